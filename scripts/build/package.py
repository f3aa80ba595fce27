"""A package: files with their names, written as an archive whose bytes depend on nothing else; and the
files that the Arduino library and the PlatformIO package share. packaging/*/pack import this file:

    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts/build"))
"""

import gzip
import io
import pathlib
import re
import subprocess
import sys
import tarfile
import zipfile

sys.dont_write_bytecode = True
from boards import SETS, sets  # noqa: E402
from project import ROOT, fact, licence, version  # noqa: E402

# The time of all files in archives, 1980-01-02. Some file systems have no time before 1980.
TIME = 315619200


class Package:
    """The files of one package: names relative to its top folder, and their bytes."""

    def __init__(self, kind: str, largest: int = 0):
        """largest: the most bytes of the archive; 0 for no limit."""
        self.kind, self.largest, self.files, self.executable = kind, largest, {}, set()

    def fail(self, reason: str) -> None:
        sys.exit(f"{self.kind}: {reason}")

    def write(self, name: str, content: bytes | str) -> None:
        if name in self.files:
            self.fail(f"two files have the name {name}")
        self.files[name] = content.encode() if isinstance(content, str) else content

    def copy(self, source: str, name: str = "", made_by: str = "") -> None:
        """Takes a file of the repository. made_by: the command that builds it, for the message if
        it is missing."""
        path = ROOT / source
        if not path.is_file():
            self.fail(f"{source} is missing" + (f"; run {made_by}" if made_by else ""))
        name = name or path.name
        self.write(name, path.read_bytes())
        if path.stat().st_mode & 0o100:
            self.executable.add(name)

    def copy_folder(self, source: str, name: str) -> None:
        """Takes the files of a folder that git knows or, in a tarball, all."""
        listed = subprocess.run(["git", "ls-files", "-z", source], cwd=ROOT, text=True, capture_output=True)
        found = [path for path in listed.stdout.split("\0") if path] if listed.returncode == 0 else \
            [str(path.relative_to(ROOT)) for path in (ROOT / source).rglob("*") if path.is_file()]
        if not found:
            self.fail(f"{source} has no files")
        for path in sorted(found):
            self.copy(path, f"{name}/{pathlib.PurePosixPath(path).relative_to(source)}")

    def take(self, folder: pathlib.Path) -> None:
        """Takes all files of a folder, with names relative to it."""
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            self.write(path.relative_to(folder).as_posix(), path.read_bytes())

    def copy_assembler(self, folder: str, kinds: tuple) -> list:
        """Takes the library as assembler source, for these dialects of SETS, the names of
        scripts/build/project.py, and a file that refuses any other core: each assembler file would
        compile to nothing there. Returns the names of the files in the package."""
        sets = {which: row for which, row in SETS.items() if row.kind in kinds}
        names = [f"{folder}/mbm_{which}.S" for which in sets]
        for which, name in zip(sets, names):
            self.copy(f"build/assembler/mbm_{which}.S", name, "make assembler")
        condition = " \\\n    || ".join(f"({row.guard})" for row in sets.values())
        cores = "; ".join(re.sub(r" \(.*", "", row.what) for row in sets.values())
        self.write(f"{folder}/mbm_core.c", f"""\
/* Refuses a core for which this package has no code. Licence: MIT OR Apache-2.0. */
#if !({condition})
#error "mbm has no code for this core. It has code for: {cores}"
#endif

/* ISO C wants a declaration in every file. */
typedef int mbm_core_has_code;
""")
        return [f"{folder}/mbm_core.c", *names]

    def copy_licence(self) -> None:
        self.write("LICENSE", licence())

    def fill(self, source: str, name: str = "", **values: str) -> None:
        """Takes a template. Replaces @VERSION@, @DESCRIPTION@ and the given values."""
        known = {"VERSION": version(), "DESCRIPTION": fact("description"), **values}
        text = (ROOT / source).read_text(encoding="utf-8")
        text = re.sub(r"@([A-Z_]+)@", lambda m: known[m[1]] if m[1] in known else
                      self.fail(f"{source}: nothing is known for {m[0]}"), text)
        self.write(name or pathlib.PurePosixPath(source).name, text)

    def entries(self, top: str):
        for name in sorted(self.files):
            yield f"{top}/{name}" if top else name, self.files[name], 0o755 if name in self.executable else 0o644

    def tar(self, target: pathlib.Path, top: str) -> None:
        """Writes a .tar.gz with one top folder, or none if `top` is empty, and prints the package's line."""
        packed = io.BytesIO()
        with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as archive:
            for name, content, mode in self.entries(top):
                entry = tarfile.TarInfo(name)
                entry.size, entry.mode, entry.mtime = len(content), mode, TIME
                archive.addfile(entry, io.BytesIO(content))
        self.written(target, gzip.compress(packed.getvalue(), 9, mtime=0))

    def zip(self, target: pathlib.Path, top: str) -> None:
        """Writes a .zip with one top folder, and prints the package's line."""
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for name, content, mode in self.entries(top):
                entry = zipfile.ZipInfo(name, (1980, 1, 2, 0, 0, 0))
                entry.create_system = 3  # Unix, where external_attr has the permissions
                entry.external_attr = (0o100000 | mode) << 16
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, content)
        self.written(target, packed.getvalue())

    def written(self, target: pathlib.Path, content: bytes) -> None:
        if 0 < self.largest < len(content):
            self.fail(f"{target} would have {len(content)} bytes, more than {self.largest}")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        print(f"{self.kind}: {target}, {len(content)} bytes")


