"""The states of a request, for docs/architecture.md and docs/client.md: src/engine, src/client."""

from drawing import MARGIN, WIDTH, Drawing

LEFT, BOX = 40, 184
RIGHT, END = 258, WIDTH - 258 - MARGIN
AXIS = LEFT + BOX / 2

# The states from the top on: name, what happens in it, height of the box.
STATES = [
    ("queued", ["in the client's queue of 16"]),
    ("gap", ["until the line is silent;", "received bytes are dropped"]),
    ("send", ["driver on; the port", "takes the bytes"]),
    ("flush", ["until the last bit has left"]),
    ("hold", ["driver still on, if a", "post-flush hold is set"]),
    ("reply", ["driver off; the reply is", "searched in all bytes"]),
    ("held", ["a reply that may be late", "waits for a second one"]),
]


def draw():
    drawing = Drawing(
        "The states of a request on a serial line",
        "A request is queued (client only), waits for the gap, is sent, flushed, held for the post-flush hold, and "
        "waits for its reply. A reply that may be a late one is held until the line was silent for the response timeout. "
        "Ends: LINE_BUSY from gap, send and flush; LINK_LOST from queued, gap, send, reply and held; OK or an exception from reply "
        "and held; a timeout or damage from reply and held, with a repetition if a retry is left; a broadcast ends "
        "after the turnaround delay; CANCELLED from every state.")
    tops = {}
    y = MARGIN
    for name, lines in STATES:
        height = 30 + 17 * len(lines)
        tops[name] = (y, y + height / 2, y + height)
        drawing.box(LEFT, y, BOX, height, "good" if name == "queued" else "ours", [name, *lines])
        y += height + 22
    names = [name for name, _ in STATES]
    for above, below in zip(names, names[1:-1]):
        drawing.line((AXIS, tops[above][2]), (AXIS, tops[below][0]), arrow="end")
    drawing.line((AXIS, tops["reply"][2]), (AXIS, tops["held"][0]), arrow="end")
    drawing.text(AXIS + 8, tops["reply"][2] + 15, "after a failure", "soft")

    def ends(state, kind, lines, offset=0, height=None):
        """A box at the right, to which an arrow leads from the state."""
        middle = tops[state][1] + offset
        height = height or 13 + 17 * len(lines)
        drawing.line((LEFT + BOX, middle), (RIGHT, middle), arrow="end")
        drawing.box(RIGHT, middle - height / 2, END, height, kind, lines, ("soft", "soft"))

    ends("queued", "bad", ["LINK_LOST"])
    ends("gap", "bad", ["LINE_BUSY", "LINK_LOST"])
    ends("send", "bad", ["LINE_BUSY", "LINK_LOST"])
    ends("flush", "bad", ["LINE_BUSY"])
    ends("reply", "good", ["OK, exception"], -22, 26)
    ends("reply", "bad", ["LINK_LOST"], 22, 26)
    ends("held", "good", ["OK, exception"], -22, 26)
    ends("held", "bad", ["LINK_LOST"], 10, 26)
    # A broadcast leaves the hold, with or without one.
    middle = tops["hold"][1]
    drawing.line((LEFT + BOX, middle), (RIGHT, middle), arrow="end")
    drawing.text((LEFT + BOX + RIGHT) / 2, middle - 5, "to 0", "soft", "middle")
    drawing.box(RIGHT, middle - 28, END, 56, "ours", ["turnaround", "of a broadcast,", "then OK"])

    # Timeout or damage: a failure, or back to the beginning.
    y = tops["held"][2] + 24
    drawing.line((AXIS, tops["held"][2]), (AXIS, y), arrow="end")
    drawing.box(LEFT, y, BOX, 47, "bad", ["timeout or damage", "is a retry left?"])
    drawing.line((LEFT, tops["reply"][1]), (30, tops["reply"][1]), (30, y + 12), (LEFT, y + 12), arrow="end")
    drawing.line((LEFT, y + 34), (18, y + 34), (18, tops["gap"][1]), (LEFT, tops["gap"][1]), arrow="end")
    drawing.line((18, tops["gap"][1]), (18, tops["queued"][1]), (LEFT, tops["queued"][1]), arrow="end")
    drawing.text(LEFT - 8, y + 50, "yes", "soft", "end")
    drawing.line((AXIS, y + 47), (AXIS, y + 75), arrow="end")
    drawing.text(AXIS + 8, y + 65, "no", "soft")
    drawing.box(LEFT, y + 75, WIDTH - MARGIN - LEFT, 47, "bad", ["RESPONSE_TIMED_OUT, INVALID_CRC,", "MALFORMED_REPLY, …"],
                ("soft", "soft"))
    y = drawing.paragraph(MARGIN, y + 146, WIDTH - 2 * MARGIN,
                          "A repetition of a master begins with the gap, one of a client in the queue, with its "
                          "back-off. A client also repeats after LINE_BUSY, and after the exception of a busy device. "
                          "CANCELLED ends each state; the driver is off then.", "soft")
    return drawing
