"""The kit pico of scripts/check/real: pico-sdk, with TinyUSB in its folder lib/tinyusb.

pico-sdk's own build compiles and links the examples, for a board with an RP2040 and, without running it, for one with an RP2350.
The emulator rp2040js runs those of the RP2040; libmodbus reads them over USB and UART."""
import os
import re

OURS = re.compile(r"(ports|examples|firmware-tests)/(pico|test|rp2040)/[\w./-]*:\d+.*warning:")
BOARDS = ("pico", "pico2")
EXAMPLES = (("serve_usb", "usb"), ("serve_uart", "uart"))


def check(kit, boards) -> None:
    kit.there(kit.tree / "lib/tinyusb/src/tusb.h")
    text = kit.there(kit.tree / "pico_sdk_version.cmake").read_text()
    version = ".".join(re.search(rf"PICO_SDK_VERSION_{part} (\d+)", text)[1] for part in ("MAJOR", "MINOR", "REVISION"))
    kit.run(kit.log, ["make", "--no-print-directory", "-C", kit.root, "rp2040-emulator"])
    for board in boards:
        archive, folder = {"pico": "cortex-m0plus", "pico2": "cortex-m33"}[board], kit.work / board
        kit.run(kit.log, [kit.root / "scripts/build/archive", archive])
        build(kit, "examples/pico", folder, archive, f"-DPICO_BOARD={board}")
        for example, line in EXAMPLES:
            size = kit.run(kit.log, ["arm-none-eabi-size", folder / f"{example}.elf"]).splitlines()[1].split()
            print(f"real: pico {version}: {board}: {example} linked, {int(size[0]) + int(size[1])} bytes of flash, "
                  f"{int(size[1]) + int(size[2])} of RAM")
            if board == "pico":
                print(kit.run(kit.log, [kit.root / "firmware-tests/rp2040/check", line, folder / f"{example}.elf"]), end="")
        if board == "pico":
            port_test(kit)


def build(kit, project, folder, archive, *options) -> None:
    """Builds a project with CMake by pico-sdk. Fails if a compiler warns of a file of mbm's."""
    environment = {**os.environ, "PICO_SDK_PATH": str(kit.tree)}
    said = kit.run(kit.log, ["cmake", "-GNinja", "-S", kit.root / project, "-B", folder, "-DPICO_NO_PICOTOOL=1",
                             f"-DMBM_LIBRARY={kit.root}/build/archives/{archive}/libmbm.a", *options], env=environment)
    said += kit.run(kit.log, ["ninja", "-C", folder], env=environment)
    if OURS.search(said):
        kit.fail("a file of mbm compiles with a warning:\n" + "\n".join(line for line in said.splitlines() if OURS.search(line)))


def port_test(kit) -> None:
    """Runs the test kit for ports over the UART, and prints its report."""
    folder = kit.work / "porttest"
    build(kit, "firmware-tests/rp2040", folder, "cortex-m0plus")
    print(kit.run(kit.log, [kit.root / "firmware-tests/rp2040/check", "porttest", folder / "porttest.elf"]), end="")
