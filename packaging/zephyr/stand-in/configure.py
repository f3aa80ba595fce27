"""Plays the part of Zephyr's build before it compiles: checks zephyr/module.yml, reads the Kconfig files
and prj.conf with kconfiglib, the devicetree and its overlay with Zephyr's own library, and writes
autoconf.h, a list of options for CMake, and the devicetree's values for stand-in/include.

    configure.py STAND-IN MODULE APPLICATION cortex-m|riscv FOLDER
"""

import os
import pathlib
import subprocess
import sys

import kconfiglib
import pykwalify.core
import yaml
from devicetree import dtlib


def module(folder: pathlib.Path, schema: pathlib.Path) -> pathlib.Path:
    """Checks module.yml. Returns the Kconfig file that it names."""
    described = yaml.safe_load((folder / "zephyr/module.yml").read_text())
    pykwalify.core.Core(source_data=described, schema_data=yaml.safe_load(schema.read_text())).validate()
    if not (folder / described["build"]["cmake"] / "CMakeLists.txt").is_file():
        sys.exit("configure: module.yml names a folder without CMakeLists.txt")
    for samples in described["samples"]:
        if not list((folder / samples).glob("*/sample.yaml")):
            sys.exit(f"configure: {samples} has no sample")
    return folder / described["build"]["kconfig"]


def options(stand_in: pathlib.Path, kconfig: pathlib.Path, application: pathlib.Path, core: str,
            out: pathlib.Path) -> None:
    os.environ.update(MODULE_KCONFIG=str(kconfig), STAND_IN_CORTEX_M="y" if core == "cortex-m" else "n",
                      STAND_IN_RISCV="y" if core == "riscv" else "n")
    found = kconfiglib.Kconfig(str(stand_in / "Kconfig"), warn_to_stderr=False)
    found.warn_assign_undef = True
    found.load_config(str(application / "prj.conf"))
    if found.warnings:
        sys.exit("configure: " + "; ".join(found.warnings))
    found.write_autoconf(str(out / "autoconf.h"))
    found.write_config(str(out / ".config"))
    (out / "options.cmake").write_text("".join(
        f"set({name} {value})\n" for name, value in
        (line.strip().split("=", 1) for line in (out / ".config").read_text().splitlines() if "=" in line)))


def devicetree(stand_in: pathlib.Path, application: pathlib.Path, out: pathlib.Path) -> None:
    both = out / "zephyr.dts"
    source = f'#include "{stand_in}/board.dts"\n#include "{application}/app.overlay"\n'
    both.write_text(subprocess.run(
        ["cpp", "-P", "-undef", "-nostdinc", "-I", stand_in / "include", "-x", "assembler-with-cpp", "-"],
        input=source, text=True, check=True, stdout=subprocess.PIPE).stdout)
    tree = dtlib.DT(str(both))
    uart = tree.alias2node["modbus-line"]
    if uart.props["status"].to_string() != "okay":
        sys.exit("configure: the UART is not switched on")
    pin = tree.get_node("/zephyr,user").props["modbus-driver-gpios"]
    cells = pin.to_nums() if pin.type.name != "PHANDLES_AND_NUMS" else dtlib.to_nums(pin.value)
    controller = tree.phandle2node[cells[0]]
    (out / "devicetree.h").write_text(
        f'#define STAND_IN_UART "{uart.path}"\n'
        f'#define STAND_IN_GPIO "{controller.path}"\n'
        f"#define STAND_IN_CURRENT_SPEED {uart.props['current-speed'].to_num()}\n"
        f"#define STAND_IN_PIN {cells[1]}\n#define STAND_IN_FLAGS {cells[2]}\n")


def main() -> None:
    stand_in, folder, application = (pathlib.Path(name) for name in sys.argv[1:4])
    out = pathlib.Path(sys.argv[5])
    out.mkdir(parents=True, exist_ok=True)
    kconfig = module(folder, stand_in.parent / "module.schema.yml")
    options(stand_in, kconfig, application, sys.argv[4], out)
    devicetree(stand_in, application, out)


main()
