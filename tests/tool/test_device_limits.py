"""Limits of a device, addresses as its manual prints them, and repeated fields: mbm with servers of libmodbus and pymodbus,
with mbm serve, and with devices that have one function alone."""

import json

import peers
import pytest
from peers import DONE, EXCEPTION, PATIENT, TcpDevice, number, pymodbus, served, ten_registers, wait
from pymodbus.server import ModbusTcpServer
from services import Broker, Subscriber


@pytest.fixture(params=["libmodbus", "pymodbus"])
def server(request):
    """The line of a server of unit 17, whose registers and coils are known."""
    if request.param == "libmodbus":
        return f"tcp://127.0.0.1:{peers.libmodbus()[2]}"
    return f"tcp://127.0.0.1:{pymodbus('tcp', '--port', '0').ready[0]}"


@pytest.fixture
def poll(mbm, write):
    def poll(line, text, *options):
        """The values that mbm poll reads in one round, by the names of their fields, and what it says."""
        found = mbm("poll", line, write("device.yaml", text), "--once", "--json", "-q", *options, *PATIENT)
        assert found.code == DONE, found
        return {one["name"]: one["value"] for one in map(json.loads, found.out.splitlines())}, found.error

    return poll


# --- addresses ---

def test_a_plan_is_shown_with_the_addresses_of_the_file(poll, server):
    _, said = poll(server, "notation: modicon\nunit: 17\nfields: [{name: level, address: 40101, type: uint16}]\n", "--show-plan")
    assert said == "request 1: unit 17, holding, 1 from 40101 on, every 1s\n"
    _, said = poll(server, "one_based: yes\nunit: 17\nfields: [{name: level, table: coils, address: 31}]\n", "--show-plan")
    assert said == "request 1: unit 17, coils, 1 from 31 on, every 1s\n"


# --- repeated fields ---

CHANNELS = """\
unit: 17
fields:
- repeat: {count: 5, every: 40}
  fields:
  - {name: "channel {n} level", table: holding, address: 10, type: uint16}
  - {name: relay, table: coils, address: 11}
- {name: last, table: holding, address: 2, type: uint16, repeat: {count: 3, every: 1, first: 0}}
"""


def test_a_header_has_repeated_fields_with_their_numbers(plain, write):
    header = plain("header", write("device.yaml", CHANNELS)).out
    assert "#define DEVICE_CHANNEL_5_LEVEL_ADDRESS 170u\n" in header and "#define DEVICE_LAST_0_ADDRESS 2u\n" in header


# --- limits ---

LIMITED = """\
max_read_registers: 10
max_read_bits: 20
excluded: [holding: 25-26]
gap: {registers: 3, bits: 30}
fields:
- {name: levels, table: holding, address: 0, type: uint16, repeat: {count: 25, every: 1}}
- {name: after, table: holding, address: 27, type: uint16}
- {name: near, table: holding, address: 31, type: uint16}
- {name: relay, table: coils, address: 100, repeat: {count: 3, every: 19}}
"""


def reads(said):
    """The requests of a plan: table, quantity and first address."""
    return [(words[4].rstrip(","), int(words[5]), int(words[7])) for words in (line.split() for line in said.splitlines())]


def test_the_gap_of_the_command_line_wins(poll, server):
    text = "gap: 3\nunit: 17\nfields:\n- {name: a, table: holding, address: 0, type: uint16, repeat: {count: 3, every: 4}}\n"
    assert reads(poll(server, text, "--show-plan")[1]) == [("holding", 9, 0)]
    assert len(reads(poll(server, text, "--show-plan", "--gap", 0)[1])) == 3
    assert reads(poll(server, text.replace("3\n", "0\n", 1), "--show-plan", "--gap", 3)[1]) == [("holding", 9, 0)]


def test_mbm_header_groups_within_the_limits_of_the_file(plain, write):
    header = plain("header", write("device.yaml", LIMITED)).out
    assert "#define DEVICE_READS 6\n" in header.replace("u\n", "\n")


