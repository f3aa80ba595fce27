"""Tests of scripts that write or judge texts: scripts/check/functions, scripts/check/dependencies, scripts/check/real,
packaging/debian/changelog, scripts/build/project.py, packaging/sbom, packaging/crates and scripts/check/steps; and of the choice of the compiler
in scripts/build/archive. `make test-scripts` has the
library for the SBOM."""
import contextlib
import copy
import importlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

from loading import ROOT, load

# --- scripts/check/functions: a question changes nothing

functions = load("scripts/check/functions")


class Names(unittest.TestCase):
    def test_a_question_that_reads_is_accepted(self):
        source = "pub fn is_due(&self, now: u32) -> bool {}\nunsafe fn has_line(node: *const Node) -> bool {}"
        self.assertEqual(functions.acting_questions(source), [])

    def test_a_question_that_may_change_something_is_refused(self):
        source = "fn ends_echo(&mut self) -> bool {}\nunsafe fn is_of<T>(\n    link: *mut T,\n) -> bool {}\nfn take_echo(&mut self) {}"
        self.assertEqual(functions.acting_questions(source), ["ends_echo", "is_of"])


# --- scripts/check/dependencies holds docs/maintainers/dependencies.md to what there is

dependencies = load("scripts/check/dependencies")

PAGE = """# Dependencies

## In the library

| crate | reason | brings |
|---|---|---|
| `vec` | holds things | `hash` |

## Python packages

| package | reason |
|---|---|
| `peer` | a peer |
"""
LISTS = {"set peers": {"peer", "helper"}}
REACH = {"vec": {"hash"}, "hash": set(), "new": set()}


def complaints_about(**present):
    kinds = {"crate in the library": {"vec", "hash"}, "Python package": {"peer"}}
    kinds.update({kind.replace("_", " "): names for kind, names in present.items()})
    return list(dependencies.complaints(dependencies.page(PAGE), kinds, REACH, LISTS))


class CheckDependencies(unittest.TestCase):
    def test_a_page_with_a_reason_for_everything_is_accepted(self):
        self.assertEqual(complaints_about(), [])

    def test_a_dependency_without_a_reason_is_refused(self):
        self.assertEqual(
            complaints_about(Python_package={"peer", "other"}),
            ["docs/maintainers/dependencies.md has no reason for the Python package `other`"],
        )

    def test_a_new_crate_is_named_with_the_crate_that_brings_it(self):
        REACH["vec"].add("new")
        self.addCleanup(REACH["vec"].discard, "new")
        self.assertEqual(
            complaints_about(crate_in_the_library={"vec", "hash", "new"}),
            ["docs/maintainers/dependencies.md has no reason for the crate in the library `new`, which `vec` brings"],
        )

    def test_a_kind_that_the_page_does_not_have_is_refused(self):
        self.assertEqual(
            complaints_about(npm_package={"linter"}), ["docs/maintainers/dependencies.md has no reason for the npm package `linter`"]
        )

    def test_a_name_that_is_not_needed_any_more_is_refused(self):
        self.assertEqual(
            complaints_about(Python_package=set()),
            ["docs/maintainers/dependencies.md names the Python package `peer`, which is not there any more"],
        )

    def test_a_crate_under_one_that_does_not_bring_it_is_refused(self):
        page = dependencies.page(PAGE.replace("`hash`", "`hash` `new`"))
        present = {"crate in the library": {"vec", "hash", "new"}, "Python package": {"peer"}}
        self.assertEqual(
            list(dependencies.complaints(page, present, REACH, LISTS)),
            ["docs/maintainers/dependencies.md says that `vec` brings `new`, but it does not"],
        )

    def test_a_list_stands_for_everything_in_it(self):
        text = PAGE.replace("| package | reason |\n|---|---|", "| package | reason | brings |\n|---|---|---|")
        page = dependencies.page(text.replace("a peer |", "a peer | `set peers` |"))
        present = {"Python package": {"peer", "helper"}}
        self.assertEqual(list(dependencies.complaints(page, present, REACH, LISTS)), [])

    def test_a_list_that_is_not_there_is_refused(self):
        text = PAGE.replace("| package | reason |\n|---|---|", "| package | reason | brings |\n|---|---|---|")
        page = dependencies.page(text.replace("a peer |", "a peer | `set old` |"))
        self.assertEqual(
            list(dependencies.complaints(page, {"Python package": {"peer"}}, REACH, LISTS)),
            ["docs/maintainers/dependencies.md names the Python package `set old`, which is not there any more"],
        )

    def test_an_empty_reason_is_refused(self):
        with self.assertRaisesRegex(SystemExit, "no reason for `peer`"):
            dependencies.page(PAGE.replace("a peer", ""))

    def test_programs_of_this_repository_are_no_dependencies(self):
        with tempfile.TemporaryDirectory() as folder:
            lock = pathlib.Path(folder) / "Cargo.lock"
            lock.write_text(
                '[[package]]\nname = "ours"\nversion = "1.0.0"\ndependencies = ["vec"]\n'
                '[[package]]\nname = "vec"\nversion = "1.0.0"\nsource = "registry"\ndependencies = ["hash 2.0.0"]\n'
                '[[package]]\nname = "hash"\nversion = "2.0.0"\nsource = "registry"\n'
            )
            self.assertEqual(dependencies.locked([lock]), {"vec": {"hash"}, "hash": set()})


