#!/usr/bin/env python3
"""Is unit 17 on a serial line, whose holding register 100 is 0x1234, and runs a program that reads it:

    device.py terminal PROGRAM...    the program gets the path of a terminal as its last argument
    device.py stdio PROGRAM...       the program's standard input and output are the line; QEMU

Fails unless the program sends exactly this request, prints the register and ends with 0.
"""

import os
import pty
import select
import subprocess
import sys
import time
import tty

REQUEST = bytes([17, 3, 0, 100, 0, 1])
REPLY = bytes([17, 3, 2, 0x12, 0x34])
EXPECTED = "register 100: 0x1234"
SECONDS = 60


def with_crc(frame: bytes) -> bytes:
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return frame + crc.to_bytes(2, "little")


def main() -> None:
    kind, *command = sys.argv[1:]
    if kind == "terminal":
        line, terminal = pty.openpty()
        tty.setraw(terminal)
        process = subprocess.Popen([*command, os.ttyname(terminal)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        source, target, output = line, line, process.stdout
    else:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        source, target, output = process.stdout.fileno(), process.stdin.fileno(), process.stderr
    received, end = b"", time.monotonic() + SECONDS
    expected = with_crc(REQUEST)
    while len(received) < len(expected) and process.poll() is None and time.monotonic() < end:
        if select.select([source], [], [], 0.1)[0]:
            received += os.read(source, 256)
    if received == expected:
        os.write(target, with_crc(REPLY))
    try:
        code = process.wait(max(1, end - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.kill()
        code = f"nothing after {SECONDS} s"
    printed = output.read().decode(errors="replace").strip()
    if received != expected:
        sys.exit(f"{command[0]} sends {received.hex(' ')}, not {expected.hex(' ')}; it prints: {printed}")
    if code != 0 or EXPECTED not in printed.splitlines():
        sys.exit(f"{command[0]} ends with {code} and prints: {printed}")


main()
