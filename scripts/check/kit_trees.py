"""The trees of real kits: at which commit `scripts/check/real` and `scripts/bench/kits` take each, and what was done with them. No
other file of the project names these commits. `scripts/check/kits --write` puts the table into docs/reports/kits.md."""
import collections
import subprocess

# A folder below that of the kit ("" is the kit's), the repository on GitHub, the commit, and the version that it holds, or its date.
Tree = collections.namedtuple("Tree", "folder repository commit version")
# A board of the kit, its core, how far the files of mbm got, and where the program ran. None: not done.
Row = collections.namedtuple("Row", "board core compiled linked run")

ST = "STMicroelectronics/"
STM32 = (Tree("cmsis_core", ST + "cmsis_core", "1a2f783395dd72778a98ebe7771f36ca1c30a35e", "2024-01-24"),)
FAMILIES = {
    "f1": ("bf83dda39877a51647d249eab56895ccce8a4f31", "2024-10-07", "8a76309ed1250d817e9c888c4417171d2ba3ba63", "2024-08-02"),
    "f4": ("d232197f12c592d87944f0f462b2d5297750f762", "2024-08-02", "cdbad761857acedcdd07ece7939b4cb209ed826a", "2024-07-01"),
    "g0": ("9595728f78a7c1d37f246ae31bb4bbe52b0a20c8", "2024-09-16", "6988fd4208123afdc44e5ddacc306ac445595b01", "2024-10-01"),
    "h7": ("6f5e35e30ac09ba7bf44139a97b289d3df53cf9c", "2024-10-14", "13ba9da797a30e1563a8795f974425fb26dd0457", "2024-05-20"),
}
for family, (hal, hal_date, device, device_date) in FAMILIES.items():
    STM32 += (Tree(f"stm32{family}xx_hal_driver", f"{ST}stm32{family}xx_hal_driver", hal, hal_date),
              Tree(f"cmsis_device_{family}", f"{ST}cmsis_device_{family}", device, device_date))

