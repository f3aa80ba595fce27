"""One look for all pictures: a card with boxes, texts, lines and bars, as an SVG file.

A picture is 400 units wide, so that a telephone shows it without making its text too small. The
card has its own background, so a picture can be read on any page, and its colours follow the
reader's choice of light or dark. Text stays text, in the system's font; a drawing fails if a text
does not fit, even in DejaVu Sans, which is wider than other systems' fonts.

A picture may appear step by step, again and again. Whoever asks the system for less motion sees the
whole picture at once, and so does a viewer that does not know animations.
"""

from xml.sax.saxutils import escape, quoteattr

WIDTH = 400
MARGIN = 14
DISPLAY = 1.2  # how much larger than its units a picture is where there is enough space
LINE = 17  # from one line of text to the next

FONT = 'system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif'
CODE = 'ui-monospace,Menlo,Consolas,"DejaVu Sans Mono",monospace'
SIZES = {"": 13, "strong": 13, "head": 14, "soft": 12, "code": 12}

# What a colour means, and how it looks: light fill, light line, dark fill, dark line.
KINDS = {
    "plain": ("#f6f8fa", "#8c959f", "#21262d", "#8b949e"),
    "ours": ("#ddf0ff", "#0969da", "#0c2d54", "#58a6ff"),
    "theirs": ("#fff0de", "#bc4c00", "#432100", "#f0883e"),
    "good": ("#dafbe1", "#1a7f37", "#0d3a1c", "#3fb950"),
    "bad": ("#ffebe9", "#cf222e", "#4b1416", "#ff7b72"),
}
# Background, frame of the card, text, quiet text, lines.
LIGHT = ("#ffffff", "#d0d7de", "#1f2328", "#57606a", "#57606a")
DARK = ("#0d1117", "#3d444d", "#e6edf3", "#a5adb7", "#a5adb7")

# Widths of DejaVu Sans in hundredths of the size of the font, regular and bold.
REGULAR = {27: "'", 28: "ijl", 29: "IJ", 32: " ,.·", 34: "/:;\\|", 35: "f", 36: "-", 39: "()[]t", 40: "!", 41: "r",
           46: '"', 50: "*_`–", 52: "sz", 53: "?", 55: "c", 56: "L", 58: "Fk", 59: "vxy", 60: "P", 61: "TYao",
           62: "e", 63: "ESbdghnpqu", 64: "$0123456789{}µ", 66: "K", 68: "AV", 69: "BRXZ", 70: "C", 73: "U",
           75: "HN", 77: "DGΩ", 78: "&", 79: "OQ", 82: "w", 84: "#+<=>^~×−→≥≤", 86: "M", 95: "%", 97: "m",
           99: "W", 100: "@…"}
BOLD = {31: "'", 34: "ijl", 35: " ", 37: "/IJ\\|", 38: ",.·", 40: ":;", 42: "-", 44: "f", 46: "!()[]", 48: "t",
        49: "r", 50: "_`–", 52: '"*', 58: "?z", 59: "c", 60: "s", 64: "L", 65: "vxy", 67: "ak", 68: "EFTe",
        69: "o", 70: "$0123456789", 71: "hnu{}", 72: "SYbdgpq", 73: "CPZ", 74: "µ", 76: "B", 77: "AKRVX", 81: "U",
        82: "G", 83: "D", 84: "#+<=>HN^~×−→≥≤", 85: "OQΩ", 87: "&", 92: "w", 100: "%@M…", 104: "m", 110: "W"}
WIDTHS = {name: {letter: width for width, letters in table.items() for letter in letters}
          for name, table in [("regular", REGULAR), ("bold", BOLD)]}


def text_width(text, kind=""):
    """The width of a line of text in the widest of the usual fonts."""
    size = SIZES[kind]
    if kind == "code":
        return len(text) * size * 0.602
    table = WIDTHS["bold" if kind in ("strong", "head") else "regular"]
    return sum(table[letter] for letter in text) * size / 100


