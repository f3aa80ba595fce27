#!/usr/bin/env python3
"""Facts about the project, for the scripts that write packages and pages: its version, its licence,
the entries of packaging/project.toml, and the instruction sets for which the library has assembler source.

  project.py           writes the project's address into the links to its releases and into Cargo.toml
  project.py --check   fails if another address stands there, or if a page that must begin with a link has none
"""

import pathlib
import re
import subprocess
import sys
import tomllib
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]


def version() -> str:
    return subprocess.run([ROOT / "scripts/version"], check=True, text=True, stdout=subprocess.PIPE).stdout.strip()


def fact(key: str) -> str:
    """An entry of packaging/project.toml."""
    return tomllib.loads((ROOT / "packaging/project.toml").read_text(encoding="utf-8"))[key]


def licence() -> str:
    """Both licences in one text."""
    mit, apache = ((ROOT / f"LICENSE-{name}").read_text(encoding="utf-8") for name in ("MIT", "APACHE"))
    return ("mbm is licensed under either of the two licences below, at your choice.\n\n"
            f"{mit}\n{'-' * 78}\n\n{apache}")


class Set(NamedTuple):
    """mcu: the archive with this code. kind: the dialect of the assembler source. guard: the
    preprocessor condition for the user's compiler. what: the boards, as a text for users."""
    mcu: str
    kind: str
    guard: str
    what: str


SETS = {
    "avr5": Set("atmega328p", "avr", "defined(__AVR_ARCH__) && (__AVR_ARCH__ == 5 || __AVR_ARCH__ == 51)",
                "AVR of 16 to 128 KB of flash (Uno, Nano, Leonardo, 1284P)"),
    "avr6": Set("atmega2560", "avr", "defined(__AVR_ARCH__) && __AVR_ARCH__ == 6",
                "AVR of 256 KB of flash (Mega 2560)"),
    # Chips of at most 8 KB lack the long calls, and the memory for a sketch.
    "avrxmega3": Set("atmega4809", "avr",
                     "defined(__AVR_ARCH__) && __AVR_ARCH__ == 103 && defined(__AVR_HAVE_JMP_CALL__)",
                     "AVR of the series 0, 1 and 2 from 16 KB (Nano Every, Uno WiFi R2, ATtiny1616)"),
    # This code runs on every Cortex-M. It is also the code for cores that give the processor to
    # the C++ compiler, but not to the assembler: arduino-pico before 4.1, and some for SAMD.
    "armv6m": Set("cortex-m0plus", "arm",
                  "defined(__ARM_ARCH_6M__) || defined(__ARM_ARCH_8M_BASE__)"
                  " || (defined(__ASSEMBLER__) && defined(ARDUINO) && defined(__ARM_ARCH_4T__))",
                  "Cortex-M0, M0+ and M23 (Zero, MKR, RP2040)"),
    "armv7m": Set("cortex-m3", "arm",
                  "defined(__ARM_ARCH_7M__) || defined(__ARM_ARCH_7EM__) || defined(__ARM_ARCH_8M_MAIN__)"
                  " || defined(__ARM_ARCH_8_1M_MAIN__)",
                  "Cortex-M3, M4, M7 and M33 (Due, UNO R4, Nano 33 BLE, GIGA, Teensy, RP2350)"),
    "rv32imc": Set("riscv32imc", "riscv",
                   "defined(__riscv_xlen) && __riscv_xlen == 32 && defined(__riscv_mul) && !defined(__riscv_32e)",
                   "RISC-V of 32 bits with multiplication (ESP32-C2, C3, C5, C6, H2, P4, RP2350)"),
    "esp8266": Set("esp8266", "xtensa", "defined(__XTENSA__) && defined(__XTENSA_CALL0_ABI__)", "ESP8266"),
    "esp32": Set("esp32", "bytes", "defined(__XTENSA__) && defined(__XTENSA_WINDOWED_ABI__)",
                 "ESP32, ESP32-S2 and ESP32-S3"),
}


# --- the address of the project, of which packaging/project.toml is the one setting

ADDRESS = [(re.compile(r"https?://[^\s()]+(?=/releases/latest\b)"), ["README.md", "docs/*.md"]),
           (re.compile(r'(?<=^repository = ")[^"]+', re.M), ["Cargo.toml"])]
# Pages that a user begins with: each has the link before its first heading of a part.
BEGIN_WITH_LINK = ["README.md", "docs/index.md", "docs/guide-*.md"]


def found(root: pathlib.Path, patterns: list) -> list:
    return [path for pattern in patterns for path in sorted(root.glob(pattern))]


def addresses(root: pathlib.Path, address: str, write: bool) -> list:
    """Writes the address everywhere if `write` says so. Returns what is wrong."""
    wrong = []
    for place, patterns in ADDRESS:
        for path in found(root, patterns):
            text = path.read_text(encoding="utf-8")
            new = place.sub(address, text)
            if new != text and write:
                path.write_text(new, encoding="utf-8")
            elif new != text:
                wrong.append(f"{path.relative_to(root)} has another address than packaging/project.toml: run `make address`")
    link = f"]({address}/releases/latest)"
    return wrong + [f"{path.relative_to(root)} does not begin with a link to {address}/releases/latest"
                    for path in found(root, BEGIN_WITH_LINK)
                    if link not in path.read_text(encoding="utf-8").partition("\n## ")[0]]


def main() -> None:
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    wrong = addresses(ROOT, fact("repository"), not sys.argv[1:])
    if wrong:
        sys.exit("\n".join(f"address: {what}" for what in wrong))
    print(f"address: pages and Cargo.toml have {fact('repository')}")


if __name__ == "__main__":
    main()
