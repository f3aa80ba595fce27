"""A pymodbus client that sends every request that it can build to mbm's server.

    pymodbus_client.py FRAMING ADDRESS

FRAMING is rtu, ascii, tcp or rtu-over-tcp; ADDRESS is a tty or a TCP port. The server is
c-tests/serve.c; c-tests/support/served.h describes its data. The script prints the number of
right answers, or the first wrong one, and ends when its input is closed. Before a request
without a response it prints `silent`, after it `sent`; each time it waits for a line.
"""

import sys

from custom_pdu import FRAMERS, Custom
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.pdu.file_message import FileRecord

UNIT, BASE, REGISTERS, BITS, HOLE, REFUSED = 17, 100, 300, 2400, 250, 260



class Unknown(Custom):
    """A function that the server does not have."""

    function_code = 0x42


def word(address):
    return (address * 40503 + 0x1234) & 0xFFFF


def bit(address):
    return bool(word(address) >> 7 & 1)


class Checker:
    """The client, and the number of right answers."""

    def __init__(self, client):
        self.client = client
        self.right = 0

    def answer(self, name, *args, **named):
        answer = getattr(self.client, name)(*args, device_id=UNIT, **named)
        assert not answer.isError(), f"{name} {args} {named}: {answer}"
        return answer

    def expect(self, fields, name, *args, **named):
        """The answer must have these fields."""
        answer = self.answer(name, *args, **named)
        for field, value in fields.items():
            found = getattr(answer, field)
            assert found == value, f"{name} {args} {named}: {field} {found}, not {value}"
        self.right += 1

    def expect_exception(self, code, name, *args, **named):
        """The answer must be this exception."""
        answer = getattr(self.client, name)(*args, device_id=UNIT, **named)
        found = getattr(answer, "exception_code", None)
        assert found == code, f"{name} {args} {named}: {answer}, not exception {code}"
        self.right += 1

    def expect_silence(self, name, *args, **named):
        """Sends a request without a response. The test that started this script checks that the
        server has received it."""
        self.say("silent")
        getattr(self.client, name)(*args, device_id=UNIT, no_response_expected=True, **named)
        self.say("sent")
        self.right += 1

    def say(self, text):
        """Prints a line, and waits for one."""
        print(text, flush=True)
        sys.stdin.readline()


def tables(check):
    for count in (1, 2, 63, 125):
        words = [word(BASE + 3 + cell) for cell in range(count)]
        check.expect({"registers": words}, "read_holding_registers", BASE + 3, count=count)
        inputs = [word(BASE + 5 + cell) ^ 0xFFFF for cell in range(count)]
        check.expect({"registers": inputs}, "read_input_registers", BASE + 5, count=count)
    for count in (1, 7, 8, 9, 1999, 2000):
        for name, start, turned in (("read_coils", 11, False), ("read_discrete_inputs", 1, True)):
            answer = check.answer(name, BASE + start, count=count)
            cells = [bit(BASE + start + cell) != turned for cell in range(count)]
            # pymodbus returns whole bytes. The bits after the last one read must be 0.
            assert answer.bits[:count] == cells, f"{name} {count}"
            assert not any(answer.bits[count:]), f"{name} {count}"
            check.right += 1
    last, last_bit = BASE + REGISTERS - 1, BASE + BITS - 1
    check.expect({"registers": [word(last)]}, "read_holding_registers", last)
    check.expect_exception(2, "read_holding_registers", last, count=2)
    check.expect_exception(2, "read_holding_registers", BASE - 1)
    check.expect_exception(2, "read_input_registers", last + 1)
    check.expect_exception(2, "read_holding_registers", HOLE - 1, count=2)
    check.expect_exception(2, "read_coils", last_bit, count=2)
    check.expect_exception(2, "read_discrete_inputs", BASE - 1)


