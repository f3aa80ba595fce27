"""The kit stm32 of scripts/check/real: ST's HAL of four families, in the folders of its repositories.

The examples are compiled by the HAL's headers and linked with the HAL, its start-up code and the library, by
DMA for each family, and by interrupt for a chip that QEMU plays. QEMU has no DMA of an STM32. The DMA
form runs on this machine, over the HAL's source and registers that are played: firmware-tests/kits/stm32/host.
"""

import pathlib
import re
import subprocess
import time

# The chip of each family: the symbol of its header, the start-up file, the options of the compiler, the archive, and flash and RAM.
CHIPS = {
    "f1": ("STM32F103xB", "startup_stm32f103xb.s", "-mcpu=cortex-m3", "cortex-m3", "0x08000000", "0x20000000, LENGTH = 20K"),
    "f4": ("STM32F405xx", "startup_stm32f405xx.s", "-mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16", "cortex-m4",
           "0x08000000", "0x20000000, LENGTH = 128K"),
    "g0": ("STM32G071xx", "startup_stm32g071xx.s", "-mcpu=cortex-m0plus", "cortex-m0plus", "0x08000000", "0x20000000, LENGTH = 36K"),
    "h7": ("STM32H743xx", "startup_stm32h743xx.s", "-mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16", "cortex-m7",
           "0x08000000", "0x24000000, LENGTH = 512K"),
}
# What plays the registers of a family on this machine, and the boards of that kind. A FIFO's threshold ends the name of a board.
PLAYED = {"f1": ("usart_sr", "dma_channel"), "f4": ("usart_sr", "dma_stream"), "g0": ("usart_isr", "dma_channel"),
          "h7": ("usart_isr", "dma_stream", "cache")}
HOSTS = (*(f"host-{name}" for name in PLAYED), "host-g0-1_8", "host-g0-1_2", "host-h7-1_8")
EXAMPLES = ("read_registers", "client", "serve")
MEMORY = """\
MEMORY { FLASH (rx) : ORIGIN = %s, LENGTH = 64K  RAM (rwx) : ORIGIN = %s }
ENTRY(Reset_Handler)
_estack = ORIGIN(RAM) + LENGTH(RAM);
SECTIONS {
  .text : { KEEP(*(.isr_vector)) *(.text* .rodata*) KEEP(*(.init)) KEEP(*(.fini)) . = ALIGN(4); } >FLASH
  .ARM.exidx : { *(.ARM.exidx*) . = ALIGN(4); _sidata = .; } >FLASH
  .data : AT(_sidata) { _sdata = .; *(.data*) . = ALIGN(4); _edata = .; } >RAM
  .bss (NOLOAD) : { _sbss = .; __bss_start__ = .; *(.bss* COMMON) . = ALIGN(4); _ebss = .; __bss_end__ = .; end = .; } >RAM
  __exidx_start = ADDR(.ARM.exidx); __exidx_end = __exidx_start + SIZEOF(.ARM.exidx);
}
"""
OURS = ("-std=c99 -Os -g -ffunction-sections -fdata-sections -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wundef "
        "-Werror")