# --- the changelog of the Debian package, which is made from CHANGELOG.md

debian = load("packaging/debian/changelog")

UNRELEASED = "# Changelog\n\n## [Unreleased]\n\n### Added\n\n- A thing.\n"
TWO_RELEASES = UNRELEASED + "\n## [70.3.0] - 2027-02-28\n\n- More.\n\n## [70.2.0] - 2026-12-01\n\n- First.\n"


def changelog(text, version, seconds=0):
    return debian.changelog(text.splitlines(keepends=True), version, "A Name <a@b.example>", seconds)


class DebianChangelog(unittest.TestCase):
    def test_a_version_that_is_not_released_yet_has_the_time_it_is_packed_for(self):
        self.assertEqual(
            changelog(UNRELEASED, "70.2.0", 315619200),
            "mbm (70.2.0-1) unstable; urgency=medium\n\n"
            "  * Version 70.2.0. The file changelog.gz lists the changes.\n\n"
            " -- A Name <a@b.example>  Wed, 02 Jan 1980 00:00:00 +0000\n",
        )

    def test_a_released_version_has_the_day_of_its_heading_whatever_the_time(self):
        for seconds in (0, 1800000000):
            first = changelog(TWO_RELEASES, "70.3.0", seconds).split("\n\n")[2]
            self.assertEqual(first.split("\n")[0], " -- A Name <a@b.example>  Sun, 28 Feb 2027 12:00:00 +0000")

    def test_older_versions_follow_the_packed_one(self):
        text = changelog(TWO_RELEASES, "70.4.0")
        heads = [line.split()[1] for line in text.splitlines() if line.startswith("mbm")]
        self.assertEqual(heads, ["(70.4.0-1)", "(70.3.0-1)", "(70.2.0-1)"])

    def test_a_version_newer_than_the_packed_one_is_left_out(self):
        text = changelog(TWO_RELEASES, "70.2.0")
        self.assertEqual([line for line in text.splitlines() if line.startswith("mbm")], ["mbm (70.2.0-1) unstable; urgency=medium"])


# --- the address of the project, which stands in one setting

project = load("scripts/build/project.py")


class Address(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "docs").mkdir()
        self.guide = self.root / "docs/guide-a.md"
        self.guide.write_text("# A\n\n[Get it](https://old.example/a/releases/latest).\n\n## B\n")
        self.ways = {"docs/guide-a.md": project.Way("[Get it](ADDRESS/releases/latest).", "Make it: `make a`.")}
        (self.root / "Cargo.toml").write_text('[package]\nrepository = "https://old.example/a"\n')

    def wrong(self, address="https://old.example/a", published=True, write=False):
        return project.addresses(self.root, address, published, write, self.ways)

    def test_another_address_is_found_and_then_replaced(self):
        self.assertEqual(["docs/guide-a.md has", "Cargo.toml has", "docs/guide-a.md does"],
                         [" ".join(what.split()[:2]) for what in self.wrong("https://new.example")])
        self.assertEqual(self.wrong("https://new.example", write=True), [])
        self.assertIn("(https://new.example/releases/latest)", self.guide.read_text())
        self.assertEqual(self.wrong("https://new.example"), [])

    def test_a_guide_that_does_not_begin_with_the_link_is_refused(self):
        self.guide.write_text("# A\n\n## B\n\n[Get it](https://old.example/a/releases/latest).\n")
        self.assertEqual(self.wrong(), ['docs/guide-a.md does not begin with "[Get it](https://old.example/a/releases/latest).": run `make address`'])

    def test_without_a_release_a_page_says_how_to_make_the_package(self):
        self.assertEqual(len(self.wrong(published=False)), 3)
        self.assertEqual(self.wrong(published=False, write=True), [])
        self.assertEqual(self.guide.read_text(), "# A\n\nMake it: `make a`.\n\n## B\n")
        self.assertEqual(self.wrong(published=True, write=True), [])
        self.assertEqual(self.guide.read_text(), "# A\n\n[Get it](https://old.example/a/releases/latest).\n\n## B\n")

    def test_without_a_release_no_page_links_to_one(self):
        self.wrong(published=False, write=True)
        self.guide.write_text(self.guide.read_text() + "\n[Get it](https://old.example/a/releases/latest).\n")
        self.assertEqual(self.wrong(published=False), ["docs/guide-a.md has a link to a release, and none is published"])

    def test_without_a_release_the_manifest_has_no_address(self):
        self.wrong(published=False, write=True)
        self.assertIn('repository = ""\n', (self.root / "Cargo.toml").read_text())
        self.wrong(published=True, write=True)
        self.assertIn('repository = "https://old.example/a"\n', (self.root / "Cargo.toml").read_text())

    def test_a_new_guide_needs_its_way(self):
        (self.root / "docs/guide-b.md").write_text("# B\n")
        self.assertEqual(self.wrong(), ["docs/guide-b.md: scripts/build/project.py does not say how a reader gets mbm"])


