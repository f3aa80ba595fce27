#!/usr/bin/env python3
"""The boards that mbm has code for: the instruction sets with a file of assembler source, the families of boards,
and boards by the names that people use. MBM_BOARDS says for which of them a package is built: names of families,
boards and archives, such as "uno cortex-m4"; all if it is empty.

  boards.py --archives   prints the archives that the C SDK has for these boards
  boards.py --list       prints the names that MBM_BOARDS may have: the families, then each archive and its boards
"""

import difflib
import os
import pathlib
import re
import subprocess
import sys
from typing import NamedTuple, NoReturn

FOLDER = pathlib.Path(__file__).resolve().parent


class Set(NamedTuple):
    """An instruction set with a file of assembler source. mcu: the archive with this code. others: the archives
    whose boards take this file too. kind: the dialect. guard: the preprocessor condition for the user's compiler.
    what: the boards, as a text for users."""
    mcu: str
    others: str
    kind: str
    guard: str
    what: str

    def archives(self) -> list:
        return [self.mcu, *self.others.split()]


SETS = {
    "avr5": Set("atmega328p", "atmega168 atmega32u4", "avr", "defined(__AVR_ARCH__) && (__AVR_ARCH__ == 5 || __AVR_ARCH__ == 51)",
                "AVR of 16 to 128 KB of flash (Uno, Nano, Leonardo, 1284P)"),
    "avr6": Set("atmega2560", "", "avr", "defined(__AVR_ARCH__) && __AVR_ARCH__ == 6",
                "AVR of 256 KB of flash (Mega 2560)"),
    # Chips of at most 8 KB lack the long calls, and the memory for a sketch.
    "avrxmega3": Set("atmega4809", "", "avr",
                     "defined(__AVR_ARCH__) && __AVR_ARCH__ == 103 && defined(__AVR_HAVE_JMP_CALL__)",
                     "AVR of the series 0, 1 and 2 from 16 KB (Nano Every, Uno WiFi R2, ATtiny1616)"),
    # This code runs on every Cortex-M. It is also the code for cores that give the processor to
    # the C++ compiler, but not to the assembler: arduino-pico before 4.1, and some for SAMD.
    "armv6m": Set("cortex-m0plus", "cortex-m0", "arm",
                  "defined(__ARM_ARCH_6M__) || defined(__ARM_ARCH_8M_BASE__)"
                  " || (defined(__ASSEMBLER__) && defined(ARDUINO) && defined(__ARM_ARCH_4T__))",
                  "Cortex-M0, M0+ and M23 (Zero, MKR, RP2040)"),
    "armv7m": Set("cortex-m3", "cortex-m4 cortex-m7 cortex-m33", "arm",
                  "defined(__ARM_ARCH_7M__) || defined(__ARM_ARCH_7EM__) || defined(__ARM_ARCH_8M_MAIN__)"
                  " || defined(__ARM_ARCH_8_1M_MAIN__)",
                  "Cortex-M3, M4, M7 and M33 (Due, UNO R4, Nano 33 BLE, GIGA, Teensy, RP2350)"),
    "rv32imc": Set("riscv32imc", "riscv32imac esp32c3 esp32c6", "riscv",
                   "defined(__riscv_xlen) && __riscv_xlen == 32 && defined(__riscv_mul) && !defined(__riscv_32e)",
                   "RISC-V of 32 bits with multiplication (ESP32-C2, C3, C5, C6, H2, P4, RP2350)"),
    "esp8266": Set("esp8266", "", "xtensa", "defined(__XTENSA__) && defined(__XTENSA_CALL0_ABI__)", "ESP8266"),
    "esp32": Set("esp32", "", "bytes", "defined(__XTENSA__) && defined(__XTENSA_WINDOWED_ABI__)",
                 "ESP32, ESP32-S2 and ESP32-S3"),
}


# The families of boards, with the dialects of SETS that they need, and the names of their Arduino cores.
FAMILIES = {
    "avr": (("avr",), ["avr", "megaavr"]),
    "arm": (("arm",), ["sam", "samd", "samd_beta", "stm32", "STM32F1", "STM32F4", "nrf52", "nRF5", "mbed", "mbed_edge",
                       "mbed_giga", "mbed_nano", "mbed_nicla", "mbed_opta", "mbed_portenta", "mbed_rp2040", "rp2040",
                       "renesas", "renesas_uno", "renesas_portenta", "teensy"]),
    "riscv": (("riscv",), ["rp2040", "esp32"]),
    "esp8266": (("xtensa",), ["esp8266"]),
    # Some of them are RISC-V.
    "esp32": (("bytes", "riscv"), ["esp32"]),
    "nucleo": (("arm",), ["stm32"]),
    "teensy": (("arm",), ["teensy"]),
}

