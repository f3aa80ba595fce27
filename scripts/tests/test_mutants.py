"""Tests of scripts/check/mutants: which places of a source it changes, how it finds them again, in which order it runs
tests, and what it says of the outcome. No compiler runs: a tree here reads its changed file in place of the tests."""
import pathlib
import tempfile
import unittest
import unittest.mock

from loading import ROOT, load

mutants = load("scripts/check/mutants")

SOURCE = '''//! 1 + 2 in a comment
#[cfg(test)]
mod tests {
    fn gone() -> u8 { 3 + 4 }
}
const _: () = assert!(5 < 6);
#[cfg(target_arch = "avr")]
const PLACES: usize = 7;
#[cfg(not(target_os = "none"))]
const LIMIT: u16 = 0x00FF;
#[cfg_attr(target_os = "none", inline(never))]
fn outer<'a>(pair: &'a (u8, u8)) -> bool {
    let text = "8 == 9"; // 10 && 11
    fn inner(a: u8, b: u8) -> u8 {
        a.wrapping_add(b) - 1
    }
    !text.is_empty() && pair.1 < b'0'
}
'''
FILES = {"src/engine/pair.rs": SOURCE, "src/ring.rs": "fn ring(a: u8) -> u8 {\n    a + 1\n}\n\nfn other(a: u8) -> u8 {\n    a + 1\n}\n"}
MUTANT = mutants.Mutant(7, "src/ring.rs", "ring", "a + 1", "a - 1", mutants.NEW)


class Sites(unittest.TestCase):
    def test_only_code_that_a_host_builds_is_changed(self):
        found = {(SOURCE[site.start:site.end], site.text) for site in mutants.sites(SOURCE)}
        self.assertEqual(found, {("0x00FF", "0x100"), ("wrapping_add", "wrapping_sub"), ("-", "+"), ("1", "2"), ("!", ""), ("&&", "||"),
                                 ("<", "<=")})

    def test_a_mutant_names_the_innermost_function_and_its_line(self):
        site = next(site for site in mutants.sites(SOURCE) if SOURCE[site.start:site.end] == "-")
        found = mutants.at_site("src/engine/pair.rs", SOURCE, site, FILES)
        self.assertEqual(found[2:5], ("inner", "a.wrapping_add(b) - 1", "a.wrapping_add(b) + 1"))

    def test_a_line_that_stands_twice_brings_the_line_before(self):
        text = "fn twice(a: u8) -> u8 {\n    one();\n    a + 1;\n    two();\n    a + 1\n}\n"
        first = next(site for site in mutants.sites(text) if text[site.start:site.end] == "+")
        self.assertEqual(mutants.at_site("f", text, first, {"f": text}).before, "a + 1;")
        same = text.replace("a + 1\n", "a + 1;\n")
        self.assertEqual(mutants.at_site("f", same, first, {"f": same}).before, "one(); a + 1;")

    def test_the_sample_is_the_same_each_time_and_passes_over_what_does_not_compile(self):
        drawn = mutants.drawn(FILES, 3, lambda mutant: True)
        self.assertEqual(drawn, mutants.drawn(dict(reversed(FILES.items())), 3, lambda mutant: True))
        self.assertEqual([each.number for each in drawn], [1, 2, 3])
        self.assertEqual(len({mutants.room(each.file) for each in drawn}), 2)
        others = mutants.drawn(FILES, 3, lambda mutant: mutant.after != drawn[0].after)
        self.assertNotIn(drawn[0].after, [each.after for each in others])


class Places(unittest.TestCase):
    def places(self, files, mutant=MUTANT):
        return [(file, files[file][start:end]) for file, start, end in mutants.places(mutant, files)]

    def test_only_the_function_counts_and_the_line_may_move_and_break(self):
        self.assertEqual(self.places(FILES), [("src/ring.rs", "a + 1")])
        moved = "// A line.\n\n" + FILES["src/ring.rs"].replace("a + 1\n}\n\n", "a\n        + 1\n}\n\n")
        self.assertEqual(self.places({"src/ring.rs": moved}), [("src/ring.rs", "a\n        + 1")])

    def test_a_function_that_moved_to_another_file_is_found(self):
        self.assertEqual(self.places({"src/data/ring.rs": FILES["src/ring.rs"]}), [("src/data/ring.rs", "a + 1")])

    def test_a_text_that_changed_or_stands_twice_is_not_taken(self):
        self.assertEqual(self.places({"src/ring.rs": FILES["src/ring.rs"].replace("a + 1", "1 + a")}), [])
        self.assertEqual(len(self.places({"src/a.rs": FILES["src/ring.rs"], "src/b.rs": FILES["src/ring.rs"]})), 2)

    def test_each_mutant_of_the_list_has_its_one_place_in_the_sources(self):
        sources, listed = mutants.texts(), mutants.read(mutants.LIST.read_text())
        self.assertEqual(len(listed), mutants.COUNT)
        lost = [f"{each.number}: {each.file}, {each.function}: {each.before}" for each in listed if len(mutants.places(each, sources)) != 1]
        self.assertEqual(lost, [])