# --- the Arduino library and the PlatformIO package: the headers, the assembler source and the sketches

HEADERS = ["ModbusMaster.h", "ModbusMasterConstants.h", "ModbusMasterHelpers.h",
           "ModbusMasterOptions.h", "ModbusMasterPorts.h", "ModbusMasterLine.h", "ModbusMasterUart.h",
           "util/crc16.h", "util/word.h",
           "ModbusMasterValues.h", "ModbusServer.h", "ModbusServerTables.h", "ModbusStatusText.h", "mbm.h",
           *(f"mbm/{part.name}" for part in sorted((ROOT / "include/mbm").glob("*.h"))),
           "ModbusClient.h", "ModbusClientCalls.h", "ModbusRequest.h", "ModbusValues.h", "ModbusNumbers.h",
           "ModbusCallback.h", "ModbusDriverPin.h", "ModbusTransmission.h", "ModbusUsb.h",
           "ModbusTcpServer.h", "ModbusTcpConnections.h", "ModbusTcpGateway.h", "ModbusSniffer.h",
           "ModbusSnifferText.h"]


def kit(package: Package, dialects: tuple, example: str) -> list:
    """Takes what the packages for ESP-IDF, RT-Thread and Zephyr share: the library as assembler source, the port,
    the headers, the example as `example`, and the tests' line. Returns the names of the library's sources."""
    port = f"mbm_{package.kind.replace('-', '_')}"
    sources = package.copy_assembler("src", dialects)
    package.copy(f"ports/{package.kind}/{port}.c", f"src/{port}.c")
    package.copy(f"ports/{package.kind}/{port}.h", f"include/{port}.h")
    package.copy("include/mbm.h", "include/mbm.h")
    package.copy_folder("include/mbm", "include/mbm")
    if example.endswith(".c"):
        package.copy(f"examples/{package.kind}/{pathlib.PurePosixPath(example).name}", example)
    else:
        package.copy_folder(f"examples/{package.kind}/{pathlib.PurePosixPath(example).name}", example)
    package.copy_folder("firmware-tests/line", "tests")
    package.copy("CHANGELOG.md")
    package.copy_licence()
    package.fill(f"packaging/{package.kind}/README.md.in", "README.md")
    return sources


def pack_kit(package: Package, usage: str) -> None:
    """Writes the package of a kit into the folder that the command line names."""
    if len(sys.argv) != 2:
        sys.exit(usage)
    package.tar(pathlib.Path(sys.argv[1]) / f"mbm-{package.kind}-{version()}.tar.gz", "mbm")


def write(path: pathlib.Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")


def boards_header() -> str:
    conditions = " || \\\n      ".join(f"({which.guard})" for which in sets().values())
    names = "; ".join(which.what for which in sets().values())
    return f"""\
/**
 * @file ModbusMasterBoards.h
 * @brief Stops the build on boards for which this library has no code.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h and ModbusServer.h.
 * Written by scripts/build/package.py; the conditions are those of the files mbm_*.S.
 */

#if !({conditions})
#error "mbm does not serve this board. Supported: {names}."
#endif
"""


def board_names() -> str:
    return "\n".join(f"- {which.what}" for which in sets().values())


def write_sources(folder: pathlib.Path, assembler: pathlib.Path) -> None:
    """Writes the headers, and the assembler source from the folder `assembler`."""
    missing = [which for which in sets() if not (assembler / f"mbm_{which}.S").is_file()]
    if missing:
        sys.exit(f"package: {assembler} has no source for {', '.join(missing)}: run `make assembler`")
    for header in HEADERS:
        write(folder / header, (ROOT / "include" / header).read_text(encoding="utf-8"))
    write(folder / "ModbusMasterBoards.h", boards_header())
    for which in sets():
        write(folder / f"mbm_{which}.S", (assembler / f"mbm_{which}.S").read_text(encoding="utf-8"))


def linux_ports() -> list:
    """The ports for Linux, which scripts/build/library.sh lists."""
    return sorted(file.name for file in (ROOT / "ports/linux").glob("mbm_*.[ch]") if not file.name.startswith("mbm_tls"))


def write_sketches(folder: pathlib.Path) -> int:
    """Writes the sketches of examples/arduino, and returns how many there are."""
    sketches = sorted((ROOT / "examples/arduino").glob("*/*.ino"))
    for sketch in sketches:
        write(folder / sketch.parent.name / sketch.name, sketch.read_text(encoding="utf-8"))
    return len(sketches)
