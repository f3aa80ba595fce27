"""Checks an SBOM against the schema of CycloneDX, and against what the crate mbm-c was packed with:

    check.py SBOM CRATE"""
import json
import pathlib
import sys
import tarfile
import tomllib

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

# In the library, but not from a registry of crates.
OURS = {"mbm", "mbm-c", "mbm-archive"}


def fail(message):
    sys.exit(f"sbom: {message}")


def packed_lock(crate):
    """The packages of the lock file in the crate, by name."""
    with tarfile.open(crate) as tar:
        name = next(name for name in tar.getnames() if name.endswith("/Cargo.lock"))
        lock = tomllib.loads(tar.extractfile(name).read().decode())
    return {package["name"]: package for package in lock["package"]}


def closure(lock, name):
    """The names of all packages that `name` depends on. mbm comes from a registry there, so it has no dependencies of tests."""
    found, todo = set(), [name]
    while todo:
        current = todo.pop()
        if current not in found:
            found.add(current)
            todo += [dependency.split()[0] for dependency in lock[current].get("dependencies", [])]
    return found


def main(sbom, crate):
    text = pathlib.Path(sbom).read_text()
    if error := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text):
        fail(f"{sbom} breaks the schema: {error}")
    data = json.loads(text)
    components = {(part["purl"].split("/")[0], part["name"], part["version"]): part for part in data["components"]}
    if len(components) != len(data["components"]):
        fail("a component is there twice")

    lock = packed_lock(crate)
    for package in lock.values():
        if package["name"] in OURS:
            continue
        part = components.get(("pkg:cargo", package["name"], package["version"]))
        if part is None:
            fail(f"{package['name']} {package['version']} is missing, which {crate} was locked to")
        if package["checksum"] not in [hash["content"] for hash in part["hashes"]]:
            fail(f"{package['name']} has another hash than in {crate}")

    inside = {part["name"] for part in data["components"] if part["scope"] == "required"}
    expected = closure(lock, "mbm") | OURS | {"rust-core"}
    if inside != expected:
        fail(f"the library is said to contain {sorted(inside)}, and contains {sorted(expected)}")
    for part in data["components"]:
        if part["scope"] == "required" and not part.get("licenses"):
            fail(f"{part['name']} is in the library and has no licence")
        if part["scope"] == "excluded" and not part.get("properties"):
            fail(f"{part['name']} does not say what it is for")
        if part["scope"] == "required" and part["name"] not in OURS | {"rust-core"} and not part.get("hashes"):
            fail(f"{part['name']} has no hash")
    version = data["metadata"]["component"]["version"]
    if not crate.endswith(f"mbm-c-{version}.crate"):
        fail(f"it is of version {version}, and the crate is {crate}")
    print(
        f"sbom: valid CycloneDX {data['specVersion']}; {len(inside)} components in the library, as locked in the crate, "
        f"and {len(components) - len(inside)} that test and build it"
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
