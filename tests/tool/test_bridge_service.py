"""mbm bridge as a service: several lines, its file, SIGHUP, texts, lists and bits, Home Assistant's discovery, statistics, and
each row of the failure drill of docs/mqtt.md."""

import json
import os
import re
import signal
import time

import pytest
from home import component_of
from peers import ROOT, WRONG, TcpDevice, wait
from services import Broker, Notified, Subscriber, metrics


class Model:
    """A device with 200 holding registers and coils, and the functions 01, 03, 05, 06, 0F, 10 and 16."""

    def __init__(self, *registers):
        self.registers, self.coils = [*registers, *[0] * (200 - len(registers))], [0] * 200
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


@pytest.fixture
def broker(folder):
    return Broker(folder).come()


@pytest.fixture
def begin(mbm, broker):
    def begin(*words, **options):
        """A bridge to the broker whose lines and files are words."""
        return mbm.begin("bridge", "-b", broker.place, "-t", "hall", "--timeout", "300ms", *words, **options)

    return begin


@pytest.fixture
def setting(broker, write):
    """Writes the file of a bridge, of lines `(place, other keys)`; returns its path."""

    def setting(*lines, head=""):
        rows = (f'- {{line: "{place}", {more}}}\n' for place, more in lines)
        return write("bridge.yaml", f"broker: {broker.place}\ntopic: hall\n{head}lines:\n" + "".join(rows))

    return setting


def subscribed(broker):
    """A subscriber, once the bridge takes writes."""
    subscriber = Subscriber(broker)
    subscriber.expect_last("hall/status", "online")
    return subscriber


# --- texts, lists and bits of a register, both ways

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


@pytest.fixture
def pump(broker, begin, write):
    """A device with the fields of VALUES, its bridge, and a subscriber."""
    model = Model()
    model.registers[40] = 0xA5A5
    model.bridge = begin(model.line, write("values.yaml", VALUES % ("yes", "read-write", "read-write")))
    model.subscriber = subscribed(broker)
    return model


def test_texts_and_lists_are_written_and_published(mbm, pump, write):
    subscriber = pump.subscriber
    for topic, payload, value, words in (
        ("text", "na\u00efve", "na\u00efve", {0: 0x6E61, 1: 0xEF76, 2: 0x6500, 3: 0}),
        ("text", '{"value":"a\\"b"}', 'a"b', {0: 0x6122, 1: 0x6200}),
        ("swapped", "AB", "AB", {10: 0x4241, 11: 0}),
        ("list", "[1.5,-0.1,0]", [1.5, -0.1, 0], {20: 15, 21: 0xFFFF, 22: 0}),
        ("list", "3,2,1", [3, 2, 1], {20: 30, 22: 10}),
        ("floats", '{"value":[1,-2]}', [1, -2], {30: 0, 31: 0x3F80, 32: 0, 33: 0xC000}),
    ):
        subscriber.expect_result(f"hall/{topic}", payload, "success")
        subscriber.expect_value(f"hall/{topic}", value)
        assert {at: pump.registers[at] for at in words} == words
    bits = [i % 3 == 0 for i in range(11)]
    subscriber.expect_result("hall/coils", json.dumps(bits), "success")
    subscriber.expect_value("hall/coils", bits)
    assert pump.coils[4:17] == [0, *map(int, bits), 0]
    # mbm poll shows them too.
    found = mbm("poll", pump.line, write("poll.yaml", VALUES % ("no", "read", "read")), "--once", "--json")
    rows = {row["name"]: row["value"] for row in map(json.loads, found.out.splitlines())}
    assert {name: rows[name] for name in ("text", "swapped", "list", "floats", "coils")} == {
        "text": 'a"b', "swapped": "AB", "list": [3, 2, 1], "floats": [1, -2], "coils": bits}


