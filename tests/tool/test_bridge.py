"""mbm bridge between a libmodbus server and a mosquitto broker."""

import json
import re
import signal

import peers
import pytest
from peers import CERTIFICATES, WRONG, bit, wait, word, words
from services import Broker, Subscriber, metrics

FIELDS = """\
device: meter
unit: 17
interval: 200ms
fields:
  - {name: voltage, table: holding, address: 0, type: uint16, scale: 0.1, access: read-write}
  - {name: power, table: holding, address: 6, type: int32, scale: 0.001}
  - {name: energy, table: holding, address: 20, type: uint32, order: CDAB, access: read-write}
  - {name: phases, table: holding, address: 30, type: uint16, count: 3}
  - {name: temperature, table: input, address: 40, type: int16}
  - {name: setpoint, table: holding, address: 50, type: float, access: read-write}
  - {name: reset, table: holding, address: 60, type: uint16, access: write}
  - {name: counter, table: holding, address: 70, type: uint64, access: read-write}
  - {name: balance, table: holding, address: 74, type: int64, order: CDAB, access: read-write}
  - {name: pump/runs, table: coils, address: 3, type: bit, access: read-write}
  - {name: gone/level, unit: 18, table: holding, address: 0, type: uint16}
"""


class Hall:
    """A broker, and libmodbus's server as a device whose fields a bridge publishes below the topic hall."""

    def __init__(self, mbm, folder, fields):
        self.mbm, self.fields = mbm, fields
        self.broker = Broker(folder).come()
        self.device, path, self.port = peers.libmodbus()
        self.place = f"rtu:{path}?parity=none"

    def begin(self, *options, place=None, broker=None):
        broker = broker or self.broker
        return self.mbm.begin("bridge", "-b", broker.place, "-t", "hall", "--timeout", "200ms", *options, place or self.place, self.fields)


@pytest.fixture
def fields(write):
    return write("meter.yaml", FIELDS)


@pytest.fixture
def hall(plain, folder, fields):
    return Hall(plain, folder, fields)


@pytest.fixture
def subscriber(hall):
    """A bridge of the hall is at work, and takes writes."""
    hall.bridge = hall.begin("--metrics", "127.0.0.1:0")
    subscriber = Subscriber(hall.broker)
    subscriber.expect_last("hall/status", "online")
    return subscriber


def signed(value, bits):
    return value - (value >> (bits - 1) << bits)


PHASES = words(30, 3)


def test_the_bridge_publishes_the_values_of_fields(subscriber):
    for topic, payload in (("unit/17/status", "online"), ("unit/18/status", "offline")):
        subscriber.expect_last(f"hall/{topic}", payload)
    for topic, value in (
        ("voltage", round(word(0) * 0.1, 1)), ("power", signed(word(6) << 16 | word(7), 32) / 1000), ("energy", word(21) << 16 | word(20)),
        ("phases", PHASES), ("temperature", signed(word(40) ^ 0xFFFF, 16)), ("pump/runs", bool(bit(3))),
    ):
        subscriber.expect_value(f"hall/{topic}", value)
    # A unit that is not there has no value, but a status.
    assert wait(lambda: "hall/gone/level" in subscriber.last)
    level = json.loads(subscriber.last["hall/gone/level"])
    assert (level["value"], level["status"]) == (None, "no complete reply in time")
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", json.loads(subscriber.last["hall/voltage"])["time"])


def test_a_value_that_stays_the_same_is_not_published_again(hall, subscriber):
    subscriber.expect_value("hall/phases", PHASES)
    subscriber.expect_last("hall/unit/18/status", "offline")
    assert wait(lambda: "hall/gone/level" in subscriber.last)
    requests = lambda: sum(value for (name, _), value in metrics(hall.bridge).items() if name == "mbm_bridge_requests_total")
    count, before = requests(), len(subscriber.messages)
    # The plan goes on reading the fields.
    assert wait(lambda: requests() > count + 30)
    assert subscriber.messages[before:] == []


def test_what_is_written_is_read_back_and_published(subscriber):
    for field, payload, value in (("voltage", "12.3", 12.3), ("energy", '{"value": 70000}', 70000), ("setpoint", "21.5", 21.5),
                                  ("setpoint", "16777215", 16777215), ("pump/runs", "ON", True), ("pump/runs", "false", False),
                                  ("pump/runs", "1", True), ("pump/runs", '{"value": false}', False)):
        subscriber.expect_result(f"hall/{field}", payload, "success")
        subscriber.expect_value(f"hall/{field}", value)
    subscriber.expect_result("hall/reset", "7", "success")
    assert "hall/reset" not in subscriber.last


