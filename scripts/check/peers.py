"""The peers of the scripts that check the examples: programs, servers of pymodbus, and a line."""

import asyncio
import os
import select
import subprocess
import sys
import threading
import tty

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def word(address):
    """The holding register that libmodbus's and pymodbus's servers have at an address at first."""
    return (address * 40503 + 0x1234) & 0xFFFF


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
