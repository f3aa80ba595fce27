"""Writes the SBOM of mbm as CycloneDX JSON:

    sbom.py VERSION HOST_RUST FIRMWARE_RUST >FILE      in the folder of the sources

A component with the scope `required` is compiled into the library. One with the scope `excluded` only
tests, measures or builds it; its property `mbm:for` says which. HOST_RUST and FIRMWARE_RUST are the
versions of Rust's core library in the archives for hosts and for microcontrollers.

The input decides every byte: the serial number is a hash of the content, and the time is
SOURCE_DATE_EPOCH or 1980-01-02."""
import datetime
import json
import os
import pathlib
import re
import subprocess
import sys
import tomllib
import uuid

from cyclonedx.model import HashAlgorithm, HashType, Property
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentScope, ComponentType
from cyclonedx.model.license import LicenseExpression
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

LICENCE = "MIT OR Apache-2.0"
# What the crates of the workspace are for, with options of `cargo tree` that choose them. The library comes first.
SHIPPED = "mbm-archive"
PURPOSES = [
    (None, [f"--package={SHIPPED}", "--edges=normal"]),
    ("tests", ["--package=mbm", "--package=mbm-c", "--package=mbm-tools"]),
    ("features of the crate", ["--package=mbm", "--all-features"]),
    ("an example", ["--package=mbm-example", "--package=mbm-embassy-example"]),
    ("fuzzing", ["--package=mbm-fuzz", "--all-features"]),
    ("benchmarks", ["--package=mbm-bench"]),
    ("model checking", ["--package=mbm-model"]),
]
TOOLS = "checking and building"
TOOL = re.compile(r"scripts/cargo-tool ([a-z][a-z-]*) (?:(\d+\.\d+\.\d+)|\$\((\w+)\))")
REQUIREMENT = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)")


def component(kind, name, version, *, licence, purpose=None, sha256=(), description=None):
    """A component that is in the library, or, with a purpose, one that is not."""
    scope, _, short = name.rpartition("/")
    purl = PackageURL(kind, scope or None, short, version)
    return Component(
        type=ComponentType.LIBRARY,
        name=name,
        version=version,
        bom_ref=purl.to_string(),
        purl=purl,
        description=description,
        licenses=[LicenseExpression(licence.replace("/", " OR "))] if licence else [],
        hashes=[HashType(alg=HashAlgorithm.SHA_256, content=hash) for hash in sha256],
        scope=ComponentScope.EXCLUDED if purpose else ComponentScope.REQUIRED,
        properties=[Property(name="mbm:for", value=purpose)] if purpose else [],
    )


def cargo(command, *options):
    return subprocess.run(["cargo", command, "--locked", *options], check=True, stdout=subprocess.PIPE, text=True).stdout


def tree(options):
    """The names and versions of all crates that the chosen ones are built of."""
    lines = cargo("tree", "--target=all", "--prefix=none", "--format={p}", *options).splitlines()
    return [(name, version.removeprefix("v")) for name, version, *_ in map(str.split, filter(None, lines))]


def crates():
    """The components of the lock file, and for those in the library what each depends on."""
    data = json.loads(cargo("metadata", "--format-version=1", "--all-features"))
    packages = {key(package): package for package in data["packages"]}
    lock = tomllib.loads(pathlib.Path("Cargo.lock").read_text())
    sums = {key(package): package.get("checksum") for package in lock["package"]}
    components = {}
    chosen = [(purpose, tree(options)) for purpose, options in PURPOSES]
    # The lock file has crates too that only other features of crates would bring.
    for purpose, names in [*chosen, ("nothing that is built", packages)]:
        for crate in names:
            # Programs of this repository are no components.
            if crate not in components and (packages[crate]["source"] or purpose is None):
                components[crate] = component(
                    "cargo", *crate, licence=packages[crate]["license"], purpose=purpose, sha256=[sum for sum in [sums[crate]] if sum]
                )
    inside = {crate for crate, part in components.items() if part.scope == ComponentScope.REQUIRED}
    names = {package["id"]: key(package) for package in data["packages"]}
    edges = {
        names[node["id"]]: {names[dep["pkg"]] for dep in node["deps"]} & inside
        for node in data["resolve"]["nodes"] if names[node["id"]] in inside
    }  # fmt: skip
    return components, edges


def key(package):
    return package["name"], package["version"]


def files(*patterns):
    """The files of the sources whose names match, without what was built."""
    for top in sorted(pathlib.Path().iterdir()):
        if top.is_dir() and top.name not in ("build", "target", "dist", ".git"):
            yield from sorted(path for pattern in patterns for path in top.rglob(pattern) if "node_modules" not in path.parts)
        elif top.is_file() and any(top.match(pattern) for pattern in patterns):
            yield top


def tools_of(text):
    """The tools that scripts/cargo-tool builds, with their versions, which may be variables of make."""
    for name, version, variable in TOOL.findall(text):
        yield name, version or re.search(rf"^{variable} *:?= *(\S+)$", text, re.M)[1]


def tools():
    scripts = [path for path in pathlib.Path("scripts").rglob("*") if path.is_file() and "tests" not in path.parts]
    found = {tool for path in [*files("Makefile", "*.mk"), *scripts] for tool in tools_of(path.read_text())}
    for name, version in sorted(found):
        yield component("cargo", name, version, licence=None, purpose=TOOLS)


def python_packages():
    """The packages of the list with hashes."""
    found = {}
    for line in pathlib.Path("packaging/requirements.txt").read_text().splitlines():
        if match := REQUIREMENT.match(line):
            found[match.groups()] = re.findall(r"--hash=sha256:([0-9a-f]{64})", line)
    for (name, version), hashes in sorted(found.items()):
        yield component("pypi", name, version, licence=None, purpose=TOOLS, sha256=sorted(hashes))


def npm_packages():
    found = {}
    for path in files("package-lock.json"):
        for folder, package in json.loads(path.read_text())["packages"].items():
            if folder:
                found[folder.rpartition("node_modules/")[2], package["version"]] = package.get("license")
    for (name, version), licence in sorted(found.items()):
        yield component("npm", name, version, licence=licence, purpose=TOOLS)


def bom(version, host_rust, firmware_rust, seconds):
    product = component("generic", "mbm", version, licence=LICENCE)
    bom = Bom()
    bom.metadata.component = product
    bom.metadata.timestamp = datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc)

    components, edges = crates()
    rust = {}
    for number, where in ((host_rust, "hosts"), (firmware_rust, "microcontrollers")):
        rust.setdefault(number, []).append(where)
    cores = [
        component("generic", "rust-core", number, licence=LICENCE,
                  description=f"Rust's core library, in the archives for {' and '.join(where)}")
        for number, where in rust.items()
    ]  # fmt: skip
    every = [*components.values(), *cores, *tools(), *python_packages(), *npm_packages()]
    for part in every:
        bom.components.add(part)
    bom.register_dependency(product, [part for part in components.values() if part.name == SHIPPED] + cores)
    for name, others in edges.items():
        bom.register_dependency(components[name], [components[other] for other in others])
    content = "\n".join(sorted(f"{part.bom_ref.value} {part.scope}" for part in every))
    bom.serial_number = uuid.uuid5(uuid.NAMESPACE_URL, f"{product.bom_ref.value}\n{content}")
    return bom


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "315619200"))
    print(JsonV1Dot6(bom(*sys.argv[1:], seconds)).output_as_string(indent=2))
