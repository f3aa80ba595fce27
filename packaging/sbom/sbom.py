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
# The manifests whose lock files say what is built, with options of Cargo, and what each is for. The
# first has the library.
MANIFESTS = [
    (["Cargo.toml"], "tests"),
    (["Cargo.toml", "--features=mbm-fuzz/libfuzzer"], "fuzzing"),
    (["Cargo.toml", "--all-features"], "features of the crate"),
    (["examples/rust/Cargo.toml"], "an example"),
    (["bench/Cargo.toml"], "benchmarks"),
    (["model/Cargo.toml"], "model checking"),
]
SHIPPED = "mbm-archive"
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


def metadata(manifest):
    command = ["cargo", "metadata", "--format-version=1", "--locked", "--manifest-path", *manifest]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def checksums(manifest):
    lock = tomllib.loads(pathlib.Path(manifest).with_name("Cargo.lock").read_text())
    return {(package["name"], package["version"]): package.get("checksum") for package in lock["package"]}


def shipped(resolve, root):
    """The ids of all packages that are compiled into the package with the id `root`."""
    nodes = {node["id"]: node for node in resolve["nodes"]}
    found, todo = set(), [root]
    while todo:
        current = todo.pop()
        if current in found:
            continue
        found.add(current)
        for dep in nodes[current]["deps"]:
            if any(kind["kind"] is None for kind in dep["dep_kinds"]):
                todo.append(dep["pkg"])
    return found


def crates():
    """The components of all lock files, and for those in the library what each depends on."""
    components, edges = {}, {}
    for manifest, purpose in MANIFESTS:
        data, sums = metadata(manifest), checksums(manifest[0])
        packages = {package["id"]: package for package in data["packages"]}
        inside = set()
        if manifest == MANIFESTS[0][0]:
            root = next(id for id, package in packages.items() if package["name"] == SHIPPED)
            inside = shipped(data["resolve"], root)
            for node in data["resolve"]["nodes"]:
                if node["id"] in inside:
                    edges[key(packages[node["id"]])] = {
                        key(packages[dep["pkg"]]) for dep in node["deps"] if dep["pkg"] in inside
                    }
        for id, package in packages.items():
            # Programs of this repository are no components.
            if package["source"] is None and id not in inside:
                continue
            if key(package) not in components:
                components[key(package)] = component(
                    "cargo",
                    *key(package),
                    licence=package["license"],
                    purpose=None if id in inside else purpose,
                    sha256=[sum for sum in [sums[key(package)]] if sum],
                )
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
    """The packages of lists with hashes, each package once."""
    found = {}
    for path in files("requirements*.txt"):
        # A list continues a line with a backslash.
        for line in path.read_text().replace("\\\n", " ").splitlines():
            if match := REQUIREMENT.match(line):
                found.setdefault(match.groups(), set()).update(re.findall(r"--hash=sha256:([0-9a-f]{64})", line))
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
