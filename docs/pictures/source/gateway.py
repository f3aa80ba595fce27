"""What the gateway forwards where: for docs/gateway.md, whose command line this is."""

from drawing import MARGIN, WIDTH, Drawing

INNER = WIDTH - 2 * MARGIN


def draw():
    drawing = Drawing(
        "The gateway between TCP clients and two serial lines",
        "Three TCP clients send requests to the gateway at port 502, several at once. The map of units sends the units "
        "1 to 31 to line 0, 101 to 131 to line 1, where they are the units 1 to 31; no other unit has a route: "
        "exception 0A. Each line has a queue and one request at a time, and the clients take turns.")
    y = MARGIN
    width = (INNER - 20) / 3
    for index, name in enumerate(["SCADA", "logger", "panel"]):
        x = MARGIN + index * (width + 10)
        drawing.box(x, y, width, 46, "plain", [name, "TCP client"])
        drawing.line((x + width / 2, y + 46), (x + width / 2, y + 76), arrow="both")
    drawing.text(MARGIN + width + 5, y + 65, "port 502", "soft", "middle")
    y += 76
    drawing.box(MARGIN, y, INNER, 128, "ours")
    drawing.text(WIDTH / 2, y + 20, "gateway", "strong", "middle")
    half = (INNER - 36) / 2
    lines = [("line 0", "/dev/ttyUSB0", "units 1–31", "as units 1–31", "19200 baud, E1"),
             ("line 1", "/dev/ttyUSB1", "units 101–131", "as units 1–31", "9600 baud, N2")]
    for index, (name, place, units, there, rate) in enumerate(lines):
        x = MARGIN + 12 + index * (half + 12)
        drawing.box(x, y + 30, half, 46, "plain", [units, there])
        middle = x + half / 2
        drawing.line((middle, y + 76), (middle, y + 88), arrow="end")
        drawing.box(x, y + 88, half, 30, "good", ["queue, by turns"], ("soft", "soft"))
        drawing.line((middle, y + 118), (middle, y + 152), arrow="both")
        drawing.box(x, y + 152, half, 63, "theirs", [name, place, rate])
        drawing.line((middle, y + 215), (middle, y + 232), (x + half * 0.2, y + 232), (x + half * 0.2, y + 244))
        drawing.line((middle, y + 232), (x + half * 0.8, y + 232), (x + half * 0.8, y + 244))
        drawing.line((middle, y + 232), (middle, y + 244))
        for place, unit in zip((0.2, 0.5, 0.8), ("1", "2", "31")):
            drawing.box(x + half * place - 20, y + 244, 40, 26, "plain", [unit], ("soft", "soft"))
    y += 270
    drawing.paragraph(MARGIN, y + 24, INNER, "A unit without a route: exception 0A. A device that does not answer: 0B.",
                      "soft")
    return drawing
