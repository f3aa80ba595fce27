"""The peers of the scripts that check the examples: programs, servers of pymodbus, and a line."""

import os
import select
import subprocess
import sys
import threading
import tty

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def start(*command, **options):
    """Starts a program that prints `ready`; returns it and the words after that."""
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options)
    ready = process.stdout.readline().split()
    assert ready[:1] == ["ready"], f"{command[0]} did not start"
    return process, ready[1:]


def pymodbus(framing, *place):
    script = os.path.join(ROOT, "tests/peer/pymodbus_server.py")
    return start(sys.executable, "-B", script, "--framing", framing, *place)


def wire():
    """Creates two terminals and a thread that copies between them; returns their names."""
    ends = []
    names = []
    for _ in range(2):
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        ends.append(ours)
        names.append(os.ttyname(theirs))

    def copy():
        while True:
            for end in select.select(ends, [], [])[0]:
                os.write(ends[1 - ends.index(end)], os.read(end, 512))

    threading.Thread(target=copy, daemon=True).start()
    return names
