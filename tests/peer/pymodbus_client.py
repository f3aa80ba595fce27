"""A pymodbus client that asks a server of ours for everything.

    pymodbus_client.py FRAMING PLACE

FRAMING is rtu, ascii, tcp or rtu-over-tcp, PLACE a tty or a port. The server is
c-tests/serve.c; what it holds is told in c-tests/support/served.h. Prints how many
answers were right, or the first that was not, and ends with its input. Around a
request without an answer it says `silent` and `sent`, and waits for a line.
"""

import sys

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.file_message import FileRecord

UNIT, BASE, REGISTERS, BITS, HOLE, REFUSED = 17, 100, 300, 2400, 250, 260
FRAMERS = {
    "rtu": FramerType.RTU,
    "ascii": FramerType.ASCII,
    "tcp": FramerType.SOCKET,
    "rtu-over-tcp": FramerType.RTU,
}


class Custom(ModbusPDU):
    """Function 41 of the user, which brings its data back: one byte that counts,
    and what it counts."""

    function_code = 0x41
    rtu_byte_count_pos = 2

    def __init__(self, data=b"", dev_id=UNIT, transaction_id=0):
        super().__init__(dev_id=dev_id, transaction_id=transaction_id)
        self.data = data

    def encode(self):
        return bytes([len(self.data)]) + self.data

    def decode(self, data):
        self.data = data[1 : 1 + data[0]]


class Unknown(Custom):
    """A function that nobody serves."""

    function_code = 0x42


def word(address):
    return (address * 40503 + 0x1234) & 0xFFFF


def bit(address):
    return bool(word(address) >> 7 & 1)


class Asker:
    """The client, and how many answers were right."""

    def __init__(self, client):
        self.client = client
        self.right = 0

    def answer(self, name, *args, **named):
        answer = getattr(self.client, name)(*args, device_id=UNIT, **named)
        assert not answer.isError(), f"{name} {args} {named}: {answer}"
        return answer

    def expect(self, fields, name, *args, **named):
        """The answer has these fields."""
        answer = self.answer(name, *args, **named)
        for field, value in fields.items():
            found = getattr(answer, field)
            assert found == value, f"{name} {args} {named}: {field} {found}, not {value}"
        self.right += 1

    def refuse(self, code, name, *args, **named):
        """The answer is this exception."""
        answer = getattr(self.client, name)(*args, device_id=UNIT, **named)
        found = getattr(answer, "exception_code", None)
        assert found == code, f"{name} {args} {named}: {answer}, not exception {code}"
        self.right += 1

    def silent(self, name, *args, **named):
        """There is to be no answer; whoever started this sees that it was heard."""
        self.say("silent")
        getattr(self.client, name)(*args, device_id=UNIT, no_response_expected=True, **named)
        self.say("sent")
        self.right += 1

    def say(self, text):
        """Goes on when told to."""
        print(text, flush=True)
        sys.stdin.readline()


def tables(ask):
    for count in (1, 2, 63, 125):
        words = [word(BASE + 3 + cell) for cell in range(count)]
        ask.expect({"registers": words}, "read_holding_registers", BASE + 3, count=count)
        inputs = [word(BASE + 5 + cell) ^ 0xFFFF for cell in range(count)]
        ask.expect({"registers": inputs}, "read_input_registers", BASE + 5, count=count)
    for count in (1, 7, 8, 9, 1999, 2000):
        for name, start, turned in (("read_coils", 11, False), ("read_discrete_inputs", 1, True)):
            answer = ask.answer(name, BASE + start, count=count)
            cells = [bit(BASE + start + cell) != turned for cell in range(count)]
            # The peer tells whole bytes; what is beyond is 0.
            assert answer.bits[:count] == cells, f"{name} {count}"
            assert not any(answer.bits[count:]), f"{name} {count}"
            ask.right += 1
    last, last_bit = BASE + REGISTERS - 1, BASE + BITS - 1
    ask.expect({"registers": [word(last)]}, "read_holding_registers", last)
    ask.refuse(2, "read_holding_registers", last, count=2)
    ask.refuse(2, "read_holding_registers", BASE - 1)
    ask.refuse(2, "read_input_registers", last + 1)
    ask.refuse(2, "read_holding_registers", HOLE - 1, count=2)
    ask.refuse(2, "read_coils", last_bit, count=2)
    ask.refuse(2, "read_discrete_inputs", BASE - 1)