class List(unittest.TestCase):
    LISTED = [MUTANT._replace(number=number, verdict=verdict) for number, verdict in
              enumerate(("killed by ring::it_is_one_more", "SURVIVED", "equivalent: no caller", mutants.NEW), 1)]

    def test_what_is_written_is_read(self):
        self.assertEqual(mutants.read(mutants.written(self.LISTED)), self.LISTED)
        self.assertRaisesRegex(SystemExit, "expected number, file", mutants.read, "1\tsrc/ring.rs\n")

    def test_numbers_ranges_and_new_select_and_an_equivalent_mutant_is_left_out(self):
        def numbers(*words):
            return [each.number for each in mutants.selected(self.LISTED, words)]

        self.assertEqual(numbers(), [1, 2, 4])
        self.assertEqual(numbers("2-9"), [2, 4])
        self.assertEqual(numbers("1", "new"), [1, 4])
        self.assertRaisesRegex(SystemExit, "five is not a number", numbers, "five")

    def test_only_a_loss_is_complained_about(self):
        killed, survived, _, new = self.LISTED
        for mutant in self.LISTED:
            self.assertIsNone(mutants.complaint(mutant, "killed by another::test"))
        self.assertIsNone(mutants.complaint(survived, "SURVIVED"))
        self.assertIsNone(mutants.complaint(new, "SURVIVED"))
        self.assertIn("mutant 1, src/ring.rs, ring, was \"killed by ring", mutants.complaint(killed, "SURVIVED"))
        self.assertIn("does not build", mutants.complaint(survived, "does not build: error"))


class Tree(mutants.Tree):
    """Has the tests `ring` and `errors` in Rust and `test_ring` and `test_bits` in C. `fails` names those that fail, each as many
    times as it says, if the file is changed."""
    TESTS = [mutants.Test("errors", "mbm"), mutants.Test("ring", "mbm"), mutants.Test("abi", "mbm-c"),
             mutants.Test("test_bits", None), mutants.Test("test_ring", None)]

    def __init__(self, folder, fails, builds=True, archive="new"):
        super().__init__(1)
        self.folder, self.fails, self.builds, self.new_archive, self.ran = folder, fails, builds, archive, []

    def command(self, *words, seconds=0):
        changed = "a - 1" in (self.folder / "src/ring.rs").read_text()
        if "--no-run" in words or words[0] == "make":
            return (0, "") if self.builds or not changed else (101, "error: no\n")
        name = next((word[7:] for word in words if word.startswith("--test=")), words[0].split("/")[-1])
        self.ran.append(name)
        times, output = self.fails.get(name, (0, ""))
        if not changed or not times:
            return 0, ""
        self.fails[name] = (times - 1, output)
        return 124 if output == "stopped" else 1, output

    def archive(self):
        return self.new_archive


class Verdict(unittest.TestCase):
    RUST, C = "test deep::it_is_one_more ... FAILED\n", "ok 1 - fine\nnot ok 2 - # SKIP\nnot ok 3 - it_is_one_more\n"

    def verdict(self, fails, mutant=MUTANT, **more):
        with tempfile.TemporaryDirectory() as folder:
            self.tree = Tree(pathlib.Path(folder), fails, **more)
            file = self.tree.folder / "src/ring.rs"
            file.parent.mkdir()
            file.write_text(FILES["src/ring.rs"])
            verdict = self.tree.verdict(mutant, FILES, Tree.TESTS, "clean")
            self.assertEqual(file.read_text(), FILES["src/ring.rs"])
            return verdict

    def test_a_test_that_fails_twice_kills_and_is_named(self):
        self.assertEqual(self.verdict({"ring": (9, self.RUST)}), "killed by ring::it_is_one_more")
        self.assertEqual(self.tree.ran, ["ring", "ring"])
        self.assertEqual(self.verdict({"test_bits": (9, self.C)}), "killed by test_bits::it_is_one_more")
        self.assertEqual(self.verdict({"errors": (9, "thread 'deep::one' (7) panicked at a.rs:3:\n")}), "killed by errors::one")
        self.assertEqual(self.verdict({"errors": (9, "")}), "killed by errors, exit code 1")

    def test_a_test_that_fails_once_kills_nothing(self):
        self.assertEqual(self.verdict({"ring": (1, self.RUST)}), "SURVIVED")
        self.assertEqual(sorted(set(self.tree.ran)), ["abi", "errors", "ring", "test_bits", "test_ring"])

    def test_a_loop_without_end_is_stopped_and_kills(self):
        self.assertEqual(self.verdict({"test_ring": (9, "stopped")}), "killed by test_ring, which was stopped")

    def test_a_test_that_is_stopped_once_kills_nothing(self):
        self.assertEqual(self.verdict({"test_ring": (1, "stopped")}), "SURVIVED")

    def test_the_test_that_killed_runs_first_then_those_of_the_same_words(self):
        self.assertEqual(self.verdict({}, MUTANT._replace(verdict="killed by test_bits::gone")), "SURVIVED")
        self.assertEqual(self.tree.ran[:3], ["test_bits", "ring", "test_ring"])

    def test_the_same_archive_needs_no_program_in_c(self):
        self.assertEqual(self.verdict({"test_ring": (9, self.C)}, archive="clean"), "SURVIVED")
        self.assertEqual(sorted(self.tree.ran), ["abi", "errors", "ring"])

    def test_a_mutant_of_the_c_interface_needs_no_test_of_the_core(self):
        found = mutants.order(MUTANT._replace(file="capi/src/ring.rs"), Tree.TESTS, {})
        self.assertEqual([test.name for group in found for test in group], ["test_ring", "abi", "test_bits"])

    def test_what_cannot_be_tried_is_said(self):
        self.assertIn("does not build: error: no", self.verdict({}, builds=False))
        self.assertIn('its text is not found: "a * 1"', self.verdict({}, MUTANT._replace(before="a * 1")))


if __name__ == "__main__":
    unittest.main()
