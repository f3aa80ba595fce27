"""A page: its blocks by language, the lines of text between them, and the faults that a check finds
in it. scripts/check/pages imports this file."""

import collections

Block = collections.namedtuple("Block", "language line text")


class Page:
    def __init__(self, path, text):
        self.path, self.text = path, text
        self.blocks, self.prose, self.wrong = [], [], []
        language = None
        for number, line in enumerate(text.splitlines(), 1):
            if line.lstrip().startswith("```"):
                if language is None:
                    language, begun, body = line.strip()[3:].strip(), number, []
                else:
                    self.blocks.append(Block(language, begun, "\n".join(body) + "\n"))
                    language = None
            elif language is None:
                self.prose.append((number, line))
            else:
                body.append(line)
        if language is not None:
            self.fault(begun, "a block without an end")

    def fault(self, line, what):
        self.wrong.append(f"{self.path}:{line}: {what.strip()}")

    def of(self, *languages):
        return [block for block in self.blocks if block.language in languages]
