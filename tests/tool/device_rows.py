"""The keys of a device file, each with what a device has in its registers, what mbm reads there, and what mbm writes:
test_device_keys.py plays each row against a server of libmodbus, one of pymodbus and mbm serve."""

import dataclasses
import json
import time

from peers import bit, tcp_frame, word
from test_types import TYPES, is_text

# Keys that say nothing about registers and requests. Those of Home Assistant: test_device_home.py.
NOT_ON_THE_WIRE = set("device fields name description unit_of_measurement device_class state_class".split())
# The registers and coils that a device has first are those of `mbm serve` too: of its tables input and discrete nothing can be
# written, so the values there are those that libmodbus's and pymodbus's servers have at first.
INPUT = lambda address: word(address) ^ 0xFFFF
DISCRETE = lambda address: not bit(address)


@dataclasses.dataclass
class Row:
    keys: str
    text: str  # of the file, with the values of mbm serve
    values: dict  # what mbm poll reads, by the names of fields
    held: dict = dataclasses.field(default_factory=dict)  # the holding registers from an address on
    coils: dict = dataclasses.field(default_factory=dict)
    # What mbm bridge writes: field, payload, result, and if that is "success" function, address, and the registers or coils there.
    writes: list = dataclasses.field(default_factory=list)
    reads: list = None  # the requests of a round: function, address, quantity
    units: set = dataclasses.field(default_factory=lambda: {17})
    manner: type = None  # what the device does with requests and replies: a class of its own for each connection to mbm
    rounds: int = 1
    options: tuple = ("--timeout", "2s")
    statuses: set = dataclasses.field(default_factory=lambda: {"success"})
    check: object = None  # a further look at the device after the last round

    @property
    def name(self):
        return self.keys.replace(" ", ",")


def field(name, address, more, table="holding"):
    return f"- {{name: {name}, table: {table}, address: {address}, {more}}}\n"


def file(*fields, head="unit: 17\n"):
    return head + "fields:\n" + "".join(fields)


# --- manners of devices

class OtherNumbers:
    """Answers as unit 0 with a transaction number of its own."""

    def reply(self, transaction, unit, pdu):
        return tcp_frame(transaction + 7 & 0xFFFF, 0, pdu)


class FourBytes:
    """Sends two bytes more than requested."""

    def reply(self, transaction, unit, pdu):
        return tcp_frame(transaction, unit, pdu if pdu[0] != 3 else bytes([3, pdu[1] + 2]) + pdu[2:] + b"\xee\xee")


class LosesTheFirst:
    """Does not answer the first request."""

    count = 0

    def reply(self, transaction, unit, pdu):
        self.count += 1
        return tcp_frame(transaction, unit, pdu) if self.count > 1 else None


class Late:
    """Answers after the timeout that a file without the key has."""

    def reply(self, transaction, unit, pdu):
        time.sleep(1.5)
        return tcp_frame(transaction, unit, pdu)


class BusyFirst(LosesTheFirst):
    """Refuses the first request with exception 06."""

    def reply(self, transaction, unit, pdu):
        return super().reply(transaction, unit, pdu) or tcp_frame(transaction, unit, bytes([pdu[0] | 0x80, 6]))


def waits_after_connecting(device):
    assert device.begun[0] - device.started >= 0.7


def waits_between(device):
    assert all(begun - ended >= 0.08 for begun, ended in zip(device.begun[1:], device.ended)), device


def waits_when_busy(device):
    assert device.begun[1] - device.ended[0] >= 0.3


def closes_after_a_round(device):
    """Both requests of the first round have one connection, and the next one has another."""
    assert len(device.opened) > 1 and device.opened[1] > device.ended[1]


def reads_slow_fields_once(device):
    asked = [address for _, address, _ in device.requests()]
    assert asked.count(20) == 1 and asked.count(40) > 1 and asked.count(60) == 1, asked


# --- types, all in one file, eight registers apart

def types_of_file():
    fields, held, values, writes = [], {}, {}, []
    for at, (options, value, registers) in enumerate(TYPES):
        more = dict(zip((one.lstrip("-").replace("time-zone", "time_zone") for one in options[1::2]), options[2::2]))
        if "o" in more:
            more["order"] = more.pop("o")
        if options[0].startswith("text"):
            more["count"] = len(value) + (len(value) % 2 if options[0] == "text_spaces" else 0)
        keys = {"type": options[0], "access": "read-write", **more, "value": value if is_text(value) else json.loads(value)}
        fields.append(field(f"f{at}", 8 * at, json.dumps(keys)[1:-1]))
        held[8 * at] = [int(registers[i:i + 4], 16) for i in range(0, len(registers), 4)]
        values[f"f{at}"] = keys["value"]
        # Another value stands there before, since mbm writes what it is told in any case.
        writes.append((f"f{at}", value, 6 if len(held[8 * at]) == 1 else 16, 8 * at, held[8 * at]))
    return Row("type layout count time_zone order", file(*fields), values, held, writes=writes)


