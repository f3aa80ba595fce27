"""mbm serve and mbm poll with clients of pymodbus, of libmodbus (mbpoll) and with requests whose answers are compared byte by
byte: devices from files, --random, --echo, and every fault on every kind of line."""

import json
import os
import re
import signal
import time

import pytest
from masters import Asker, framed, mbpoll, outcome, port_of, pymodbus_client
from peers import (CERTIFICATES, DAMAGED, DONE, EXCEPTION, LINE, NO_REPLY, PATIENT, READ, ROOT, Client, Program, Strace, Wire,
                   between_sends, number, wait)

METER = f"{ROOT}/examples/devices/energy-meter.yaml"
TCP = "tcp://127.0.0.1:0"
# rtu and ascii are terminals that the server opens.
LINES = ["pty:", "rtu", "ascii", TCP, "rtu+tcp://127.0.0.1:0", "udp://127.0.0.1:0"]
WRITTEN = """
device: test
fields:
  - {name: level, table: holding, address: 7, type: int16, value: 21}
  - {name: offset, table: holding, address: 8, type: int16, value: -2}
  - {name: state, table: holding, address: 8, type: bit, bit: 1, count: 3, value: 7}
  - {name: alarm, table: holding, address: 8, type: bit, bit: 0}
  - {name: limit, table: holding, address: 20, type: float, value: 1.5, order: CDAB, access: read-write}
  - {name: key, table: holding, address: 30, type: uint16, access: write}
  - {name: model, table: holding, address: 40, type: text, count: 7, value: "Ger\u00e4t 1"}
  - {name: last, table: input, address: 65532, type: uint64, value: 18446744073709551615}
  - {name: relays, table: coils, address: 65535, value: on, access: read-write}
"""
VALUES = [21, -2, 7, False, 1.5, "Ger\u00e4t 1", 18446744073709551615, True]


@pytest.fixture
def file(write):
    """A device file with everything."""
    return write("test.yaml", WRITTEN)


@pytest.fixture
def serving(mbm):
    def serving(kind, *words):
        """A server on a kind of line; returns the place of its clients."""
        if kind not in ("rtu", "ascii"):
            return mbm.serve(kind, *words)
        ours, theirs = Wire().names
        # A loaded machine may deliver a request in pieces.
        mbm.serve(f"{kind}:{ours}?parity=none{'&gap=50ms' if kind == 'rtu' else ''}", *words)
        return f"ascii:{theirs}" if kind == "ascii" else theirs

    return serving


# --- requests, byte by byte

UNIT, FIRST = 1, 7


def read_request(address=FIRST, count=2):
    return bytes([UNIT, 3]) + address.to_bytes(2, "big") + count.to_bytes(2, "big")


ANSWER = bytes([UNIT, 3, 4, 0, 21, 0xFF, 0xFE])


def damaged(framing, frame):
    if framing == "tcp":
        return frame[:2] + b"\xFF" + frame[3:]
    if framing == "ascii":
        return frame[:-3] + (b"1" if frame[-3:-2] == b"0" else b"0") + frame[-2:]
    return frame[:-1] + bytes([frame[-1] ^ 0xFF])


def faults_in_bytes(kind):
    """The faults of a kind of line, and the second of three answers."""
    framing = "ascii" if kind == "ascii" else "rtu" if kind.startswith(("pty", "rtu")) else "tcp"
    right = framed(framing, ANSWER)
    longer = right[:5] + bytes([right[5] + 1]) + right[6:] if framing == "tcp" else framed(framing, ANSWER[:2] + b"\x05" + ANSWER[3:])
    rows = {
        "late=900ms": right, "deaf": b"", "slow=10ms": right, "damaged": damaged(framing, right), "cut=3": right[:3], "cut=500": right,
        "noise=4": b"????" + right, "twice": right + right, "exception=6": framed(framing, bytes([UNIT, 0x83, 6])),
        "foreign": framed(framing, bytes([UNIT + 1]) + ANSWER[1:]) + right, "wrong-length": longer, "close": b"<closed>",
    }
    if kind.startswith("udp"):
        rows = {name: rows[name] for name in ("late=900ms", "deaf", "twice", "exception=6", "foreign")}
    if "tcp" not in kind:
        rows.pop("close", None)
    return right, rows


