"""What mbm sends of values and makes of registers that it reads, byte by byte: first of the types that devices have beside
integers and floats, also through a bridge.
test_device_keys.py has them on servers of others too."""

import datetime
import json
import os
import pty
import re
import struct
import subprocess

import peers
import pytest
from peers import DAMAGED, DONE, EXCEPTION, NO_REPLY, PATIENT, WRONG, TcpDevice, numbered, wait
from services import Broker, Subscriber


def seconds(text):
    """Seconds since 1970, as Python has them."""
    return int(datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp())


EVENING, SINCE_2000 = "2026-11-27T20:15:30Z", seconds("2000-01-01T00:00:00Z")
# The options of `mbm read` and `mbm write`, a value, and the registers that it is.
TYPES = [
    (["int24"], "-123456", "fffe1dc0"), (["uint24"], "16777215", "00ffffff"),
    (["int48"], "-2", "fffffffffffe"), (["uint48", "-o", "CDAB"], "123456789012", "1a14be99001c"),
    (["sign_magnitude16"], "-1000", "83e8"), (["sign_magnitude32"], "-1000", "800003e8"), (["sign_magnitude16"], "32767", "7fff"),
    (["bcd16"], "2301", "2301"), (["bcd32"], "12345678", "12345678"), (["bcd32", "-o", "CDAB"], "12345678", "56781234"),
    (["bcd16", "--scale", "0.1"], "230.1", "2301"),
    (["uint32_m10k"], "99999999", "270f270f"), (["int32_m10k"], "-12345678", "fb2ee9d2"),
    (["uint48_m10k", "-o", "CDAB"], "100020003", "000300020001"), (["int48_m10k"], "-1", "00000000ffff"),
    # The energy of a PM710, lowest register first.
    (["uint64_m10k", "-o", "CDAB"], "4363560264", "010818d4002b0000"), (["int64_m10k"], "-9999999999999999", "d8f1d8f1d8f1d8f1"),
    (["float16"], "21.5", struct.pack(">e", 21.5).hex()), (["float16"], "-0.1", struct.pack(">e", -0.1).hex()), (["float16"], "65504", "7bff"),
    (["uint64", "-o", "EFGHABCD"], "72623859790382856", "0506070801020304"), (["int64", "-o", "CDABGHEF"], "72623859790382856", "0304010207080506"),
    (["uint64", "-o", "FEHGBADC"], "72623859790382856", "0605080702010403"), (["uint64", "-o", "DCBAHGFE"], "72623859790382856", "0403020108070605"),
    (["double", "-o", "EFGHABCD"], "0.1", (struct.pack(">d", 0.1)[4:] + struct.pack(">d", 0.1)[:4]).hex()),
    (["text_low"], "Ab1", "004100620031"), (["text_high"], "Ab1", "410062003100"), (["text_spaces"], "Ab1", "41623120"),
    (["text_spaces", "-o", "BADC"], "Ab1", "62412031"), (["text_low_spaces"], "Ab", "00410062"), (["text_high_spaces"], "Ab", "41006200"),
    (["unix32"], EVENING, f"{seconds(EVENING):08x}"), (["unix32", "-o", "CDAB"], "2106-02-07T06:28:15Z", "ffffffff"),
    (["unix32", "--time-zone", "+01:00"], "2026-11-27T20:15:30+01:00", f"{seconds(EVENING):08x}"),
    (["unix64"], "1969-12-31T23:59:59Z", "ffffffffffffffff"), (["unix64_ms"], "2026-11-27T20:15:30.123Z", f"{seconds(EVENING) * 1000 + 123:016x}"),
    (["unix64_ms"], "1969-12-31T23:59:59.999Z", "ffffffffffffffff"),
    (["seconds_2000"], EVENING, f"{seconds(EVENING) - SINCE_2000:08x}"),
    (["iec870"], "2026-11-27T23:59:58.123Z", "001a0b1b173be30b"), (["iec870", "-o", "CDAB"], "2026-11-27T23:59:58.123Z", "e30b173b0b1b001a"),
    (["iec870_3"], "2026-11-27T23:59:00Z", "001a0b1b173b"),
    (["date", "--layout", "Y M D h m s"], EVENING, "07ea000b001b0014000f001e"), (["date", "--layout", "yM Dh ms"], EVENING, "1a0b1b140f1e"),
    (["date", "--layout", "MD nh ms f"], "2026-11-27T20:15:30.250Z", "0b1b7e140f1e00fa"), (["date", "--layout", "Y M D"], "2024-02-29", "07e80002001d"),
    (["date", "--layout", "hm"], "07:30:00", "071e"), (["date_bcd", "--layout", "sm h- DM yC"], EVENING, "3015200027112620"),
]
NAMES = [" ".join([*one[0], one[1]]) for one in TYPES]


