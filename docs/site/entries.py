"""Makes Markdown of functions, types and constants: headings that the contents and the search
know, code in C, and HTML for the rest. `@@NAME` in an href stands for the page of NAME."""

import html
import re

LINE = 72


def word(name, text=None):
    """A name in code, as a link to its page."""
    return f'<a href="@@{name}"><code>{html.escape(text or name)}</code></a>'


def linker(names):
    """A function that makes HTML of a text, in which each of `names` is a link."""
    def link(text):
        return re.sub(r"\b\w{4,}\b", lambda found: f'<a href="@@{found[0]}">{found[0]}</a>' if found[0] in names
                      else found[0], html.escape(text, quote=False))
    return link


def declared(kind, name, rest=""):
    """A declaration in C's order, of a type as Doxygen splits it."""
    kind, rest = re.sub(r"\bstruct (mbm_)", r"\1", kind), re.sub(r"\bstruct (mbm_)", r"\1", rest)
    if kind.endswith("(*"):  # a pointer to a function
        return f"{kind[:-2].rstrip()} (*{name}{rest}"
    kind = re.sub(r"\s*([*&]+)$", r" \1", kind.replace("(*", " (*"))
    return f"{kind}{name}{rest}" if kind.endswith(("*", "&")) else f"{kind} {name}{rest}".strip()


def parameter(kind, name, array, default):
    if "(*" in kind and ")(" in kind:
        text = re.sub(r"\(\*\s*\)", f"(*{name})", kind)
        text = re.sub(r"\bstruct (mbm_)", r"\1", text)
    elif "(&" in kind:
        text = kind.replace("(&", f"(&{name}", 1)
    else:
        text = declared(kind, name, array)
    return text + (f" = {default}" if default else "")


def prototype(member, suffix=";"):
    """The declaration of a function: one line if it is short, else a line for each parameter."""
    head = declared(member.type, member.name)
    if member.is_static and not head.startswith("static "):
        head = "static " + head
    if member.template:
        head = f"template <{', '.join(part.strip() for part in member.template)}>\n{head}"
    parameters = [parameter(*each) for each in member.parameters]
    after = member.arguments.rpartition(")")[2].strip()
    end = f") {after}".rstrip() + suffix
    short = f"{head}({', '.join(parameters)}{end}"
    if max(map(len, short.splitlines())) <= LINE and len(parameters) < 3:
        return short
    return f"{head}(\n    " + ",\n    ".join(parameters) + end


def code(text, language="c"):
    return f"```{language}\n{text}\n```\n\n"


def table(kind, heads, rows):
    """A table as HTML in one line, so that Markdown leaves it alone."""
    head = "".join(f"<th>{text}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="table {kind}"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>\n\n'


def block(content):
    """HTML that Markdown leaves alone: no empty line may be in it, except in <pre>."""
    return f'<div class="entry">{re.sub(chr(10) * 2, chr(10) + "&#10;", content)}</div>\n\n' if content else ""


def explained(comment):
    """Parameters and the returned value of a function."""
    text = comment.text
    if comment.parameters:
        text += '<dl class="parameters">' + "".join(
            f"<dt><code>{html.escape(name)}</code></dt><dd>{about}</dd>" for name, about in comment.parameters) + "</dl>"
    if comment.returns:
        text += f'<p class="returns"><strong>Returns</strong> {comment.returns}</p>'
    return block(text)


def heading(level, name, anchor=None):
    return f"{'#' * level} {html.escape(name)} {{ #{anchor or name} .name }}\n\n{parts(name)}"


def parts(name):
    """What else one may look for to find a name, for the search: mbm_client_readCoils is also
    client_readCoils, readCoils, and read coils."""
    rest = name.split("_")
    words = ["_".join(rest[start:]) for start in range(1, len(rest))]
    words += [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", name) if word.lower() != "mbm"]
    return f"<p hidden>{' '.join(dict.fromkeys(words))}</p>\n\n"


def constants(members):
    """A table; each row has an anchor."""
    rows = []
    for member in members:
        arguments = f"({', '.join(name for _, name, _, _ in member.parameters)})" if member.parameters else ""
        rows.append([f'<code id="{member.name}">{member.name}{arguments}</code>',
                     f"<code>{html.escape(short_value(member.value))}</code>", member.comment.text])
    return table("constants", ["constant", "value", "meaning"], rows)


def short_value(value):
    return value if len(value) <= 28 else "…"


def summary(members):
    """What each function does, in a line."""
    return table("summary", ["function", "does"], [[word(m.name), m.comment.first] for m in members])
