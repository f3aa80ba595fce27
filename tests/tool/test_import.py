"""mbm import: what it makes of the configurations of other programs reads a device as they do, and what it cannot take over is named
line by line."""

import itertools
import json
import struct

import pytest
from peers import DONE, PATIENT, SYSTEM, WRONG, TcpDevice, bit, word

HUB = """\
modbus:
  - name: house
    type: tcp
    host: 192.168.0.7
    port: 1502
    sensors:
      - {name: Voltage L1, address: 0, slave: 3, input_type: input, data_type: float32, unit_of_measurement: V, device_class: voltage, scan_interval: 10}
      - &energy
        name: Energy
        address: 10
        data_type: uint32
        swap: word
        scale: 0.1
        unit_of_measurement: kWh
        device_class: energy
        state_class: total_increasing
        unique_id: energy_1
      - {<<: *energy, name: "Energy: out", address: 12}
      - {name: Label, address: 30, data_type: string, count: 4, swap: byte}
      - {name: Level, address: 40, data_type: custom, structure: ">h", count: 1}
      - {name: Flow, address: 60, data_type: int16, scale: 0.01, offset: -5.5, precision: 1}
      - {name: Missing, address: 61, data_type: uint16, nan_value: %s}
      - {name: String, address: 50, data_type: uint16, virtual_count: 2}
    binary_sensors:
      - {name: Door, address: 5, input_type: discrete_input, device_class: door}
      - {name: Alarm, address: 7, input_type: holding}
    switches:
      - {name: Pump, address: 3, write_type: coil, verify: }
      - {name: Fan, address: 100, command_on: 3, command_off: 1, verify: {address: 101, input_type: input}}
    covers:
      - {name: Blind, address: 110}
    climates:
      - name: Room
        address: 117
        input_type: input
        target_temp_register: 108
        data_type: int16
        scale: 0.1
        hvac_onoff_register: 11
        hvac_mode_register:
          address: 12
          values: {state_off: 0, state_heat: 1, state_fan_only: 3}
""" % hex(word(61))
PLUGIN = """\
[agent]
  interval = "10s"
[[inputs.modbus]]
  name = 'Device "2"' # with quotes
  controller = "file:///dev/ttyUSB0"
  baud_rate = 19200
  parity = "E"
  slave_id = 17
  configuration_type = "register"
  coils = [
    { name = "motor", address = [0]},
  ]
  holding_registers = [
    { name = "power factor", byte_order = "AB", data_type = "FIXED", scale = 0.01, address = [8]},
    { name = "energy", byte_order = "CDAB", data_type = "UINT32", scale = 1.0, address = [5, 6]},
    { name = "wide", byte_order = "GHEFCDAB", data_type = "INT64", address = [30, 31,
      32, 33]},
    { name = "bit", byte_order = "AB", data_type = "BIT", bit = 3, address = [20]},
    { name = "high", byte_order = "AB", data_type = "UINT8H", address = [21]},
    { name = "t\\u0065xt", byte_order = "AB", data_type = "STRING", address = [22, 23, 24]},
  ]
"""
REQUESTS = """\
[[inputs.modbus]]
  name = "drive"
  controller = "tcp://192.168.0.7:1502"
  configuration_type = "request"
  [[inputs.modbus.request]]
    slave_id = 2
    byte_order = "DCBA"
    register = "holding"
    measurement = "motor"
    fields = [
      { address=0, type="INT16", name="speed", scale=0.1, output="FLOAT64" },
      { address=1, type="UINT32", name="hours" },
      { address=9, type="UINT32", name="hidden", omit=true },
      { address=24, type="FLOAT16", name="half" },
    ]
  [[inputs.modbus.request]]
    slave_id = 3
    register = "coil"
    fields = [ { address=4, name="door" } ]
"""
METRICS = """\
[[inputs.modbus]]
  controller = "tcp://192.168.0.7"
  configuration_type = "metric"
  [[inputs.modbus.metric]]
    slave_id = 1
    byte_order = "ABCD"
    measurement = "tank"
    fields = [
      { register="input", address=3, type="UINT16", name="level" },
      { register="discrete", address=2, name="full" },
      { register="holding", address=1, type="STRING", length=3, name="low" },
    ]
  [inputs.modbus.workarounds]
    string_register_location = "lower"
"""
POINT = '{"name": "%s", "type": "%s", "size": %s%s}'
MODEL = '{"id": 64999, "group": {"name": "pump", "label": "A Pump", "type": "group", "points": [\n%s],\n"groups": [{"name": "stage", "count": 2, ' \
    '"type": "group", "points": [\n%s]}]}}' % (
        ",\n".join(POINT % point for point in (
            ("ID", "uint16", 1, ', "value": 64999, "static": "S"'), ("L", "uint16", 1, ""), ("Mn", "string", 4, ', "desc": "Who made it"'),
            ("A_SF", "sunssf", 1, ""), ("Pad", "pad", 1, ""), ("A", "int16", 1, ', "sf": "A_SF", "units": "A"'), ("V", "uint16", 1, ', "sf": -1, "units": "V"'), ("WH", "acc32", 2, ', "units": "Wh"'),
            ("St", "enum16", 1, ', "symbols": [{"name": "OFF", "value": 1}, {"name": "RUNS", "value": 4660}]'),
            ("Evt", "bitfield32", 2, ', "symbols": [{"name": "HOT", "value": 2}, {"name": "WET", "value": 17}]'),
            ("Set", "float32", 2, ', "access": "RW", "units": "Pct"'))),
        ",\n".join(POINT % point for point in (("Tmp", "int16", 1, ', "units": "C"'), ("N", "uint64", 4, ""))))