def read_words(options, address, text):
    """The words of `mbm read`: of a text with its number of characters."""
    return ("-T", *options, address, *([len(text)] if options[0].startswith("text") else []))


def is_text(text):
    """Whether JSON has a value as a text: all but numbers."""
    return not text.lstrip("-").replace(".", "", 1).isdigit()


@pytest.mark.parametrize("options, value, registers", TYPES, ids=NAMES)
def test_a_value_is_these_registers_and_back(mbm, options, value, registers):
    device = TcpDevice(lambda pdu: pdu[:5])
    mbm.prints("", "write", device.line, "-q", "--multiple", "-T", *options, 100, value)
    count = len(registers) // 4
    assert device.asked == [(1, f"100064{count:04x}{2 * count:02x}{registers}")]
    data = bytes.fromhex(registers)
    line = TcpDevice(lambda pdu: bytes([pdu[0], len(data)]) + data).line
    mbm.prints(f"  100  {value}\n", "read", line, *read_words(options, 100, value))
    found = mbm.json("read", line, *read_words(options, 100, value))["values"]
    assert found == [{"address": 100, "value": value if is_text(value) else json.loads(value)}]


@pytest.mark.parametrize("options, registers", [
    (["bcd16"], "12a4"), (["bcd32"], "0000000f"), (["uint32_m10k"], "27100000"), (["uint32_m10k"], "ffff0000"), (["int32_m10k"], "80000000"),
    (["iec870"], "0000000000000000"), (["iec870"], "ffffffffffffffff"), (["unix64"], "7fffffffffffffff"),
    (["date", "--layout", "Y M D h m s"], "07ea0002001d000000000000"), (["date", "--layout", "yM Dh ms"], "ffffffffffff"),
    (["date_bcd", "--layout", "Y M D"], "20ab00010001")])
def test_registers_that_hold_no_value_of_the_type_are_null_with_a_status(mbm, options, registers):
    data = bytes.fromhex(registers)
    line = TcpDevice(lambda pdu: bytes([pdu[0], len(data)]) + data).line
    why = "the registers hold no value of this type"
    assert mbm("read", line, "-T", *options, 7, *PATIENT) == (DAMAGED, f"    7  {why}\n", "")
    assert mbm.json("read", line, "-T", *options, 7, code=DAMAGED)["values"] == [{"address": 7, "value": None, "status": why}]


