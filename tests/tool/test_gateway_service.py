"""mbm gateway as a service: its file, SIGHUP, statistics, log lines, and each row of the failure drill of docs/gateway.md."""

import json
import os
import pty
import signal
import socket
import subprocess
import threading
import time

import pytest
from peers import NO_ANSWER, NO_PATH, PATIENCE, ROOT, SYSTEM, WRONG, Client, TcpDevice, number, wait
from services import Notified, http, metrics, metrics_port

LISTEN = "listen: tcp://127.0.0.1:0\n"
METRICS = ("--metrics", "127.0.0.1:0")


@pytest.fixture
def setting(write):
    """Writes the file of a gateway, of lines `(place, units)` or `(place, units, more keys)`; returns its path."""

    def setting(*lines, head=LISTEN + "timeout: 2s\n"):
        rows = (f'- {{line: "{place}", units: "{units}"{"".join(more)}}}\n' for place, units, *more in lines)
        return write("gateway.yaml", head + "lines:\n" + "".join(rows))

    return setting


@pytest.fixture
def gateway(mbm):
    def gateway(path, *words, **options):
        """Begins a gateway; it has a port and can be asked by a new client."""
        service = mbm.begin("gateway", path, *words, **options)
        service.port = service.await_output("^ready").split()[1]
        return service

    return gateway


def device(value):
    return TcpDevice(lambda pdu: number(value))


NOWHERE = ("rtu:/dev/no-such-line", "1")


@pytest.mark.parametrize("text, sentence", [
    ("", "gateway.yaml: the file is empty"),
    ("lines: [{line: rtu:/dev/null, units: 1}]\n", "gateway.yaml:1: the file has no key listen"),
    ("listen: tcp://:0\n", "gateway.yaml:1: the file has no key lines"),
    ("listen: udp://:0\nlines: []\n", ':1: listen: "udp://:0": a gateway listens at tcp://'),
    ("listen: tcp://:0\nlines: []\n", "gateway.yaml:2: lines is empty"),
    ("listen: tcp://:0\nlisten: tcp://:1\n", "gateway.yaml:2: listen is there twice, first in line 1"),
    ("listen: tcp://:0\nport: 1\n", 'gateway.yaml:2: key: "port" is not one of listen, connections'),
    ("listen: tcp://:0\ntimeout: 500\nlines: [{line: rtu:/dev/null, units: 1}]\n", ':2: timeout: "500" is not a time'),
    ("listen: tcp://:0\nlines:\n- units: 1\n", ":3: the line has no key line"),
    ("listen: tcp://:0\nlines:\n- line: rtu:/dev/null\n", ":3: the line has no key units"),
    ("listen: tcp://:0\nlines:\n- rtu:/dev/null\n", ':3: the line must be a mapping of keys, such as "line:"'),
    ("listen: tcp://:0\nlines:\n- line: /dev/null\n  units: 1\n", ':3: line: "/dev/null" is not a line'),
    ("listen: tcp://:0\nlines:\n- line: rtu:/dev/null\n  units: 1-\n", ':4: units: "1-": units are FIRST-LAST'),
    ("listen: tcp://:0\nlines:\n- line: rtu:/dev/null\n  units: 1=0\n",
     'gateway.yaml:4: units: "1=0": 0 on a line is a broadcast, which no device answers'),
    ("listen: tcp://:0\nlines:\n- line: rtu:/dev/null\n  units: 0=0,5-9=0\n", 'gateway.yaml:4: units: "0=0,5-9=0": 0 on a line is a broadcast'),
    ("listen: tcp://:0\nlines:\n- {line: rtu:/a, units: 1-9}\n- {line: rtu:/b, units: 9}\n", ':4: units: "9": a range before has one of these units'),
    ("listen: tcp://:0\nlines:\n- {line: rtu:/a, units: 1}\n- {line: rtu:/a, units: 2}\n", ":4: line: the line rtu:/a is there twice"),
    ("listen: tcp://:0\nlines:\n- {line: rtu:/a, units: 1, in_flight: 17}\n", "from 1 to 16 is allowed"),
    ("listen: tcp://:0\nrequests: 010\nlines: [{line: rtu:/dev/null, units: 1}]\n", ':2: requests: "010" begins with 0: write a decimal number'),
    ("listen: tcp://:0\nlines: [\n", "gateway.yaml:3: this is not YAML"),
    ("listen: tcp://:0\nlines: [{line: rtu:/a, units: 1}]\n--- more\n", ":3: a second document begins"),
])
def test_a_wrong_file_is_refused_with_its_line(mbm, write, text, sentence):
    mbm.fails(WRONG, sentence, "gateway", write("gateway.yaml", text))


