"""mbm poll --watch in a terminal, and mbm poll --http with any visitor: what they show, and that nothing outlasts them."""

import codecs
import fcntl
import json
import os
import random
import re
import select
import signal
import socket
import struct
import subprocess
import termios
import threading
import time
import unicodedata

import pytest
from masters import port_of
from peers import DONE, EXCEPTION, LINE, PATIENCE, PATIENT, ROOT, WRONG, Client, endings, run, wait
from services import http

TCP = "tcp://127.0.0.1:0"
FIELDS = """
device: Wärmepumpe
interval: 200ms
fields:
  - {name: flow, table: holding, address: 0, type: int16, scale: 0.1, unit_of_measurement: "°C", unit: 1}
  - {name: größe 日本, table: holding, address: 1, type: uint16, unit: 1}
  - {name: mode, table: holding, address: 2, type: uint16, enumeration: {0: "off", 1: heating}, unit: 2}
  - {name: gone, table: holding, address: 30, type: uint16, unit: 2}
"""
ENTER, LEAVE = "\x1b[?1049h", "\x1b[?1049l"


@pytest.fixture
def file(write):
    return write("pump.yaml", FIELDS)


@pytest.fixture
def device(mbm):
    """A device of units 1 and 2 without register 30; `write` sets a register."""
    place = mbm.serve(TCP, "--echo", "--unit", "1-2", "--fault", "hole=30")
    client = Client(port_of(place))
    client.place = place
    client.write = lambda address, value, unit=1: client.ask(unit, b"\x06" + address.to_bytes(2, "big") + (value & 0xFFFF).to_bytes(2, "big"))
    return client


# --- a terminal

def columns_of(text):
    return sum(0 if unicodedata.combining(one) else 2 if unicodedata.east_asian_width(one) in "WF" else 1 for one in text)


class Screen:
    """What a terminal shows of the escapes that are used. An unknown one is an error. A row is a list of columns; one that a
    wide character takes beside its first is empty."""

    PIECE = re.compile(r"\x1b\[(\??)([0-9;]*)([A-Za-z])|([^\x00-\x1f]+)|([\r\n])")

    def __init__(self):
        self.rows, self.at, self.column, self.all = {}, 0, 0, ""
        self.normal, self.modes, self.rest = {}, set(), ""

    def feed(self, text):
        self.all += text
        text, at = self.rest + text, 0
        while match := self.PIECE.match(text, at):
            at = match.end()
            if match[3]:
                self.obey(*match.group(1, 2, 3))
            elif match[4]:
                self.put(match[4])
            elif match[5] == "\n":
                self.at += 1
            else:
                self.column = 0
        self.rest = text[at:]
        assert len(self.rest) < 20, self.rest[:40]

    def put(self, text):
        cells = [cell for one in text for cell in [one, ""][:columns_of(one)]]
        row = self.rows.setdefault(self.at, [])
        row += [" "] * (self.column - len(row))
        row[self.column:self.column + len(cells)] = cells
        self.column += len(cells)

    def obey(self, private, numbers, letter):
        if private:
            assert letter in "hl" and numbers in ("1049", "25", "7", "2026"), (numbers, letter)
            (self.modes.add if letter == "h" else self.modes.discard)(numbers)
            if numbers == "1049":
                self.rows, self.normal = ({}, self.rows) if letter == "h" else (self.normal, {})
                self.at = max(self.rows, default=-1) + 1 if letter == "l" else 0
                self.column = 0
        elif letter == "H":
            self.at = self.column = 0
        elif letter == "K":
            del self.rows.setdefault(self.at, [])[self.column:]
        elif letter == "J":
            self.rows = {at: row for at, row in self.rows.items() if at <= self.at}
        else:
            assert letter == "m", letter

    def lines(self):
        return ["".join(self.rows.get(at, [])).rstrip() for at in range(max(self.rows, default=-1) + 1)]