def test_a_payload_that_is_no_value_of_its_field_is_refused_and_nothing_is_written(subscriber):
    before = (("voltage", "12.3", 12.3), ("energy", "70000", 70000), ("setpoint", "21.5", 21.5), ("pump/runs", "0", False))
    for field, payload, _ in before:
        subscriber.expect_result(f"hall/{field}", payload, "success")
    no_number, out_of_range = "the payload is no number", "the number is out of range"
    for field, payload, pattern in (
        ("voltage", "hot", no_number), ("voltage", "7000", out_of_range), ("voltage", "-1", out_of_range), ("voltage", "NaN", no_number),
        ("voltage", "9" * 200, "the payload is too long"), ("voltage", "12.34", "the number is not a multiple of the scale"),
        ("pump/runs", "2", out_of_range), ("energy", "21.5", "the number is not a whole number"), ("setpoint", "1e39", out_of_range),
        # A payload that only begins with a number.
        *(("energy", payload, f"{no_number}|{out_of_range}") for payload in (
            "21,5", "0x10", "12abc", "5 6 7", '{"value":9}}garbage', '{"value":9} {"value":8}', '{"value":9,"value":8}', "+5", "ON", "1e999 ", "\t")),
        *(("energy", payload, no_number) for payload in (b"5\0garbage", b"5\0")),
        *(("pump/runs", payload, no_number) for payload in ("1x", "ONx", "yes", "[1]", '"ON"', "true false")),
    ):
        subscriber.expect_result(f"hall/{field}", payload, pattern)
    for field, _, value in before:
        subscriber.expect_value(f"hall/{field}", value)


def test_integers_of_64_bits_are_written_exactly_or_refused(subscriber):
    for field, values in (("counter", (9007199254740993, 2**64 - 1, 2**63, 0)),
                          ("balance", (9007199254740993, -9007199254740993, 2**63 - 1, -(2**63), 0))):
        for value in values:
            for payload in (str(value), f'{{"value":{value}}}'):
                subscriber.expect_result(f"hall/{field}", payload, "success")
                subscriber.expect_value(f"hall/{field}", value)
    for field, value in (("counter", 2**64), ("counter", -1), ("balance", 2**63), ("balance", -(2**63) - 1)):
        subscriber.expect_result(f"hall/{field}", str(value), "the number is out of range")
        subscriber.expect_value(f"hall/{field}", 0)


def test_each_write_gets_a_result_and_an_empty_payload_none(hall, subscriber):
    """An empty payload clears a retained message."""
    for field, pattern in (("phases", "the field is not writable"), ("temperature", "the field is not writable"),
                           *((name, "there is no such field") for name in ("no-field", "pump/stops", "a/b/c/d/e/f/g/h", "voltage/set"))):
        subscriber.expect_result(f"hall/{field}", "1", pattern)
    for field in ("energy", "phases", "no-field"):
        count = len(subscriber.of(f"hall/{field}/result"))
        hall.broker.publish(f"hall/{field}/set", "")
        subscriber.expect_result(f"hall/{field}", "x", ".*")
        assert len(subscriber.of(f"hall/{field}/result")) == count + 1


def test_a_retained_write_is_refused(hall):
    """It would be repeated each time the bridge connects."""
    hall.broker.publish("hall/voltage/set", "44.4", "-r")
    subscriber = Subscriber(hall.broker)
    bridge = hall.begin()
    assert wait(lambda: "hall/voltage/result" in subscriber.last)
    assert "retained" in subscriber.last["hall/voltage/result"]
    subscriber.expect_value("hall/voltage", round(word(0) * 0.1, 1))
    bridge.end()
    subscriber.expect_last("hall/status", "offline")


def test_a_bridge_survives_a_device_over_tcp_that_closes_its_connection(hall):
    subscriber = Subscriber(hall.broker)
    bridge = hall.begin(place=f"tcp://127.0.0.1:{hall.port}")
    subscriber.expect_value("hall/phases", PHASES)
    hall.device.close()
    subscriber.expect_last("hall/unit/17/status", "offline")
    assert bridge.code is None


