"""Tests of scripts/check/steps."""
import pathlib
import subprocess
import unittest

STEPS = pathlib.Path(__file__).parents[1] / "check/steps"


def run(commands, *options):
    done = subprocess.run([STEPS, *options, "name"], input="\n".join(commands) + "\n", stdout=subprocess.PIPE, text=True)
    return done.returncode, done.stdout.splitlines()


class Steps(unittest.TestCase):
    def test_each_step_has_its_time_and_the_last_line_the_total(self):
        code, lines = run(["# a comment", "true", "sleep 1"])
        self.assertEqual(code, 0)
        self.assertRegex(lines[-2], r"^name: +[1-9]\d* s  sleep 1$")
        self.assertRegex(lines[-1], r"^name: 2 steps, 0 failed, [1-9]\d* s$")

    def test_the_first_failure_ends_it(self):
        code, lines = run(["false", "echo went on"])
        self.assertEqual(code, 1)
        self.assertNotIn("went on", lines)
        self.assertIn("1 steps, 1 failed", lines[-1])

    def test_it_may_keep_going_and_fails_at_the_end(self):
        code, lines = run(["false", "echo went on"], "--keep-going")
        self.assertEqual(code, 1)
        self.assertIn("went on", lines)
        self.assertIn("2 steps, 1 failed", lines[-1])

    def test_no_step_is_a_failure(self):
        self.assertEqual(run(["# nothing"])[0], 1)

    def test_a_step_does_not_read_the_list(self):
        self.assertIn("2 steps, 0 failed", run(["cat", "true"])[1][-1])


if __name__ == "__main__":
    unittest.main()