def writes(check):
    check.expect({"address": BASE, "registers": [0xABCD]}, "write_register", BASE, 0xABCD)
    check.expect({"registers": [0xABCD]}, "read_holding_registers", BASE)
    for value in (True, False):
        check.expect({"address": BASE, "bits": [value]}, "write_coil", BASE, value)
        assert check.answer("read_coils", BASE).bits[0] is value
    words = [(cell * 257) & 0xFFFF for cell in range(123)]
    check.expect({"address": BASE + 20, "count": 123}, "write_registers", BASE + 20, words)
    check.expect({"registers": words}, "read_holding_registers", BASE + 20, count=123)
    cells = [cell % 3 == 0 for cell in range(1968)]
    check.expect({"address": BASE + 43, "count": 1968}, "write_coils", BASE + 43, cells)
    assert check.answer("read_coils", BASE + 43, count=1968).bits == cells
    # The cell before the range and the one after it are unchanged.
    for cell in (BASE + 42, BASE + 43 + 1968):
        assert check.answer("read_coils", cell).bits[0] is bit(cell)
    check.expect({}, "write_register", BASE + 1, 0x0012)
    check.expect(
        {"address": BASE + 1, "and_mask": 0xF2, "or_mask": 0x25},
        "mask_write_register",
        address=BASE + 1,
        and_mask=0xF2,
        or_mask=0x25,
    )
    check.expect({"registers": [0x0017]}, "read_holding_registers", BASE + 1)
    words = [cell + 7 for cell in range(121)]
    check.expect(
        {"registers": [0x0017, *words, word(BASE + 123), word(BASE + 124), word(BASE + 125)][:122]},
        "readwrite_registers",
        read_address=BASE + 1,
        read_count=122,
        write_address=BASE + 2,
        values=words,
    )
    # The server's hook refuses the request, and no register of it is written.
    check.expect_exception(3, "write_registers", REFUSED - 1, [1, 0xBEEF, 3])
    check.expect(
        {"registers": [word(REFUSED + cell) for cell in (-1, 0, 1)]},
        "read_holding_registers",
        REFUSED - 1,
        count=3,
    )
    check.expect_exception(2, "write_register", HOLE, 1)
    check.expect_exception(2, "write_registers", BASE + REGISTERS - 1, [1, 2])
    check.expect_exception(2, "write_coil", BASE + BITS, True)
    check.expect_exception(2, "mask_write_register", address=BASE - 1, and_mask=0, or_mask=0)


def diagnostics(check):
    check.expect({"status": 0x6D}, "read_exception_status")
    check.expect({"message": b"\xa5\x37"}, "diag_query_data", b"\xa5\x37")
    check.expect({"message": 0xFF00}, "diag_restart_communication", True)
    check.expect({"message": 0}, "diag_read_diagnostic_register")
    # The delimiter that is set already, in the high byte.
    check.expect({"message": 0x0A00}, "diag_change_ascii_input_delimeter", delimiter=0x0A00)
    check.expect({"message": 0}, "diag_clear_counters")
    check.expect_exception(2, "read_holding_registers", 0)
    check.expect({"registers": [word(399)]}, "read_holding_registers", 399)
    # Each request that reads a counter is counted too.
    check.expect({"message": 3}, "diag_read_bus_message_count")
    check.expect({"message": 0}, "diag_read_bus_comm_error_count")
    check.expect({"message": 1}, "diag_read_bus_exception_error_count")
    check.expect({"message": 6}, "diag_read_device_message_count")
    check.expect({"message": 0}, "diag_read_device_no_response_count")
    check.expect({"message": 0}, "diag_read_device_nak_count")
    check.expect({"message": 0}, "diag_read_device_busy_count")
    check.expect({"message": 0}, "diag_read_bus_char_overrun_count")
    check.expect({"message": 0}, "diag_clear_overrun_counter")
    # Sub-functions of other equipment, which the standard reserves.
    check.expect_exception(1, "diag_read_iop_overrun_count")
    check.expect_exception(1, "diag_getclear_modbus_response", data=3)
    before = check.answer("diag_get_comm_event_counter")
    assert before.status is True
    check.expect({}, "read_holding_registers", 399)
    check.expect_exception(2, "read_holding_registers", 0)
    # Neither a refused request nor the request for the counter is counted.
    check.expect({"status": True, "count": before.count + 1}, "diag_get_comm_event_counter")
    log = check.answer("diag_get_comm_event_log")
    assert (log.status, log.event_count) == (True, before.count + 1), log
    assert log.message_count == 18, log.message_count
    # The latest event first: this request received, the counter sent, the exception, the words.
    assert log.events[:7] == [0x80, 0x40, 0x80, 0x41, 0x80, 0x40, 0x80], log.events
    check.right += 2
    check.expect_silence("diag_force_listen_only")
    check.expect_silence("write_register", BASE + 299, 1)
    check.expect_silence("diag_restart_communication", False)
    # In listen only mode the server has written nothing.
    check.expect({"registers": [word(BASE + 299)]}, "read_holding_registers", BASE + 299)


