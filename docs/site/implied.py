#!/usr/bin/env python3
"""Writes what the comments of include/mbm/*.h leave out, for Doxygen, which reads the headers
through it: a parameter without a line is that of the function that the comment refers to, or the
object of its type. A result without a line is a status.

  implied.py HEADER

It adds no line, so that the places of Doxygen's pages and warnings are those of the header.
"""
import re
import sys
from pathlib import Path

FUNCTION = re.compile(r"(/\*\*(?:(?!\*/).)*?)( ?\*/\n)([a-z][\w *]*?\bmbm_\w+\()([^;{]*)(\);|\)(?=\n\{))", re.S)
PARAMETER = re.compile(r"(mbm_\w+)?[ *]+(\w+)(?:,|$)")


def explained(found, comments):
    comment, end, head, parameters, tail = found.groups()
    others = [comment]
    for other in others:
        names = re.findall(r"\b(?:[Aa]s|see) (mbm_\w+)", other)
        others += [comments[name] for name in names if name in comments and comments[name] not in others]
    for kind, name in PARAMETER.findall(parameters):
        named = re.compile(rf"@param {name}\b")
        if named.search(comment):
            continue
        if any(named.search(other) for other in others):
            comment += f" @param {name} as there"
        # `client` is an mbm_client, `request` an mbm_clientRequest.
        elif kind.lower().endswith(name.lower()):
            comment += f" @param {name} the object"
    if re.match(r"(static inline )?uint8_t ", head) and "@return" not in comment:
        comment += " @return a status"
    return comment + end + head + parameters + tail


if __name__ == "__main__":
    text = Path(sys.argv[1]).read_text()
    said = {re.search(r"mbm_\w+", found[3])[0]: found[1] for found in FUNCTION.finditer(text)}
    print(FUNCTION.sub(lambda found: explained(found, said), text), end="")