REPOSITORY = "https://forge.example/us/mbm"
# What may stand in a page, a manifest, a man page or an example while nothing is published, and what may not.
HARMLESS = ["https://modbus.org/", "see https://github.com/epsilonrt/mbpoll", "`mbm read tcp://127.0.0.1:1502 100 2`", "file:///home/you/mbm",
         "github.com/particle-iot/device-os/issues/776", "src/mbm.rs/x", "https://example.com/mbm_port.h"]
STRAYS = [REPOSITORY, f"[it]({REPOSITORY}/releases/latest)", f"{REPOSITORY}/issues/3", "https://docs.rs/mbm", "docs.rs/mbm/0.2.0/mbm",
         "https://crates.io/crates/mbm", "https://registry.platformio.org/libraries/us/mbm", "git@forge.example:us/mbm.git",
         "ssh://git@forge.example/us/mbm", "https://mbm.readthedocs.io", 'Homepage: https://mbm.example', '.UR https://forge.example/other/mbm']


class Unreal(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def unreal(self, text, published, file="docs/a.md"):
        path = self.root / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return project.unreal(self.root, REPOSITORY, published)

    def test_while_nothing_is_published_every_address_of_the_project_is_found(self):
        for text in HARMLESS:
            self.assertEqual(self.unreal(text, False), [], text)
        for text in STRAYS:
            self.assertEqual(len(self.unreal(text, False)), 1, text)

    def test_it_is_found_in_a_manifest_a_man_page_and_an_example(self):
        for file in ("packaging/x/library.properties", "cli/man/mbm.1.in", "examples/linux/a.c", "README.md", "include/mbm.h"):
            self.assertEqual(self.unreal(f"at {REPOSITORY}.", False, file), [f"{file} has the address {REPOSITORY}, and nothing is published"])
            (self.root / file).unlink()

    def test_once_published_only_the_repository_and_its_latest_release_are_there(self):
        for text in [REPOSITORY, f"[it]({REPOSITORY}/releases/latest)", *HARMLESS]:
            self.assertEqual(self.unreal(text, True), [], text)
        for text in STRAYS[2:]:
            self.assertEqual(len(self.unreal(text, True)), 1, text)

    def test_the_project_has_no_address_that_it_does_not_have(self):
        self.assertEqual(project.unreal(ROOT, project.fact("repository"), project.fact("published")), [])


class BothStates(unittest.TestCase):
    """The project's own pages and manifests, as they are now and once the project is published."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "docs").mkdir()
        for path in [ROOT / "README.md", ROOT / "Cargo.toml", *sorted((ROOT / "docs").glob("*.md"))]:
            shutil.copy(path, self.root / path.relative_to(ROOT))

    def texts(self):
        return {path.relative_to(self.root).as_posix(): path.read_text(encoding="utf-8") for path in self.root.rglob("*") if path.is_file()}

    def test_a_published_project_has_a_download_in_each_page_that_a_user_begins_with_and_back_again_none(self):
        repository, now = project.fact("repository"), project.fact("published")
        before = self.texts()
        for published in (not now, now):
            self.assertEqual(project.addresses(self.root, repository, published, True), [])
            self.assertEqual(project.addresses(self.root, repository, published, False), [])
            self.assertEqual(project.unreal(self.root, repository, published), [])
            for page in project.WAYS:
                begin = self.texts()[page].partition("\n## ")[0]
                self.assertEqual(f"({repository}/releases/latest)" in begin, published, page)
                self.assertEqual("No release is published" in begin or "no release is published" in begin, not published, page)
        self.assertEqual(self.texts(), before)

    def test_packages_name_the_address_only_once_it_is_published(self):
        sys.path.insert(0, str(ROOT / "scripts/build"))
        self.addCleanup(sys.path.remove, str(ROOT / "scripts/build"))
        scripts_project = importlib.import_module("project")
        for published in (True, False):
            facts = dict(repository=REPOSITORY, published=published, authors="us", description="it")
            with unittest.mock.patch.object(scripts_project, "fact", facts.get):
                for script, text in (("packaging/arduino/library", lambda module: module.properties()),
                                     ("packaging/platformio/pack", lambda module: str(module.manifest([])))):
                    module = load(script)
                    self.assertEqual(REPOSITORY in text(module), published, script)


def program(path, *lines):
    """Writes a shell script."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    path.chmod(0o755)


# --- the compiler that is measured and that ships

MEASURED = subprocess.run([ROOT / "scripts/build/archive", "--compiler"], check=True, capture_output=True, text=True).stdout.strip()
OTHER = "rustc 1.42.0 (b8cedc004 2020-03-09)"


class Compiler(unittest.TestCase):
    """Runs scripts/build/archive and scripts/check/compiler in a folder of their own. Programs stand for the compilers,
    that of Debian in `debian`, rustup's in the path. Each Cargo prints its name and fails, so nothing is built."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for script in ("scripts/build/archive", "scripts/check/compiler", "scripts/need"):
            (self.root / script).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / script, self.root / script)
        path = self.root / "scripts/build/archive"
        text = path.read_text()
        self.assertIn("${MBM_RUST:-/usr/bin}", text)
        path.write_text(text.replace("${MBM_RUST:-/usr/bin}", f"${{MBM_RUST:-{self.root}/debian}}"))
        self.compiler("debian", MEASURED)
        self.compiler("path", OTHER)
        program(self.root / "path/rustup", "echo thumbv6m-none-eabi", "echo aarch64-unknown-linux-gnu", "echo rust-src")
        program(self.root / "path/dpkg-query", "echo install ok installed")
        for tool in ("ar", "ld", "objcopy"):
            program(self.root / f"path/aarch64-linux-gnu-{tool}")

    def compiler(self, folder, version):
        program(self.root / folder / "rustc", f"case $1 in --version) echo '{version}' ;; *) echo '{{}}' ;; esac")
        program(self.root / folder / "cargo", f"echo Cargo of {folder} >&2", "exit 7")

    def run_script(self, *command, **more):
        kept = {name: value for name, value in os.environ.items() if not name.startswith("MBM_")}
        return subprocess.run(command, cwd=self.root, env={**kept, "PATH": f"{self.root}/path:{os.environ['PATH']}", **more},
                              capture_output=True, text=True)

    def build(self, **more):
        return self.run_script("scripts/build/archive", "cortex-m0plus", **more)

    def test_a_target_that_rustup_has_does_not_change_the_compiler(self):
        self.assertEqual(self.build().stderr, "Cargo of debian\n")

    def test_another_machine_has_the_same_compiler(self):
        found = self.run_script("scripts/build/archive", "--host", "build/arm/libmbm.a", MBM_MACHINE="aarch64-linux-gnu")
        self.assertEqual(found.stderr, "Cargo of debian\n")

    def test_another_version_of_the_compiler_builds_nothing(self):
        self.compiler("debian", OTHER)
        for more in ({}, {"MBM_RUST": ""}):
            found = self.build(**more)
            self.assertEqual(found.returncode, 1)
            self.assertIn(f"is {OTHER}, but what is measured and shipped is built by {MEASURED}", found.stderr)
            self.assertNotIn("Cargo", found.stderr)

    def test_a_compiler_that_is_missing_is_named(self):
        shutil.rmtree(self.root / "debian")
        found = self.build()
        self.assertEqual(found.returncode, 1)
        self.assertIn(f"there is no compiler {self.root}/debian/rustc", found.stderr)

    def test_another_compiler_is_taken_by_its_folder_only(self):
        self.assertEqual(self.build(MBM_RUST=str(self.root / "path")).stderr, "Cargo of path\n")

    def check(self, folder, name):
        if name:
            (self.root / folder).mkdir(parents=True)
            (self.root / folder / "compiler").write_text(name + "\n")
        return self.run_script("scripts/check/compiler", *sorted(str(path) for path in (self.root / "build").glob("*/*")))

    def test_the_check_refuses_the_archive_of_another_compiler(self):
        self.assertEqual(self.check("build/archives/cortex-m0", MEASURED).returncode, 0)
        found = self.check("build/archives/cortex-m4", OTHER)
        self.assertEqual(found.returncode, 1)
        self.assertIn(f"build/archives/cortex-m4 was built by {OTHER}, but", found.stderr)

    def test_the_check_refuses_an_archive_without_the_name_of_its_compiler(self):
        (self.root / "build/archives/cortex-m0").mkdir(parents=True)
        self.assertIn("cortex-m0/compiler is missing", self.check("", "").stderr)

    def test_the_check_of_nothing_fails(self):
        self.assertEqual(self.check("", "").returncode, 1)

    def test_the_check_refuses_a_page_of_another_compiler(self):
        page = self.root / "docs/reports/size.md"
        page.parent.mkdir(parents=True)
        page.write_text(f"Measured with {MEASURED}.\n")
        self.assertEqual(self.run_script("scripts/check/compiler", "--page").returncode, 0)
        page.write_text(f"Measured with {OTHER}.\n")
        found = self.run_script("scripts/check/compiler", "--page")
        self.assertEqual(found.returncode, 1)
        self.assertIn(f"archives are built by {MEASURED}, but docs/reports/size.md was not measured with it", found.stderr)


# --- the packages and the families of boards of the Arduino library

boards = load("scripts/build/boards.py")


class Boards(unittest.TestCase):
    """Runs scripts/build/assembler on a system that lacks packages: `dpkg-query` says which."""

    def assemble(self, missing, named=""):
        with tempfile.TemporaryDirectory() as folder:
            program(pathlib.Path(folder) / "dpkg-query",
                    f"case {' '.join(missing)} in *$4*) exit 1 ;; esac", "echo install ok installed")
            return subprocess.run([ROOT / "scripts/build/archive", "--packages", *(
                row.mcu for row in boards.SETS.values() if row.kind in self.kinds(named))],
                env={**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "MBM_INSTALL": "no"}, capture_output=True, text=True)

    def kinds(self, named):
        with unittest.mock.patch.dict(os.environ, {"MBM_BOARDS": named}):
            return {row.kind for row in boards.sets().values()}

    def test_a_package_that_only_the_last_build_needs_is_named_before_the_first(self):
        found = self.assemble(["llvm-22"])
        self.assertEqual(found.returncode, 1)
        self.assertIn("Debian packages are missing: llvm-22", found.stderr)

    def test_all_missing_packages_are_named_at_once(self):
        self.assertIn("missing: binutils-arm-none-eabi binutils-xtensa-lx106 llvm-22",
                      self.assemble(["binutils-arm-none-eabi,binutils-xtensa-lx106,llvm-22"]).stderr)

    def test_a_family_needs_no_other_familys_packages(self):
        self.assertEqual(self.assemble(["llvm-22,binutils-arm-none-eabi,binutils-xtensa-lx106,binutils-riscv64-unknown-elf"], "avr").returncode, 0)
        self.assertEqual(self.kinds("avr"), {"avr"})
        self.assertEqual(self.kinds("arm esp8266"), {"arm", "xtensa"})
        self.assertEqual(self.kinds("esp32"), {"bytes", "riscv"})
        self.assertEqual(self.kinds(""), {row.kind for row in boards.SETS.values()})

    def test_every_dialect_belongs_to_a_family(self):
        self.assertEqual({kind for kinds, _ in boards.FAMILIES.values() for kind in kinds}, {row.kind for row in boards.SETS.values()})

    def test_a_board_needs_its_own_instruction_set_alone(self):
        with unittest.mock.patch.dict(os.environ, {"MBM_BOARDS": "uno pico2"}):
            self.assertEqual(list(boards.sets()), ["avr5", "armv7m"])
            self.assertEqual(boards.named_archives(), ["atmega328p", "cortex-m33"])

    def test_a_board_may_be_written_in_capitals_and_with_other_hyphens(self):
        with unittest.mock.patch.dict(os.environ, {"MBM_BOARDS": "ESP32-C3 Nano_Every"}):
            self.assertEqual(boards.named(), ["esp32c3", "nano-every"])

    def test_boards_and_families_have_the_names_that_people_use(self):
        for name, board, archive in (
            ("Uno", "uno", "atmega328p"), ("arduino-mega", "mega", "atmega2560"), ("leonardo", "leonardo", "atmega32u4"),
            ("ESP32", "esp32", "esp32"), ("ESP32-C3", "esp32c3", "esp32c3"), ("esp32-s3-devkitc", "esp32s3", "esp32"),
            ("Pico", "pico", "cortex-m0plus"), ("Blue-Pill", "bluepill", "cortex-m3"), ("blackpill", "blackpill", "cortex-m4"),
            ("nucleo-f401re", "stm32f4", "cortex-m4"), ("NUCLEO_G071RB", "stm32g0", "cortex-m0plus"), ("stm32f103c8", "stm32f1", "cortex-m3"),
            ("stm32wba52", "stm32wba", "cortex-m33"), ("teensy4.1", "teensy4", "cortex-m7"), ("teensyLC", "teensy-lc", "cortex-m0plus"),
            ("atmega328pb", "atmega328", "atmega328p"), ("nucleo", "nucleo", None), ("teensy", "teensy", None),
        ):
            with self.subTest(name):
                self.assertEqual((boards.known(name), boards.archive_of(name)), (board, archive))

    def test_no_two_boards_have_the_same_plain_name(self):
        plain = [boards.plain(name) for name in boards.names()]
        self.assertEqual(len(plain), len(set(plain)))

    def test_boards_may_stand_between_commas(self):
        with unittest.mock.patch.dict(os.environ, {"MBM_BOARDS": "uno,pico, mega"}):
            self.assertEqual(boards.named(), ["uno", "pico", "mega"])

    def test_a_family_has_the_cores_of_arduino_that_it_names_and_a_board_those_of_its_instruction_set(self):
        with unittest.mock.patch.dict(os.environ, {"MBM_BOARDS": "esp32"}):
            self.assertEqual(boards.architectures(), ["esp32"])
        with unittest.mock.patch.dict(os.environ, {"MBM_BOARDS": "uno"}):
            self.assertEqual(boards.architectures(), ["avr", "megaavr"])

    def test_every_archive_belongs_to_an_instruction_set(self):
        built = subprocess.run([ROOT / "scripts/build/archive", "--list"], check=True, capture_output=True, text=True).stdout.split()
        # The Nano Every takes assembler source.
        self.assertEqual(sorted(boards.archives()), sorted([*built, "atmega4809"]))
        self.assertEqual(set(boards.BOARDS) - set(boards.archives()), set())

    def test_a_board_that_is_not_there_is_refused_with_the_nearest_names(self):
        with self.assertRaisesRegex(SystemExit, 'there is no board or family "unno"; the nearest names are uno'):
            self.kinds("unno")


# --- what a new machine lacks


class Need(unittest.TestCase):
    """Runs scripts/need on a machine that has the packages `present`, and the Cargo of a test."""

    def need(self, *packages, present=(), cargo="no-cargo", install="no"):
        with tempfile.TemporaryDirectory() as folder:
            program(pathlib.Path(folder) / "dpkg-query", f"case ' {' '.join(present)} ' in *\" $4 \"*) echo install ok installed ;; *) exit 1 ;; esac")
            program(pathlib.Path(folder) / "sudo", "exit 0")
            for version in ("1.95.0", "1.65.0"):
                program(pathlib.Path(folder) / f"cargo-{version}", f"echo 'cargo {version} (abc 2026-01-01)'")
            for name in ("apt-get", "flock"):
                program(pathlib.Path(folder) / name, f"echo {name} \"$*\"", "exit 3")
            return subprocess.run([ROOT / "scripts/need", *packages], capture_output=True, text=True, env={
                "PATH": f"{folder}:/usr/bin:/bin", "CARGO": cargo, "MBM_INSTALL": install})

    def test_without_rust_the_one_of_debian_is_named_beside_the_other_packages(self):
        found = self.need("rust", "gcc", "help2man", present=["gcc"])
        self.assertEqual(found.returncode, 1)
        self.assertIn("Debian packages are missing: rustc-web cargo-web help2man\n", found.stderr)

    def test_a_rust_that_is_new_enough_needs_no_package(self):
        found = self.need("rust", "gcc", present=["gcc"], cargo="cargo-1.95.0")
        self.assertEqual((found.returncode, found.stderr), (0, ""))

    def test_an_old_rust_is_named_with_what_makes_it_newer(self):
        found = self.need("rust", "gcc", present=["gcc"], cargo="cargo-1.65.0")
        self.assertEqual(found.returncode, 1)
        self.assertRegex(found.stderr, r"Rust 1.88 or later is needed, but .*cargo-1.65.0 --version says: cargo 1.65.0 .*`rustup update`")

    def test_packages_of_debian_that_are_in_the_way_are_not_removed_but_named(self):
        found = self.need("rust", present=["rustc", "cargo"], install="")
        self.assertEqual(found.returncode, 1)
        self.assertIn("apt-get remove rustc cargo\n", found.stderr)
        self.assertNotIn("apt-get update", found.stderr)

    def test_a_package_is_named_once(self):
        self.assertIn("missing: rustc-web cargo-web gcc\n", self.need("rust", "gcc", "rustc-web", "gcc").stderr)

    def test_what_every_board_needs_is_known_without_python(self):
        with tempfile.TemporaryDirectory() as folder:
            program(pathlib.Path(folder) / "dpkg-query", "exit 1")
            found = subprocess.run([ROOT / "scripts/build/archive", "--packages", "--", "python3"],
                                   env={**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "MBM_INSTALL": "no", "MBM_RUST": ""},
                                   capture_output=True, text=True)
            self.assertIn("missing: cargo-web python3 rust-web-src rustc-web\n", found.stderr)

    def test_the_packages_that_a_caller_adds_are_named_in_the_same_sentence(self):
        with tempfile.TemporaryDirectory() as folder:
            program(pathlib.Path(folder) / "dpkg-query", "exit 1")
            found = subprocess.run([ROOT / "scripts/build/archive", "--packages", "atmega328p", "cortex-m4", "--", "pkg-config"],
                                   env={**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "MBM_INSTALL": "no", "MBM_RUST": ""},
                                   capture_output=True, text=True)
            self.assertIn("missing: binutils-arm-none-eabi binutils-avr cargo-web pkg-config rust-web-src rustc-web\n", found.stderr)


class Owner(unittest.TestCase):
    """Runs scripts/build/install and install-tool as a user who may not write to PREFIX."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        self.root.chmod(0o755)
        for script in ("install", "install-tool", "library.sh"):
            (self.root / "scripts/build").mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / "scripts/build" / script, self.root / "scripts/build")
        self.prefix = self.root / "prefix"
        self.prefix.mkdir()
        self.prefix.chmod(0o555)
        for tool in ("sh", "dirname", "env"):
            (self.root / "path").mkdir(exist_ok=True)
            (self.root / "path" / tool).symlink_to(shutil.which(tool))
        self.nobody = {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}

    def install(self, script, *arguments, **more):
        return subprocess.run(["/bin/sh", self.root / "scripts/build" / script, *arguments], capture_output=True, text=True, **self.nobody,
                              env={"PATH": str(self.root / "path"), "PREFIX": str(self.prefix), **more})

    def test_sudo_installs_where_the_user_may_not(self):
        program(self.root / "path/sudo", 'echo "sudo $*"')
        for script in ("install", "install-tool"):
            checked = self.install(script, "--check")
            self.assertEqual(checked.returncode, 0)
            self.assertIn(f"{script}: {self.prefix} is not yours, so sudo installs there in the end. PREFIX=$HOME/.local", checked.stdout)
            installed = self.install(script)
            self.assertRegex(installed.stdout, f"^sudo env PREFIX={self.prefix} .*scripts/build/{script}\n$")

    def test_without_sudo_a_user_learns_where_to_install_before_anything_is_built(self):
        for more in ({}, {"MBM_INSTALL": "no"}):
            if more:
                program(self.root / "path/sudo", "echo called")
            checked = self.install("install-tool", "--check", **more)
            self.assertEqual((checked.returncode, checked.stdout), (1, ""))
            self.assertIn(f"you may not write to {self.prefix}. PREFIX=$HOME/.local installs for you alone", checked.stderr)

    def test_a_folder_of_the_user_needs_no_sudo(self):
        self.prefix.chmod(0o777)
        checked = self.install("install", "--check")
        self.assertEqual((checked.returncode, checked.stdout, checked.stderr), (0, "", ""))


