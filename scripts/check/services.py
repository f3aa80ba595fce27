"""What the checks of `mbm gateway` and `mbm bridge` as services have in common: a process whose log lines can be
awaited, and readers of its statistics."""

import os
import re
import resource
import signal
import socket
import subprocess
import threading
import time

PATIENCE = 60
checks = failures = 0


def expect(what, right, found=""):
    global checks, failures
    checks += 1
    if not right:
        failures += 1
        print(f"check: {what}\n--- found\n{found}", flush=True)


def wait(right, patience=PATIENCE):
    """Waits until `right` returns true; its last value if it never does."""
    end = time.monotonic() + patience
    while not (found := right()) and time.monotonic() < end:
        time.sleep(0.02)
    return found


def limit_files(size):
    """For a child: a write beyond this size of a file fails, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


class Service:
    """A program that runs until it is told to end. Keeps its log lines and its output."""

    def __init__(self, *command, env=None, ready=None, limit=None):
        self.log, self.output = [], []
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, **(env or {})}, preexec_fn=(lambda: limit_files(limit)) if limit else None)
        self.readers = [threading.Thread(target=self.read, args=one, daemon=True)
                        for one in ((self.process.stderr, self.log), (self.process.stdout, self.output))]
        for reader in self.readers:
            reader.start()
        if ready:
            self.port = int(re.search(ready, self.await_line(ready, self.output)).group(1))

    @staticmethod
    def read(stream, lines):
        for line in stream:
            lines.append(line.rstrip("\n"))

    def await_line(self, pattern, lines=None, since=0):
        """Waits for a line that matches; returns it, or an empty text."""
        lines = self.log if lines is None else lines
        return wait(lambda: next((line for line in lines[since:] if re.search(pattern, line)), "")) or ""

    def expect_line(self, what, pattern, since=0):
        expect(f"{what}: {pattern}", self.await_line(pattern, since=since), "\n".join(self.log))

    def signal(self, number):
        self.process.send_signal(number)

    def reload(self, pattern):
        """SIGHUP, and the log line that follows it."""
        since = len(self.log)
        self.signal(signal.SIGHUP)
        self.expect_line("SIGHUP", pattern, since)

    def end(self, code=0):
        self.signal(signal.SIGTERM)
        expect(f"{self.process.args[1]} ends with {code}", self.process.wait(PATIENCE) == code,
               "\n".join(self.log))
        for reader in self.readers:
            reader.join(PATIENCE)


class Notified:
    """What a service tells systemd."""

    def __init__(self, folder):
        self.path = os.path.join(folder, "notify")
        if os.path.exists(self.path):
            os.unlink(self.path)
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.socket.settimeout(PATIENCE)

    def expect(self, beginning):
        found = self.socket.recv(200).decode()
        expect(f"systemd hears {beginning}", found.startswith(beginning), found)


def http(port, request=b"GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n"):
    """Returns the head and the body of a reply."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(request)
        data = b""
        while part := connection.recv(65536):
            data += part
    head, _, body = data.decode().partition("\r\n\r\n")
    return head, body


HELP = re.compile(r"# HELP (mbm_[a-z_]+) .+\.")
TYPE = re.compile(r"# TYPE (mbm_[a-z_]+) (counter|gauge)")
SAMPLE = re.compile(r'(mbm_[a-z_]+)(?:\{line="((?:[^"\\\n]|\\["\\n])*)"\})? (\d+)')


def metrics(port):
    """Reads the text format strictly: each name has its help and its type, then all its samples; a counter's ends
    with _total, and no sample is there twice. Returns the numbers, by name and line."""
    head, body = http(port)
    found, name = {}, None
    expect("the reply is text of the format 0.0.4", head.startswith("HTTP/1.0 200 OK\r\n")
           and "Content-Type: text/plain; version=0.0.4" in head
           and f"Content-Length: {len(body.encode())}\r\n" in head, head)
    expect("the text ends with a line feed", body.endswith("\n"))
    lines = iter(body.splitlines())
    for line in lines:
        if match := HELP.fullmatch(line):
            name, kind = match.group(1), TYPE.fullmatch(next(lines))
            expect(f"{name} has a type", kind and kind.group(1) == name
                   and (kind.group(2) == "counter") == name.endswith("_total"), line)
            expect(f"{name} is there once", not any(one == name for one, _ in found))
            continue
        match = SAMPLE.fullmatch(line)
        expect("a line is a sample of the name before", match and match.group(1) == name, line)
        expect("a sample is there once", (name, match.group(2)) not in found, line)
        found[name, match.group(2)] = int(match.group(3))
    return found