class Family:
    """A family's HAL, and what is built with it."""

    def __init__(self, kit, name: str):
        self.kit, self.name = kit, name
        tree = kit.tree
        self.symbol, startup, cpu, mcu, flash, ram = CHIPS[name]
        self.hal = kit.there(tree / f"stm32{name}xx_hal_driver")
        device = kit.there(tree / f"cmsis_device_{name}")
        self.work = kit.work / name
        self.work.mkdir()
        # A project has this file from CubeMX. The HAL has a form of it with everything switched on.
        template = self.hal / f"Inc/stm32{name}xx_hal_conf_template.h"
        (self.work / f"stm32{name}xx_hal_conf.h").write_text(kit.there(template).read_text())
        (self.work / "chip.ld").write_text(MEMORY % (flash, ram))
        self.cc = ["arm-none-eabi-gcc", "-mthumb", *cpu.split(), f"-D{self.symbol}", "-DUSE_HAL_DRIVER"]
        self.headers = [f"-I{self.work}", "-isystem", self.hal / "Inc", "-isystem", device / "Include",
                        "-isystem", kit.there(tree / "cmsis_core/Core/Include")]
        self.device = [device / f"Source/Templates/system_stm32{name}xx.c", device / f"Source/Templates/gcc/{startup}"]
        self.archive = kit.root / f"build/archives/{mcu}/libmbm.a"
        kit.run(kit.log, [kit.root / "scripts/build/archive", mcu])
        self.objects = self.compile_hal()

    def compile_hal(self) -> list:
        """The HAL's own files, as its user compiles them."""
        sources = [*self.device, *(self.hal / f"Src/stm32{self.name}xx_hal{part}.c" for part in
                                   ("", "_cortex", "_dma", "_dma_ex", "_gpio", "_rcc", "_rcc_ex", "_uart", "_uart_ex"))]
        objects = []
        for source in sources:
            if source.exists():
                objects.append(self.work / (source.stem + ".o"))
                self.kit.run(self.kit.log, [*self.cc, "-Os", "-w", "-ffunction-sections", "-fdata-sections", *self.headers,
                                            "-c", source, "-o", objects[-1]])
        return objects

    def build(self, example: str, *defines: str) -> pathlib.Path:
        """Builds an example with the port and the library. Returns the image."""
        root = self.kit.root
        name = "-".join([example, *(define[2:].partition("=")[0].lower() for define in defines)])
        sources = [root / f"examples/stm32/{example}.c", root / "ports/stm32/mbm_stm32.c", root / "ports/stm32/mbm_stm32_callbacks.c"]
        return self.link(name, sources, [*OURS.split(), *defines], self.archive)

    def link(self, name: str, sources: list, options: list, *more) -> pathlib.Path:
        """Compiles sources and what CubeMX makes, and links them with the HAL, and with objects and archives. Returns the image."""
        root, kits = self.kit.root, self.kit.root / "firmware-tests/kits/stm32"
        objects = []
        for source in (kits / "main.c", *sources):
            objects.append(self.work / f"{name}-{source.stem}.o")
            self.kit.run(self.kit.log, [*self.cc, *options, f"-I{root}/include", f"-I{root}/ports/stm32", f"-I{root}/examples/stm32",
                                        f"-I{kits}", *self.headers, "-c", source, "-o", objects[-1]])
        image = self.work / f"{name}.elf"
        self.kit.run(self.kit.log, [*self.cc, "--specs=nano.specs", "--specs=rdimon.specs", "-T",
                                    self.work / "chip.ld", "-Wl,--gc-sections", "-Wl,--no-warn-rwx-segments", f"-Wl,-Map,{image}.map",
                                    *objects, *self.objects, *more, "-o", image])
        return image


def check(kit, boards: tuple) -> None:
    """Builds for each family, and runs where the chip is played."""
    for name in boards:
        if name.startswith("host-"):
            on_this_machine(kit, name)
            continue
        family = Family(kit, name)
        for example in EXAMPLES:
            family.build(example)
            family.build(example, "-DWITHOUT_DMA")
            family.build(example, "-DUSE_HAL_UART_REGISTER_CALLBACKS=1")
        print(f"real: stm32 {name}: {family.symbol}: {len(EXAMPLES)} examples compiled without a warning and linked with the"
              " HAL, by DMA, by interrupt, and with registered callbacks")
        if name == "f4":
            in_qemu(kit, family)


def in_qemu(kit, family: Family) -> None:
    """Runs the examples by interrupt on the chip that QEMU plays."""
    for example in ("read_registers", "client"):
        image = family.build(example, "-DWITHOUT_DMA")
        kit.converse(f"f4-{example}", ["qemu-system-arm", "-machine", "netduinoplus2", *kit.quiet, *kit.meter,
                                       "-chardev", "stdio,id=console", "-semihosting-config",
                                       "enable=on,target=native,chardev=console", "-kernel", image],
                     [f"{kit.registers}\n" * 5])
    serve_in_qemu(kit, family.build("serve", "-DWITHOUT_DMA"))