REPEATED = """\
unit: 17
fields:
- repeat: {count: 3, every: 40}
  fields:
  - {name: "channel {n} level", table: holding, address: 10, type: uint16, value: 7, access: read-write}
  - {name: relay, table: coils, address: 11, value: on}
- {name: last, table: holding, address: 2, type: uint16, repeat: {count: 3, every: 1, first: 0}}
"""
EXCLUDED = """\
max_read_registers: 10
max_read_bits: 20
max_write_registers: 2
max_write_bits: 3
excluded: [holding: 25-26]
gap: {registers: 3, bits: 30}
unit: 17
fields:
- {name: level, table: holding, address: 0, type: uint16, repeat: {count: 25, every: 1, first: 0}, value: 5}
- {name: after, table: holding, address: 27, type: uint16, value: 6}
- {name: near, table: holding, address: 31, type: uint32, value: 7, access: read-write}
- {name: hole, table: holding, address: 28, type: uint16, count: 3}
- {name: relay, table: coils, address: 100, repeat: {count: 3, every: 19, first: 0}}
- {name: between, table: coils, address: 101, count: 18}
- {name: lamps, table: coils, address: 300, count: 3, access: read-write}
"""


def modicon(level, inverse, relay, state, head="notation: modicon\nunit: 17\n", tables=("", "", "", "")):
    """The same four fields in another notation of their addresses."""
    holding, given, coils, discrete = tables
    return Row("notation table address" if "modicon" in head else "one_based table address", file(
        f"- {{name: level, address: {level}, {holding}type: uint16, access: read-write, value: 500}}\n",
        f"- {{name: inverse, address: {inverse}, {given}type: uint16, value: {INPUT(8)}}}\n",
        f"- {{name: relay, address: {relay}, {coils}access: read-write, value: on}}\n",
        f"- {{name: state, address: {state}, {discrete}value: {'on' if DISCRETE(30) else 'off'}}}\n", head=head),
        {"level": 500, "inverse": INPUT(8), "relay": True, "state": DISCRETE(30)}, {100: [500]}, {30: [1]},
        writes=[("level", "70", 6, 100, [70]), ("relay", "false", 5, 30, [0])],
        reads=[(3, 100, 1), (4, 8, 1), (1, 30, 1), (2, 30, 1)])


