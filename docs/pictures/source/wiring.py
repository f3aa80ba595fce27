"""Wiring of an RS-485 transceiver: for docs/guide-arduino.md. One picture for boards of 5 V, one for
boards of 3.3 V."""

from drawing import MARGIN, WIDTH, Drawing

TERMINATION = 120
NEEDED = 0.2  # volts between A and B that every receiver takes for silence
# The wires of the chip's upper side: where, the pin of the chip.
UPPER = [(60, "VCC"), (132, "DI"), (200, "DE + /RE"), (268, "RO"), (340, "GND")]
A, B, GROUND = 140, 260, 340


def resistor(drawing, left, right, y, label):
    """A resistor between two wires, with its value above it."""
    middle = (left + right) / 2
    drawing.line((left, y), (middle - 20, y))
    drawing.line((middle + 20, y), (right, y))
    drawing.box(middle - 20, y - 6, 40, 12)
    drawing.text(middle, y - 10, label, "soft", "middle")
    drawing.dot(left, y)
    drawing.dot(right, y)


def wired(board, chip, volts, bias, pins, note):
    """`pins` are the pins of the board at the wires of UPPER."""
    line = TERMINATION / 2
    idle = volts * line / (line + 2 * bias)
    assert NEEDED < idle < 0.3, f"{idle} V between A and B"
    drawing = Drawing(
        f"Wiring of a {chip} to {board}",
        f"The board's pins {', '.join(pins)} are wired to the transceiver's VCC, DI, DE with /RE, RO and GND. The "
        f"transceiver's A goes to the meter's terminal A, also named + or D1, its B to B, also named - or D0, and "
        f"ground to ground. {TERMINATION} ohms join A and B at each end of the line. {bias} ohms lead from VCC to A and "
        "from B to ground, at one place of the line.")
    y = MARGIN
    drawing.box(MARGIN, y, WIDTH - 2 * MARGIN, 56, "ours")
    drawing.text(WIDTH / 2, y + 20, board, "strong", "middle")
    for (x, _), pin in zip(UPPER, pins):
        drawing.text(x, y + 46, pin, "soft", "middle")
    y += 56
    for x, _ in UPPER:
        drawing.line((x, y), (x, y + 30))
    drawing.text(UPPER[1][0] + 6, y + 20, "sends", "soft")
    drawing.text(UPPER[3][0] + 6, y + 20, "receives", "soft")
    y += 30
    # The chip is narrower than the board: its supply passes on both sides to the bias resistors.
    drawing.box(MARGIN + 20, y, WIDTH - 2 * MARGIN - 40, 74, "good")
    for x, pin in UPPER:
        drawing.text(x, y + 18, pin, "soft", "middle")
    drawing.text(WIDTH / 2, y + 43, chip, "strong", "middle")
    y += 74
    for x, pin in [(A, "A"), (B, "B")]:
        drawing.text(x, y - 8, pin, "strong", "middle")
    for x, _ in (UPPER[0], UPPER[4]):
        drawing.line((x, y), (x, y + 34))
    drawing.text(UPPER[0][0], y - 8, "VCC", "soft", "middle")
    drawing.text(GROUND, y - 8, "GND", "soft", "middle")
    resistor(drawing, UPPER[0][0], A, y + 34, f"{bias} Ω")
    resistor(drawing, B, GROUND, y + 34, f"{bias} Ω")
    resistor(drawing, A, B, y + 72, f"{TERMINATION} Ω")
    bottom = y + 178
    for x in (A, B):
        drawing.line((x, y), (x, bottom))
    drawing.line((GROUND, y + 34), (GROUND, bottom))
    drawing.text((A + B) / 2, y + 104, "twisted pair", "soft", "middle")
    drawing.text((A + B) / 2, y + 120, "up to 1000 m", "soft", "middle")
    resistor(drawing, A, B, bottom - 20, f"{TERMINATION} Ω")
    drawing.box(MARGIN, bottom, WIDTH - 2 * MARGIN, 56, "theirs")
    for x, terminal in [(A, "A, +, D1"), (B, "B, −, D0"), (GROUND, "GND, C")]:
        drawing.text(x, bottom + 20, terminal, "soft", "middle")
    drawing.text(WIDTH / 2, bottom + 44, "meter, at the end of the line", "strong", "middle")
    y = bottom + 80
    for words in (f"These resistors hold A {idle * 1000:.0f} mV above B while nobody sends. The standard has the letters the other way round: its B is "
                  "D1, the chip's A. No reply? Swap A and B; that does no harm.", note):
        y = drawing.paragraph(MARGIN, y, WIDTH - 2 * MARGIN, words, "soft") + 4
    return drawing


def draw_all():
    return {
        "wiring-5v": wired(
            "Arduino Uno, Nano (5 V)", "MAX485", 5.0, 560, ["5V", "11", "2", "10", "GND"],
            "Many modules with a MAX485 have resistors of 120 Ω on them. Only the two ends of a line need one, and "
            "only one place the resistors of 560 Ω."),
        "wiring-3v3": wired(
            "ESP32, ESP8266, RP2040 (3.3 V)", "MAX3485, SP3485", 3.3, 390, ["3V3", "TX", "GPIO", "RX", "GND"],
            "Do not lead RO of a 5 V chip to a pin of 3.3 V. A chip of 3.3 V and one of 5 V work on one line. Only the "
            "two ends of a line need 120 Ω, and only one place the 390 Ω."),
    }
