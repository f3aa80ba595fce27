"""The peers of the scripts that check mbm and the examples: programs, servers of pymodbus, a line and a device."""

import asyncio
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# nohup ignores SIGHUP, and the programs that a script begins would inherit that.
signal.signal(signal.SIGHUP, signal.SIG_DFL)


def word(address):
    """The holding register that libmodbus's and pymodbus's servers have at an address at first."""
    return (address * 40503 + 0x1234) & 0xFFFF


def bit(address):
    """The coil that these servers have at an address at first."""
    return word(address) >> 7 & 1


def numbered(address, values):
    """What `mbm read` prints of values at consecutive addresses."""
    return "".join(f"{address + i:5}  {value}\n" for i, value in enumerate(values))


def demonstration():
    """Each function of a client on a libmodbus server: the words of a command of mbm after the line and the
    unit, what it prints, and its exit code."""
    wrote = "unit 17: wrote {} from address {} on, function {}\n"
    return [
        ("read 2 6", numbered(2, [word(2 + i) for i in range(6)]), 0),
        ("read --table input 8 2", numbered(8, [word(8 + i) ^ 0xFFFF for i in range(2)]), 0),
        ("write 40 48879", wrote.format("1 holding register", 40, "06"), 0),
        ("write 0 1 2 3", wrote.format("3 holding registers", 0, "10"), 0),
        ("read --hex 0 3", numbered(0, ["0x0001", "0x0002", "0x0003"]), 0),
        ("call 16 00 28 FF 00 00 12", "16 00 28 FF 00 00 12\nunit 17  reply      16 mask write register  40: and FF00 or 0012\n", 0),
        ("call 17 00 28 00 02 00 29 00 01 02 0A 0B",
         "17 04 BE 12 0A 0B\nunit 17  reply      17 read/write multiple registers: 48658 2571\n", 0),
        ("write --table coils 20 1", wrote.format("1 coil", 20, "05"), 0),
        ("write --table coils 21 1 0 1", wrote.format("3 coils", 21, "0F"), 0),
        ("read --table coils 20 5", numbered(20, [1, 1, 0, 1, bit(24)]), 0),
        ("read --table discrete 30 4", numbered(30, [1 - bit(30 + i) for i in range(4)]), 0),
        ("read 500", "", 5),
        ("read --unit 99 --timeout 200ms 0", "", 4),
    ]


def start(*command, **options):
    """Starts a program that prints `ready`; returns it and the words after that."""
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options)
    ready = process.stdout.readline().split()
    assert ready[:1] == ["ready"], f"{command[0]} did not start"
    return process, ready[1:]


def libmodbus(folder):
    """Starts libmodbus's servers; returns the process, the pty and the TCP port."""
    process, (path, port) = start(os.path.join(folder, "serve_libmodbus"))
    return process, path, port


def pymodbus(framing, *place):
    script = os.path.join(ROOT, "tests/peer/pymodbus_server.py")
    return start(sys.executable, "-B", script, "--framing", framing, *place)


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


def crc(frame):
    """The CRC of an RTU frame."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


class Wire(threading.Thread):
    """Two terminals that are connected. Keeps the bytes that each end sends."""

    def __init__(self):
        super().__init__(daemon=True)
        self.ends, self.names, self.sent = [], [], [b"", b""]
        for _ in range(2):
            ours, theirs = os.openpty()
            tty.setraw(theirs)
            self.ends.append(ours)
            self.names.append(os.ttyname(theirs))
        self.start()

    def run(self):
        while True:
            for end in select.select(self.ends, [], [])[0]:
                index = self.ends.index(end)
                data = os.read(end, 512)
                self.sent[index] += data
                os.write(self.ends[1 - index], data)


class TcpDevice:
    """Answers requests of Modbus TCP by a function of the PDU; None is no answer. It may close the
    connection after each answer, or after `idle` seconds without a request, answer late, answer only the
    first `answers` requests of a connection, or be away."""

    def __init__(self, answer=lambda pdu: bytes([3, 2, 0, 42]), hangs_up=False, late=0.0, host="127.0.0.1", idle=None,
                 answers=None):
        self.answer, self.hangs_up, self.late, self.host = answer, hangs_up, late, host
        self.idle, self.answers, self.connections = idle, answers, 0
        self.port = 0
        self.asked = []
        self.come()

    @property
    def line(self):
        return f"tcp://[{self.host}]:{self.port}" if ":" in self.host else f"tcp://{self.host}:{self.port}"

    def come(self):
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        self.listener = socket.create_server((self.host, self.port), family=family)
        self.port = self.listener.getsockname()[1]
        self.peers = []
        threading.Thread(target=self.accept, args=(self.listener,), daemon=True).start()

    def go(self):
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
            self.connections += 1
            threading.Thread(target=self.serve, args=(peer,), daemon=True).start()

    def serve(self, peer):
        answered = 0
        try:
            peer.settimeout(self.idle)
            stream = peer.makefile("rb")
            while len(head := stream.read(7)) == 7:
                pdu = stream.read(int.from_bytes(head[4:6], "big") - 1)
                self.asked.append((head[6], pdu.hex()))
                reply = self.answer(pdu)
                if reply is None or answered == self.answers:
                    continue
                answered += 1
                time.sleep(self.late)
                peer.sendall(head[:4] + (len(reply) + 1).to_bytes(2, "big") + head[6:] + reply)
                if self.hangs_up:
                    peer.shutdown(socket.SHUT_RDWR)
        except TimeoutError:
            peer.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
