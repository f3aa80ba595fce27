"""Reads and builds frames with pymodbus: one command a line, one line of answer.

    request FRAMING HEX     what its server reads in a frame
    response FRAMING HEX    what its client reads in a frame
    call FRAMING CALL       the frame that its client sends for a call
    reply FRAMING PDU       the frame that its server sends for a response

FRAMING is rtu, ascii or tcp. For a frame that pymodbus can read, the answer is the unit, the
transaction identifier (0 unless tcp), the name of the class and its fields; for another frame
it is `nothing` or `error`.
"""

import logging
import sys

from custom_pdu import FRAMERS, Custom
from pymodbus.client.mixin import ModbusClientMixin
from pymodbus.exceptions import ModbusException
from pymodbus.framer import FRAMER_NAME_TO_CLASS
from pymodbus.pdu import (
    DecodePDU,
    ExceptionResponse,
    FileRecord,
    bit_message,
    diag_message,
    file_message,
    mei_message,
    other_message,
    register_message,
)

UNIT, TRANSACTION = 17, 0x1234

# The fields to print, by class. All classes of function 08 have the same fields.
FIELDS = {
    "ReadCoilsRequest": ["address", "count"],
    "ReadDiscreteInputsRequest": ["address", "count"],
    "ReadHoldingRegistersRequest": ["address", "count"],
    "ReadInputRegistersRequest": ["address", "count"],
    "WriteSingleCoilRequest": ["address", "bits"],
    "WriteSingleRegisterRequest": ["address", "registers"],
    "WriteMultipleCoilsRequest": ["address", "count", "bits"],
    "WriteMultipleRegistersRequest": ["address", "count", "registers"],
    "ReadCoilsResponse": ["bits"],
    "ReadDiscreteInputsResponse": ["bits"],
    "ReadHoldingRegistersResponse": ["registers"],
    "ReadInputRegistersResponse": ["registers"],
    "WriteSingleCoilResponse": ["address", "bits"],
    "WriteSingleRegisterResponse": ["address", "registers"],
    "WriteMultipleCoilsResponse": ["address", "count"],
    "WriteMultipleRegistersResponse": ["address", "count"],
    "ReadExceptionStatusRequest": [],
    "ReadExceptionStatusResponse": ["status"],
    "GetCommEventCounterRequest": [],
    "GetCommEventCounterResponse": ["status", "count"],
    "GetCommEventLogRequest": [],
    "GetCommEventLogResponse": ["status", "event_count", "message_count", "events"],
    "ReportDeviceIdRequest": [],
    "ReportDeviceIdResponse": ["identifier", "status"],
    "ReadFileRecordRequest": ["records"],
    "ReadFileRecordResponse": ["records"],
    "WriteFileRecordRequest": ["records"],
    "WriteFileRecordResponse": ["records"],
    "MaskWriteRegisterRequest": ["address", "and_mask", "or_mask"],
    "MaskWriteRegisterResponse": ["address", "and_mask", "or_mask"],
    "ReadWriteMultipleRegistersRequest": [
        "read_address",
        "read_count",
        "write_address",
        "write_count",
        "write_registers",
    ],
    "ReadWriteMultipleRegistersResponse": ["registers"],
    "ReadFifoQueueRequest": ["address"],
    "ReadFifoQueueResponse": ["values"],
    "ReadDeviceInformationRequest": ["read_code", "object_id"],
    "ReadDeviceInformationResponse": [
        "read_code",
        "conformity",
        "more_follows",
        "next_object_id",
        "number_of_objects",
        "information",
    ],
    "ExceptionResponse": ["function_code", "exception_code"],
    "Custom": ["data"],
}



class Client(ModbusClientMixin):
    """A client that returns a request instead of sending it."""

    def execute(self, no_response_expected, request):
        return request

    def custom(self, data):
        return Custom(data)


NAMES = {"FileRecord": FileRecord, "ExceptionResponse": ExceptionResponse, "Custom": Custom}
for module in (
    bit_message,
    diag_message,
    file_message,
    mei_message,
    other_message,
    register_message,
):
    NAMES.update(
        {name: thing for name, thing in vars(module).items() if isinstance(thing, type)}
    )


def framer(framing, is_server):
    decoder = DecodePDU(is_server)
    decoder.register(Custom)
    return FRAMER_NAME_TO_CLASS[FRAMERS[framing]](decoder)


def text(value):
    if isinstance(value, FileRecord):
        parts = (value.file_number, value.record_number, value.record_length)
        return "/".join(map(str, parts)) + "/" + bytes(value.record_data).hex()
    if isinstance(value, (bytes, bytearray)):
        return bytes(value).hex()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ",".join(f"{key}:{text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ",".join(map(text, value)) + "]"
    return str(int(value))


def fields(pdu):
    name = type(pdu).__name__
    names = FIELDS.get(name, ["sub_function_code", "message"])
    shown = [f"{field}={text(getattr(pdu, field))}" for field in names]
    return " ".join([str(pdu.dev_id), str(pdu.transaction_id), name, *shown])


def read(framing, frame, is_server):
    used, pdu = framer(framing, is_server).handleFrame(bytes.fromhex(frame), 0, 0)
    return fields(pdu) if pdu else "nothing"


def send(framing, pdu):
    pdu.dev_id, pdu.transaction_id = UNIT, TRANSACTION
    return framer(framing, False).buildFrame(pdu).hex()


def answer(verb, framing, rest):
    if verb == "request":
        return read(framing, rest, True)
    if verb == "response":
        return read(framing, rest, False)
    if verb == "call":
        return send(framing, eval("client." + rest, {**NAMES, "client": Client()}))
    if verb == "reply":
        return send(framing, eval(rest, dict(NAMES)))
    raise ValueError(verb)


def main():
    logging.disable(logging.CRITICAL)
    for line in sys.stdin:
        try:
            print(answer(*line.strip().split(" ", 2)), flush=True)
        except (ModbusException, ValueError, IndexError, KeyError, TypeError) as fault:
            print(f"error: {type(fault).__name__}: {fault}".replace("\n", " "), flush=True)


main()
