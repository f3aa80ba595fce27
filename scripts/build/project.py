#!/usr/bin/env python3
"""Facts about the project, for the scripts that write packages and pages: its version, its licence
and the entries of packaging/project.toml. boards.py knows the boards.

  project.py           writes the project's address into the links to its releases and into Cargo.toml, and how a
                       reader gets mbm into the pages that a user begins with
  project.py --check   fails if something else stands there, or if any file of the project has an address of the
                       project that it does not have: while nothing is published, any
"""

import pathlib
import re
import subprocess
import sys
import tomllib
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]


def version() -> str:
    return subprocess.run([ROOT / "scripts/version"], check=True, text=True, stdout=subprocess.PIPE).stdout.strip()


def fact(key: str) -> str | bool:
    """An entry of packaging/project.toml."""
    return tomllib.loads((ROOT / "packaging/project.toml").read_text(encoding="utf-8"))[key]


def address() -> str:
    """The address of the project for packages and pages; empty while it has none."""
    return str(fact("repository")) if fact("published") else ""


def licence() -> str:
    """Both licences in one text."""
    mit, apache = ((ROOT / f"LICENSE-{name}").read_text(encoding="utf-8") for name in ("MIT", "APACHE"))
    return ("mbm is licensed under either of the two licences below, at your choice.\n\n"
            f"{mit}\n{'-' * 78}\n\n{apache}")


# --- the address of the project and whether it has releases, both set in packaging/project.toml

RELEASES = "/releases/latest"
LINK = re.compile(rf"https?://[^\s()]+(?={RELEASES}\b)")
MANIFEST = re.compile(r'(?<=^repository = ")[^"]*', re.M)
# Anything that a reader may take for an address, on the sites that have projects and packages or with its scheme.
WEB = re.compile(r"(?:\b\w+://(?:[\w.-]+@)?|git@)[\w.-]+[^\s<>()\[\]{}\"'`|]*"
                 r"|\b(?:github\.com|gitlab\.com|codeberg\.org|docs\.rs|lib\.rs|crates\.io|pypi\.org|npmjs\.com|readthedocs\.io"
                 r"|registry\.platformio\.org|components\.espressif\.com|reference\.arduino\.cc)/[^\s<>()\[\]{}\"'`|]*")
NAME = re.compile(r"(?<![a-z0-9])mbm(?![a-z0-9_])", re.I)
# What has the settings themselves, and planted faults.
NOT_LOOKED_AT = re.compile(r"packaging/project\.toml|scripts/(tests/|check/site$)")


class Way(NamedTuple):
    """How a page that a user begins with says where to get mbm, before its first heading of a part: with a
    release, and without one."""
    published: str
    unpublished: str

    def text(self, address: str, published: bool) -> str:
        return (self.published if published else self.unpublished).replace("ADDRESS", address)


RELEASE = "from the [latest release](ADDRESS/releases/latest)"


def guide(what: str, file: str, command: str, more: str = "", board: str = "") -> Way:
    """`board` is an example of a board for which the command makes the package alone, in less time."""
    quick = (f", in a quarter of an hour; `{command} BOARDS={board}` writes that for one board, "
             f"`{file.replace('VERSION', f'VERSION-{board}')}`, in a minute") if board else ""
    return Way(f"Download {what}, `{file}`,{more} {RELEASE}.",
               f"No release is published yet: in a clone of mbm, `{command}` writes {what}, `{file}`, to the folder `dist`{quick}.")


SDK = "mbm-sdk-VERSION.tar.gz"
WAYS = {
    "README.md": Way("**[Download](ADDRESS/releases/latest)**, then start with",
                     "No release is published yet: **[build the packages from a clone](#install)**, then start with"),
    "docs/index.md": Way("**[Download](ADDRESS/releases/latest)** then start with",
                         "**[Build it from a clone](../README.md#install)** as no release is published yet, then start with"),
    "docs/guide-arduino.md": guide("the library", "mbm-arduino-VERSION.zip", "make arduino-zip", board="uno"),
    "docs/guide-esp-idf.md": guide("the component", "mbm-esp-idf-VERSION.tar.gz", "make package KIND=esp-idf"),
    "docs/guide-platformio.md": guide("the package", "mbm-platformio-VERSION.tar.gz", "make package KIND=platformio"),
    "docs/guide-linux.md": Way(f"Download the C SDK, `{SDK}`, or the Debian packages `libmbm-dev` and `libmbm0`, {RELEASE}.",
                               "No release is published yet: in a clone of mbm, `make install` installs the library, "
                               "`make deb` writes the Debian packages `libmbm-dev` and `libmbm0` to the folder `dist`, and "
                               f"`make sdk` the C SDK, `{SDK}`."),
    "docs/guide-mcu.md": guide("the C SDK", SDK, "make sdk", board="cortex-m4"),
    "docs/guide-pico.md": guide("the C SDK", SDK, "make sdk", board="pico"),
    "docs/guide-freertos.md": guide("the C SDK", SDK, "make sdk", board="cortex-m3"),
    "docs/guide-lwip.md": guide("the C SDK", SDK, "make sdk", board="cortex-m4"),
    "docs/guide-stm32.md": guide("the C SDK", SDK, "make sdk", board="stm32f4"),
    "docs/guide-rt-thread.md": guide("the package", "mbm-rt-thread-VERSION.tar.gz", "make package KIND=rt-thread"),
    "docs/guide-rust.md": Way(f"`cargo add mbm` takes the crate. Or download `mbm-VERSION.crate` {RELEASE} and unpack it.",
                              "No release is published yet: `cargo add mbm --path FOLDER` takes the crate from a clone of mbm, and "
                              "`make package KIND=crates` there writes it, `mbm-VERSION.crate`, to the folder `dist`."),
    "docs/guide-zephyr.md": guide("the module", "mbm-zephyr-VERSION.tar.gz", "make package KIND=zephyr"),
}


