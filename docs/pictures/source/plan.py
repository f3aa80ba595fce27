"""How a plan groups its fields into requests: for docs/plan.md. The fields are those of
examples/devices/energy-meter.yaml; `make plan` shows the requests."""

from drawing import LINE, MARGIN, WIDTH, Drawing

# A request: unit, table, first address, quantity, milliseconds; its fields: address, width, name.
READS = [
    (17, "holding registers", 0, 8, 500, [(0, 1, "V 1"), (1, 1, "V 2"), (2, 1, "V 3"), (6, 2, "power")]),
    (17, "holding registers", 20, 4, 2000, [(20, 2, "energy in"), (22, 2, "energy out")]),
    (17, "coils", 3, 7, 1000, [(3, 1, "pump"), (9, 1, "valve")]),
    (17, "input registers", 40, 1, 1000, [(40, 1, "temp.")]),
    (18, "holding registers", 0, 1, 1000, [(0, 1, "level")]),
]
CELL = 44


def draw():
    fields = sum(len(read[-1]) for read in READS)
    drawing = Drawing(
        f"A plan groups {fields} fields into {len(READS)} requests",
        "; ".join(f"unit {unit}, {table}, {quantity} from {first} on, every {time} ms: "
                  + ", ".join(f"{name} at {address}" for address, _, name in fields)
                  for unit, table, first, quantity, time, fields in READS) + ".")
    y = 28
    drawing.text(WIDTH / 2, y, f"{fields} fields of a table, {len(READS)} requests", "strong", "middle")
    for unit, table, first, quantity, time, fields in READS:
        y += 30
        drawing.text(MARGIN, y, f"unit {unit}, {table}: {quantity} from {first} on, every {time} ms", "soft")
        y += 18
        taken = {}
        for address, width, name in fields:
            taken.update({address + offset: None for offset in range(1, width)})
            taken[address] = (width, name)
        for address in range(first, first + quantity):
            x = MARGIN + 4 + (address - first) * CELL
            drawing.text(x + CELL / 2, y + 4, str(address), "soft", "middle")
            if address not in taken:
                drawing.box(x + 1, y + 8, CELL - 2, 26, "plain")
            elif taken[address]:
                width, name = taken[address]
                drawing.box(x + 1, y + 8, CELL * width - 2, 26, "ours", [name], ("soft", "soft"))
        left, right = MARGIN + 2, MARGIN + 6 + quantity * CELL
        y += 34
        drawing.line((left, y + 3), (left, y + 8), (right, y + 8), (right, y + 3), kind="trace trace-good")
    drawing.paragraph(MARGIN, y + 12 + LINE, WIDTH - 2 * MARGIN,
                      "Blue: a field. Grey: read as well, because the gap between two fields is small enough. Another "
                      "unit, table or interval is another request.", "soft")
    return drawing
