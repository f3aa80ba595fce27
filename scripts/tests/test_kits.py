"""Tests of scripts/check/kits and of the trees of kits."""
import pathlib
import subprocess
import tempfile
import unittest
from unittest import mock

from loading import load

kits = load("scripts/check/kits")


class Kits(unittest.TestCase):
    def test_each_board_of_a_kit_has_a_row(self):
        self.assertEqual(kits.boards_without_a_row(), [])

    def test_a_board_without_a_row_is_named(self):
        rows = {**kits.kit_trees.ROWS, "pico": kits.kit_trees.ROWS["pico"][:1]}
        with mock.patch.object(kits.kit_trees, "ROWS", rows):
            self.assertEqual(kits.boards_without_a_row(), ["pico: the board pico2 has no row, or is not there any more"])

    def test_no_page_but_the_report_names_a_commit(self):
        self.assertEqual(kits.second_copies(), [])

    def test_a_page_that_names_a_commit_is_found(self):
        tree = kits.kit_trees.Tree("", "mbm", "Modbus stack", "")
        with mock.patch.object(kits.kit_trees, "TREES", {"any": (tree,)}):
            self.assertTrue(any(each.startswith("README.md names the commit Modbus ") for each in kits.second_copies()))

    def test_a_clone_at_another_commit_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["git", "init", "-q", folder], check=True)
            subprocess.run(["git", "-C", folder, "-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a", "--allow-empty"], check=True)
            wrong = kits.kit_trees.other_commits("freertos", pathlib.Path(folder))
            self.assertEqual(len(wrong), 1)
            self.assertRegex(wrong[0], "^FreeRTOS/FreeRTOS-Kernel is at [0-9a-f]{8}, and the table of docs/reports/kits.md is about 4269c69a$")

    def test_an_unpacked_tree_has_no_commit(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(kits.kit_trees.other_commits("pico", pathlib.Path(folder)), [])


if __name__ == "__main__":
    unittest.main()