class Terminal:
    """mbm in a terminal of its own, of which it is the foreground program."""

    def __init__(self, *command, rows=24, columns=100, env=None):
        self.ours, theirs = os.openpty()
        self.theirs = theirs
        self.size(rows, columns)
        self.before = termios.tcgetattr(theirs)

        def lead():
            os.setsid()
            fcntl.ioctl(theirs, termios.TIOCSCTTY, 0)

        self.process = subprocess.Popen([str(one) for one in command], stdin=theirs, stdout=theirs, stderr=subprocess.PIPE, preexec_fn=lead,
                                        env={**os.environ, "TERM": "xterm-256color", **(env or {})})
        self.screen, self.lock, self.wrong, self.is_gone = Screen(), threading.Lock(), None, False
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        endings.append(self.close)

    def size(self, rows, columns):
        fcntl.ioctl(self.ours, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def read(self):
        decoder = codecs.getincrementaldecoder("utf-8")()
        while True:
            if not select.select([self.ours], [], [], 0.2)[0]:
                if self.is_gone or self.process.poll() is not None:
                    return
                continue
            if self.is_gone:
                return
            try:
                data = os.read(self.ours, 65536)
            except OSError:
                return
            with self.lock:
                try:
                    self.screen.feed(decoder.decode(data))
                except AssertionError as wrong:
                    self.wrong = wrong
                    return

    def lines(self):
        assert self.wrong is None, self.wrong
        with self.lock:
            return self.screen.lines()

    def shows(self, pattern):
        """Waits until a line of the screen has the pattern; returns it."""
        found = wait(lambda: next((line for line in self.lines() if re.search(pattern, line)), None), PATIENCE)
        assert found, (pattern, self.lines())
        return found

    def row(self, name):
        return self.shows(rf"^. {re.escape(name)}\b")

    def type(self, text):
        os.write(self.ours, text.encode())

    def end(self, *codes):
        assert self.process.wait(PATIENCE) in codes, (self.process.returncode, self.process.stderr.read())
        self.reader.join(PATIENCE)
        return self.process.stderr.read().decode()

    def is_restored(self):
        """The terminal is as it was: its page, its cursor, its way to read."""
        assert self.wrong is None, self.wrong
        with self.lock:
            return termios.tcgetattr(self.theirs) == self.before and self.screen.all.count(ENTER) == self.screen.all.count(LEAVE) and (
                self.screen.all.rfind("\x1b[?25h") > self.screen.all.rfind("\x1b[?25l")) and "7" in self.screen.modes

    def hang_up(self):
        self.is_gone = True
        self.reader.join(PATIENCE)
        os.close(self.theirs)
        os.close(self.ours)

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.process.stderr.close()
        if not self.is_gone:
            self.hang_up()


@pytest.fixture
def watching(mbm, device, file):
    def watching(*words, path=None, rows=24, columns=110, env=None):
        return Terminal(mbm.path, "poll", device.place, path or file, "--watch", *PATIENT, *words, rows=rows, columns=columns, env=env)

    return watching


# --- what the table shows

def test_the_table_shows_values_changes_minimum_maximum_and_errors_of_each_unit(watching, device):
    device.write(0, 200)
    terminal = watching()
    assert re.search(r"^Wärmepumpe  tcp://127\.0\.0\.1:\d+  3 of 4 fields read  round \d+, \d\d:\d\d:\d\d UTC$", terminal.shows("3 of 4 fields read  round"))
    terminal.shows(r"^  NAME +VALUE +UNIT +AGE +CHANGED +MIN +MAX +STATUS$")
    assert re.search(r"^  flow +20 °C +1 +\d\.\ds +20 +20 +success$", terminal.row("flow"))
    device.write(0, 215)
    terminal.shows(r"^▲ flow +21\.5 °C +1 +\d\.\ds +\d\.\ds +20 +21\.5 +success$")
    device.write(0, 190)
    terminal.shows(r"^▼ flow +19 °C +1 +\d\.\ds +\d\.\ds +19 +21\.5 +success$")
    device.write(2, 1, 2)
    # Numbers with names have no minimum.
    terminal.shows(r"^• mode +1 \(heating\) +2 +\d\.\ds +\d\.\ds +success$")
    terminal.shows(r"^! gone +- +2 +exception 02: illegal data address$")
    terminal.shows(r"^unit 2: \d+ reads, \d+ exceptions?; unit 1: \d+ reads?$")
    # The mark goes after a while, the time of the change stays.
    terminal.shows(r"^  flow +19 °C +1 +\d\.\ds +\d+(\.\d)?s +19 +21\.5 +success$")
    terminal.type("r")
    terminal.shows(r"^  flow +19 °C +1 +\d\.\ds +\d+(\.\d)?s +19 +19 +success$")


def test_a_read_of_several_fields_counts_once(watching):
    terminal = watching("--rounds", 6)
    error = terminal.end(EXCEPTION)
    counts = [int(count) for count in re.findall(r"^unit \d: (\d+) read", "\n".join(terminal.lines()), re.M)]
    # Two fields of the first unit are in one read. One request may be under way.
    requests = int(re.search(r"requests: (\d+)", error)[1])
    assert len(counts) == 2 and sum(counts) in (requests, requests - 1), (counts, error)


def test_columns_stand_below_each_other_whatever_characters_a_name_has(watching):
    terminal = watching()
    terminal.shows(r"round ([2-9]|\d\d)")
    lines = [line for line in terminal.lines()[1:6]]
    values = [re.search(r"VALUE|(?<=  )(0 °C|0 \(off\)|0  |-  )", line) for line in lines]
    assert all(values), lines
    places = {columns_of(line[:value.start()]) for line, value in zip(lines, values)}
    assert len(places) == 1, lines


def test_texts_of_a_device_move_no_cursor(watching, device, write):
    for address, word in enumerate((0x411B, 0x5B32, 0x4A09, 0x9B42)):
        device.write(address, word)
    terminal = watching(path=write("text.yaml", "fields:\n- {name: a, table: holding, address: 0, type: text, count: 8}\n"))
    terminal.shows(r"^  a +A\.\[2J\.\.B +")
    assert "\x1b[2J" not in terminal.screen.all


def test_the_table_stays_on_the_terminal_when_it_ends(watching, device):
    device.write(0, 200)
    terminal = watching()
    terminal.shows("^! gone")
    terminal.type("q")
    error = terminal.end(EXCEPTION)
    assert any(re.search(r"^. flow +20 °C ", line) for line in terminal.lines())
    assert "mbm poll: rounds: " in error and "field gone in line 8 of the file: exception 02" in error


def test_rounds_and_times_end_the_table_too(watching):
    for words in (("--rounds", 3), ("--for", "1s")):
        terminal = watching(*words)
        terminal.end(EXCEPTION)
        assert terminal.is_restored()


# --- keys and sizes

@pytest.fixture
def long(write):
    return write("long.yaml", "interval: 200ms\nfields:\n" + "".join(
        f"- {{name: field {i}, table: input, address: {i + 100}, type: uint16}}\n" for i in range(60)))


def test_a_table_of_more_fields_than_lines_scrolls(watching, long):
    terminal = watching(path=long, rows=14)
    shown = lambda first: terminal.shows(rf"^fields {first + 1}-{first + 10} of 60  ") and terminal.row(f"field {first}")
    shown(0)
    for keys, first in (("j", 1), ("\x1b[B", 2), ("\x1bOB", 3), ("k", 2), ("\x1b[A\x1b[A\x1b[A\x1b[A", 0), ("\x1b[6~", 10), (" ", 20), ("\x1b[5~", 10),
                        ("G", 50), ("\x1b[F", 50), ("j", 50), ("g", 0), ("\x1b[4~", 50), ("\x1b[H", 0), ("b", 0), ("\x1b[6~" * 9, 50), ("\x1b[1~", 0),
                        ("x\x1b[15~\x1bx\x1b[1;5Bj", 1)):
        terminal.type(keys)
        shown(first)
    terminal.size(40, 100)
    terminal.shows("^fields 2-37 of 60")
    terminal.size(100, 100)
    terminal.row("field 59")
    assert not any("fields 1-" in line for line in terminal.lines())
    terminal.type("q")
    terminal.end(DONE)


@pytest.mark.parametrize("columns", [100, 80, 60, 40, 30, 20])
def test_no_line_is_wider_than_the_terminal(watching, columns):
    terminal = watching(columns=columns)
    terminal.shows("flow")
    terminal.shows("^!")
    assert max(map(columns_of, terminal.lines())) < columns
    heads = terminal.lines()[1].split()
    assert ("MIN" in heads) == ("MAX" in heads) and heads[:2] == ["NAME", "VALUE"], heads


def test_a_narrow_terminal_keeps_dates_and_statuses(watching, device, write):
    """80 columns hold a long name in part, a date as a whole, and why a field has no value."""
    path = write("long.yaml", """\
fields:
- {name: a clock that has a very long name, table: holding, address: 0, type: unix32}
- {name: missing, table: holding, address: 4, type: uint16, not_available: 0}
- {name: broken, table: holding, address: 5, type: iec870_3}
""")
    terminal = watching(path=path, columns=80)
    terminal.shows(r"^  NAME +VALUE +AGE +STATUS$")
    # The name has what the date leaves.
    terminal.shows(r"^  a clock that has a very .*…  1970-01-01T00:00:00Z +\d\.\ds +success$")
    terminal.shows(r"^  missing +- +\d\.\ds +not available$")
    terminal.shows(r"^! broken +- +\d\.\ds +the registers hold?.*…$")
    terminal.shows("  2 of 3 fields read  ")


def test_any_sizes_and_keys_leave_the_table_alive(watching, long):
    chance = random.Random(7)
    terminal = watching(path=long)
    terminal.row("field 0")
    for _ in range(60):
        terminal.size(chance.randint(1, 40), chance.randint(1, 120))
        terminal.type(chance.choice(["j", "G", "\x1b", "[", "\x1b[6~", "\x1b[", "é", "\x00", "k" * 50, "\x1b[99999;", "r"]))
        time.sleep(0.01)
    terminal.type("A")
    terminal.size(24, 100)
    terminal.shows("^fields ")
    terminal.type("q")
    terminal.end(DONE)
    assert terminal.is_restored()


# --- the ends

@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGABRT, signal.SIGUSR1, signal.SIGALRM,
                                    "q", "Q", "\x03"])
