#!/usr/bin/env python3
"""A Modbus device for the programs of this package's test: unit 17, whose holding register N has
the value 1000 + N.

    device.py tcp|rtu

It listens on a free port of this machine and prints the port's number. With rtu it speaks RTU over
the connection, as a serial line that QEMU connects to it.

Licence: MIT OR Apache-2.0.
"""

import socket
import struct
import sys

UNIT = 17


def crc(frame: bytes) -> bytes:
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


def respond(pdu: bytes) -> bytes:
    function, first, count = struct.unpack(">BHH", pdu)
    if function != 3 or not 1 <= count <= 125:
        return bytes([function | 0x80, 1])
    return struct.pack(f">BB{count}H", 3, 2 * count, *range(1000 + first, 1000 + first + count))


def take(link: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = link.recv(count - len(data))
        if not part:
            sys.exit(0)
        data += part
    return data


def serve_tcp(link: socket.socket) -> None:
    while True:
        transaction, protocol, length, unit = struct.unpack(">HHHB", take(link, 7))
        pdu = take(link, length - 1)
        if protocol == 0 and unit == UNIT:
            answer = respond(pdu)
            link.sendall(struct.pack(">HHHB", transaction, 0, len(answer) + 1, unit) + answer)


def serve_rtu(link: socket.socket) -> None:
    while True:
        frame = take(link, 8)
        if frame[0] == UNIT and crc(frame[:6]) == frame[6:]:
            answer = frame[:1] + respond(frame[1:6])
            link.sendall(answer + crc(answer))


def main() -> None:
    serve = {"tcp": serve_tcp, "rtu": serve_rtu}[sys.argv[1]]
    with socket.create_server(("127.0.0.1", 0)) as server:
        print(server.getsockname()[1], flush=True)
        link, _ = server.accept()
        serve(link)


main()