@pytest.mark.parametrize("words, sentence", [
    ("-T bcd16 1 10000", "VALUE \"10000\" is out of range of the type bcd16."),
    ("-T uint32_m10k 1 100000000", "is out of range of the type uint32_m10k."), ("-T uint32_m10k 1 -1", "is out of range of the type uint32_m10k."),
    ("-T int24 1 8388608", "is out of range of the type int24."), ("-T sign_magnitude16 1 -32768", "is out of range of the type sign_magnitude16."),
    ("-T float16 1 65520", "is out of range of the type float16."), ("-T float16 1 2049", "is a whole number that the type cannot hold exactly."),
    ("-T float 1 16777217", "is a whole number that the type cannot hold exactly."),
    ("-T double 1 9007199254740993", "VALUE \"9007199254740993\" is a whole number that the type cannot hold exactly."),
    ("-T unix32 1 2026-02-29T00:00:00Z", "VALUE \"2026-02-29T00:00:00Z\" is a date that does not exist."),
    ("-T unix32 1 2026-02-28T00:00:00", "has no time zone: Z, or such as +01:00."), ("-T unix32 1 tomorrow", "is not a date and a time such as 2026-"),
    ("-T unix32 1 1969-12-31T23:59:59Z", "is out of range of the type unix32."), ("-T unix32 1 2106-02-07T06:28:16Z", "is out of range of the type unix32."),
    ("-T unix32 1 2026-02-28T00:00:00.5Z", "has milliseconds, for which the registers have no place."),
    ("-T unix64_ms 1 2026-02-28T00:00:00.0005Z", "is not a date and a time such as"),
    ("-T iec870_3 1 2026-02-28T00:00:01Z", "has seconds, for which the registers have no place."), ("-T iec870 1 2128-01-01T00:00:00Z", "is out of range of the type iec870."),
    ("-T date --layout hm 1 24:00", "is no time of a day."), ("-T date --layout hm 1 7:30", "is not a time such as 20:15:00."),
    ("-T date --layout yMDhms 1 07:30", "--layout \"yMDhms\" is no layout of a date, such as"), ("-T date 1 07:30", "the type date needs --layout, such as \"Y M D h m s\"."),
    ("-T date --layout -.-.-.-.-.-.-.-.hm 1 07:30", "has 9 registers: a date has at most 8."),
    ("-T uint16 --layout hm 1 5", "--layout is for the types date and date_bcd, not for uint16."), ("-T uint16 --time-zone +01:00 1 5", "--time-zone is for dates."),
    ("-T unix32 --time-zone CET 1 5", "--time-zone \"CET\" is neither Z nor an offset such as +01:00."),
    ("-T unix32 --scale 2 1 5", "--scale needs a number, not a bit, a text, a date or --hex."), ("-T bcd16 --hex 1 5", "--hex needs an integer type."),
    ("-T uint32 -o EFGHABCD 1 5", "--order EFGHABCD is for values of four registers."), ("-T int48_m10k -o EFGHABCD 1 5", "--order EFGHABCD is for values of four registers."),
])
def test_what_cannot_be_written_exactly_is_refused_with_a_sentence(mbm, words, sentence):
    device = TcpDevice()
    mbm.fails(WRONG, sentence, "write", device.line, *(word.replace(".", " ") if word.endswith("hm") else word for word in words.split()))
    assert device.asked == []


def test_a_float_with_a_point_or_an_exponent_is_rounded(mbm):
    for kind, value in (("float", "16777217.0"), ("double", "9007199254740993e0"), ("float16", "2049.0"), ("float", "0.1")):
        device = TcpDevice(lambda pdu: pdu[:5])
        mbm.prints("", "write", device.line, "-q", "-T", kind, 1, value)
        assert len(device.asked) == 1


def test_several_values_of_a_type_follow_each_other(mbm):
    data = bytes.fromhex("0001000203e7" + "0000000000ff")
    line = TcpDevice(lambda pdu: bytes([pdu[0], len(data)]) + data).line
    mbm.prints(f"    0  {0x1000203E7}\n    3  255\n", "read", line, "-T", "uint48", 0, 2)
    device = TcpDevice(lambda pdu: pdu[:5])
    mbm.prints("", "write", device.line, "-q", "-T", "date", "--layout", "hm", 0, "07:30", "22:00")
    assert device.asked == [(1, "1000000002" "04" "071e1600")]


# --- in a device file


def poll(mbm, line, file):
    """The values of one round, and the statuses."""
    found = mbm("poll", line, file, "--once", "--json", "-q", *PATIENT)
    assert found.code == DONE, found
    rows = [json.loads(row) for row in found.out.splitlines()]
    return {row["name"]: row["value"] for row in rows}, {row["status"] for row in rows}


def test_pymodbus_reads_a_number_as_it_was_written_in_each_order(plain):
    """pymodbus's client converts registers itself: its numbers are those of mbm."""
    from pymodbus.client import ModbusTcpClient

    for options, value, kind, order in ((["uint64"], 72623859790382856, "UINT64", "big"), (["int64", "-o", "CDAB"], -2, "INT64", "little"),
                                        (["double"], 0.1, "FLOAT64", "big"), (["uint32"], 7, "UINT32", "big")):
        device = TcpDevice(lambda pdu: pdu[:5])
        plain.prints("", "write", device.line, "-q", "-T", *options, 0, repr(value))
        data = device.asked[0][1][12:]
        registers = [int(data[i:i + 4], 16) for i in range(0, len(data), 4)]
        assert ModbusTcpClient.convert_from_registers(registers, ModbusTcpClient.DATATYPE[kind], word_order=order) == value


