"""Reads Doxygen's XML: the functions, types, constants and classes of the headers, and their
comments as HTML. A tag that this module does not know stops the build."""

import html
import re
import xml.etree.ElementTree as ElementTree

# Tags that become one HTML element each, and tags of which only the content is kept.
ELEMENTS = {
    "computeroutput": "code", "bold": "strong", "emphasis": "em", "itemizedlist": "ul",
    "orderedlist": "ol", "listitem": "li", "row": "tr", "table": "table",
}
KEPT = ["ref", "highlight", "codeline"]
CHARACTERS = {"sp": " ", "ndash": "–", "mdash": "—", "linebreak": "<br>"}
BLOCKS = ["itemizedlist", "orderedlist", "verbatim", "preformatted", "programlisting", "table"]


class Comment:
    """The comment of one item: HTML of its text, of its parameters, and of what it returns."""

    def __init__(self, item, link):
        self.link = link
        self.parameters, self.returns, self.notes = [], "", []
        self.brief = self.content(item.find("briefdescription")).strip()
        self.detail = self.content(item.find("detaileddescription")).strip()

    @property
    def first(self):
        """The first sentence as text without a paragraph around it."""
        return re.sub(r"^<p>|</p>$", "", self.brief.partition("</p>")[0])

    @property
    def text(self):
        return "".join([self.brief, self.detail, *self.notes])

    def content(self, node):
        if node is None:
            return ""
        parts = [self.link(node.text or "")]
        for child in node:
            parts += [self.element(child), self.link(child.tail or "")]
        return "".join(parts)

    def element(self, node):
        if node.tag in CHARACTERS:
            return CHARACTERS[node.tag]
        if node.tag == "parameterlist":
            for item in node.iter("parameteritem"):
                names = [name.text for name in item.iter("parametername")]
                self.parameters.append((", ".join(names), unwrapped(self.content(item.find("parameterdescription")))))
            return ""
        if node.tag == "simplesect":
            content = unwrapped(self.content(node))
            if node.get("kind") == "return":
                self.returns = content
            else:
                self.notes.append(f"<p><strong>{node.get('kind').capitalize()}:</strong> {content}</p>")
            return ""
        if node.tag == "programlisting":
            lines = ["".join(text_of(line)) for line in node.iter("codeline")]
            return f"<pre><code>{html.escape(chr(10).join(lines))}</code></pre>"
        if node.tag == "ulink":
            return f'<a href="{html.escape(node.get("url"))}">{self.content(node)}</a>'
        if node.tag in KEPT:
            return self.content(node)
        if node.tag == "para":
            return self.paragraph(node)
        if node.tag == "entry":
            cell = "th" if node.get("thead") == "yes" else "td"
            return f"<{cell}>{unwrapped(self.content(node))}</{cell}>"
        if node.tag in ("verbatim", "preformatted"):
            return f"<pre><code>{html.escape(''.join(node.itertext()))}</code></pre>"
        if node.tag not in ELEMENTS:
            raise SystemExit(f"site: docs/site/doxygen.py does not know Doxygen's <{node.tag}>")
        return f"<{ELEMENTS[node.tag]}>{self.content(node).strip()}</{ELEMENTS[node.tag]}>"

    def paragraph(self, node):
        """Doxygen puts lists and code into paragraphs; HTML has them beside paragraphs."""
        parts, line = [], self.link(node.text or "")
        for child in node:
            made = self.element(child)
            if child.tag in BLOCKS:
                parts += [line, made]
                line = self.link(child.tail or "")
            else:
                line += made + self.link(child.tail or "")
        parts.append(line)
        return "".join(part if part.startswith(("<ul>", "<ol>", "<pre>", "<table>")) else f"<p>{part.strip()}</p>"
                       for part in parts if part.strip())


def text_of(node):
    if node.tag == "sp":
        yield " "
    yield node.text or ""
    for child in node:
        yield from text_of(child)
        yield child.tail or ""


def unwrapped(content):
    """Without the paragraph around a single one."""
    content = content.strip()
    single = re.fullmatch(r"<p>((?:(?!</?p>).)*)</p>", content, re.S)
    return single[1].strip() if single else content


def plain(node):
    return re.sub(r"\s+", " ", "".join(node.itertext())).strip() if node is not None else ""


class Member:
    """A function, a constant, a typedef, or a field."""

    def __init__(self, node, link):
        self.kind, self.name = node.get("kind"), plain(node.find("name"))
        place = node.find("location")
        self.file, self.line = place.get("file"), int(place.get("line"))
        self.type, self.arguments = plain(node.find("type")), plain(node.find("argsstring"))
        self.is_public = node.get("prot") == "public"
        self.is_static = node.get("static") == "yes"
        self.value = plain(node.find("initializer"))
        self.parameters = [(plain(p.find("type")), plain(p.find("declname")) or plain(p.find("defname")),
                            plain(p.find("array")), plain(p.find("defval"))) for p in node.findall("param")]
        self.template = [plain(p.find("type")) + " " + plain(p.find("declname"))
                         for p in node.findall("templateparamlist/param")]
        self.values = [Member(value, link) for value in located(node, node.findall("enumvalue"))]
        self.comment = Comment(node, link)

    @property
    def is_private(self):
        """`make check-comments` holds every public name to a comment."""
        return not self.is_public or not self.comment.brief or self.comment.brief.lower().startswith("<p>private")


def located(parent, children):
    """Values of an enumeration have no place of their own."""
    for child in children:
        child.append(parent.find("location"))
        yield child


class Compound:
    """A struct, a class or a header."""

    def __init__(self, node, link):
        self.name, self.kind = plain(node.find("compoundname")), node.get("kind")
        place = node.find("location")
        self.file, self.line = place.get("file"), int(place.get("line") or 0)
        self.bases = [(plain(base), base.get("prot") == "public") for base in node.findall("basecompoundref")]
        self.template = [plain(p.find("type")) + (" " + plain(p.find("declname"))).rstrip()
                         for p in node.findall("templateparamlist/param")]
        self.members = [Member(m, link) for section in node.findall("sectiondef")
                        for m in section.findall("memberdef")]
        self.comment = Comment(node, link)


def read(folder, link=html.escape):
    """All compounds of the XML in a folder. `link` makes HTML of the text of comments."""
    compounds = []
    for file in sorted(folder.glob("*.xml")):
        root = ElementTree.parse(file).getroot()
        for node in root.findall("compounddef"):
            if node.get("kind") in ("struct", "class", "file"):
                compounds.append(Compound(node, link))
    return compounds