@pytest.fixture
def imported(mbm, folder, write):
    """Imports a text; returns the device file that is made of it, and what is said."""
    def imported(whose, text, *options, code=DONE):
        file = f"{folder}/made.yaml"
        found = mbm("import", whose, write("theirs", text), "-o", file, *options)
        assert (found.code, found.out) == (code, ""), found
        return file, found.error

    return imported


@pytest.fixture
def polled(mbm, libmodbus):
    """The values that mbm poll reads by a file from libmodbus's server."""
    def polled(file):
        code, out, error = mbm("poll", libmodbus.tcp, file, "--once", "--json", *PATIENT)
        assert code == DONE, error
        return {row["name"]: row["value"] for row in map(json.loads, out.splitlines())}

    return polled


def wide(*addresses, opposite=0):
    """The bytes of registers of libmodbus's server; those of input registers are the complement."""
    return b"".join((word(address) ^ opposite).to_bytes(2, "big") for address in addresses)


def number(*addresses, sign=False):
    return int.from_bytes(wide(*addresses), "big", signed=sign)


def near(value):
    return pytest.approx(value, rel=1e-6)


def expect(found, wanted):
    assert {name: found.get(name) for name in wanted} == wanted


def head_of(file):
    with open(file, encoding="utf-8") as lines:
        return lines.read().split("fields:\n")[0]


def test_what_home_assistant_reads_is_read(imported, polled):
    file, said = imported("homeassistant", HUB)
    assert said == ""
    assert head_of(file) == "# Made by mbm import from theirs.\n# The line: \"tcp://192.168.0.7:1502\"\ndevice: house\nunit: 1\ninterval: 15s\ntimeout: 5s\n"
    found = polled(file)
    label = wide(30, 31, 32, 33)
    expect(found, {
        "Voltage L1": near(struct.unpack(">f", wide(0, 1, opposite=0xFFFF))[0]), "Energy": near(number(11, 10) * 0.1),
        "Energy: out": near(number(13, 12) * 0.1), "Level": number(40, sign=True), "Flow": round(number(60, sign=True) * 0.01 - 5.5 + 1e-9, 1), "Missing": None, "String 0": word(50), "String 2": word(52),
        "Door": not bit(5), "Alarm": bool(word(7) & 1), "Pump": bool(bit(3)), "Fan state": word(101) ^ 0xFFFF, "Blind": word(110),
        "Room temperature": near(int.from_bytes(wide(117, opposite=0xFFFF), "big", signed=True) * 0.1),
        "Room setpoint": near(number(108, sign=True) * 0.1), "Room on": word(11), "Room mode": word(12)})
    assert found["Label"].encode("latin-1") == b"".join(label[i:i + 2][::-1] for i in range(0, 8, 2)).split(b"\0")[0]


