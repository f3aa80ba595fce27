"""mbm serve as the devices that people meet: each word of --fault for one, with mbm read, pymodbus and libmodbus as the master
that suffers, and all words together by chance."""

import random
import re
import select
import socket
import ssl
import time

import pytest
from masters import QUIET, Asker, framed, mbpoll, outcome, port_of, pymodbus_client
from peers import (DONE, EXCEPTION, LINE, NO_REPLY, PATIENCE, PATIENT, READ, WRONG, Client, Wire, context, number, tcp_frame,
                   tls_line, wait)

TCP, UDP, RTU_OVER_TCP = "tcp://127.0.0.1:0", "udp://127.0.0.1:0", "rtu+tcp://127.0.0.1:0"
BUSY = b"\x83\x06"
NOTHING = "failed"


@pytest.fixture
def playing(mbm):
    def playing(*faults, line=TCP, units="1"):
        """A device with these faults whose registers hold what is written; returns its place."""
        return mbm.serve(line, "--echo", "--unit", units, *(word for fault in faults for word in ("--fault", fault)))

    return playing


@pytest.fixture
def client(playing):
    """A client of such a device. Its `again` makes another one."""

    def client(*faults, **more):
        place = playing(*faults, **more)
        made = Client(port_of(place))
        made.place, made.again = place, lambda: Client(port_of(place))
        return made

    return client


def read(address=0, count=1, function=3):
    return bytes([function]) + address.to_bytes(2, "big") + count.to_bytes(2, "big")


def write(address, *values):
    """Function 06 of one value, 10 (hex) of several."""
    if len(values) == 1:
        return bytes([6]) + address.to_bytes(2, "big") + values[0].to_bytes(2, "big")
    data = b"".join(value.to_bytes(2, "big") for value in values)
    return b"\x10" + address.to_bytes(2, "big") + bytes([0, len(values), len(data)]) + data


def is_silent(one):
    return not select.select([one.socket], [], [], QUIET)[0]


def has_ended(one):
    try:
        return one.socket.recv(1) == b""
    except ConnectionResetError:
        return True


# --- who answers

def test_a_device_answers_with_another_unit(client):
    for unit in (0, 255):
        device = client(f"unit={unit}")
        device.send(1)
        assert device.response() == (1, unit, number(0))


@pytest.mark.parametrize("line, framing", [("pty:", "rtu"), (RTU_OVER_TCP, "rtu"), (UDP, "tcp"), ("ascii", "ascii")])
def test_a_device_answers_with_another_unit_on_each_kind_of_line(mbm, playing, line, framing):
    if line == "ascii":
        ours, theirs = Wire().names
        mbm.serve(f"ascii:{ours}?parity=none", "--echo", "--fault", "unit=9")
        place = f"ascii:{theirs}"
    else:
        place = playing("unit=9", line=line)
    answer = framed(framing, b"\x09" + number(0))
    assert Asker(place).ask(b"\x01" + READ, len(answer)) == answer


@pytest.mark.parametrize("word, wanted", [("0", [0, 0, 0, 0]), ("65535", [65535] * 4), ("count", [1, 2, 3, 4]), ("before", [0, 100, 200, 300])])
def test_a_device_answers_with_another_transaction_number(client, word, wanted):
    device, found = client(f"transaction={word}"), []
    for sent in (100, 200, 300, 400):
        device.number = sent - 1
        device.send(1)
        found.append(device.response()[0])
    assert found == wanted


def test_an_own_count_is_that_of_all_connections_and_begins_when_it_happens_first(client):
    one = client("transaction=count@2-")
    found = []
    for peer in (one, one.again(), one):
        peer.number = 40
        peer.send(1)
        found.append(peer.response()[0])
    assert found == [41, 1, 2]


# --- what is refused