def test_the_terminal_is_restored_in_every_way_it_ends(watching, number):
    terminal = watching()
    terminal.shows("^! gone")
    assert not terminal.is_restored()
    if isinstance(number, str):
        terminal.type(number)
        terminal.end(EXCEPTION)
    else:
        terminal.process.send_signal(number)
        terminal.end(EXCEPTION, -number)
    assert terminal.is_restored()


def test_the_terminal_is_restored_after_a_crash(plain, device, file):
    terminal = Terminal(plain.path, "poll", device.place, file, "--watch", *PATIENT)
    terminal.shows("^! gone")
    terminal.process.send_signal(signal.SIGSEGV)
    terminal.end(-signal.SIGSEGV)
    assert terminal.is_restored()


def test_a_program_that_is_stopped_gives_the_terminal_back_and_takes_it_again(watching):
    terminal = watching()
    terminal.shows("^! gone")
    state = lambda: open(f"/proc/{terminal.process.pid}/stat").read().rpartition(")")[2].split()[0]
    for _ in range(2):
        terminal.type("\x1a")
        assert wait(lambda: state() == "T") and wait(terminal.is_restored)
        terminal.process.send_signal(signal.SIGCONT)
        assert wait(lambda: not terminal.is_restored())
        terminal.shows("^! gone")
    terminal.type("q")
    terminal.end(EXCEPTION)


