"""The tests of scripts/build/single, the library as two files."""

import pathlib
import re
import subprocess
import tempfile
import unittest

from loading import ROOT, load

single = load("scripts/build/single")

SOURCE = """\
\t.syntax\tunified
\t.globl\t__do_copy_data
\t.section\t.text.mbm_read,"ax",%progbits
\t.globl\tmbm_read
\t.type\tmbm_read,%function
mbm_read:
\tbl\tmbm.1
\tbx\tlr
\t.section\t.text.mbm.1,"ax",%progbits
mbm.1:
\tldr\tr0, .L1_0
\tbx\tlr
.L1_0:
\t.long\t.Ld2
#line 1
\t.section\t.rodata.mbm.2,"a",%progbits
.Ld2:
\t.long\t7
\t.section\t.text.mbm_write,"ax",%progbits
\t.globl\tmbm_write
mbm_write:
\tbx\tlr
\t.globl\tmbm_fetch
\t.type\tmbm_fetch,%function
\t.thumb_set\tmbm_fetch, mbm_read
""".splitlines()


def reached(*functions):
    return single.Source(SOURCE).reachable(set(functions))


class Code(unittest.TestCase):
    def test_a_function_brings_what_it_calls_and_the_constants_of_that(self):
        self.assertEqual([line for line in reached("mbm_read") if line.endswith(":")], ["mbm_read:", "mbm.1:", ".L1_0:", ".Ld2:"])

    def test_what_nobody_calls_is_left_out(self):
        self.assertNotIn("mbm_write:", reached("mbm_read"))
        self.assertNotIn("mbm_read:", reached("mbm_write"))

    def test_the_head_of_the_file_stays(self):
        self.assertEqual(reached("mbm_write")[0], "\t.syntax\tunified")

    def test_a_second_name_brings_the_function_and_stands_behind_it(self):
        lines = reached("mbm_fetch")
        self.assertGreater(lines.index("\t.thumb_set\tmbm_fetch, mbm_read"), lines.index("mbm_read:"))
        self.assertIn("\t.globl\tmbm_fetch", lines)

    def test_a_second_name_that_nobody_wants_is_left_out(self):
        self.assertFalse([line for line in reached("mbm_read") if "mbm_fetch" in line])

    def test_constants_are_copied_to_ram_only_if_there_are_some(self):
        self.assertIn("\t.globl\t__do_copy_data", reached("mbm_read"))
        self.assertNotIn("\t.globl\t__do_copy_data", reached("mbm_write"))

    def test_lines_are_counted_anew_where_they_were(self):
        lines = reached("mbm_read")
        self.assertEqual(lines.index("#line 1") + 1, lines.index('\t.section\t.rodata.mbm.2,"a",%progbits'))
        self.assertEqual(reached("mbm_write").count("#line 1"), 1)


class Header(unittest.TestCase):
    def test_a_part_stands_behind_those_that_it_includes(self):
        self.assertEqual(single.with_included(["client"]), ["base", "functions", "packets", "client"])
        for parts in (["server"], single.all_parts()):
            order = single.with_included(parts)
            for part in order:
                for included in single.INCLUDE.findall(single.text_of(part)):
                    self.assertLess(order.index(included), order.index(part))

    def test_all_parts_are_in_the_whole_header(self):
        self.assertEqual(set(single.with_included(single.all_parts())), set(single.all_parts()))

    def test_the_header_of_every_part_compiles_by_itself(self):
        for part in single.all_parts():
            with self.subTest(part), tempfile.TemporaryDirectory() as folder:
                file = pathlib.Path(folder) / "mbm.h"
                file.write_text(single.header(single.with_included([part]), "uno"), encoding="utf-8")
                self.assertNotIn('#include "', file.read_text())
                for flags in (["-std=c99", "-xc"], ["-std=c++11", "-xc++"]):
                    subprocess.run(["gcc", *flags, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-"], check=True,
                                   text=True, input=f'#include "{file}"\n#include "{file}"\nint main(void);\n')

    def test_the_functions_of_a_part_are_those_that_it_declares(self):
        self.assertEqual({re.match("mbm_[a-zA-Z]+_", name)[0] for name in single.functions(["ring"])}, {"mbm_ring_", "mbm_dmaRing_"})
        exports = subprocess.run([ROOT / "scripts/build/exports"], check=True, text=True, capture_output=True).stdout.split()
        self.assertEqual(single.functions(single.all_parts()), set(exports))

    def test_the_licence_is_in_the_header(self):
        self.assertIn("Permission is hereby granted, free of charge", single.header(["base"], "uno"))


class Arguments(unittest.TestCase):
    def refused(self, *arguments):
        found = subprocess.run([ROOT / "scripts/build/single", *arguments], capture_output=True, text=True)
        self.assertEqual(found.returncode, 1)
        return found.stderr

    def test_a_part_that_is_not_there_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertIn('there is no part "masters": there are base, functions, master', self.refused("uno", folder, "masters"))
            self.assertEqual(list(pathlib.Path(folder).iterdir()), [])

    def test_a_family_of_boards_is_refused_with_a_board_of_it(self):
        self.assertIn("avr is a family of boards with several processors; name one board, such as uno", self.refused("avr", "/nowhere"))
        self.assertIn("such as nucleo-f401re", self.refused("nucleo", "/nowhere"))

    def test_board_and_parts_are_looked_at_without_writing_anything(self):
        self.assertIn('there is no board or family "unno"', self.refused("--check", "unno"))
        self.assertIn('there is no part "masters"', self.refused("--check", "uno", "masters"))
        subprocess.run([ROOT / "scripts/build/single", "--check", "uno", "master"], check=True)

    def test_a_board_that_is_not_there_is_refused(self):
        self.assertIn('there is no board or family "unno"', self.refused("unno", "/nowhere"))


if __name__ == "__main__":
    unittest.main()