def test_what_telegraf_reads_is_read(imported, polled):
    file, said = imported("telegraf", PLUGIN)
    assert said == ""
    assert head_of(file) == "# Made by mbm import from theirs.\n# The line: \"rtu:/dev/ttyUSB0?baud=19200&parity=even&stop=1\"\n" \
        'device: "Device \\"2\\""\nunit: 17\ninterval: 10s\n'
    expect(polled(file), {"motor": bool(bit(0)), "power factor": near(number(8, sign=True) * 0.01), "energy": number(6, 5),
                          "wide": number(33, 32, 31, 30, sign=True), "bit": bool(word(20) >> 3 & 1), "high": word(21) >> 8,
                          "text": wide(22, 23, 24).split(b"\0")[0].decode("latin-1")})


def test_requests_and_metrics_of_telegraf_are_read(imported, polled):
    file, said = imported("telegraf", REQUESTS)
    assert said == ""
    turned = lambda *addresses: int.from_bytes(wide(*addresses)[::-1], "big", signed=len(addresses) == 1)
    assert polled(file) == {"motor speed": near(turned(0) * 0.1), "motor hours": turned(1, 2), "door": bool(bit(4)),
                            "motor half": pytest.approx(struct.unpack("<e", wide(24))[0], rel=1e-3)}
    file, said = imported("telegraf", METRICS)
    assert said == ""
    assert polled(file) == {"tank level": word(3) ^ 0xFFFF, "tank full": not bit(2), "tank low": wide(1, 2, 3)[1::2].decode("latin-1")}


def test_pauses_repetitions_and_the_end_of_connections_are_taken_over(imported, polled):
    paced = "type: tcp\nhost: here\nport: 502\ndelay: 1\nmessage_wait_milliseconds: 30\nclose_comm_on_error: true\nsensors:\n- {name: a, address: 1}\n"
    file, said = imported("homeassistant", paced)
    assert said == "" and head_of(file).endswith("interval: 15s\ndelay: 1s\nmessage_wait: 30ms\nclose: error\ntimeout: 5s\n")
    assert polled(file) == {"a": number(1, sign=True)}
    file, said = imported("telegraf", PLUGIN + """\
  [inputs.modbus.workarounds]
    pause_after_connect = "200ms"
    pause_between_requests = "0ms"
    close_connection_after_gather = true
    max_word_registers_per_request = 60
    max_bit_registers_per_request = 0
""".replace("  [inputs", '  busy_retries = 3\n  busy_retries_wait = "50ms"\n  [inputs'))
    assert said == "" and head_of(file).endswith("interval: 10s\nbusy_retries: 3\nbusy_wait: 50ms\ndelay: 200ms\nmax_read_registers: 60\nclose: round\n")
    assert polled(file)["motor"] == bool(bit(0))


def test_a_model_of_sunspec_is_read_where_it_begins(imported, polled):
    file, said = imported("sunspec", MODEL, "--address", "100", "--unit", "3")
    assert said == ""
    assert head_of(file) == "# Made by mbm import from theirs.\ndevice: A Pump\nunit: 3\n"
    expect(polled(file), {
        "ID": word(100), "Mn": wide(102, 103, 104, 105).split(b"\0")[0].decode("latin-1"), "A_SF": number(106, sign=True),
        # The power of ten is none that a device has.
        "A": None, "V": near(word(109) * 0.1), "WH": number(110, 111), "St": word(112), "Evt": number(113, 114),
        "Evt HOT": bool(word(114) >> 2 & 1), "Evt WET": bool(word(113) >> 1 & 1), "Set": near(struct.unpack(">f", wide(115, 116))[0]),
        "stage 1 Tmp": number(117, sign=True), "stage 1 N": number(118, 119, 120, 121), "stage 2 Tmp": number(122, sign=True),
        "stage 2 N": number(123, 124, 125, 126)})


def test_a_point_of_sunspec_has_the_power_of_ten_of_its_scale_factor_or_is_not_available(imported, mbm):
    registers = {106: 0xFFFE, 108: 1234, 109: 0xFFFF}

    def answer(pdu):
        first, count = int.from_bytes(pdu[1:3], "big"), pdu[4]
        return bytes([3, 2 * count]) + b"".join(registers.get(first + i, 0).to_bytes(2, "big") for i in range(count))

    device = TcpDevice(answer)
    file, _ = imported("sunspec", MODEL, "--address", "100")
    found = mbm("poll", device.line, file, "--once", "--json", *PATIENT)
    rows = {row["name"]: (row["value"], row["status"]) for row in map(json.loads, found.out.splitlines())}
    assert (rows["A"], rows["V"]) == ((12.34, "success"), (None, "not available"))