# --- the SBOM

sbom = load("packaging/sbom/sbom.py")
check = load("packaging/sbom/check.py")

LOCK = {
    "mbm-c": {"name": "mbm-c", "version": "1.0.0", "dependencies": ["mbm", "cc"]},
    "mbm": {"name": "mbm", "version": "1.0.0", "dependencies": ["vec"]},
    "vec": {"name": "vec", "version": "0.9.0", "checksum": "aa"},
    "cc": {"name": "cc", "version": "1.2.0", "checksum": "bb"},
}


def part(name, version, *, scope="required", kind="cargo", hashes=()):
    return {
        "name": name,
        "version": version,
        "purl": f"pkg:{kind}/{name}@{version}",
        "scope": scope,
        "licenses": [{"expression": "MIT"}],
        "hashes": [{"content": content} for content in hashes],
        "properties": [{"name": "mbm:for", "value": "tests"}] if scope == "excluded" else [],
    }


RIGHT = {
    "components": [
        part("mbm", "1.0.0"),
        part("mbm-c", "1.0.0"),
        part("mbm-archive", "1.0.0"),
        part("rust-core", "1.95.0", kind="generic"),
        part("vec", "0.9.0", hashes=["aa"]),
        part("cc", "1.2.0", scope="excluded", hashes=["bb"]),
    ]
}


