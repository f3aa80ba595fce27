"""mbm sniff on a recording of a bus, on a terminal and on a stream of TCP."""

import json
import os
import re
import socket
import struct
import termios
import time

import pytest
from peers import LINE, ROOT, WRONG, wait

REQUEST, REPLY = bytes.fromhex("1103006b00037687"), bytes.fromhex("110306022b00000064c8ba")
AT = ("--baud", "19200", "-")


def recorded(name):
    with open(f"{ROOT}/examples/recordings/{name}") as file:
        return file.read()


@pytest.fixture
def sniff(plain):
    return lambda *words, text="": plain("sniff", *words, text=text)


def events_of(found):
    return [json.loads(line) for line in found.out.splitlines()]


def test_a_recording_is_explained_as_its_example_says(sniff):
    found = sniff(*AT, text=recorded("bus.hex"))
    assert (found.code, found.out + found.error) == (0, recorded("bus.txt"))
    assert sniff("--quiet", *AT, text=recorded("bus.hex")) == (0, found.out, "")


def test_json_has_the_same_texts_and_their_parts(sniff):
    events = events_of(sniff("--json", *AT, text=recorded("bus.hex")))
    assert [one["text"] for one in events] == [line[23:] for line in recorded("bus.txt").splitlines()[:-1]]
    assert events[1] == {"seconds": 0.012, "event": "reply", "unit": 17, "function": 3, "address": 107, "quantity": 3, "values": [555, 0, 100],
                         "response_ms": 12, "text": events[1]["text"], "bytes": REPLY.hex()}
    assert (events[7]["event"], events[7]["exception"]) == ("exception", 2)


def test_a_recording_may_be_in_ascii_and_a_timeout_shorter(sniff):
    found = sniff("--timeout", "300ms", "--framing", "ascii", "-", text="0: 3A 30 31 30 33 30 30 30 30 30 30 30 31 46 42 0D 0A")
    assert [" ".join(line.split()) for line in found.out.splitlines()] == [
        "0.000 unit 1 request 03 read holding registers 0", "0.300 300.0 ms unit 1 timeout 03 read holding registers 0"]


def frames_of_pcap(path):
    """The times of the packets in a pcapng file, in microseconds."""
    found = []
    with open(path, "rb") as file:
        blocks = file.read()
    while blocks:
        kind, length = struct.unpack_from("<II", blocks)
        if kind == 6:
            high, low = struct.unpack_from("<II", blocks, 12)
            found.append(high << 32 | low)
        blocks = blocks[length:]
    return found


def test_of_several_frames_in_one_piece_the_first_ones_ended_before_its_time(sniff, folder):
    """The time of a piece is that of its last byte. The reply has 11 characters of 11 bits: 11 * 11 / 19200 s."""
    glued = "0: " + (REQUEST + REPLY).hex(" ")
    times = lambda found: [line.split()[0] for line in found.out.splitlines()]
    assert times(sniff(*AT, text=glued)) == ["-0.006", "0.000"]
    assert times(sniff(*AT, text=glued.replace("0:", "100:"))) == ["0.093", "0.100"]
    assert [round(one["seconds"], 3) for one in events_of(sniff("--json", *AT, text=glued))] == [-0.006, 0]
    assert [line.split(" ")[0] for line in sniff("--trace", *AT, text=glued).error.splitlines()[:2]] == ["00:00:00.000000"] * 2
    sniff("--pcap", f"{folder}/frames", *AT, text=glued)
    assert frames_of_pcap(f"{folder}/frames") == [0, 0]


@pytest.mark.parametrize("limit, kinds", [("200ms", ["request", "timeout"]), ("20ms", ["bad CRC", "bad CRC"])])
def test_a_frame_may_come_in_two_pieces_within_its_timeout(sniff, limit, kinds):
    recording = f"0: {REQUEST[:4].hex()}\n120: {REQUEST[4:].hex()}\n"
    assert [one["event"] for one in events_of(sniff("--json", "--frame-timeout", limit, "-", text=recording))] == kinds


@pytest.mark.parametrize("recording, sentence", [
    ("0: 11 03 0", "line 1 of the recording: bytes are pairs of hexadecimal digits"),
    ("0: 11\nx: 12", "line 2 of the recording: before the colon stands a time"),
    ("5: 11\n4: 12", "line 2 of the recording: the time is not between"),
    ("nan: 12", "line 1 of the recording: the time is not between"),
    ("0: " + "00" * 2701, "line 1 of the recording: a line has at most 2700 bytes"),
], ids=range(5))
def test_a_wrong_line_of_a_recording_is_named(sniff, recording, sentence):
    found = sniff("-", text=recording)
    assert found.code == WRONG and sentence in found.error


def seen(program):
    """The first two lines, without their times."""
    program.await_output(since=1)
    return [" ".join(re.sub(r"^ *\d+\.\d{3} +([\d.]+ ms)? *", "", line).split()) for line in program.output]


SEEN = ["unit 17 request 03 read holding registers 107..109", "unit 17 reply 03 read holding registers 107..109: 555 0 100"]


def test_a_terminal_is_watched_until_a_signal(plain, wire):
    program = plain.begin("sniff", f"rtu:{wire.names[1]}?baud=115200&parity=none")
    end = os.open(wire.names[0], os.O_WRONLY | os.O_NOCTTY)
    # The sniffer discards bytes that came before it had set its terminal.
    assert wait(lambda: termios.tcgetattr(wire.terminals[1])[4] == termios.B115200 and program.sleeps)
    os.write(end, REQUEST)
    time.sleep(0.1)
    os.write(end, REPLY)
    assert seen(program) == SEEN
    os.close(end)
    assert program.end().error.startswith("mbm sniff: requests: 1, replies: 1, exceptions: ")


def test_a_stream_of_tcp_is_watched_until_the_connection_is_lost(plain):
    with socket.create_server(("127.0.0.1", 0)) as server:
        program = plain.begin("sniff", f"rtu+tcp://127.0.0.1:{server.getsockname()[1]}")
        with server.accept()[0] as connection:
            connection.sendall(REQUEST)
            time.sleep(0.1)
            connection.sendall(REPLY)
            assert seen(program) == SEEN
        assert "the line was lost" in program.wait(LINE).error
