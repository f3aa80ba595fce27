"""Masters for the tests of mbm serve: pymodbus's client, mbpoll of libmodbus, and one that sends bytes and keeps what comes back."""

import os
import re
import select
import socket
import time
import tty

from peers import endings, run, sealed, tcp_frame

# The silence after which a test takes an answer for complete. Nothing but the end of an answer depends on it.
QUIET = 0.3


def port_of(place):
    return int(place.rsplit(":", 1)[1])


def framed(framing, body, transaction=0x1234):
    """The frame of a unit and PDU."""
    if framing == "ascii":
        return b":" + (body + bytes([-sum(body) & 0xFF])).hex().upper().encode() + b"\r\n"
    return sealed(body) if framing == "rtu" else tcp_frame(transaction, body[0], body[1:])


class Asker:
    """A client that sends bytes to a place and collects what comes back."""

    def __init__(self, place):
        self.framing = "ascii" if place.startswith("ascii:") else "rtu" if place.startswith(("/", "rtu+")) else "tcp"
        if place.startswith(("/", "ascii:")):
            self.fd = os.open(place.removeprefix("ascii:"), os.O_RDWR | os.O_NOCTTY)
            tty.setraw(self.fd)
            self.close = lambda: os.close(self.fd)
        else:
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if place.startswith("udp:") else socket.SOCK_STREAM)
            self.socket.connect(("127.0.0.1", port_of(place)))
            self.fd, self.close = self.socket.fileno(), self.socket.close
        endings.append(self.close)

    def ask(self, body, wanted=1):
        """Sends a request. Returns the bytes until `wanted` have arrived and then a silence, or <closed>; `first` and
        `last` are the seconds until the first and the last byte."""
        os.write(self.fd, framed(self.framing, body))
        begin, found = time.monotonic(), b""
        self.first = self.last = 0.0
        while True:
            left = begin + (20 if len(found) < wanted else self.last + QUIET) - time.monotonic()
            if left <= 0 or not select.select([self.fd], [], [], left)[0]:
                return found
            try:
                piece = os.read(self.fd, 4096)
            except ConnectionResetError:
                piece = b""
            if not piece:
                return found + b"<closed>"
            self.last = time.monotonic() - begin
            self.first = self.first or self.last
            found += piece


def pymodbus_client(place, timeout=20):
    from pymodbus import FramerType
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient, ModbusUdpClient

    if place.startswith(("/", "ascii:")):
        framer = FramerType.ASCII if place.startswith("ascii:") else FramerType.RTU
        client = ModbusSerialClient(place.removeprefix("ascii:"), framer=framer, baudrate=19200, timeout=timeout, retries=0)
    elif place.startswith("udp"):
        client = ModbusUdpClient("127.0.0.1", port=port_of(place), timeout=timeout, retries=0)
    else:
        framer = FramerType.RTU if place.startswith("rtu+") else FramerType.SOCKET
        client = ModbusTcpClient("127.0.0.1", port=port_of(place), framer=framer, timeout=timeout, retries=0)
    client.connect()
    endings.append(client.close)
    return client


def outcome(call):
    """The registers or bits of a reply, its exception, or "failed"."""
    from pymodbus.exceptions import ModbusException

    try:
        reply = call()
    except ModbusException:
        return "failed"
    if reply.isError():
        return f"exception {reply.exception_code:02}"
    return reply.registers or [int(bit) for bit in reply.bits[:1]] or "written"


def mbpoll(place, unit, *options, values=()):
    """Runs mbpoll, of libmodbus. Returns its values or the last words of its error."""
    where = ["-m", "rtu", "-b", "19200", "-P", "none", place] if place.startswith("/") else ["-m", "tcp", "-p", port_of(place), "127.0.0.1"]
    done = run("mbpoll", "-0", "-1", "-q", "-o", "5", "-a", unit, *options, *where, *values)
    failed = re.search(r"failed: (.*)", done.error)
    return re.findall(r"^\[\d+\]:\s+(\S+)", done.out, re.M) or (failed[1] if failed else done.out.strip() and "done")
