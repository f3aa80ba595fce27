"""What people reported of limits of devices, of the function that a device insists on, and of the addresses in its manual, replayed by
the number of the report with a device file. The symptom of each stands before it, in our words."""

import json

import pytest
from peers import DONE, EXCEPTION, NO_REPLY, PATIENT, WRONG, TcpDevice, bits, word
from services import Broker, Subscriber


class Reported(TcpDevice):
    """A device of unit 1: what it has, how much one request reads, and which functions it refuses and how. Its registers are those of
    `words`, or all; `held` has what was written."""

    def __init__(self, words=None, most=125, refused=(), code=2, before_write=None):
        self.words, self.most, self.refused, self.code, self.held = words, most, refused, code, {}
        self.before_write = before_write
        super().__init__(self.take)

    def take(self, pdu):
        function, first = pdu[0], int.from_bytes(pdu[1:3], "big")
        if function in self.refused:
            return bytes([function | 0x80, 1])
        if function in (5, 6):
            self.put(first, [int.from_bytes(pdu[3:5], "big")])
            return pdu
        count = int.from_bytes(pdu[3:5], "big")
        if function == 15:
            self.put(first, [0xFF00 * (pdu[6 + i // 8] >> i % 8 & 1) for i in range(count)])
            return pdu[:5]
        if function == 16:
            self.put(first, [int.from_bytes(pdu[6 + 2 * i:8 + 2 * i], "big") for i in range(count)])
            return pdu[:5]
        addresses = range(first, first + count)
        if count > self.most or (self.words is not None and not all(address in self.words for address in addresses)):
            return bytes([function | 0x80, self.code])
        if function in (1, 2):
            return bytes([function, (count + 7) // 8]) + sum(one << i for i, one in enumerate(bits(first, count))).to_bytes((count + 7) // 8, "little")
        return bytes([function, 2 * count]) + b"".join(self.get(address).to_bytes(2, "big") for address in addresses)

    def put(self, first, values):
        if self.before_write:
            self.before_write(self, first)
        self.held.update(zip(range(first, first + len(values)), values))

    def get(self, address):
        return self.held.get(address, (self.words or {}).get(address, word(address)))


def polled(mbm, write, device, text, code=DONE, rounds=1):
    found = mbm("poll", device.line, write("device.yaml", text), "--rounds", rounds, "--json", *PATIENT)
    assert found.code == code, found
    return {one["name"]: one["value"] for one in map(json.loads, found.out.splitlines())}, found.error


def levels(count, head="", table="holding", first=0, more=""):
    return f"{head}fields:\n- {{name: level, table: {table}, address: {first}, type: uint16, repeat: {{count: {count}, every: 1, first: 0}}{more}}}\n"


# --- limits: item 4 of the table of keys in docs/device-file.md, "Limits"

@pytest.mark.parametrize("report, count, most, head", [
    # A three-phase meter reads at most 40 floats at once: 80 registers.
    ("influxdata/telegraf#8151", 120, 80, "max_read_registers: 80\n"),
    # The manual of such a meter says 80, and some refuse from 51 registers on.
    ("openWB/core#2890", 96, 50, "max_read_registers: 50\n"),
    # A heat pump has 171 registers in a row, and does not send them in the requests that a program makes by itself.
    ("modbus2mqtt/modbus2mqtt#283", 171, 60, "max_read_registers: 60\n"),
    # A controller that reads fewer than 125 at once.
    ("influxdata/telegraf#16873", 501, 100, "max_read_registers: 100\n"),
])
def test_a_device_reads_fewer_registers_at_once_than_the_standard_allows(mbm, write, report, count, most, head):
    wanted = {f"level {n}": word(n) for n in range(count)}
    device = Reported(most=most)
    values, said = polled(mbm, write, device, levels(count, head))
    assert values == wanted and "refuse" not in said, report
    assert [quantity for _, _, quantity in device.requests() if quantity > most] == []
    # Without the key mbm finds it out.
    device = Reported(most=most)
    assert polled(mbm, write, device, levels(count))[0] == wanted
    assert polled(mbm, write, Reported(most=most, code=3), levels(count))[0] == wanted


def test_a_device_that_does_not_answer_long_reads_is_told_from_one_that_is_away(mbm, write):
    """influxdata/telegraf#8151: other meters do not answer a read that is too long at all."""
    class Silent(Reported):
        def take(self, pdu):
            return None if pdu[4] > 80 else super().take(pdu)

    fields = levels(120) + "- {name: other, table: input, address: 0, type: uint16}\n"
    found = mbm("poll", Silent().line, write("device.yaml", fields), "--once", "-q", "--timeout", "300ms")
    assert found.code == NO_REPLY and ("unit 1 did not answer within 300ms. It answers other requests. Some devices do not answer a read of more "
                                       "registers than they can send, here 120: try max_read_registers in the file.") in found.error
    assert polled(mbm, write, Silent(), "max_read_registers: 80\n" + fields)[0]["level 119"] == word(119)
    found = mbm("poll", TcpDevice(lambda pdu: None).line, write("device.yaml", fields), "--once", "-q", "--timeout", "300ms")
    assert "It answers other" not in found.error and "Check the unit's number" in found.error


def test_an_address_that_the_device_lacks_costs_no_other_value(mbm, write):
    """influxdata/telegraf#14671: one address in the file that the battery does not have, and nothing was read any more."""
    words = {address: address for address in range(40) if address not in (17, 18)}
    values, said = polled(mbm, write, Reported(words), levels(40), EXCEPTION)
    assert values == {f"level {n}": words.get(n) for n in range(40)}
    assert "the device refuses 2 of 40 fields: level 17, level 18. The others are read without them." in said
    # What is known to be missing is excluded, and a gap does not read over it.
    text = "gap: 20\nexcluded: [holding: 17-18]\nfields:\n- {name: a, table: holding, address: 16, type: uint16}\n- {name: b, table: holding, address: 19, type: uint16}\n"
    device = Reported(words)
    assert polled(mbm, write, device, text)[0] == {"a": 16, "b": 19}
    assert device.requests() == [(3, 16, 1), (3, 19, 1)]


def test_a_hole_between_two_fields_is_not_read(mbm, write):
    """ioBroker/ioBroker.modbus#581: the device has 11174, 11176 and 11177, and refuses whatever touches 11175."""
    words = {11174: 1, 11176: 2, 11177: 3}
    text = "fields:\n" + "".join(f"- {{name: f{at}, table: holding, address: {at}, type: uint16}}\n" for at in words)
    device = Reported(words)
    assert polled(mbm, write, device, text)[0] == {"f11174": 1, "f11176": 2, "f11177": 3}
    assert device.requests() == [(3, 11174, 1), (3, 11176, 2)]
    # With a gap that is too large the fields come all the same.
    assert polled(mbm, write, Reported(words), "gap: 10\n" + text)[0] == {"f11174": 1, "f11176": 2, "f11177": 3}


def test_a_relay_board_that_reads_eight_coils_or_none(mbm, write):
    """home-assistant/core#53826: the board answers a read of eight coils alone."""
    class Eight(Reported):
        def take(self, pdu):
            return b"\x81\x03" if pdu[3:5] != b"\0\x08" else super().take(pdu)

    text = "fields: [{name: relays, table: coils, address: 0, count: 8, access: read-write}]\n"
    assert polled(mbm, write, Eight(), text)[0] == {"relays": [bool(one) for one in bits(0, 8)]}


def test_a_text_and_a_register_at_the_end_of_the_table(mbm, write):
    """influxdata/telegraf#15138: fields from 65524 on were left out without a word."""
    words = {65524 + i: 0x4142 for i in range(10)} | {65534: 5, 65535: 6}
    text = ("fields:\n- {name: name, table: holding, address: 65524, type: text, count: 20}\n- {name: state, table: holding, address: 65534, type: uint16}\n"
            "- {name: last, table: holding, address: 65535, type: uint16}\n")
    assert polled(mbm, write, Reported(words), text)[0] == {"name": "AB" * 10, "state": 5, "last": 6}


# --- the function that writes

@pytest.fixture
def hall(plain, folder, write):
    """Begins a bridge for a device; returns what writes to its fields."""

    def begin(device, text):
        broker = Broker(folder).come()
        plain.begin("bridge", "-b", broker.place, "-t", "hall", *PATIENT, device.line, write("device.yaml", text))
        subscriber = Subscriber(broker)
        subscriber.expect_last("hall/status", "online")
        return lambda name, payload, pattern="success": subscriber.expect_result(f"hall/{name}", payload, pattern)

    return begin


def writes(device):
    return [(unit, pdu) for unit, pdu in device.asked if int(pdu[:2], 16) > 4]


HOLDING = "fields:\n- {{name: state, table: holding, address: {}, type: uint16, access: read-write}}\n"


@pytest.mark.parametrize("report, refused, head, field, payload, sent", [
    # A ventilation unit answers function 06 with exception 01, and takes one register with 10 (hex).
    ("esphome/issues#2709", [6], "write_function: multiple\n", HOLDING.format(1000), "1", "1003e80001020001"),
    ("home-assistant/core#45079", [6], "write_function: multiple\n", HOLDING.format(7), "500", "100007000102" "01f4"),
    # A device of unit 7 answers function 05 with exception 01, and takes one coil with 0F.
    ("home-assistant/core#45750", [5], "write_function: multiple\nunit: 7\n", "fields:\n- {name: state, table: coils, address: 145, access: read-write}\n", "true", "0f009100010101"),
    # An air conditioner and a frequency inverter have 06 alone.
    ("favalex/modbus-cli#6", [16], "", HOLDING.format(9), "3", "0600090003"),
    ("LinuxCNC/linuxcnc#487", [16], "write_function: single\n", HOLDING.format(9), "3", "0600090003"),
])
def test_a_device_takes_writes_by_one_function_alone(hall, report, refused, head, field, payload, sent):
    device = Reported(refused=refused)
    hall(device, head + field)("state", payload)
    assert writes(device) == [(7 if "unit: 7" in head else 1, sent)], report


def test_a_relay_module_is_written_by_function_10_on_the_command_line(mbm):
    """epsilonrt/mbpoll#32."""
    device = Reported(refused=[6])
    assert "exception 01" in mbm("write", device.line, 4, 1, *PATIENT).error
    mbm.prints("unit 1: wrote 1 holding register from address 4 on, function 10\n", "write", device.line, 4, 1, "--write-function", "multiple")
    assert device.held == {4: 1}


def test_an_inverter_refuses_function_10_for_one_register_and_takes_06(hall):
    """andig/gosunspec#13: the limit of power at 40217 of unit 71."""
    class Inverter(Reported):
        def take(self, pdu):
            return b"\x90\x02" if pdu[0] == 16 and pdu[3:5] == b"\0\1" else super().take(pdu)

    device = Inverter()
    hall(device, "unit: 71\n" + HOLDING.format(40217))("state", "30")
    assert writes(device) == [(71, "069d19001e")]


COUNTER = "fields:\n- {{name: counter, table: holding, address: 13056, type: uint32, order: CDAB, access: read-write{}}}\n"


def test_both_halves_of_a_number_are_written_in_one_request(hall):
    """Azure/iot-edge-modbus#67: a write of one half clears the other one, so that two writes leave (0, 1) of (4400, 1)."""
    device = Reported(before_write=lambda device, first: device.held.update({13056: 0, 13057: 0}))
    hall(device, COUNTER.format(""))("counter", str(4400 + 65536))
    assert device.held == {13056: 4400, 13057: 1}
    assert writes(device) == [(1, "1033000002041130" "0001")]


def test_a_number_of_two_registers_is_not_written_in_two_requests(plain, write, hall):
    """pyhys/minimalmodbus#38: a device that has function 06 alone, and a number of 32 bits. The half that is written first makes
    another number of it. Two fields write it, in the order that the program chooses."""
    plain.fails(WRONG, 'device.yaml:2: the field has 2 registers, and "write_function: single" writes one', "poll", "tcp://127.0.0.1:1",
                write("device.yaml", COUNTER.format(", write_function: single")))
    device = Reported(refused=[16])
    half = "- {{name: {}, table: holding, address: {}, type: uint16, access: read-write}}\n"
    put = hall(device, "write_function: single\nfields:\n" + half.format("low", 13056) + half.format("high", 13057))
    put("high", "1")
    put("low", "4400")
    assert writes(device) == [(1, "0633010001"), (1, "0633001130")]


# --- addresses as the manual prints them

@pytest.mark.parametrize("report, head, address, asked", [
    # The manual of a storage system counts from 1: its first register, 40001, is 40000 on the wire, and no 0 of the notation modicon.
    ("home-assistant/core#11299", "one_based: yes\n", "table: holding, address: 40001", (3, 40000, 1)),
    # The register that a manual names 5636 is 5635 on the wire.
    ("AndreySV/check_modbus#11", "one_based: yes\n", "table: holding, address: 5636", (3, 5635, 1)),
    # A manual names 40110, and the device has it at 109.
    ("serhmarch/ModbusTools#83", "notation: modicon\n", "address: 40110", (3, 109, 1)),
    # Six digits.
    ("MicrosoftDocs/azure-docs#31815", "notation: modicon\n", "address: 400001", (3, 0, 1)),
    # A charger's manual has the addresses of the wire, and people know those with 30001.
    ("goecharger/go-eCharger-API-v2#107", "notation: modicon\n", "address: 30101", (4, 100, 1)),
    ("goecharger/go-eCharger-API-v2#107", "", "table: input, address: 100", (4, 100, 1)),
    # 30847 of an inverter is the address on the wire: no notation.
    ("home-assistant/home-assistant.io#31760", "", "table: input, address: 30847", (4, 30847, 1)),
    # A device whose register 0 was read as 1.
    ("edgexfoundry/device-modbus-go#272", "", "table: holding, address: 0", (3, 0, 1)),
])
def test_an_address_of_a_manual_is_this_one_on_the_wire(mbm, write, report, head, address, asked):
    device = Reported()
    values, _ = polled(mbm, write, device, f"{head}fields: [{{name: a, {address}, type: uint16}}]\n")
    assert (values["a"], device.requests()) == (word(asked[1]), [asked]), report


def test_floats_that_are_read_one_address_late_come_from_two_values(mbm, write):
    """influxdata/telegraf#8151: with the addresses of the manual, which count from 1, the numbers were made of halves of two floats, and
    an order of bytes was found that made some of them look right."""
    words = dict(enumerate([0x4366, 0x199A, 0x4367, 0x3333, 0x4365, 0x8000]))
    names = ("L1", "L2", "L3")
    text = "fields:\n" + "".join(f"- {{name: {name}, table: input, address: {2 * i + 1}, type: float, precision: 1}}\n" for i, name in enumerate(names))
    assert polled(mbm, write, Reported(words), "one_based: yes\n" + text)[0] == {"L1": 230.1, "L2": 231.2, "L3": 229.5}