def complaints(change=None):
    data = copy.deepcopy(RIGHT)
    if change:
        change({component["name"]: component for component in data["components"]}, data["components"])
    return list(check.complaints(data, LOCK))


class Check(unittest.TestCase):
    def test_an_sbom_that_agrees_with_the_crate_is_accepted(self):
        self.assertEqual(complaints(), [])

    def test_a_crate_that_is_missing_is_refused(self):
        self.assertEqual(
            complaints(lambda names, every: every.remove(names["cc"])),
            ["cc 1.2.0 is missing, to which the crate is locked"],
        )

    def test_a_crate_of_another_hash_is_refused(self):
        self.assertEqual(
            complaints(lambda names, every: names["vec"].update(hashes=[{"content": "cc"}])),
            ["vec has another hash than in the crate"],
        )

    def test_a_crate_of_the_library_that_is_said_to_be_for_tests_is_refused(self):
        found = complaints(lambda names, every: names["vec"].update(scope="excluded"))
        self.assertIn("and contains ['mbm', 'mbm-archive', 'mbm-c', 'rust-core', 'vec']", found[0])

    def test_a_crate_for_tests_that_is_said_to_be_in_the_library_is_refused(self):
        found = complaints(lambda names, every: names["cc"].update(scope="required"))
        self.assertIn("said to contain ['cc', ", found[0])

    def test_a_part_of_the_library_without_a_licence_is_refused(self):
        self.assertEqual(
            complaints(lambda names, every: names["vec"].pop("licenses")), ["vec is in the library and has no licence"]
        )

    def test_text_that_is_no_cyclonedx_is_refused(self):
        self.assertIsNone(check.schema_error('{"bomFormat": "CycloneDX", "specVersion": "1.6"}'))
        self.assertIsNotNone(check.schema_error('{"bomFormat": "CycloneDX", "specVersion": "1.6", "components": 1}'))