def test_of_a_payload_that_does_not_fit_its_field_nothing_is_sent(pump):
    for topic, payload, pattern in (
        ("text", "12345678901", "the text is longer than the field"), ("text", "\u20ac", ".* not in Latin-1"),
        ("list", "1,2", "the payload is no list of 3 values"), ("list", "1,2,3.33", "value 3: .* multiple of the scale"),
        ("coils", "1,0", "the payload is no list of 11 values"), ("text", "x" * 3001, "the payload is too long"),
        ("mode", "8", "the number is out of range"), ("pump", "2", "the number is out of range"), ("pump", "maybe", "the payload is no number"),
    ):
        pump.subscriber.expect_result(f"hall/{topic}", payload, pattern)
    assert pump.writes() == []


def test_bits_are_written_by_one_request_22_and_the_others_stay(pump):
    for topic, payload, value, pdu, register in (
        ("pump", "ON", True, "16 0028 fff7 0008", 0xA5AD), ("pump", "false", False, "16 0028 fff7 0000", 0xA5A5),
        ("mode", "5", 5, "16 0028 ff8f 0050", 0xA5D5), ("mode", '{"value":2}', 2, "16 0028 ff8f 0020", 0xA5A5),
    ):
        before = len(pump.writes())
        pump.subscriber.expect_result(f"hall/{topic}", payload, "success")
        assert pump.writes()[before:] == [bytes.fromhex(pdu)]
        assert pump.registers[40] == register
        pump.subscriber.expect_value(f"hall/{topic}", value)


def test_a_device_without_function_22_gets_no_other_request(pump, write):
    pump.has_masks = False
    pump.subscriber.expect_result("hall/pump", "ON", "exception 01: illegal function")
    assert len(pump.writes()) == 1
    # Its file says so.
    write("values.yaml", VALUES % ("no", "read", "read"))
    pump.bridge.reload(r"^info: the files are in force\. Lines kept: 0, with a new device file: 1, removed: 0, added: 0\.$")
    pump.subscriber.expect_result("hall/pump", "ON", "the field is not writable: bits of a register need \"mask_write: yes\".*")
    assert len(pump.writes()) == 1
    write("values.yaml", VALUES % ("no", "read-write", "read"))
    pump.bridge.reload(r"^error: .*values\.yaml:12: access is read-write: bits of a register cannot be written, unless the "
                       r"device has function 22 and the file says \"mask_write: yes\"\. The files before stay in force\.$")


# --- several lines, and files

FIELDS = """\
device: %s
unit: %d
interval: 100ms
fields:
- {name: level, table: holding, address: 0, type: uint16, access: read-write}
- {name: speed, table: holding, address: 1, type: uint16}
"""


@pytest.mark.parametrize("word, payload", [("yes", "1"), ("true", "1"), ("no", None), ("false", None)])
def test_a_file_says_yes_or_true_and_no_or_false(mbm, broker, begin, write, word, payload):
    model, meter = Model(1, 2), write("meter.yaml", FIELDS % ("meter", 1))
    begin(write("bridge.yaml", f"plain: {word}\nlines: [{{line: '{model.line}', file: {meter}}}]\n"))
    subscriber = subscribed(broker)
    assert wait(lambda: any(topic.endswith("/level") for topic in subscriber.last))
    last = next(text for topic, text in subscriber.last.items() if topic.endswith("/level"))
    assert last == payload if payload else json.loads(last)["value"] == 1


