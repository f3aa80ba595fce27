"""Each failure of a line, a device or a stream has its exit code, and a sentence with advice that fits."""

import re
import socket
import subprocess

import pytest
from peers import (DAMAGED, DONE, EXCEPTION, LINE, NO_REPLY, PATIENT, ROOT, SYSTEM, SerialDevice, TcpDevice, crc, numbered, run)

ADDRESS = "exception 02: illegal data address"
BRIEF = ("--timeout", "300ms")
EACH_COMMAND = [("read", 0), ("write", 0, 1), ("call", "0300000001"), ("scan",), ("identify",)]
COMMAND = dict(argnames="command, more", argvalues=[(command, more) for command, *more in EACH_COMMAND], ids=[one[0] for one in EACH_COMMAND])


@pytest.mark.parametrize(**COMMAND)
def test_a_line_that_cannot_be_opened_says_why(mbm, command, more):
    mbm.fails(LINE, "Connection refused. Check host and port", command, "tcp://127.0.0.1:1", *more)
    mbm.fails(LINE, "No such file or directory. Is the adapter plugged in?", command, "rtu:/dev/none", *more)
    mbm.fails(LINE, "It is no terminal", command, "rtu:/dev/null", *more)


def test_a_host_that_nobody_knows_is_named(mbm):
    host = "no-such-host.invalid"
    with pytest.raises(socket.gaierror) as reason:
        socket.getaddrinfo(host, "502", type=socket.SOCK_STREAM)
    mbm.fails(LINE, f"tcp://{host}: {reason.value.strerror}. Check the name", "read", f"tcp://{host}", 1)


@pytest.mark.parametrize("command, more", [("read", [0, 300]), ("write", [0, 1]), ("call", ["0300000001"]), ("identify", ["--quiet"])])
def test_a_silent_unit_is_reported(mbm, silent, command, more):
    mbm.fails(NO_REPLY, "unit 9 did not answer within 300ms. Check the unit's number; of a device behind a gateway",
              command, silent.line, "-u", 9, *BRIEF, *more)


def test_a_scan_of_silent_units_finds_none(mbm, silent):
    assert mbm("scan", silent.line, "--units", "1-3", *BRIEF)[:2] == (NO_REPLY, "")


def test_silence_of_a_serial_line_has_more_reasons(mbm, serial):
    serial.mood = "silent"
    mbm.fails(NO_REPLY, "Check the unit's number, baud rate, parity and wiring", "read", serial.line, 0, *BRIEF)


def test_a_malformed_reply_is_reported(mbm):
    malformed = TcpDevice(lambda pdu: bytes([pdu[0], 3, 1, 2, 3]))
    mbm.fails(DAMAGED, "--trace shows what the device sent", "read", malformed.line, 0, *BRIEF)


def test_a_damaged_reply_is_reported(mbm, folder):
    damaged = SerialDevice(folder, lambda frame: bytes([frame[0], 3, 2, 0, 42, 0, 0]))
    mbm.fails(DAMAGED, "Check baud rate, parity, wiring and termination", "read", damaged.line, 0, *BRIEF)
    code, out, _ = mbm("scan", damaged.line, "--units", "1")
    assert code == DAMAGED and "two units with one id" in out


@pytest.mark.parametrize("number, sentence", [
    (6, "exception 06: server device busy. Try again later"),
    *((number, f"unit 1: exception {number:02X}, which the standard does not have.") for number in (0x0C, 0x7F, 0xFF))])
def test_an_exception_is_explained(mbm, number, sentence):
    mbm.fails(EXCEPTION, sentence, "read", TcpDevice(lambda pdu: bytes([pdu[0] | 0x80, number])).line, 0)


def test_the_first_of_two_failures_counts(mbm):
    mixed = TcpDevice(lambda pdu: bytes([0x83, 2]) if pdu[1:3] == b"\0\0" else None)
    mbm.fails(EXCEPTION, ADDRESS, "read", mixed.line, 0, 200, *BRIEF)


def test_a_connection_that_the_device_closes_is_reported(mbm):
    mbm.fails(LINE, "the link was lost: the other end has closed it.", "read", mbm.serve("tcp://127.0.0.1:0", "--echo", "--fault", "close"), 0)


def test_trace_goes_to_stderr(mbm, device):
    code, out, error = mbm("read", device.line, 0, "--trace")
    assert code == DONE and out == numbered(0, [42]) and "read holding registers" in error


