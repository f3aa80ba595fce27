"""The peers of mbm in tests/tool: programs, servers of libmodbus and pymodbus, lines, devices and clients. What a test
begins ends with it: conftest.py calls `end_all`."""

import asyncio
import collections
import contextlib
import os
import re
import resource
import select
import signal
import socket
import ssl
import subprocess
import sys
import threading
import time
import tty

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.join(ROOT, "build")
PLAIN = os.path.join(BUILD, "plain")
CERTIFICATES = os.path.join(BUILD, "certificates")
# The exit codes of mbm.
DONE, SYSTEM, WRONG, LINE, NO_REPLY, EXCEPTION, DAMAGED = range(7)
# A loaded machine must not let a test fail.
PATIENCE = 60
PATIENT = ("--timeout", "20s")
# nohup ignores SIGHUP, and a shell SIGQUIT for what runs in the background. The programs that a test begins would inherit that.
for one in (signal.SIGHUP, signal.SIGQUIT):
    signal.signal(one, signal.SIG_DFL)
endings = []


def end_all(since=0):
    """Ends what was begun after the first `since` endings."""
    with contextlib.ExitStack() as stack:
        for ending in endings[since:]:
            stack.callback(ending)
        del endings[since:]


def wait(right, patience=PATIENCE):
    """Waits until `right` returns true; its last value if it never does."""
    end = time.monotonic() + patience
    while not (found := right()) and time.monotonic() < end:
        time.sleep(0.02)
    return found


def word(address):
    """The holding register that libmodbus's and pymodbus's servers have at an address at first."""
    return (address * 40503 + 0x1234) & 0xFFFF


def bit(address):
    """The coil that these servers have at an address at first."""
    return word(address) >> 7 & 1


def words(first, count, complement=0):
    return [word(address) ^ complement for address in range(first, first + count)]


def bits(first, count, opposite=0):
    return [bit(address) ^ opposite for address in range(first, first + count)]


def numbered(address, values, mark=""):
    """What `mbm read` prints of values at consecutive addresses."""
    return "".join(f"{mark}{address + i:5}  {value}\n" for i, value in enumerate(values))


def demonstration():
    """Each function of a client on a libmodbus server: the words of a command of mbm after the line and the
    unit, what it prints, and its exit code."""
    wrote = "unit 17: wrote {} from address {} on, function {}\n"
    return [
        ("read 2 6", numbered(2, words(2, 6)), DONE),
        ("read --table input 8 2", numbered(8, words(8, 2, 0xFFFF)), DONE),
        ("write 40 48879", wrote.format("1 holding register", 40, "06"), DONE),
        ("write 0 1 2 3", wrote.format("3 holding registers", 0, "10"), DONE),
        ("read --hex 0 3", numbered(0, ["0x0001", "0x0002", "0x0003"]), DONE),
        ("call 16 00 28 FF 00 00 12", "16 00 28 FF 00 00 12\nunit 17  reply      16 mask write register  40: and FF00 or 0012\n", DONE),
        ("call 17 00 28 00 02 00 29 00 01 02 0A 0B",
         "17 04 BE 12 0A 0B\nunit 17  reply      17 read/write multiple registers: 48658 2571\n", DONE),
        ("write --table coils 20 1", wrote.format("1 coil", 20, "05"), DONE),
        ("write --table coils 21 1 0 1", wrote.format("3 coils", 21, "0F"), DONE),
        ("read --table coils 20 5", numbered(20, [1, 1, 0, 1, bit(24)]), DONE),
        ("read --table discrete 30 4", numbered(30, bits(30, 4, 1)), DONE),
        ("read 500", "", EXCEPTION),
        ("read --unit 99 --timeout 200ms 0", "", NO_REPLY),
    ]


# --- programs

Result = collections.namedtuple("Result", "code out error")


def run(*command, stdout=subprocess.PIPE, text="", **options):
    done = subprocess.run([str(one) for one in command], stdout=stdout, stderr=subprocess.PIPE, input=text, text=True,
                          errors="replace", timeout=90, **options)
    return Result(done.returncode, done.stdout, done.stderr)