SERVED = """\
max_read_registers: 4
max_read_bits: 9
max_write_registers: 2
max_write_bits: 3
fields:
- {name: level, table: holding, address: 0, type: uint16, count: 4, access: read, value: [1, 2, 3, 4]}
- {name: limit, table: holding, address: 4, type: uint16, access: read-write}
- {name: ramp, table: holding, address: 5, type: uint32, access: read-write, write_function: multiple}
- {name: mode, table: holding, address: 7, type: uint16, access: read-write, write_function: multiple}
- {name: step, table: holding, address: 8, type: uint16, access: read-write, write_function: single}
- {name: lamps, table: coils, address: 0, count: 3, access: read-write}
- {name: more lamps, table: coils, address: 3, count: 7}
"""
REFUSED = "exception {}: illegal {}"


def test_mbm_serve_keeps_the_limits_of_its_file(mbm, write):
    place = mbm.serve("tcp://127.0.0.1:0", write("served.yaml", SERVED))
    mbm.prints("    0  1\n    1  2\n    2  3\n    3  4\n", "read", place, 0, 4)
    mbm.fails(EXCEPTION, REFUSED.format("03", "data value"), "read", place, 0, 5, *PATIENT)
    mbm.fails(EXCEPTION, REFUSED.format("03", "data value"), "read", place, "-t", "coils", 0, 10, *PATIENT)
    mbm.fails(EXCEPTION, REFUSED.format("03", "data value"), "write", place, 4, 1, 2, 3, *PATIENT)
    mbm.prints("unit 1: wrote 2 holding registers from address 5 on, function 10\n", "write", place, 5, 1, 2)
    mbm.fails(EXCEPTION, REFUSED.format("01", "function"), "write", place, 7, 1, *PATIENT)
    mbm.prints("unit 1: wrote 1 holding register from address 7 on, function 10\n", "write", place, 7, 1, "--write-function", "multiple")
    mbm.fails(EXCEPTION, REFUSED.format("01", "function"), "write", place, 8, 1, "--multiple", *PATIENT)
    mbm.prints("unit 1: wrote 1 holding register from address 8 on, function 06\n", "write", place, 8, 1, "--write-function", "single")


def test_a_write_of_one_function_alone_has_one_value(plain):
    plain.fails(2, "--write-function single writes one register, and these are 2", "write", "tcp://127.0.0.1:1", 0, 1, 2, "--write-function", "single")
    plain.fails(2, "--write-function single writes one coil, and these are 3", "write", "tcp://127.0.0.1:1", 0, "-t", "coils", 1, 0, 1,
                "--write-function", "single")
    plain.fails(2, '--write-function "both" is not one of single and multiple', "write", "tcp://127.0.0.1:1", 0, 1, "--write-function", "both")


# --- the bridge ---

WRITABLE = """\
interval: 200ms
{}fields:
- {{name: level, table: holding, address: 0, type: uint16, access: read-write}}
- {{name: step, table: holding, address: 1, type: uint16, access: read-write, write_function: single}}
- {{name: lamp, table: coils, address: 2, access: read-write}}
"""


def answer(pdu):
    """A device that takes every write, and whose registers and coils are 0."""
    if pdu[0] == 3:
        return number(0) if pdu[4] == 1 else bytes([3, 2 * pdu[4]]) + bytes(2 * pdu[4])
    return b"\x01\x01\x00" if pdu[0] == 1 else pdu[:5]


@pytest.mark.parametrize("head, options, wanted", [
    ("", (), {"level": "0600000007", "step": "0600010007", "lamp": "050002ff00"}),
    ("write_function: multiple\n", (), {"level": "1000000001020007", "step": "0600010007", "lamp": "0f000200010101"}),
    ("", ("--write-function", "multiple"), {"level": "1000000001020007", "step": "0600010007", "lamp": "0f000200010101"}),
    ("write_function: single\n", ("--write-function", "multiple"), {"level": "0600000007", "step": "0600010007", "lamp": "050002ff00"}),
])
def test_the_bridge_writes_by_the_function_that_the_device_has(plain, folder, write, head, options, wanted):
    device, broker = TcpDevice(answer), Broker(folder).come()
    plain.begin("bridge", "-b", broker.place, "-t", "hall", *options, device.line, write("device.yaml", WRITABLE.format(head)))
    subscriber = Subscriber(broker)
    subscriber.expect_last("hall/unit/1/status", "online")
    for name, pdu in wanted.items():
        broker.publish(f"hall/{name}/set", "true" if name == "lamp" else "7")
        assert wait(lambda: (1, pdu) in device.asked), (pdu, device.asked)