@pytest.mark.parametrize("fault, pdu, wanted", [
    ("only-function=16", write(0, 5), b"\x86\x01"), ("only-function=16", READ, b"\x83\x01"), ("only-function=0x10", write(0, 5, 6), b"\x10\0\0\0\2"),
    ("no-function=6", write(0, 5), b"\x86\x01"), ("no-function=0x06", READ, number(0)), ("no-function=43", b"\x2b\x0e\x01\0", b"\xab\x01"),
    ("most-registers=80", read(0, 80), b"\3\xa0" + bytes(160)), ("most-registers=80", read(0, 81), b"\x83\2"),
    ("most-registers=80", read(0, 81, 4), b"\x84\2"), ("most-registers=1", write(0, 5, 6), b"\x90\2"),
    ("most-registers=2", b"\x17\0\0\0\2\0\0\0\3\6\0\1\0\2\0\3", b"\x97\2"), ("most-registers=1", read(0, 16, 1), b"\1\2\0\0"),
    ("most-bits=16", read(0, 16, 1), b"\1\2\0\0"), ("most-bits=16", read(0, 17, 2), b"\x82\2"), ("most-bits=16", read(0, 17), b"\3\x22" + bytes(34)),
    ("hole=10-19", read(9, 1), number(0)), ("hole=10-19", read(9, 2), b"\x83\2"), ("hole=10-19", read(19, 1), b"\x83\2"),
    ("hole=10-19", read(20, 1), number(0)), ("hole=10-19", read(0, 30), b"\x83\2"), ("hole=10", write(10, 5), b"\x86\2"),
    ("hole=10", b"\x16\0\x0a\0\0\0\0", b"\x96\2"), ("hole=65535", read(65535, 1), b"\x83\2"), ("hole=0-65535", read(65535, 1), b"\x83\2"),
    ("hole=10", b"\x17\0\0\0\1\0\x0a\0\1\2\0\1", b"\x97\2"),
])
def test_a_device_refuses_functions_and_blocks(client, fault, pdu, wanted):
    assert client(fault).ask(1, pdu) == wanted


def test_faults_of_one_kind_that_refuse_add_up(client):
    device = client("only-function=3", "only-function=16", "hole=5", "hole=7-8", "refused-with=3", "most-registers=10")
    ask = lambda pdu: device.ask(1, pdu)
    assert [ask(write(0, 1, 2)), ask(read(0, 2)), ask(read(0, 1, 4)), ask(write(0, 9))] == [b"\x10\0\0\0\2", b"\3\4\0\1\0\2", b"\x84\1", b"\x86\1"]
    assert [ask(read(4, 2)), ask(read(6, 1)), ask(read(6, 3)), ask(read(9, 11))] == [b"\x83\3", number(0), b"\x83\3", b"\x83\3"]


def test_a_write_that_is_refused_or_dropped_does_nothing(client):
    for fault in ("no-function=6@1", "hole=0@1", "needs-delay=10m@1"):
        device = client(fault, *(["busy"] if "needs" in fault else []))
        assert [device.ask(1, write(0, 7))[0], device.ask(1)] == [0x86, number(0)]


# --- when it hears

def test_a_device_needs_a_pause_after_connecting(client):
    device = client("needs-delay=10m")
    device.send(1)
    assert is_silent(device)
    device = client("needs-delay=10m", "busy")
    assert [device.ask(1), device.ask(1)] == [BUSY, BUSY]
    begin = time.monotonic()
    device = client("needs-delay=500ms", "busy")
    assert wait(lambda: device.ask(1) == number(0)) and time.monotonic() - begin >= 0.5


def test_a_device_needs_a_pause_between_requests(client):
    device = client("needs-message-wait=30s", "busy")
    assert [device.ask(1), device.ask(1), device.again().ask(1)] == [number(0), BUSY, BUSY]
    device = client("needs-message-wait=200ms", "busy")
    for _ in range(3):
        assert device.ask(1) == number(0)
        time.sleep(0.3)
    device = client("needs-message-wait=200ms")
    device.socket.sendall(tcp_frame(1, 1, READ) + tcp_frame(2, 1, READ))
    assert device.response()[0] == 1 and is_silent(device)
    time.sleep(0.3)
    device.number = 2
    assert device.ask(1) == number(0)


def test_a_device_on_a_serial_line_needs_a_pause_between_requests(playing):
    device = Asker(playing("needs-message-wait=30s", "busy", line="pty:"))
    assert device.ask(b"\x01" + READ) == framed("rtu", b"\x01" + number(0))
    assert device.ask(b"\x01" + READ) == framed("rtu", b"\x01" + BUSY)