def test_each_pair_on_the_command_line_has_a_topic(mbm, broker, begin, write):
    one, two = Model(1, 2), Model(3, 4)
    meter, pump = write("meter.yaml", FIELDS % ("meter", 1)), write("pump.yaml", FIELDS % ("pump", 1))
    bridge = begin(one.line, meter, two.line, pump, "--metrics", "127.0.0.1:0")
    subscriber = subscribed(broker)
    for topic, value in (("meter/level", 1), ("meter/speed", 2), ("pump/level", 3), ("pump/speed", 4)):
        subscriber.expect_value(f"hall/{topic}", value)
    subscriber.expect_last("hall/meter/unit/1/status", "online")
    subscriber.expect_last("hall/pump/unit/1/status", "online")
    subscriber.expect_result("hall/pump/level", "30", "success")
    subscriber.expect_value("hall/pump/level", 30)
    assert (one.registers[0], two.registers[0]) == (1, 30)
    for topic in ("hall/pump/none", "hall/meter/level/high"):
        subscriber.expect_result(topic, "1", "there is no such field")
    found = metrics(bridge)
    assert found["mbm_bridge_line_up", "meter"] == found["mbm_bridge_mqtt_connected", None] == found["mbm_bridge_writes_total", None] == 1
    assert found["mbm_bridge_requests_total", "pump"] > 1 and found["mbm_bridge_mqtt_publishes_total", None] > 6
    mbm.fails(WRONG, 'the topic "meter" of the line is, or begins, or goes on, the topic "meter"', "bridge", one.line, meter, two.line, meter)
    mbm.fails(WRONG, "a bridge needs LINE and FILE", "bridge", one.line, meter, two.line)


@pytest.mark.parametrize("text, sentence", [
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
    ("plain: 1\nlines: []\n", ':1: plain: "1" is not one of no, yes, false and true'),
    ("gap: 124\nlines: []\n", "from 0 to 123 is allowed"),
    ("gap: 010\nlines: []\n", ':1: gap: "010" begins with 0: write a decimal number'),
    ("cert: a\nlines: []\n", "cert and key need ca"),
    ("host: a\nlines: []\n", ':1: key: "host" is not one of broker, topic'),
    ("lines:\n- {line: rtu:/dev/null}\n", ":2: the line has no key file"),
    ("lines:\n- {file: meter.yaml}\n", ":2: the line has no key line"),
    ("lines:\n- {line: /dev/null, file: meter.yaml}\n", ':2: "/dev/null" is not a line'),
    ("lines:\n- {line: rtu:/dev/null, file: meter.yaml, topic: a/set}\n", ':2: the topic "a/set" of the line'),
    ("lines:\n- {line: rtu:/a, file: meter.yaml}\n- {line: rtu:/b, file: meter.yaml}\n", ':3: the topic "meter" of the line is, or begins, or goes on'),
    ("lines:\n- {line: rtu:/dev/null, file: none.yaml}\n", "none.yaml: No such file or directory"),
    ("lines:\n- {line: rtu:/dev/null, file: wrong.yaml}\n", "wrong.yaml:1: key:"),
])
def test_a_wrong_file_is_refused_with_its_line(mbm, write, text, sentence):
    write("meter.yaml", FIELDS % ("meter", 1))
    write("wrong.yaml", "wrong: 1\n")
    path = write("bridge.yaml", text)
    for options in ([], ["--check"]):
        code, _, error = mbm("bridge", *options, path)
        assert code in (1, 2) and sentence in error, error


def test_check_only_looks_at_the_file(mbm, write):
    write("meter.yaml", FIELDS % ("meter", 1))
    path = write("bridge.yaml", "broker: '[::1]:1883'\nlines:\n- {line: rtu:/dev/no-such-line, file: meter.yaml}\n")
    assert mbm("bridge", "--check", path) == (0, "", "")