def test_check_only_looks_at_the_file(mbm, setting, folder):
    assert mbm("gateway", "--check", setting(NOWHERE)) == (0, "", "")
    mbm.fails(SYSTEM, "No such file", "gateway", f"{folder}/none.yaml")


# --- SIGHUP

def test_a_new_file_is_in_force_and_what_stays_the_same_notices_nothing(gateway, setting, folder):
    one, two, three = device(1), device(2), device(3)
    late, notified = threading.Event(), Notified(folder)
    slow = TcpDevice(lambda pdu: late.wait(PATIENCE) and None)
    service = gateway(setting((one.line, "1"), (slow.line, "2")), *METRICS, env=notified.env)
    notified.expect("READY=1")
    client = Client(service.port)
    assert client.ask(1) == number(1)
    connections = len(one.peers)
    # A request is with the device of a line that the new file does not have.
    client.send(2)
    assert wait(lambda: slow.asked)
    setting((two.line, "2,5=1"), (one.line, "1,4=1"), (three.line, "3"))
    service.reload(r"^info: .*gateway\.yaml is in force\. Lines kept: 1, removed: 1, added: 2\.$")
    notified.expect("RELOADING=1\nMONOTONIC_USEC=", "READY=1")
    assert client.take() == NO_PATH
    late.set()
    # The client stays connected, and the new map of units is in force.
    assert [client.ask(unit) for unit in (1, 2, 3, 4, 5)] == [number(value) for value in (1, 2, 3, 1, 2)]
    # The line that stays keeps its connection and its counters; a removed one has no samples.
    assert len(one.peers) == connections
    found = metrics(service)
    assert found["mbm_gateway_requests_total", one.line] == 3
    assert ("mbm_gateway_requests_total", slow.line) not in found


def test_a_file_that_is_wrong_or_needs_a_restart_changes_nothing(gateway, setting, folder):
    one, notified = device(1), Notified(folder)
    path = setting((one.line, "1"))
    service = gateway(path, *METRICS, env=notified.env)
    notified.expect("READY=1")
    client = Client(service.port)
    setting((one.line, "1"), ("rtu:/dev/null", "300"))
    service.reload(r'^error: .*gateway\.yaml:5: units: "300": units are .*\. The file before stays in force\.$')
    notified.expect("RELOADING=1", "READY=1")
    setting((one.line, "1"), head="listen: tcp://127.0.0.1:1502\n")
    service.reload(r"^error: .*: listen has changed, which needs a restart\. The file before stays in force\.$")
    setting((one.line, "1"), head=LISTEN + "connections: 3\n")
    service.reload(r"^error: .*: connections has changed, which needs a restart")
    setting(*((f"rtu:/dev/none{i}", i + 10) for i in range(12)))
    service.reload(r"^error: .*: it has more lines than there are places, which needs a restart")
    os.unlink(path)
    service.reload(r"^error: .*gateway\.yaml: No such file or directory\. The file before stays in force\.$")
    assert client.ask(1) == number(1)
    found = metrics(service)
    assert (found["mbm_gateway_reloads_total", None], found["mbm_gateway_reload_failures_total", None]) == (0, 5)


def test_every_line_becomes_another_while_a_client_sends_and_does_not_wait(gateway, setting):
    one, two, three = device(1), device(2), device(3)
    service = gateway(setting((two.line, "2,5=1"), (one.line, "1,4=1"), (three.line, "3")), *METRICS)
    client = Client(service.port)
    for turn in range(20):
        for unit in (1, 2, 3, 4, 5):
            client.send(unit)
        first, second = (one, two) if turn % 2 else (two, three)
        setting((first.line, "1-2=1"), (second.line, "3-5=1"))
        service.reload("is in force")
        assert {client.take() for _ in range(5)} <= {number(1), number(2), number(3), NO_PATH}
    assert [client.ask(1), client.ask(3)] == [number(1), number(2)]
    assert metrics(service)["mbm_gateway_reloads_total", None] == 20


