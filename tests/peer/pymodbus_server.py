"""A pymodbus server for tests.

    pymodbus_server.py --framing rtu --tty /dev/pts/3
    pymodbus_server.py --framing tcp --port 0

Prints `ready PORT` once it listens (port 0 for a tty), and serves until its standard input is
closed. Each of the four tables has 2048 cells. Holding register A is A * 40503 + 0x1234 modulo
65536. Input register A is its complement. Coil A is bit 7 of holding register A. Discrete input
A is the opposite of coil A. With unit 0 it answers for every unit. --objects N adds N objects of
60 bytes to its identification, from id 80 (hex) on. --endless adds one that never ends: its two
values do not fit into one response, so pymodbus sends the first one again and again.
"""

import argparse
import asyncio
import logging
import sys

from custom_pdu import FRAMERS, Custom
from pymodbus import ModbusDeviceIdentification
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

CELLS = 2048


class Reversing(Custom):
    """The response has the bytes of the request in reverse order."""

    async def datastore_update(self, context, device_id):
        return Custom(self.data[::-1], device_id, self.transaction_id)


def device(unit):
    words = [(cell * 40503 + 0x1234) & 0xFFFF for cell in range(CELLS)]
    coils = [bool(word >> 7 & 1) for word in words]

    def table(values, datatype):
        return [SimData(0, values=values, datatype=datatype)]

    return SimDevice(
        unit,
        simdata=(
            table(coils, DataType.BITS),
            table([not coil for coil in coils], DataType.BITS),
            table(words, DataType.REGISTERS),
            table([word ^ 0xFFFF for word in words], DataType.REGISTERS),
        ),
    )


def arguments():
    parser = argparse.ArgumentParser(description="A pymodbus server for tests.")
    parser.add_argument("--framing", choices=FRAMERS, required=True)
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--tty", help="the device to serve on")
    where.add_argument("--port", type=int, help="the TCP port to serve on; 0 takes a free one")
    parser.add_argument("--unit", type=int, default=17)
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--objects", type=int, default=0)
    parser.add_argument("--endless", action="store_true")
    return parser.parse_args()


async def main():
    logging.disable(logging.CRITICAL)
    args = arguments()
    private = {0x80 + n: f"object {0x80 + n:02X} ".ljust(60, ".") for n in range(args.objects)}
    if args.endless:
        private[0xF0] = ["a" * 200, "b" * 200]
    identity = ModbusDeviceIdentification(
        info=private,
        info_name={
            "VendorName": "Vendor",
            "ProductCode": "PC",
            "MajorMinorRevision": "V2.11",
            "VendorUrl": "example.org",
        },
    )
    common = {
        "framer": FRAMERS[args.framing],
        "identity": identity,
        "ignore_missing_devices": args.framing != "tcp",
        "broadcast_enable": args.framing in ("rtu", "ascii"),
        "custom_pdu": [Reversing],
    }
    if args.tty:
        server = ModbusSerialServer(
            device(args.unit), port=args.tty, baudrate=args.baud, **common
        )
    else:
        server = ModbusTcpServer(
            device(args.unit), address=("127.0.0.1", args.port), **common
        )
    await server.serve_forever(background=True)
    port = 0 if args.tty else server.transport.sockets[0].getsockname()[1]
    print(f"ready {port}", flush=True)
    # The process that started this one holds the other end of its input.
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    await server.shutdown()


asyncio.run(main())