def test_a_field_without_a_value_of_its_type_has_a_status_in_poll(mbm, write):
    file = write("clock.yaml", "fields: [{name: clock, table: holding, address: 0, type: iec870}, {name: other, table: holding, address: 0, type: uint16}]")
    empty = TcpDevice(lambda pdu: bytes([pdu[0], pdu[4] * 2]) + bytes(pdu[4] * 2))
    assert poll(mbm, empty.line, file) == ({"clock": None, "other": 0}, {"success", "the registers hold no value of this type"})


HEADER = """\
#include "mbm.h"
#define TYPES_PLAN
#define TYPES_SERVER
#include "types.h"
#include <stdio.h>
int main(void)
{
    mbm_registers view;
    uint64_t energy = 0, bits = 0;
    uint32_t digits = 0;
    mbm_date date = MBM_INIT;
    char serial[TYPES_SERIAL_COUNT + 1] = "";

    types_initialise();
    types_get_energy(&energy);
    types_get_mode(&bits);
    types_get_clock(1, &date);
    types_get_serial(serial, sizeof serial);
    (void)mbm_registers_ofWords(&view, types_holding, 8, 0);
    printf("%u %llu %llu %02u:%02u %s", types_take_bcd(&view, &digits), (unsigned long long)energy, (unsigned long long)bits, date.hour,
           date.minute, serial);
    printf(" %lu %u\\n", (unsigned long)digits, types_set_bcd(10000));
    return TYPES_MODE_BIT != 12 || TYPES_MODE_BITS != 8 || TYPES_FIELDS != 5;
}
"""


def test_a_header_has_functions_that_take_these_values_out_of_registers(mbm, folder, write):
    file = write("types.yaml", """\
device: types
fields:
  - {name: bcd, table: holding, address: 0, type: bcd16, value: 1234, access: read-write}
  - {name: energy, table: holding, address: 1, type: uint64_m10k, order: CDAB, value: 4363560264}
  - {name: mode, table: holding, address: 5, type: uint32, bits: 12-19, value: 165}
  - {name: clock, table: holding, address: 7, type: date, layout: hm, count: 2, value: ["07:30", "22:15"]}
  - {name: serial, table: holding, address: 9, type: text_low, count: 4, value: AB1}
""")
    write("program.c", HEADER)
    assert mbm("header", file, "-o", f"{folder}/types.h") == (DONE, "", "")
    warnings = "-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wundef -Werror".split()
    for compiler in ("gcc", "g++ -x c++ -std=c++11", "avr-gcc -mmcu=atmega328p", "arm-none-eabi-gcc -mthumb -mcpu=cortex-m0plus"):
        done = peers.run(*compiler.split(), *warnings, f"-I{peers.ROOT}/include", "-c", f"{folder}/program.c", "-o", f"{folder}/program.o")
        assert done.code == 0, done.error
    parts = f"{peers.BUILD}/{mbm.build}"
    sanitizers = ["clang", "-fsanitize=address,undefined"] if mbm.build == "sanitized" else ["gcc"]
    archive = f"{parts}/libmbm.a" if mbm.build == "sanitized" else f"{peers.ROOT}/target/release/libmbm.a"
    done = peers.run(*sanitizers, "-std=c11", f"-I{peers.ROOT}/include", f"{folder}/program.c", archive, "-o", f"{folder}/program")
    assert done.code == 0, done.error
    assert peers.run(f"{folder}/program") == (DONE, "0 4363560264 165 22:15 AB1 1234 246\n", "")