def test_a_device_takes_one_request_at_a_time(client):
    both = tcp_frame(1, 1, read(0, 2)) + tcp_frame(2, 1, READ)
    # Two in one segment; the second one while the first is answered; and one on another connection.
    device = client("one-request")
    device.socket.sendall(both)
    assert device.response() == (1, 1, b"\3\4\0\0\0\0") and is_silent(device)
    device.number = 2
    assert device.ask(1) == number(0)
    device = client("one-request", "late=1s@1", "busy")
    device.socket.sendall(both)
    assert [device.response(), device.response()] == [(2, 1, BUSY), (1, 1, b"\3\4\0\0\0\0")]
    device = client("one-request", "late=5s@1", "busy")
    device.send(1)
    other = device.again()
    assert other.ask(1) == BUSY and device.take() == number(0) and other.ask(1) == number(0)


def test_a_busy_device_hears_others_when_a_client_leaves_during_its_answer(client):
    device = client("one-request", "late=10m@1", "busy")
    device.send(1)
    other = device.again()
    assert other.ask(1) == BUSY
    device.socket.close()
    assert wait(lambda: other.ask(1) == number(0))


def test_a_busy_device_says_so_between_frames(client):
    device = client("one-request", "slow=30ms@1", "busy")
    device.send(1)
    first = device.read(1)
    device.send(1)
    assert first + device.read(10) == tcp_frame(1, 1, number(0)) and device.response() == (2, 1, BUSY)


def test_requests_that_a_device_drops_may_come_in_pieces(client):
    device = client("one-request", "late=700ms@1")
    dropped = tcp_frame(2, 1, write(0, *range(100)))
    device.socket.sendall(tcp_frame(1, 1, READ) + dropped[:5])
    for at in range(5, len(dropped), 50):
        device.socket.sendall(dropped[at:at + 50])
    assert device.response()[0] == 1
    device.number = 2
    assert device.ask(1) == number(0)


# --- what becomes of the connection

def test_a_device_closes_an_idle_connection(client):
    device = client("close-idle=1s")
    again = device.again
    for _ in range(2):
        begin = time.monotonic()
        assert device.ask(1) == number(0)
        assert has_ended(device) and time.monotonic() - begin >= 1
        device = again()


def test_a_device_closes_a_connection_that_never_sends_anything(client):
    begin = time.monotonic()
    assert has_ended(client("close-idle=300ms")) and time.monotonic() - begin >= 0.3


def test_a_device_closes_after_each_answer_or_after_some(client):
    for most in (1, 3):
        first = client(f"close-after={most}")
        for device in (first, first.again()):
            assert [device.ask(1) for _ in range(most)] == [number(0)] * most
            assert has_ended(device)


def test_a_device_goes_deaf_on_a_connection(client):
    device = client("deaf-after=2")
    assert [device.ask(1, write(0, 7)), device.ask(1)] == [write(0, 7), number(7)]
    device.send(1, write(0, 8))
    other = device.again()
    assert [other.ask(1), other.ask(1)] == [number(7)] * 2
    assert is_silent(device)


def test_a_device_has_one_connection_at_a_time(client):
    device = client("connections=1")
    assert device.ask(1) == number(0)
    assert has_ended(device.again())
    assert device.ask(1) == number(0)
    device.socket.close()

    def is_served():
        try:
            return device.again().ask(1) == number(0)
        except OSError:
            return False

    assert wait(is_served)


def test_devices_behind_tls_close_and_count_connections_too(playing):
    place = playing("close-after=2", "connections=1", line=tls_line(0, "server"))

    def secured():
        device = Client(port_of(place))
        device.socket = context("operator", ssl.PROTOCOL_TLS_CLIENT).wrap_socket(device.socket)
        return device

    def is_served():
        try:
            return secured().ask(1) == number(0)
        except OSError:
            return False

    first = secured()
    assert first.ask(1) == number(0)
    assert not is_served()
    assert first.ask(1) == number(0) and has_ended(first)
    assert wait(is_served)


# --- how the bytes come

