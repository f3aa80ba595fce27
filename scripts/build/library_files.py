"""The files that the Arduino library and the PlatformIO package share: the headers, the assembler
source and the sketches. packaging/arduino/library and packaging/platformio/pack import this."""

import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
sys.dont_write_bytecode = True
from boards import SETS  # noqa: E402
from project import ROOT  # noqa: E402

HEADERS = ["ModbusMaster.h", "ModbusMasterConstants.h", "ModbusMasterHelpers.h",
           "ModbusMasterOptions.h", "ModbusMasterPorts.h", "ModbusMasterLine.h", "util/crc16.h", "util/word.h",
           "ModbusMasterValues.h", "ModbusServer.h", "ModbusServerTables.h", "ModbusStatusText.h", "mbm.h",
           "ModbusClient.h", "ModbusClientCalls.h", "ModbusRequest.h", "ModbusValues.h", "ModbusNumbers.h",
           "ModbusCallback.h", "ModbusTransmission.h",
           "ModbusTcpServer.h", "ModbusTcpConnections.h", "ModbusTcpGateway.h", "ModbusSniffer.h",
           "ModbusSnifferText.h"]


def write(path: pathlib.Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")


def boards_header() -> str:
    conditions = " || \\\n      ".join(f"({which.guard})" for which in SETS.values())
    names = "; ".join(which.what for which in SETS.values())
    return f"""\
/**
 * @file ModbusMasterBoards.h
 * @brief Stops the build on boards for which this library has no code.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h and ModbusServer.h.
 * Written by scripts/build/library_files.py; the conditions are those of the files mbm_*.S.
 */

#if !({conditions})
#error "mbm does not serve this board. Supported: {names}."
#endif
"""


def board_names() -> str:
    return "\n".join(f"- {which.what}" for which in SETS.values())


def write_sources(folder: pathlib.Path, assembler: pathlib.Path) -> None:
    """Writes the headers, and the assembler source from the folder `assembler`."""
    missing = [which for which in SETS if not (assembler / f"mbm_{which}.S").is_file()]
    if missing:
        sys.exit(f"library_files: {assembler} has no source for {', '.join(missing)}: run `make assembler`")
    for header in HEADERS:
        write(folder / header, (ROOT / "include" / header).read_text(encoding="utf-8"))
    write(folder / "ModbusMasterBoards.h", boards_header())
    for which in SETS:
        write(folder / f"mbm_{which}.S", (assembler / f"mbm_{which}.S").read_text(encoding="utf-8"))


def linux_ports() -> list:
    """The ports for Linux, which scripts/build/library.sh lists."""
    listed = subprocess.run(["sh", "-c", ". scripts/build/library.sh; echo $LINUX_PORTS"], cwd=ROOT, check=True, text=True,
                            stdout=subprocess.PIPE)
    return listed.stdout.split()


def write_sketches(folder: pathlib.Path) -> int:
    """Writes the sketches of examples/arduino, and returns how many there are."""
    sketches = sorted((ROOT / "examples/arduino").glob("*/*.ino"))
    for sketch in sketches:
        write(folder / sketch.parent.name / sketch.name, sketch.read_text(encoding="utf-8"))
    return len(sketches)
