"""Why a late reply is not delivered: for docs/reliability.md and the README. c-tests/test_late_replies.c holds what it shows, for
example the_last_reply_that_the_unit_owes_is_delivered_at_once."""

from drawing import LINE, MARGIN, WIDTH, Drawing

MASTER, UNIT = 128, 268  # the two vertical lines
LATE, RIGHT = 230, 231   # the volts that the two reads find


def draw():
    drawing = Drawing(
        "Why mbm does not deliver a late reply",
        "A master reads the volts of unit 17 twice. The unit owes one reply after the first read, which times out. After "
        f"the quiet time of 100 ms the second read is sent, and the unit owes two. The late reply to the first read, {LATE}, looks "
        "like the answer to the second one. mbm holds it, because one more is owed; a master that delivers it is one reply "
        f"behind from now on. The reply to the second read, {RIGHT}, replaces it. It is the last one that is owed, so mbm delivers "
        "it at once.")
    drawing.text(MASTER, 30, "master", "strong", "middle")
    drawing.text(UNIT, 30, "unit 17", "strong", "middle")
    drawing.text(WIDTH - MARGIN, 30, "owes", "strong", "end")

    def owes(y, replies):
        drawing.text(WIDTH - MARGIN - 16, y, str(replies), "strong", "middle", "theirs" if replies else "good")

    def frame(y, words, to_unit=False, kind="wire"):
        """A frame between the two lines, with its words above it."""
        ends = (MASTER + 5, UNIT - 5) if to_unit else (UNIT - 5, MASTER + 5)
        drawing.line((ends[0], y), (ends[1], y), kind=kind, arrow="end")
        drawing.text((MASTER + UNIT) / 2, y - 5, words, "soft", "middle")

    def span(first, last, kind, lines):
        """A time at the master, and what it is."""
        drawing.bar(MASTER - 4, first, 8, last - first, kind)
        for index, line in enumerate(lines):
            drawing.text(MASTER - 12, (first + last) / 2 + 4 + (index - (len(lines) - 1) / 2) * LINE, line, "soft", "end")

    def state(y, kind, lines):
        drawing.box(MARGIN, y - 4 - 9 * len(lines), MASTER - 14 - MARGIN, 10 + 17 * len(lines), kind, lines, ("soft", "soft"))

    end = 402
    for x in (MASTER, UNIT):
        drawing.line((x, 40), (x, end), kind="thin")
    drawing.appear(3)
    frame(66, "read 1", to_unit=True)
    owes(66, 1)
    drawing.appear(3)
    span(68, 140, "plain", ["response", "timeout"])
    state(166, "bad", ["read 1 has", "timed out"])
    drawing.appear(3)
    span(194, 222, "theirs", ["quiet, 100 ms"])
    drawing.appear(3)
    frame(240, "read 2", to_unit=True)
    owes(240, 2)
    drawing.appear(5)
    frame(288, f"{LATE}, late, to read 1", kind="trace trace-theirs")
    owes(288, 1)
    state(288, "theirs", [f"{LATE} is held:", "1 more is owed"])
    drawing.text(UNIT + 10, 310, "a master that", "soft", colour="bad")
    drawing.text(UNIT + 10, 326, "delivers it stays", "soft", colour="bad")
    drawing.text(UNIT + 10, 342, "1 reply behind", "soft", colour="bad")
    drawing.appear(12)
    frame(374, f"{RIGHT}, to read 2", kind="trace trace-good")
    owes(374, 0)
    state(374, "good", [f"{RIGHT} is read 2:", "none is owed"])
    drawing.paragraph(MARGIN, end + 22, WIDTH - 2 * MARGIN,
                      "If no second reply comes within the response timeout, that to read 1 was lost: mbm delivers what it holds.", "soft")
    return drawing
