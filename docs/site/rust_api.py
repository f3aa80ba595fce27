"""The Rust API: a page of the site with every item of the crate, from what rustdoc wrote, and a bar
on rustdoc's own pages that leads back to the site."""

import html
import re

from breaks import RUST, broken_well
from entries import table

IMPLEMENTORS = re.compile(r'src="([./]+)(trait\.impl/[\w./]+\.js)"')
BAR = "<!-- the way back -->"
ITEM = re.compile(r'<dt>(?:<[^>]*>)*?<a class="(\w+)" href="([\w./]+)" title="\w+ ([\w:]+)">.*?</dt>(?:<dd>(.*?)</dd>)?', re.S)
KINDS = {"struct": "struct", "enum": "enum", "trait": "trait", "fn": "function", "constant": "constant",
         "type": "type", "mod": "module", "macro": "macro", "static": "static"}


def text_of(markup):
    """Rustdoc's short description without links."""
    return re.sub(r"\s+", " ", re.sub(r"</?a\b[^>]*>|<wbr>", "", markup or "")).strip()


def items(file):
    """(kind, address, path, description) of each item of a module's page."""
    return [(KINDS[kind], link, path, text_of(about))
            for kind, link, path, about in ITEM.findall(file.read_text(encoding="utf-8")) if kind in KINDS]


def rows(found, place):
    """The table of items whose pages are in the folder `place`."""
    made = [[f'<a href="../rust/mbm/{place}{address}"><code>{path.rpartition("::")[2]}</code></a>', kind, about]
            for kind, address, path, about in found]
    return table("sections", ["item", "kind", "about"], made) if made else ""


def page(folder):
    """The Markdown of the page, from `folder`, where rustdoc's pages of the crate are."""
    text = ("# Rust API\n\nThe core is a crate, `mbm`: `no_std`, without `alloc`, without unsafe code. The C functions"
            " stand on it.\n\n")
    text += ('<p><a class="md-button md-button--primary" href="../rust/mbm/index.html">The crate\'s documentation, with'
             " examples</a></p>\n\n")
    root = items(folder / "index.html")
    text += rows([item for item in root if item[0] != "module"], "")
    for kind, _, path, about in root:
        if kind == "module":
            name = path.removeprefix("mbm::")
            text += f"## {name}\n\n<div class=\"entry\"><p>{about}</p></div>\n\n"
            text += rows(items(folder / name / "index.html"), f"{html.escape(name)}/")
    return text


def lead_back(folder):
    """Puts the path to the site's first page into the bar of each of rustdoc's pages, ends its lines of code where they may
    end, and adds the lists of a
    trait's implementors that rustdoc names and does not write, as empty ones. Returns how many pages have the bar."""
    count = 0
    for file in folder.rglob("*.html"):
        text = file.read_text(encoding="utf-8")
        for _, script in IMPLEMENTORS.findall(text):
            listed = folder / script
            listed.parent.mkdir(parents=True, exist_ok=True)
            listed.touch()
        if BAR in text:
            root = "../" * (len(file.relative_to(folder).parts))
            text = text.replace(BAR, "").replace("SITE/", root)
            # Sources scroll beside the numbers of their lines.
            file.write_text(text if '<body class="rustdoc src">' in text else broken_well(text, RUST), encoding="utf-8")
            count += 1
    return count
