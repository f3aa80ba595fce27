"""The time line of a transaction on RS-485: for docs/port.md and docs/master.md."""

from drawing import MARGIN, WIDTH, Drawing

BAUD = 19200
CHARACTER = 11 / BAUD * 1000  # ms
SILENCE = 3.5 * CHARACTER
LABELS = 54
FIRST, LAST = MARGIN + LABELS, WIDTH - MARGIN

# What happens, and how many milliseconds it takes: a request of 8 bytes, a reply of 11.
PHASES = [("gap", SILENCE), ("request", 8 * CHARACTER), ("hold", CHARACTER), ("device", 4.0), ("reply", 11 * CHARACTER),
          ("next", SILENCE)]
WORDS = [
    ("1", f"Gap: silence of t3.5, {SILENCE:.1f} ms at {BAUD} baud. After a failure the quiet time, 100 ms."),
    ("2", f"preTransmission switches the driver on. The request follows at once: 8 bytes, {8 * CHARACTER:.1f} ms."),
    ("3", "flush has returned 1. With setPostFlushHold(1) the driver stays on for one character more; without, "
          "it goes off here."),
    ("4", "postTransmission switches the driver off, and the response timeout begins. The device works; it must keep "
          "t3.5 too."),
    ("5", f"The reply, here 11 bytes, {11 * CHARACTER:.1f} ms. With its last byte the request ends, if it is right. "
          "The response timeout, 2000 ms if not set, must not expire before."),
    ("6", "The gap before the next request."),
]


def draw():
    drawing = Drawing(
        f"A transaction on RS-485 at {BAUD} baud, to scale",
        "Time runs to the right. First a gap of t3.5; then the driver goes on and the request is sent; after the "
        "last bit the driver stays on for the post-flush hold; then it goes off and the response timeout begins; the "
        "device works and sends its reply; with the last byte of the reply the request ends, and the gap before the "
        "next request begins.")
    scale = (LAST - FIRST) / sum(time for _, time in PHASES)
    edges = [FIRST]
    for _, time in PHASES:
        edges.append(edges[-1] + time * scale)
    gap, request, hold, device, reply, following, end = edges
    drawing.text(WIDTH / 2, 28, f"one transaction at {BAUD} baud, to scale", "strong", "middle")

    for index, (number, _) in enumerate(WORDS):
        x = (edges[index] + edges[index + 1]) / 2
        drawing.text(x, 52, number, "strong", "middle", "ours")
    top, height = 62, 34
    for edge, lanes in zip(edges[1:-1], (2, 2, 3, 1, 3)):
        drawing.line((edge, top - 4), (edge, top + lanes * (height + 16) - 8), kind="dashed")

    def label(y, *lines):
        for index, line in enumerate(lines):
            drawing.text(MARGIN, y + 14 + index * 15 - (len(lines) - 2) * 7, line, "soft")

    y = top
    label(y, "on the", "line")
    drawing.line((gap, y + height), (end, y + height), kind="thin")
    drawing.box(request, y, hold - request, height, "ours", ["request"])
    drawing.box(reply, y, following - reply, height, "theirs", ["reply"])

    y += height + 16
    label(y, "driver", "enable")
    drawing.line((gap, y + height), (request, y + height), (request, y + 6), (device, y + 6), (device, y + height),
                 (end, y + height), kind="trace trace-ours")

    y += height + 16
    label(y, "response", "timeout")
    drawing.line((device, y + height / 2), (following, y + height / 2), arrow="end")
    drawing.line((following, y + height / 2), (end, y + height / 2), kind="dashed")
    drawing.text((device + following) / 2, y + height / 2 - 6, "until the reply is found", "soft", "middle")

    y += height + 34
    for number, words in WORDS:
        drawing.text(MARGIN, y, number, "strong", colour="ours")
        y = drawing.paragraph(MARGIN + 18, y, WIDTH - 2 * MARGIN - 18, words, "soft") + 5
    return drawing