def test_the_bridge_publishes_and_writes_them(plain, folder, libmodbus, write):
    file = write("types.yaml", """\
unit: 17
interval: 200ms
time_zone: +01:00
fields:
  - {name: bcd, table: holding, address: 200, type: bcd32, access: read-write}
  - {name: energy, table: holding, address: 210, type: uint64_m10k, order: CDAB, scale: 0.001, access: read-write}
  - {name: clock, table: holding, address: 220, type: date, layout: yM Dh ms, access: read-write}
  - {name: starts, table: holding, address: 230, type: date, layout: hm, count: 2, access: read-write}
  - {name: serial, table: holding, address: 240, type: text_low_spaces, count: 6, access: read-write}
  - {name: mode, table: holding, address: 250, type: uint32, bits: 12-19}
  - {name: since, table: holding, address: 250, type: unix32}
  - {name: day, table: holding, address: 260, type: date, layout: Y M D}
""")
    for address, registers in ((200, "1 2"), (210, "1 2 3 4"), (220, "6667 6932 3870"), (230, "1 2"), (240, "32 32 32 32 32 32"), (250, "10 20480")):
        plain.prints("", "write", libmodbus.tcp, "-u", 17, "-q", "--multiple", address, *registers.split())
    broker = Broker(folder).come()
    subscriber = Subscriber(broker)
    plain.begin("bridge", "-b", broker.place, "-t", "hall", "--discovery", "homeassistant", libmodbus.tcp, file)
    for field, value in (("bcd", 10002), ("energy", 4000300020.001), ("clock", "2026-11-27T20:15:30+01:00"), ("starts", ["00:01:00", "00:02:00"]),
                         ("serial", ""), ("mode", 165)):
        subscriber.expect_value(f"hall/{field}", value)
    for field, payload, value in (
            ("bcd", "12345678", 12345678), ("bcd", '{"value": 7}', 7), ("energy", "1.5", 1.5), ("clock", "2027-01-01T00:00:00Z", "2027-01-01T01:00:00+01:00"),
            ("clock", '"2027-01-01T00:00:00+01:00"', "2027-01-01T00:00:00+01:00"), ("clock", '{"value": "2027-01-02T00:00:00+01:00"}', "2027-01-02T00:00:00+01:00"),
            ("starts", '["07:30", "22:00"]', ["07:30:00", "22:00:00"]), ("serial", "AB 12", "AB 12")):
        subscriber.expect_result(f"hall/{field}", payload, "success")
        subscriber.expect_value(f"hall/{field}", value)
    for field, payload, why in (
            ("bcd", "100000000", "the number is out of range"), ("energy", "1.0005", "the number is not a multiple of the scale"),
            ("clock", "2027-02-29T00:00:00Z", "the date is a date that does not exist"), ("clock", "5", "the date is not a date and a time such as .*"),
            ("serial", "ends ", "the text ends with a space, which .*"), ("mode", "5", "the field is not writable")):
        subscriber.expect_result(f"hall/{field}", payload, why)
    subscriber.expect_value("hall/clock", "2027-01-02T00:00:00+01:00")
    assert wait(lambda: any("/clock/config" in topic for topic in subscriber.last))
    assert wait(lambda: any("/day/config" in topic for topic in subscriber.last))
    classes = {topic.split("/")[-2]: json.loads(text) for topic, text in subscriber.last.items() if topic.endswith("/config")}
    assert "min" not in classes["clock"] and "unit_of_measurement" not in classes["clock"]
    assert [classes[name].get("device_class") for name in ("clock", "since", "day", "starts")] == [None, "timestamp", "date", None]
    assert "state_class" not in classes["since"]


def test_a_library_of_others_packs_the_same_halves(plain):
    """Python's struct has half floats too: every exponent, and a mantissa each."""
    for bits in range(0x0001, 0x7C00, 0x123):
        value = struct.unpack(">e", bits.to_bytes(2, "big"))[0]
        data = bits.to_bytes(2, "big")
        line = TcpDevice(lambda pdu: bytes([pdu[0], 2]) + data).line
        text = plain("read", line, "-T", "float16", 0, *PATIENT).out.split()[1]
        assert struct.pack(">e", float(text)) == data, (text, value)


