"""scripts/check/dependencies holds docs/dependencies.md to what there is."""
import pathlib
import tempfile
import unittest

from scripts_under_test import load

module = load("scripts/check/dependencies")

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
LISTS = {"peers/requirements.txt": {"peer", "helper"}}
REACH = {"vec": {"hash"}, "hash": set(), "new": set()}


def complaints(**present):
    kinds = {"crate in the library": {"vec", "hash"}, "Python package": {"peer"}}
    kinds.update({kind.replace("_", " "): names for kind, names in present.items()})
    return list(module.complaints(module.page(PAGE), kinds, REACH, LISTS))


class CheckDependencies(unittest.TestCase):
    def test_a_page_with_a_reason_for_everything_is_accepted(self):
        self.assertEqual(complaints(), [])

    def test_a_dependency_without_a_reason_is_refused(self):
        self.assertEqual(
            complaints(Python_package={"peer", "other"}),
            ["docs/dependencies.md has no reason for the Python package `other`"],
        )

    def test_a_new_crate_is_named_with_the_crate_that_brings_it(self):
        REACH["vec"].add("new")
        self.addCleanup(REACH["vec"].discard, "new")
        self.assertEqual(
            complaints(crate_in_the_library={"vec", "hash", "new"}),
            ["docs/dependencies.md has no reason for the crate in the library `new`, which `vec` brings"],
        )

    def test_a_kind_that_the_page_does_not_have_is_refused(self):
        self.assertEqual(
            complaints(npm_package={"linter"}), ["docs/dependencies.md has no reason for the npm package `linter`"]
        )

    def test_a_name_that_is_not_needed_any_more_is_refused(self):
        self.assertEqual(
            complaints(Python_package=set()),
            ["docs/dependencies.md names the Python package `peer`, which is not there any more"],
        )

    def test_a_crate_under_one_that_does_not_bring_it_is_refused(self):
        page = module.page(PAGE.replace("`hash`", "`hash` `new`"))
        present = {"crate in the library": {"vec", "hash", "new"}, "Python package": {"peer"}}
        self.assertEqual(
            list(module.complaints(page, present, REACH, LISTS)),
            ["docs/dependencies.md says that `vec` brings `new`, but it does not"],
        )

    def test_a_list_stands_for_everything_in_it(self):
        text = PAGE.replace("| package | reason |\n|---|---|", "| package | reason | brings |\n|---|---|---|")
        page = module.page(text.replace("a peer |", "a peer | `peers/requirements.txt` |"))
        present = {"Python package": {"peer", "helper"}}
        self.assertEqual(list(module.complaints(page, present, REACH, LISTS)), [])

    def test_a_list_that_is_not_there_is_refused(self):
        text = PAGE.replace("| package | reason |\n|---|---|", "| package | reason | brings |\n|---|---|---|")
        page = module.page(text.replace("a peer |", "a peer | `old/requirements.txt` |"))
        self.assertEqual(
            list(module.complaints(page, {"Python package": {"peer"}}, REACH, LISTS)),
            ["docs/dependencies.md names the Python package `old/requirements.txt`, which is not there any more"],
        )

    def test_an_empty_reason_is_refused(self):
        with self.assertRaisesRegex(SystemExit, "no reason for `peer`"):
            module.page(PAGE.replace("a peer", ""))

    def test_programs_of_this_repository_are_no_dependencies(self):
        with tempfile.TemporaryDirectory() as folder:
            lock = pathlib.Path(folder) / "Cargo.lock"
            lock.write_text(
                '[[package]]\nname = "ours"\nversion = "1.0.0"\ndependencies = ["vec"]\n'
                '[[package]]\nname = "vec"\nversion = "1.0.0"\nsource = "registry"\ndependencies = ["hash 2.0.0"]\n'
                '[[package]]\nname = "hash"\nversion = "2.0.0"\nsource = "registry"\n'
            )
            self.assertEqual(module.locked([lock]), {"vec": {"hash"}, "hash": set()})


if __name__ == "__main__":
    unittest.main()