def test_sighup_without_a_file_is_answered_in_the_log(mbm):
    service = mbm.begin("gateway", "tcp://127.0.0.1:0", *NOWHERE)
    service.await_output()
    service.reload("^warning: SIGHUP reads the file of the gateway, and this one was begun without a file")


def test_sighup_ends_a_gateway_whose_terminal_is_gone(mbm, setting):
    path = setting(NOWHERE)
    process, master = pty.fork()
    if process == 0:
        os.execv(mbm.path, [mbm.path, "gateway", path])
    said = b""
    while b"ready" not in said:
        said += os.read(master, 100)
    os.close(master)
    assert wait(lambda: os.waitpid(process, os.WNOHANG)[0] == process)


# --- statistics

def test_statistics_are_written_after_sigusr1_and_at_the_end(gateway, setting, folder):
    one, path = device(1), f"{folder}/stats.json"
    service = gateway(setting((one.line, "1")), "--stats", path)
    client = Client(service.port)
    client.ask(1)
    service.tell(signal.SIGUSR1)
    assert wait(lambda: os.path.exists(path))
    found = json.load(open(path))
    line = found["lines"][0]
    assert (found["command"], found["clients"], found["connections"], line["line"], line["requests"], line["replies"], line["line_up"]) == (
        "gateway", 1, 1, one.line, 1, 1, 1)
    client.ask(1)
    service.end()
    assert json.load(open(path))["lines"][0]["requests"] == 2


def test_statistics_are_written_again_and_again(gateway, setting):
    service = gateway(setting(NOWHERE), "--stats", "-", "--stats-every", "100ms")
    assert wait(lambda: len(service.output) >= 4)
    service.end()
    assert {json.loads(text)["command"] for text in service.output[1:]} == {"gateway"}


def test_a_full_disk_for_statistics_is_reported_once(gateway, setting):
    service = gateway(setting((device(1).line, "1")), "--stats", "/dev/full", "--stats-every", "100ms")
    service.await_line(r"^error: /dev/full: No space left on device\. The statistics are not written\.$")
    time.sleep(0.5)
    assert sum("/dev/full" in text for text in service.log) == 1
    assert Client(service.port).ask(1) == number(1)


def test_a_full_disk_for_frames_stops_no_request(gateway, setting, folder):
    service = gateway(setting((device(1).line, "1")), "--pcap", f"{folder}/frames.pcapng", limit=2000)
    client = Client(service.port)
    assert [client.ask(1) for _ in range(100)] == [number(1)] * 100
    service.await_line(r"^error: .*frames\.pcapng: File too large\. No more frames are written to it\.$")


@pytest.mark.parametrize("request_line, status", [
    (b"GET /metrics HTTP/1.0\r\n\r\n", "200 OK"), (b"GET /metrics?a=b HTTP/1.0\n\n", "200 OK"),
    (b"GET / HTTP/1.0\r\n\r\n", "404 Not Found"), (b"GET /metricsx HTTP/1.0\r\n\r\n", "404 Not Found"),
    (b"POST /metrics HTTP/1.0\r\n\r\n", "405 Method Not Allowed"), (b"x" * 8191, "400 Bad Request"), (b"\0\0", "400 Bad Request")], ids=repr)
def test_the_port_of_metrics_speaks_http(gateway, setting, request_line, status):
    service = gateway(setting(NOWHERE), *METRICS)
    head, _ = http(metrics_port(service), request_line)
    assert head.startswith(f"HTTP/1.0 {status}\r\n")