def test_new_files_are_in_force_and_what_stays_the_same_notices_nothing(mbm, broker, setting, write, folder):
    """What is gone is no longer retained."""
    one, two, three, notified = Model(1, 2), Model(3, 4), Model(5, 6), Notified(folder)
    write("meter.yaml", FIELDS % ("meter", 1))
    write("pump.yaml", FIELDS % ("pump", 2))
    path = setting((one.line, "file: meter.yaml"), (two.line, "file: pump.yaml, topic: north/pump"), head="discovery: homeassistant\n")
    bridge = mbm.begin("bridge", path, "--stats", f"{folder}/stats.json", "--all", env=notified.env)
    notified.expect("READY=1")
    subscriber = subscribed(broker)
    subscriber.expect_value("hall/meter/level", 1)
    subscriber.expect_value("hall/north/pump/speed", 4)
    connections = len(one.device.peers), len(two.device.peers)

    # Of the second device one field leaves, one changes and one is new.
    write("pump.yaml", (FIELDS % ("pump", 2)).replace("name: level", "name: height").replace("}", ", unit_of_measurement: m}", 1))
    bridge.reload(r"^info: the files are in force\. Lines kept: 1, with a new device file: 1, removed: 0, added: 0\.$")
    notified.expect("RELOADING=1", "READY=1")
    subscriber.expect_value("hall/north/pump/height", 3)
    subscriber.expect_last("hall/north/pump/level", "")
    subscriber.expect_last("homeassistant/number/hall_north_pump_%08x/level/config" % fnv("hall/north/pump"), "")
    subscriber.expect_result("hall/north/pump/height", "33", "success")
    subscriber.expect_result("hall/north/pump/level", "33", "there is no such field")
    assert (len(one.device.peers), len(two.device.peers)) == connections

    # A line is removed and another added, while a write is pending.
    two.mood = "silent"
    assert wait(lambda: subscriber.last.get("hall/north/pump/unit/2/status") == "offline")
    setting((three.line, "file: pump.yaml, topic: south/pump"), (one.line, "file: meter.yaml"), head="discovery: homeassistant\n")
    bridge.reload(r"^info: the files are in force\. Lines kept: 1, with a new device file: 0, removed: 1, added: 1\.$")
    subscriber.expect_value("hall/south/pump/height", 5)
    subscriber.expect_result("hall/south/pump/height", "55", "success")
    subscriber.expect_result("hall/meter/level", "11", "success")
    kept = broker.retained()
    assert not any("north" in topic for topic in kept), kept
    assert {topic for topic in kept if topic.startswith("hall/")} == {
        "hall/status", "hall/meter/level", "hall/meter/speed", "hall/meter/unit/1/status", "hall/south/pump/height", "hall/south/pump/speed",
        "hall/south/pump/unit/2/status"}
    assert sum("is connected" in line for line in bridge.log) == 1

    # Files that are wrong, or that need a restart.
    write("meter.yaml", "fields: []\n")
    bridge.reload(r"^error: .*meter\.yaml:1: fields is empty\. The files before stay in force\.$")
    write("meter.yaml", FIELDS % ("meter", 1))
    setting((one.line, "file: meter.yaml"), head="topic: other\n")
    bridge.reload(r"^error: .*bridge\.yaml:3: topic is there twice, first in line 2\. The files before")
    setting((one.line, "file: meter.yaml"), head="plain: yes\n")
    bridge.reload(r"^error: .*: discovery has changed, which needs a restart\. The files before stay in force\.$")
    subscriber.expect_result("hall/south/pump/height", "56", "success")
    bridge.tell(signal.SIGUSR1)
    assert wait(lambda: os.path.exists(f"{folder}/stats.json"))
    found = json.load(open(f"{folder}/stats.json"))
    assert (found["command"], found["reloads"], found["reload_failures"], found["mqtt_connects"], [line["line"] for line in found["lines"]]) == (
        "bridge", 2, 3, 1, ["south/pump", "meter"])


def fnv(text):
    digest = 0x811C9DC5
    for byte in text.encode():
        digest = (digest ^ byte) * 0x01000193 & 0xFFFFFFFF
    return digest


# --- discovery

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

@pytest.fixture
def heat(broker, begin, write):
    """A device whose fields Home Assistant discovers: its configs by their topics, and by their names with their components."""
    model = Model()
    model.fields = write("heat.yaml", DISCOVERED)
    model.bridge = begin("--discovery", "homeassistant", model.line, model.fields)
    model.subscriber = subscribed(broker)
    assert wait(lambda: model.subscriber.value("hall/label") is not None)
    model.configs = {topic: json.loads(text) for topic, text in broker.retained().items() if topic.startswith("homeassistant/")}
    model.components = {config["name"]: (component_of(topic, config), config) for topic, config in model.configs.items()}
    return model