@pytest.mark.parametrize("line", ["pty:", TCP, RTU_OVER_TCP])
@pytest.mark.parametrize("faults, seconds", [
    # At 19200 baud a byte takes 0.57 ms. 205 or more bytes come in at least 3 blocks.
    (["blocks=100"], 0.114), (["blocks-every=50ms"], 0.15), (["blocks=22", "blocks-every=50ms"], 0.11),
    (["blocks=20", "slow=2ms"], 0.4), (["blocks-every=1ms"], 0.2)], ids=lambda one: "-".join(map(str, one)) if isinstance(one, list) else "")
def test_an_answer_comes_in_blocks(playing, line, faults, seconds):
    peer = Asker(playing(*faults, line=line))
    answer = framed("tcp" if line == TCP else "rtu", b"\x01\x03\xc8" + bytes(200))
    assert peer.ask(b"\x01" + read(0, 100), len(answer)) == answer
    # The least time, whatever the machine does meanwhile.
    assert peer.last >= 0.95 * seconds


# --- unit 0, which is a unit in frames of Modbus TCP

@pytest.mark.parametrize("line", [TCP, "udp://127.0.0.1:0"])
def test_unit_0_has_the_manners_of_other_units(mbm, playing, line):
    place = playing("unit=5", "transaction=count", "needs-message-wait=50ms", "hole=100-109", "most-registers=80", "no-function=6",
                    "exception=6@1", "deaf@2", line=line, units="0,7")
    reach = ("--accept", "unit,transaction", "--message-wait", "80ms", "--busy-retries", 1, "--busy-wait", "10ms", "--retries", 1, "--unit", 0)
    # The first request is refused, and the second gets no answer.
    assert mbm("write", place, 0, 40, 50, *reach).code == DONE
    assert mbm("read", place, 0, 2, *reach, "--timeout", "5s").out == "    0  40\n    1  50\n"
    assert "exception 02" in mbm("read", place, 100, *reach).error
    assert "exception 02" in mbm("call", place, "03 00 00 00 51", *reach).error
    assert "exception 01" in mbm("write", place, 0, 5, *reach).error
    # Unit 7 has the same manners, and registers of its own.
    assert mbm("read", place, 0, 2, *reach[:-1], 7).out == "    0  0\n    1  0\n"
    assert "exception 02" in mbm("read", place, 100, *reach[:-1], 7).error


def test_a_device_file_with_unit_0_has_other_units_too(mbm, write):
    place = mbm.serve("tcp://127.0.0.1:0", write("d.yaml", """\
unit: 0
fields:
- {name: a, table: holding, address: 0, type: uint16, value: 5}
- {name: b, table: holding, address: 9, type: uint16, unit: 23, value: 6, access: read-write}
"""))
    mbm.prints("    0  5\n", "read", place, "--unit", 0, 0)
    mbm.prints("    9  6\n", "read", place, "--unit", 23, 9)
    mbm.prints("unit 23: wrote 1 holding register from address 9 on, function 06\n", "write", place, "--unit", 23, 9, 7)
    mbm.prints("    9  7\n", "read", place, "--unit", 23, 9)
    mbm.fails(EXCEPTION, "exception 02", "read", place, "--unit", 23, 0, *PATIENT)
    # Unit 0 answers for every other one.
    mbm.prints("    0  5\n", "read", place, "--unit", 24, 0)


def test_requests_to_unit_0_count_for_faults_and_are_answered(client):
    device = client("exception=6@2", "close-after=4", units="0")
    assert [device.ask(0, pdu) for pdu in (write(0, 5), write(0, 6), write(1, 7, 8), read(0, 3))] == [
        write(0, 5), b"\x86\x06", b"\x10\0\1\0\2", b"\3\6\0\5\0\7\0\x08"]
    assert has_ended(device)


def test_a_device_file_of_255_units_is_served_and_one_of_256_is_refused(mbm, write):
    field = "- {{name: f{0}, table: holding, address: 0, type: uint16, unit: {0}, value: {0}}}\n".format
    file = lambda units: write("units.yaml", "fields:\n" + "".join(map(field, units)))
    place = mbm.serve(TCP, file(range(1, 256)))
    assert [Client(port_of(place)).ask(unit) for unit in (1, 254)] == [number(1), number(254)]
    mbm.fails(WRONG, "units.yaml: the fields have 256 units, and up to 255 are served.", "serve", TCP, file(range(256)))