def strays(text: str, repository: str, published: bool) -> list:
    """The addresses of the project in a text that it does not have. An address is the project's if it begins with the
    repository's or has the word mbm."""
    has = [repository, repository + RELEASES] if published else []
    return [web for web in (each.rstrip(".,;:/") for each in WEB.findall(text)) if web not in has and
            (web.startswith(repository) or NAME.search(web) and not web.startswith("file:"))]


def files(root: pathlib.Path) -> list:
    """The files of the project, with the names that a check shows."""
    listed = subprocess.run(["git", "ls-files"], cwd=root, text=True, capture_output=True)
    if listed.returncode:  # a tarball
        names = [path.relative_to(root).as_posix() for path in root.rglob("*")
                 if path.is_file() and path.relative_to(root).parts[0] not in ("build", "target", "dist")]
    else:
        names = listed.stdout.splitlines()
    return [(name, root / name) for name in sorted(names) if (root / name).is_file() and not NOT_LOOKED_AT.match(name)]


def unreal(root: pathlib.Path, repository: str, published: bool) -> list:
    """What is wrong with the addresses in all files of the project: pages, manifests, sources, examples."""
    why = "that is neither the repository nor its latest release" if published else "nothing is published"
    return [f"{name} has the address {web}, and {why}" for name, path in files(root)
            for web in strays(path.read_text(encoding="utf-8", errors="ignore"), repository, published)]


def found(root: pathlib.Path, patterns: list) -> list:
    return [path for pattern in patterns for path in sorted(root.glob(pattern))]


def addresses(root: pathlib.Path, address: str, published: bool, write: bool, ways: dict = WAYS) -> list:
    """Writes the address and the ways to get mbm everywhere if `write` says so. Returns what is wrong."""
    wrong = []
    for place, right, patterns in [(LINK, address, ["README.md", "docs/*.md"]), (MANIFEST, address if published else "", ["Cargo.toml"])]:
        for path in found(root, patterns):
            text = path.read_text(encoding="utf-8")
            new = place.sub(right, text)
            if new != text and write:
                path.write_text(new, encoding="utf-8")
            elif new != text:
                wrong.append(f"{path.relative_to(root)} has another address than packaging/project.toml: run `make address`")
    for path in found(root, ["README.md", "docs/index.md", "docs/guide-*.md"]):
        name = path.relative_to(root).as_posix()
        if name not in ways:
            wrong.append(f"{name}: scripts/build/project.py does not say how a reader gets mbm")
            continue
        text = path.read_text(encoding="utf-8")
        right, other = ways[name].text(address, published), ways[name].text(address, not published)
        begin, heading, rest = text.partition("\n## ")
        if write and other in begin:
            begin = begin.replace(other, right)
            path.write_text(begin + heading + rest, encoding="utf-8")
        if right not in begin:
            wrong.append(f"{name} does not begin with \"{right}\": run `make address`")
        if not published and "/releases/latest" in begin + rest:
            wrong.append(f"{name} has a link to a release, and none is published")
    return wrong


def main() -> None:
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    wrong = addresses(ROOT, fact("repository"), fact("published"), not sys.argv[1:])
    wrong += unreal(ROOT, fact("repository"), fact("published"))
    if wrong:
        sys.exit("\n".join(f"address: {what}" for what in wrong))
    print(f"address: the files of the project have {fact('repository')} and its latest release, and no other address of it" if fact("published") else
          "address: nothing is published, and no file of the project has an address of it")


if __name__ == "__main__":
    main()