def test_home_assistant_discovers_each_field(heat):
    assert {name: one[0] for name, one in heat.components.items()} == {
        "flow": "sensor", "setpoint": "number", "energy": "number", "alarm": "binary_sensor", "pump/runs": "switch", "eco": "switch", "mode": "number",
        "label": "text", "serial": "sensor", "phases": "sensor", "curve": "text", "state": "sensor", "program": "select", "reset": "switch",
        "other": "number"}
    assert len({config["unique_id"] for config in heat.configs.values()}) == len(heat.configs)
    for name, wanted in (
        ("flow", {"state_topic": "hall/flow", "unit_of_measurement": "l/min", "value_template": "{{ value_json.value }}",
                  "availability": [{"topic": "hall/status"}, {"topic": "hall/unit/3/status"}],
                  "device": {"identifiers": ["mbm_hall_3"], "name": "heat pump unit 3", "model": "heat pump"}}),
        ("setpoint", {"command_topic": "hall/setpoint/set", "min": -16384, "max": 16383.5, "step": 0.5, "unit_of_measurement": "\u00b0C"}),
        ("energy", {"min": 0, "step": 0.001}), ("mode", {"min": 0, "max": 7}),
        ("pump/runs", {"payload_on": "ON", "payload_off": "OFF", "state_on": "True", "state_off": "False"}),
        ("alarm", {"payload_on": "True", "payload_off": "False"}), ("reset", {"state_topic": None, "value_template": None}),
        ("serial", {"value_template": "{{ value_json.value or '' }}"}), ("label", {"max": 16, "command_template": "{{ value | to_json }}"}),
        ("phases", {"unit_of_measurement": None}),
        ("state", {"device_class": "enum", "options": ["off", "on", "5\" \u00bd"], "unit_of_measurement": None,
                   "value_template": '{{ {0: "off", 1: "on", 7: "5\\" \u00bd"}.get(value_json.value) }}'}),
        ("program", {"options": ["auto", "party"], "value_template": '{{ {-1: "auto", 3: "party"}.get(value_json.value) }}',
                     "command_template": '{{ {"auto": -1, "party": 3}[value] }}'}),
        ("other", {"availability": [{"topic": "hall/status"}]}),
    ):
        config = heat.components[name][1]
        assert {key: config.get(key) for key in wanted} == wanted


def test_what_home_assistant_publishes_as_the_configs_say_is_taken(heat):
    for name, payload in (("pump/runs", "ON"), ("eco", "OFF"), ("setpoint", "21.5"), ("mode", "5"), ("program", "-1"), ("label", '"hall 1"')):
        heat.subscriber.expect_result(heat.components[name][1]["command_topic"].removesuffix("/set"), payload, "success")
    heat.subscriber.expect_value("hall/label", "hall 1")


def test_of_fields_that_leave_or_become_another_component_the_config_is_removed(heat, broker, write):
    text = DISCOVERED.replace("- {name: eco", "#").replace("- {name: flow", "#")
    write("heat.yaml", text.replace("count: 3, access: read-write}\n- {name: label", "count: 3}\n- {name: label"))
    heat.bridge.reload("the files are in force")
    for topic in ("sensor/hall/flow", "switch/hall/eco", "number/hall/mode"):
        heat.subscriber.expect_last(f"homeassistant/{topic}/config", "")
    assert wait(lambda: "homeassistant/sensor/hall/mode/config" in heat.subscriber.last)
    stays = {topic for topic in heat.configs if not any(f"/{name}/" in topic for name in ("eco", "flow", "mode"))}
    assert {topic for topic in broker.retained() if topic.startswith("homeassistant/")} == stays | {"homeassistant/sensor/hall/mode/config"}