# --- the masters that suffer

@pytest.mark.parametrize("faults, by_mbm, sentence, by_libmodbus, by_pymodbus", [
    (["unit=0"], NO_REPLY, "a reply of unit 0 came", ["0"], None),
    (["transaction=7"], NO_REPLY, "a reply with transaction number 7 came", "Invalid data", NOTHING),
    (["only-function=16"], EXCEPTION, "exception 01", "Illegal function", "exception 01"),
    (["hole=0"], EXCEPTION, "exception 02", "Illegal data address", "exception 02"),
    (["most-registers=1", "refused-with=3"], EXCEPTION, "exception 03", "Illegal data value", "exception 03"),
    (["needs-delay=10m"], NO_REPLY, "did not answer", "Connection timed out", NOTHING),
    (["needs-delay=10m", "busy"], EXCEPTION, "exception 06", "Slave device or server is busy", "exception 06"),
    (["close-after=1"], DONE, "", ["0"], [0, 0]),
    (["deaf-after=1"], DONE, "", ["0"], [0, 0]),
    (["blocks=3", "late=300ms", "close-idle=10m", "connections=1", "needs-message-wait=1ms"], DONE, "", ["0"], [0, 0]),
], ids=lambda one: "-".join(map(str, one)) if isinstance(one, list) else "")
def test_mbm_libmodbus_and_pymodbus_suffer_from_a_device_as_they_do(mbm, playing, faults, by_mbm, sentence, by_libmodbus, by_pymodbus):
    patience = ("--timeout", "1s") if by_mbm == NO_REPLY else PATIENT
    code, out, error = mbm("read", playing(*faults), 0, 2, *patience)
    assert code == by_mbm and sentence in error, out + error
    found = mbpoll(playing(*faults), 1, "-o", "1" if by_libmodbus == "Connection timed out" else "10", "-t", "4", "-r", "0", "-c", "2")
    assert found == by_libmodbus or by_libmodbus == ["0"] and found == ["0", "0"], found
    if by_pymodbus:
        master = pymodbus_client(playing(*faults), 1 if by_pymodbus == NOTHING else 20)
        assert outcome(lambda: master.read_holding_registers(0, count=2, device_id=1)) == by_pymodbus


def test_masters_write_to_a_device_that_has_function_16_only(mbm, playing):
    place = playing("no-function=6")
    assert mbm("write", place, 0, 5, *PATIENT).code == EXCEPTION
    assert mbpoll(place, 1, "-t", "4", "-r", "0", values=[5]) == "Illegal function"
    master = pymodbus_client(place)
    assert outcome(lambda: master.write_register(0, 5)) == "exception 01"
    assert "exception" not in outcome(lambda: master.write_registers(0, [5])) and outcome(lambda: master.read_holding_registers(0, count=1)) == [5]
    # Two values go by function 16.
    assert mbm("write", place, 0, 6, 7, *PATIENT).code == DONE
    assert mbpoll(place, 1, "-t", "4", "-r", "0", values=[8, 9]) == "done"
    mbm.prints("    0  8\n    1  9\n", "read", place, 0, 2)


def test_masters_meet_a_device_that_has_its_connection_taken(mbm, playing):
    place = playing("connections=1")
    holder = Client(port_of(place))
    assert holder.ask(1) == number(0)
    assert mbm("read", place, 0, "--timeout", "1s").code == LINE
    assert mbpoll(place, 1, "-t", "4", "-r", "0", "-c", "1") == "Connection reset by peer"
    master = pymodbus_client(place, 1)
    assert outcome(lambda: master.read_holding_registers(0, count=1)) == NOTHING
    assert holder.ask(1) == number(0)


def test_masters_that_do_not_pause_meet_a_busy_device(mbm, playing):
    place = playing("needs-message-wait=30s", "busy")
    assert mbm("read", place, 0, *PATIENT).code == DONE
    assert mbm("read", place, 0, *PATIENT).code == EXCEPTION
    assert mbpoll(place, 1, "-t", "4", "-r", "0", "-c", "1") == "Slave device or server is busy"
    assert outcome(lambda: pymodbus_client(place).read_holding_registers(0, count=1)) == "exception 06"