@pytest.mark.parametrize("kind, fault", [(kind, fault) for kind in LINES for fault in faults_in_bytes(kind)[1]])
def test_a_fault_happens_to_the_second_of_three_requests(serving, file, kind, fault):
    right, rows = faults_in_bytes(kind)
    place = serving(kind, file, "--fault", f"{fault}@2")
    peer = Asker(place)
    assert peer.ask(read_request(), len(right)) == right
    found = peer.ask(read_request(), len(rows[fault]))
    if fault == "deaf":
        time.sleep(0.7)  # on a loaded machine the next request would follow without a silence
    if fault == "noise=4":
        assert len(found) == len(right) + 4 and found.endswith(right)
    else:
        assert found == rows[fault]
    # These times are the least, whatever the machine does meanwhile.
    assert fault != "late=900ms" or peer.first >= 0.85
    assert fault != "slow=10ms" or peer.last >= 0.0095 * (len(right) - 1)
    if fault == "close":
        peer = Asker(place)
    assert peer.ask(read_request(), len(right)) == right


@pytest.mark.parametrize("when, wanted", [("", "FFFFFFF"), ("@1", "F......"), ("@3", "..F...."), ("@3-", "..FFFFF"), ("@2/3", ".F..F.."),
                                          ("@1/2", "F.F.F.F")])
def test_a_fault_happens_to_the_requests_that_its_option_names(mbm, file, when, wanted):
    client = Client(port_of(mbm.serve(TCP, file, "--fault", f"exception=4{when}")))
    assert "".join("F" if client.ask(UNIT, read_request()[1:])[0] == 0x83 else "." for _ in wanted) == wanted


def test_the_requests_of_all_clients_count_together_and_faults_add_up(mbm, file):
    place = mbm.serve(TCP, file, "--fault", "twice@2", "--fault", "damaged@2", "--fault", "cut=9@3")
    one, two, right = Asker(place), Asker(place), framed("tcp", ANSWER)
    assert one.ask(read_request()) == right
    assert two.ask(read_request()) == 2 * damaged("tcp", right)
    assert one.ask(read_request()) == right[:9]


def test_a_request_that_gets_an_exception_does_nothing(mbm):
    client = Client(port_of(mbm.serve(TCP, "--echo", "--fault", "exception=6@1")))
    write = bytes([6, 0, 0, 0, 99])
    assert [client.ask(UNIT, pdu) for pdu in (write, READ, write, READ)] == [bytes([0x86, 6]), number(0), write, number(99)]


# --- devices from files, with clients of others

@pytest.mark.parametrize("kind", LINES)
def test_a_client_of_pymodbus_reads_a_device_from_a_file(serving, kind):
    client = pymodbus_client(serving(kind, METER))
    holding = lambda first, count, unit=17: outcome(lambda: client.read_holding_registers(first, count=count, device_id=unit))
    coil = lambda: outcome(lambda: client.read_coils(3, count=1, device_id=17))
    # Scaled registers, a negative int32, the low word first, another unit.
    assert holding(0, 3) == [2301, 2298, 2314]
    assert holding(6, 2) == [0xFFFF, 0xFB1E]
    assert holding(20, 4) == [104217 & 0xFFFF, 104217 >> 16, 389, 0]
    assert holding(0, 1, 18) == [1200]
    assert outcome(lambda: client.read_input_registers(40, count=1, device_id=17)) == [2150]
    # An address that is not in the file, a range with one, the last address, a table without fields, a write of what is read.
    assert [holding(3, 1), holding(2, 2), holding(65535, 1)] == ["exception 02"] * 3
    assert outcome(lambda: client.read_discrete_inputs(0, count=1, device_id=17)) == "exception 02"
    assert outcome(lambda: client.write_register(0, 1, device_id=17)) == "exception 02"
    assert coil() == [1]
    assert outcome(lambda: client.write_coil(3, False, device_id=17)) != "failed"
    assert coil() == [0]


