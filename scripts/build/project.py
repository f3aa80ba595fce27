#!/usr/bin/env python3
"""Facts about the project, for the scripts that write packages and pages: its version, its licence
and the entries of packaging/project.toml. boards.py knows the boards.

  project.py           writes the project's address into the links to its releases and into Cargo.toml, and how a
                       reader gets mbm into the pages that a user begins with
  project.py --check   fails if something else stands there
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


def licence() -> str:
    """Both licences in one text."""
    mit, apache = ((ROOT / f"LICENSE-{name}").read_text(encoding="utf-8") for name in ("MIT", "APACHE"))
    return ("mbm is licensed under either of the two licences below, at your choice.\n\n"
            f"{mit}\n{'-' * 78}\n\n{apache}")


# --- the address of the project and whether it has releases, both set in packaging/project.toml

ADDRESS = [(re.compile(r"https?://[^\s()]+(?=/releases/latest\b)"), ["README.md", "docs/*.md"]),
           (re.compile(r'(?<=^repository = ")[^"]+', re.M), ["Cargo.toml"])]


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
                     "No release is published yet: **[make the packages from a clone](#install)**, then start with"),
    "docs/index.md": Way("**[Download](ADDRESS/releases/latest)** then start with",
                         "**[Make it from a clone](../README.md#install)** as no release is published yet, then start with"),
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


def found(root: pathlib.Path, patterns: list) -> list:
    return [path for pattern in patterns for path in sorted(root.glob(pattern))]


def addresses(root: pathlib.Path, address: str, published: bool, write: bool, ways: dict = WAYS) -> list:
    """Writes the address and the ways to get mbm everywhere if `write` says so. Returns what is wrong."""
    wrong = []
    for place, patterns in ADDRESS:
        for path in found(root, patterns):
            text = path.read_text(encoding="utf-8")
            new = place.sub(address, text)
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
    if wrong:
        sys.exit("\n".join(f"address: {what}" for what in wrong))
    print(f"address: pages and Cargo.toml have {fact('repository')}, " +
          ("with releases" if fact("published") else "without a release"))


if __name__ == "__main__":
    main()