ROWS = [
    Row("unit", file(field("a", 0, "type: uint16, value: 5, access: read-write"), field("b", 490, f"type: uint16, unit: 23, value: {word(490)}"), head="unit: 0\n"),
        {"a": 5, "b": word(490)}, {0: [5]}, units={0, 23}, writes=[("a", "9", 6, 0, [9])]),
    Row("interval", file(field("a", 20, "type: uint16, value: 1"), field("b", 40, "type: uint16, value: 2, interval: 100ms"),
                         field("c", 60, "type: uint16, value: 3, interval: 1h"), head="unit: 17\ninterval: 30m\n"),
        {"a": 1, "b": 2, "c": 3}, {20: [1], 40: [2], 60: [3]}, rounds=3, check=reads_slow_fields_once),
    Row("order type", file(field("a", 0, "type: uint32, value: 305419896, access: read-write"),
                           field("b", 2, "type: float, order: DCBA, value: 21.5, access: read-write"),
                           field("c", 4, "type: double, order: CDABGHEF, value: 0.1, access: read-write"),
                           field("d", 8, "type: int64, order: ABCD, value: -2, access: read-write"),
                           field("e", 12, "type: text, count: 4, order: BADC, value: Ab, access: read-write"), head="unit: 17\norder: CDAB\n"),
        {"a": 0x12345678, "b": 21.5, "c": 0.1, "d": -2, "e": "Ab"},
        {0: [0x5678, 0x1234], 2: [0x0000, 0xAC41], 4: [0x9999, 0x3FB9, 0x999A, 0x9999], 8: [0xFFFF] * 3 + [0xFFFE], 12: [0x6241, 0]},
        writes=[("a", "1", 16, 0, [1, 0]), ("b", "-2", 16, 2, [0, 0x00C0]), ("c", "-2", 16, 4, [0, 0xC000, 0, 0]),
                ("d", "258", 16, 8, [0, 0, 0, 258]), ("e", '"xyz"', 16, 12, [0x7978, 0x007A])]),
    Row("table address count value access bit mask_write", file(
        field("words", 0, "type: int16, count: 3, value: [1, -2, 3], access: read-write"), field("seen", 5, f"type: uint16, value: {INPUT(5)}", "input"),
        field("state", 6, f"value: {'on' if DISCRETE(6) else 'off'}", "discrete"), field("lamps", 8, "count: 3, value: [on, off, on], access: read-write", "coils"),
        field("part", 10, "type: bit, bit: 4, count: 3, value: 5, access: read-write"), field("wide", 12, "type: uint32, bits: 20-23, value: 9, access: read-write"),
        field("command", 20, "type: uint16, access: write"), head="unit: 17\nmask_write: yes\n"),
        {"words": [1, -2, 3], "seen": INPUT(5), "state": DISCRETE(6), "lamps": [True, False, True], "part": 5, "wide": 9},
        {0: [1, 0xFFFE, 3], 10: [0x0050], 12: [0x0090]}, {8: [1, 0, 1]},
        writes=[("words", "[4, 5, -6]", 16, 0, [4, 5, 0xFFFA]), ("lamps", "[false, true, true]", 15, 8, [0, 1, 1]), ("part", "2", 22, 10, [0x0020]),
                ("wide", "6", 22, 12, [0x0060]), ("command", "700", 6, 20, [700]), ("seen", "1", "the field is not writable")]),
    Row("bits", file(field("mode", 40, "type: uint32, bits: 12-19, value: 165"), field("flags", 44, "type: uint64, bits: 0-0, value: 1")),
        {"mode": 165, "flags": 1}, {40: [0x000A, 0x5000], 47: [1]}),
    types_of_file(),
    Row("time_zone layout", file(field("clock", 0, 'type: date, layout: yM Dh ms, value: "2026-11-27T20:15:30+01:00", access: read-write'),
                                 field("since", 4, 'type: unix32, time_zone: Z, value: "1970-01-01T00:00:07Z", access: read-write'), head="unit: 17\ntime_zone: +01:00\n"),
        {"clock": "2026-11-27T20:15:30+01:00", "since": "1970-01-01T00:00:07Z"}, {0: [0x1A0B, 0x1B14, 0x0F1E], 4: [0, 7]},
        writes=[("clock", "2027-01-01T00:00:00Z", 16, 0, [0x1B01, 0x0101, 0]), ("since", "1970-01-01T01:00:09+01:00", 16, 4, [0, 9]),
                ("clock", "2027-02-29T00:00:00Z", "the date is a date that does not exist")]),
    Row("scale offset precision", file(
        field("a", 0, "type: uint16, scale: 0.1, offset: -273.15, precision: 1, value: 26.85, access: read-write"),
        field("power", 1, "type: int16, scale: sf, value: 123.4, access: read-write"), field("sf", 2, "type: int16, value: -1"),
        field("b", 3, "type: int32, scale: -25e-2, value: -1.25, access: read-write")),
        {"a": 26.9, "power": 123.4, "sf": -1, "b": -1.25}, {0: [3000, 1234, 0xFFFF, 0, 5]},
        writes=[("a", "20.05", 6, 0, [2932]), ("a", "20", "the number is not the offset and a multiple of the scale"), ("power", "-5.5", 6, 1, [0xFFC9]),
                ("b", "0.5", 16, 3, [0xFFFF, 0xFFFE])]),
    Row("not_available", file(
        field("a", 0, "type: int16, value: 5"), field("b", 1, "type: int16, value: -32768"), field("c", 2, "type: uint32, not_available: [0x7FFFFFFF, 3], value: 3"),
        field("d", 4, "type: uint16, not_available: none, value: 65535"), field("e", 5, "type: int16, count: 3, value: [1, -32768, 3]"),
        field("f", 8, "type: float, value: 1.5"), head="unit: 17\nnot_available: standard\n"),
        {"a": 5, "b": None, "c": None, "d": 65535, "e": [1, None, 3], "f": 1.5}, {0: [5, 0x8000, 0, 3, 0xFFFF, 1, 0x8000, 3, 0x3FC0, 0]},
        statuses={"success", "not available"}),
    Row("min_value max_value step", file(field("a", 7, "type: int16, scale: 0.1, value: 20, access: read-write, min_value: 5, max_value: 30, step: 0.5")),
        {"a": 20}, {7: [200]},
        writes=[("a", "5.5", 6, 7, [55]), ("a", "4.5", "the number is less than min_value, which is 5"),
                ("a", "30.5", "the number is greater than max_value, which is 30"),
                ("a", "5.2", "the number is not min_value, 5, and a multiple of step, which is 0.5")]),
    Row("enumeration", file(field("mode", 3, "type: uint16, value: 1, access: read-write, enumeration: {0: manual, 1: automatic}")),
        {"mode": 1}, {3: [1]},
        writes=[("mode", "0", 6, 3, [0])]),
    Row("press", file(field("reset", 9, "type: uint16, access: write, press: 3"), field("a", 8, "type: uint16, value: 4")), {"a": 4}, {8: [4]},
        writes=[("reset", "3", 6, 9, [3])]),
    Row("repeat", REPEATED, {**{f"channel {n} level": 7 for n in (1, 2, 3)}, **{f"relay {n}": True for n in (1, 2, 3)}, **{f"last {n}": 0 for n in range(3)}},
        {10: [7], 50: [7], 90: [7], 2: [0, 0, 0]}, {11: [1], 51: [1], 91: [1]}, writes=[("channel_3_level", "8", 6, 90, [8])]),
    Row("max_read_registers max_read_bits max_write_registers max_write_bits excluded gap", EXCLUDED,
        {**{f"level {n}": 5 for n in range(25)}, "after": 6, "hole": [0, 0, 0], "near": 7, **{f"relay {n}": False for n in range(3)}, "lamps": [False] * 3,
         "between": [False] * 18},
        {0: [5] * 25, 27: [6, 0, 0, 0, 0, 7]}, {100: [0] * 20, 138: [0], 300: [0] * 3},
        reads=[(3, 0, 10), (3, 10, 10), (3, 20, 5), (3, 27, 6), (1, 100, 20), (1, 138, 1), (1, 300, 3)],
        writes=[("near", "70000", 16, 31, [1, 4464]), ("lamps", "[true, false, true]", 15, 300, [1, 0, 1])]),
    Row("write_function", file(field("a", 0, "type: uint16, access: read-write, value: 1"), field("b", 1, "type: uint16, access: read-write, write_function: single, value: 2"),
                               field("c", 2, "access: read-write", "coils"), field("d", 3, "access: read-write, write_function: single", "coils"),
                               head="unit: 17\nwrite_function: multiple\n"),
        {"a": 1, "b": 2, "c": False, "d": False}, {0: [1, 2]}, {2: [0, 0]},
        writes=[("a", "7", 16, 0, [7]), ("b", "8", 6, 1, [8]), ("c", "true", 15, 2, [1]), ("d", "true", 5, 3, [1])]),
    modicon(40101, 30009, 31, 10031),
    modicon(400101, "IR9", '"000031"', "di31", tables=("", "table: input, ", "", "")),
    modicon("HR101", "ir9", "C31", "100031", tables=("", "", "table: coils, ", "")),
    modicon(101, 9, 31, 31, "one_based: yes\nunit: 17\n", ("table: holding, ", "table: input, ", "table: coils, ", "table: discrete, ")),
    Row("notation", file(field("a", 12, "type: uint16, value: 3, access: read-write"), head="notation: wire\nunit: 17\n"), {"a": 3}, {12: [3]},
        writes=[("a", "4", 6, 12, [4])], reads=[(3, 12, 1)]),
    Row("timeout", file(field("a", 0, "type: uint16, value: 5, access: read-write"), head="unit: 17\ntimeout: 20s\n"), {"a": 5}, {0: [5]}, manner=Late, options=(),
        writes=[("a", "9", 6, 0, [9])]),
    *(Row(keys, file(field("a", 0, "type: uint16, value: 5, access: read-write"), field("b", 200, "type: uint16, value: 6"), head=f"unit: 17\n{head}"),
          {"a": 5, "b": 6}, {0: [5], 200: [6]}, manner=manner, rounds=rounds, check=check, writes=[("a", "9", 6, 0, [9])])
      for keys, head, manner, rounds, check in (
          ("accept", "accept: [unit, transaction]\n", OtherNumbers, 1, None),
          ("lenient", "lenient: yes\n", FourBytes, 1, None),
          ("delay", "delay: 700ms\n", None, 1, waits_after_connecting),
          ("message_wait", "message_wait: 80ms\n", None, 1, waits_between),
          ("message_wait_milliseconds", "message_wait_milliseconds: 80\n", None, 1, waits_between),
          ("close", "interval: 200ms\nclose: round\n", None, 3, closes_after_a_round),
          ("retries", "retries: 1\n", LosesTheFirst, 1, None),
          ("busy_retries busy_wait", "busy_retries: 1\nbusy_wait: 300ms\n", BusyFirst, 1, waits_when_busy))),
]