def limit_files(size):
    """For a child: a write beyond this size of a file fails, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


class Program:
    """A program that runs until it is told to end. Keeps the lines of its output and of its log."""

    # The end of a program of others says nothing.
    is_ours = True

    def __init__(self, *command, env=None, limit=None, **options):
        self.output, self.log = [], []
        self.process = subprocess.Popen(
            [str(one) for one in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, **(env or {})}, preexec_fn=(lambda: limit_files(limit)) if limit else None, **options)
        self.pid = self.process.pid
        self.readers = [threading.Thread(target=self.read, args=one, daemon=True)
                        for one in ((self.process.stderr, self.log), (self.process.stdout, self.output))]
        for reader in self.readers:
            reader.start()
        endings.append(self.close)

    @staticmethod
    def read(stream, lines):
        for line in stream:
            lines.append(line.rstrip("\n"))

    @property
    def code(self):
        """The exit code, or None as long as it runs. Then `cpu` is the seconds of processor time that it used."""
        if self.process.returncode is None and (ended := os.wait4(self.pid, os.WNOHANG))[0]:
            self.process.returncode = os.waitstatus_to_exitcode(ended[1])
            self.cpu = ended[2].ru_utime + ended[2].ru_stime
        return self.process.returncode

    @property
    def sleeps(self):
        """Whether it waits in the kernel."""
        with open(f"/proc/{self.pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] == "S"

    def await_line(self, pattern="", lines=None, since=0):
        """Waits for a line of the log that matches; returns it."""
        lines = self.log if lines is None else lines
        found = wait(lambda: next(([line] for line in lines[since:] if re.search(pattern, line)), None) or
                     (self.code is not None and not any(reader.is_alive() for reader in self.readers) and [None]))
        assert found and found[0] is not None, f"no line matches {pattern} in\n" + "\n".join([*self.output, *self.log])
        return found[0]

    def await_output(self, pattern="", since=0):
        return self.await_line(pattern, self.output, since)

    def last_word(self):
        """The last word of the first line of its output: often a place or a port."""
        return self.await_output().split()[-1]

    def tell(self, number):
        self.process.send_signal(number)

    def reload(self, pattern):
        """SIGHUP, and the log line that follows it."""
        since = len(self.log)
        self.tell(signal.SIGHUP)
        self.await_line(pattern, since=since)

    def wait(self, code=None):
        """Waits for its end. Returns its exit code and what it printed."""
        assert wait(lambda: self.code is not None), f"{self.process.args} does not end"
        for reader in self.readers:
            reader.join(PATIENCE)
        assert code in (None, self.code), f"{self.process.args} ended with {self.code}\n" + "\n".join(self.log)
        return Result(self.code, *("".join(f"{line}\n" for line in lines) for lines in (self.output, self.log)))

    def end(self, number=signal.SIGTERM, code=DONE):
        self.tell(number)
        return self.wait(code)

    def close(self):
        if self.code is None and self.is_ours:
            self.end()
        elif self.code is None:
            self.end(signal.SIGKILL, None)


class Peer(Program):
    """A server of others, or of the tests."""

    is_ours = False

    def __init__(self, *command, **options):
        super().__init__(*command, **options)
        self.ready = self.await_output("^ready").split()[1:]


def libmodbus():
    """libmodbus's servers: unit 17 on a pty, and any unit over TCP. Returns the program, the pty and the port."""
    program = Peer(f"{PLAIN}/serve_libmodbus")
    return program, *program.ready


def pymodbus(framing, *place):
    return Peer(sys.executable, "-B", f"{ROOT}/tests/peer/pymodbus_server.py", "--framing", framing, *place)


def served(make):
    """Starts the server of pymodbus that `make` returns, in a thread of its own. Returns its port."""
    loop = asyncio.new_event_loop()

    async def begin():
        server = make()
        await server.serve_forever(background=True)
        place = getattr(server.transport, "sockets", None)
        return (place[0].getsockname() if place else server.transport.get_extra_info("sockname"))[1]

    port = loop.run_until_complete(begin())
    threading.Thread(target=loop.run_forever, daemon=True).start()
    return port


