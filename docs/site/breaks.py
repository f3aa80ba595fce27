"""Where a line of code may end on a narrow screen: at a space, and in what is too long for a line after a slash, a comma and the
like. A browser would also break `--option` and `c-tests` after a hyphen, and a word or a number wherever a line is full."""

import html
import re

# The most letters that fit a line of a phone, in a block of code and in a text: of the site's pages, and of rustdoc's.
SITE, RUST = (48, 40), (40, 30)
TAGS = re.compile(r"(<[^>]*>)")


def ends(token, longest):
    """The places in a token of code, which has no space, at which a line may end: none if it fits a line."""
    found = [0, len(token)]
    for places in (r"[,;/=({\[|&?](?=[\w\"'<{\[-])|:(?=[^\W\d])|(?<=\"):|(?<=[^\d\W])\.(?=[^\d\W])", "_(?=[^_])", "-(?=[^-])"):
        pairs = list(zip(found, found[1:]))
        for first, last in pairs:
            if last - first > longest:
                found += [first + at.end() for at in re.finditer(places, token[first:last]) if first + at.end() < last]
        found = sorted(set(found))
    return found[1:-1]


def kept(code, longest):
    """Code in HTML: each word with a hyphen is in one piece, and what is longer than a line may break at `ends`."""
    parts = TAGS.split(code)
    # The letters of all texts, with the part in which each is.
    letters = [(number, letter) for number in range(0, len(parts), 2) for letter in re.findall(r"&[^;\s]+;|.", parts[number], re.S)]
    plain = "".join(html.unescape(letter)[:1] for _, letter in letters)
    pieces = {number: [] for number in range(0, len(parts), 2)}
    at = 0
    for run in re.finditer(r"\S+|\s+", plain):
        places = [run.start() + place for place in ends(run[0], longest)] if not run[0].isspace() else []
        for first, last in zip([run.start(), *places], [*places, run.end()]):
            for number in dict.fromkeys(part for part, _ in letters[first:last]):
                piece = "".join(letter for part, letter in letters[first:last] if part == number)
                if "-" in piece and last - first <= longest:
                    piece = f'<span class="whole">{piece}</span>'
                pieces[number].append(("<wbr>" if first in places and number == letters[first][0] else "") + piece)
        at = run.end()
    assert at == len(letters)
    parts[::2] = ["".join(pieces[number]) for number in range(0, len(parts), 2)]
    return "".join(parts)


def broken_well(page, longest=SITE):
    """The HTML of a page, with its code as `kept` has it."""
    def code(found):
        return kept(found[0], longest[0] if found[0].startswith("<pre") else longest[1])

    return re.sub(r"<pre\b.*?</pre>|<code\b.*?</code>|<h\d\b[^>]*\bclass=\"name\"[^>]*>.*?</h\d>", code, page, flags=re.S)
