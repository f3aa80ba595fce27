"""The versions of mbm that files and finished packages state, for scripts/release/version."""
import gzip
import io
import json
import lzma
import re
import tarfile
import zipfile

NUMBER = r"(\d+\.\d+\.\d+)"


def by_hand_pattern(version):
    """What a version of mbm looks like in a text: all three numbers, or two after a word.
    "before version 1.0" is a rule and no version of mbm."""
    short = version.rpartition(".")[0]
    whole = rf"(?<![\d.]){re.escape(version)}(?![\d]|\.\d)"
    two = rf"(?:\bmbm[ -]v?|\bVersion |\bmbm/){re.escape(short)}(?![\d]|\.\d)"
    return re.compile(f"{whole}|{two}")


def of_header(text):
    """The version that the macros of mbm.h make."""
    return ".".join(
        re.search(rf"^#define MBM_VERSION_{part} (\d+)$", text, re.M)[1]
        for part in ("MAJOR", "MINOR", "PATCH")
    )


def of_cargo(text):
    """A crate, or the workspace. The crates of the tools have no version of mbm."""
    if 'version = "0.0.0"' in text or "version.workspace" in text and "[workspace.package]" not in text:
        return None
    found = re.search(r"^\[(?:workspace\.)?package\]\n(?:(?!\[).*\n)*?version = \"(.*)\"", text, re.M)
    return found and found[1]


def first(pattern):
    """A function that takes the first match of the pattern."""
    return lambda text: (found := re.search(pattern, text, re.M)) and found[1]


def of_bill(text):
    """A CycloneDX bill of materials."""
    return json.loads(text)["metadata"]["component"]["version"]


# How a file states its version, by the end of its name.
MANIFESTS = {
    "library.properties": first(r"^version=(.*)$"),
    "library.json": lambda text: json.loads(text)["version"],
    "idf_component.yml": first(r"^version: *[\"']?([^\"'\n]*)"),
    "mbm.pc": first(r"^Version: *(.*)$"),
    "mbmConfigVersion.cmake": first(r"PACKAGE_VERSION \"([^\"]*)\""),
    "include/mbm.h": of_header,
    "src/mbm.h": of_header,
    "Cargo.toml": of_cargo,
    "./control": first(rf"^Version: *{NUMBER}"),
    ".pdsc": first(r"<release [^>]*version=\"([^\"]*)\""),
    ".cdx.json": of_bill,
}
# The sources contain libraries of others' names, which stand in for them in tests.
SKIPPED = "firmware-tests/avr/libraries/"


def of_archive(data):
    """The text that mbm_version returns, in a static archive. None for another archive."""
    if b"mbm_version" not in data:
        return None
    found = re.findall(rb"(?<![\d.])(\d+\.\d+\.\d+)\0", data)
    return found[0].decode() if len(set(found)) == 1 else f"{len(found)} texts like a version"


def of_assembler(text):
    """The text that mbm_version returns, in the library as assembler source."""
    found = set(re.findall(rf"\.(?:asciz|string)\s+\"{NUMBER}\"", text))
    return found.pop() if len(found) == 1 else None


def of_file(name, data):
    """The version that one file states, or None."""
    if SKIPPED in name:
        return None
    if name.endswith("libmbm.a"):
        return of_archive(data)
    if name.endswith(".S"):
        return of_assembler(data.decode())
    for end, reader in MANIFESTS.items():
        if name.endswith(end):
            return reader(data.decode())
    return None


def members_of_deb(data):
    """The members of an `ar` file."""
    place = 8
    while place + 60 <= len(data):
        name = data[place : place + 16].decode().strip().rstrip("/")
        size = int(data[place + 48 : place + 58])
        yield name, data[place + 60 : place + 60 + size]
        place += 60 + size + size % 2


def members(name, data):
    """The files in a package; None if the name is not that of one."""
    if name.endswith((".zip", ".pack")):
        with zipfile.ZipFile(io.BytesIO(data)) as package:
            return [(i.filename, package.read(i)) for i in package.infolist() if not i.is_dir()]
    if name.endswith((".tar", ".tar.gz", ".tgz", ".crate", ".tar.xz")):
        with tarfile.open(fileobj=io.BytesIO(data)) as package:
            return [(i.name, package.extractfile(i).read()) for i in package if i.isfile()]
    if name.endswith(".deb"):
        return list(members_of_deb(data))
    if name.endswith(".gz"):
        return [(name[:-3], gzip.decompress(data))]
    if name.endswith(".xz"):
        return [(name[:-3], lzma.decompress(data))]
    return None


def inside(place, data):
    """What the files in a package state, also in packages within it."""
    files = members(place, data)
    if files is None:
        stated = of_file(place, data)
        return [(place, stated)] if stated else []
    return [found for name, content in files for found in inside(f"{place}: {name}", content)]


def of_package(path):
    """(place, version) for each version that the package states, its name first."""
    found = inside(path.name, path.read_bytes())
    name = re.search(rf"[-_]{NUMBER}", path.name)
    return ([(f"the name {path.name}", name[1])] if name else []) + found
