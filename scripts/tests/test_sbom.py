"""The SBOM that packaging/sbom writes and checks. `make test-scripts` has the library for it."""
import copy
import unittest

from scripts_under_test import load

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
        def dep(name, kind):
            return {"pkg": name, "dep_kinds": [{"kind": kind}]}

        nodes = [
            {"id": "archive", "deps": [dep("core", None)]},
            {"id": "core", "deps": [dep("vec", None), dep("tester", "dev"), dep("compiler", "build")]},
            {"id": "vec", "deps": []},
            {"id": "tester", "deps": [dep("random", None)]},
            {"id": "compiler", "deps": []},
            {"id": "random", "deps": []},
        ]
        self.assertEqual(sbom.shipped({"nodes": nodes}, "archive"), {"archive", "core", "vec"})


if __name__ == "__main__":
    unittest.main()
