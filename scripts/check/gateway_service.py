"""Checks `mbm gateway` as a service: its file, SIGHUP, statistics, log lines, and each row of the failure drill of
docs/gateway.md."""

import json
import os
import pty
import select
import signal
import socket
import subprocess
import tempfile
import threading
import time
import tty

from peers import ROOT, TcpDevice, crc
from services import PATIENCE, Notified, Service, expect, http, metrics, wait

READY = r"ready (\d+)"


def frame(transaction, unit, pdu):
    return transaction.to_bytes(2, "big") + b"\0\0" + (len(pdu) + 1).to_bytes(2, "big") + bytes([unit]) + pdu


READ = bytes([3, 0, 0, 0, 1])


class Client:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self.number = 0

    def send(self, unit, pdu=READ):
        self.number += 1
        self.socket.sendall(frame(self.number, unit, pdu))

    def take(self):
        """The PDU of the next response."""
        head = self.read(7)
        return self.read(int.from_bytes(head[4:6], "big") - 1)

    def read(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            assert part, "the gateway closed the connection"
            data += part
        return data

    def ask(self, unit, pdu=READ):
        self.send(unit, pdu)
        return self.take()


def number(value):
    return bytes([3, 2]) + value.to_bytes(2, "big")


def device(value):
    return TcpDevice(lambda pdu: number(value))


NO_PATH, NO_REPLY = b"\x83\x0a", b"\x83\x0b"


class Files:
    """The file of a gateway, in a folder of its own."""

    def __init__(self, folder):
        self.folder, self.path = folder, os.path.join(folder, "gateway.yaml")

    def write(self, *lines, head="listen: tcp://127.0.0.1:0\ntimeout: 2s\n"):
        with open(self.path, "w") as file:
            file.write(head + "lines:\n" + "".join(f"- {line}\n" for line in lines))

    def line(self, place, units, more=""):
        return f'{{line: "{place}", units: "{units}"{more}}}'


WRONG = [
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
    ("listen: tcp://:0\nlines:\n- line: rtu:/dev/null\n  units: 0=0,5-9=0\n",
     'gateway.yaml:4: units: "0=0,5-9=0": 0 on a line is a broadcast'),
    ("listen: tcp://:0\nlines:\n- {line: rtu:/a, units: 1-9}\n- {line: rtu:/b, units: 9}\n",
     ':4: units: "9": a range before has one of these units'),
    ("listen: tcp://:0\nlines:\n- {line: rtu:/a, units: 1}\n- {line: rtu:/a, units: 2}\n",
     ":4: line: the line rtu:/a is there twice"),
    ("listen: tcp://:0\nlines:\n- {line: rtu:/a, units: 1, in_flight: 17}\n", "from 1 to 16 is allowed"),
    ("listen: tcp://:0\nrequests: 010\nlines: [{line: rtu:/dev/null, units: 1}]\n",
     ':2: requests: "010" begins with 0: write a decimal number'),
    ("listen: tcp://:0\nlines: [\n", "gateway.yaml:3: this is not YAML"),
    ("listen: tcp://:0\nlines: [{line: rtu:/a, units: 1}]\n--- more\n", ":3: a second document begins"),
]


def check_wrong_files(mbm, files):
    for text, reason in WRONG:
        with open(files.path, "w") as file:
            file.write(text)
        found = subprocess.run([mbm, "gateway", files.path], capture_output=True, text=True, timeout=PATIENCE)
        expect(f"{text!r}: {reason}", found.returncode == 2 and reason in found.stderr, found.stderr)
    found = subprocess.run([mbm, "gateway", f"{files.folder}/none.yaml"], capture_output=True, text=True)
    expect("a file that is not there", found.returncode == 1 and "No such file" in found.stderr, found.stderr)
    files.write(files.line("rtu:/dev/no-such-line", "1"))
    found = subprocess.run([mbm, "gateway", "--check", files.path], capture_output=True, text=True, timeout=PATIENCE)
    expect("--check ends without a word", (found.returncode, found.stdout, found.stderr) == (0, "", ""), found)
    for option, reason in (
        (["--metrics", "0.0.0.0:9100"], '"0.0.0.0:9100" is not an address of this machine'),
        (["--metrics", "192.168.0.1:9100"], "is not an address of this machine"),
        (["--metrics", "127.0.0.1"], "is not an address of this machine and a port"),
        (["--metrics", "127.0.0.1:x"], "is not an address of this machine and a port"),
        (["--stats-every", "10s"], "--stats-every needs --stats"),
        (["--log-level", "loud"], "is not one of error, warning, info and debug"),
        (["--log-level", "info", "rtu:/dev/null"], "one word too many"),
    ):
        found = subprocess.run([mbm, "gateway", files.path, *option], capture_output=True, text=True, timeout=PATIENCE)
        expect(f"{option}: {reason}", found.returncode == 2 and reason in found.stderr, found.stderr)


def check_reload(mbm, files):
    """The new file is in force as a whole or not at all; clients and lines that stay the same notice nothing."""
    one, two, three = device(1), device(2), device(3)
    late = threading.Event()
    slow = TcpDevice(lambda pdu: late.wait(PATIENCE) and None)
    notified = Notified(files.folder)
    files.write(files.line(one.line, "1"), files.line(slow.line, "2"))
    gateway = Service(mbm, "gateway", files.path, "--metrics", "127.0.0.1:0", ready=READY,
                      env={"NOTIFY_SOCKET": notified.path})
    notified.expect("READY=1")
    port = int(gateway.await_line(r"metrics are at port (\d+)").split()[-2].rstrip(","))
    client = Client(gateway.port)
    expect("the first line answers", client.ask(1) == number(1))
    connections = len(one.peers)

    # A request is with the device of a line that the new file does not have.
    client.send(2)
    wait(lambda: slow.asked)
    files.write(files.line(two.line, "2,5=1"), files.line(one.line, "1,4=1"), files.line(three.line, "3"))
    gateway.reload(r"^info: .*gateway\.yaml is in force\. Lines kept: 1, removed: 1, added: 2\.$")
    notified.expect("RELOADING=1\nMONOTONIC_USEC=")
    notified.expect("READY=1")
    expect("a request on a removed line gets 0A", client.take() == NO_PATH)
    late.set()
    answers = [client.ask(unit) for unit in (1, 2, 3, 4, 5)]
    expect("the client stays connected, and the new map of units is in force",
           answers == [number(value) for value in (1, 2, 3, 1, 2)], answers)
    expect("the line that stays keeps its connection", len(one.peers) == connections, len(one.peers))
    found = metrics(port)
    expect("and its counters", found["mbm_gateway_requests_total", one.line] == 3, found)
    expect("a removed line has no samples", ("mbm_gateway_requests_total", slow.line) not in found, found)

    # Files that are wrong, or that need a restart, change nothing.
    with open(files.path, "a") as file:
        file.write('- {line: "rtu:/dev/null", units: 300}\n')
    gateway.reload(r'^error: .*gateway\.yaml:7: units: "300": units are .*\. The file before stays in force\.$')
    notified.expect("RELOADING=1")
    notified.expect("READY=1")
    files.write(files.line(one.line, "1"), head="listen: tcp://127.0.0.1:1502\n")
    gateway.reload(r"^error: .*: listen has changed, which needs a restart\. The file before stays in force\.$")
    files.write(files.line(one.line, "1"), head="listen: tcp://127.0.0.1:0\nconnections: 3\n")
    gateway.reload(r"^error: .*: connections has changed, which needs a restart")
    os.unlink(files.path)
    gateway.reload(r"^error: .*gateway\.yaml: No such file or directory\. The file before stays in force\.$")
    expect("after wrong files the one before is in force",
           [client.ask(unit) for unit in (1, 2, 3)] == [number(value) for value in (1, 2, 3)])

    # Every line is another one, at the same places, while a client sends and does not wait.
    for turn in range(20):
        for unit in (1, 2, 3, 4, 5):
            client.send(unit)
        order = (one, two) if turn % 2 else (two, three)
        files.write(files.line(order[0].line, "1-2=1"), files.line(order[1].line, "3-5=1"))
        gateway.reload("is in force")
        answers = {client.take() for _ in range(5)}
        expect("each request gets a number or 0A", answers <= {number(1), number(2), number(3), NO_PATH}, answers)
    expect("... and then the last map", [client.ask(1), client.ask(3)] == [number(1), number(2)])

    # More lines than there are places.
    lines = [files.line(f"rtu:/dev/none{i}", f"{i + 10}") for i in range(12)]
    files.write(*lines)
    gateway.reload(r"^error: .*: it has more lines than there are places, which needs a restart")
    found = metrics(port)
    expect("reloads are counted", (found["mbm_gateway_reloads_total", None],
                                   found["mbm_gateway_reload_failures_total", None]) == (21, 5), found)
    gateway.end()
    for one in (one, two, three, slow):
        one.go()


def check_stats(mbm, files):
    """JSON at the end, after SIGUSR1, and again and again; a full disk."""
    one = device(1)
    files.write(files.line(one.line, "1", ", timeout: 200ms"))
    path = os.path.join(files.folder, "stats.json")
    gateway = Service(mbm, "gateway", files.path, "--stats", path, ready=READY)
    client = Client(gateway.port)
    client.ask(1)
    gateway.signal(signal.SIGUSR1)
    wait(lambda: os.path.exists(path))
    found = json.load(open(path))
    line = found["lines"][0]
    expect("the statistics are JSON", (found["command"], found["clients"], found["connections"], line["line"],
                                       line["requests"], line["replies"], line["line_up"])
           == ("gateway", 1, 1, one.line, 1, 1, 1), found)
    client.ask(1)
    gateway.end()
    expect("and are written at the end", json.load(open(path))["lines"][0]["requests"] == 2, open(path).read())

    gateway = Service(mbm, "gateway", files.path, "--stats", "-", "--stats-every", "100ms", ready=READY)
    wait(lambda: len(gateway.output) >= 4)
    gateway.end()
    expect("each 100 ms a line", all(json.loads(text)["command"] == "gateway" for text in gateway.output[1:]))

    gateway = Service(mbm, "gateway", files.path, "--stats", "/dev/full", "--stats-every", "100ms", ready=READY)
    gateway.expect_line("a full disk", r"^error: /dev/full: No space left on device\. The statistics are not written\.$")
    time.sleep(0.5)
    expect("is reported once", sum("/dev/full" in text for text in gateway.log) == 1, gateway.log)
    expect("and the gateway goes on", Client(gateway.port).ask(1) == number(1))
    gateway.end()

    pcap = os.path.join(files.folder, "frames.pcapng")
    gateway = Service(mbm, "gateway", files.path, "--pcap", pcap, ready=READY, limit=2000)
    client = Client(gateway.port)
    for _ in range(100):
        expect("a full disk stops no request", client.ask(1) == number(1))
    gateway.expect_line("the disk of --pcap is full",
                        r"^error: .*frames\.pcapng: File too large\. No more frames are written to it\.$")
    gateway.end()
    one.go()


def check_metrics(mbm, files):
    """Scrapers that are slow, wrong or many do not delay a client of Modbus."""
    one = device(1)
    files.write(files.line(one.line, "1"))
    gateway = Service(mbm, "gateway", files.path, "--metrics", "127.0.0.1:0", ready=READY)
    port = int(gateway.await_line(r"metrics are at port (\d+)").split()[-2].rstrip(","))
    client = Client(gateway.port)
    client.ask(1)
    found = metrics(port)
    expect("the metrics", (found["mbm_gateway_requests_total", one.line], found["mbm_gateway_clients", None],
                           found["mbm_gateway_line_up", one.line]) == (1, 1, 1), found)
    for request, status in (
        (b"GET /metrics HTTP/1.0\r\n\r\n", "200 OK"), (b"GET /metrics?a=b HTTP/1.0\n\n", "200 OK"),
        (b"GET / HTTP/1.0\r\n\r\n", "404 Not Found"), (b"GET /metricsx HTTP/1.0\r\n\r\n", "404 Not Found"),
        (b"POST /metrics HTTP/1.0\r\n\r\n", "405 Method Not Allowed"),
        (b"x" * 2047, "400 Bad Request"), (b"\0\0", "400 Bad Request"),
    ):
        head, _ = http(port, request)
        expect(f"{request[:40]}: {status}", head.startswith(f"HTTP/1.0 {status}\r\n"), head)

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
    for one_flood in floods:
        one_flood.start()
    times = []
    for _ in range(200):
        begin = time.monotonic()
        expect("a client is served under a flood of scrapes", client.ask(1) == number(1))
        times.append(time.monotonic() - begin)
    stop.set()
    for one_flood in floods:
        one_flood.join()
    times.sort()
    print(f"  a request under a flood of scrapes: median {times[100] * 1000:.1f} ms, longest {times[-1] * 1000:.1f} ms")
    expect("... without a long delay", times[-1] < 1, times[-5:])
    found = metrics(port)
    expect("a scraper is served after them", found["mbm_gateway_requests_total", one.line] == 201, found)

    def has_ended(peer):
        try:
            return peer.recv(1) == b""
        except ConnectionResetError:
            return True

    expect("slow scrapers are disconnected", all(has_ended(peer) for peer in idle))
    gateway.end()
    one.go()


def check_log(mbm, files):
    """The prefixes of the journal, and the level."""
    files.write(files.line("rtu:/dev/no-such-line", "1"))
    read, write = os.pipe()
    known = os.fstat(write)
    process = subprocess.Popen([mbm, "gateway", files.path], stderr=write, stdout=subprocess.PIPE, text=True,
                               env={**os.environ, "JOURNAL_STREAM": f"{known.st_dev}:{known.st_ino}"})
    os.close(write)
    with os.fdopen(read) as stream:
        line = stream.readline()
    expect("the journal gets levels", line == "<4>rtu:/dev/no-such-line: No such file or directory. "
           "The line is opened again each second.\n", line)
    process.terminate()
    process.communicate(timeout=PATIENCE)
    process = subprocess.run([mbm, "gateway", f"{files.folder}/none.yaml"], capture_output=True, text=True,
                             env={**os.environ, "JOURNAL_STREAM": "1:1"})
    expect("another stream than stderr has none", process.stderr.startswith("mbm gateway: "), process.stderr)
    gateway = Service(mbm, "gateway", files.path, "--log-level", "error", "--quiet", ready=READY)
    expect("the line gets 0A", Client(gateway.port).ask(1) == NO_PATH)
    gateway.end()
    expect("--log-level error leaves warnings out", gateway.log == [], gateway.log)
    gateway = Service(mbm, "gateway", "tcp://127.0.0.1:0", "rtu:/dev/no-such-line", "1", ready=READY)
    gateway.reload("^warning: SIGHUP reads the file of the gateway, and this one was begun without a file")
    gateway.end()
    gateway = Service(mbm, "gateway", files.path, "--log-level", "debug", ready=READY)
    Client(gateway.port).socket.close()
    gateway.expect_line("debug", "^debug: client 0 is connected")
    gateway.expect_line("debug", "^debug: client 0 is disconnected")
    gateway.end()


def check_terminal(mbm, files):
    """SIGHUP ends a program whose terminal is gone."""
    files.write(files.line("rtu:/dev/no-such-line", "1"))
    process, master = pty.fork()
    if process == 0:
        os.execv(mbm, [mbm, "gateway", files.path])
    said = b""
    while b"ready" not in said:
        said += os.read(master, 100)
    os.close(master)
    expect("the gateway ends with its terminal", wait(lambda: os.waitpid(process, os.WNOHANG)[0] == process))


class Serial:
    """A device in RTU on a pseudo terminal, whose registers are all 7. It answers, is silent, loses one reply, answers with damage, or is
    pulled out."""

    def __init__(self, folder, name="tty"):
        self.path, self.mood = os.path.join(folder, name), "right"
        self.plug_in()

    def plug_in(self):
        master, terminal = os.openpty()
        tty.setraw(terminal)
        if os.path.islink(self.path):
            os.unlink(self.path)
        os.symlink(os.ttyname(terminal), self.path)
        os.close(terminal)
        wake, self.wake = os.pipe()
        self.thread = threading.Thread(target=self.serve, args=(master, wake), daemon=True)
        self.thread.start()

    def pull_out(self):
        os.unlink(self.path)
        os.close(self.wake)
        self.thread.join()

    def serve(self, master, wake):
        request = b""
        while wake not in (ready := select.select([master, wake], [], [])[0]):
            try:
                request += os.read(ready[0], 8 - len(request))
            except OSError:
                # No program has the terminal open.
                time.sleep(0.01)
            if len(request) < 8:
                continue
            words = request[5]
            reply = request[:1] + bytes([3, 2 * words]) + bytes([0, 7]) * words
            request, checksum = b"", crc(reply)
            if self.mood == "damaged":
                checksum = bytes([checksum[0] ^ 1, checksum[1]])
            if self.mood not in ("silent", "loses one"):
                os.write(master, reply + checksum)
            if self.mood == "loses one":
                self.mood = "right"
        os.close(wake)
        os.close(master)


def check_drill(mbm, files):
    """Each row of the failure drill of docs/gateway.md that is not checked above."""
    serial, other = Serial(files.folder), device(1)
    files.write(files.line(f"rtu:{serial.path}?baud=115200", "7"), files.line(other.line, "1"),
                head="listen: tcp://127.0.0.1:0\ntimeout: 300ms\nquiet_time: 20ms\n")
    gateway = Service(mbm, "gateway", files.path, ready=READY)
    client = Client(gateway.port)
    expect("the device answers", wait(lambda: client.ask(7) == number(7)))

    for mood, pattern in (
        ("silent", r"^warning: rtu:.*: the last 5 requests got no reply\. Check the units' numbers, baud rate, parity and wiring\.$"),
        ("damaged", r"^warning: rtu:.*: the last 5 requests got no right reply, [1-5] of them damaged ones\. Check baud rate, parity, wiring"),
    ):
        since, serial.mood = len(gateway.log), mood
        expect(f"a {mood} device gets 0B", [client.ask(7) for _ in range(6)] == [NO_REPLY] * 6)
        gateway.expect_line(f"a {mood} device", pattern, since)
        expect("the other line goes on", client.ask(1) == number(1))
        serial.mood = "right"
        expect("and the device is served again", wait(lambda: client.ask(7) == number(7)))
        gateway.expect_line("the device", r"^info: rtu:.*: a device answers again\.$", since)
        expect("each is reported once", len(gateway.log) == since + 2, gateway.log)

    since = len(gateway.log)
    serial.pull_out()
    gateway.expect_line("the cable is pulled", r"^warning: rtu:.*\. The line is opened again each second\.$", since)
    expect("its units get 0A", client.ask(7) == NO_PATH)
    gateway.expect_line("the adapter is gone", r"^warning: rtu:.*: No such file or directory\. The line", since)
    expect("the other line goes on", client.ask(1) == number(1))
    serial.plug_in()
    expect("the adapter is back", wait(lambda: client.ask(7) == number(7)))
    gateway.expect_line("the adapter is back", r"^info: rtu:.*: the line is open again\.$", since)

    since = len(gateway.log)
    other.go()
    expect("a device over TCP that is gone gets 0A", wait(lambda: client.ask(1) == NO_PATH))
    gateway.expect_line("the device", r"^warning: tcp://.*: .*\. The line is opened again each second\.$", since)
    other.come()
    expect("it is back", wait(lambda: client.ask(1) == number(1)))
    gateway.expect_line("the device", r"^info: tcp://.*: the line is open again\.$", since)
    gateway.end()
    other.go()


def check_impatient_clients(mbm, files):
    """A device loses one reply, once. Its client has less patience than the gateway: it closes its connection, connects
    again and asks again."""
    serials = []
    lines = []
    for unit in (1, 2, 3):
        folder = os.path.join(files.folder, str(unit))
        os.mkdir(folder)
        serials.append(Serial(folder))
        lines.append(files.line(f"rtu:{serials[-1].path}?baud=115200", unit))
    # All else as it is by default.
    files.write(*lines, head="listen: tcp://127.0.0.1:0\n")
    gateway = Service(mbm, "gateway", files.path, ready=READY)

    def asks(unit, patience):
        client = Client(gateway.port)
        client.socket.settimeout(patience)
        try:
            return client.ask(unit) == number(7)
        except (TimeoutError, AssertionError):
            return False
        finally:
            client.socket.close()

    def lives(unit, patience, found):
        serial = serials[unit - 1]
        if not wait(lambda: asks(unit, PATIENCE)):
            return
        serial.mood = "loses one"
        found["lost"] = not asks(unit, patience)
        for found["rounds"] in range(1, int(PATIENCE / patience)):
            if asks(unit, patience):
                break
        # The device itself is as fast as the machine.
        found["heard"] = wait(lambda: asks(unit, patience), 10) and serial.mood == "right"

    programs = []
    for unit, patience in ((1, 0.2), (2, 0.5), (3, 1.0)):
        found = {}
        thread = threading.Thread(target=lives, args=(unit, patience, found), daemon=True)
        thread.start()
        programs.append((patience, thread, found))
    for patience, thread, found in programs:
        thread.join(2 * PATIENCE)
        expect(f"a client that reconnects after {patience} s is answered again after one lost reply",
               found.get("lost") and found.get("heard"), found)
        # Two response timeouts of 1 s and the quiet time, after the request.
        print(f"    after {found.get('rounds')} connections of {patience} s")
    gateway.end()


def check_connections(mbm, files):
    """Devices that close idle connections, or answer no more on one that stays open."""
    idle, closing = TcpDevice(lambda pdu: number(1), idle=0.2), TcpDevice(lambda pdu: number(2), hangs_up=True)
    silent, kept = (TcpDevice(lambda pdu: number(3), answers=3) for _ in range(2))
    files.write(files.line(idle.line, "1"), files.line(closing.line, "2"), files.line(silent.line, "3"),
                files.line(kept.line, "4", ", replace_after: 0"), head="listen: tcp://127.0.0.1:0\ntimeout: 300ms\n")
    gateway = Service(mbm, "gateway", files.path, ready=READY)
    client, waiting = Client(gateway.port), Client(gateway.port)
    for _ in range(8):
        expect("a device that closes idle connections answers", client.ask(1) == number(1))
        time.sleep(0.4)
    expect("each request is sent once", len(idle.asked) == 8, idle.asked)
    expect("a device that closes each connection answers", [client.ask(2) for _ in range(8) if not time.sleep(0.1)]
           == [number(2)] * 8)
    expect("nothing of that is reported", gateway.log == [], gateway.log)
    answers = [waiting.ask(3) for _ in range(20)]
    expect("a silent connection costs two requests", answers == ([number(3)] * 3 + [NO_REPLY] * 2) * 4, answers)
    gateway.expect_line("a silent connection", r"^warning: tcp://.*: no byte came after 2 requests in a row\. The connection is "
                        "made anew, now and each time that this happens\\.$")
    expect("that is reported once", len(gateway.log) == 1, gateway.log)
    answers = [waiting.ask(4) for _ in range(8)]
    expect("replace_after: 0 keeps the connection", answers == [number(3)] * 3 + [NO_REPLY] * 5, answers)
    gateway.end()
    for one in idle, closing, silent, kept:
        one.go()


def traced(mbm, folder, *arguments):
    """A gateway whose system calls strace writes to a file."""
    return Service("strace", "-D", "-o", os.path.join(folder, "calls"), mbm, "gateway", "tcp://127.0.0.1:0", *arguments,
                   ready=READY)


def end_traced(gateway, folder):
    """Ends it, and returns its calls, one a line."""
    gateway.end()
    path = os.path.join(folder, "calls")
    wait(lambda: "+++ exited" in open(path).read())
    with open(path) as file:
        return [line for line in file if line[0].isalpha()]


def calls_of(mbm, folder, clients, each, others):
    """The system calls of a gateway for each request, while clients ask one line and others are idle."""
    serial, idle = Serial(folder, "asked"), Serial(folder, "idle")
    gateway = traced(mbm, folder, f"rtu:{serial.path}?baud=115200", "7", f"rtu:{idle.path}?baud=115200", "8")
    silent = [Client(gateway.port) for _ in range(others)]
    asking = [Client(gateway.port) for _ in range(clients)]
    expect("the device answers", [one.ask(7) for one in asking + silent] == [number(7)] * (clients + others))

    def ask(one):
        for _ in range(each):
            expect("each request has its reply", one.ask(7) == number(7))

    threads = [threading.Thread(target=ask, args=(one,)) for one in asking]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    calls, count = end_traced(gateway, folder), clients * each
    serial.pull_out()
    idle.pull_out()
    sent = [at for at, call in enumerate(calls) if call.startswith("send")]
    expect("each response is sent by one call", len(sent) == count + clients + others, len(sent))
    return (sent[-1] - sent[-1 - count]) / count


def check_calls(mbm):
    """A request costs few system calls, however many connections and lines are idle."""
    for clients, each, others in (1, 300, 0), (1, 300, 12), (10, 40, 0):
        with tempfile.TemporaryDirectory() as folder:
            found = calls_of(mbm, folder, clients, each, others)
        print(f"  {clients} asking, {others} idle: {found:.2f} system calls a request")
        expect(f"{clients} asking, {others} idle: at most 8 system calls a request", found <= 8, found)

    # More requests in one segment than the gateway takes from a connection in one poll.
    with tempfile.TemporaryDirectory() as folder:
        gateway = traced(mbm, folder, "rtu:/dev/no-such-line", "1", "--requests", "128", "--log-level", "error")
        client = Client(gateway.port)
        client.socket.sendall(b"".join(frame(i, 9, READ) for i in range(100)))
        expect("a hundred requests at once are answered", [client.take() for _ in range(100)] == [NO_PATH] * 100)
        calls = end_traced(gateway, folder)
    sent = [at for at, call in enumerate(calls) if call.startswith("send")]
    expect("no sleep keeps them waiting", not [call for call in calls[sent[0] : sent[-1]] if "(Timeout)" in call and
                                               "tv_sec=0, tv_nsec=0}" not in call], "".join(calls[sent[0] : sent[-1]]))


def check_crowd(mbm, files):
    """A client that finds no place."""
    files.write(files.line("rtu:/dev/no-such-line", "1"), head="listen: tcp://127.0.0.1:0\nconnections: 1\n")
    gateway = Service(mbm, "gateway", files.path, "--metrics", "127.0.0.1:0", ready=READY)
    port = int(gateway.await_line(r"metrics are at port (\d+)").split()[-2].rstrip(","))
    first = Client(gateway.port)
    first.ask(1)
    expect("a client without a place is disconnected", Client(gateway.port).socket.recv(1) == b"")
    expect("the first one stays", first.ask(1) == NO_PATH)
    expect("and it is counted", metrics(port)["mbm_gateway_refused_connections_total", None] == 1)
    gateway.end()


def check_example(mbm, files):
    """The example that is installed."""
    with open(os.path.join(ROOT, "examples/services/gateway.yaml")) as file:
        text = file.read().replace("tcp://:502 ", "tcp://127.0.0.1:0 ")
    with open(files.path, "w") as file:
        file.write(text)
    gateway = Service(mbm, "gateway", files.path, ready=READY)
    expect("the example maps units", Client(gateway.port).ask(255) == NO_PATH)
    gateway.end()


def check_service(mbm):
    with tempfile.TemporaryDirectory() as folder:
        files = Files(folder)
        for check in (check_wrong_files, check_reload, check_stats, check_metrics, check_log, check_terminal, check_drill,
                      check_impatient_clients, check_connections, check_crowd, check_example):
            check(mbm, files)
