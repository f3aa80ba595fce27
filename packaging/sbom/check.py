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


def schema_error(text):
    return JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)


def complaints(data, lock):
    """Returns the faults of the SBOM `data`, compared with the lock file of the crate."""
    crates = {(part["name"], part["version"]): part for part in data["components"] if part["purl"].startswith("pkg:cargo/")}
    for package in lock.values():
        if package["name"] in OURS:
            continue
        part = crates.get((package["name"], package["version"]))
        if part is None:
            yield f"{package['name']} {package['version']} is missing, to which the crate is locked"
        elif package["checksum"] not in [hash["content"] for hash in part.get("hashes", [])]:
            yield f"{package['name']} has another hash than in the crate"

    inside = {part["name"] for part in data["components"] if part["scope"] == "required"}
    expected = closure(lock, "mbm") | OURS | {"rust-core"}
    if inside != expected:
        yield f"the library is said to contain {sorted(inside)}, and contains {sorted(expected)}"
    for part in data["components"]:
        if part["scope"] == "required" and not part.get("licenses"):
            yield f"{part['name']} is in the library and has no licence"
        if part["scope"] == "excluded" and not part.get("properties"):
            yield f"{part['name']} does not say what it is for"


def main(sbom, crate):
    text = pathlib.Path(sbom).read_text()
    if error := schema_error(text):
        sys.exit(f"sbom: {sbom} breaks the schema: {error}")
    data = json.loads(text)
    version = data["metadata"]["component"]["version"]
    if not crate.endswith(f"mbm-c-{version}.crate"):
        sys.exit(f"sbom: it is of version {version}, and the crate is {crate}")
    found = list(complaints(data, packed_lock(crate)))
    if found:
        sys.exit("\n".join(f"sbom: {line}" for line in found))
    inside = sum(part["scope"] == "required" for part in data["components"])
    print(
        f"sbom: valid CycloneDX {data['specVersion']}; {inside} components in the library, as locked in the crate, "
        f"and {len(data['components']) - inside} that test and build it"
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