@pytest.mark.parametrize("kind", ["pty:", TCP])
def test_a_client_of_libmodbus_reads_a_device_from_a_file(serving, kind):
    place = serving(kind, METER)
    assert mbpoll(place, 17, "-t", "4", "-r", "0", "-c", "3") == ["2301", "2298", "2314"]
    assert mbpoll(place, 17, "-t", "4:int", "-B", "-r", "6", "-c", "1") == ["-1250"]
    assert mbpoll(place, 17, "-t", "4", "-r", "3", "-c", "1") == "Illegal data address"
    assert mbpoll(place, 17, "-t", "4", "-r", "0", values=[5]) == "Illegal data address"
    assert mbpoll(place, 17, "-t", "0", "-r", "3", "-c", "1") == ["1"]


RIGHT, NOTHING = [21, 65534], "failed"
TIMEOUT, BUSY = "Connection timed out", "Slave device or server is busy"


# None: it depends on the time, or there is no such line for libmodbus here. libmodbus and pymodbus do not find an answer after noise.
@pytest.mark.parametrize("kind, fault, by_libmodbus, by_pymodbus, by_poll", [
    ("pty:", "late=200ms", ["21"], RIGHT, DONE),
    ("pty:", "deaf", TIMEOUT, NOTHING, NO_REPLY),
    ("pty:", "slow=5ms", ["21"], RIGHT, DONE),
    ("pty:", "damaged", "Invalid CRC", NOTHING, DAMAGED),
    ("pty:", "cut=3", TIMEOUT, NOTHING, NO_REPLY),
    ("pty:", "noise=4", None, NOTHING, DONE),
    ("pty:", "twice", ["21"], RIGHT, DONE),
    ("pty:", "exception=6", BUSY, "exception 06", EXCEPTION),
    ("pty:", "foreign", None, None, DONE),
    ("pty:", "wrong-length", None, NOTHING, DAMAGED),
    ("ascii", "late=200ms", None, RIGHT, DONE),
    ("ascii", "damaged", None, NOTHING, DAMAGED),
    ("ascii", "exception=6", None, "exception 06", EXCEPTION),
    (TCP, "late=200ms", ["21"], RIGHT, DONE),
    (TCP, "deaf", TIMEOUT, NOTHING, NO_REPLY),
    (TCP, "slow=5ms", ["21"], RIGHT, DONE),
    (TCP, "damaged", None, NOTHING, NO_REPLY),
    (TCP, "cut=3", TIMEOUT, NOTHING, NO_REPLY),
    (TCP, "twice", ["21"], RIGHT, DONE),
    (TCP, "exception=6", BUSY, "exception 06", EXCEPTION),
    (TCP, "wrong-length", None, NOTHING, None),
    (TCP, "close", "Connection reset by peer", NOTHING, LINE),
    ("rtu+tcp://127.0.0.1:0", "noise=4", None, None, DONE),
    ("rtu+tcp://127.0.0.1:0", "twice", None, RIGHT, DONE),
    ("rtu+tcp://127.0.0.1:0", "damaged", None, NOTHING, DAMAGED),
    ("rtu+tcp://127.0.0.1:0", "close", None, NOTHING, LINE),
    ("udp://127.0.0.1:0", "late=200ms", None, RIGHT, DONE),
    ("udp://127.0.0.1:0", "deaf", None, NOTHING, NO_REPLY),
    ("udp://127.0.0.1:0", "twice", None, RIGHT, DONE),
    ("udp://127.0.0.1:0", "exception=6", None, "exception 06", EXCEPTION),
])
def test_libmodbus_pymodbus_and_mbm_poll_see_a_fault_as_they_do(mbm, serving, file, kind, fault, by_libmodbus, by_pymodbus, by_poll):
    # Each client has a server of its own, since a fault may leave bytes on the line.
    server = lambda: serving(kind, file, "--fault", fault)
    if by_libmodbus:
        assert mbpoll(server(), UNIT, "-o", "1" if by_libmodbus == TIMEOUT else "10", "-t", "4", "-r", FIRST, "-c", "1") == by_libmodbus
    if by_pymodbus:
        client = pymodbus_client(server(), 1 if by_pymodbus == NOTHING else 20)
        assert outcome(lambda: client.read_holding_registers(FIRST, count=2, device_id=UNIT)) == by_pymodbus
    if by_poll is None:
        return
    place = server()
    where = place if "//" in place else f"{place if ':' in place else 'rtu:' + place}?parity=none"
    # A damaged reply may be followed by the right one, so the client waits for that too.
    code, out, error = mbm("poll", where, file, "--once", "--json", *(PATIENT if by_poll in (DONE, EXCEPTION) else ("--timeout", "1s")))
    assert code == by_poll, out + error
    assert code != DONE or [json.loads(row)["value"] for row in out.splitlines()] == VALUES


