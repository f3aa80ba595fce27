"""How the reply is found in noise: for docs/reliability.md. scripts/check-pictures gives the bytes of
this picture to a master, by c-tests/play_transaction.c."""

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
    assert false_crc != claimed and RECEIVED[1:4] == REPLY[:3]
    drawing = Drawing(
        "How mbm finds a reply behind noise",
        f"The received bytes are {RECEIVED.hex(' ').upper()}. The first byte is not the unit. The second to fourth "
        "byte begin like the reply, but the CRC of the frame that would begin there is wrong. The fifth byte begins "
        "the reply: its CRC is right.")
    y = 28
    drawing.text(WIDTH / 2, y, f"unit {UNIT} was asked for {len(WORDS)} holding registers:", "", "middle")
    drawing.text(WIDTH / 2, y + 18, f"the reply begins {REPLY[:3].hex(' ').upper()}, and has {len(REPLY)} bytes", "",
                 "middle")
    y += 34
    for index, byte in enumerate(RECEIVED):
        kind = "good" if index >= len(NOISE) else "plain"
        drawing.box(MARGIN + index * CELL + 1, y, CELL - 2, 30, kind, [f"{byte:02X}"], ("code", ""))
    y += 30

    def candidate(y, first, count, kind, texts):
        """A bracket below the bytes that are looked at, and what is found."""
        left, right = MARGIN + first * CELL + 2, MARGIN + (first + count) * CELL - 2
        drawing.line((left, y + 8), (left, y + 14), (right, y + 14), (right, y + 8), kind=f"trace trace-{kind}")
        for index, text in enumerate(texts):
            width = WIDTH - MARGIN - left
            y = drawing.paragraph(left, y + 31 if index == 0 else y, width, text, "strong" if index == 0 else "soft")
        return y - 10

    y = candidate(y, 0, 1, "bad", ["not here", f"{RECEIVED[0]:02X} is not the unit: one byte on"])
    y = candidate(y, 1, len(REPLY), "bad",
                  ["not here", f"begins like the reply; but the CRC of its 9 bytes is {false_crc.hex(' ').upper()}, and "
                   f"{claimed.hex(' ').upper()} stands there: one byte on"])
    y = candidate(y, 2, 2, "bad", ["not here", f"{RECEIVED[2]:02X} and {RECEIVED[3]:02X} are not the unit"])
    y = candidate(y, len(NOISE), len(REPLY), "good",
                  ["here", f"the CRC {REPLY[-2:].hex(' ').upper()} is right", f"registers: {', '.join(map(str, WORDS))}"])
    drawing.bottom = y
    return drawing