@pytest.mark.parametrize("whose, text, options", [("homeassistant", HUB, ()), ("telegraf", PLUGIN, ()), ("telegraf", REQUESTS, ()),
                                                   ("sunspec", MODEL, ("--address", "100"))],
                         ids=("homeassistant", "telegraf", "requests", "sunspec"))
def test_the_device_that_serve_is_by_an_imported_file_is_read_by_it(imported, mbm, whose, text, options):
    file, _ = imported(whose, text, *options)
    found = mbm("poll", mbm.serve("tcp://127.0.0.1:0", file), file, "--once", "--json", *PATIENT)
    rows = [json.loads(row) for row in found.out.splitlines()]
    assert found.code == DONE and rows and {row["status"] for row in rows} == {"success"}


# --- what is not taken over

def hub(lines):
    return f"type: tcp\nhost: here\nport: 502\nsensors:\n- {{name: right, address: 0}}\n{lines}\n"


def plugin(lines):
    return f'[[inputs.modbus]]\ncontroller = "tcp://here"\nholding_registers = [{{name="right", address=[0]}},\n{lines}]\n'


@pytest.mark.parametrize("whose, text, head", [
    ("homeassistant", hub("timeout: 5"), "timeout: 5s\n"), ("homeassistant", hub("timeout: 0.25"), "timeout: 250ms\n"),
    ("telegraf", plugin("") + 'timeout = "3s"\n', "timeout: 3s\n")])
def test_the_timeout_becomes_a_key_of_the_device_file(imported, polled, whose, text, head):
    file, _ = imported(whose, text)
    assert head in open(file).read() and polled(file)


@pytest.mark.parametrize("whose, text, sentence", [
    ("homeassistant", hub("- {name: a, address: 1, min_value: 3}"), "6: a: min_value is not taken over."),
    ("homeassistant", hub("- {name: a, address: 1, data_type: custom, structure: '>2h'}"),
     "6: a: the data_type custom >2h has no counterpart: the field is left out."),
    ("homeassistant", hub("- {name: a, address: 70000}"), '6: a: address: "70000" is out of range'),
    ("homeassistant", hub("- {name: a, address: 1, scan_interval: 0}"), "6: a: scan_interval 0, which is no polling, is not taken over."),
    ("homeassistant", hub("- {name: a, address: 1, unit_of_measurement: W, device_class: energy}"),
     "6: a: device_class: energy does not go with the unit_of_measurement W"),
    ("homeassistant", hub("- {name: Right, address: 1}"), '6: Right: the name is "Right 2" here: another field has it.'),
    ("homeassistant", hub("- {name: a, address: 1, data_type: int32, count: 1}"), "6: a: count 1 is not the 2 registers of int32."),
    ("homeassistant", hub("timeout: 5000"), "6: timeout: a timeout is from 1ms to 1000s."),
    ("homeassistant", hub("retries: 5"), "6: the hub: retries is not taken over."),
    ("homeassistant", hub("climates:\n- {name: a, address: 1, target_temp_register: 2, hvac_mode_register: {address: 3, values: {state_off: [0, 4]}}}"),
     "7: a mode: state_off: only 0 of several numbers."),
    ("telegraf", plugin('{name="a", data_type="INT8L", address=[1]}'), "4: a: the type INT8L has no counterpart: the field is left out."),
    ("telegraf", plugin('{name="a", data_type="INT32", address=[1, 3]}'), "4: a: its addresses do not follow each other: the field is left out."),
    ("telegraf", plugin('{name="a", data_type="INT32", address=[1]}'), "4: a: INT32 has 2 registers and not 1."),
    ("telegraf", plugin('{name="a", color="red", address=[1]}'), "4: a: color is not taken over."),
    ("telegraf", plugin("") + 'timeout = "1m30s"\n', '5: timeout: "1m30s" is not a time'),
    ("sunspec", MODEL.replace('"pad"', '"eui48"'), "6: Pad: the type eui48 has no counterpart: the field is left out."),
    ("sunspec", MODEL.replace('"count": 2', '"count": 0'),
     "13: stage: the device says how often it is there: give that with --count. One is taken."),
], ids=itertools.count())
def test_what_is_not_taken_over_is_named_with_its_line_and_the_rest_is_written(imported, folder, polled, whose, text, sentence):
    options = ("--address", "100") if whose == "sunspec" else ()
    file, said = imported(whose, text, *options, code=WRONG)
    assert f"mbm import: {folder}/theirs:{sentence}" in said
    assert said.splitlines()[-1].startswith(f"mbm import: {folder}/theirs: not taken over: 1. The device file has ")
    assert {"right", "ID"} & set(polled(file))


