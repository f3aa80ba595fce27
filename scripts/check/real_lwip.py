"""The kit lwip of scripts/check/real: the tree of lwIP, 2.0 or later.

"host" runs the tests c-tests/test_lwip*.c that have a wire in memory over lwIP's own source in a main loop (NO_SYS) with little memory,
with the address and the undefined-behaviour sanitizer. "cortex-m4" links the examples with lwIP, and prints what they take."""

import re

BOARDS = ("host", "cortex-m4")
TESTS = ("test_lwip", "test_lwip_lost", "test_lwip_places", "test_lwip_calls")
PORT = ("ports/lwip/mbm_lwip.c", "ports/lwip/mbm_lwip_listener.c")
OURS = "-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wundef -Werror".split()
# A chip with memory enough. The program never runs.
MEMORY = """\
MEMORY { FLASH (rx) : ORIGIN = 0x08000000, LENGTH = 512K  RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 128K }
ENTRY(main)
SECTIONS {
  .text : { *(.text* .rodata*) . = ALIGN(4); } >FLASH
  .ARM.exidx : { *(.ARM.exidx*) } >FLASH
  .data : { *(.data*) } >RAM AT>FLASH
  .bss (NOLOAD) : { *(.bss* COMMON) . = ALIGN(4); end = .; } >RAM
}
"""


class Build:
    """Objects of lwIP and of mbm, by one compiler and its options."""

    def __init__(self, kit, name: str, compiler: list):
        self.kit, self.work, self.compiler = kit, kit.work / name, compiler
        self.work.mkdir()
        self.headers = [f"-I{kit.root}/{folder}" for folder in ("include", "ports/lwip", "examples/lwip", "c-tests/support", "c-tests/lwip",
                                                                "firmware-tests/kits/lwip")]
        self.headers += ["-isystem", kit.there(kit.tree / "src/include")]

    def compile(self, source, *options: str):
        target = self.work / f"{source.stem}.o"
        self.kit.run(self.kit.log, [*self.compiler, *options, *self.headers, "-c", source, "-o", target])
        return target

    def lwip(self) -> list:
        """lwIP's core, with IPv4 and Ethernet."""
        source = self.kit.tree / "src"
        files = [*sorted((source / "core").glob("*.c")), *sorted((source / "core/ipv4").glob("*.c")), source / "netif/ethernet.c"]
        return [self.compile(file, "-w") for file in files]

    def ours(self, *names: str) -> list:
        return [self.compile(self.kit.root / name, *OURS, "-Wno-unused-parameter") for name in names]


def version(kit, tree) -> str:
    text = kit.there(tree / "src/include/lwip/init.h").read_text()
    return ".".join(re.search(rf"LWIP_VERSION_{part}\s+(\d+)", text)[1] for part in ("MAJOR", "MINOR", "REVISION"))


def check(kit, boards: tuple) -> None:
    kit.version = version(kit, kit.tree)
    for board in boards:
        (on_this_machine if board == "host" else on_a_chip)(kit)


def on_this_machine(kit) -> None:
    build = Build(kit, "host", ["gcc", "-std=gnu11", "-g", "-O1", "-DBOTH_ENDS", "-DMEM_ALIGNMENT=8", "-fsanitize=address,undefined",
                                "-fno-sanitize-recover=undefined"])
    shared = build.lwip() + build.ours(*PORT, "c-tests/lwip/lwip_wire.c", "c-tests/lwip/lwip_pair.c", "c-tests/support/test.c")
    count = 0
    for test in TESTS:
        program = build.work / test
        kit.run(kit.log, [*build.compiler, *build.ours(f"c-tests/{test}.c"), *shared, kit.there(kit.root / "target/release/libmbm.a"),
                          "-Wl,--wrap=tcp_write,--wrap=tcp_new_ip_type", "-lcmocka", "-o", program])
        count += kit.passed(program, f"{test} prints")
    print(f"real: lwip {kit.version}: host: {count} tests in a main loop, with sanitizers")


def on_a_chip(kit) -> None:
    kit.run(kit.log, [kit.root / "scripts/build/archive", "cortex-m4"])
    build = Build(kit, "cortex-m4", ["arm-none-eabi-gcc", "-mthumb", "-mcpu=cortex-m4", "-std=c99", "-Os", "-ffunction-sections",
                                     "-fdata-sections"])
    script = build.work / "chip.ld"
    script.write_text(MEMORY)
    shared = build.lwip() + build.ours(*PORT, "firmware-tests/kits/lwip/board.c")
    for example in ("client", "serve"):
        image = build.work / f"{example}.elf"
        kit.run(kit.log, [*build.compiler, "--specs=nano.specs", "--specs=nosys.specs", "-nostartfiles", "-T", script, "-Wl,--gc-sections",
                          "-Wl,--no-warn-rwx-segments", f"-Wl,-Map,{image}.map", *build.ours(f"examples/lwip/{example}.c"), *shared,
                          kit.root / "build/archives/cortex-m4/libmbm.a", "-o", image])
        flash, ram = parts(kit, image)
        print(f"real: lwip {kit.version}: cortex-m4: {example} linked: {sum(flash.values())} bytes of flash, of which the port has "
              f"{flash['port']}, mbm {flash['mbm']}, lwIP {flash['lwip']}; {sum(ram.values())} of RAM, of which the port and mbm have none, "
              f"the example {ram['example']}, lwIP {ram['lwip']}")
        if ram["port"] or ram["mbm"]:
            kit.fail(f"{example}: the port or mbm has variables of its own: {ram}")


def parts(kit, image) -> tuple:
    """The bytes of flash and of RAM that each part has in an image, by the map of the linker."""
    flash, ram = ({name: 0 for name in ("port", "mbm", "lwip", "example", "other")} for _ in range(2))
    text = image.with_suffix(".elf.map").read_text().split("Linker script and memory map")[1]
    for section, size, file in re.findall(r"^ (\.(?:text|rodata|data|bss|ARM\.exidx|COMMON)\S*)\s+0x[0-9a-f]{8,}\s+(0x[0-9a-f]+) (\S+)$", text, re.M):
        name = file.rpartition("/")[2]
        part = ("port" if name.startswith("mbm_lwip") else "mbm" if "libmbm.a" in file else
                "example" if name in ("client.o", "serve.o") else "other" if name == "board.o" or ".a(" in file else "lwip")
        for memory, sections in ((flash, ("text", "rodata", "data", "ARM")), (ram, ("data", "bss", "COMMON"))):
            if section[1:].startswith(sections):
                memory[part] += int(size, 16)
    return flash, ram
