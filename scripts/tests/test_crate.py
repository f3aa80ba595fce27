"""Tests of the crate that is published."""
import pathlib
import re
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
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


if __name__ == "__main__":
    unittest.main()
