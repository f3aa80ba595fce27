"""How the reply is found in noise, byte by byte: for docs/reliability.md and docs/architecture.md."""

from drawing import MARGIN, WIDTH, Drawing

UNIT, FUNCTION, WORDS = 17, 3, (555, 0, 100)


def crc16(data):
    """The CRC of an RTU frame, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return bytes([crc & 0xFF, crc >> 8])


CONTENT = bytes([UNIT, FUNCTION, 2 * len(WORDS)]) + b"".join(word.to_bytes(2, "big") for word in WORDS)
REPLY = CONTENT + crc16(CONTENT)
# One byte of noise, then the beginning of a reply that broke off.
NOISE = bytes([0xF8]) + CONTENT[:3]
RECEIVED = NOISE + REPLY
CELL = (WIDTH - 2 * MARGIN) / len(RECEIVED)


def draw():
    false_crc = crc16(RECEIVED[1:1 + len(CONTENT)])
    claimed = RECEIVED[1 + len(CONTENT):1 + len(REPLY)]
    assert false_crc != claimed and RECEIVED[1:4] == REPLY[:3] and (len(REPLY), len(RECEIVED)) == (11, 15)
    drawing = Drawing(
        "How mbm finds a reply behind noise",
        f"The received bytes are {RECEIVED.hex(' ').upper()}. For each byte mbm looks at the last {len(REPLY)} bytes. At "
        "the eleventh byte they begin with another byte than the unit. At the twelfth byte they begin like the reply, but "
        "their CRC is wrong. At the thirteenth and fourteenth byte they do not begin with the unit. At the fifteenth "
        "byte they begin like the reply, and their CRC is right.")
    y = 28
    drawing.text(WIDTH / 2, y, f"unit {UNIT} was asked for {len(WORDS)} holding registers:", "", "middle")
    drawing.text(WIDTH / 2, y + 18, f"the reply begins {REPLY[:3].hex(' ').upper()}, and has {len(REPLY)} bytes", "",
                 "middle")
    top = y + 34
    y = top + 30

    def arrive(last, kind="plain"):
        """The byte of this number."""
        drawing.box(MARGIN + (last - 1) * CELL + 1, top, CELL - 2, 30, kind, [f"{RECEIVED[last - 1]:02X}"], ("code", ""))

    def suffix(y, last, kind, texts):
        """A bracket below as many bytes as the reply has, up to number `last`, and what is found."""
        first = last - len(REPLY)
        left, right = MARGIN + first * CELL + 2, MARGIN + last * CELL - 2
        drawing.line((left, y + 8), (left, y + 14), (right, y + 14), (right, y + 8), kind=f"trace trace-{kind}")
        for index, text in enumerate(texts):
            width = WIDTH - MARGIN - left
            y = drawing.paragraph(left, y + 31 if index == 0 else y, width, text, "strong" if index == 0 else "soft")
        return y - 10

    for last in range(1, 11):
        drawing.appear(0.4)
        arrive(last)
    drawing.appear(3)
    arrive(11)
    y = suffix(y, 11, "bad", ["byte 11: no", f"the last {len(REPLY)} bytes begin with {RECEIVED[0]:02X}, which is not the unit"])
    drawing.appear(4)
    arrive(12)
    y = suffix(y, 12, "bad",
               ["byte 12: no", f"they begin like the reply; but the CRC of the first 9 is {false_crc.hex(' ').upper()}, and "
                f"{claimed.hex(' ').upper()} stands there"])
    drawing.appear(3)
    arrive(13)
    arrive(14)
    y = suffix(y, 13, "bad", ["bytes 13 and 14: no",
                              f"they begin with {RECEIVED[2]:02X} and with {RECEIVED[3]:02X}, which are not the unit"])
    drawing.appear(10)
    for last in range(len(NOISE) + 1, len(RECEIVED) + 1):
        arrive(last, "good")
    y = suffix(y, 15, "good",
               ["byte 15: yes", f"the CRC {REPLY[-2:].hex(' ').upper()} is right", f"registers: {', '.join(map(str, WORDS))}"])
    drawing.bottom = y
    return drawing