def ten_registers():
    """The device of pymodbus's servers in this process: unit 17 with the registers 100 to 109."""
    from pymodbus.simulator import DataType, SimData, SimDevice

    return SimDevice(17, simdata=[SimData(100, values=[1000 + i for i in range(10)], datatype=DataType.REGISTERS)])


def keys(name):
    """The files of a certificate and of its key."""
    return f"{CERTIFICATES}/{name}.pem", f"{CERTIFICATES}/{name}.key.pem"


def context(name, protocol):
    """What Python's TLS needs to be `name`."""
    made = ssl.SSLContext(protocol)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.load_cert_chain(*keys(name))
    made.load_verify_locations(f"{CERTIFICATES}/authority.pem")
    made.check_hostname = False
    made.verify_mode = ssl.CERT_REQUIRED
    return made


def tls_line(port, name, more=""):
    certificate, key = keys(name)
    return f"tls://127.0.0.1:{port}?ca={CERTIFICATES}/authority.pem&cert={certificate}&key={key}{more}"


class Strace:
    """Counts system calls. `before` stands before the command of the program."""

    def __init__(self, path):
        self.path, self.before = str(path), ("strace", "-D", "-o", str(path))

    def calls(self):
        """The calls of the program, which is to end, one a line."""
        assert wait(lambda: re.search(r"^\+\+\+ (exited|killed)", self.read(), re.M))
        return [line for line in self.read().splitlines() if line[:1].isalpha()]

    def read(self):
        with open(self.path, errors="replace") as file:
            return file.read()


def between_sends(calls, requests):
    """How many system calls there are for each of the last requests, and how many responses were sent."""
    sent = [at for at, call in enumerate(calls) if call.startswith("send")]
    return (sent[-1] - sent[-1 - requests]) / requests, len(sent)


# --- frames

READ = bytes([3, 0, 0, 0, 1])
NO_PATH, NO_ANSWER = b"\x83\x0a", b"\x83\x0b"


def number(value):
    """The PDU of a reply to READ."""
    return bytes([3, 2]) + value.to_bytes(2, "big")


