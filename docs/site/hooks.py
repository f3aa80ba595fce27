"""What MkDocs does beside its own: the pages of the API in the navigation, the anchors of a forge, lines of code
that end where they may, wide enough columns of text, and no file with the time of the build."""

import json
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))

from breaks import broken_well  # noqa: E402


def slug(text, separator):
    """The anchor of a heading, as a forge and scripts/check/pages make it."""
    return re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", separator)


def expanded(entry, folders):
    """The navigation with the pages that docs/site/build has made in the place of their folders."""
    if isinstance(entry, list):
        return [each for part in entry for each in
                (folders[part] if isinstance(part, str) and part in folders else [expanded(part, folders)])]
    if isinstance(entry, dict):
        return {name: expanded(part, folders) for name, part in entry.items()}
    return entry


def on_config(config):
    pages = pathlib.Path(config.docs_dir)
    folders = json.loads((pages.parent / "site-parts/navigation.json").read_text())
    config.nav = expanded(config.nav, folders)
    config.mdx_configs["toc"]["slugify"] = slug
    # A sitemap needs an address and has the day of the build.
    config.theme.static_templates -= {"sitemap.xml"}
    return config


# A cell with more letters holds sentences, and is not squeezed between columns of code.
SENTENCE = 40


def cell(found):
    return '<td class="text">' + found[1] if len(re.sub(r"<[^>]*>", "", found[1])) > SENTENCE else found[0]


def on_page_content(html, **_):
    return broken_well(re.sub(r"<td>((?:(?!</td>).)*)", cell, html, flags=re.S))