def test_ctrl_c_ends_a_bridge_and_its_device_over_udp(hall):
    device = hall.mbm.begin("serve", "udp://127.0.0.1:0", hall.fields)
    subscriber = Subscriber(hall.broker)
    bridge = hall.begin(place=device.last_word())
    subscriber.expect_last("hall/status", "online")
    subscriber.expect_last("hall/unit/17/status", "online")
    subscriber.expect_result("hall/counter", str(2**64 - 1), "success")
    subscriber.expect_value("hall/counter", 2**64 - 1)
    bridge.end(signal.SIGINT)
    device.end(signal.SIGINT)


def test_the_broker_says_that_a_killed_bridge_is_offline(hall, subscriber):
    hall.bridge.end(signal.SIGKILL, -signal.SIGKILL)
    subscriber.expect_last("hall/status", "offline")


def test_plain_payloads_have_the_value_alone(hall):
    subscriber = Subscriber(hall.broker)
    hall.begin("--plain")
    subscriber.expect_last("hall/phases", ",".join(map(str, PHASES)))
    subscriber.expect_result("hall/voltage", "12.3", "success")
    subscriber.expect_last("hall/voltage", "12.3")


def test_a_broker_may_want_a_certificate_of_the_bridge(hall, folder):
    path = lambda name: f"{CERTIFICATES}/{name}.pem"
    broker = Broker(folder, f"cafile {path('authority')}", f"certfile {path('server')}", f"keyfile {path('server.key')}",
                    "require_certificate true").come()
    broker.place = f"localhost:{broker.port}"
    broker.client += ("--cafile", path("authority"), "--cert", path("operator"), "--key", path("operator.key"), "-h", "localhost")
    subscriber = Subscriber(broker)
    hall.begin("--ca", path("authority"), "--cert", path("operator"), "--key", path("operator.key"), broker=broker)
    subscriber.expect_value("hall/phases", PHASES)


# --- files and words that are refused

RIGHT = "name: voltage, table: holding, address: 0, type: uint16, interval: 100ms"
PLACE = "rtu:/dev/null"


# Each file differs in one place from a right one.
@pytest.mark.parametrize("field, sentence", [
    (RIGHT.replace("address: 0, ", ""), ":3: the field has no key address"),
    (f"{RIGHT}, unit: 300", 'unit: "300" is out of range: from 0 to 255'),
    (RIGHT.replace("holding", "register"), 'table: "register" is not one of coils, discrete, holding'),
    (RIGHT.replace(": 0", ": 65536"), 'address: "65536" is out of range: from 0 to 65535'),
    (RIGHT.replace("uint16", "word"), 'type: "word" is not one of the 38 words in docs/device-file.md'),
    (RIGHT.replace("100ms", "0ms"), 'interval: "0ms" is out of range: from 1ms to 24h'),
    (RIGHT.replace("100ms", "100"), 'interval: "100" is not a time'),
    (f"{RIGHT}, scale: x", 'scale: "x" is neither a decimal number'),
    (f"{RIGHT}, scale: 0x10", 'scale: "0x10" is not a decimal number'),
    (RIGHT.replace("voltage", "v" * 201), "name has more than 200 bytes"),
    (f"{RIGHT}, big: 1", 'key: "big" is not one of name, table'),
    (f"{RIGHT}, address: 1", "address is there twice"),
    (f"{RIGHT}, access: write".replace("holding", "input"), "only coils and holding registers can be written"),
    (f"{RIGHT}, count: 124, access: read-write", "one request writes at most 123 registers"),
    (f"{RIGHT}, access: write", "no field can be read"),
    (f"{RIGHT}, value: 1}}\n- {{{RIGHT.replace('voltage', 'current')}, value: 2", ":4: current shares an address with voltage"),
    (f"{RIGHT}}}\n- {{{RIGHT.replace(': 0', ': 1')}", ":4: the field in line 3 has the name voltage too"),
    ("voltage: [1]", ":3: key: \"voltage\" is not one of name, table"),
    (f"{RIGHT}}}}}", "this is not YAML"),
])
def test_a_wrong_field_is_refused_with_its_line(plain, write, field, sentence):
    plain.fails(WRONG, sentence, "bridge", "-b", "127.0.0.1:1", PLACE, write("wrong.yaml", "unit: 17\nfields:\n- {" + field + "}\n"))


@pytest.mark.parametrize("text, sentence", [
    ("# nothing\n", "the file is empty"),
    ("voltage 17 holding 0 uint16 1000 scale=0.1\n", "the file must be a mapping of keys"),
    ("fields: []\n", "fields is empty"),
])
def test_a_file_without_fields_is_refused(plain, write, text, sentence):
    plain.fails(WRONG, sentence, "bridge", "-b", "127.0.0.1:1", PLACE, write("wrong.yaml", text))