def test_discovery_may_have_another_prefix_and_plain_payloads(broker, begin, write):
    begin("--discovery", "homeassistant", "--discovery-prefix", "ha", "--plain", Model().line, write("heat.yaml", DISCOVERED))
    subscriber = Subscriber(broker)
    # Of a plain payload the number has a name.
    assert wait(lambda: '{\\"0\\": \\"off\\", ' in subscriber.last.get("ha/sensor/hall/state/config", ""))
    assert wait(lambda: "state_on\":\"1\"" in subscriber.last.get("ha/switch/hall/pump_runs/config", ""))


# --- each row of the failure drill of docs/mqtt.md

@pytest.fixture
def drill(mbm, broker, setting, serial, write):
    """A bridge between a broker, a device on a serial line and one over TCP."""
    model = Model(1, 2)
    write("meter.yaml", FIELDS % ("meter", 7))
    write("pump.yaml", FIELDS % ("pump", 2))
    path = setting((serial.line, "file: meter.yaml"), (model.line, "file: pump.yaml"), head="keep_alive: 5s\n")
    bridge = mbm.begin("bridge", path, "--timeout", "300ms", "--stats", "/dev/full", "--stats-every", "200ms")
    bridge.model, bridge.broker, bridge.name = model, broker, f"the broker 127\\.0\\.0\\.1:{broker.port}"
    bridge.await_line(rf"^info: {bridge.name} is connected\.$")
    bridge.subscriber = subscribed(broker)
    bridge.subscriber.expect_value("hall/meter/level", 7)
    bridge.subscriber.expect_value("hall/pump/level", 1)
    return bridge


def test_a_full_disk_for_statistics_is_reported(drill):
    drill.await_line(r"^error: /dev/full: No space left on device\. The statistics are not written\.$")


def test_a_broker_that_is_absent_at_first_is_reported(begin, broker, write):
    broker.go()
    bridge = begin(Model(1, 2).line, write("pump.yaml", FIELDS % ("pump", 2)))
    name = f"the broker 127\\.0\\.0\\.1:{broker.port}"
    bridge.await_line(rf"^warning: {name} cannot be reached\. The bridge reads on, and tries it again\.$")
    broker.come()
    bridge.await_line(rf"^info: {name} is connected\.$")
    subscribed(broker).expect_value("hall/speed", 2)


def test_a_cable_that_is_pulled_and_plugged_in_again_is_reported(drill, serial):
    since, subscriber = len(drill.log), drill.subscriber
    serial.go()
    drill.await_line(r"^warning: rtu:.*\. The line is opened again each second\.$", since=since)
    subscriber.expect_last("hall/meter/unit/7/status", "offline")
    subscriber.expect_result("hall/meter/level", "1", ".*link.*")
    drill.model.registers[1] = 22
    subscriber.expect_value("hall/pump/speed", 22)
    serial.come()
    drill.await_line(r"^info: rtu:.*: the line is open again\.$", since=since)
    subscriber.expect_last("hall/meter/unit/7/status", "online")


@pytest.mark.parametrize("mood, status", [("silent", "no complete reply in time"), ("damaged", "CRC")])
def test_a_device_that_does_not_answer_is_reported(drill, serial, mood, status):
    since, serial.mood = len(drill.log), mood
    drill.await_line(rf"^warning: rtu:.*: unit 7 does not answer: .*{status}.*\.$", since=since)
    drill.subscriber.expect_last("hall/meter/unit/7/status", "offline")
    assert wait(lambda: status in drill.subscriber.last["hall/meter/level"])
    # The last value stays.
    assert drill.subscriber.value("hall/meter/level") == 7
    serial.mood = "right"
    drill.await_line(r"^info: rtu:.*: unit 7 answers\.$", since=since)
    drill.subscriber.expect_last("hall/meter/unit/7/status", "online")
    assert wait(lambda: '"status":"success"' in drill.subscriber.last["hall/meter/level"])


