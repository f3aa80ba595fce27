"""Converts an object file of the ESP32 to text for any Xtensa assembler: its bytes, and a line
for each relocation.

Debian has no assembler that supports the ESP32's register windows. So no check could show that
the user's assembler reads LLVM's text as LLVM does. Bytes have only one meaning.
"""

import struct
from typing import NamedTuple

SYMTAB, RELA, PROGBITS, NOBITS = 2, 4, 1, 8
ALLOC, EXECUTE = 2, 4
GLOBAL = 1
FUNCTION = 2
R_32, R_SLOT0_OP = 1, 20


class Section(NamedTuple):
    name: str
    kind: int
    flags: int
    data: bytes
    info: int
    align: int


class Symbol(NamedTuple):
    name: str
    value: int
    bind: int
    kind: int
    section: int


def string(table: bytes, at: int) -> str:
    return table[at:table.index(b"\0", at)].decode()


def member(archive: bytes) -> bytes:
    """The first object of an archive. It follows the table of symbols and the long names."""
    at = 8
    while at < len(archive):
        size = int(archive[at + 48:at + 58])
        data = archive[at + 60:at + 60 + size]
        if data.startswith(b"\x7fELF"):
            return data
        at += 60 + size + size % 2
    raise ValueError("no object in the archive")


def parse(elf: bytes) -> tuple:
    table, = struct.unpack_from("<I", elf, 32)
    size, count, names = struct.unpack_from("<HHH", elf, 46)
    raw = [struct.unpack_from("<10I", elf, table + i * size) for i in range(count)]

    def data(h: tuple) -> bytes:
        return b"" if h[1] == NOBITS else elf[h[4]:h[4] + h[5]]
    texts = data(raw[names])
    sections = [Section(string(texts, h[0]), h[1], h[2], data(h), h[7], h[8]) for h in raw]
    index = next(i for i, h in enumerate(raw) if h[1] == SYMTAB)
    texts = data(raw[raw[index][6]])
    symbols = []
    for name, value, _, info, _, section in struct.iter_unpack("<IIIBBH", sections[index].data):
        symbols.append(Symbol(string(texts, name), value, info >> 4, info & 15, section))
    return sections, symbols


def lines(archive: bytes) -> list:
    sections, symbols = parse(member(archive))
    used = [i for i, s in enumerate(sections) if s.kind == PROGBITS and s.flags & ALLOC and s.data]
    number = {section: i for i, section in enumerate(used)}
    fills = {s.info: s.data for s in sections if s.kind == RELA}
    out = []
    for section in used:
        out += one(sections[section], section, symbols, fills.get(section, b""), number)
    return out


def place(symbol: Symbol, addend: int, number: dict) -> str:
    if symbol.section == 0:
        name = symbol.name
    else:
        name = f".Ls{number[symbol.section]}"
        addend += symbol.value
    return f"{name}+{addend}" if addend else name


def one(section: Section, index: int, symbols: list, fills: bytes, number: dict) -> list:
    here = [s for s in symbols if s.section == index]
    exported = [s for s in here if s.bind == GLOBAL]
    function = bool(section.flags & EXECUTE)
    base, flags = (".text", "ax") if function else (".rodata", "a")
    name = exported[0].name if exported else f"mbm.{number[index]}"
    if ".unlikely." in section.name:
        name = f"unlikely.{name}"
    # Constants are not marked for merging, because relocations refer to their section.
    out = [f'\t.section\t{base}.{name},"{flags}",@progbits', f"\t.balign\t{max(section.align, 1)}",
           f".Ls{number[index]}:"]
    if exported and not function:
        raise ValueError(f"{section.name}: exported data")
    labels = {}
    for s in here:
        if s.kind == FUNCTION:
            label = s.name if s.bind == GLOBAL else f"mbm.{number[index]}"
            labels.setdefault(s.value, []).append(label)
            if s.bind == GLOBAL:
                out.append(f"\t.globl\t{label}")
            out.append(f"\t.type\t{label},@function")
    words = {}
    for at, info, addend in struct.iter_unpack("<IIi", fills):
        symbol = symbols[info >> 8]
        if info & 255 == R_32:
            # The value in the section is added to the addend.
            words[at] = place(symbol, addend + struct.unpack_from("<i", section.data, at)[0], number)
        elif info & 255 == R_SLOT0_OP:
            out.append(f"\t.reloc\t{at}, R_XTENSA_SLOT0_OP, {place(symbol, addend, number)}")
        else:
            raise ValueError(f"{section.name}: relocation {info & 255}")
    return out + body(section.data, labels, words)


def body(data: bytes, labels: dict, words: dict) -> list:
    out = []
    stops = sorted({*labels, *words, len(data)})
    at = 0
    while at < len(data) or at in labels:
        out += [f"{label}:" for label in labels.get(at, [])]
        if at in words:
            out.append(f"\t.long\t{words[at]}")
            at += 4
            continue
        end = next((stop for stop in stops if stop > at), at)
        for row in range(at, end, 32):
            out.append("\t.byte\t" + ",".join(str(b) for b in data[row:min(row + 32, end)]))
        if end == at:
            break
        at = end
    return out