def test_scrapers_that_are_slow_wrong_or_many_do_not_keep_a_client_from_its_replies(gateway, setting):
    one = device(1)
    service = gateway(setting((one.line, "1")), *METRICS)
    port = metrics_port(service)
    client = Client(service.port)
    client.ask(1)
    found = metrics(service)
    assert (found["mbm_gateway_requests_total", one.line], found["mbm_gateway_clients", None], found["mbm_gateway_line_up", one.line]) == (1, 1, 1)
    idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(12)]
    for peer in idle:
        peer.sendall(b"GET /met")
    unread = socket.create_connection(("127.0.0.1", port))
    unread.sendall(b"GET /metrics HTTP/1.0\r\n\r\n")
    stop = threading.Event()

    def flood():
        while not stop.is_set():
            try:
                with socket.create_connection(("127.0.0.1", port), timeout=1) as peer:
                    peer.sendall(b"GET /metrics HTTP/1.0\r\n\r\n")
            except OSError:
                pass

    floods = [threading.Thread(target=flood) for _ in range(4)]
    for thread in floods:
        thread.start()
    assert [client.ask(1) for _ in range(200)] == [number(1)] * 200
    stop.set()
    for thread in floods:
        thread.join()
    # A scraper is served after them, and slow ones are disconnected.
    assert metrics(service)["mbm_gateway_requests_total", one.line] == 201

    def has_ended(peer):
        try:
            return peer.recv(1) == b""
        except ConnectionResetError:
            return True

    assert all(map(has_ended, idle))
    unread.close()


def test_a_client_without_a_place_is_disconnected_and_counted(gateway, setting):
    service = gateway(setting(NOWHERE, head=LISTEN + "connections: 1\n"), *METRICS)
    first = Client(service.port)
    first.ask(1)
    assert Client(service.port).socket.recv(1) == b""
    assert first.ask(1) == NO_PATH
    assert metrics(service)["mbm_gateway_refused_connections_total", None] == 1


# --- the log

def test_the_journal_gets_levels_and_another_stream_none(mbm, setting, folder):
    path = setting(NOWHERE)
    read, write = os.pipe()
    known = os.fstat(write)
    process = subprocess.Popen([mbm.path, "gateway", path], stderr=write, stdout=subprocess.PIPE, text=True,
                               env={**os.environ, "JOURNAL_STREAM": f"{known.st_dev}:{known.st_ino}"})
    os.close(write)
    with os.fdopen(read) as stream:
        assert stream.readline() == "<4>rtu:/dev/no-such-line: No such file or directory. The line is opened again each second.\n"
    process.terminate()
    process.communicate(timeout=PATIENCE)
    assert mbm("gateway", f"{folder}/none.yaml", env={**os.environ, "JOURNAL_STREAM": "1:1"}).error.startswith("mbm gateway: ")


def test_the_log_level_leaves_lines_out(gateway, setting):
    path = setting(NOWHERE)
    service = gateway(path, "--log-level", "error", "--quiet")
    assert Client(service.port).ask(1) == NO_PATH
    service.end()
    assert service.log == []
    service = gateway(path, "--log-level", "debug")
    Client(service.port).socket.close()
    service.await_line("^debug: client 0 is connected")
    service.await_line("^debug: client 0 is disconnected")


# --- each row of the failure drill of docs/gateway.md

@pytest.fixture
def drill(gateway, setting, serial):
    """A gateway between a client, a device on a serial line, unit 7, and one over TCP, unit 1."""
    other = device(1)
    service = gateway(setting((serial.line, "7"), (other.line, "1"), head=LISTEN + "timeout: 300ms\nquiet_time: 20ms\n"))
    service.other, service.client = other, Client(service.port)
    assert wait(lambda: service.client.ask(7) == number(7))
    return service


@pytest.mark.parametrize("mood, pattern", [
    ("silent", r"^warning: rtu:.*: the last 5 requests got no reply\. Check the units' numbers, baud rate, parity and wiring\.$"),
    ("damaged", r"^warning: rtu:.*: the last 5 requests got no right reply, [1-5] of them damaged ones\. Check baud rate, parity, wiring"),
])
def test_a_device_that_does_not_answer_is_reported_once_and_served_again(drill, serial, mood, pattern):
    client, since, serial.mood = drill.client, len(drill.log), mood
    assert [client.ask(7) for _ in range(6)] == [NO_ANSWER] * 6
    drill.await_line(pattern, since=since)
    assert client.ask(1) == number(1)
    serial.mood = "right"
    assert wait(lambda: client.ask(7) == number(7))
    drill.await_line(r"^info: rtu:.*: a device answers again\.$", since=since)
    assert len(drill.log) == since + 2


