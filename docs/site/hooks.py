"""What MkDocs does beside its own: the pages of the API in the navigation, the anchors of a forge, words of code
that stay whole, and no file with the time of the build."""

import json
import pathlib
import re


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


# The most letters of a word that fits a line of a phone.
WORD = 44


def whole(block):
    """A block of code whose words with a hyphen stay in one line: a browser would break `--option` after a hyphen."""
    def word(found):
        return f'<span class="whole">{found[0]}</span>' if len(found[0]) <= WORD else found[0]

    parts = re.split(r"(<[^>]*>)", block[0])
    parts[::2] = [re.sub(r"[^\s<>]*-[^\s<>]*", word, part) for part in parts[::2]]
    return "".join(parts)


def on_page_content(html, **_):
    return re.sub(r"<pre\b.*?</pre>", whole, html, flags=re.S)