def test_a_device_that_takes_one_request_loses_those_that_are_in_flight_beside_it(mbm, playing):
    place = playing("one-request", "late=200ms")
    code, _, error = mbm("read", place, 0, 300, "--in-flight", 4, "--timeout", "2s")
    assert code == NO_REPLY and "try --in-flight 1" in error
    assert mbm("read", place, 0, 300, *PATIENT).code == DONE
    # The others have one request in flight.
    assert mbpoll(place, 1, "-o", "10", "-t", "4", "-r", "0", "-c", "1") == ["0"]
    assert outcome(lambda: pymodbus_client(place).read_holding_registers(0, count=1)) == [0]


def test_rounds_of_mbm_get_along_with_a_device_that_closes_and_goes_deaf(mbm, playing):
    code, out, error = mbm("read", playing("close-idle=300ms"), 0, "--every", "600ms", "--times", 4, "--csv", *PATIENT)
    assert code == DONE and out.count(",success,") == 4, out + error
    code, out, error = mbm("read", playing("deaf-after=3"), 0, "--every", "100ms", "--times", 10, "--csv", "--timeout", "1s", "--retries", 2)
    assert code == DONE and out.count(",success,") == 10, out + error


def test_the_summary_counts_what_a_fault_has_changed(mbm):
    server = mbm.begin("serve", TCP, "--echo", "--fault", "hole=5", "--fault", "needs-delay=1ms@1000", "--fault", "close-after=100")
    peer = Client(port_of(server.last_word()))
    assert [peer.ask(1, read(at)) for at in (4, 5, 6)] == [number(0), b"\x83\2", number(0)]
    assert "requests: 3, with a fault: 1." in server.end().error


# --- all of them by chance

ORDERLY = [
    lambda chance: f"late={chance.randint(1, 40)}ms", lambda chance: f"late={chance.randint(1, 40)}ms@{chance.randint(1, 9)}/{chance.randint(1, 9)}",
    lambda chance: f"deaf@{chance.randint(1, 20)}/{chance.randint(2, 20)}", lambda chance: f"slow=1ms@{chance.randint(1, 9)}/3",
    lambda chance: f"blocks={chance.randint(1, 30)}", lambda chance: f"blocks-every={chance.randint(1, 20)}ms",
    lambda chance: f"exception={chance.randint(1, 127)}@{chance.randint(1, 20)}/{chance.randint(2, 20)}",
    lambda chance: "close@5/7", lambda chance: f"close-idle={chance.randint(1, 60)}ms", lambda chance: f"close-after={chance.randint(1, 9)}",
    lambda chance: f"deaf-after={chance.randint(1, 9)}", lambda chance: f"connections={chance.randint(1, 3)}",
    lambda chance: f"hole={chance.randint(0, 5)}-{chance.randint(5, 99)}", lambda chance: f"most-registers={chance.randint(1, 9)}",
    lambda chance: f"most-bits={chance.randint(1, 9)}", lambda chance: f"no-function={chance.randint(1, 7)}",
    lambda chance: f"only-function={chance.randint(1, 5)}", lambda chance: "one-request",
    lambda chance: f"needs-delay={chance.randint(1, 60)}ms", lambda chance: f"needs-message-wait={chance.randint(1, 30)}ms@{chance.randint(1, 5)}/2",
]
NAMES = [lambda chance: f"unit={chance.randint(0, 255)}", lambda chance: f"transaction={chance.choice([0, 65535, 'count', 'before'])}", lambda chance: "twice@3/5",
         lambda chance: "foreign@2/5"]
MALFORMED = [lambda chance: "damaged@2/3", lambda chance: f"cut={chance.randint(1, 20)}@2/3", lambda chance: f"noise={chance.randint(1, 256)}@3/4",
             lambda chance: "wrong-length@4/3"]


def chosen(chance, kinds):
    faults = [make(chance) for make in chance.sample(kinds, chance.randint(2, 7))]
    needs_busy = any(fault.startswith(("needs", "one-request")) for fault in faults)
    return faults + (["busy"] if needs_busy and chance.random() < 0.5 else [])