def wrapped(text, width, kind=""):
    """The text in lines that are no wider than `width`."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, kind) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def colours(page, kinds):
    """The rules of the style sheet that name colours."""
    background, frame, ink, quiet, line = page
    rules = [f".card{{fill:{background};stroke:{frame}}}", f"text{{fill:{ink}}}", f".soft{{fill:{quiet}}}",
             f".wire,.thin,.dashed{{stroke:{line}}}.mark{{stroke:{ink}}}", f".head-of-arrow,.dot{{fill:{line}}}"]
    for name, (fill, stroke) in kinds.items():
        rules.append(f".{name}{{fill:{fill};stroke:{stroke}}}.bar-{name}{{fill:{stroke}}}"
                     f".trace-{name}{{stroke:{stroke}}}.text-{name}{{fill:{stroke}}}")
    return "".join(rules)


STYLE = (
    f"text{{font:{SIZES['']}px {FONT}}}"
    f".strong{{font-weight:bold}}.head{{font-weight:bold;font-size:{SIZES['head']}px}}"
    f".soft{{font-size:{SIZES['soft']}px}}.code{{font:{SIZES['code']}px {CODE}}}"
    ".box,.card{stroke-width:1.5}.middle{text-anchor:middle}.end{text-anchor:end}"
    ".wire,.thin,.dashed,.trace,.mark{fill:none;stroke-width:1.5;stroke-linejoin:round}.thin{stroke-width:1}"
    ".dashed{stroke-width:1;stroke-dasharray:4 3}.trace,.mark{stroke-width:2}"
    + colours(LIGHT, {name: look[:2] for name, look in KINDS.items()})
    + "@media (prefers-color-scheme:dark){"
    + colours(DARK, {name: look[2:] for name, look in KINDS.items()}) + "}")

ARROWHEAD = ('<marker id="arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" '
             'markerUnits="userSpaceOnUse" orient="auto-start-reverse">'
             '<path class="head-of-arrow" d="M0 0L8 4L0 8z"/></marker>')


PALE = 0.13  # how much of a part is seen before its step
FADE = 0.3  # seconds


def number(value):
    return f"{value:.1f}".removesuffix(".0")


def appearing(steps):
    """The rules of a style sheet by which the parts of each step appear after the seconds of those before it."""
    whole, before, rules = sum(steps), 0, []
    for step, seconds in enumerate(steps[:-1], 1):
        before += seconds
        begin, end = (f"{100 * time / whole:.1f}%" for time in (before, before + FADE))
        rules.append(f".step-{step}{{animation:step-{step} {number(whole)}s infinite}}"
                     f"@keyframes step-{step}{{0%,{begin}{{opacity:{PALE}}}{end},98%{{opacity:1}}to{{opacity:{PALE}}}}}")
    return "@media (prefers-reduced-motion:no-preference){" + "".join(rules) + "}" if rules else ""


class Drawing:
    """A picture. `title` says what it is, `description` what it shows to those who cannot see it."""

    def __init__(self, title, description):
        self.title, self.description = title, description
        self.parts, self.bottom = [], 0
        # How long each step lasts, in seconds. The first one shows all that belongs to no step.
        self.steps, self.step = [1], 0

    def appear(self, seconds):
        """Begins a step: what is drawn from now on appears after the steps before, and nothing else does for `seconds`."""
        self.steps.append(seconds)
        self.step = len(self.steps) - 1

    def end_steps(self, seconds):
        """The last step lasts for `seconds`. What is drawn from now on belongs to no step."""
        self.steps[-1], self.step = seconds, 0

    def add(self, tag, bottom, content=None, **attributes):
        """Adds an element that ends at the height `bottom`. Attributes: `kind` is the class."""
        self.bottom = max(self.bottom, bottom)
        step = f"step-{self.step}" if self.step else ""
        attributes = {"class": f"{attributes.pop('kind')} {step}".strip(), **attributes}
        written = "".join(f" {name}={quoteattr(value if isinstance(value, str) else number(value))}"
                          for name, value in attributes.items() if value != "")
        self.parts.append(f"<{tag}{written}/>" if content is None else f"<{tag}{written}>{escape(content)}</{tag}>")

    def text(self, x, y, text, kind="", anchor="", colour="", within=WIDTH - 4):
        """A line of text on the base line `y`. `anchor` is "", "middle" or "end"."""
        width = text_width(text, kind)
        left = x - {"": 0, "middle": width / 2, "end": width}[anchor]
        if left < WIDTH - within or left + width > within:
            raise ValueError(f"{self.title}: '{text}' takes {left:.0f} to {left + width:.0f}")
        classes = " ".join(word for word in (kind, anchor, f"text-{colour}" if colour else "") if word)
        self.add("text", y + 4, text, kind=classes, x=x, y=y)

    def paragraph(self, x, y, width, text, kind="", anchor=""):
        """Text in as many lines as it needs. Returns the base line after the last."""
        for line in wrapped(text, width, kind):
            self.text(x, y, line, kind, anchor)
            y += LINE
        return y

    def box(self, x, y, width, height, kind="plain", lines=(), kinds=("strong", "soft")):
        """A box with centred lines of text: the first of the kind `kinds[0]`, the others of the second."""
        self.add("rect", y + height, kind=f"box {kind}", x=x, y=y, width=width, height=height, rx=5)
        base = y + height / 2 - (len(lines) - 1) * LINE / 2 + 4.5
        for index, line in enumerate(lines):
            text_kind = kinds[min(index, 1)]
            if text_width(line, text_kind) > width - 6:
                raise ValueError(f"{self.title}: '{line}' does not fit its box")
            self.text(x + width / 2, base + index * LINE, line, text_kind, "middle")

    def line(self, *points, kind="wire", arrow=""):
        """A line through points; `arrow` is "", "end" or "both"."""
        path = "M" + "L".join(f"{number(x)} {number(y)}" for x, y in points)
        ends = {"marker-end": "url(#arrow)" if arrow else "", "marker-start": "url(#arrow)" if arrow == "both" else ""}
        self.add("path", max(y for _, y in points), kind=kind, d=path, **ends)

    def dot(self, x, y):
        """Where two lines are joined."""
        self.add("circle", y + 3, kind="dot", cx=x, cy=y, r=3)

    def bar(self, x, y, width, height, kind):
        self.add("rect", y + height, kind=f"bar-{kind}", x=x, y=y, width=width, height=height, rx=2)

    def svg(self):
        height = self.bottom + MARGIN - 4
        return "\n".join([
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {number(height)}" '
            f'width="{number(WIDTH * DISPLAY)}" height="{number(height * DISPLAY)}" role="img" '
            'aria-labelledby="title desc">',
            f'<title id="title">{escape(self.title)}</title>',
            f'<desc id="desc">{escape(self.description)}</desc>',
            f"<style>{escape(STYLE + appearing(self.steps))}</style>",
            f"<defs>{ARROWHEAD}</defs>",
            f'<rect class="card" x="1" y="1" width="{WIDTH - 2}" height="{number(height - 2)}" rx="8"/>',
            *self.parts,
            "</svg>", ""])
