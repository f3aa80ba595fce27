"""A line that another program has open is refused, whoever opens it, and the other one is named."""

import fcntl
import os
import signal
import struct

import pytest
from peers import DONE, LINE, NO_REPLY, Client, Program, wait

DEVICE = "fields: [{name: a, table: holding, address: 0, type: uint16}]\n"
BRIEF = ("--timeout", "50ms")


def holder(path, *command):
    """A program that has a terminal open, and how mbm names it."""
    program = Program(*command)
    program.is_ours = False
    folder = f"/proc/{program.pid}/fd"

    def files():
        for fd in os.listdir(folder):
            try:
                yield os.readlink(f"{folder}/{fd}")
            except OSError:
                pass

    assert wait(lambda: path in files())
    return program, f"{os.path.basename(command[0])} (process {program.pid}) has it open"


@pytest.fixture
def path(wire):
    return wire.names[1]


@pytest.fixture(params=["cat", "mbm sniff", "mbm serve"])
def other(request, mbm, path):
    line = f"rtu:{path}"
    return request.param, *holder(path, *{"cat": ("cat", path), "mbm sniff": (mbm.path, "sniff", line),
                                          "mbm serve": (mbm.path, "serve", f"{line}?parity=none", "--echo")}[request.param])


def test_a_line_that_another_program_has_open_is_refused(mbm, path, write, other):
    line, device = f"rtu:{path}", write("alone.yaml", DEVICE)
    who, program, name = other
    for command in (("read", line, 0), ("write", line, 0, 1), ("call", line, "03 00 00 00 01"), ("scan", line), ("identify", line),
                    ("poll", line, device), ("poll", line, device, "--once"), ("read", line, 0, "--every", "1s"), ("serve", line, "--echo"),
                    ("sniff", line), ("read", f"ascii:{path}", 0), ("bridge", line, device, "--broker", "127.0.0.1:1")):
        mbm.fails(LINE, f"{name}. End that program first. shared=yes in the name", *command)
    if who == "cat":
        code, _, error = mbm("read", f"{line}?shared=yes", 0, *BRIEF)
        assert (code, "did not answer" in error) == (NO_REPLY, True)
    else:
        mbm.fails(LINE, name, "read", f"{line}?shared=yes", 0)
    program.end(code=None)
    assert mbm("read", line, 0, *BRIEF).code == NO_REPLY


def test_services_wait_for_a_line_that_another_program_has_open(mbm, path, write, other):
    line, name = f"rtu:{path}", other[2]
    write("alone.yaml", DEVICE)
    bridge = write("bridge.yaml", f"broker: 127.0.0.1:1\ntopic: a\nlines: [{{line: '{line}', file: alone.yaml, topic: b}}]\n")
    for command in (("gateway", "tcp://127.0.0.1:0", line, "1"), ("bridge", bridge)):
        service = mbm.begin(*command)
        if command[0] == "gateway":
            assert Client(service.last_word()).ask(1) == b"\x83\x0a"
        assert f"{line}: {name}. The line is opened again each second" in service.await_line(r"has it open")
        service.end()


def test_two_programs_that_say_so_share_a_line(mbm, path):
    line = f"rtu:{path}"
    program, name = holder(path, mbm.path, "sniff", f"{line}?shared=yes")
    mbm.fails(LINE, name, "read", line, 0)
    assert mbm("read", f"{line}?shared=yes", 0, *BRIEF).code == NO_REPLY
    program.end()


def test_one_terminal_under_two_names_is_opened_once(mbm, path, folder):
    os.symlink(path, f"{folder}/alias")
    gateway = mbm.begin("gateway", "tcp://127.0.0.1:0", f"rtu:{path}", "1", f"rtu:{folder}/alias", "2")
    assert "this program has it open already, under another name" in gateway.await_line()


def test_a_killed_client_leaves_the_terminal_of_a_server_to_others(mbm, folder):
    name = f"{folder}/served"
    mbm.begin("serve", f"pty:{name}", "--echo", "-q").await_output()
    client, _ = holder(os.path.realpath(name), mbm.path, "read", f"rtu:{name}", 0, "--every", "20ms")
    client.end(signal.SIGKILL, -signal.SIGKILL)
    fd = os.open(name, os.O_RDWR | os.O_NOCTTY)
    is_exclusive = lambda: struct.unpack("i", fcntl.ioctl(fd, 0x80045440, b"\0" * 4))[0]  # TIOCGEXCL
    assert wait(lambda: not is_exclusive())
    os.close(fd)
    assert mbm("read", f"rtu:{name}", 0)[:2] == (DONE, "    0  0\n")
