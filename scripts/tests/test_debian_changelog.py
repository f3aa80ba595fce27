"""The changelog of the Debian package, which packaging/debian/changelog makes from CHANGELOG.md."""
import unittest

from scripts_under_test import load

module = load("packaging/debian/changelog")

UNRELEASED = "# Changelog\n\n## [Unreleased]\n\n### Added\n\n- A thing.\n"
TWO_RELEASES = UNRELEASED + "\n## [70.3.0] - 2027-02-28\n\n- More.\n\n## [70.2.0] - 2026-12-01\n\n- First.\n"


def changelog(text, version, seconds=0):
    return module.changelog(text.splitlines(keepends=True), version, "A Name <a@b.example>", seconds)


class DebianChangelog(unittest.TestCase):
    def test_a_version_that_is_not_released_yet_has_the_time_it_is_packed_for(self):
        self.assertEqual(
            changelog(UNRELEASED, "70.2.0", 315619200),
            "mbm (70.2.0-1) unstable; urgency=medium\n\n"
            "  * Version 70.2.0. The file changelog.gz lists the changes.\n\n"
            " -- A Name <a@b.example>  Wed, 02 Jan 1980 00:00:00 +0000\n",
        )

    def test_a_released_version_has_the_day_of_its_heading_whatever_the_time(self):
        for seconds in (0, 1800000000):
            first = changelog(TWO_RELEASES, "70.3.0", seconds).split("\n\n")[2]
            self.assertEqual(first.split("\n")[0], " -- A Name <a@b.example>  Sun, 28 Feb 2027 12:00:00 +0000")

    def test_older_versions_follow_the_packed_one(self):
        text = changelog(TWO_RELEASES, "70.4.0")
        heads = [line.split()[1] for line in text.splitlines() if line.startswith("mbm")]
        self.assertEqual(heads, ["(70.4.0-1)", "(70.3.0-1)", "(70.2.0-1)"])

    def test_a_version_newer_than_the_packed_one_is_left_out(self):
        text = changelog(TWO_RELEASES, "70.2.0")
        self.assertEqual([line for line in text.splitlines() if line.startswith("mbm")], ["mbm (70.2.0-1) unstable; urgency=medium"])


if __name__ == "__main__":
    unittest.main()