class Tools(unittest.TestCase):
    def test_the_version_of_a_tool_may_be_a_variable_of_make(self):
        text = "BINDER := 1.2.3\nA = scripts/cargo-tool binder $(BINDER)\nB = scripts/cargo-tool judge 4.5.6 --locked\n"
        self.assertEqual(list(sbom.tools_of(text)), [("binder", "1.2.3"), ("judge", "4.5.6")])


class Shipped(unittest.TestCase):
    def test_only_what_is_compiled_into_the_archive_is_in_the_library(self):
        with contextlib.chdir(ROOT):
            purpose, options = sbom.PURPOSES[0]
            names = {name for name, _ in sbom.tree(options)}
        self.assertIsNone(purpose)
        self.assertLessEqual({"mbm", "mbm-c", "mbm-archive", "heapless", "crc"}, names)
        # For tests, for a build script, and behind a feature that another crate of the workspace switches on.
        self.assertFalse(names & {"proptest", "cc", "embedded-io", "cortex-m-rt"})


# --- scripts/check/real judges a program by what it prints and by what a device heard

real = load("scripts/check/real")
REQUEST = "06:00:00.000000  pty:line  received  unit 17  request    03 read holding registers " + real.REQUEST
REPLY = "06:00:00.004000  pty:line  sent      unit 17  reply      03 read holding registers: 2301 50 " + real.REPLY
STRAY = "06:00:00.000000  pty:line  received  incomplete frame, 1 bytes [00]"