def writes(ask):
    ask.expect({"address": BASE, "registers": [0xABCD]}, "write_register", BASE, 0xABCD)
    ask.expect({"registers": [0xABCD]}, "read_holding_registers", BASE)
    for value in (True, False):
        ask.expect({"address": BASE, "bits": [value]}, "write_coil", BASE, value)
        assert ask.answer("read_coils", BASE).bits[0] is value
    words = [(cell * 257) & 0xFFFF for cell in range(123)]
    ask.expect({"address": BASE + 20, "count": 123}, "write_registers", BASE + 20, words)
    ask.expect({"registers": words}, "read_holding_registers", BASE + 20, count=123)
    cells = [cell % 3 == 0 for cell in range(1968)]
    ask.expect({"address": BASE + 43, "count": 1968}, "write_coils", BASE + 43, cells)
    assert ask.answer("read_coils", BASE + 43, count=1968).bits == cells
    # One cell on either side is as it was.
    for cell in (BASE + 42, BASE + 43 + 1968):
        assert ask.answer("read_coils", cell).bits[0] is bit(cell)
    ask.expect({}, "write_register", BASE + 1, 0x0012)
    ask.expect(
        {"address": BASE + 1, "and_mask": 0xF2, "or_mask": 0x25},
        "mask_write_register",
        address=BASE + 1,
        and_mask=0xF2,
        or_mask=0x25,
    )
    ask.expect({"registers": [0x0017]}, "read_holding_registers", BASE + 1)
    words = [cell + 7 for cell in range(121)]
    ask.expect(
        {"registers": [0x0017, *words, word(BASE + 123), word(BASE + 124), word(BASE + 125)][:122]},
        "readwrite_registers",
        read_address=BASE + 1,
        read_count=122,
        write_address=BASE + 2,
        values=words,
    )
    # Refused by the hook of the server, and nothing of it is written.
    ask.refuse(3, "write_registers", REFUSED - 1, [1, 0xBEEF, 3])
    ask.expect(
        {"registers": [word(REFUSED + cell) for cell in (-1, 0, 1)]},
        "read_holding_registers",
        REFUSED - 1,
        count=3,
    )
    ask.refuse(2, "write_register", HOLE, 1)
    ask.refuse(2, "write_registers", BASE + REGISTERS - 1, [1, 2])
    ask.refuse(2, "write_coil", BASE + BITS, True)
    ask.refuse(2, "mask_write_register", address=BASE - 1, and_mask=0, or_mask=0)


def diagnostics(ask):
    ask.expect({"status": 0x6D}, "read_exception_status")
    ask.expect({"message": b"\xa5\x37"}, "diag_query_data", b"\xa5\x37")
    ask.expect({"message": 0xFF00}, "diag_restart_communication", True)
    ask.expect({"message": 0}, "diag_read_diagnostic_register")
    # The delimiter that there is already; it is kept in the high byte.
    ask.expect({"message": 0x0A00}, "diag_change_ascii_input_delimeter", delimiter=0x0A00)
    ask.expect({"message": 0}, "diag_clear_counters")
    ask.refuse(2, "read_holding_registers", 0)
    ask.expect({"registers": [word(399)]}, "read_holding_registers", 399)
    # Each request counts itself.
    ask.expect({"message": 3}, "diag_read_bus_message_count")
    ask.expect({"message": 0}, "diag_read_bus_comm_error_count")
    ask.expect({"message": 1}, "diag_read_bus_exception_error_count")
    ask.expect({"message": 6}, "diag_read_device_message_count")
    ask.expect({"message": 0}, "diag_read_device_no_response_count")
    ask.expect({"message": 0}, "diag_read_device_nak_count")
    ask.expect({"message": 0}, "diag_read_device_busy_count")
    ask.expect({"message": 0}, "diag_read_bus_char_overrun_count")
    ask.expect({"message": 0}, "diag_clear_overrun_counter")
    # Of other equipment's, no standard's.
    ask.refuse(1, "diag_read_iop_overrun_count")
    ask.refuse(1, "diag_getclear_modbus_response", data=3)
    before = ask.answer("diag_get_comm_event_counter")
    assert before.status is True
    ask.expect({}, "read_holding_registers", 399)
    ask.refuse(2, "read_holding_registers", 0)
    # Neither counts: what is refused, and the asking.
    ask.expect({"status": True, "count": before.count + 1}, "diag_get_comm_event_counter")
    log = ask.answer("diag_get_comm_event_log")
    assert (log.status, log.event_count) == (True, before.count + 1), log
    assert log.message_count == 18, log.message_count
    # The latest first: received, then the counter sent, the refusal, the words.
    assert log.events[:7] == [0x80, 0x40, 0x80, 0x41, 0x80, 0x40, 0x80], log.events
    ask.right += 2
    ask.silent("diag_force_listen_only")
    ask.silent("write_register", BASE + 299, 1)
    ask.silent("diag_restart_communication", False)
    # In listen only mode nothing was written.
    ask.expect({"registers": [word(BASE + 299)]}, "read_holding_registers", BASE + 299)


