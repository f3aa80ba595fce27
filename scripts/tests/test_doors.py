"""The tests of scripts/bench/doors, which opens the doors of the README, and of those doors."""

import io
import unittest
import unittest.mock

from loading import ROOT, load

doors = load("scripts/bench/doors")

OUTPUT = """\
@@RUN make single BOARD=uno
need: they are installed, after 12 s
need: they are installed, after 3 s
single: dist/single/uno
@@TIME 20.5 7.0 1.5
@@END 0
@@RUN false
no line end@@TIME 0.0 0.0 0.0
@@END 1
"""


class Doors(unittest.TestCase):
    def test_the_readme_has_every_door_with_at_most_three_lines(self):
        text = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## Five doors\n")[2].partition("\n## ")[0]
        self.assertEqual([line.removeprefix("### ") for line in text.splitlines() if line.startswith("### ")],
                         [door.name for door in doors.DOORS])
        for door in doors.DOORS:
            self.assertIn(len(doors.commands(door.name)), (1, 2, 3), door.name)

    def test_what_a_door_saves_is_in_the_readme(self):
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        for door in doors.DOORS:
            for language in door.files:
                self.assertTrue(doors.blocks(doors.section(door.name), language) or doors.blocks(text, language), door.name)

    def test_a_door_that_the_readme_has_not_is_named(self):
        with self.assertRaisesRegex(SystemExit, "the README has no door The cellar"):
            doors.commands("The cellar")

    def test_a_door_fails_with_the_command_that_fails(self):
        class Played:
            transcript = io.StringIO()

            def __init__(self, name, files):
                self.transcript.name = f"{name}.txt"

            def prepare(self, more):
                pass

            def run(self, user, lines):
                return [doors.Step(line, 1.0, 1.0, int(line.startswith("cargo add")), 0.0) for line in lines]

            def sizes(self, pattern):
                return 7

        door = next(door for door in doors.DOORS if door.name == "Rust")
        with unittest.mock.patch.object(doors, "Machine", Played):
            with self.assertRaisesRegex(SystemExit, "doors: Rust: .*cargo add embedded-io@0.7.*see Rust.txt"):
                doors.opened(door)

    def test_a_transcript_has_the_times_of_each_command_and_of_its_packages(self):
        machine = object.__new__(doors.Machine)
        machine.transcript = io.StringIO()
        first, second = machine.listen(io.StringIO(OUTPUT))
        self.assertEqual(first, ("make single BOARD=uno", 20.5, 8.5, 0, 15.0))
        self.assertEqual((second.command, second.code, second.packages), ("false", 1, 0.0))
        written = machine.transcript.getvalue()
        self.assertIn("$ make single BOARD=uno\n", written)
        self.assertIn("[20.5 s, 8.5 s of processor, ends with 0]", written)
        self.assertIn("single: dist/single/uno", written)


if __name__ == "__main__":
    unittest.main()
