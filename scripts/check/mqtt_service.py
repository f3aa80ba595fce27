"""Checks `mbm bridge` as a service: several lines, its file, SIGHUP, texts, lists and bits, Home Assistant's discovery,
statistics, and each row of the failure drill of docs/mqtt.md."""

import json
import os
import re
import signal
import socket
import subprocess
import tempfile
import threading
import time

from gateway_service import Serial
from peers import ROOT, TcpDevice
from services import PATIENCE, Notified, Service, expect, metrics, wait


class Broker:
    """A mosquitto broker, which can go, come back and stop to read."""

    def __init__(self, folder, anonymous="true"):
        with socket.create_server(("127.0.0.1", 0)) as one:
            self.port = one.getsockname()[1]
        self.file = os.path.join(folder, f"mosquitto-{self.port}.conf")
        with open(self.file, "w") as file:
            file.write(f"listener {self.port} 127.0.0.1\nallow_anonymous {anonymous}\n")

    def come(self):
        self.process = subprocess.Popen(["mosquitto", "-c", self.file], stderr=subprocess.DEVNULL)

        def listens():
            try:
                socket.create_connection(("127.0.0.1", self.port)).close()
                return True
            except ConnectionRefusedError:
                return False

        expect("the broker begins", wait(listens))

    def go(self):
        self.process.kill()
        self.process.wait()

    def publish(self, topic, payload, *options):
        command = ["mosquitto_pub", "-p", str(self.port), "-t", topic, "-s", *options]
        subprocess.run(command, input=payload if isinstance(payload, bytes) else payload.encode(), check=True)

    def retained(self):
        """What the broker keeps: the payload of each topic."""
        self.publish("end", "end", "-r")
        command = ["mosquitto_sub", "-p", str(self.port), "-t", "#", "-F", "%t\t%p", "--retained-only", "-W", "1"]
        found = subprocess.run(command, capture_output=True, text=True)
        return dict(line.split("\t", 1) for line in found.stdout.splitlines())


class Subscriber:
    """Keeps all messages."""

    def __init__(self, broker):
        self.messages, self.last = [], {}
        self.process = subprocess.Popen(["mosquitto_sub", "-p", str(broker.port), "-t", "#", "-F", "%t\t%p"],
                                        stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self.read, daemon=True).start()
        while "probe" not in self.last:
            broker.publish("probe", "1")
            time.sleep(0.02)

    def read(self):
        for line in self.process.stdout:
            topic, payload = line.rstrip("\n").split("\t", 1)
            self.messages.append((topic, payload))
            self.last[topic] = payload

    def value(self, topic):
        try:
            return json.loads(self.last[topic])["value"]
        except (KeyError, ValueError, TypeError):
            return None

    def expect_value(self, topic, value):
        expect(f"{topic} is {value}", wait(lambda: self.value(topic) == value), self.last.get(topic))

    def expect_last(self, topic, payload):
        expect(f"{topic} is {payload!r}", wait(lambda: self.last.get(topic) == payload), self.last.get(topic))

    def end(self):
        self.process.kill()
        self.process.wait()


