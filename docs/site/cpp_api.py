"""The pages of the C++ API: one for each class, and one for what is outside of classes."""

import re

from entries import block, code, constants, declared, explained, heading, prototype, table, word

# The headers that a sketch includes, in the order of the navigation.
SKETCHES = ["ModbusMaster", "ModbusClient", "ModbusServer", "ModbusTcpServer", "ModbusTcpGateway", "ModbusSniffer"]
GUIDE = "docs/arduino-classes.md"


class Class:
    def __init__(self, compound):
        self.compound, self.name = compound, compound.name
        self.path = f"api/cpp/{re.sub(r'[^A-Za-z0-9_]+', '-', compound.name).strip('-')}.md"
        self.header = compound.file.rpartition("/")[2]
        self.members = [m for m in compound.members if not m.is_private]
        self.is_for_sketches = self.header.removesuffix(".h") in SKETCHES and bool(self.members)

    def names(self):
        return {self.name: None}

    def of(self, *kinds):
        return [m for m in self.members if m.kind in kinds]


def classes(compounds):
    """Every class that is not inside another one, those of sketches first."""
    found = [Class(c) for c in compounds if c.kind in ("class", "struct") and "::" not in c.name
             and "/Modbus" in c.file]
    order = {f"{name}.h": place for place, name in enumerate(SKETCHES)}
    return sorted(found, key=lambda c: (order.get(c.header, len(order)), c.header, f"{c.name}.h" != c.header,
                                        not c.members, c.compound.line))


def overloads(members):
    """Functions with one name, together, in the order of the first of each."""
    groups = {}
    for member in members:
        groups.setdefault(member.name, []).append(member)
    return groups


def function(name, group, level):
    text = heading(level, name, re.sub(r"\W+", "-", name).strip("-") or "operator")
    # Overloads without a comment of their own stand before the one that has it.
    waiting = []
    for member in group:
        waiting.append(prototype(member))
        if member.comment.text or member.comment.returns:
            text += code("\n".join(waiting), "cpp") + explained(member.comment)
            waiting = []
    return text + (code("\n".join(waiting), "cpp") if waiting else "")


def page(each, known):
    """The Markdown of a class's page. `known` are all classes by name."""
    compound = each.compound
    bases = [re.sub(r"< (.*?) >", r"<\1>", base) for base, is_public in compound.bases if is_public]
    template = f"template <{', '.join(compound.template)}>\n" if compound.template else ""
    inherits = " :\n    public " + ",\n    public ".join(bases) if bases else ""
    text = f"# {compound.name.replace('<', '&lt;')}\n\n"
    text += code(f"#include <{each.header}>\n\n{template}{compound.kind} {compound.name}{inherits};", "cpp")
    text += block(compound.comment.text)
    if each.is_for_sketches:
        text += f"The guide with sketches: [Arduino](/{GUIDE}).\n\n"
    functions = overloads(each.of("function"))
    if functions:
        rows = [[f'<a href="#{re.sub(chr(92) + "W+", "-", name).strip("-") or "operator"}"><code>{name}</code></a>',
                 next((m.comment.first for m in group if m.comment.first), "")] for name, group in functions.items()]
        text += table("summary", ["member", "does"], rows)
    for base in inherited(compound, known):
        names = list(overloads(base.of("function")))
        if names:
            links = ", ".join(f'<a href="@@{base.name}#{name}"><code>{name}</code></a>' for name in names
                              if name.isidentifier())
            text += f'<p class="inherited">From {word(base.name)}: {links}</p>\n\n'
    values = each.of("variable")
    if values:
        text += "## Values\n\n"
        rows = [[f'<code id="{m.name}">{declared(m.type, m.name, m.arguments)}</code>', m.comment.text] for m in values]
        text += table("fields", ["value", "meaning"], rows)
    for enumeration in each.of("enum"):
        text += f"## {enumeration.name or 'Constants'}\n\n" + block(enumeration.comment.text)
        text += constants(enumeration.values)
    typedefs = each.of("typedef")
    if typedefs:
        text += "## Types\n\n"
        for member in typedefs:
            text += heading(3, member.name) + code(typedef(member), "cpp") + explained(member.comment)
    if functions:
        text += "## Members\n\n"
        text += "".join(function(name, group, 3) for name, group in functions.items())
    return within(text, [name for name in functions if re.search(r"[a-z][A-Z]", name)])


def within(text, names):
    """Makes links of the members of a class that its comments name. Names like `begin`, which are words too, stay."""
    if not names:
        return text
    pattern = re.compile(rf"\b({'|'.join(map(re.escape, names))})\b(?!</(?:a|code)>)")
    lines = text.split("\n")
    for number, line in enumerate(lines):
        if line.startswith('<div class="entry">'):
            # Not in tags, and not in what is a link or code already.
            parts = re.split(r"(<a .*?</a>|<pre>.*?</pre>|<[^>]*>)", line)
            parts[::2] = [pattern.sub(r'<a href="#\1">\1</a>', part) for part in parts[::2]]
            lines[number] = "".join(parts)
    return "\n".join(lines)


def typedef(member):
    if member.arguments:
        return f"typedef {declared(member.type, member.name, member.arguments)};"
    return f"using {member.name} = {member.type};"


def inherited(compound, known):
    for base, is_public in compound.bases:
        found = known.get(re.sub(r"\s*<.*", "", base))
        if is_public and found:
            yield found
            yield from inherited(found.compound, known)


def loose(compounds):
    """The headers that have functions, macros or types outside of classes."""
    for file in compounds:
        if file.kind == "file" and "/Modbus" in file.file:
            members = [m for m in file.members if not m.is_private and not m.name.endswith("_H")]
            if members:
                yield file, members


def loose_page(compounds):
    text = "# Functions and macros\n\nWhat the headers for sketches have outside of classes.\n\n"
    for file, members in loose(compounds):
        text += f"## {file.name}\n\n" + block(file.comment.brief)
        defines = [m for m in members if m.kind == "define"]
        values = [m for m in members if m.kind == "variable"]
        text += constants(defines + values) if defines or values else ""
        for member in members:
            if member.kind == "enum":
                text += block(member.comment.text) + constants(member.values)
            elif member.kind == "typedef":
                text += heading(3, member.name) + code(typedef(member), "cpp") + explained(member.comment)
        functions = overloads([m for m in members if m.kind == "function"])
        text += "".join(function(name, group, 3) for name, group in functions.items())
    return text


def index(made, compounds):
    text = ("# C++ API\n\nClasses for sketches, header-only, C++11, without a heap. Each stands on the C functions of"
            f" `mbm.h`. [arduino-classes.md](/{GUIDE}) has complete sketches.\n\n")
    for title, wanted in [("Classes that a sketch declares", True), ("Classes that these stand on", False)]:
        rows = [[word(each.name), f"<code>{each.header}</code>", each.compound.comment.first] for each in made
                if each.is_for_sketches == wanted]
        text += f"## {title}\n\n" + table("sections", ["class", "header", "about"], rows)
    text += "## Headers\n\n"
    for file in sorted((c for c in compounds if c.kind == "file" and "/Modbus" in c.file), key=lambda c: c.name):
        text += heading(3, file.name, file.name.replace(".", "-")) + block(file.comment.text)
    return text
