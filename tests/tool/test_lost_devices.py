"""Devices that are away for a while, that close connections, or that are silent; and signals that end a command. Meanwhile mbm
sleeps: a test counts the processor's time, not that of the clock."""

import re
import signal

import pytest
from peers import DONE, LINE, NO_REPLY, Program, SerialDevice, TcpDevice, sealed, wait

ANY = "tcp://127.0.0.1:0"
LOST = "no complete reply in time"


def statuses(out):
    return [line.split(",")[2] for line in out.splitlines()[1:]]


def sleeps(program):
    assert program.cpu < 0.6


def absence(device, program):
    """The device is away for some of the rounds: from the fourth line on, until three more are printed."""
    program.await_output(since=6)
    device.go()
    until = len(program.output) + 6
    assert wait(lambda: len(program.output) > until)
    device.come()


@pytest.fixture(params=["tcp", "rtu"])
def gone(request, folder):
    return TcpDevice() if request.param == "tcp" else SerialDevice(folder)


def test_samples_go_on_while_a_device_is_away(mbm, gone):
    program = mbm.begin("read", gone.line, 0, "--every", "200ms", "--times", 35, "--csv", "--timeout", "500ms")
    absence(gone, program)
    code, out, _ = program.wait()
    found = statuses(out)
    assert len(found) == 35
    assert set(found[:3]) == {"success"} and set(found[-5:]) == {"success"}, found
    assert len(set(found)) > 1 and code in (LINE, NO_REPLY)
    sleeps(program)


def test_rounds_go_on_while_a_device_is_away(mbm, gone):
    program = mbm.begin("read", gone.line, 0, "--every", "200ms", "--times", 30, "--timeout", "500ms")
    absence(gone, program)
    _, out, _ = program.wait()
    rounds = out.split("unit 1, holding, ")[1:]
    assert len(rounds) == 30 and "1 of 1 values read" in rounds[-1], out
    assert any("0 of 1 values read" in one for one in rounds)
    sleeps(program)


def test_samples_go_on_over_new_connections(mbm):
    """The device closes the connection after each answer."""
    device = mbm.serve(ANY, "--echo", "--fault", "close-after=1")
    program = mbm.begin("read", device, 0, "--every", "1500ms", "--times", 4, "--csv")
    assert statuses(program.wait().out) == ["success"] * 4
    sleeps(program)


POLL = "device: d\nunit: 1\ninterval: 600ms\nfields:\n- {name: a, table: holding, address: 0, type: uint16}\n"


@pytest.mark.parametrize("command", ["read", "poll"])
def test_a_connection_that_is_closed_when_idle_costs_no_request(mbm, write, command):
    device = mbm.begin("serve", ANY, "--echo", "--fault", "close-idle=300ms")
    words = (0, "--every", "600ms", "--times", 5, "--csv") if command == "read" else (write("d.yaml", POLL), "--rounds", 5)
    program = mbm.begin(command, device.last_word(), *words, "--timeout", "500ms")
    _, out, error = program.wait(DONE)
    assert "lost" not in out + error
    assert re.search("requests: [45],", device.end().error)
    sleeps(program)


@pytest.mark.parametrize("options, requests, wanted", [
    # Two of each of the first three connections are not answered.
    (("--every", "100ms", "--times", 10, "--retries", 2), 16, ["success"] * 10),
    # A silent connection costs two requests.
    (("--every", "400ms", "--times", 10), 10, (["success"] * 3 + [LOST] * 2) * 2),
    (("--every", "400ms", "--times", 9, "--replace-after", 0), 9, ["success"] * 3 + [LOST] * 6),
], ids=["retries", "two requests", "never replaced"])
def test_a_silent_connection_is_replaced(mbm, options, requests, wanted):
    """After three answers the device takes requests and answers no more, until it is connected to anew."""
    device = mbm.begin("serve", ANY, "--echo", "--fault", "deaf-after=3")
    code, out, _ = mbm("read", device.last_word(), 0, *options, "--csv", "--timeout", "300ms")
    assert statuses(out) == wanted
    assert f"requests: {requests}," in device.end().error
    assert (code == DONE) == (LOST not in wanted)


def test_of_units_behind_a_gateway_that_asks_them_one_after_the_other_fewer_requests_in_flight_are_advised(mbm, folder):
    device = SerialDevice(folder, lambda frame: sealed(bytes([3, 3, 2, 0, 42])) if frame[0] == 3 else None)
    line = f"tcp://127.0.0.1:{mbm.begin('gateway', 'tcp://127.0.0.1:0', device.line, '1-8').last_word()}"
    code, out, error = mbm("scan", line, "--units", "1-8")
    assert code == DONE and re.fullmatch("unit   3: .* 42\n", out), out + error
    assert "in-flight" not in error
    code, _, error = mbm("read", line, 0, "--unit", 5, "--timeout", "200ms", "--in-flight", 4)
    assert code == NO_REPLY and "try --in-flight 1" in error, error
    error = mbm("scan", line, "--units", "4-6", "--timeout", "200ms", "--in-flight", 3).error
    assert "Up to 3 requests were in flight at once: try --in-flight 1.\n" in error


def test_responses_that_come_too_late_are_no_success(mbm):
    device = mbm.serve(ANY, "--echo", "--fault", "late=2500ms")
    program = mbm.begin("read", device, 0, "--every", "5s", "--times", 2, "--csv")
    assert set(statuses(program.wait(NO_REPLY).out)) == {LOST}
    sleeps(program)


def test_rounds_without_a_device_say_why(mbm):
    code, out, _ = mbm("read", "tcp://127.0.0.1:1", 0, "--every", "100ms", "--times", 1)
    assert code == LINE and "Connection refused" in out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_rounds(mbm, device, number):
    program = mbm.begin("read", device.line, 0, "--every", "50ms")
    program.await_output(since=3)
    assert re.fullmatch(r"mbm read: \d+ rounds, 0 of them with failures.\n", program.end(number).error)


def test_nohup_keeps_rounds_from_their_end_by_sighup(mbm, device):
    program = Program("nohup", mbm.path, "read", device.line, "0", "--every", "50ms")
    for turn in range(8):
        program.await_output(since=turn)
        program.tell(signal.SIGHUP)
    program.await_output(since=len(program.output) + 4)
    assert program.code is None
    program.end()


@pytest.mark.parametrize("command, more", [("read", [0]), ("write", [0, 1]), ("call", ["0300000001"]), ("identify", [])])
def test_ctrl_c_ends_a_command_that_waits(mbm, silent, command, more):
    program = mbm.begin(command, silent.line, *more, "--timeout", "1000s")
    assert wait(lambda: silent.asked)
    assert "stopped before unit 1 answered" in program.end(signal.SIGINT, NO_REPLY).error


def test_ctrl_c_ends_a_scan(mbm, silent):
    program = mbm.begin("scan", silent.line, "--timeout", "1000s")
    assert wait(lambda: silent.asked)
    _, out, error = program.end(signal.SIGINT)
    assert out == "" and "0 of 0 requests were answered" in error, error
