"""The kits freertos-lwip and wiznet of scripts/check/real.

freertos-lwip: FOLDER has FreeRTOS-Kernel and lwip, each in the folder of its name. firmware-tests/lwip runs both forms of the port in
QEMU's mps2-an385 with its Ethernet controller, on the loopback interface, against libmodbus and `mbm`.
wiznet: FOLDER is ioLibrary_Driver. The examples are linked with it for a Cortex-M3, for each chip. Nothing runs: a test on this
machine plays the chip (c-tests/test_wiznet.c)."""
import real_lwip

FORMS = ("raw", "sockets")
CHIPS = ("W5500", "W5100S", "W5200", "W6100")


def check_lwip(kit, forms) -> None:
    kernel, lwip = kit.there(kit.tree / "FreeRTOS-Kernel"), kit.there(kit.tree / "lwip")
    kit.version = f"{real_lwip.version(kit, lwip)} with FreeRTOS {kit.freertos_version(kernel)}"
    kit.run(kit.work / "archive.log", [kit.root / "scripts/build/archive", "cortex-m3"])
    for form in forms:
        said = kit.run(kit.work / f"{form}.log", ["make", "--no-print-directory", "-f", kit.root / "firmware-tests/lwip/Makefile",
                                                  f"KERNEL={kernel}", f"LWIP={lwip}", f"OUT={kit.work}", f"FORM={form}"], cwd=kit.root)
        print(f"real: lwIP {kit.version}: {said.splitlines()[-1]}")
        said = kit.run(kit.work / f"{form}.log", [kit.root / "firmware-tests/lwip/check", form, kit.work / f"load_{form}.elf",
                                                  kit.root / "build/plain/mbm"])
        print("\n".join(line for line in said.splitlines() if "Slirp" not in line))


def check_wiznet(kit, chips) -> None:
    library = kit.there(kit.tree / "Ethernet")
    log, machines = kit.work / "build.log", kit.root / "ports/baremetal/machines"
    kit.run(log, [kit.root / "scripts/build/archive", "cortex-m3"])
    compiler = ["arm-none-eabi-gcc", "-mcpu=cortex-m3", "-mthumb", "--specs=nano.specs", "-std=c11", "-Os", "-ffunction-sections",
                "-fdata-sections", "-I", kit.root / "include", "-I", kit.root / "ports/wiznet", "-I", kit.root / "examples/wiznet",
                "-isystem", library]
    # Its header declares static functions that only socket.c has.
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wundef", "-Werror", "-Wno-unused-function"]
    for chip in chips:
        folder = kit.work / chip
        folder.mkdir()
        ours = [kit.root / "ports/wiznet/mbm_wiznet.c", kit.root / "firmware-tests/wiznet/board.c"]
        theirs = [library / "socket.c", library / "wizchip_conf.c", kit.there(library / chip / f"{chip.lower()}.c")]
        for source in [*ours, *theirs]:
            kit.run(log, [*compiler, f"-D_WIZCHIP_={chip}", *(strict if source in ours else ["-w", "-I", library]), "-c", source,
                          "-o", folder / f"{source.stem}.o"])
        sizes = []
        for example in ("serve", "client"):
            kit.run(log, [*compiler, *strict, f"-D_WIZCHIP_={chip}", "-c", kit.root / f"examples/wiznet/{example}.c", "-o",
                          folder / f"{example}.o"])
            elf = folder / f"{example}.elf"
            kit.run(log, [*compiler[:4], "--specs=nosys.specs", "-Wl,--gc-sections,--fatal-warnings,-e,main,-z,noexecstack,--no-warn-rwx-segments",
                          "-nostartfiles", f"-L{machines}/mps2-an500", folder / f"{example}.o",
                          *(folder / f"{source.stem}.o" for source in [*ours, *theirs]),
                          kit.root / "build/archives/cortex-m3/libmbm.a", "-o", elf])
            numbers = kit.run(log, ["arm-none-eabi-size", elf]).splitlines()[1].split()
            sizes.append(f"{example} {int(numbers[0]) + int(numbers[1])} bytes of flash and {int(numbers[1]) + int(numbers[2])} of RAM")
        print(f"real: wiznet: {chip}: compiled and linked; {', '.join(sizes)}")
