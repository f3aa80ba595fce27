"""Bar charts in the look of all pictures. Each bar begins at 0 and has its number and name beside it."""

from drawing import LINE, MARGIN, WIDTH, Drawing, text_width

INNER = WIDTH - 2 * MARGIN
BAR, PITCH = 12, 16


class Panel:
    """Bars of one unit with one scale. A group is a label and its bars: (kind, number, name). `marks`
    has the places of marks, by the index of group and bar."""

    def __init__(self, heading, unit, groups, marks=None):
        self.heading, self.unit, self.groups = heading, unit, groups
        self.marks = marks or {}

    def draw(self, drawing, y):
        y = drawing.paragraph(MARGIN, y, INNER, self.heading, "strong")
        y = drawing.paragraph(MARGIN, y, INNER, self.unit, "soft") - LINE
        bars = [bar for _, group in self.groups for bar in group]
        texts = max(text_width(written(bar), "soft") for bar in bars)
        scale = (INNER - texts - 8) / max([bar[1] for bar in bars] + list(self.marks.values()))
        for number, (label, group) in enumerate(self.groups):
            y += 5
            if label:
                y = drawing.paragraph(MARGIN, y + 17, INNER, label) - LINE + 6
            for place, bar in enumerate(group):
                width = max(bar[1] * scale, 1)
                drawing.bar(MARGIN, y, width, BAR, bar[0])
                mark = self.marks.get((number, place), 0) * scale
                if mark:
                    drawing.line((MARGIN + mark, y - 1), (MARGIN + mark, y + BAR + 1), kind="mark")
                drawing.text(MARGIN + max(width, mark) + 5, y + BAR - 2, written(bar), "soft")
                y += PITCH
            y -= PITCH - BAR
        return y


def grouped(number):
    """A number with a space before each three digits if it has at least five: 13 352."""
    return f"{number:,.0f}".replace(",", " ") if number >= 10000 else f"{number:g}"


def written(bar):
    _, number, name = bar
    return f"{grouped(number)} {name}" if number >= 10 else f"{number:.2f} {name}"


def chart(title, description, panels, notes):
    """A chart of panels, one below the other. `notes` say where the numbers come from."""
    drawing = Drawing(title, description)
    y = drawing.paragraph(MARGIN, 30, INNER, title, "head") + 6
    for panel in panels:
        y = panel.draw(drawing, y) + 30
    y -= 4
    for note in notes:
        y = drawing.paragraph(MARGIN, y, INNER, note, "soft") + 3
    return drawing


def describe(panels):
    """The numbers of the panels in words, for those who cannot see the chart."""
    return " ".join(
        f"{panel.heading}, {panel.unit}: " + "; ".join(f"{label}{': ' if label else ''}" + ", ".join(written(bar) for bar in group)
                                         for label, group in panel.groups) + "."
        for panel in panels)