class Model:
    """A device with 200 holding registers and coils, and the functions 01, 03, 05, 06, 0F, 10 and 16."""

    def __init__(self):
        self.registers, self.coils = [0] * 200, [0] * 200
        self.has_masks, self.mood = True, "right"
        self.device = TcpDevice(self.answer)
        self.line = self.device.line

    def writes(self):
        """The PDUs of requests that were no reads."""
        return [bytes.fromhex(pdu) for _, pdu in self.device.asked if pdu[:2] not in ("01", "03")]

    def answer(self, pdu):
        if self.mood == "silent":
            return None
        address, word = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        if pdu[0] == 1:
            bits = self.coils[address:address + word]
            packed = bytes(sum(bit << i for i, bit in enumerate(bits[at:at + 8])) for at in range(0, word, 8))
            return bytes([1, len(packed)]) + packed
        if pdu[0] == 3:
            words = self.registers[address:address + word]
            return bytes([3, 2 * word]) + b"".join(one.to_bytes(2, "big") for one in words)
        if pdu[0] == 5:
            self.coils[address] = word >> 15
        elif pdu[0] == 6:
            self.registers[address] = word
        elif pdu[0] == 15:
            self.coils[address:address + word] = [pdu[6 + i // 8] >> i % 8 & 1 for i in range(word)]
        elif pdu[0] == 16:
            self.registers[address:address + word] = [int.from_bytes(pdu[6 + 2 * i:8 + 2 * i], "big") for i in range(word)]
        elif pdu[0] == 22 and self.has_masks:
            other = int.from_bytes(pdu[5:7], "big")
            self.registers[address] = self.registers[address] & word | other & ~word & 0xFFFF
        else:
            return bytes([pdu[0] | 0x80, 1])
        return pdu[:5] if pdu[0] != 22 else pdu


class Bench:
    def __init__(self, mbm, folder):
        self.mbm, self.folder = mbm, folder
        self.broker = Broker(folder)
        self.broker.come()

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w") as file:
            file.write(text)
        return self.path(name)

    def bridge(self, *words, **options):
        return Service(self.mbm, "bridge", "-b", f"127.0.0.1:{self.broker.port}", "-t", "hall", "--timeout", "300ms",
                       *words, **options)


def result(bench, subscriber, topic, payload, pattern):
    """Writes, and expects a result."""
    count = sum(name == f"{topic}/result" for name, _ in subscriber.messages)
    bench.broker.publish(f"{topic}/set", payload)
    found = wait(lambda: [text for name, text in list(subscriber.messages) if name == f"{topic}/result"][count:])
    expect(f"{topic} {payload}: {pattern}", found and re.fullmatch(pattern, found[0]), found)


VALUES = """\
device: pump
unit: 3
interval: 100ms
mask_write: %s
fields:
- {name: text, table: holding, address: 0, type: text, count: 10, access: read-write}
- {name: swapped, table: holding, address: 10, type: text, count: 4, order: BADC, access: read-write}
- {name: list, table: holding, address: 20, type: int16, count: 3, scale: 0.1, access: read-write}
- {name: floats, table: holding, address: 30, type: float, count: 2, order: CDAB, access: read-write}
- {name: coils, table: coils, address: 5, count: 11, access: read-write}
- {name: word, table: holding, address: 40, type: uint16}
- {name: pump, table: holding, address: 40, type: bit, bit: 3, access: %s}
- {name: mode, table: holding, address: 40, type: bit, bit: 4, count: 3, access: %s}
"""


def check_values(bench):
    """Texts, lists and bits of a register, both ways."""
    model = Model()
    model.registers[40] = 0xA5A5
    fields = bench.write("values.yaml", VALUES % ("yes", "read-write", "read-write"))
    bridge, subscriber = bench.bridge(model.line, fields), Subscriber(bench.broker)
    subscriber.expect_last("hall/status", "online")
    for topic, payload, value, words in (
        ("text", "na\u00efve", "na\u00efve", {0: 0x6E61, 1: 0xEF76, 2: 0x6500, 3: 0}),
        ("text", '{"value":"a\\"b"}', 'a"b', {0: 0x6122, 1: 0x6200}),
        ("swapped", "AB", "AB", {10: 0x4241, 11: 0}),
        ("list", "[1.5,-0.1,0]", [1.5, -0.1, 0], {20: 15, 21: 0xFFFF, 22: 0}),
        ("list", "3,2,1", [3, 2, 1], {20: 30, 22: 10}),
        ("floats", '{"value":[1,-2]}', [1, -2], {30: 0, 31: 0x3F80, 32: 0, 33: 0xC000}),
    ):
        result(bench, subscriber, f"hall/{topic}", payload, "success")
        subscriber.expect_value(f"hall/{topic}", value)
        expect("the registers", all(model.registers[at] == word for at, word in words.items()), model.registers[:44])
    bits = [i % 3 == 0 for i in range(11)]
    result(bench, subscriber, "hall/coils", json.dumps(bits), "success")
    subscriber.expect_value("hall/coils", bits)
    expect("the coils", model.coils[4:17] == [0, *map(int, bits), 0], model.coils[:20])
    before = len(model.writes())
    for topic, payload, pattern in (
        ("text", "12345678901", "the text is longer than the field"), ("text", "\u20ac", ".* not in Latin-1"),
        ("list", "1,2", "the payload is no list of 3 values"), ("list", "1,2,3.33", "value 3: .* multiple of the scale"),
        ("coils", "1,0", "the payload is no list of 11 values"), ("text", "x" * 3001, "the payload is too long"),
        ("mode", "8", "the number is out of range"), ("pump", "2", "the number is out of range"),
        ("pump", "maybe", "the payload is no number"),
    ):
        result(bench, subscriber, f"hall/{topic}", payload, pattern)
    expect("nothing was sent for them", len(model.writes()) == before, model.writes()[before:])

    # Bits are written by function 22 alone, which no read precedes.
    for topic, payload, value, pdu, register in (
        ("pump", "ON", True, "16 0028 fff7 0008", 0xA5AD), ("pump", "false", False, "16 0028 fff7 0000", 0xA5A5),
        ("mode", "5", 5, "16 0028 ff8f 0050", 0xA5D5), ("mode", '{"value":2}', 2, "16 0028 ff8f 0020", 0xA5A5),
    ):
        before = len(model.writes())
        result(bench, subscriber, f"hall/{topic}", payload, "success")
        expect(f"{topic} is written by one request 22", model.writes()[before:] == [bytes.fromhex(pdu)], model.writes())
        expect("the other bits stay", model.registers[40] == register, hex(model.registers[40]))
        subscriber.expect_value(f"hall/{topic}", value)
    model.has_masks = False
    before = len(model.writes())
    result(bench, subscriber, "hall/pump", "ON", "exception 01: illegal function")
    expect("a device without function 22 gets no other request", len(model.writes()) == before + 1, model.writes())

    # A device that has no function 22, as its file says.
    bench.write("values.yaml", VALUES % ("no", "read", "read"))
    bridge.reload(r"^info: the files are in force\. Lines kept: 0, with a new device file: 1, removed: 0, added: 0\.$")
    result(bench, subscriber, "hall/pump", "ON", "the field is not writable: bits of a register need \"mask_write: yes\".*")
    expect("nothing was sent", len(model.writes()) == before + 1, model.writes())
    bench.write("values.yaml", VALUES % ("no", "read-write", "read"))
    bridge.reload(r"^error: .*values\.yaml:12: access is read-write: bits of a register cannot be written, unless the "
                  r"device has function 22 and the file says \"mask_write: yes\"\. The files before stay in force\.$")
    expect("mbm poll shows texts and lists", poll(bench, model) == {
        "text": 'a"b', "swapped": "AB", "list": [3, 2, 1], "floats": [1, -2], "coils": bits})
    bridge.end()
    subscriber.end()
    model.device.go()


def poll(bench, model):
    fields = bench.write("poll.yaml", VALUES % ("no", "read", "read"))
    found = subprocess.run([bench.mbm, "poll", model.line, fields, "--once", "--json"], capture_output=True, text=True)
    rows = {row["name"]: row["value"] for row in map(json.loads, found.stdout.splitlines())}
    return {name: rows.get(name) for name in ("text", "swapped", "list", "floats", "coils")}


FIELDS = """\
device: %s
unit: %d
interval: 100ms
fields:
- {name: level, table: holding, address: 0, type: uint16, access: read-write}
- {name: speed, table: holding, address: 1, type: uint16}
"""


def numbers(first, second):
    model = Model()
    model.registers[:2] = [first, second]
    return model


def check_several_lines(bench):
    """Pairs on the command line: a topic for each."""
    one, two = numbers(1, 2), numbers(3, 4)
    meter, pump = bench.write("meter.yaml", FIELDS % ("meter", 1)), bench.write("pump.yaml", FIELDS % ("pump", 1))
    bridge = bench.bridge(one.line, meter, two.line, pump, "--metrics", "127.0.0.1:0")
    subscriber = Subscriber(bench.broker)
    # The bridge takes writes from then on.
    subscriber.expect_last("hall/status", "online")
    for topic, value in (("meter/level", 1), ("meter/speed", 2), ("pump/level", 3), ("pump/speed", 4)):
        subscriber.expect_value(f"hall/{topic}", value)
    subscriber.expect_last("hall/meter/unit/1/status", "online")
    subscriber.expect_last("hall/pump/unit/1/status", "online")
    result(bench, subscriber, "hall/pump/level", "30", "success")
    subscriber.expect_value("hall/pump/level", 30)
    expect("only that device is written", (one.registers[0], two.registers[0]) == (1, 30))
    for topic in ("hall/pump/none", "hall/meter/level/high"):
        result(bench, subscriber, topic, "1", "there is no such field")
    port = int(bridge.await_line(r"metrics are at port (\d+)").split()[-2].rstrip(","))
    found = metrics(port)
    expect("the metrics have each line", found["mbm_bridge_line_up", "meter"] == 1
           and found["mbm_bridge_requests_total", "pump"] > 1 and found["mbm_bridge_mqtt_connected", None] == 1
           and found["mbm_bridge_writes_total", None] == 1 and found["mbm_bridge_mqtt_publishes_total", None] > 6, found)
    bridge.end()
    subscriber.end()
    for words, reason in (
        ([one.line, meter, two.line, meter], 'the topic "meter" of the line is, or begins, or goes on, the topic "meter"'),
        ([one.line, meter, two.line], "a bridge needs LINE and FILE"),
    ):
        found = subprocess.run([bench.mbm, "bridge", *words], capture_output=True, text=True, timeout=PATIENCE)
        expect(f"{reason}", found.returncode == 2 and reason in found.stderr, found.stderr)
    for model in (one, two):
        model.device.go()


WRONG = [
    ("", "the file is empty"),
    ("topic: hall\n", ":1: the file has no key lines"),
    ("lines: []\n", ":1: lines is empty"),
    ("broker: [1]\nlines: []\n", ":1: broker is a list: it must be one word"),
    ("broker: a:b:c\nlines: []\n", ':1: broker: "a:b:c" is not HOST or HOST:PORT'),
    ("broker: host:0\nlines: []\n", ":1: broker: its port"),
    ("topic: a/#\nlines: []\n", ':1: topic: "a/#" is not 1 to 200 bytes'),
    ("keep_alive: 1s\nlines: []\n", ":1: keep_alive: \"1s\" is out of range"),
    ("discovery: other\nlines: []\n", ':1: discovery: "other" is not one of homeassistant'),
    ("discovery_prefix: ha\nlines: []\n", ":1: a prefix of discovery needs discovery"),
    ("plain: true\nlines: []\n", ':1: plain: "true" is not one of no and yes'),
    ("gap: 124\nlines: []\n", "from 0 to 123 is allowed"),
    ("gap: 010\nlines: []\n", ':1: gap: "010" begins with 0: write a decimal number'),
    ("cert: a\nlines: []\n", "cert and key need ca"),
    ("host: a\nlines: []\n", ':1: key: "host" is not one of broker, topic'),
    ("lines:\n- {line: rtu:/dev/null}\n", ":2: the line has no key file"),
    ("lines:\n- {file: meter.yaml}\n", ":2: the line has no key line"),
    ("lines:\n- {line: /dev/null, file: meter.yaml}\n", ':2: "/dev/null" is not a line'),
    ("lines:\n- {line: rtu:/dev/null, file: meter.yaml, topic: a/set}\n", ':2: the topic "a/set" of the line'),
    ("lines:\n- {line: rtu:/a, file: meter.yaml}\n- {line: rtu:/b, file: meter.yaml}\n",
     ':3: the topic "meter" of the line is, or begins, or goes on'),
    ("lines:\n- {line: rtu:/dev/null, file: none.yaml}\n", "none.yaml: No such file or directory"),
    ("lines:\n- {line: rtu:/dev/null, file: wrong.yaml}\n", "wrong.yaml:1: key:"),
]


def check_wrong_files(bench):
    bench.write("meter.yaml", FIELDS % ("meter", 1))
    bench.write("wrong.yaml", "wrong: 1\n")
    for text, reason in WRONG:
        path = bench.write("bridge.yaml", text)
        for options in ([], ["--check"]):
            found = subprocess.run([bench.mbm, "bridge", *options, path], capture_output=True, text=True, timeout=PATIENCE)
            expect(f"{text!r}: {reason}", found.returncode in (1, 2) and reason in found.stderr, found.stderr)
    path = bridge_file(bench, ("rtu:/dev/no-such-line", "file: meter.yaml"))
    found = subprocess.run([bench.mbm, "bridge", "--check", path], capture_output=True, text=True, timeout=PATIENCE)
    expect("--check ends without a word", (found.returncode, found.stdout, found.stderr) == (0, "", ""), found)


def bridge_file(bench, *lines, head=""):
    text = f"broker: 127.0.0.1:{bench.broker.port}\ntopic: hall\n{head}lines:\n"
    return bench.write("bridge.yaml", text + "".join(f'- {{line: "{line}", {more}}}\n' for line, more in lines))


def check_reload(bench):
    """The broker and lines that stay the same notice nothing; what is gone is no longer retained."""
    one, two, three = numbers(1, 2), numbers(3, 4), numbers(5, 6)
    bench.write("meter.yaml", FIELDS % ("meter", 1))
    bench.write("pump.yaml", FIELDS % ("pump", 2))
    notified = Notified(bench.folder)
    path = bridge_file(bench, (one.line, "file: meter.yaml"), (two.line, "file: pump.yaml, topic: north/pump"),
                       head="discovery: homeassistant\n")
    bridge = Service(bench.mbm, "bridge", path, "--stats", bench.path("stats.json"), "--all",
                     env={"NOTIFY_SOCKET": notified.path})
    notified.expect("READY=1")
    subscriber = Subscriber(bench.broker)
    subscriber.expect_last("hall/status", "online")
    subscriber.expect_value("hall/meter/level", 1)
    subscriber.expect_value("hall/north/pump/speed", 4)
    connections = len(one.device.peers), len(two.device.peers)

    # Of the second device one field leaves, one changes and one is new.
    bench.write("pump.yaml", (FIELDS % ("pump", 2)).replace("name: level", "name: height").replace("}", ", unit_of_measurement: m}", 1))
    bridge.reload(r"^info: the files are in force\. Lines kept: 1, with a new device file: 1, removed: 0, added: 0\.$")
    notified.expect("RELOADING=1")
    notified.expect("READY=1")
    subscriber.expect_value("hall/north/pump/height", 3)
    subscriber.expect_last("hall/north/pump/level", "")
    subscriber.expect_last("homeassistant/number/hall_north_pump_%08x/level/config" % fnv("hall/north/pump"), "")
    result(bench, subscriber, "hall/north/pump/height", "33", "success")
    result(bench, subscriber, "hall/north/pump/level", "33", "there is no such field")
    expect("both lines keep their connections", (len(one.device.peers), len(two.device.peers)) == connections)

    # A line is removed and another added, while a write is pending.
    two.mood = "silent"
    wait(lambda: subscriber.last.get("hall/north/pump/unit/2/status") == "offline")
    bridge_file(bench, (three.line, "file: pump.yaml, topic: south/pump"), (one.line, "file: meter.yaml"),
                head="discovery: homeassistant\n")
    bridge.reload(r"^info: the files are in force\. Lines kept: 1, with a new device file: 0, removed: 1, added: 1\.$")
    subscriber.expect_value("hall/south/pump/height", 5)
    result(bench, subscriber, "hall/south/pump/height", "55", "success")
    result(bench, subscriber, "hall/meter/level", "11", "success")
    kept = bench.broker.retained()
    expect("nothing of the removed line is retained", not any("north" in topic for topic in kept), kept)
    wanted = {"hall/status", "hall/meter/level", "hall/meter/speed", "hall/meter/unit/1/status",
              "hall/south/pump/height", "hall/south/pump/speed", "hall/south/pump/unit/2/status"}
    found = {topic for topic in kept if topic.startswith("hall/")}
    expect("all of the others is", found == wanted, found ^ wanted)
    expect("the broker stays connected", sum("is connected" in line for line in bridge.log) == 1, bridge.log)

    # Files that are wrong, or that need a restart.
    bench.write("meter.yaml", "fields: []\n")
    bridge.reload(r"^error: .*meter\.yaml:1: fields is empty\. The files before stay in force\.$")
    bench.write("meter.yaml", FIELDS % ("meter", 1))
    bridge_file(bench, (one.line, "file: meter.yaml"), head="topic: other\n")
    bridge.reload(r"^error: .*bridge\.yaml:3: topic is there twice, first in line 2\. The files before")
    bridge_file(bench, (one.line, "file: meter.yaml"), head="plain: yes\n")
    bridge.reload(r"^error: .*: discovery has changed, which needs a restart\. The files before stay in force\.$")
    result(bench, subscriber, "hall/south/pump/height", "56", "success")
    bridge.signal(signal.SIGUSR1)
    wait(lambda: os.path.exists(bench.path("stats.json")))
    found = json.load(open(bench.path("stats.json")))
    expect("the statistics", (found["command"], found["reloads"], found["reload_failures"], found["mqtt_connects"],
                              [line["line"] for line in found["lines"]])
           == ("bridge", 2, 3, 1, ["south/pump", "meter"]), f"{found}\n" + "\n".join(bridge.log))
    bridge.end()
    subscriber.end()
    for model in (one, two, three):
        model.device.go()


def fnv(text):
    digest = 0x811C9DC5
    for byte in text.encode():
        digest = (digest ^ byte) * 0x01000193 & 0xFFFFFFFF
    return digest


DISCOVERED = """\
device: heat pump
unit: 3
interval: 100ms
mask_write: yes
fields:
- {name: flow, table: input, address: 0, type: float, unit_of_measurement: l/min}
- {name: setpoint, table: holding, address: 1, type: int16, scale: 0.5, unit_of_measurement: "\u00b0C", access: read-write}
- {name: energy, table: holding, address: 2, type: uint32, scale: 0.0001, access: read-write}
- {name: alarm, table: discrete, address: 0}
- {name: pump/runs, table: coils, address: 0, access: read-write}
- {name: eco, table: holding, address: 10, type: bit, bit: 2, access: read-write}
- {name: mode, table: holding, address: 10, type: bit, bit: 4, count: 3, access: read-write}
- {name: label, table: holding, address: 20, type: text, count: 16, access: read-write}
- {name: serial, table: holding, address: 30, type: text, count: 16}
- {name: phases, table: holding, address: 40, type: uint16, count: 3, unit_of_measurement: V}
- {name: curve, table: holding, address: 50, type: uint16, count: 3, access: read-write}
- {name: state, table: input, address: 60, type: uint16, unit_of_measurement: "-", enumeration: {0: off, 1: on, 7: "5\\" \u00bd"}}
- {name: program, table: holding, address: 61, type: int16, enumeration: {-1: auto, 3: party}, access: read-write}
- {name: reset, table: coils, address: 1, access: write}
- {name: other, unit: 4, table: holding, address: 0, type: double, access: write}
"""

# The schemas of Home Assistant's documentation of MQTT entities: the keys that a component may have, and their types.
COMMON = {"name": str, "unique_id": str, "availability": list, "availability_mode": str, "device": dict, "origin": dict,
          "state_topic": str, "value_template": str}
SCHEMAS = {
    "sensor": ({"unit_of_measurement": str, "device_class": str, "options": list}, {"state_topic"}),
    "select": ({"command_topic": str, "command_template": str, "options": list}, {"command_topic", "options"}),
    "binary_sensor": ({"payload_on": str, "payload_off": str}, {"state_topic"}),
    "switch": ({"command_topic": str, "payload_on": str, "payload_off": str, "state_on": str, "state_off": str},
               {"command_topic"}),
    "number": ({"command_topic": str, "min": float, "max": float, "step": float, "mode": str,
                "unit_of_measurement": str}, {"command_topic"}),
    "text": ({"command_topic": str, "max": int, "command_template": str}, {"command_topic"}),
}
DEVICE = {"identifiers": list, "name": str, "model": str}
TOPIC = re.compile(r"homeassistant/([a-z_]+)/[a-zA-Z0-9_-]+/[a-zA-Z0-9_-]+/config")


def is_a(value, kind):
    return isinstance(value, (int, float)) if kind is float else isinstance(value, kind)


def check_schema(topic, config):
    """As Home Assistant would check it. Returns the component."""
    match = TOPIC.fullmatch(topic)
    component = match.group(1) if match else None
    expect(f"{topic} is a topic of discovery", component in SCHEMAS, topic)
    optional, needed = SCHEMAS[component]
    keys = {**COMMON, **optional}
    expect(f"{topic} has keys of its schema alone", all(key in keys and is_a(value, keys[key]) for key, value in config.items()), config)
    expect(f"{topic} has what its schema needs", needed | {"unique_id", "device", "availability"} <= set(config), config)
    block = config["device"]
    expect("the device has an identifier and keys of its schema", block["identifiers"]
           and all(key in DEVICE and is_a(value, DEVICE[key]) for key, value in block.items()), block)
    expect("availability is a list of topics", all(set(one) == {"topic"} for one in config["availability"])
           and config["availability_mode"] == "all", config)
    if component == "number":
        expect("a number has a range and a step that Home Assistant takes",
               config["min"] < config["max"] and config["step"] >= 0.001 and config["mode"] == "box", config)
    if component == "text" and "max" in config:
        expect("a text has a length that Home Assistant takes", 0 < config["max"] <= 255, config)
    return component


def check_discovery(bench):
    model = Model()
    fields = bench.write("heat.yaml", DISCOVERED)
    bridge = bench.bridge("--discovery", "homeassistant", model.line, fields)
    subscriber = Subscriber(bench.broker)
    subscriber.expect_last("hall/status", "online")
    wait(lambda: subscriber.value("hall/label") is not None)
    kept = bench.broker.retained()
    configs = {topic: json.loads(text) for topic, text in kept.items() if topic.startswith("homeassistant/")}
    components = {config["name"]: (check_schema(topic, config), config) for topic, config in configs.items()}
    expect("each field is there", {name: one[0] for name, one in components.items()} == {
        "flow": "sensor", "setpoint": "number", "energy": "number", "alarm": "binary_sensor", "pump/runs": "switch",
        "eco": "switch", "mode": "number", "label": "text", "serial": "sensor", "phases": "sensor", "curve": "text",
        "state": "sensor", "program": "select", "reset": "switch", "other": "number"}, components)
    expect("no identifier is there twice", len({config["unique_id"] for config in configs.values()}) == len(configs))
    get = lambda name, *keys: tuple(components[name][1].get(key) for key in keys)
    for found, wanted in (
        (get("flow", "state_topic", "unit_of_measurement", "value_template"),
         ("hall/flow", "l/min", "{{ value_json.value }}")),
        (get("setpoint", "command_topic", "min", "max", "step", "unit_of_measurement"),
         ("hall/setpoint/set", -16384, 16383.5, 0.5, "\u00b0C")),
        (get("energy", "min", "step"), (0, 0.001)),
        (get("mode", "min", "max"), (0, 7)),
        (get("pump/runs", "payload_on", "payload_off", "state_on", "state_off"), ("ON", "OFF", "True", "False")),
        (get("alarm", "payload_on", "payload_off"), ("True", "False")),
        (get("reset", "state_topic", "value_template"), (None, None)),
        (get("serial", "value_template"), ("{{ value_json.value or '' }}",)),
        (get("label", "max", "command_template"), (16, "{{ value | to_json }}")),
        (get("phases", "unit_of_measurement"), (None,)),
        (get("state", "device_class", "options", "unit_of_measurement"), ("enum", ["off", "on", "5\" \u00bd"], None)),
        (get("state", "value_template"), ('{{ {0: "off", 1: "on", 7: "5\\" \u00bd"}.get(value_json.value) }}',)),
        (get("program", "options", "value_template", "command_template"),
         (["auto", "party"], '{{ {-1: "auto", 3: "party"}.get(value_json.value) }}', '{{ {"auto": -1, "party": 3}[value] }}')),
        (get("flow", "availability"), ([{"topic": "hall/status"}, {"topic": "hall/unit/3/status"}],)),
        (get("other", "availability"), ([{"topic": "hall/status"}],)),
        (get("flow", "device"), ({"identifiers": ["mbm_hall_3"], "name": "heat pump unit 3", "model": "heat pump"},)),
    ):
        expect(f"{wanted}", found == wanted, found)
    # What Home Assistant publishes as these configs say is taken.
    for topic, payload in (("pump/runs", "ON"), ("eco", "OFF"), ("setpoint", "21.5"), ("mode", "5"), ("program", "-1"), ("label", '"hall 1"')):
        result(bench, subscriber, components[topic][1]["command_topic"].removesuffix("/set"), payload, "success")
    subscriber.expect_value("hall/label", "hall 1")

    # Two fields leave, and one becomes another component.
    text = DISCOVERED.replace("- {name: eco", "#").replace("- {name: flow", "#").replace("count: 3, access: read-write}\n- {name: label", "count: 3}\n- {name: label")
    bench.write("heat.yaml", text)
    bridge.reload("the files are in force")
    for topic in ("sensor/hall/flow", "switch/hall/eco", "number/hall/mode"):
        subscriber.expect_last(f"homeassistant/{topic}/config", "")
    wait(lambda: "homeassistant/sensor/hall/mode/config" in subscriber.last)
    kept = {topic for topic in bench.broker.retained() if topic.startswith("homeassistant/")}
    wanted = {topic for topic in configs if "/eco/" not in topic and "/flow/" not in topic and "/mode/" not in topic}
    expect("what leaves is removed, and the rest stays", kept == wanted | {"homeassistant/sensor/hall/mode/config"}, kept)
    bridge.end()
    bridge = bench.bridge("--discovery", "homeassistant", "--discovery-prefix", "ha", "--plain", model.line, fields)
    expect("the name of a number in a plain payload",
           wait(lambda: '{\\"0\\": \\"off\\", ' in subscriber.last.get("ha/sensor/hall/state/config", "")))
    expect("another prefix, and plain payloads",
           wait(lambda: "state_on\":\"1\"" in subscriber.last.get("ha/switch/hall/pump_runs_%08x/config" % fnv("pump/runs"), "")))
    bridge.end()
    subscriber.end()
    model.device.go()


def check_drill(bench):
    """Each row of the failure drill of docs/mqtt.md that is not checked above."""
    serial, model = Serial(bench.folder), numbers(1, 2)
    bench.write("meter.yaml", FIELDS % ("meter", 7))
    bench.write("pump.yaml", FIELDS % ("pump", 2))
    bench.broker.go()
    path = bridge_file(bench, (f"rtu:{serial.path}?baud=115200", "file: meter.yaml"), (model.line, "file: pump.yaml"),
                       head="keep_alive: 5s\n")
    bridge = Service(bench.mbm, "bridge", path, "--timeout", "300ms", "--stats", "/dev/full", "--stats-every", "200ms")
    broker = f"the broker 127\\.0\\.0\\.1:{bench.broker.port}"
    bridge.expect_line("no broker at first", rf"^warning: {broker} cannot be reached\. The bridge reads on, and tries it again\.$")
    bridge.expect_line("the disk is full", r"^error: /dev/full: No space left on device\. The statistics are not written\.$")
    bench.broker.come()
    bridge.expect_line("the broker", rf"^info: {broker} is connected\.$")
    subscriber = Subscriber(bench.broker)
    subscriber.expect_last("hall/status", "online")
    subscriber.expect_value("hall/meter/level", 7)
    subscriber.expect_value("hall/pump/level", 1)

    since = len(bridge.log)
    serial.pull_out()
    bridge.expect_line("the cable is pulled", r"^warning: rtu:.*\. The line is opened again each second\.$", since)
    subscriber.expect_last("hall/meter/unit/7/status", "offline")
    result(bench, subscriber, "hall/meter/level", "1", "the link was lost.*|.*link.*")
    model.registers[1] = 22
    subscriber.expect_value("hall/pump/speed", 22)
    serial.plug_in()
    bridge.expect_line("the cable is back", r"^info: rtu:.*: the line is open again\.$", since)
    subscriber.expect_last("hall/meter/unit/7/status", "online")

    for mood, status in (("silent", "no complete reply in time"), ("damaged", "CRC")):
        since, serial.mood = len(bridge.log), mood
        bridge.expect_line(f"a {mood} device", rf"^warning: rtu:.*: unit 7 does not answer: .*{status}.*\.$", since)
        subscriber.expect_last("hall/meter/unit/7/status", "offline")
        expect("its values have the status", wait(lambda: status in subscriber.last["hall/meter/level"]), subscriber.last)
        serial.mood = "right"
        bridge.expect_line("the device", r"^info: rtu:.*: unit 7 answers\.$", since)
        subscriber.expect_last("hall/meter/unit/7/status", "online")

    since = len(bridge.log)
    bench.broker.go()
    bridge.expect_line("the broker goes", rf"^warning: {broker} is lost: .*\. The bridge connects again\.$", since)
    bridge.expect_line("and stays away", rf"^warning: {broker} cannot be reached\.", since)
    model.registers[1] = 23
    bench.broker.come()
    bridge.expect_line("the broker is back", rf"^info: {broker} is connected\.$", since)
    subscriber.end()
    subscriber = Subscriber(bench.broker)
    subscriber.expect_value("hall/pump/speed", 23)
    subscriber.expect_last("hall/status", "online")

    # A broker that takes nothing more: after the keep-alive time it is lost.
    since = len(bridge.log)
    bench.broker.process.send_signal(signal.SIGSTOP)
    bridge.expect_line("the broker hangs", rf"^warning: {broker} is lost: .*\. The bridge connects again\.$", since)
    model.registers[1] = 24
    bench.broker.process.send_signal(signal.SIGCONT)
    bridge.expect_line("the broker goes on", rf"^info: {broker} is connected\.$", since)
    subscriber.expect_value("hall/pump/speed", 24)
    bridge.end()
    subscriber.expect_last("hall/status", "offline")
    subscriber.end()

    strict = Broker(bench.folder, "false")
    strict.come()
    bridge = Service(bench.mbm, "bridge", "-b", f"127.0.0.1:{strict.port}", model.line, bench.path("pump.yaml"))
    bridge.expect_line("a broker that refuses", r"^error: the broker .* refuses: Connection Refused: not authorised\.$")
    bridge.end()
    strict.go()
    model.device.go()


def check_connections(bench):
    """Devices that close idle connections, or answer no more on one that stays open."""
    idle, silent = numbers(1, 2), numbers(3, 4)
    idle.device.idle, silent.device.answers = 0.2, 3
    bench.write("idle.yaml", (FIELDS % ("idle", 1)).replace("100ms", "500ms"))
    bench.write("silent.yaml", (FIELDS % ("silent", 1)).replace("100ms", "300ms"))
    path = bridge_file(bench, (idle.line, "file: idle.yaml, topic: idle"), (silent.line, "file: silent.yaml, topic: silent"))
    bridge = Service(bench.mbm, "bridge", path, "--timeout", "300ms", "--all")
    subscriber = Subscriber(bench.broker)
    subscriber.expect_last("hall/status", "online")
    subscriber.expect_value("hall/idle/level", 1)
    for value in range(10, 26):
        result(bench, subscriber, "hall/idle/level", str(value), "success")
        time.sleep(0.25)

    def readings(name):
        return [json.loads(text) for topic, text in list(subscriber.messages) if topic == f"hall/{name}"]

    expect("each round reads a device that closes idle connections", len(readings("idle/level")) > 8
           and {one["status"] for one in readings("idle/level")} == {"success"}, readings("idle/level"))
    expect("each write is sent once", len(idle.writes()) == 16, idle.writes())
    wait(lambda: len(readings("silent/level")) > 20)
    statuses = [one["status"] == "success" for one in readings("silent/level")]
    expect("a silent device is heard again", sum(statuses) > 8, statuses)
    expect("two requests fail in a row", "000" not in "".join(str(int(one)) for one in statuses), statuses)
    expect("a connection that was closed is not reported", not [line for line in bridge.log if idle.line in line and "answers" not in line],
           bridge.log)
    expect("a silent connection is reported once", sum("The connection is made anew" in line for line in bridge.log) == 1,
           bridge.log)
    bridge.end()
    subscriber.end()
    idle.device.go()
    silent.device.go()


def check_example(bench):
    """The example that is installed."""
    folder = os.path.join(ROOT, "examples/services")
    with open(os.path.join(folder, "pump.yaml")) as file:
        bench.write("pump.yaml", file.read())
    with open(os.path.join(folder, "bridge.yaml")) as file:
        text = file.read()
    text = text.replace("broker.local", f"127.0.0.1:{bench.broker.port}").replace("192.168.0.7", "127.0.0.1:1")
    bridge = Service(bench.mbm, "bridge", bench.write("bridge.yaml", text))
    bridge.expect_line("the example", "is connected")
    bridge.end()


def check_service(mbm):
    with tempfile.TemporaryDirectory() as folder:
        for check in (check_values, check_several_lines, check_wrong_files, check_reload, check_discovery, check_drill,
                      check_connections, check_example):
            # Each has a broker of its own, which retains nothing.
            bench = Bench(mbm, folder)
            check(bench)
            bench.broker.go()