TREES = {
    "freertos": (Tree("", "FreeRTOS/FreeRTOS-Kernel", "4269c69a16f924c11adeedbb31591f6fad9f41b2", "11.1.0+"),),
    "stm32": STM32,
    "pico": (Tree("", "raspberrypi/pico-sdk", "a1438dff1d38bd9c65dbd693f0e5db4b9ae91779", "2.2.0"),
             Tree("lib/tinyusb", "hathach/tinyusb", "86ad6e56c1700e85f1c5678607a762cfe3aa2f47", "0.18.0")),
    "lwip": (Tree("", "lwip-tcpip/lwip", "77dcd25a", "2.2.1"),),
    "freertos-lwip": (Tree("FreeRTOS-Kernel", "FreeRTOS/FreeRTOS-Kernel", "4269c69a16f924c11adeedbb31591f6fad9f41b2", "11.1.0+"),
                      Tree("lwip", "lwip-tcpip/lwip", "3d896ba0a37ff3ce73270ca5e230707fe47f60e3", "2.2.2, in development")),
    "wiznet": (Tree("", "Wiznet/ioLibrary_Driver", "1d2582a7d0d9ff237e37173bb32aecf487a0faf0", "2025-09-10"),),
    "esp-idf": (Tree("", "espressif/esp-idf", "102122904ade11fd1ae373848f34ffd7dfb18aeb", "6.2.0, in development"),),
    "zephyr": (Tree("zephyr", "wdrx70xn/zvm", "b3ccfc41", "3.7.1, a fork"),
               Tree("modules/hal/cmsis", "zephyrproject-rtos/cmsis", "4b96cbb1", ""),
               Tree("modules/hal/nordic", "zephyrproject-rtos/hal_nordic", "ab5cb2e2", "")),
    "rt-thread": (Tree("", "dengtaowei/rt-thread-learn", "b21d047b", "5.3.0, a fork"),),
}
LINKED = "by DMA, by interrupt, with registered callbacks"
PLAYED = "on this machine, over registers of USART and DMA that are played under the HAL's source"
ROWS = {
    "freertos": (Row("load", "Cortex-M3", "yes", "yes", "QEMU's mps2-an385, beside tasks that take the processor, and each fault"),
                 Row("read_registers", "Cortex-M3", "yes", "yes", "QEMU's mps2-an385, against `mbm serve`"),
                 Row("client", "Cortex-M3", "yes", "yes", "QEMU's mps2-an385, against `mbm serve`"),
                 Row("serve", "Cortex-M3", "yes", "yes", "QEMU's mps2-an385, against `mbm read` and `mbm write`")),
    "stm32": (Row("f1", "STM32F103xB, Cortex-M3", "yes", LINKED, None),
              Row("f4", "STM32F405, Cortex-M4", "yes", LINKED,
                  "QEMU's netduinoplus2, by interrupt, against `mbm`"),
              Row("g0", "STM32G071, Cortex-M0+", "yes", LINKED, None),
              Row("h7", "STM32H743, Cortex-M7", "yes", LINKED, None),
              *(Row(f"host-{name}", "x86-64", "yes", "with the HAL's UART, DMA and GPIO", PLAYED)
                for name in ("f1", "f4", "g0", "h7", "g0-1_8", "g0-1_2", "h7-1_8"))),
    "lwip": (Row("host", "x86-64", "yes", "yes", "on this machine, with a wire in memory"),
             Row("cortex-m4", "Cortex-M4", "yes", "yes", None)),
    "freertos-lwip": tuple(Row(form, "Cortex-M3", "yes", "yes", "QEMU's mps2-an385 with its Ethernet controller, against libmodbus and `mbm`, "
                               "with each fault") for form in ("raw", "sockets")),
    "wiznet": tuple(Row(chip, "Cortex-M3", "yes", "yes", None) for chip in ("W5500", "W5100S", "W5200", "W6100")),
    "pico": (Row("pico", "RP2040, Cortex-M0+", "yes", "yes", "rp2040js, UART and USB, against libmodbus"),
             Row("pico2", "RP2350, Cortex-M33", "yes", "yes", None)),
    "esp-idf": (Row("esp32c3", "ESP32-C3, RISC-V", "by ESP-IDF's commands, with Debian's compiler",
                    "with the drivers of UART and GPIO alone", None),),
    "zephyr": (Row("qemu_cortex_m3", "Cortex-M3", "yes", "yes", "QEMU's lm3s6965evb, against `mbm serve`"),
               Row("qemu_cortex_m0", "Cortex-M0", "yes", "yes", "QEMU's microbit, against `mbm serve`"),
               Row("native_sim", "x86-64", "yes", "yes", "on this machine, against `mbm serve`"),
               Row("nrf52840dk", "Cortex-M4", "yes", "yes", None)),
    "rt-thread": (Row("lm3s8962", "Cortex-M3", "yes", "yes", "QEMU's lm3s6965evb, against `mbm serve`"),
                  *(Row(f"host-v{version}", "x86-64", "yes", f"with version {version} of the serial framework and the pin device",
                        "on this machine, over a UART that is played, with each fault") for version in (1, 2))),
}


def other_commits(kind, folder):
    """What is wrong with the commits of a kit's trees, in sentences. A tree that was unpacked from an archive has none."""
    wrong = []
    for tree in TREES.get(kind, ()):
        place = folder / tree.folder
        if not (place / ".git").exists():
            continue
        head = subprocess.run(["git", "-C", place, "rev-parse", "HEAD"], stdout=subprocess.PIPE, text=True).stdout.strip()
        if not head.startswith(tree.commit):
            wrong.append(f"{tree.repository} is at {head[:8]}, and the table of docs/reports/kits.md is about {tree.commit[:8]}")
    return wrong
