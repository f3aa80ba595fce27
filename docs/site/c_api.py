"""The pages of the C API: one for each section of the parts of mbm.h, and one for each port for Linux."""

import re

from entries import block, code, constants, declared, explained, heading, prototype, summary, table, word

HEADER = "include/mbm.h"
# The page with the guide to a section; a section without one is explained by its comments alone.
GUIDES = {
    "Version": "CHANGELOG.md", "Statuses": "docs/status-codes.md", "Port": "docs/port.md",
    "Limits": "docs/packets.md",
    "Functions and framings": "docs/packets.md", "Master": "docs/master.md", "Client": "docs/client.md",
    "Plan": "docs/plan.md", "Link": "docs/link.md", "Server": "docs/server.md",
    "Units": "docs/server.md", "Gateway": "docs/gateway.md", "Values": "docs/values.md",
    "Packets": "docs/packets.md", "Sniffer": "docs/sniffer.md", "Trace": "docs/trace.md",
    "Ring": "docs/port.md#a-uart-without-a-fifo",
}
PORT_GUIDES = {
    "mbm_tty": "docs/ports-linux.md", "mbm_tcp": "docs/ports-linux.md", "mbm_call": "docs/ports-linux.md",
    "mbm_udp": "docs/ports-linux.md#over-udp", "mbm_loop": "docs/ports-linux.md#many-devices-in-one-process", "mbm_tls": "docs/security.md", "mbm_tls_linux": "docs/security.md",
}


class Section:
    """A part of the API that has a page."""

    def __init__(self, title, about, path, guide, members, compounds, intro="", include=""):
        self.title, self.about, self.path, self.guide, self.intro = title, about, path, guide, intro
        self.include = include
        known = [m for m in members if not m.is_private]
        self.functions = [m for m in known if m.kind == "function"]
        self.constants = [m for m in known if m.kind == "define" and not m.name.endswith("_H")]
        structs = {compound.name for compound in compounds}
        self.typedefs = [m for m in known if m.kind == "typedef" and m.name not in structs]
        self.enumerations = [m for m in known if m.kind == "enum"]
        self.types = sorted(compounds, key=lambda c: c.line)

    def names(self):
        """{name: anchor}"""
        every = self.functions + self.constants + self.types + self.typedefs
        every += [value for enumeration in self.enumerations for value in enumeration.values]
        return {item.name: item.name for item in every}


def slug(title):
    return re.sub(r"\W+", "-", title.lower())


def sections(root, header, compounds):
    """The sections of the parts that mbm.h includes."""
    return [section for part in re.findall(r'^#include "(mbm/\w+\.h)"', header, re.M)
            for section in of_part(part, (root / "include" / part).read_text(), compounds)]


def of_part(part, text, compounds):
    """The sections of a part. A comment begins each; what stands before the first is its own."""
    lines = text.splitlines()
    starts = [(number, m[1], m[2]) for number, line in enumerate(lines, 1)
              if (m := re.match(r"/\* ==== (.*?): (.*?) =+ \*/", line))]
    file = next(c for c in compounds if c.kind == "file" and c.file.endswith(f"include/{part}"))
    structs = [c for c in compounds if c.kind == "struct" and c.file == file.file]
    made = []
    for place, (start, title, about) in enumerate(starts):
        end = starts[place + 1][0] if place + 1 < len(starts) else len(lines) + 1
        # The macros at the head of the file belong to the first section.
        start = 0 if place == 0 else start
        def inside(item):
            return start < item.line < end
        made.append(Section(title, about, f"api/c/{slug(title)}.md", GUIDES.get(title),
                            [m for m in file.members if inside(m)], [c for c in structs if inside(c)],
                            include=part))
    return made


def ports(compounds):
    """A section for each header of ports/linux."""
    made = []
    for file in compounds:
        if file.kind == "file" and "/linux/mbm_" in file.file and file.file.endswith(".h"):
            name = file.name.removesuffix(".h")
            structs = [c for c in compounds if c.kind == "struct" and c.file == file.file]
            made.append(Section(f"{name}.h", file.comment.first, f"api/c/{name}.md", PORT_GUIDES.get(name),
                                file.members, structs, file.comment.detail))
    return made


def struct(compound):
    fields = [m for m in compound.members if not m.is_private]
    if not fields:
        return f"typedef struct {compound.name} {compound.name}; /* its fields are private */"
    lines = [f"    {declared(m.type, m.name, m.arguments)};" for m in fields]
    lines += ["    /* and private fields */"] if len(fields) < len(compound.members) else []
    return "\n".join([f"typedef struct {compound.name} {{", *lines, f"}} {compound.name};"])


def page(section, titles):
    """The Markdown of a section's page. `titles` are those of the project's pages."""
    text = f"# {section.title}\n\n{section.about[0].upper() + section.about[1:].rstrip('.')}."
    if section.guide:
        text += f" Guide: [{titles[section.guide.partition('#')[0]]}](/{section.guide})."
    text += f" It is in `{section.include}`." if section.include else ""
    text += "\n\n" + block(section.intro)
    if section.functions:
        text += summary(section.functions)
    if section.types or section.typedefs:
        text += "## Types\n\n"
        for compound in section.types:
            text += heading(3, compound.name) + code(struct(compound)) + block(compound.comment.text)
            rows = [[f"<code>{m.name}</code>", m.comment.text] for m in compound.members if not m.is_private]
            text += table("fields", ["field", "meaning"], rows) if rows else ""
        for member in section.typedefs:
            text += heading(3, member.name)
            text += code(f"typedef {declared(member.type, member.name, member.arguments)};") + explained(member.comment)
    parts = [functions_of(section), constants_of(section)]
    # A section of constants begins with them.
    return text + "".join(reversed(parts) if len(section.constants) > len(section.functions) else parts)


def functions_of(section):
    if not section.functions:
        return ""
    return "## Functions\n\n" + "".join(heading(3, m.name) + code(prototype(m)) + explained(m.comment)
                                        for m in section.functions)


def constants_of(section):
    if not section.constants and not section.enumerations:
        return ""
    text = "## Constants\n\n" + (constants(section.constants) if section.constants else "")
    return text + "".join(block(each.comment.text) + constants(each.values) for each in section.enumerations)


def index(header, made):
    """The first page: the rules of every function, the sections, and every function."""
    rules = re.search(r"^ \* Rules of every function:\n(.*?)^ \*\n", header, re.S | re.M)[1]
    rules = re.sub(r"^ \* ?", "", rules, flags=re.M)
    of_header = [s for s in made if not s.title.endswith(".h")]
    of_linux = [s for s in made if s.title.endswith(".h")]
    rows = [[f'<a href="@@{s.path}">{s.title}</a>', s.about, len(s.functions)] for s in of_header]
    text = ("# C API\n\nYou include one header, `mbm.h`, or those of its parts that you need, and link one archive. The"
            " archive carries these functions; your linker drops the ones that you do not call.\n\n")
    text += table("sections", ["section", "about", "functions"], rows)
    text += f"## Rules of every function\n\n{rules}\n## Ports for Linux\n\n"
    text += ("Sources beside the archive: compile the ones that you need with your program."
             " [guide-linux.md](/docs/guide-linux.md) shows how.\n\n")
    text += table("sections", ["header", "about"], [[f'<a href="@@{s.path}">{s.title}</a>', s.about] for s in of_linux])
    text += "## Every function\n\n"
    names = sorted((m.name, m.comment.first) for s in of_header for m in s.functions)
    text += table("summary", ["function", "does"], [[word(name), about] for name, about in names])
    return text
