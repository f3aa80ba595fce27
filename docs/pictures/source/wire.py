"""What the first program of the README puts on the wire, and what comes back: for the README and docs/index.md."""

from drawing import MARGIN, WIDTH, Drawing
from search import crc16

BAUD = 19200
UNIT, ADDRESS, VALUES = 17, 107, (555, 100)


def framed(*fields):
    """The fields of a frame, each a name and bytes, and the CRC."""
    return [*fields, ("CRC", crc16(b"".join(data for _, data in fields)))]


def word(value):
    return value.to_bytes(2, "big")


REQUEST = framed(("unit", bytes([UNIT])), ("function", bytes([3])), ("address", word(ADDRESS)), ("quantity", word(len(VALUES))))
REPLY = framed(("unit", bytes([UNIT])), ("function", bytes([3])), ("bytes", bytes([2 * len(VALUES)])),
               *((f"register {ADDRESS + index}", word(value)) for index, value in enumerate(VALUES)))


def length(frame):
    return sum(len(data) for _, data in frame)


def milliseconds(characters):
    return f"{characters * 11 / BAUD * 1000:.1f} ms"


CELL = (WIDTH - 2 * MARGIN) / length(REPLY)


def draw():
    written = [" ".join(f"{name} {data.hex(' ').upper()}" for name, data in frame) for frame in (REQUEST, REPLY)]
    drawing = Drawing(
        f"Reading registers {ADDRESS} and {ADDRESS + 1} of unit {UNIT}, on the wire",
        f"At {BAUD} baud. The line is silent for {milliseconds(3.5)}. The master sends {length(REQUEST)} bytes in "
        f"{milliseconds(length(REQUEST))}: {written[0]}. The device works. Then it sends {length(REPLY)} bytes in "
        f"{milliseconds(length(REPLY))}: {written[1]}.")

    def words(name, data):
        """What stands below a field, line by line."""
        number = int.from_bytes(data, "big")
        if name == "CRC":
            return [name, "right" if data == REPLY[-1][1] else ""]
        if name.startswith("register "):
            return [*name.split(), f"= {number}"]
        return ["func." if name == "function" else name, str(number)]

    def show(y, frame, kind, seconds):
        x = MARGIN
        for name, data in frame:
            drawing.appear(seconds)
            width = len(data) * CELL
            for index, byte in enumerate(data):
                drawing.box(x + index * CELL + 1, y, CELL - 2, 28, "plain" if name == "CRC" else kind, [f"{byte:02X}"], ("code", ""))
            for index, line in enumerate(words(name, data)):
                drawing.text(x + width / 2, y + 43 + 16 * index, line, "soft", "middle")
            x += width
        return y + 59

    y = 28
    drawing.text(MARGIN, y, f"master: {length(REQUEST)} bytes, {milliseconds(length(REQUEST))} at {BAUD} baud", "strong", colour="ours")
    y = show(y + 12, REQUEST, "ours", 0.7)
    drawing.appear(1.5)
    drawing.text(MARGIN, y + 34, f"device: {length(REPLY)} bytes, {milliseconds(length(REPLY))}", "strong", colour="theirs")
    y = show(y + 46, REPLY, "theirs", 0.7)
    drawing.end_steps(10)
    drawing.paragraph(MARGIN, y + 42, WIDTH - 2 * MARGIN,
                      f"Before the request the line is silent for {milliseconds(3.5)}. The right reply ends the call with its last byte.",
                      "soft")
    return drawing