def files(ask, framing):
    ask.expect({}, "write_file_record", [FileRecord(4, 7, b"\x12\x34\x56\x78")])
    answer = ask.answer(
        "read_file_record",
        [FileRecord(4, 6, record_length=6), FileRecord(4, 8, record_length=2)],
    )
    data = [record.record_data for record in answer.records]
    assert data == [b"\0\0\x12\x34\x56\x78", b"\x56\x78"], data
    ask.refuse(2, "read_file_record", [FileRecord(5, 0, record_length=2)])
    ask.refuse(2, "read_file_record", [FileRecord(4, 19, record_length=4)])
    ask.refuse(2, "write_file_record", [FileRecord(4, 0, b"\1\1"), FileRecord(4, 20, b"\1\1")])
    answer = ask.answer("read_file_record", [FileRecord(4, 0, record_length=2)])
    assert answer.records[0].record_data == b"\0\0", "refused, and written"
    ask.refuse(2, "read_fifo_queue", address=0x04DF)
    # In RTU frames the peer takes this response for two bytes shorter than it is.
    if not framing.startswith("rtu"):
        ask.expect({"values": [0x01B8, 0x1284]}, "read_fifo_queue", address=0x04DE)
    ask.right += 2


def identity(ask):
    ask.expect({"identifier": b"mbm\xfftes", "byte_count": 8}, "report_device_id")
    basic = {0: b"Maker", 1: b"Thing", 2: b"V1.0"}
    regular = basic | {3: b"http://example.org"}
    for code, objects in ((1, basic), (2, regular), (3, regular | {0x80: b"own"})):
        ask.expect(
            {"information": objects, "conformity": 0x83, "more_follows": 0},
            "read_device_information",
            read_code=code,
        )
    ask.expect({"information": {0x80: b"own"}}, "read_device_information", read_code=4, object_id=0x80)
    ask.refuse(2, "read_device_information", read_code=4, object_id=0x44)


def custom(ask):
    ask.client.register(Custom)
    for data in (b"own data", bytes(range(100))):
        answer = ask.client.execute(False, Custom(data))
        assert not answer.isError() and answer.data == data, answer
        ask.right += 1
    answer = ask.client.execute(False, Unknown(b"x"))
    assert answer.exception_code == 1, answer
    ask.right += 1


def main():
    framing, place = sys.argv[1:]
    # No answer is asked for twice: the server counts.
    common = {"framer": FRAMERS[framing], "timeout": 60, "retries": 0}
    if framing in ("rtu", "ascii"):
        client = ModbusSerialClient(place, baudrate=115200, **common)
    else:
        client = ModbusTcpClient("127.0.0.1", port=int(place), **common)
    assert client.connect(), "no connection"
    ask = Asker(client)
    files(ask, framing)
    for part in (tables, writes, identity, custom, diagnostics):
        part(ask)
    client.close()
    print(f"{ask.right} answers", flush=True)
    sys.stdin.read()


try:
    main()
except Exception as fault:  # told to whoever started this, in one line
    print(f"{type(fault).__name__}: {fault}".replace("\n", " "), flush=True)