class Crowd:
    """A few clients that send anything at any time, leave, come back, and keep all that they get."""

    def __init__(self, port, chance):
        self.port, self.chance, self.peers, self.all = port, chance, [], []

    def connect(self):
        one = socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE)
        self.peers.append(one)
        self.all.append((one, bytearray(), []))

    def ask(self, one):
        pdus = [read(self.chance.randint(0, 9), self.chance.randint(1, 20), self.chance.randint(1, 4)), write(self.chance.randint(0, 9), 5),
                write(0, 1, 2, 3), b"\x2b\x0e\x01\0"]
        asked = next(entry[2] for entry in self.all if entry[0] is one)
        data = b""
        for _ in range(self.chance.choice([1, 1, 2, 5])):
            asked.append(pdu := self.chance.choice(pdus))
            data += tcp_frame(len(asked), 1, pdu)
        one.sendall(data)

    def turn(self):
        while len(self.peers) < 3:
            self.connect()
        one = self.chance.choice(self.peers)
        try:
            self.ask(one)
        except OSError:
            self.leave(one)
        for ready in select.select(self.peers, [], [], self.chance.choice([0, 0, 0.01, 0.03]))[0]:
            self.take(ready)
        if self.chance.random() < 0.1 and one in self.peers:
            self.leave(one)

    def take(self, one):
        try:
            data = one.recv(65536)
        except OSError:
            data = b""
        next(entry[1] for entry in self.all if entry[0] is one).extend(data)
        if not data:
            self.leave(one)

    def leave(self, one):
        self.peers.remove(one)
        one.close()


def frames(data):
    """The frames of Modbus TCP in all that came over a connection; the last one may be cut by its end."""
    while len(data) >= 8:
        length = int.from_bytes(data[4:6], "big")
        assert data[2:4] == b"\0\0" and 3 <= length <= 254, bytes(data[:12])
        yield bytes(data[:6 + length])
        data = data[6 + length:]


@pytest.mark.parametrize("seed", range(12))
def test_any_faults_together_make_nothing_wrong_that_was_not_asked_for_and_the_server_lives(mbm, seed):
    chance = random.Random(seed)
    faults = chosen(chance, ORDERLY + (NAMES if seed % 2 else []))
    server = mbm.begin("serve", TCP, "--echo", *(word for fault in faults for word in ("--fault", fault)))
    crowd = Crowd(port_of(server.last_word()), chance)
    for _ in range(150):
        crowd.turn()
    for _, data, asked in crowd.all:
        functions = {pdu[0] for pdu in asked}
        for frame in frames(data):
            assert frame[7] & 0x7F in functions, (faults, frame)
            if seed % 2 == 0:
                at = int.from_bytes(frame[:2], "big")
                assert frame[6] == 1 and 1 <= at <= len(asked) and frame[7] & 0x7F == asked[at - 1][0], (faults, frame)
    assert server.code is None, faults
    assert re.search(r"requests: \d+, with a fault: \d+\.", server.end().error), faults


@pytest.mark.parametrize("line", [TCP, RTU_OVER_TCP])
@pytest.mark.parametrize("seed", range(4))
def test_a_server_lives_with_any_faults_and_any_bytes(mbm, line, seed):
    chance = random.Random(1000 + seed)
    faults = [fault for fault in chosen(chance, ORDERLY + MALFORMED + NAMES) if line == TCP or not fault.startswith("transaction")]
    if not any(fault.startswith(("needs", "one-request")) for fault in faults):
        faults = [fault for fault in faults if fault != "busy"]
    server = mbm.begin("serve", line, "--echo", *(word for fault in faults for word in ("--fault", fault)))
    crowd = Crowd(port_of(server.last_word()), chance)
    for turn in range(100):
        crowd.turn()
        if turn % 9 == 0 and crowd.peers:
            try:
                crowd.peers[0].sendall(chance.randbytes(chance.randint(1, 300)))
            except OSError:
                crowd.leave(crowd.peers[0])
    assert server.code is None, faults
    server.end()