def test_a_broker_that_goes_and_comes_back_is_reported(drill):
    since = len(drill.log)
    drill.broker.go()
    drill.await_line(rf"^warning: {drill.name} is lost: .*\. The bridge connects again\.$", since=since)
    drill.await_line(rf"^warning: {drill.name} cannot be reached\.", since=since)
    drill.model.registers[1] = 23
    drill.broker.come()
    drill.await_line(rf"^info: {drill.name} is connected\.$", since=since)
    # It has forgotten what was retained, and gets everything again.
    subscriber = subscribed(drill.broker)
    subscriber.expect_value("hall/pump/speed", 23)
    subscriber.expect_value("hall/meter/level", 7)
    subscriber.expect_last("hall/meter/unit/7/status", "online")
    drill.end()
    subscriber.expect_last("hall/status", "offline")


def test_a_broker_that_takes_nothing_more_is_lost_after_the_keep_alive_time(drill):
    since = len(drill.log)
    drill.broker.program.tell(signal.SIGSTOP)
    drill.await_line(rf"^warning: {drill.name} is lost: .*\. The bridge connects again\.$", since=since)
    drill.model.registers[1] = 24
    drill.broker.program.tell(signal.SIGCONT)
    drill.await_line(rf"^info: {drill.name} is connected\.$", since=since)
    drill.subscriber.expect_value("hall/pump/speed", 24)
    drill.end()
    drill.subscriber.expect_last("hall/status", "offline")


def test_a_broker_that_refuses_is_reported(mbm, folder, write):
    strict = Broker(folder, anonymous="false").come()
    bridge = mbm.begin("bridge", "-b", strict.place, Model().line, write("pump.yaml", FIELDS % ("pump", 2)))
    bridge.await_line(r"^error: the broker .* refuses: Connection Refused: not authorised\.$")


def test_devices_that_close_connections_or_are_silent_on_one_are_read_on(mbm, broker, setting, write):
    idle, silent = Model(1, 2), Model(3, 4)
    idle.device.idle, silent.device.answers = 0.2, 3
    write("idle.yaml", (FIELDS % ("idle", 1)).replace("100ms", "500ms"))
    write("silent.yaml", (FIELDS % ("silent", 1)).replace("100ms", "300ms"))
    path = setting((idle.line, "file: idle.yaml, topic: idle"), (silent.line, "file: silent.yaml, topic: silent"))
    bridge = mbm.begin("bridge", path, "--timeout", "300ms", "--all")
    subscriber = subscribed(broker)
    subscriber.expect_value("hall/idle/level", 1)
    for value in range(10, 26):
        subscriber.expect_result("hall/idle/level", str(value), "success")
        time.sleep(0.25)
    statuses = lambda name: [json.loads(text)["status"] for text in subscriber.of(f"hall/{name}")]
    assert len(statuses("idle/level")) > 8 and set(statuses("idle/level")) == {"success"}
    assert len(idle.writes()) == 16
    assert wait(lambda: len(statuses("silent/level")) > 20)
    found = "".join("01"[one == "success"] for one in statuses("silent/level"))
    # It is heard again, after two requests that fail in a row.
    assert found.count("1") > 8 and "000" not in found
    # A connection that was closed is not reported, and a silent one once.
    assert not [line for line in bridge.log if idle.line in line and "answers" not in line]
    assert sum("The connection is made anew" in line for line in bridge.log) == 1


def test_the_example_that_is_installed_connects(mbm, broker, write):
    with open(f"{ROOT}/examples/services/pump.yaml") as file:
        write("pump.yaml", file.read())
    with open(f"{ROOT}/examples/services/bridge.yaml") as file:
        text = file.read().replace("broker.local", broker.place).replace("192.168.0.7", "127.0.0.1:1")
    mbm.begin("bridge", write("bridge.yaml", text)).await_line("is connected")