def crc(frame):
    """The CRC of an RTU frame."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def sealed(frame):
    return frame + crc(frame)


def tcp_frame(transaction, unit, pdu):
    return transaction.to_bytes(2, "big") + b"\0\0" + (len(pdu) + 1).to_bytes(2, "big") + bytes([unit]) + pdu


class Client:
    """A client of Modbus TCP."""

    def __init__(self, port, patience=PATIENCE):
        self.socket = socket.create_connection(("127.0.0.1", int(port)), timeout=patience)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.number = 0
        endings.append(self.socket.close)

    def send(self, unit, pdu=READ):
        self.number += 1
        self.socket.sendall(tcp_frame(self.number, unit, pdu))

    def read(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise ConnectionResetError("the other end closed the connection")
            data += part
        return data

    def response(self):
        """The next response: transaction, unit and PDU."""
        head = self.read(7)
        return int.from_bytes(head[:2], "big"), head[6], self.read(int.from_bytes(head[4:6], "big") - 1)

    def take(self):
        return self.response()[2]

    def ask(self, unit, pdu=READ):
        self.send(unit, pdu)
        return self.take()


# --- lines and devices

class Wire(threading.Thread):
    """Two terminals that are connected. Keeps the bytes that each end sends."""

    def __init__(self):
        super().__init__(daemon=True)
        self.ends, self.terminals, self.names, self.sent = [], [], [], [b"", b""]
        for _ in range(2):
            ours, theirs = os.openpty()
            tty.setraw(theirs)
            self.ends.append(ours)
            self.terminals.append(theirs)
            self.names.append(os.ttyname(theirs))
        self.start()

    def run(self):
        while True:
            for end in select.select(self.ends, [], [])[0]:
                index = self.ends.index(end)
                data = os.read(end, 512)
                self.sent[index] += data
                os.write(self.ends[1 - index], data)


class SerialDevice:
    """Answers requests of 8 bytes in RTU on a pseudo terminal by a function of the frame. Without one all its registers
    are `value`, and by its mood it is right, silent, damaged, or loses one reply. Its path stays the same when it is
    pulled out, and comes back with another terminal."""

    def __init__(self, folder, answer=None, value=7, name="tty"):
        self.path, self.answer, self.value, self.mood = os.path.join(folder, name), answer or self.reply, value, "right"
        self.line = f"rtu:{self.path}?baud=115200"
        self.come()
        endings.append(self.go)

    def come(self):
        master, terminal = os.openpty()
        tty.setraw(terminal)
        os.symlink(os.ttyname(terminal), self.path)
        os.close(terminal)
        wake, self.wake = os.pipe()
        self.thread = threading.Thread(target=self.serve, args=(master, wake), daemon=True)
        self.thread.start()

    def go(self):
        if self.wake:
            os.unlink(self.path)
            os.close(self.wake)
            self.thread.join()
            self.wake = None

    def reply(self, frame):
        mood = self.mood
        if mood == "loses one":
            self.mood = "right"
        right = sealed(frame[:1] + bytes([3, 2 * frame[5]]) + self.value.to_bytes(2, "big") * frame[5])
        return {"right": right, "damaged": right[:-2] + bytes([right[-2] ^ 1, right[-1]])}.get(mood)

    def serve(self, master, wake):
        request = b""
        while wake not in (ready := select.select([master, wake], [], [])[0]):
            try:
                request += os.read(ready[0], 8 - len(request))
            except OSError:
                # No program has the terminal open.
                time.sleep(0.01)
            if len(request) == 8:
                reply, request = self.answer(request), b""
                if reply:
                    os.write(master, reply)
        os.close(wake)
        os.close(master)


class TcpDevice:
    """Answers requests of Modbus TCP by a function of the PDU; None is no answer. It may be away, close a connection after
    `idle` seconds without a request, or answer only the first `answers` requests of a connection. `mbm serve --fault` plays
    devices with other manners."""

    idle = answers = None

    def __init__(self, answer=lambda pdu: number(42), host="127.0.0.1"):
        self.answer, self.host = answer, host
        self.port = 0
        self.asked = []
        self.come()
        endings.append(self.go)

    @property
    def line(self):
        return f"tcp://[{self.host}]:{self.port}" if ":" in self.host else f"tcp://{self.host}:{self.port}"

    def requests(self):
        """Function, address and quantity of each read."""
        return [tuple(int(pdu[i:j], 16) for i, j in ((0, 2), (2, 6), (6, 10))) for _, pdu in self.asked]

    def come(self):
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        self.listener = socket.create_server((self.host, self.port), family=family)
        self.port = self.listener.getsockname()[1]
        self.peers = []
        threading.Thread(target=self.accept, args=(self.listener,), daemon=True).start()

    def go(self):
        if self.listener.fileno() < 0:
            return
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for peer in self.peers:
            try:
                peer.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
            peer.close()

    def accept(self, listener):
        while True:
            try:
                peer, _ = listener.accept()
            except OSError:
                return
            self.peers.append(peer)
            threading.Thread(target=self.serve, args=(peer,), daemon=True).start()

    def reply(self, head, pdu):
        """The frame for a header and the PDU of a request."""
        self.asked.append((head[6], pdu.hex()))
        reply = self.answer(pdu)
        return reply and head[:4] + (len(reply) + 1).to_bytes(2, "big") + head[6:] + reply

    def serve(self, peer):
        answered = 0
        try:
            peer.settimeout(self.idle)
            stream = peer.makefile("rb")
            while len(head := stream.read(7)) == 7:
                reply = self.reply(head, stream.read(int.from_bytes(head[4:6], "big") - 1))
                if reply is not None and answered != self.answers:
                    answered += 1
                    peer.sendall(reply)
        except TimeoutError:
            peer.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
