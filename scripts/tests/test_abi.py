"""Tests of scripts/check/abi, in a repository with copies of the headers."""
import pathlib
import platform
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parents[2]
COPIED = ["include", "ports/linux", "scripts/check/abi", "scripts/build/exports", "packaging/project.toml"]
OWNER = ["-c", "user.name=a test", "-c", "user.email=test@localhost"]


@unittest.skipUnless(platform.machine() == "x86_64", "scripts/check/abi compares on x86_64 alone")
class CheckAbi(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.tree = pathlib.Path(folder.name)
        for name in COPIED:
            (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, self.tree / name)
        self.git("init", "--quiet", "--initial-branch", "main")
        self.git("add", "--all")
        self.git(*OWNER, "commit", "--quiet", "-m", "start")

    def git(self, *command):
        subprocess.run(["git", *command], cwd=self.tree, check=True)

    def edit(self, name, old, new):
        path = self.tree / name
        self.assertIn(old, path.read_text())
        path.write_text(path.read_text().replace(old, new, 1))

    def answer(self, *arguments):
        done = subprocess.run(["scripts/check/abi", *arguments], cwd=self.tree, capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr

    def add_a_function(self):
        self.edit("include/mbm/base.h", "const char *mbm_version(void);", "const char *mbm_version(void);\nint mbm_answer(void);")

    def test_before_the_first_release_it_says_that_nothing_was_compared(self):
        code, output, _ = self.answer()
        self.assertEqual(code, 0)
        self.assertIn("nothing was compared: no release yet", output)

    def test_a_shallow_clone_without_tags_is_named(self):
        self.git("clone", "--quiet", "--depth", "1", f"file://{self.tree}", "shallow")
        self.tree = self.tree / "shallow"
        code, output, _ = self.answer()
        self.assertEqual(code, 0)
        self.assertIn("this is a shallow clone", output)

    def test_the_greatest_tag_is_compared_with(self):
        self.git("tag", "v0.2.0")
        self.add_a_function()
        self.git(*OWNER, "commit", "--quiet", "--all", "-m", "a function more")
        self.git("tag", "v0.10.0")
        code, output, _ = self.answer()
        self.assertEqual(code, 0)
        self.assertIn("the change of the interface since v0.10.0: same", output)
        self.assertEqual(self.answer("--since", "v0.2.0")[1], "addition\n")

    def test_an_addition_is_admitted(self):
        self.git("tag", "v0.2.0")
        self.add_a_function()
        code, output, _ = self.answer()
        self.assertEqual(code, 0)
        self.assertIn("since v0.2.0: addition", output)

    def test_a_break_needs_another_soname(self):
        self.git("tag", "v0.2.0")
        self.edit("include/mbm/base.h", "const char *mbm_version(void);", "int mbm_version(void);")
        self.assertEqual(self.answer("--since", "v0.2.0")[1], "break\n")
        code, _, errors = self.answer()
        self.assertEqual(code, 1)
        self.assertIn("mbm_version", errors)
        self.assertIn("count up soname", errors)
        self.edit("packaging/project.toml", 'soname = "0"', 'soname = "1"')
        code, output, _ = self.answer()
        self.assertEqual(code, 0)
        self.assertIn("since v0.2.0: break", output)

    def test_the_version_may_change_and_a_constant_may_not(self):
        self.git("tag", "v0.2.0")
        self.edit("include/mbm/base.h", "#define MBM_VERSION_PATCH ", "#define MBM_VERSION_PATCH 9")
        self.assertEqual(self.answer("--since", "v0.2.0")[1], "same\n")
        header = next(path for path in (self.tree / "include/mbm").glob("*.h") if "#define MBM_MAX_PDU 253" in path.read_text())
        self.edit(header.relative_to(self.tree), "#define MBM_MAX_PDU 253", "#define MBM_MAX_PDU 252")
        self.assertEqual(self.answer("--since", "v0.2.0")[1], "break\n")

    def test_a_function_that_is_not_found_is_an_error(self):
        self.edit("scripts/build/exports", "| sort -u", "| sort -u; echo mbm_other")
        code, _, errors = self.answer()
        self.assertEqual(code, 1)
        self.assertIn("functions and", errors)


if __name__ == "__main__":
    unittest.main()
