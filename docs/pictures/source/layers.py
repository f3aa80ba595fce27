"""The layers of mbm: in full for docs/architecture.md, in short for the README and the first page."""

from drawing import LINE, MARGIN, WIDTH, Drawing, text_width

INNER = WIDTH - 2 * MARGIN
GAP = 6

# The rows of the core from the top on: modules side by side, and what each is for.
CORE = [
    [("line, node",), ("client",), ("plan",), ("server",), ("gateway",)],
    [("engine", "one request"), ("sniffer", "others' frames"), ("trace", "each frame")],
    [("text", "frames, events and statuses in words")],
    [("packet", "any frame as fields, and back")],
    [("pdu", "requests and responses, one file for each family")],
    [("frame", "RTU, ASCII, TCP; CRC, LRC")],
    [("data", "registers, typed values"), ("port", "stream of bytes")],
    [("error, time", "statuses, t3.5")],
]


def row(drawing, y, modules):
    """Boxes side by side in the middle of the core. Returns the height of the row."""
    widths = [max(text_width(module[0], "strong"), text_width(module[-1], "soft")) for module in modules]
    more = (INNER - 16 - GAP * (len(modules) - 1) - sum(widths)) / len(modules)
    height = 13 + LINE * len(modules[0])
    x = MARGIN + 8
    for module, width in zip(modules, widths):
        drawing.box(x, y, width + more, height, "ours", module)
        x += width + more + GAP
    return height


def draw():
    drawing = Drawing(
        "The layers of mbm, from a sketch to the port",
        "Sketches use C++ classes, which use the C interface mbm.h. C and C++ programs use mbm.h. Rust firmware uses "
        "the core. In the core, from top to bottom: line and node, client, plan, server and gateway; engine, sniffer and "
        "trace; text; packet; pdu; frame; data and port; error and time. Each layer uses only layers below it. "
        "The port calls functions of yours: read, write, clock, driver on and off, flush.")
    third = (INNER - 2 * GAP) / 3
    left, middle, right = (MARGIN + index * (third + GAP) for index in range(3))
    y = MARGIN
    drawing.box(left, y, third, 36, lines=["sketch"])
    drawing.box(middle, y, third, 36, lines=["C or C++"])
    drawing.box(right, y, third, 36, lines=["Rust"])
    y += 36
    drawing.line((left + third / 2, y), (left + third / 2, y + 18), arrow="end")
    drawing.line((middle + third / 2, y), (middle + third / 2, y + 84), arrow="end")
    drawing.line((right + third / 2, y), (right + third / 2, y + 150), arrow="end")
    drawing.box(left, y + 18, third, 48, "good", ["C++ classes", "ModbusMaster.h"])
    drawing.line((left + third / 2, y + 66), (left + third / 2, y + 84), arrow="end")
    y += 84
    drawing.box(left, y, 2 * third + GAP, 48, "theirs", ["C API", "mbm.h and libmbm.a"])
    drawing.line((left + third + GAP / 2, y + 48), (left + third + GAP / 2, y + 66), arrow="end")
    y += 66
    top = y
    y += 22
    drawing.text(WIDTH / 2, y - 4, "the core, no_std Rust: each layer uses those below it", "soft", "middle")
    for modules in CORE:
        y += 5
        y += row(drawing, y, modules)
    y += 8
    drawing.line((MARGIN, top), (MARGIN + INNER, top), (MARGIN + INNER, y), (MARGIN, y), (MARGIN, top), kind="dashed")
    drawing.line((WIDTH / 2, y), (WIDTH / 2, y + 18), arrow="end")
    y += 18
    drawing.box(MARGIN, y, INNER, 48, lines=["your port", "read, write, clock, driver on and off, flush"])
    return drawing


def in_short():
    drawing = Drawing(
        "The layers of mbm in short, from a sketch to the port",
        "Sketches use C++ classes, which use the C interface mbm.h. C and C++ programs use mbm.h. Rust firmware uses the "
        "core: master, client, plan, server, gateway and sniffer. The core calls functions of yours: read, write, clock.")
    third, box, step = (INNER - 2 * GAP) / 3, 25, 10
    left, middle, right = (MARGIN + index * (third + GAP) for index in range(3))
    classes, interface, core = (MARGIN + index * (box + step) for index in (1, 2, 3))
    for x, what, end in ((left, "sketch", classes), (middle, "C or C++", interface), (right, "Rust", core)):
        drawing.box(x, MARGIN, third, box, lines=[what])
        drawing.line((x + third / 2, MARGIN + box), (x + third / 2, end), arrow="end")
    drawing.box(left, classes, third, box, "good", ["C++ classes"])
    drawing.line((left + third / 2, classes + box), (left + third / 2, interface), arrow="end")
    drawing.box(left, interface, 2 * third + GAP, box, "theirs", ["C: mbm.h and libmbm.a"])
    drawing.line((left + third + GAP / 2, interface + box), (left + third + GAP / 2, core), arrow="end")
    drawing.box(MARGIN, core, INNER, 44, "ours", ["core, no_std Rust", "master, client, plan, server, gateway, sniffer"])
    drawing.line((WIDTH / 2, core + 44), (WIDTH / 2, core + 44 + step), arrow="end")
    drawing.box(MARGIN, core + 44 + step, INNER, box, lines=["your port: read, write, clock"])
    return drawing


def draw_all():
    return {"layers-short": in_short()}