def test_the_bridge_refuses_a_field_that_its_function_cannot_write(plain, write):
    text = "fields: [{name: level, table: holding, address: 0, type: uint32, access: read-write}]\n"
    plain.fails(2, "level: write_function single writes one coil or register, and the field has more", "bridge", "--check",
                "--write-function", "single", "tcp://127.0.0.1:1", write("device.yaml", text))


# --- fields that the device does not have ---

def polled(mbm, line, path):
    found = mbm("poll", line, path, "--once", "--json", *PATIENT)
    assert found.code == EXCEPTION, found
    return {one["name"]: (one["value"], one["status"]) for one in map(json.loads, found.out.splitlines())}, found.error


NOT_THERE = (None, "exception 02: illegal data address")


def test_fields_that_pymodbus_does_not_have_are_named_and_the_others_read(mbm, write):
    port = served(lambda: ModbusTcpServer(ten_registers(), address=("127.0.0.1", 0)))
    path = write("device.yaml", "unit: 17\nfields:\n- {name: level, table: holding, address: 98, type: uint16, repeat: {count: 14, every: 1}}\n")
    values, said = polled(mbm, f"tcp://127.0.0.1:{port}", path)
    assert values == {f"level {n + 1}": (1000 + n - 2, "success") if 2 <= n < 12 else NOT_THERE for n in range(14)}
    assert "mbm poll: the device refuses 4 of 14 fields: level 1, level 2, level 13, level 14. The others are read without them.\n" in said


def test_a_field_that_mbm_serve_does_not_have_is_named(mbm, write):
    place = mbm.serve("tcp://127.0.0.1:0", write("served.yaml", """\
fields:
- {name: level, table: holding, address: 0, type: uint16, count: 30, value: [%s]}
- {name: after, table: holding, address: 31, type: uint16, count: 30, value: [%s]}
""" % (", ".join(map(str, range(30))), ", ".join(map(str, range(31, 61))))))
    path = write("device.yaml", "fields:\n- {name: level, table: holding, address: 0, type: uint16, repeat: {count: 61, every: 1, first: 0}}\n")
    values, said = polled(mbm, place, path)
    assert values == {f"level {n}": (n, "success") if n != 30 else NOT_THERE for n in range(61)}
    assert "field level 30 in line 2 of the file: exception 02" in said and "refuses" not in said


def test_a_device_that_refuses_long_reads_is_read_in_shorter_ones(plain, write):
    def short(pdu):
        return bytes([0x83, 3]) if pdu[4] > 80 else bytes([3, 2 * pdu[4]]) + b"".join((pdu[2] + i).to_bytes(2, "big") for i in range(pdu[4]))

    device = TcpDevice(short)
    path = write("device.yaml", "fields:\n- {name: level, table: holding, address: 0, type: uint16, repeat: {count: 120, every: 1, first: 0}}\n")
    found = plain("poll", device.line, path, "--once", "--json", "-q", *PATIENT)
    assert found.code == DONE, found
    assert [one["value"] for one in map(json.loads, found.out.splitlines())] == list(range(120))


def test_the_bridge_logs_a_field_that_the_device_does_not_have(plain, folder, write):
    def without(pdu):
        return bytes([0x83, 2]) if pdu[2] <= 5 < pdu[2] + pdu[4] else bytes([3, 2 * pdu[4]]) + bytes(2 * pdu[4])

    device, broker = TcpDevice(without), Broker(folder).come()
    path = write("device.yaml", "fields:\n- {name: level, table: holding, address: 0, type: uint16, repeat: {count: 10, every: 1, first: 0}}\n")
    bridge = plain.begin("bridge", "-b", broker.place, "-t", "hall", device.line, path)
    subscriber = Subscriber(broker)
    for n in range(10):
        if n != 5:
            subscriber.expect_value(f"hall/level_{n}", 0)
    assert "unit 1 refuses level 5: exception 02: illegal data address" in bridge.await_line("refuses")


# --- SunSpec ---

