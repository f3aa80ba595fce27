"""Devices that answer with another unit or transaction number, with more data than they were asked for, that need time or a new
connection, that are busy, and that are unit 0: by the name of a line, by options, and by the keys of files. Each is a device that
people have reported; the test's comment says where."""

import signal
import time

import pytest
from peers import DAMAGED, DONE, EXCEPTION, NO_REPLY, READ, WRONG, Client, SerialDevice, TcpDevice, number, sealed, tcp_frame, wait
from services import Broker, Subscriber

FIELDS = "fields:\n- {name: a, table: holding, address: 0, type: uint16}\n"
QUICK = ("--timeout", "300ms")


class Device(TcpDevice):
    """Its registers are their addresses. `number` and `unit` make those of the reply from those of the request, `more` is a
    number of registers beside those that were asked; the first `busy` requests get an exception. It notes when requests came, and how
    many connections there were."""

    def __init__(self, number=None, unit=None, more=0, busy=(), silent=lambda turn: False, late=0.0):
        self.renumber, self.reunit, self.more, self.busy = number, unit, more, list(busy)
        self.silent, self.times, self.turn, self.late, self.connections = silent, [], 0, late, 0
        super().__init__()

    def serve(self, peer):
        self.count = 0
        self.connections += 1
        super().serve(peer)

    def reply(self, head, pdu):
        self.times.append(time.monotonic())
        self.asked.append((head[6], pdu.hex()))
        self.turn += 1
        if self.silent(self.turn):
            return None
        self.count += 1
        transaction = self.renumber(self.count) if self.renumber else int.from_bytes(head[:2], "big")
        time.sleep(self.late)
        return tcp_frame(transaction, head[6] if self.reunit is None else self.reunit, self.answer_to(pdu))

    def answer_to(self, pdu):
        if self.busy:
            return bytes([pdu[0] | 0x80, self.busy.pop(0)])
        if pdu[0] not in (1, 2, 3, 4):
            return pdu[:5]
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        if pdu[0] < 3:
            return bytes([pdu[0], (count + 7) // 8]) + bytes((count + 7) // 8)
        values = [first + i for i in range(count)] + [0xEEEE] * self.more
        return bytes([pdu[0], 2 * len(values)]) + b"".join(value.to_bytes(2, "big") for value in values)


NUMBERS = {"always 0": lambda count: 0, "a count of its own": lambda count: 0x7000 + count, "always the same": lambda count: 0x1234}


# --- another transaction number (pymodbus 2709, 2831 and PR 2844; sunsynk 680: the request's number and 1; modbus-esp8266 109),
# another unit (pymodbus 2571 and 2777, FluentModbus 84, Scada-LTS 2799)

@pytest.mark.parametrize("kind", NUMBERS)
def test_a_reply_with_another_transaction_number_is_named_and_taken_if_asked(mbm, kind):
    device = Device(NUMBERS[kind])
    mbm("read", device.line, 7, *QUICK)  # The first number may be right by chance.
    code, out, error = mbm("read", device.line, 7, "--every", "10ms", "--times", 2, "--csv", *QUICK)
    theirs = "4660" if kind == "always the same" else "0" if kind == "always 0" else "2867"
    assert code == NO_REPLY and f"a reply with transaction number {theirs}" in out and "--accept transaction takes it" in out, out + error
    for words in (("--accept", "transaction"), ("--accept", "unit,transaction")):
        code, out, error = mbm("read", device.line, 5, 3, *words)
        assert (code, out) == (DONE, "    5  5\n    6  6\n    7  7\n"), error
    assert mbm("read", device.line + "?accept=transaction", 9, "--every", "10ms", "--times", 5, "--csv").out.count(",success,9") == 5


@pytest.mark.parametrize("unit", [0, 1, 255])
def test_a_reply_of_another_unit_is_named_and_taken_if_asked(mbm, unit):
    device = Device(unit=unit)
    code, _, error = mbm("read", device.line, 7, "--unit", 17, *QUICK)
    assert code == NO_REPLY and f"a reply of unit {unit} came; --accept unit takes it" in error, error
    assert mbm("read", device.line + "?accept=unit", 7, "--unit", 17).out == "    7  7\n"
    assert mbm("read", device.line, 7, "--unit", 17, "--accept", "unit", "--in-flight", 4).code == DONE


def test_every_command_takes_them(mbm, write):
    device = Device(NUMBERS["always the same"], unit=0)
    line = device.line + "?accept=unit,transaction"
    assert mbm("write", line, 3, 42, "--unit", 9).code == DONE
    assert mbm("call", line, "03 00 05 00 01", "--unit", 9).out.startswith("03 02 00 05")
    assert "1 of 1 requests were answered" in mbm("scan", line, "--units", 9).error
    file = write("d.yaml", "accept: [unit, transaction]\nunit: 9\n" + FIELDS)
    assert mbm("poll", device.line, file, "--once").code == DONE
    listen = mbm.begin("gateway", "tcp://127.0.0.1:0", line, "1-20").last_word()
    assert Client(listen).ask(9, bytes([3, 0, 5, 0, 1])) == number(5)


def test_a_late_reply_with_another_number_is_no_wrong_value(mbm):
    """The device answers 0.7 s late, and the timeout is 0.3 s: each request of another address would get the reply before."""
    device = Device(NUMBERS["always 0"], late=0.7)
    for address in range(3):
        assert mbm("read", device.line, address, "--accept", "transaction", *QUICK).out == ""
    program = mbm.begin("read", device.line, 7, 130, "--accept", "transaction", "--every", "50ms", "--times", 3, "--csv", *QUICK)
    out = program.wait().out
    assert out.count("no complete reply in time") == 3, out
    # Every request had a connection of its own.
    assert device.connections >= 4
    device.late = 0
    assert mbm("read", device.line, 7, "--accept", "transaction").out == "    7  7\n"


def test_replies_without_close_are_waited_for(mbm):
    """With close=never the request after a timeout waits for the late reply, and gets its own."""
    device = Device(NUMBERS["always 0"], silent=lambda turn: turn == 2)
    out = mbm("read", device.line + "?accept=transaction&close=never", 7, "--every", "50ms", "--times", 4, "--csv", *QUICK).out
    assert [row.split(",")[2] for row in out.splitlines()[1:]] == ["success", "no complete reply in time", "success", "success"], out
    assert device.connections == 1


# --- lenient: meters that send four bytes for one register (esphome, telegraf)

def four_bytes(frame):
    return sealed(frame[:1] + bytes([3, 4, 0, frame[3], 0xEE, 0xEE]))


@pytest.fixture(params=["tcp", "rtu"])
def generous(request, folder):
    return Device(more=1) if request.param == "tcp" else SerialDevice(folder, four_bytes)


def test_more_data_than_asked_are_taken_if_asked(mbm, write, generous):
    assert mbm("read", generous.line, 7).code == DAMAGED
    assert mbm("read", generous.line, 7, "--lenient").out == "    7  7\n"
    lenient = generous.line + ("&" if "?" in generous.line else "?") + "lenient=yes"
    assert mbm("read", lenient, 7).out == "    7  7\n"
    assert mbm("call", lenient, "03 00 05 00 01").out.startswith("03 02 00 05\n")
    assert mbm("poll", generous.line, write("d.yaml", "lenient: yes\n" + FIELDS), "--once").code == DONE
    assert mbm("poll", generous.line, write("d.yaml", "lenient: true\n" + FIELDS), "--once").code == DONE
    assert mbm("poll", generous.line, write("d.yaml", "lenient: false\n" + FIELDS), "--once").code == DAMAGED
    listen = mbm.begin("gateway", "tcp://127.0.0.1:0", lenient, "1-20").last_word()
    assert Client(listen).ask(9, bytes([3, 0, 5, 0, 1])) == number(5)


def test_less_data_than_asked_is_refused_in_any_case(mbm, write):
    line = TcpDevice(lambda pdu: number(7)).line
    found = mbm("read", line, 7, 2, "--lenient", *QUICK)
    assert found.code == DAMAGED and found.out == "" and "does not answer the request" in found.error, found
    file = write("d.yaml", "lenient: yes\nfields: [{name: a, table: holding, address: 0, type: uint16, count: 2}]\n")
    assert mbm("poll", line, file, "--once", *QUICK).code == DAMAGED
    # The file describes what the device sends.
    assert mbm("poll", line, write("d.yaml", FIELDS), "--once", *QUICK).code == DONE


@pytest.mark.parametrize("line, key, sentence", [
    ("rtu:", "accept: unit", "accept has no effect here: it is for frames of Modbus TCP, in others nothing but the unit tells whose a reply is."),
    ("rtu:", "accept: [unit, transaction]", "accept has no effect here"),
    ("ascii:/dev/null", "lenient: yes", "lenient has no effect in ASCII frames."),
    ("udp://127.0.0.1:1", "delay: 1s", "delay has no effect on udp://, which has no connection."),
    ("udp://127.0.0.1:1", "close: round", "close has no effect on udp://, which has no connection."),
])
def test_a_key_of_the_device_file_that_the_line_cannot_have_is_named(mbm, write, folder, line, key, sentence):
    place = SerialDevice(folder).line if line == "rtu:" else line
    file = write("d.yaml", f"{key}\n{FIELDS}")
    found = mbm("poll", place, file, "--once", *QUICK)
    assert f"mbm poll: {file}: {sentence}" in found.error, found.error
    assert line != "rtu:" or found.code == DONE
    assert "no effect" not in mbm("poll", place, file, "--once", "-q", *QUICK).error
    assert f"{file}: {sentence.rstrip('.')}" in mbm("bridge", "--check", place, file).error


def test_what_is_the_default_is_not_named(mbm, write, folder):
    file = write("d.yaml", f"lenient: no\ndelay: 0s\nclose: never\n{FIELDS}")
    assert "no effect" not in mbm("poll", "udp://127.0.0.1:1", file, "--once", *QUICK).error


# --- pace: devices that answer nothing at first (telegraf 11919), that need a pause (HA 9451 and 50011, telegraf 9253), that are busy

def test_nothing_is_sent_during_the_delay_after_connecting(mbm, write):
    place = mbm.serve("tcp://127.0.0.1:0", "--echo", "--fault", "needs-delay=500ms")
    assert mbm("read", place, 7, *QUICK).code == NO_REPLY
    for words in ((place, 7, "--delay", "800ms"), (place + "?delay=800ms", 7)):
        assert mbm("read", *words, "--timeout", "2s").out == "    7  0\n"
    assert mbm("poll", place, write("d.yaml", "delay: 800ms\n" + FIELDS), "--once").code == DONE


@pytest.mark.parametrize("key", ["message_wait: 80ms", "message_wait_milliseconds: 80"])
def test_a_pause_is_kept_between_requests(mbm, write, key):
    device = Device()
    fields = "fields:\n" + "".join(f"- {{name: f{i}, table: holding, address: {i * 200}, type: uint16}}\n" for i in range(5))
    assert mbm("poll", device.line, write("d.yaml", key + "\n" + fields), "--once").code == DONE
    pauses = [after - before for before, after in zip(device.times, device.times[1:])]
    assert len(pauses) == 4 and min(pauses) > 0.079, pauses


def test_a_pause_is_kept_on_a_serial_line(mbm, serial):
    times = []
    answer = serial.answer
    serial.answer = lambda frame: times.append(time.monotonic()) or answer(frame)
    assert mbm("read", serial.line + "&message_wait=80ms", 0, 400).code == DONE
    pauses = [after - before for before, after in zip(times, times[1:])]
    assert len(pauses) == 3 and min(pauses) > 0.079, pauses


def test_a_busy_device_is_asked_again(mbm, write):
    for words in (("--busy-retries", 2), ("--busy-retries", 5, "--busy-wait", "10ms")):
        assert mbm("read", Device(busy=[6, 5]).line, 7, *words).out == "    7  7\n"
    assert mbm("read", Device(busy=[6, 6, 6]).line, 7, "--busy-retries", 2).code == EXCEPTION
    assert mbm("read", Device(busy=[6, 6]).line + "?busy_retries=2&busy_wait=1ms", 7).out == "    7  7\n"
    # Exception 05 says that a write is being carried out: it is not sent again.
    device = Device(busy=[5])
    assert mbm("write", device.line, 7, 1, "--busy-retries", 2).code == EXCEPTION and len(device.asked) == 1
    file = write("d.yaml", "busy_retries: 3\nbusy_wait: 10ms\nretries: 1\n" + FIELDS)
    device = Device(busy=[6, 6], silent=lambda turn: turn == 1)
    assert mbm("poll", device.line, file, "--once", *QUICK).code == DONE and len(device.asked) == 4


@pytest.mark.parametrize("where", ["name", "option", "device", "gateway", "gateway line"])
def test_a_reply_may_take_as_long_as_timeout_says(mbm, write, where):
    """Longer than the second of the default. Home Assistant's hub waits five."""
    device = Device(late=1.3)
    if where.startswith("gateway"):
        head, line = ("timeout: 20s\n", "") if where == "gateway" else ("timeout: 100ms\n", ", timeout: 20s")
        file = write("g.yaml", f"listen: tcp://127.0.0.1:0\n{head}lines:\n- {{line: '{device.line}', units: 9{line}}}\n")
        assert Client(mbm.begin("gateway", file).last_word()).ask(9, bytes([3, 0, 5, 0, 1])) == number(5)
        return
    line = device.line + ("?timeout=20s" if where == "name" else "")
    options = ("--timeout", "20s") if where == "option" else ()
    if where != "device":
        assert mbm("read", line, 7, *options).out == "    7  7\n"
    file = write("d.yaml", ("timeout: 20s\n" if where == "device" else "") + FIELDS)
    assert mbm("poll", line, file, "--once", *options).code == DONE


def test_a_failure_names_the_time_that_was_in_force(mbm, write):
    device = Device(silent=lambda turn: True)
    line = device.line + "?timeout=30ms"
    assert "within 30ms" in mbm("read", line, 7, "--timeout", "20s").error
    assert "within 40ms" in mbm("poll", device.line, write("d.yaml", "timeout: 40ms\n" + FIELDS), "--once").error
    assert "within 50ms" in mbm("poll", device.line, write("d.yaml", "timeout: 20s\n" + FIELDS), "--once", "--timeout", "50ms").error


# --- connections: few places (telegraf 8225), closed after each answer (HA 101982, evcc 14275), deaf until a new one (evcc 23395)

def test_a_connection_is_closed_after_each_round(mbm, write):
    device = Device()
    program = mbm.begin("read", device.line + "?close=round", 7, 200, "--every", "200ms", "--times", 4, "--csv")
    assert program.wait(DONE).out.count(",success,") == 4
    assert device.connections == 4 and len(device.asked) == 8
    device = Device()
    file = write("d.yaml", "close: round\ninterval: 200ms\n" + FIELDS)
    assert mbm("poll", device.line, file, "--rounds", 3).code == DONE
    # The last round may end before its read is answered.
    assert len(device.asked) >= 2 and device.connections >= len(device.asked)


def test_a_connection_is_closed_after_an_error(mbm):
    """After each two answers the device is deaf until it is connected to anew."""
    device = Device()
    device.silent = lambda turn: device.count >= 2
    out = mbm("read", device.line, 7, "--every", "50ms", "--times", 6, "--csv", "--close", "error", "--replace-after", 0, *QUICK).out
    rows = [row.split(",")[2] for row in out.splitlines()[1:]]
    assert rows == ["success", "success", "no complete reply in time"] * 2, rows
    device = Device()
    device.silent = lambda turn: device.count >= 2
    out = mbm("read", device.line, 7, "--every", "50ms", "--times", 6, "--csv", "--close", "error", "--retries", 1, *QUICK).out
    assert out.count(",success,7") == 6, out


def test_a_device_that_closes_after_each_answer_costs_no_request(mbm):
    for close in ("never", "round", "error"):
        place = mbm.serve("tcp://127.0.0.1:0", "--echo", "--fault", "close-after=1")
        out = mbm("read", place, 7, "--every", "100ms", "--times", 4, "--csv", "--close", close).out
        assert out.count(",success,0") == 4, out


# --- the same between a broker and a device

SHY = "unit=0 transaction=count needs-delay=300ms needs-message-wait=50ms exception=6@1 deaf@3".split()
SHY_KEYS = ["accept: [unit, transaction]", "delay: 600ms", "message_wait: 80ms", "busy_retries: 1", "busy_wait: 10ms", "retries: 1"]
SHY_FIELDS = ("unit: 9\ninterval: 200ms\nfields:\n- {name: a, table: holding, address: 0, type: uint16, value: 7, access: read-write}\n"
              "- {name: b, table: holding, address: 300, type: uint16, value: 8, access: read-write}\n")


@pytest.mark.parametrize("where", ["device", "line", "head", "name", "nowhere"])
def test_a_bridge_reaches_a_device_as_its_keys_say(mbm, folder, write, where):
    """The keys are in the device file, in the file of the bridge at the line or at its head, or in the name of the line."""
    place = mbm.serve("tcp://127.0.0.1:0", write("served.yaml", SHY_FIELDS), *(word for fault in SHY for word in ("--fault", fault)))
    broker = Broker(folder).come()
    device = write("d.yaml", "".join(f"{key}\n" for key in SHY_KEYS if where == "device") + SHY_FIELDS)
    keys = "".join(f", {key}" for key in SHY_KEYS if where == "line")
    if where == "name":
        place += "?accept=unit,transaction&delay=600ms&message_wait=80ms&busy_retries=1&busy_wait=10ms&retries=1"
    head = "".join(f"{key}\n" for key in SHY_KEYS if where == "head")
    file = write("b.yaml", f"broker: {broker.place}\ntopic: hall\n{head}lines:\n- {{line: '{place}', topic: shy, file: {device}{keys}}}\n")
    subscriber = Subscriber(broker)
    mbm.begin("bridge", file, "--timeout", "1s")
    if where == "nowhere":
        subscriber.expect_last("hall/shy/unit/9/status", "offline")
        assert not {7, 8} & {subscriber.value("hall/shy/a"), subscriber.value("hall/shy/b")}
        return
    subscriber.expect_value("hall/shy/a", 7)
    subscriber.expect_value("hall/shy/b", 8)
    subscriber.expect_last("hall/shy/unit/9/status", "online")
    subscriber.expect_result("hall/shy/b", "40", "success")
    subscriber.expect_value("hall/shy/b", 40)


@pytest.mark.parametrize("where", ["device", "line", "head"])
def test_a_bridge_waits_as_long_as_timeout_says_and_reads_it_again(mbm, folder, write, where):
    """The device answers after 0.4 s: not within 100 ms, but after SIGHUP, with another timeout, it does."""
    device, broker = Device(late=0.4), Broker(folder).come()
    subscriber = Subscriber(broker)

    def files(timeout):
        key = {where: f"timeout: {timeout}"}
        fields = write("d.yaml", key.get("device", "") + "\nunit: 9\ninterval: 100ms\n" + FIELDS)
        line = f"{{line: '{device.line}', topic: slow, file: {fields}, {key.get('line', '')}}}"
        return write("b.yaml", f"broker: {broker.place}\ntopic: hall\n{key.get('head', '')}\nlines:\n- {line}\n")

    # An option counts before the device file, and after the file of the bridge.
    bridge = mbm.begin("bridge", files("100ms"), *(() if where == "device" else ("--timeout", "20s")))
    subscriber.expect_last("hall/slow/unit/9/status", "offline")
    files("20s")
    bridge.process.send_signal(signal.SIGHUP)
    subscriber.expect_last("hall/slow/unit/9/status", "online")
    subscriber.expect_value("hall/slow/a", 0)


def test_a_bridge_closes_the_connection_after_each_round(mbm, folder, write):
    """close: round leaves the only place of a device to another master."""
    place = mbm.serve("tcp://127.0.0.1:0", write("served.yaml", SHY_FIELDS), "--fault", "connections=1")
    broker = Broker(folder).come()
    device = write("d.yaml", "close: round\n" + SHY_FIELDS.replace("200ms", "1s"))
    subscriber = Subscriber(broker)
    mbm.begin("bridge", "-b", broker.place, "-t", "hall", place, device)
    subscriber.expect_value("hall/b", 8)
    assert wait(lambda: mbm("write", place, 0, 33, "--unit", 9, "--timeout", "300ms").code == DONE)
    subscriber.expect_value("hall/a", 33)


# --- unit 0 (inverters that have no other)

def test_unit_0_is_a_unit_of_modbus_tcp(mbm, write):
    device = Device()
    assert mbm("read", device.line, 7, "--unit", "0").out == "    7  7\n"
    assert mbm("read", device.line, 7, "--unit", "0,3").code == DONE
    assert mbm("write", device.line, 7, 1, "--unit", "0").code == DONE
    assert mbm("call", device.line, "03 00 05 00 01", "--unit", "0").out.startswith("03 02 00 05\n")
    assert "1 of 1 requests were answered" in mbm("scan", device.line, "--units", "0").error
    assert mbm("poll", device.line, write("d.yaml", "unit: 0\n" + FIELDS), "--once", "--json").code == DONE
    assert {unit for unit, _ in device.asked} == {0, 3}


def test_a_read_of_unit_0_on_a_serial_line_says_what_it_is(mbm, write, serial):
    sentence = "on a serial line it is a broadcast, which no device answers"
    mbm.fails(WRONG, sentence, "read", serial.line, 7, "--unit", 0)
    mbm.fails(WRONG, sentence, "scan", serial.line, "--units", "0-3")
    file = write("d.yaml", "unit: 0\n" + FIELDS)
    for command in ("poll", "bridge"):
        mbm.fails(WRONG, f"{file}:3: unit 0 of a is read in frames of Modbus TCP only: {sentence}", command, serial.line, file)
    mbm.fails(WRONG, sentence, "serve", "pty:", file)
    mbm.fails(WRONG, sentence, "serve", "pty:", "--random", "--unit", "0")


def test_a_device_with_unit_0_is_served_over_tcp(mbm, write):
    file = write("d.yaml", "unit: 0\n" + FIELDS.replace("uint16}", "uint16, value: 42}"))
    program = mbm.begin("serve", "tcp://127.0.0.1:0", file)
    line = program.await_output("^serving unit 0 on").split()[-1]
    assert mbm("read", line, 0, "--unit", 0).out == "    0  42\n"
    assert mbm("poll", line, file, "--once").code == DONE
    line = mbm.serve("tcp://127.0.0.1:0", "--random", "--unit", "0,7")
    assert mbm("read", line, 0, "--unit", "0,7").code == DONE


# --- what is refused

@pytest.mark.parametrize("key, sentence", [
    ("accept: everything", 'accept: "everything" is not one of unit and transaction'),
    ("accept: [unit, unit]", 'accept: "unit" is there twice'),
    ("accept: []", "accept"),
    ("lenient: maybe", 'lenient: "maybe" is not one of no, yes, false and true'),
    ("delay: 70s", "delay"),
    ("delay: 5", "delay"),
    ("message_wait: 30", "message_wait"),
    ("message_wait_milliseconds: 30ms", "message_wait_milliseconds"),
    ("message_wait_milliseconds: 70000", "message_wait_milliseconds"),
    ("message_wait: 30ms\nmessage_wait_milliseconds: 30", "message_wait_milliseconds and message_wait are both there"),
    ("close: sometimes", 'close: "sometimes" is not one of never, round and error'),
    ("close: [never, round]", "close: never goes with no other word"),
    ("retries: 255", "retries"),
    ("busy_retries: -1", "busy_retries"),
    ("busy_wait: 10ms", "busy_wait needs busy_retries"),
    ("timeout: 5", 'timeout: "5" is not a time'),
    ("timeout: 0s", 'timeout: "0s" is out of range: from 1ms to 1000s is allowed'),
    ("timeout: 1001s", 'timeout: "1001s" is out of range'),
    ("timeout: [1s]", "timeout"),
    ("unit: 256", "unit"),
])
def test_a_wrong_value_is_refused_with_file_and_line(plain, write, device, key, sentence):
    file = write("d.yaml", key + "\n" + FIELDS)
    line = 2 if "\n" in key else 1
    plain.fails(WRONG, f"{file}:{line}: {sentence}", "poll", device.line, file)
    assert not device.asked


def test_keys_of_the_files_of_gateway_and_bridge_are_refused_with_their_line(plain, write):
    device = write("d.yaml", FIELDS)
    for text, sentence in [
        ("listen: tcp://:0\nlines:\n- {line: 'tcp://h', units: 1, accept: foo}\n", 'g.yaml:3: accept: "foo"'),
        ("listen: tcp://:0\nlines:\n- {line: 'rtu:/dev/x', units: 1, accept: unit}\n", "g.yaml:3: accept is for tcp://"),
        ("listen: tcp://:0\nlines:\n- {line: 'tcp://h', units: 1, accept: transaction, in_flight: 2}\n",
         "g.yaml:3: accept transaction needs one request in flight: in_flight is 2"),
        ("listen: tcp://:0\ntimeout: 1\nlines:\n- {line: 'tcp://h', units: 1}\n", 'g.yaml:2: timeout: "1" is not a time'),
        ("listen: tcp://:0\nlines:\n- {line: 'tcp://h', units: 1, timeout: 0ms}\n", 'g.yaml:3: timeout: "0ms" is out of range'),
        ("listen: tcp://:0\nmessage_wait: 1\nlines:\n- {line: 'tcp://h', units: 1}\n", "g.yaml:2: message_wait"),
    ]:
        plain.fails(WRONG, sentence, "gateway", write("g.yaml", text), "--check")
    for text, sentence in [
        (f"lines:\n- {{line: 'tcp://h', file: {device}, close: often}}\n", 'b.yaml:2: close: "often"'),
        (f"lines:\n- {{line: 'rtu:/dev/x', file: {device}, accept: unit}}\n", "b.yaml:2: accept is for tcp://"),
        (f"lines:\n- {{line: 'tcp://h', file: {device}, timeout: 1}}\n", 'b.yaml:2: timeout: "1" is not a time'),
        (f"timeout: 1h\nlines:\n- {{line: 'tcp://h', file: {device}}}\n", 'b.yaml:1: timeout: "1h" is out of range: from 1ms to 1000s'),
        (f"busy_wait: 1s\nlines:\n- {{line: 'tcp://h', file: {device}}}\n", "b.yaml:1: busy_wait needs busy_retries"),
        (f"lines:\n- {{line: 'udp://h', file: {device}, delay: 1s}}\n", "b.yaml:2: delay is not for udp://"),
    ]:
        plain.fails(WRONG, sentence, "bridge", write("b.yaml", text), "--check")


def test_what_contradicts_itself_is_refused(plain, write, device):
    file = write("d.yaml", "accept: transaction\n" + FIELDS)
    plain.fails(WRONG, f"{file}: accept transaction needs one request in flight: in_flight is 4", "poll", device.line, file, "--in-flight", 4)
    plain.fails(WRONG, "message_wait needs one request in flight", "poll", device.line, write("e.yaml", "message_wait: 1ms\n" + FIELDS), "--in-flight", 2)
    plain.fails(WRONG, "--lenient is not for ascii:", "read", "ascii:/dev/null", 1, "--lenient")
    plain.fails(WRONG, '"accept" is unknown', "serve", "tcp://:0?accept=unit", "--random")


def test_the_name_of_the_line_counts_before_an_option_and_that_before_the_file(mbm, write):
    device = Device(NUMBERS["always the same"])
    file = write("d.yaml", "accept: transaction\ndelay: 60s\n" + FIELDS)
    assert mbm("poll", device.line + "?delay=0s", file, "--once", "--delay", "60s").code == DONE
    assert mbm("poll", device.line, file, "--once", "--delay", "0s").code == DONE
    assert mbm("poll", device.line, file, "--once", "--delay", "0s", "--accept", "unit", *QUICK).code == NO_REPLY