def wrong(printed=real.REGISTERS, trace=(REQUEST, REPLY), stray=""):
    return real.judge("board", printed, "\n".join(trace), [real.REGISTERS], stray)


class Real(unittest.TestCase):
    def test_the_registers_and_only_requests_are_right(self):
        self.assertEqual(wrong(), "")
        self.assertEqual(wrong(trace=(STRAY, REQUEST, REPLY), stray="1 bytes [00]"), "")

    def test_other_registers_or_none_in_between_are_wrong(self):
        self.assertIn("prints something else", wrong(printed="registers 100 and 101: 2301 51"))
        self.assertIn("prints something else", wrong(printed=f"no registers: late\n{real.REGISTERS}"))

    def test_a_byte_that_is_no_request_is_wrong(self):
        self.assertIn("sends other bytes", wrong(trace=(STRAY, REQUEST, REPLY)))
        self.assertIn("sends other bytes", wrong(trace=(REQUEST, STRAY, REPLY)))

    def test_a_byte_that_is_expected_and_does_not_come_is_wrong(self):
        self.assertIn("does not begin with", wrong(stray="1 bytes [00]"))

    def test_a_program_that_asks_nothing_or_is_not_answered_is_wrong(self):
        self.assertIn("sends other bytes", wrong(trace=()))
        self.assertIn("sends other bytes", wrong(trace=(REQUEST,)))

    def test_a_warning_counts_only_in_a_file_of_mbm(self):
        with tempfile.TemporaryDirectory() as folder:
            log = pathlib.Path(folder) / "log"
            log.write_text("kernel/sched.c:3:1: warning: theirs\n")
            real.no_warning(log)
            log.write_text("modules/mbm/src/mbm_zephyr.c:3:1: warning: ours\n")
            with self.assertRaises(SystemExit):
                real.no_warning(log)

    def test_a_kit_a_board_or_a_folder_that_is_not_there_is_refused(self):
        with self.assertRaisesRegex(SystemExit, "is missing"):
            real.there(pathlib.Path("/nowhere/zephyr"))
        for arguments in ([], ["linux", "."], ["zephyr", ".", "uno"]):
            with self.subTest(arguments), unittest.mock.patch.object(sys, "argv", ["real", *arguments]):
                self.assertRaises(SystemExit, real.main)