def test_a_terminal_that_is_gone_ends_it_even_without_a_signal(mbm, device, file):
    terminal = Terminal("sh", "-c", f"trap '' HUP; exec {mbm.path} poll {device.place} {file} --watch")
    terminal.shows("^! gone")
    terminal.hang_up()
    assert terminal.process.wait(PATIENCE) is not None


def test_a_table_needs_a_terminal(mbm, device, file):
    mbm.fails(WRONG, "--watch: standard output is no terminal. Leave it out to print each round.", "poll", device.place, file, "--watch")
    terminal = Terminal("sh", "-c", f"exec {mbm.path} poll {device.place} {file} --watch </dev/null")
    assert "--watch: standard input is no terminal, so no key would end it." in terminal.end(WRONG)
    for kind in ("dumb", ""):
        terminal = Terminal(mbm.path, "poll", device.place, file, "--watch", env={"TERM": kind})
        assert "--watch: the terminal cannot place text (TERM is dumb or not set)." in terminal.end(WRONG)


def test_colours_are_left_out_for_those_who_want_none(watching):
    terminal = watching(env={"NO_COLOR": "1"})
    terminal.shows("^! gone")
    assert not re.search(r"\x1b\[[0-9;]*3[0-9]m", terminal.screen.all)


# --- the page