def test_a_cable_that_is_pulled_and_plugged_in_again_is_reported(drill, serial):
    client, since = drill.client, len(drill.log)
    serial.go()
    drill.await_line(r"^warning: rtu:.*\. The line is opened again each second\.$", since=since)
    assert client.ask(7) == NO_PATH
    drill.await_line(r"^warning: rtu:.*: No such file or directory\. The line", since=since)
    assert client.ask(1) == number(1)
    serial.come()
    assert wait(lambda: client.ask(7) == number(7))
    drill.await_line(r"^info: rtu:.*: the line is open again\.$", since=since)


def test_a_device_over_tcp_that_goes_and_comes_back_is_reported(drill):
    client, since = drill.client, len(drill.log)
    drill.other.go()
    assert wait(lambda: client.ask(1) == NO_PATH)
    drill.await_line(r"^warning: tcp://.*: .*\. The line is opened again each second\.$", since=since)
    drill.other.come()
    assert wait(lambda: client.ask(1) == number(1))
    drill.await_line(r"^info: tcp://.*: the line is open again\.$", since=since)


@pytest.mark.parametrize("patience", [0.2, 0.5, 1.0])
def test_a_client_that_closes_its_connection_and_asks_again_is_answered_after_one_lost_reply(gateway, setting, serial, patience):
    """It has less patience than the gateway, in which all is as by default."""
    service = gateway(setting((serial.line, "7"), head=LISTEN))

    def asks(patience):
        client = Client(service.port, patience)
        try:
            return client.ask(7) == number(7)
        except (TimeoutError, ConnectionResetError):
            return False
        finally:
            client.socket.close()

    assert wait(lambda: asks(PATIENCE))
    serial.mood = "loses one"
    assert not asks(patience)
    assert wait(lambda: asks(patience)) and serial.mood == "right"


def playing(mbm, unit, fault):
    """mbm serve as a device whose registers are all 0."""
    return mbm.begin("serve", "tcp://127.0.0.1:0", "--echo", "--unit", unit, "--fault", fault)


def test_devices_that_close_connections_get_each_request_once(mbm, gateway, setting):
    idle, closing = playing(mbm, 1, "close-idle=200ms"), playing(mbm, 2, "close-after=1")
    service = gateway(setting((idle.last_word(), "1"), (closing.last_word(), "2"), head=LISTEN + "timeout: 300ms\n"))
    client = Client(service.port)
    for _ in range(8):
        assert client.ask(1) == number(0)
        time.sleep(0.4)
    assert [client.ask(2) for _ in range(8) if not time.sleep(0.1)] == [number(0)] * 8
    assert service.log == []
    assert "requests: 8," in idle.end().error


def test_a_connection_on_which_a_device_is_silent_is_made_anew(mbm, gateway, setting):
    silent, kept = (playing(mbm, unit, "deaf-after=3").last_word() for unit in (3, 4))
    service = gateway(setting((silent, "3"), (kept, "4", ", replace_after: 0"), head=LISTEN + "timeout: 300ms\n"))
    client = Client(service.port)
    # It costs two requests, and is reported once.
    assert [client.ask(3) for _ in range(20)] == ([number(0)] * 3 + [NO_ANSWER] * 2) * 4
    service.await_line(r"^warning: tcp://.*: no byte came after 2 requests in a row\. The connection is made anew, now and each time "
                       r"that this happens\.$")
    assert len(service.log) == 1
    assert [client.ask(4) for _ in range(8)] == [number(0)] * 3 + [NO_ANSWER] * 5


def test_the_example_that_is_installed_maps_units(gateway, write):
    with open(f"{ROOT}/examples/services/gateway.yaml") as file:
        path = write("gateway.yaml", file.read().replace("tcp://:502 ", "tcp://127.0.0.1:0 "))
    assert Client(gateway(path).port).ask(255) == NO_PATH