def test_a_device_file_says_what_may_be_read_and_written(mbm, file):
    client = pymodbus_client(mbm.serve(TCP, file))
    read = lambda first, count: outcome(lambda: client.read_holding_registers(first, count=count))
    # A float, low word first.
    assert read(20, 2) == [0, 0x3FC0]
    assert outcome(lambda: client.write_registers(20, [1, 2])) != "failed"
    assert read(20, 2) == [1, 2]
    # A field that can only be written, and a write beyond a field.
    assert read(30, 1) == "exception 02"
    assert "exception" not in outcome(lambda: client.write_register(30, 5))
    assert outcome(lambda: client.write_registers(21, [1, 2])) == "exception 02"
    assert read(20, 2) == [1, 2]
    # A text in Latin-1, the last input registers, the last coil.
    assert read(40, 4) == [0x4765, 0x72E4, 0x7420, 0x3100]
    assert outcome(lambda: client.read_input_registers(65532, count=4)) == [65535] * 4
    assert outcome(lambda: client.read_coils(65535, count=1)) == [1]
    # A write and a read at once, and identification.
    assert outcome(lambda: client.readwrite_registers(read_address=7, read_count=1, write_address=20, values=[7])) == [21]
    assert read(20, 1) == [7]
    reply = client.read_device_information(read_code=1)
    assert (reply.information[0], reply.information[1]) == (b"mbm", b"test")


def test_echo_keeps_what_is_written_to_each_unit(mbm):
    client = pymodbus_client(mbm.serve(TCP, "--echo", "-u", "1,5-6"))
    for unit in (1, 5, 6):
        read = lambda: outcome(lambda: client.read_holding_registers(65530, count=6, device_id=unit))
        assert read() == [0] * 6
        client.write_registers(65534, [unit, 2], device_id=unit)
        assert read() == [0, 0, 0, 0, unit, 2]
        client.write_coil(65535, True, device_id=unit)
        assert outcome(lambda: client.read_coils(65535, count=1, device_id=unit)) == [1]
        assert outcome(lambda: client.read_input_registers(0, count=2, device_id=unit)) == [0, 0]


def test_random_values_move_by_small_steps_and_are_the_same_after_each_start(mbm):
    found = []
    for _ in range(2):
        client = pymodbus_client(mbm.serve(TCP, "--random"))
        found.append([outcome(lambda: client.read_input_registers(100, count=50)) for _ in range(20)])
        steps = {((b - a + 32768) & 0xFFFF) - 32768 for one, two in zip(found[-1], found[-1][1:]) for a, b in zip(one, two)}
        assert steps == set(range(-5, 6))
        bits = [outcome(lambda: client.read_discrete_inputs(7, count=1)) for _ in range(100)]
        assert {0, 1} == {bit for one in bits for bit in one}
        # What was written stays.
        client.write_registers(500, [123])
        assert [outcome(lambda: client.read_holding_registers(500, count=1)) for _ in range(5)] == [[123]] * 5
    assert found[0] == found[1]