def test_the_table_of_poll_has_columns_for_dates_and_texts(mbm, write):
    file = write("clock.yaml", """\
fields:
  - {name: clock, table: holding, address: 0, type: unix32, value: "2026-11-27T20:15:30Z"}
  - {name: serial, table: holding, address: 10, type: text, count: 30, value: "ABC-0123456789-0123456789"}
  - {name: level, table: holding, address: 30, type: uint16, value: 5}
  - {name: story, table: holding, address: 100, type: text, count: 80, value: "%s"}
""" % ("long " * 15 + "end"))
    found = mbm("poll", mbm.serve("tcp://127.0.0.1:0", file), file, "--once", "-q", *PATIENT)
    rows = found.out.splitlines()[1:]
    ages = [row.index("ms") for row in rows[:3]]
    assert found.code == DONE and len({row.index("success") for row in rows[:3]}) == 1, found.out
    assert max(ages) - min(ages) <= 2
    # A text of 78 characters takes its columns in its own row alone.
    assert rows[3].index("success") > rows[0].index("success") + 20 and "long end  " in rows[3]


FLOAT, DOUBLE = struct.pack(">f", -21.5).hex(), struct.pack(">d", 0.1).hex()


@pytest.mark.parametrize("words, sent", [
    ("100 1", "0600640001"),
    ("--multiple 100 1", "100064000102" "0001"),
    ("65536 1 --one-based", "06ffff0001"),
    ("--table coils 3 1", "050003ff00"),
    ("--table coils 3 0", "0500030000"),
    ("--table coils --multiple 3 1", "0f0003000101" "01"),
    ("--table coils 3 1 0 1 1 0 0 0 0 1 1", "0f0003000a02" "0d03"),
    ("--type int16 100 -32768 32767", "100064000204" "80007fff"),
    ("--type uint32 100 2923517522", "100064000204" "ae415652"),
    ("--type uint32 --order CDAB 100 2923517522", "100064000204" "5652ae41"),
    ("--type uint32 --order BADC 100 2923517522", "100064000204" "41ae5256"),
    ("--type uint32 --order DCBA 100 2923517522", "100064000204" "525641ae"),
    ("--type float 100 -21.5", "100064000204" + FLOAT),
    ("--type double 100 0.1", "100064000408" + DOUBLE),
    ("--type int64 100 -9223372036854775808", "100064000408" "8000000000000000"),
    ("--type uint64 100 18446744073709551615", "100064000408" "ffffffffffffffff"),
    ("--type text 100 meter", "100064000306" "6d6574657200"),
    ("100 --type=int16 -5", "060064fffb"),
    ("100 -Tint16 -5 -0 --multiple -1", "100064000306" "fffb0000ffff"),
    ("--type int16 100 -q -5", "060064fffb"),
    ("--scale 0.1 100 21.5", "06006400d7"),
    ("--scale -0.5 --type int16 100 1 -1", "100064000204" "fffe0002"),
    ("--hex 100 BEEF", "060064beef"),
    ("--hex 100 0x00ff", "06006400ff"),
])
def test_write_sends_these_bytes(mbm, words, sent):
    device = TcpDevice(lambda pdu: pdu[:5])
    mbm.prints("", "write", device.line, "-q", *words.split())
    assert device.asked == [(1, sent)]


@pytest.mark.parametrize("pdu", ["0300640000", "030064", "10ffff", "4101", "2b0e0100", "1406000400010002", "150600040001" "0001beef"])
def test_call_sends_a_pdu_that_breaks_the_rules_of_its_function(mbm, pdu):
    device = TcpDevice(lambda pdu: bytes([pdu[0] | 0x80, 3]))
    code, out, _ = mbm("call", device.line, pdu, *PATIENT)
    assert (code, out[:5], device.asked) == (EXCEPTION, f"{int(pdu[:2], 16) | 0x80:02X} 03", [(1, pdu)])


@pytest.mark.parametrize("pdu", ["42", "42 01"])
def test_a_response_may_consist_of_a_function_code_alone(mbm, pdu):
    device = TcpDevice(lambda pdu: pdu[:1])
    code, out, error = mbm("call", device.line, pdu, *PATIENT)
    assert (code, out.splitlines()[0], error) == (DONE, "42", "")
    assert mbm.json("call", device.line, pdu)["response"] == "42"


