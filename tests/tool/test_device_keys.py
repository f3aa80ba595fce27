"""Each key of a device file: what mbm reads and writes with it on a server of libmodbus, on one of pymodbus, and on mbm serve with
the same file. device_rows.py has the keys."""

import json
import threading
import time

import peers
import pytest
from device_rows import NOT_ON_THE_WIRE, ROWS
from peers import DONE, WRONG, Client, TcpDevice, pymodbus, tcp_frame
from services import Broker, Subscriber


class Device(TcpDevice):
    """Stands before a server: notes requests and their times, and answers with the manner of a row. `unit` is that of the server,
    if it has one alone, and `own` that whose registers the test looks at."""

    def __init__(self, port, row, unit=None):
        self.server, self.lock, self.unit = Client(port), threading.Lock(), unit
        self.own = 17 if 17 in row.units else min(row.units)
        self.manner = row.manner and row.manner()
        self.opened, self.begun, self.ended = [], [], []
        super().__init__()
        # No program has connected before.
        self.started = time.monotonic()

    def serve(self, peer):
        self.opened.append(time.monotonic())
        super().serve(peer)

    def ask(self, pdu, unit=None):
        with self.lock:
            return self.server.ask(self.unit or (self.own if unit is None else unit), pdu)

    def reply(self, head, pdu):
        self.begun.append(time.monotonic())
        self.asked.append((head[6], pdu.hex()))
        transaction, reply = int.from_bytes(head[:2], "big"), self.ask(pdu, head[6])
        self.ended.append(time.monotonic())
        return self.manner.reply(transaction, head[6], reply) if self.manner else tcp_frame(transaction, head[6], reply)

    # What a test looks at and sets, past the row's manner.

    def set(self, held, coils):
        pairs = lambda values: b"".join(value.to_bytes(2, "big") for value in values)
        for address, values in held.items():
            at = pairs([address, len(values)])
            assert self.ask(b"\x10" + at + bytes([2 * len(values)]) + pairs(values))[0] == 0x10
        for address, values in coils.items():
            for i, value in enumerate(values):
                assert self.ask(b"\x05" + pairs([address + i, 0xFF00 * value]))[0] == 5

    def get(self, address, count, is_coils=False):
        found = []
        for at in range(address, address + count):
            reply = self.ask(bytes([1 if is_coils else 3]) + at.to_bytes(2, "big") + b"\0\1")
            found.append(reply[2] & 1 if is_coils else int.from_bytes(reply[2:], "big"))
        return found


@pytest.fixture(scope="module", params=["libmodbus", "pymodbus", "mbm"])
def port(request):
    """Returns the port of a server for a row."""
    if request.param == "mbm":
        return None
    return int(peers.libmodbus()[2] if request.param == "libmodbus" else pymodbus("tcp", "--port", "0").ready[0])


def begin(port, row, mbm, path):
    """A server that has the row's registers."""
    if port:
        device = Device(port, row, 17)
        device.set(row.held, row.coils)
        return device
    # mbm serve has them from the values of the file.
    return Device(mbm.serve("tcp://127.0.0.1:0", path).rsplit(":", 1)[1], row)


@pytest.fixture(scope="module")
def broker(tmp_path_factory):
    return Broker(tmp_path_factory.mktemp("broker")).come()


def of_each_row(rows):
    return pytest.mark.parametrize("row", rows, ids=[row.name for row in rows])


@of_each_row(ROWS)
def test_a_key_is_read(mbm, write, port, row):
    path = write("device.yaml", row.text)
    device = begin(port, row, mbm, path)
    for address, values in row.held.items():
        assert device.get(address, len(values)) == values
    for address, values in row.coils.items():
        assert device.get(address, len(values), is_coils=True) == values
    found = mbm("poll", device.line, path, "--rounds", row.rounds, "--json", "-q", *row.options)
    assert found.code == DONE, found
    rows = [json.loads(line) for line in found.out.splitlines()]
    assert {one["name"]: one["value"] for one in rows} == row.values
    assert {one["status"] for one in rows} == row.statuses
    assert {unit for unit, _ in device.asked} == row.units
    if row.reads:
        assert sorted(device.requests()) == sorted(row.reads)
    if row.check:
        row.check(device)


@of_each_row([row for row in ROWS if row.writes])
def test_a_key_is_written(plain, write, port, broker, row):
    path = write("device.yaml", row.text)
    device = begin(port, row, plain, path)
    topic = f"row{ROWS.index(row)}"
    plain.begin("bridge", "-b", broker.place, "-t", topic, "-q", *row.options, device.line, path)
    subscriber = Subscriber(broker)
    # It has subscribed to the topics of writes by then.
    subscriber.expect_last(f"{topic}/status", "online")
    for name, value in row.values.items():
        subscriber.expect_value(f"{topic}/{name.replace(' ', '_')}", value)
    for name, payload, result, *wanted in row.writes:
        since = len(device.asked)
        subscriber.expect_result(f"{topic}/{name}", payload, result if not wanted else "success")
        if not wanted:
            continue
        address, values = wanted
        function = result
        written = [pdu for _, pdu in device.asked[since:] if int(pdu[:2], 16) > 4]
        assert written and {(int(pdu[:2], 16), int(pdu[2:6], 16)) for pdu in written} == {(function, address)}, written
        # mbm serve does not show a field with access write.
        if port or name.replace("_", " ") in row.values:
            assert device.get(address, len(values), is_coils=function in (5, 15)) == values


def keys_that_mbm_knows(plain, write, text):
    """The keys that the refusal of an unknown one names."""
    found = plain("poll", "tcp://127.0.0.1:1", write("wrong.yaml", text))
    assert found.code == WRONG, found
    return set(found.error.split(" is not one of ")[1].rstrip(".\n").replace(" and ", ", ").split(", "))


def test_each_key_has_a_row(plain, write):
    known = keys_that_mbm_knows(plain, write, "unknown: 1\n") | keys_that_mbm_knows(plain, write, "fields: [{unknown: 1}]\n")
    assert {key for row in ROWS for key in row.keys.split()} == known - NOT_ON_THE_WIRE
    assert NOT_ON_THE_WIRE <= known