def files(check, framing):
    check.expect({}, "write_file_record", [FileRecord(4, 7, b"\x12\x34\x56\x78")])
    answer = check.answer(
        "read_file_record",
        [FileRecord(4, 6, record_length=6), FileRecord(4, 8, record_length=2)],
    )
    data = [record.record_data for record in answer.records]
    assert data == [b"\0\0\x12\x34\x56\x78", b"\x56\x78"], data
    check.expect_exception(2, "read_file_record", [FileRecord(5, 0, record_length=2)])
    check.expect_exception(2, "read_file_record", [FileRecord(4, 19, record_length=4)])
    check.expect_exception(2, "write_file_record", [FileRecord(4, 0, b"\1\1"), FileRecord(4, 20, b"\1\1")])
    answer = check.answer("read_file_record", [FileRecord(4, 0, record_length=2)])
    assert answer.records[0].record_data == b"\0\0", "refused, but written"
    check.expect_exception(2, "read_fifo_queue", address=0x04DF)
    # In RTU framing, pymodbus assumes that this response is two bytes shorter.
    if not framing.startswith("rtu"):
        check.expect({"values": [0x01B8, 0x1284]}, "read_fifo_queue", address=0x04DE)
    check.right += 2


def identity(check):
    check.expect({"identifier": b"mbm\xfftes", "byte_count": 8}, "report_device_id")
    basic = {0: b"Maker", 1: b"Thing", 2: b"V1.0"}
    regular = basic | {3: b"http://example.org"}
    for code, objects in ((1, basic), (2, regular), (3, regular | {0x80: b"own"})):
        check.expect(
            {"information": objects, "conformity": 0x83, "more_follows": 0},
            "read_device_information",
            read_code=code,
        )
    check.expect({"information": {0x80: b"own"}}, "read_device_information", read_code=4, object_id=0x80)
    check.expect_exception(2, "read_device_information", read_code=4, object_id=0x44)


def custom(check):
    check.client.register(Custom)
    for data in (b"own data", bytes(range(100))):
        answer = check.client.execute(False, Custom(data, UNIT))
        assert not answer.isError() and answer.data == data, answer
        check.right += 1
    answer = check.client.execute(False, Unknown(b"x", UNIT))
    assert answer.exception_code == 1, answer
    check.right += 1


def main():
    framing, address = sys.argv[1:]
    # No retries: the server counts the requests.
    common = {"framer": FRAMERS[framing], "timeout": 60, "retries": 0}
    if framing in ("rtu", "ascii"):
        client = ModbusSerialClient(address, baudrate=115200, **common)
    else:
        client = ModbusTcpClient("127.0.0.1", port=int(address), **common)
    assert client.connect(), "no connection"
    check = Checker(client)
    files(check, framing)
    for part in (tables, writes, identity, custom, diagnostics):
        part(check)
    client.close()
    print(f"{check.right} answers", flush=True)
    sys.stdin.read()


try:
    main()
except Exception as fault:  # reported in one line to the test that started this script
    print(f"{type(fault).__name__}: {fault}".replace("\n", " "), flush=True)
