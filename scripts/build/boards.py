"""The instruction sets for which the Arduino library has code, and the processors that
Debian's compilers know. scripts/build/assembler, packaging/arduino/library and their checks import this file."""

import pathlib
import re
import subprocess
from typing import NamedTuple


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

PACKAGES = ["gcc-avr", "avr-libc", "gcc-arm-none-eabi", "gcc-riscv64-unknown-elf", "gcc-xtensa-lx106"]


class Target(NamedTuple):
    """A processor, with the options that select it in the compiler."""
    name: str
    prefix: str
    flags: tuple


def avr() -> list:
    """Returns every microcontroller that avr-gcc knows."""
    folder = subprocess.run(["avr-gcc", "-print-file-name=device-specs"], check=True, text=True,
                            stdout=subprocess.PIPE).stdout.strip()
    names = [path.name.removeprefix("specs-") for path in pathlib.Path(folder).glob("specs-*")]
    return [Target(name, "avr-", (f"-mmcu={name}",)) for name in sorted(names)]


# The float units for which images for these processors are built.
FLOATS = {
    "cortex-m4": ["fpv4-sp-d16"], "cortex-m7": ["fpv5-sp-d16", "fpv5-d16"], "cortex-m33": ["fpv5-sp-d16"],
    "cortex-m35p": ["fpv5-sp-d16"], "cortex-m55": ["auto"],
}


def arm() -> list:
    """Returns every Cortex-M that arm-none-eabi-gcc knows, with each float ABI, and two others."""
    printed = subprocess.run(["arm-none-eabi-gcc", "-mcpu=list", "-E", "-"], text=True, stdin=subprocess.DEVNULL,
                           stderr=subprocess.PIPE).stderr
    known = sorted(set(re.findall(r"\bcortex-m[\w.+-]+", printed)))
    out = [Target("cortex-a9", "arm-none-eabi-", ("-mcpu=cortex-a9",)),
           Target("arm7tdmi", "arm-none-eabi-", ("-mcpu=arm7tdmi",))]
    for cpu in known:
        flags = ("-mthumb", f"-mcpu={cpu}")
        out.append(Target(cpu, "arm-none-eabi-", flags))
        for unit in FLOATS.get(cpu, []):
            for abi in "softfp", "hard":
                out.append(Target(f"{cpu} {abi} {unit}", "arm-none-eabi-",
                                  (*flags, f"-mfloat-abi={abi}", f"-mfpu={unit}")))
    return out


# The -march of the cores for these boards, without extensions that gcc 12 does not know.
RISCV = {
    "rv32imc": "ilp32",                                  # ESP32-C2, C3
    "rv32imc_zicsr_zifencei": "ilp32",
    "rv32imac": "ilp32",                                 # ESP32-C6, H2
    "rv32imac_zicsr_zifencei": "ilp32",                  # and C5
    "rv32imac_zicsr_zifencei_zba_zbb_zbs_zbkb": "ilp32",  # RP2350
    "rv32imafc_zicsr_zifencei": "ilp32f",                # ESP32-P4
    "rv32gc": "ilp32d",
    "rv32im": "ilp32",
    # Not served: 16 registers, no multiplication, 64 bits.
    "rv32emc": "ilp32e", "rv32ic": "ilp32", "rv64imac": "lp64",
}


def riscv() -> list:
    return [Target(arch, "riscv64-unknown-elf-", (f"-march={arch}", f"-mabi={abi}", "-msmall-data-limit=0"))
            for arch, abi in RISCV.items()]


def xtensa() -> list:
    # Debian has no compiler for the ESP32. That for the ESP8266 gets its predefined macros.
    windowed = ("-U__XTENSA_CALL0_ABI__", "-D__XTENSA_WINDOWED_ABI__")
    return [Target("lx106", "xtensa-lx106-elf-", ("-mlongcalls",)),
            Target("esp32", "xtensa-lx106-elf-", ("-mlongcalls", *windowed))]


def targets() -> list:
    return avr() + arm() + riscv() + xtensa()
