"""What mbm sends of values, byte by byte, and what it makes of registers that it reads."""

import os
import pty
import re
import struct
import subprocess

import pytest
from peers import DONE, EXCEPTION, NO_REPLY, PATIENT, TcpDevice, numbered

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