# --- mbm poll

def test_poll_prints_the_values_of_a_device(mbm):
    poll = ("poll", mbm.serve(TCP, METER), METER, *PATIENT)
    code, out, error = mbm(*poll, "--once", "--json")
    rows = {row["name"]: row for row in map(json.loads, out.splitlines())}
    assert (code, [row.get("value") for row in rows.values()]) == (DONE, [230.1, 229.8, 231.4, -1.25, 104217, 389, 21.5, True, False, 1200])
    assert {key: rows["temperature"][key] for key in ("round", "unit", "unit_of_measurement", "code", "status")} == {
        "round": 1, "unit": 17, "unit_of_measurement": "°C", "code": 0, "status": "success"}
    assert 0 <= rows["power"]["age_ms"] < 20000
    assert re.fullmatch(r"mbm poll: rounds: 1, requests: \d+, replies: \d+, exceptions: 0\.\n", error), error
    code, out, error = mbm(*poll, "--rounds", 2, "-q")
    assert out.count("round ") == 2 and "voltage 1      230.1 V" in out and error == ""
    begin = time.monotonic()
    code, out, error = mbm(*poll, "--for", "1s")
    assert code == DONE and time.monotonic() - begin >= 1 and out.count("round ") >= 1
    # A gap that the device does not have: the requests become shorter.
    code, out, error = mbm(*poll, "--once", "--gap", "16")
    assert code == DONE and "exception" not in out and "exceptions: 0" not in error, error


def test_ctrl_c_ends_poll(mbm):
    poll = mbm.begin("poll", f"rtu:{mbm.serve('pty:', METER)}?parity=none", METER)
    assert poll.await_output().startswith("round 1")
    assert "rounds: " in poll.end(signal.SIGINT).error


def test_a_server_over_tls_refuses_clients_of_another_authority(mbm):
    keys = lambda name: f"?ca={CERTIFICATES}/authority.pem&cert={CERTIFICATES}/{name}.pem&key={CERTIFICATES}/{name}.key.pem"
    place = mbm.serve(f"tls://127.0.0.1:0{keys('server')}", METER)
    code, out, error = mbm("poll", place + keys("operator"), METER, "--once", *PATIENT)
    assert code == DONE and "230.1 V" in out, error
    code, out, error = mbm("poll", place + keys("stranger"), METER, "--once", *PATIENT)
    assert code == LINE and "230.1 V" not in out, error


# --- what a server costs, and the place where it listens

def test_a_request_over_tcp_costs_few_system_calls_however_many_connections_are_idle(plain, folder, record_property):
    """Three, and one more if the machine wakes the server twice."""
    strace, count = Strace(f"{folder}/calls"), 200
    server = Program(*strace.before, plain.path, "serve", "--quiet", TCP, "--random")
    clients = [Client(port_of(server.last_word())) for _ in range(13)]
    for client in clients + (count - 1) * clients[:1]:
        client.ask(UNIT)
    server.end()
    each, sent = between_sends(strace.calls(), count - 1)
    record_property("system calls of mbm serve for a request", f"{each:.2f}")
    assert sent == count + 12 and each <= 4


def test_a_port_that_is_in_use_is_refused(mbm):
    mbm.fails(LINE, "Address already in use. Another program listens there.", "serve", mbm.serve(TCP, "--echo"), "--echo")


# --- names of pseudo terminals

# No system has so many terminals.
NO_TERMINAL = 9999999