# --- streams and files

def test_a_recording_that_cannot_be_written_is_reported(mbm, device):
    code, _, error = mbm("read", device.line, 0, "--pcap", "/nowhere/file")
    assert (code, error) == (SYSTEM, "mbm read: /nowhere/file: No such file or directory.\n")


def test_samples_end_when_the_disk_is_full(mbm, device):
    with open("/dev/full", "w") as full:
        code, _, error = mbm("read", device.line, 0, "--every", "10ms", "--times", 1000, "--csv", stdout=full)
    assert code == SYSTEM and "No space left" in error
    assert len(device.asked) < 500


@pytest.mark.parametrize("words", [("read", "LINE", 0), ("read", "LINE", 0, "--json"), ("scan", "LINE", "--units", "1-3"),
                                   ("header", f"{ROOT}/examples/devices/energy-meter.yaml"), ("--help",), ("--version",), ("read", "--help")],
                         ids=lambda words: " ".join(map(str, words)).replace(ROOT, ""))
def test_a_full_disk_is_noticed(mbm, device, words):
    with open("/dev/full", "w") as full:
        code, _, error = mbm(*(device.line if one == "LINE" else one for one in words), stdout=full)
    assert code == SYSTEM and "standard output: No space left on device.\n" in error


@pytest.mark.parametrize("closing", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_nothing_is_printed_to_the_line_when_a_stream_is_closed(mbm, device, closing):
    found = run("bash", "-c", f'exec "$@" {closing}', "bash", mbm.path, "read", device.line, "0", "--trace", "--every", "50ms", "--times", "3")
    assert (found.code, device.asked) == (DONE, [(1, "0300000001")] * 3)


def test_a_recording_that_the_disk_does_not_hold_is_reported_once_and_the_rounds_go_on(mbm, device, folder):
    found = run("bash", "-c", 'ulimit -f 1; trap "" XFSZ; exec "$@"', "bash", mbm.path, "read", device.line, "0", "--every", "10ms",
                "--times", "20", "--quiet", "--pcap", f"{folder}/frames")
    assert (found.code, found.out.count("round ")) == (SYSTEM, 20)
    assert "frames: File too large. No more frames" in found.error


def test_a_recording_that_cannot_be_read_is_reported(mbm):
    with open("/proc/self/mem", "rb") as unreadable:
        assert subprocess.run([mbm.path, "sniff", "-"], stdin=unreadable, capture_output=True, timeout=90).returncode == SYSTEM


# --- replies of Modbus TCP with a wrong header

def header_device(answer):
    """A device of Modbus TCP that sends `answer` of the header and the PDU of each request."""
    device = TcpDevice()
    device.reply = lambda head, pdu: answer(head[:4] + b"\0\5" + head[6:])
    return device.line


DATA = b"\3\2\0\x2A"


@pytest.mark.parametrize("answer, sentence", [
    (lambda head: bytes([head[0], head[1] ^ 5]) + head[2:] + DATA, "a reply with transaction number 5 came, and the request had 0; --accept transaction takes it."),
    (lambda head: head[:2] + b"\0\1" + head[4:] + DATA, "a reply came with protocol id 1, which is 0 in Modbus TCP."),
    (lambda head: b"HTTP/1." + DATA, "a reply came with protocol id 21584, which is 0 in Modbus TCP."),
    (lambda head: head[:4] + b"\0\6" + head[6:] + DATA, "a reply came whose header announces 6 bytes, and 5 came."),
    (lambda head: head[:4] + b"\0\0" + head[6:] + DATA, "a reply came whose header announces 0 bytes, and 2 to 254 are possible."),
    (lambda head: head[:4] + b"\5\0" + head[6:] + DATA, "a reply came whose header announces 1280 bytes"),
    (lambda head: head[:6] + b"\xFF" + DATA, "only other units answered: a reply of unit 255 came; --accept unit takes it. Check the unit's number."),
    (lambda head: head[:3], "3 bytes came, and a reply begins with a header of 7."),
    (lambda head: head[6:] + DATA + crc(head[6:] + DATA), "it looks like a frame of rtu+tcp://"),
], ids=["transaction number", "protocol id", "no protocol", "too long", "length 0", "bytes in the wrong order", "another unit", "half a header",
        "an RTU frame"])
def test_a_reply_with_a_wrong_header_is_not_reported_as_silence(mbm, answer, sentence):
    brief = (header_device(answer), *BRIEF)
    mbm.fails(NO_REPLY, sentence, "read", *brief, 0)
    mbm.fails(NO_REPLY, sentence, "call", *brief, "03 00 00 00 01")
    code, out, _ = mbm("read", *brief, 0, "--json")
    assert code == NO_REPLY and sentence.split(".")[0].removeprefix("only other units answered: ") in out
    code, _, error = mbm("scan", *brief, "--units", "1")
    assert code == NO_REPLY and ", although " in error and "; --trace shows what came." in error and "baud" not in error


def test_wrong_headers_of_several_units_are_reported_for_each(mbm):
    line = header_device(lambda head: bytes([head[0], head[1] ^ 0x80]) + head[2:] + DATA)
    code, out, error = mbm("read", line, 0, "-u", "1-2", "--timeout", "200ms")
    assert (out.count("a reply with transaction number"), error.count("a reply with transaction number")) == (2, 2)
    _, _, error = mbm("scan", line, "--units", "1-3", "--timeout", "200ms")
    assert "0 of 3 requests were answered, although a reply with transaction number 128 came, and the request had 0; --accept transaction takes it." in error


def test_a_late_reply_is_explained(mbm):
    line = header_device(lambda head: b"" if head[1] == 0 else bytes([head[0], head[1] - 1]) + head[2:] + DATA)
    out = mbm("read", line, 0, "--timeout", "200ms", "--every", "10ms", "--times", 2).out
    assert "no complete reply in time: a reply to an earlier request came; a slow device needs a longer --timeout" in out


# --- advice

def refusing(number):
    return TcpDevice(lambda pdu: bytes([pdu[0] | 0x80, number])).line


def says(mbm, wanted, not_wanted, *words):
    error = mbm(*words).error
    assert wanted in error and not (not_wanted and re.search(not_wanted, error)), error


@pytest.mark.parametrize("words, command", [
    ("read LINE 40101", "read LINE 100"),
    ("read LINE -u 17 40001 2 -T int16", "read -u 17 -T int16 LINE 0 2"),
    ("read LINE 49999", "read LINE 9998"),
    ("read LINE 30101", "read --table input LINE 100"),
    ("read -t input LINE 30101", "read -t input LINE 100"),
    ("read -t input LINE 40101 3", "read LINE 100 3"),
    ("read --table=input LINE 40101", "read LINE 100"),
    ("read LINE 40101 --one-based", "read --one-based LINE 101"),
    ("read -t discrete LINE 10101", "read -t discrete LINE 100"),
    ("write LINE 40101 -5 -T int16", "write -T int16 LINE 100 -5"),
])
def test_of_a_number_of_a_manual_the_exact_command_is_advised(mbm, words, command):
    line = refusing(2)
    code, _, error = mbm(*words.replace("LINE", line).split())
    # The options come first.
    assert code == EXCEPTION and error.endswith(f":\n  mbm {command}\n".replace("LINE", line)), error
    assert mbm(*error.splitlines()[-1].split()[1:]).code == EXCEPTION


@pytest.mark.parametrize("words", ["read LINE 40000", "read LINE 50000", "read LINE 39999 -t coils", "read LINE 30000", "read LINE 100"])
def test_of_another_number_the_manual_is_to_be_checked(mbm, words):
    says(mbm, "Check address and count against the device's manual; if that counts from 1, use --one-based.", "In a manual",
         *words.replace("LINE", refusing(2)).split())


FIELD = "fields:\n- {{name: level, table: holding, address: {}, type: uint16}}\n"


@pytest.mark.parametrize("number, words, wanted, not_wanted", [
    (2, ("read", "LINE", 100, "--one-based"), "if that counts from 0, leave out --one-based.", "use --one-based"),
    (2, ("write", "LINE", 30101, 5), "In a manual, 30101 is the input register with address 100, which cannot be written.", "mbm write t"),
    # poll and call have no --one-based.
    (2, ("poll", "LINE", "7", "--once", "-q"),
     "unit 1, field level in line 2 of the file: exception 02: illegal data address. Check table, address and type in the file", "--one-based"),
    (2, ("poll", "LINE", "7", "--once", "-q", "--gap", 5), "subtract 1, or write \"one_based: yes\" at the head of the file. Try without --gap.", "--one-based"),
    (2, ("poll", "LINE", "30108", "--once", "-q"), 'In a manual, 30108 is address 107: write "table: input" and "address: 107", or "notation: modicon" if', "--one-based"),
    (2, ("call", "LINE", "03 9C A5 00 01"), "Check address and count in HEX against the device's manual; addresses in a request count from 0.",
     "--one-based"),
    (2, ("identify", "LINE"), "exception 02: illegal data address. The device does not have it.", "one-based|Check"),
    (1, ("read", "LINE", 0), "The device does not have this function; values may be in another table.", ""),
    (1, ("call", "LINE", "03 00 00 00 01"), "The device does not have this function.", "table"),
    (3, ("read", "LINE", 0), "illegal data value. Check the count against", "values"),
    (3, ("write", "LINE", 0, 1), "illegal data value. Check the count and the values against", ""),
    (4, ("read", "LINE", 0), "The device failed at it: its own display or log may say why.", ""),
])
def test_the_advice_for_an_exception_fits_the_command(mbm, write, number, words, wanted, not_wanted):
    file = write("advice.yaml", FIELD.format(words[2])) if words[0] == "poll" else ""
    line = refusing(number)
    says(mbm, wanted, not_wanted, *(line if one == "LINE" else file if file and at == 2 else one for at, one in enumerate(words)))


@pytest.mark.parametrize("words", [("read", "LINE", 0), ("poll", "LINE", "FILE", "--once"), ("scan", "LINE", "--units", "1-3"), ("identify", "LINE"),
                                   ("call", "LINE", "03 00 00 00 01"), ("write", "LINE", 0, 1)], ids=lambda words: words[0])
def test_a_line_without_a_baud_rate_has_no_advice_about_it(mbm, silent, write, words):
    names = {"LINE": silent.line, "FILE": write("advice.yaml", FIELD.format(7))}
    says(mbm, "of ", "baud|parity|wiring", *(names.get(one, one) for one in words), "--timeout", "200ms")


def test_a_gateway_has_no_advice_about_baud_rates_of_a_device_over_tcp(mbm, silent):
    gateway = mbm.begin("gateway", "tcp://127.0.0.1:0", silent.line, "1", "--timeout", "50ms")
    for _ in range(6):
        mbm("read", f"tcp://127.0.0.1:{gateway.last_word()}", 0, *PATIENT)
    assert "got no reply. Check the units' numbers; of devices behind a gateway also its line." in gateway.end().error


def test_a_device_server_has_a_serial_line_behind_it(mbm):
    with socket.create_server(("127.0.0.1", 0)) as server:
        says(mbm, "baud rate, parity and wiring behind the device server", "", "read", f"rtu+tcp://127.0.0.1:{server.getsockname()[1]}", 0,
             "--timeout", "200ms")


@pytest.mark.parametrize("answer, sentence", [
    (lambda frame: b"\xFC\x80\0", "no right reply from unit 1 within 200ms: 3 bytes came that are no reply. Check the unit's number, baud rate"),
    (lambda frame: frame, "its own request came back. If the receiver hears what is sent, add echo=yes to the name of the line."),
], ids=["noise", "echo"])
def test_what_came_on_a_serial_line_is_explained(mbm, folder, answer, sentence):
    says(mbm, sentence, "", "read", SerialDevice(folder, answer).line, 0, "--timeout", "200ms")


def test_of_a_read_that_is_partly_refused_the_hole_is_named(mbm):
    partly = TcpDevice(lambda pdu: bytes([0x83, 2]) if pdu[1:3] in (b"\0\x7D", b"\0\xFA") else bytes([3, 2 * pdu[4]]) + bytes(2 * pdu[4]))
    code, out, error = mbm("read", partly.line, 0, 400, *PATIENT)
    assert (code, out.count("\n"), error.count("exception")) == (EXCEPTION, 150, 1)
    assert "mbm read: unit 1, addresses 125 to 374: exception 02" in error
    assert "unit 1, addresses 126 to 375: " in mbm("read", partly.line, 1, 400, "--one-based", *PATIENT).error
    assert mbm("read", partly.line, 0, "--every", "10ms", "--times", 1, *PATIENT).error == "mbm read: 1 round, 0 of them with failures.\n"
