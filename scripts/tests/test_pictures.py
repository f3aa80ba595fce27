"""Tests of scripts/build/pictures: what the pages show is what the reports say."""
import html
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from loading import ROOT

# The charts of docs/reports/two-files.md, and the column that each shows.
SHOWN = {"two-files-flash": 3, "two-files-ram": 4}


def texts(picture):
    return [html.unescape(text) for text in re.findall(r"<text[^>]*>([^<]*)</text>", picture.read_text(encoding="utf-8"))]


def grouped(number):
    return f"{int(number):,}".replace(",", " ") if int(number) >= 10000 else number


class Charts(unittest.TestCase):
    def test_a_row_in_which_a_peer_is_ahead_is_shown_like_all_others(self):
        rows = [[cell.strip() for cell in line.strip("|").split("|")]
                for line in (ROOT / "docs/reports/two-files.md").read_text(encoding="utf-8").splitlines()
                if re.match(r"\| .*\| (mbm|nanoMODBUS) \|", line)]
        self.assertGreater(len(rows), 20)
        for name, column in SHOWN.items():
            bars = [text for text in texts(ROOT / f"docs/pictures/chart-{name}.svg") if re.match(r"\d[\d ]* (mbm|nanoMODBUS)$", text)]
            self.assertEqual(sorted(bars), sorted(f"{grouped(row[column])} {row[2]}" for row in rows), name)


class Stale(unittest.TestCase):
    """Runs the script in a copy of what it reads."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        shutil.copytree(ROOT / "docs", self.root / "docs")
        for name in ("README.md", "scripts/build/pictures", "scripts/fill"):
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, self.root / name)

    def run_it(self, *arguments):
        return subprocess.run([sys.executable, self.root / "scripts/build/pictures", *arguments], capture_output=True, text=True)

    def change(self, page, before, after):
        path = self.root / page
        text = path.read_text(encoding="utf-8")
        self.assertIn(before, text)
        path.write_text(text.replace(before, after), encoding="utf-8")

    def test_the_pictures_of_the_project_are_up_to_date(self):
        found = self.run_it("--check")
        self.assertEqual((found.returncode, found.stderr), (0, ""))

    def test_a_chart_of_other_numbers_is_found_and_then_drawn(self):
        self.change("docs/reports/two-files.md", "| Cortex-M4 | master | nanoMODBUS | ", "| Cortex-M4 | master | nanoMODBUS | 1")
        self.assertIn("writes these anew: chart-two-files-flash.svg\n", self.run_it("--check").stderr)
        self.assertEqual(self.run_it().returncode, 0)
        self.assertEqual(self.run_it("--check").returncode, 0)

    def test_figures_of_other_numbers_are_found(self):
        self.change("docs/reports/size.md", "| cortex-m0plus | FC03 only | ", "| cortex-m0plus | FC03 only | 9")
        self.assertIn("chart-cores.svg, the figures of docs/index.md", self.run_it("--check").stderr)

    def test_a_picture_without_its_source_is_found_and_then_taken_away(self):
        (self.root / "docs/pictures/old.svg").write_text("<svg/>")
        self.assertIn("old.svg", self.run_it("--check").stderr)
        self.run_it()
        self.assertFalse((self.root / "docs/pictures/old.svg").exists())

    def test_a_picture_that_no_page_shows_is_found(self):
        for page in ("README.md", "docs/reliability.md", "docs/architecture.md"):
            self.change(page, "pictures/late.svg)", "pictures/wire.svg)")
        self.assertIn("no page shows late.svg", self.run_it("--check").stderr)


class Steps(unittest.TestCase):
    """A picture that appears step by step."""

    def setUp(self):
        self.pictures = {name: (ROOT / f"docs/pictures/{name}.svg").read_text(encoding="utf-8") for name in ("search", "late", "wire")}

    def test_every_step_has_its_parts_and_its_animation(self):
        for name, text in self.pictures.items():
            parts, rules = (sorted(set(re.findall(pattern, text))) for pattern in (r'class="[^"]*\b(step-\d+)', r"\.(step-\d+)\{animation:"))
            self.assertGreater(len(parts), 5, name)
            self.assertEqual(parts, rules, name)

    def test_without_animations_all_of_it_is_seen(self):
        for name, text in self.pictures.items():
            self.assertNotIn("opacity", text.replace(re.search(r"@media \(prefers-reduced-motion:no-preference\)\{.*</style>", text)[0], ""), name)

    def test_a_picture_is_small(self):
        for name, text in self.pictures.items():
            self.assertLess(len(text), 12000, name)


if __name__ == "__main__":
    unittest.main()