def test_a_server_replaces_the_link_of_one_that_was_killed_and_removes_its_own(mbm, folder):
    link = f"{folder}/meter"
    for _ in range(2):
        os.symlink(f"/dev/pts/{NO_TERMINAL}", link)
        server = mbm.begin("serve", f"pty:{link}", "--echo")
        assert (server.last_word(), os.readlink(link).startswith("/dev/pts/")) == (link, True)
        assert Asker(link).ask(read_request(0, 1)) == framed("rtu", bytes([UNIT, 3, 2, 0, 0]))
        server.end()
        assert not os.path.lexists(link)
    server = mbm.begin("serve", f"pty:{link}", "--echo")
    server.await_output()
    assert "requests: 0" in server.end(signal.SIGHUP).error
    assert not os.path.lexists(link)
    for _ in range(10):
        server = mbm.begin("serve", f"pty:{link}", "--echo")
        server.await_output()
        server.end(signal.SIGKILL, -signal.SIGKILL)
        assert os.path.lexists(link)
        server = mbm.begin("serve", f"pty:{link}", "--echo")
        assert wait(lambda: server.output or server.code is not None)
        if server.code is None:
            break
        # A program beside this test has got the number of the terminal meanwhile.
        assert "which a program has open" in server.wait(LINE).error
        os.unlink(link)
    assert server.code is None and os.path.exists(link)


def test_a_second_server_does_not_take_the_name_of_a_running_one(mbm, folder):
    link = f"{folder}/taken"
    server = mbm.begin("serve", f"pty:{link}", "--echo")
    server.await_output()
    held = os.readlink(link)
    mbm.fails(LINE, f"{link} leads to {held}, which a program has open", "serve", f"pty:{link}", "--echo")
    assert os.readlink(link) == held
    assert mbm("write", f"rtu:{link}", "100", "1", *PATIENT).code == DONE
    server.end()
    assert not os.path.lexists(link)


@pytest.mark.parametrize("target", ["FOLDER/mine", "/dev/null", "/dev/nowhere", "/dev/pts/ptmx", "/dev/pts", "FOLDER", f"/dev/pts/../{NO_TERMINAL}"])
def test_a_link_to_something_else_is_neither_replaced_nor_removed(mbm, folder, write, target):
    write("mine", "")
    link, target = f"{folder}/taken", target.replace("FOLDER", folder)
    os.symlink(target, link)
    mbm.fails(LINE, f"leads to {target}", "serve", f"pty:{link}", "--echo")
    assert os.readlink(link) == target


def test_a_link_that_another_program_has_made_meanwhile_stays(mbm, folder, write):
    link, mine = f"{folder}/taken", write("mine", "")
    server = mbm.begin("serve", f"pty:{link}", "--echo")
    server.await_output()
    os.unlink(link)
    os.symlink(mine, link)
    server.end()
    assert os.readlink(link) == mine


def test_a_name_in_a_folder_that_is_not_there_is_refused(mbm, folder):
    mbm.fails(LINE, "No such file or directory. The folder of this name is not there.", "serve", f"pty:{folder}/none/meter", "--echo")


def test_the_first_line_of_a_server_names_its_units_and_its_place(mbm):
    assert re.fullmatch(r"tcp://\[::1\]:\d+", mbm.serve("tcp://[::1]:0", "--echo"))
    for words, wanted in (("-u", "1-247"), "units 1-247 on"), (("-u", "9,1-2,4"), "units 1-2, 4, 9 on"), ((), "unit 1 on"):
        server = mbm.begin("serve", "udp://127.0.0.1:0", "--echo", "-q", *words)
        assert server.await_output().startswith(f"serving {wanted} udp://127.0.0.1:")
        server.end(signal.SIGINT)


def test_a_server_traces_what_its_clients_send(mbm):
    server = mbm.begin("serve", TCP, "--echo", "--trace")
    client = Client(port_of(server.last_word()))
    client.ask(UNIT)
    client.socket.close()
    error = server.end().error
    assert "client 1  received  " in error and "client 1  sent" in error and "requests: 1, with a fault: 0" in error


def test_a_server_ends_with_its_line(mbm):
    ours, theirs = os.openpty()
    server = mbm.begin("serve", f"rtu:{os.ttyname(theirs)}?parity=none", "--echo")
    server.await_output()
    os.close(theirs)
    os.close(ours)
    assert "the line was lost: " in server.wait(LINE).error