def test_a_host_may_have_an_address_of_ipv6(mbm):
    mbm.prints(numbered(7, [42]), "read", TcpDevice(host="::1").line, 7)


def device_with(data):
    return TcpDevice(lambda pdu: bytes([pdu[0], len(data)]) + data)


@pytest.mark.parametrize("kind, data, text, value", [
    ("float", struct.pack(">f", 230.1), "230.1", 230.1), ("double", struct.pack(">d", 0.1), "0.1", 0.1), ("int16", b"\xff\xfe", "-2", -2),
    ("int32", b"\xff\xff\xff\xfe", "-2", -2), ("uint64", b"\xff" * 8, str(2**64 - 1), 2**64 - 1),
    ("int64", b"\x80" + bytes(7), str(-2**63), -2**63)])
def test_read_makes_a_value_of_registers(mbm, kind, data, text, value):
    line = device_with(data).line
    mbm.prints(f"    0  {text}\n", "read", line, "-T", kind, 0)
    assert mbm.json("read", line, "-T", kind, 0)["values"] == [{"address": 0, "value": value}]


@pytest.mark.parametrize("data, text, value", [
    (b"meter\0", "meter", "meter"), (b"a\"\x1b,\xe4\0", "a\".,ä", "a\"\x1b,ä"), (b"\\\x9b\x7f\xa0\xff\0", "\\..\xa0ÿ", "\\\x9b\x7f\xa0ÿ")])
def test_a_text_has_no_control_characters_on_a_terminal_nor_in_json(mbm, data, text, value):
    read = ("read", device_with(data).line, "-T", "text", 0, 6)
    mbm.prints(f"    0  {text}\n", *read)
    assert mbm.json(*read)["values"][0]["value"] == value
    assert not re.search("[\x7f-\x9f]", mbm(*read, "--json").out)


def test_a_value_that_is_no_number_is_null_in_json(mbm):
    line = device_with(struct.pack(">f", float("nan"))).line
    assert mbm.json("read", line, "-T", "float", 0)["values"][0]["value"] is None


def test_a_scale_multiplies_what_is_read(mbm):
    mbm.prints("    0  230.1\n", "read", device_with(b"\x08\xfd").line, "--scale", "0.1", 0)


def test_on_a_terminal_a_table_is_shown_in_place_and_what_changed_is_marked(mbm):
    values = iter([1, 1, 2])
    device = TcpDevice(lambda pdu: bytes([3, 2, 0, next(values)]))
    ours, theirs = pty.openpty()
    subprocess.run([mbm.path, "read", device.line, "7", "--every", "100ms", "--times", "3", *PATIENT], stdout=theirs, stderr=subprocess.DEVNULL,
                   timeout=90)
    os.close(theirs)
    found = os.read(ours, 4096).decode().replace("\r", "").split("\033[H\033[J")[1:]
    os.close(ours)
    assert found == [f"unit 1, holding, round {n}: 1 of 1 values read\n{mark}     7  {v}\n" for n, mark, v in ((1, " ", 1), (2, " ", 1), (3, "*", 2))]


def test_each_unit_has_its_marks(mbm):
    values = {1: iter([1, 1, 1]), 2: iter([1, 2, 3])}
    device = TcpDevice(lambda pdu: bytes([3, 2, 0, next(values[device.asked[-1][0]])]) if device.asked[-1][0] in values else None)
    code, out, _ = mbm("read", device.line, "-u", "1,2", 7, "--every", "20ms", "--times", 3, *PATIENT)
    assert (code, [row[0] for row in out.splitlines()[1::2]]) == (DONE, [" ", " ", " ", "*", " ", "*"])


def test_a_silent_unit_does_not_keep_the_others_from_being_read(mbm):
    device = TcpDevice(lambda pdu: bytes([3, 2, 0, 42]) if device.asked[-1][0] != 2 else None)
    code, out, error = mbm("read", device.line, "-u", "1-3", 7, "--timeout", "300ms")
    assert (code, out.splitlines()[1::2]) == (NO_REPLY, ["      7  42", "      7  no complete reply in time", "      7  42"])
    assert error.startswith("mbm read: unit 2 did not answer within 300ms"), error
