"""The user-defined function 0x41 for pymodbus, and the framings that the tests name."""

from pymodbus import FramerType
from pymodbus.pdu import ModbusPDU

FRAMERS = {
    "rtu": FramerType.RTU,
    "ascii": FramerType.ASCII,
    "tcp": FramerType.SOCKET,
    "rtu-over-tcp": FramerType.RTU,
}


class Custom(ModbusPDU):
    """A byte count, and the bytes that it counts."""

    function_code = 0x41
    rtu_byte_count_pos = 2

    def __init__(self, data=b"", dev_id=1, transaction_id=0):
        super().__init__(dev_id=dev_id, transaction_id=transaction_id)
        self.data = data

    def encode(self):
        return bytes([len(self.data)]) + self.data

    def decode(self, data):
        self.data = data[1 : 1 + data[0]]