# --- packaging/crates: the crate that is published

INCLUDE = re.compile(r'include(?:_str|_bytes)?!\("([^"]+)"\)')


class Crate(unittest.TestCase):
    def test_it_has_every_file_that_its_sources_include(self):
        with tempfile.TemporaryDirectory() as folder:
            stage = pathlib.Path(folder, "stage")
            subprocess.run(["packaging/crates/pack", "--stage", str(stage)], cwd=ROOT, check=True)
            listed = subprocess.run(["cargo", "package", "--package=mbm", "--list", "--allow-dirty", "--offline"],
                                    cwd=stage, check=True, capture_output=True, text=True).stdout.splitlines()
        included = [((ROOT / name).parent / path).resolve().relative_to(ROOT).as_posix()
                    for name in listed if name.endswith(".rs") for path in INCLUDE.findall((ROOT / name).read_text())]
        self.assertIn("README.md", included)
        self.assertEqual([path for path in included if path not in listed], [])


# --- scripts/check/steps

STEPS = ROOT / "scripts/check/steps"


def run_steps(commands, *options):
    done = subprocess.run([STEPS, *options, "name"], input="\n".join(commands) + "\n", stdout=subprocess.PIPE, text=True)
    return done.returncode, done.stdout.splitlines()


class Steps(unittest.TestCase):
    def test_each_step_has_its_time_and_the_last_line_the_total(self):
        code, lines = run_steps(["# a comment", "true", "sleep 1"])
        self.assertEqual(code, 0)
        self.assertRegex(lines[-2], r"^name: +[1-9]\d* s  sleep 1$")
        self.assertRegex(lines[-1], r"^name: 2 steps, 0 failed, [1-9]\d* s$")

    def test_the_first_failure_ends_it(self):
        code, lines = run_steps(["false", "echo went on"])
        self.assertEqual(code, 1)
        self.assertNotIn("went on", lines)
        self.assertIn("1 steps, 1 failed", lines[-1])

    def test_it_may_keep_going_and_fails_at_the_end(self):
        code, lines = run_steps(["false", "echo went on"], "--keep-going")
        self.assertEqual(code, 1)
        self.assertIn("went on", lines)
        self.assertIn("2 steps, 1 failed", lines[-1])

    def test_no_step_is_a_failure(self):
        self.assertEqual(run_steps(["# nothing"])[0], 1)

    def test_a_step_does_not_read_the_list(self):
        self.assertIn("2 steps, 0 failed", run_steps(["cat", "true"])[1][-1])


if __name__ == "__main__":
    unittest.main()
