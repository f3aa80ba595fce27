#!/usr/bin/env python3
"""Facts about the project, for the scripts that write packages and pages: its version, its licence,
the entries of packaging/project.toml, and the instruction sets for which the library has assembler source.

  project.py           writes the project's address into the links to its releases and into Cargo.toml, and how a
                       reader gets mbm into the pages that a user begins with
  project.py --check   fails if something else stands there
"""

import os
import pathlib
import re
import subprocess
import sys
import tomllib
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]


def version() -> str:
    return subprocess.run([ROOT / "scripts/version"], check=True, text=True, stdout=subprocess.PIPE).stdout.strip()


def fact(key: str) -> str | bool:
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
}


def families() -> list:
    """The families of boards for which the Arduino library is built: those that MBM_BOARDS names, or all."""
    named = os.environ.get("MBM_BOARDS", "").split()
    for name in named:
        if name not in FAMILIES:
            sys.exit(f"BOARDS: \"{name}\" is no family of boards: there are {', '.join(FAMILIES)}")
    return [name for name in FAMILIES if name in named or not named]


def sets() -> dict:
    """The rows of SETS of these families."""
    kinds = [kind for name in families() for kind in FAMILIES[name][0]]
    return {name: row for name, row in SETS.items() if row.kind in kinds}


def architectures() -> list:
    """The Arduino cores that are known to have boards of these families."""
    return list(dict.fromkeys(name for family in families() for name in FAMILIES[family][1]))


# --- the address of the project and whether it has releases, both set in packaging/project.toml

ADDRESS = [(re.compile(r"https?://[^\s()]+(?=/releases/latest\b)"), ["README.md", "docs/*.md"]),
           (re.compile(r'(?<=^repository = ")[^"]+', re.M), ["Cargo.toml"])]


class Way(NamedTuple):
    """How a page that a user begins with says where to get mbm, before its first heading of a part: with a
    release, and without one."""
    published: str
    unpublished: str

    def text(self, address: str, published: bool) -> str:
        return (self.published if published else self.unpublished).replace("ADDRESS", address)


RELEASE = "from the [latest release](ADDRESS/releases/latest)"


def guide(what: str, file: str, command: str, more: str = "") -> Way:
    return Way(f"Download {what}, `{file}`,{more} {RELEASE}.",
               f"No release is published yet: in a clone of mbm, `{command}` writes {what}, `{file}`, to the folder `dist`.")


SDK = "mbm-sdk-VERSION.tar.gz"
WAYS = {
    "README.md": Way("**[Download](ADDRESS/releases/latest)**, then start with",
                     "No release is published yet: **[make the packages from a clone](#install)**, then start with"),
    "docs/index.md": Way("**[Download](ADDRESS/releases/latest)** then start with",
                         "**[Make it from a clone](../README.md#install)** as no release is published yet, then start with"),
    "docs/guide-arduino.md": guide("the library", "mbm-arduino-VERSION.zip", "make arduino-zip"),
    "docs/guide-esp-idf.md": guide("the component", "mbm-esp-idf-VERSION.tar.gz", "make package KIND=esp-idf"),
    "docs/guide-platformio.md": guide("the package", "mbm-platformio-VERSION.tar.gz", "make package KIND=platformio"),
    "docs/guide-linux.md": Way(f"Download the C SDK, `{SDK}`, or the Debian packages `libmbm-dev` and `libmbm0`, {RELEASE}.",
                               "No release is published yet: in a clone of mbm, `make install` installs the library, "
                               "`make package KIND=debian` writes the Debian packages `libmbm-dev` and `libmbm0` to the folder `dist`, and "
                               f"`make package KIND=sdk` the C SDK, `{SDK}`."),
    "docs/guide-mcu.md": guide("the C SDK", SDK, "make package KIND=sdk"),
    "docs/guide-rt-thread.md": guide("the package", "mbm-rt-thread-VERSION.tar.gz", "make package KIND=rt-thread"),
    "docs/guide-rust.md": Way(f"`cargo add mbm` takes the crate. Or download `mbm-VERSION.crate` {RELEASE} and unpack it.",
                              "No release is published yet: `cargo add mbm --path FOLDER` takes the crate from a clone of mbm, and "
                              "`make package KIND=crates` there writes it, `mbm-VERSION.crate`, to the folder `dist`."),
    "docs/guide-zephyr.md": guide("the module", "mbm-zephyr-VERSION.tar.gz", "make package KIND=zephyr"),
}


def found(root: pathlib.Path, patterns: list) -> list:
    return [path for pattern in patterns for path in sorted(root.glob(pattern))]


def addresses(root: pathlib.Path, address: str, published: bool, write: bool, ways: dict = WAYS) -> list:
    """Writes the address and the ways to get mbm everywhere if `write` says so. Returns what is wrong."""
    wrong = []
    for place, patterns in ADDRESS:
        for path in found(root, patterns):
            text = path.read_text(encoding="utf-8")
            new = place.sub(address, text)
            if new != text and write:
                path.write_text(new, encoding="utf-8")
            elif new != text:
                wrong.append(f"{path.relative_to(root)} has another address than packaging/project.toml: run `make address`")
    for path in found(root, ["README.md", "docs/index.md", "docs/guide-*.md"]):
        name = path.relative_to(root).as_posix()
        if name not in ways:
            wrong.append(f"{name}: scripts/build/project.py does not say how a reader gets mbm")
            continue
        text = path.read_text(encoding="utf-8")
        right, other = ways[name].text(address, published), ways[name].text(address, not published)
        begin, heading, rest = text.partition("\n## ")
        if write and other in begin:
            begin = begin.replace(other, right)
            path.write_text(begin + heading + rest, encoding="utf-8")
        if right not in begin:
            wrong.append(f"{name} does not begin with \"{right}\": run `make address`")
        if not published and "/releases/latest" in begin + rest:
            wrong.append(f"{name} has a link to a release, and none is published")
    return wrong


def main() -> None:
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    wrong = addresses(ROOT, fact("repository"), fact("published"), not sys.argv[1:])
    if wrong:
        sys.exit("\n".join(f"address: {what}" for what in wrong))
    print(f"address: pages and Cargo.toml have {fact('repository')}, " +
          ("with releases" if fact("published") else "without a release"))


if __name__ == "__main__":
    main()