# Boards and series of chips, by the archive for their processor.
BOARDS = {
    "atmega328p": "uno uno-r3 nano pro-mini atmega328",
    "atmega32u4": "leonardo micro pro-micro",
    "atmega2560": "mega mega2560",
    "atmega4809": "nano-every uno-wifi-r2",
    "cortex-m0": "microbit stm32f0",
    "cortex-m0plus": "pico pico-w rp2040 zero mkr nano-33-iot samd21 stm32c0 stm32g0 stm32l0 teensy-lc",
    "cortex-m3": "bluepill due stm32f1 stm32f2 stm32l1",
    "cortex-m4": "blackpill uno-r4 nano-33-ble microbit-v2 nrf52 samd51 stm32f3 stm32f4 stm32g4 stm32l4 stm32wb stm32wl teensy3",
    "cortex-m7": "giga portenta stm32f7 stm32h7 teensy4",
    "cortex-m33": "pico2 pico2-w rp2350 stm32h5 stm32l5 stm32u5 stm32wba",
    "esp32": "esp32dev esp32s2 esp32s3 nano-esp32",
    "esp32c3": "esp32c2",
    "esp32c6": "esp32c5 esp32h2",
    "esp8266": "nodemcu d1-mini wemos",
}

# Names of a board or chip of these makers begin with one of BOARDS: that of a nucleo-f401re is stm32f4.
SERIES = re.compile(r"(?:nucleo|stm32)(wba|[a-z][0-9bl])|(atmega\d+|teensy\d|esp32[chs]\d)")


# The archive that a C project takes for the processor of another one, as packaging/sdk/target.h says.
TAKEN = {
    "atmega168": "atmega328p",
    "atmega32u4": "atmega328p",
    "cortex-m0plus": "cortex-m0",
    "cortex-m7": "cortex-m4",
    "esp32c3": "riscv32imc",
    "esp32c6": "riscv32imac",
}


def set_of(archive: str) -> str:
    """The instruction set whose file serves the boards of an archive."""
    return next(name for name, row in SETS.items() if archive in row.archives())


def archives() -> list:
    return [archive for row in SETS.values() for archive in row.archives()]


def plain(name: str) -> str:
    """A name without what people write differently: ESP32-C3 is esp32c3."""
    return re.sub(r"[-_. ]|^arduino", "", name.lower())


def by_plain_name() -> dict:
    """All of names(), by their plain names."""
    return {plain(name): name for name in names()}


def known(name: str) -> str | None:
    """The one of names() for a board, a chip or a family as people call it; None if there is none."""
    by_name, word = by_plain_name(), plain(name)
    if series := SERIES.match(word):
        return by_name.get(word) or by_name.get(f"stm32{series[1]}" if series[1] else series[2])
    return by_name.get(word)


def archive_of(board: str) -> str | None:
    """The archive for a board, which may be named by its archive itself; None if there is no such board."""
    name = known(board)
    return next((archive for archive in archives() if name in [archive, *BOARDS.get(archive, "").split()]), None)


def names() -> list:
    """All names that MBM_BOARDS may have."""
    boards = [board for row in BOARDS.values() for board in row.split()]
    return list(dict.fromkeys([*FAMILIES, *archives(), *boards]))


def refuse(name: str) -> NoReturn:
    by_name = by_plain_name()
    near = [by_name[word] for word in difflib.get_close_matches(plain(name), by_name, 3)]
    hint = f"; the nearest names are {', '.join(near)}" if near else ""
    sys.exit(f"boards: there is no board or family \"{name}\"{hint}. `scripts/build/boards.py --list` prints all names")


def named() -> list:
    """What MBM_BOARDS names. Ends the program if it does not know one of the names."""
    return [known(word) or refuse(word) for word in os.environ.get("MBM_BOARDS", "").replace(",", " ").split()]


def boards_of(family: str) -> list:
    """The boards of a family, by name."""
    kinds = FAMILIES[family][0]
    return [board for row in SETS.values() if row.kind in kinds for archive in row.archives() for board in BOARDS.get(archive, "").split()]


def set_names(word: str) -> list:
    """The instruction sets of a family or a board."""
    if word in FAMILIES:
        return [name for name, row in SETS.items() if row.kind in FAMILIES[word][0]]
    return [set_of(archive_of(word))]


def sets() -> dict:
    """The rows of SETS of the named boards."""
    chosen = [name for word in named() for name in set_names(word)]
    return {name: row for name, row in SETS.items() if name in chosen or not named()}


def named_archives() -> list:
    """The archives that the C SDK has for the named boards: those that a C project takes for them, or all. A board
    without one takes assembler source."""
    built = subprocess.run([FOLDER / "archive", "--list"], check=True, text=True, stdout=subprocess.PIPE).stdout.split()
    chosen = []
    for word in named():
        chosen += [archive for name in set_names(word) for archive in SETS[name].archives()] if word in FAMILIES else [archive_of(word)]
    taken = [TAKEN.get(archive, archive) for archive in chosen]
    return [archive for archive in built if archive in taken or not named()]


def architectures() -> list:
    """The Arduino cores that are known to have these boards: those of a family, and for a board those of every family
    with its instruction set."""
    chosen = []
    for word in named() or list(FAMILIES):
        kinds = {SETS[name].kind for name in set_names(word)}
        chosen += [word] if word in FAMILIES else [family for family in FAMILIES if kinds & set(FAMILIES[family][0])]
    return list(dict.fromkeys(core for family in FAMILIES if family in chosen for core in FAMILIES[family][1]))


def main() -> None:
    if sys.argv[1:] == ["--list"]:
        print("families:", *FAMILIES)
        for archive in archives():
            print(f"{archive}:", *BOARDS.get(archive, "").split())
    elif sys.argv[1:] == ["--archives"]:
        print(*named_archives())
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