def serve_in_qemu(kit, image: pathlib.Path) -> None:
    """Reads and writes a unit that the chip serves, with mbm."""
    output = kit.work / "f4-serve.output"
    with output.open("w") as out:
        qemu = subprocess.Popen(["qemu-system-arm", "-machine", "netduinoplus2", *kit.quiet, "-serial", "pty", "-chardev", "stdio,id=console",
                                 "-semihosting-config", "enable=on,target=native,chardev=console", "-kernel", image],
                                stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    try:
        end = time.monotonic() + 60
        while "serving unit 17" not in output.read_text() and time.monotonic() < end:
            time.sleep(0.1)
        line = "rtu:" + re.search(r"redirected to (/dev/pts/\d+)", output.read_text())[1]
        mbm = [kit.root / "build/plain/mbm"]
        options = ["--unit=17", "--timeout=5s", line]
        for command, expected in ((["read", *options, "100", "2"], ("2301", "50")), (["write", *options, "105", "4711"], ()),
                                  (["read", *options, "105"], ("4711",)), (["write", "--table=coils", *options, "9", "1"], ()),
                                  (["read", "--table=coils", *options, "8", "2"], ("0", "1"))):
            for _ in range(20):
                said = kit.run(kit.log, [*mbm, *command])
                if not all(re.search(rf"\b{word}\b", said) for word in expected):
                    kit.fail(f"{command} prints {said}")
    finally:
        qemu.kill()
        qemu.wait(10)
    print("real: stm32 f4: the chip serves its unit to mbm, 100 requests by interrupt")


def on_this_machine(kit, board: str) -> None:
    """Runs the tests c-tests/test_stm32*.c over the source of a family's HAL, whose registers are played."""
    _, name, *threshold = board.split("-")
    root, tests, played = kit.root, ("test_stm32", "test_stm32_server", "test_stm32_field"), PLAYED[name]
    hal, work, host = kit.there(kit.tree / f"stm32{name}xx_hal_driver"), kit.work / board, root / "firmware-tests/kits/stm32/host"
    work.mkdir()
    template = kit.there(hal / f"Inc/stm32{name}xx_hal_conf_template.h")
    (work / f"stm32{name}xx_hal_conf.h").write_text(template.read_text())
    # The HAL keeps addresses in 32 bits, so the program lies below 4 GB.
    low = ["gcc", "-std=gnu11", "-g", "-no-pie", "-fno-pie", f"-I{root}/include", f"-I{root}/c-tests", f"-I{root}/c-tests/support",
           "-I", work, f"-I{root}/c-tests/stm32", f"-I{root}/ports/stm32", f"-I{host}"]
    with_hal = [f"-D{CHIPS[name][0]}", "-DUSE_HAL_DRIVER", "-include", host / "shim.h", f"-I{work}", "-isystem", hal / "Inc", "-isystem",
                kit.tree / f"cmsis_device_{name}/Include", "-isystem", kit.tree / "cmsis_core/Core/Include",
                *(f"-DWITH_FIFO=UART_RXFIFO_THRESHOLD_{eighths}" for eighths in threshold)]
    (work / "main.h").write_text(f'#include "stm32{name}xx_hal.h"\nextern UART_HandleTypeDef huart1;\n'
                                 "#define MBM_STM32_RECEIVE_BYTES 64\n")
    parts = [hal / f"Src/stm32{name}xx_hal_{part}.c" for part in ("uart", "uart_ex", "dma", "gpio")]
    sources = [*((part, ["-w", *with_hal]) for part in parts if part.exists()),
               *((host / f"{part}.c", ["-Wall", "-Wextra", "-Werror", *with_hal]) for part in ("chip", *played)),
               (host / "registers.c", ["-O1"]),
               (root / "c-tests/stm32/machine.c", ["-O1"]), (root / "c-tests/support/test.c", ["-O1"]),
               *((root / source, ["-O1", "-Wall", "-Wextra", "-Werror", *with_hal]) for source in
                 (*(f"c-tests/{test}.c" for test in tests), "c-tests/stm32/uart.c", "c-tests/stm32/served_unit.c",
                  "ports/stm32/mbm_stm32.c", "ports/stm32/mbm_stm32_callbacks.c"))]
    for source, options in sources:
        kit.run(kit.log, [*low, *options, "-c", source, "-o", work / (source.stem + ".o")])
    shared = [work / (source.stem + ".o") for source, _ in sources if source.stem not in tests]
    count = 0
    for test in tests:
        kit.run(kit.log, [*low, work / (test + ".o"), *shared, kit.there(root / "target/release/libmbm.a"), "-lcmocka", "-lpthread",
                          "-o", work / test])
        count += kit.passed(work / test, f"{board}: the tests over the HAL's source print")
    print(f"real: stm32 {board}: {count} tests of the port over the source of the HAL, by DMA and by interrupt")