@pytest.fixture
def page(mbm, device, write):
    """mbm poll with a page. Its `get` returns head and body of a path."""
    fine = write("fine.yaml", FIELDS[:FIELDS.index("  - {name: gone")])

    def page(*words, path=fine, address="0"):
        program = mbm.begin("poll", device.place, path, "--http", address, *PATIENT, *words)
        program.url = re.search(r"the page is at (http://\S+/)", program.await_line("the page is at"))[1]
        program.port = int(program.url.rstrip("/").rsplit(":", 1)[1])
        program.get = lambda path="/values.json", host="127.0.0.1", method="GET": http(
            program.port, f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
        program.values = lambda: json.loads(program.get()[1])
        return program

    return page


def test_the_page_has_the_values_of_poll_and_what_became_of_them(mbm, page, device, file):
    device.write(0, 200)
    program = page(path=file)
    assert wait(lambda: program.values()["round"] > 1)
    found = program.values()
    assert (found["device"], found["line"], found["interval_ms"]) == ("Wärmepumpe", device.place, 200)
    rows = [json.loads(line) for line in mbm("poll", device.place, file, "--once", "--json", *PATIENT).out.splitlines()]
    same = ("unit", "name", "value", "value_name", "unit_of_measurement", "code", "status", "exception")
    assert [{key: one.get(key) for key in same} for one in found["fields"]] == [{key: one.get(key) for key in same} for one in rows]
    assert [one.get("text") for one in found["fields"]] == ["20 °C", "0", "0 (off)", None]
    flow = lambda: program.values()["fields"][0]
    assert (flow()["min"], flow()["max"], flow().get("changed_ms")) == (20, 20, None)
    device.write(0, 215)
    assert wait(lambda: flow()["value"] == 21.5)
    assert (flow()["min"], flow()["max"], flow()["direction"]) == (20, 21.5, 1) and flow()["changed_ms"] >= 0
    assert "min" not in program.values()["fields"][2]
    units = program.values()["units"]
    assert [one["unit"] for one in units] == [1, 2] and units[0]["failures"] == 0
    assert units[1]["failures"] == units[1]["exceptions"] > 0 and units[1]["reads"] > units[1]["exceptions"]
    assert program.end(signal.SIGINT, EXCEPTION).out == ""


def test_the_page_loads_nothing_of_others_and_may_run_its_own_script_only(page):
    head, body = page().get("/")
    assert head.startswith("HTTP/1.0 200 OK") and "Content-Type: text/html; charset=utf-8" in head
    assert body == open(f"{ROOT}/cli/page.html", encoding="utf-8").read()
    assert not re.findall(r"""(?:src|href|url\(|import)\s*[=(]?\s*["']?(?!data:)(?:https?:)?//""", body) and "innerHTML" not in body
    assert re.search(r"Content-Security-Policy: default-src 'none'; .*connect-src 'self'.*frame-ancestors 'none'", head)
    assert "X-Content-Type-Options: nosniff" in head and "Access-Control" not in head


@pytest.mark.parametrize("host, status", [
    ("127.0.0.1:8080", 200), ("127.0.0.1", 200), ("localhost:1", 200), ("LOCALHOST", 200), ("[::1]:80", 200), ("192.168.0.7:80", 200),
    ("evil.example", 421), ("evil.example:80", 421), ("127.0.0.1.evil.example", 421), ("localhost.evil.example", 421), ("", 421), ("[::1", 421),
    ("[::1]evil", 421), ("127.0.0.1evil", 421), ("x" * 200, 421), ("127.0.0.1\r\nHost: evil.example", 421)])
def test_a_name_that_others_made_does_not_reach_the_page(page, host, status):
    program = page()
    for path in ("/", "/values.json"):
        assert program.get(path, host)[0].startswith(f"HTTP/1.0 {status} ")


def test_a_page_can_only_be_read(page):
    program = page()
    for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS", "get"):
        assert program.get("/values.json", method=method)[0].startswith("HTTP/1.0 405 ")
    for path in ("/metrics", "/page.html", "/../etc/passwd", "//", "/values", "/values.jsonx"):
        assert program.get(path)[0].startswith("HTTP/1.0 404 ")
    assert program.get("/values.json?x=1")[0].startswith("HTTP/1.0 200 ")


def test_slow_silent_and_many_visitors_keep_nobody_out_and_stop_no_round(page):
    program = page()
    assert wait(lambda: program.values()["round"] > 1)
    idle = [socket.create_connection(("127.0.0.1", program.port)) for _ in range(60)]
    for peer in idle[::2]:
        peer.sendall(b"GET /values")
    unread = [socket.create_connection(("127.0.0.1", program.port)) for _ in range(4)]
    for peer in unread:
        peer.sendall(b"GET / HTTP/1.0\r\n\r\n")
    before = program.values()["round"]
    for _ in range(20):
        assert program.get("/")[0].startswith("HTTP/1.0 200 ")
    assert wait(lambda: program.values()["round"] > before + 2)
    # At most 8 connections are kept, and none for longer than 5 s.
    links = lambda: [os.readlink(f"/proc/{program.pid}/fd/{one}") for one in os.listdir(f"/proc/{program.pid}/fd")]
    assert sum(one.startswith("socket:") for one in links()) <= 8 + 2
    assert wait(lambda: sum(one.startswith("socket:") for one in links()) <= 2)
    for peer in idle + unread:
        peer.close()


def test_a_page_escapes_what_a_file_says(page, write):
    path = write("names.yaml", 'fields:\n- {name: "</script><b>\\"x", table: holding, address: 0, type: uint16, unit_of_measurement: "<i>"}\n')
    program = page(path=path)
    assert wait(lambda: program.values()["round"])
    assert [program.values()["fields"][0][key] for key in ("name", "text")] == ['</script><b>"x', "0 <i>"]


def test_a_page_and_rounds_in_json_go_together(page, file):
    program = page("--json", "--rounds", 3, path=file)
    found = program.wait(EXCEPTION)
    assert [json.loads(line)["round"] for line in found.out.splitlines()] == [1] * 4 + [2] * 4 + [3] * 4


def test_a_page_and_a_table_go_together(watching):
    terminal = watching("--http", "0")
    port = int(re.search(r"http://127\.0\.0\.1:(\d+)/", terminal.shows("q end .* http://127.0.0.1:"))[1])
    assert "Wärmepumpe" in http(port, b"GET /values.json HTTP/1.1\r\nHost: localhost\r\n\r\n")[1]


def test_a_page_that_others_can_see_says_so(mbm, device, long):
    for address, wanted in (("0.0.0.0:0", ", and other machines can see it."), ("127.0.0.1:0", "/."), ("[::1]:0", "/.")):
        program = mbm.begin("poll", device.place, long, "--http", address, *PATIENT)
        line = program.await_line("the page is at")
        assert line.endswith(wanted) and f"http://{address[:-2]}:" in line


def test_a_port_of_a_page_that_is_in_use_is_refused(mbm, page, file, device):
    found = mbm("poll", device.place, file, "--http", page().port, *PATIENT)
    assert found.code == LINE and re.search(r"--http \d+: Address already in use", found.error)


def test_a_page_is_at_an_address_of_this_machine_only_unless_another_one_is_named(page):
    program = page()
    assert program.url.startswith("http://127.0.0.1:")
    listening = run("sh", "-c", "cat /proc/net/tcp").out
    assert f"0100007F:{program.port:04X}" in listening and f"00000000:{program.port:04X}" not in listening