def chain(base, models, lacks=(), longest=125):
    """A device with a chain of models: (id, length) pairs, or more words of the body."""
    words = {base: 0x5375, base + 1: 0x6E53}
    at = base + 2
    for model, length, *body in models:
        words.update({at: model, at + 1: length, **{at + 2 + i: body[i] if i < len(body) else 0 for i in range(length)}})
        at += 2 + length

    def answer(pdu):
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        if count > longest or any(address not in words for address in range(first, first + count)):
            return bytes([0x83, 2])
        return bytes([3, 2 * count]) + b"".join(words[address].to_bytes(2, "big") for address in range(first, first + count))

    return TcpDevice(answer)


def letters(text):
    padded = text.encode().ljust(32, b"\0")
    return [int.from_bytes(padded[i:i + 2], "big") for i in range(0, 32, 2)]


COMMON = (1, 66, *letters("Example"), *letters("Inverter 5"))
END_OF_CHAIN = (0xFFFF, 0)


@pytest.mark.parametrize("base", [40000, 0, 50000])
@pytest.mark.parametrize("longest", [125, 5, 1])
def test_scan_lists_the_models_of_sunspec_wherever_they_begin(mbm, base, longest):
    device = chain(base, [COMMON, (103, 50), (64110, 3), (555, 1), END_OF_CHAIN], longest=longest)
    mbm.prints(f"unit 1: SunSpec at holding register {base}: Example Inverter 5\n"
               f"{base + 2:5}  model     1   66 registers  common\n"
               f"{base + 70:5}  model   103   50 registers  inverter, three phase\n"
               f"{base + 122:5}  model 64110    3 registers  vendor's\n"
               f"{base + 127:5}  model   555    1 registers  \n", "scan", device.line, "--sunspec")


def test_scan_lists_models_as_json(mbm):
    device = chain(0, [COMMON, (203, 105), END_OF_CHAIN])
    found = mbm("scan", device.line, "--sunspec", "--units", "3", "--json", *PATIENT)
    assert found.code == DONE
    assert [json.loads(line) for line in found.out.splitlines()] == [
        {"unit": 3, "base": 0, "address": 2, "model": 1, "name": "common", "length": 66, "manufacturer": "Example", "device": "Inverter 5",
         "code": 0, "status": "success"},
        {"unit": 3, "base": 0, "address": 70, "model": 203, "name": "meter, wye-connected three phase", "length": 105, "code": 0,
         "status": "success"}]


def test_scan_lists_the_models_of_a_pymodbus_server(mbm):
    from pymodbus.simulator import DataType, SimData, SimDevice

    values = [0x5375, 0x6E53, *COMMON, *[0] * (66 - 32), 103, 50, *[0] * 50, 0xFFFF, 0]
    device = SimDevice(17, simdata=[SimData(40000, values=values, datatype=DataType.REGISTERS)])
    port = served(lambda: ModbusTcpServer(device, address=("127.0.0.1", 0)))
    found = mbm("scan", f"tcp://127.0.0.1:{port}", "--sunspec", "--units", 17, *PATIENT)
    assert found.code == DONE and "Example Inverter 5" in found.out and "40070  model   103" in found.out


@pytest.mark.parametrize("models, code, sentence", [
    ([COMMON, (103, 50)], peers.DAMAGED, "leads to address 122, which the device refuses: exception 02: illegal data address"),
    ([COMMON, (103, 65500), END_OF_CHAIN], peers.DAMAGED, "leads to address 65572, beyond the last one, 65535"),
    ([COMMON, (0, 0)], peers.DAMAGED, "has no end: at address 70 stands model 0"),
    ([(5, 0)] * 501 + [END_OF_CHAIN], peers.DAMAGED, "has no end: at address 1002 stands model 5"),
])
def test_a_wrong_chain_of_sunspec_ends_with_a_sentence(mbm, models, code, sentence):
    found = mbm("scan", chain(0, models).line, "--sunspec", *PATIENT)
    assert found.code == code and sentence in found.error, found


def test_a_device_without_sunspec_is_named(mbm):
    mbm.fails(EXCEPTION, "unit 1 has no SunSpec models", "scan", chain(7, []).line, "--sunspec", *PATIENT)
    mbm.fails(2, "--sunspec reads at the rate and parity of LINE", "scan", "rtu:/dev/null", "--sunspec", "--rates", "9600")