@pytest.mark.parametrize("whose, text, sentence", [
    ("homeassistant", "- a\n", "there is no hub of the integration modbus"),
    ("homeassistant", "modbus:\n- {name: a, type: tcp}\n- {name: b, type: tcp}\n", "there are 2 hubs: choose one with --hub, by its name, host or port"),
    ("homeassistant", "modbus:\n- {name: a, type: tcp}\n", "there is no field that can be taken over"),
    ("homeassistant", "modbus: [", "this is not YAML"),
    ("telegraf", "[agent]\n", "there is no [[inputs.modbus]]"),
    ("telegraf", "[[inputs.modbus]]\n[[inputs.modbus]]\n", "there are 2 [[inputs.modbus]]: choose one with --hub"),
    ("telegraf", "a = 1\na = 2\n", ":2: this is not TOML: a key is there twice"),
    ("telegraf", 'a = "b\n', ":1: this is not TOML: a string has no end"),
    ("telegraf", "a = [1 2]\n", ":1: this is not TOML: a comma or the end of a list is missing"),
    ("telegraf", "a = \n", ":1: this is not TOML: a value is missing"),
    ("telegraf", "a = 1 b = 2\n", ":1: this is not TOML: a line goes on after its value"),
    ("telegraf", "a = 1\n[a]\n", ":2: this is not TOML: a key is a value and a table"),
    ("telegraf", "a = " + "[" * 60 + "\n", ":1: this is not TOML: values are nested too deeply"),
    ("telegraf", 'a = "\\q"\n', ":1: this is not TOML: an unknown escape"),
    ("telegraf", "[a\n", ":1: this is not TOML: ] is missing"),
    ("telegraf", "= 1\n", ":1: this is not TOML: a key is missing"),
    ("sunspec", "{}", "this is no model of SunSpec"),
    ("sunspec", MODEL, "give the address of the model's ID with --address"),
], ids=itertools.count())
def test_a_file_of_which_nothing_can_be_made_is_refused(mbm, write, whose, text, sentence):
    mbm.fails(WRONG, sentence, "import", whose, write("theirs", text))


def test_a_file_that_is_not_there_is_reported(plain, folder):
    for whose in ("homeassistant", "telegraf", "sunspec"):
        plain.fails(SYSTEM, f"{folder}/none: No such file or directory", "import", whose, f"{folder}/none")


def test_hub_chooses_among_several_and_the_output_may_be_printed(plain, write):
    file = write("theirs", PLUGIN + REQUESTS)
    found = plain("import", "telegraf", file, "--hub", "drive")
    assert (found.code, found.error) == (DONE, "") and "motor speed" in found.out and "energy" not in found.out
    assert "energy" in plain("import", "telegraf", file, "--hub", "file:///dev/ttyUSB0").out


@pytest.mark.parametrize("words, sentence", [
    ("", "WHOSE is missing"), ("telegraf", "FILE is missing"), ("evcc x", 'WHOSE "evcc" is not one of homeassistant, telegraf and sunspec'),
    ("telegraf x --address 3", "--address is for sunspec"), ("homeassistant x --count 3", "--count is for sunspec"),
    ("sunspec x --hub a", "--hub is for homeassistant and telegraf"), ("telegraf x y", '"y" is one word too many'),
])
def test_a_wrong_word_of_import_is_refused(plain, words, sentence):
    plain.fails(WRONG, sentence, "import", *words.split())


def test_an_unwritable_output_is_reported(plain, write, folder):
    plain.fails(SYSTEM, f"{folder}/no/made.yaml: No such file or directory", "import", "telegraf", write("theirs", PLUGIN), "-o", f"{folder}/no/made.yaml")
