"""Takes the project's Markdown into the site: links between files become links between the site's
pages, names of the API in code become links, and files that pages name get a page with their text."""

import functools
import os
import pathlib
import re
import subprocess

# The pages beside those of docs/, and their places in the site.
PLACED = {"README.md": "readme.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md",
          ".github/SECURITY.md": "reporting-a-weakness.md", ".github/CODE_OF_CONDUCT.md": "code-of-conduct.md"}
LANGUAGES = {".c": "c", ".h": "c", ".ino": "cpp", ".cpp": "cpp", ".rs": "rust", ".py": "python", ".sh": "sh",
             ".toml": "toml", ".yml": "yaml", ".yaml": "yaml", ".json": "json", ".txt": "text", ".cmake": "cmake",
             ".mk": "make", ".ld": "text", ".S": "gas"}
# Headers that have pages of the API.
HEADERS = {"include/mbm.h": "api/c/index.md", "include/mbm": "api/c/index.md"}
LONGEST_SOURCE = 200_000
# Where the field cases are, and where docs/field-cases.md gets a table of them.
CASES = "capi/tests/field/cases/"
CASES_MARK = "<!-- field cases -->"


class Site:
    """What is where. `names` are those of the API: {name: (page, anchor)}."""

    def __init__(self, root, names):
        self.root, self.names = root, names
        listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True)
        if listed.returncode:  # a tarball
            files = [p for p in root.rglob("*") if p.is_file() and p.relative_to(root).parts[0] not in ("build", "target")]
            self.files = {str(p.relative_to(root)) for p in files}
        else:
            self.files = {name for name in listed.stdout.splitlines() if (root / name).exists()}
        self.headers = dict(HEADERS)
        self.sources = set()

    @functools.cached_property
    def markdown_places(self):
        """The pages: {path in the project: path in the site}."""
        found = {name: place for name, place in PLACED.items() if name in self.files}
        found.update({name: name.removeprefix("docs/") for name in sorted(self.files)
                      if name.startswith("docs/") and name.endswith(".md")})
        return found

    @functools.cached_property
    def titles(self):
        """The first heading of each page."""
        return {path: re.search(r"^# (.*)", (self.root / path).read_text(encoding="utf-8"), re.M)[1]
                for path in self.markdown_places}

    def place(self, path):
        """The page of the site for a path of the project; None if there is none."""
        if path in self.headers:
            return self.headers[path]
        if path in self.markdown_places:
            return self.markdown_places[path]
        if path.startswith("docs/") and path in self.files:
            return path.removeprefix("docs/")  # a picture
        if path in self.files or any(name.startswith(path + "/") for name in self.files):
            self.sources.add(path)
            return source_place(path, path in self.files)
        return None

    def convert(self, text, path, page):
        """The Markdown of `page`, made of the file `path` of the project."""
        lines, fence = [], None
        text = text.replace(CASES_MARK, self.field_cases()) if CASES_MARK in text else text
        for line in text.splitlines():
            mark = re.match(r"\s*(`{3,})", line)
            if mark and (fence is None or len(mark[1]) >= fence):
                fence = len(mark[1]) if fence is None else None
            elif fence is None and not line.startswith("<div "):
                line = self.line(line, path, page)
            lines.append(line)
        return self.resolve("\n".join(lines) + "\n", page)

    def field_cases(self):
        """The table of the field cases, one row for each."""
        rows = ["| report | symptom | what mbm does | case |", "|---|---|---|---|"]
        for file in sorted(name for name in self.files if name.startswith(CASES) and name.endswith(".txt")):
            text = (self.root / file).read_text(encoding="utf-8")
            for name, case in re.findall(r"^case (\w+)\n(.*?)(?=^case |\Z)", text, re.M | re.S):
                head = dict(line.split(" ", 1) for line in case.splitlines() if " " in line and not line.startswith((" ", "#")))
                reports = [f"[{report}](https://github.com/{report.replace('#', '/issues/')})" if "#" in report else report
                           for report in head["report"].split(", ")]
                done = f"not yet: {head['pending']}" if "pending" in head else head["mbm"]
                rows.append(f"| {', '.join(reports)} | {head['symptom']} | {done} | [{name}](/{file}) |")
        return "\n".join(rows)

    def line(self, line, path, page):
        folder = os.path.dirname(path)

        def link(found):
            target, anchor = re.fullmatch(r"([^#]*)(#.*)?", found[2]).groups()
            if re.match(r"[a-z]+:", target) or not target:
                return found[0]
            file = target[1:] if target.startswith("/") else os.path.normpath(os.path.join(folder, target))
            place = self.place(file)
            if place is None:
                raise SystemExit(f"site: {path} links to {found[2]}, which the site does not have")
            # A forge shows names of files; readers of the site know pages by their titles.
            words = f"[{self.titles[file]}]" if file in self.titles and found[1].endswith(".md]") else found[1]
            return f"{words}({relative(place, page)}{anchor or ''})"

        # Code, links and the rest in turn, so that code in the text of a link gets no link of its own. The text of a link may
        # begin in the line before or end in the next one.
        parts = re.split(r"(^(?:`[^`]*`|[^\[\]`])*\]\([^)\s]+\)|!?\[(?:`[^`]*`|[^\]`])*\]\([^)\s]+\)|\[(?:`[^`]*`|[^\]`])*$|`[^`]+`)", line)
        for number, part in enumerate(parts):
            if re.fullmatch(r"`[^`]+`", part) and not line.startswith("#"):
                parts[number] = self.code(part, page)
            elif number % 2:
                parts[number] = re.sub(r"(.*\])\(([^)\s]+)\)", link, part)
        return "".join(parts)

    def code(self, part, page):
        """Code in a line, as a link if it names something of the API or a file."""
        content = part.strip("`")
        name = re.sub(r"\(.*\)$", "", content)
        if name in self.names and (name.startswith(("mbm_", "MBM_")) or name[:1].isupper()):
            return f"[{part}](@@{name})"
        family = re.fullmatch(r"(mbm_[a-z]+_)\*", content)
        if family:
            page_of = next((place for name, (place, _) in self.names.items() if name.startswith(family[1])), None)
            return f"[{part}]({relative(page_of, page)})" if page_of else part
        if content.startswith(("examples/", "include/")) and content.rstrip("/") in self.files | self.folders:
            return f"[{part}]({relative(self.place(content.rstrip('/')), page)})"
        header = f"include/{content}"
        if header in self.headers:
            return f"[{part}]({relative(self.headers[header], page)})"
        return part

    @functools.cached_property
    def folders(self):
        return {str(folder) for name in self.files for folder in pathlib.PurePath(name).parents} - {"."}

    def resolve(self, text, page):
        """Replaces @@NAME, @@NAME#ANCHOR and @@PAGE.md: in HTML by the file, in Markdown by the page."""
        def found(match):
            before, name, anchor = match.groups()
            if name.endswith(".md"):
                place, own = name, None
            elif name in self.names:
                place, own = self.names[name]
            else:
                raise SystemExit(f"site: {page} refers to {name}, which the API does not have")
            target = relative(place, page)
            if before == '"':
                target = re.sub(r"\.md$", ".html", target)
            anchor = anchor or (f"#{own}" if own else "")
            return f"{before}{anchor if anchor and place == page else target + anchor}"
        return re.sub(r'(["(])@@([\w./-]+)(#[\w-]+)?', found, text)

    def source_pages(self):
        """Pages with the text of each file that a page names, and with the files of each folder."""
        made, ahead = {}, sorted(self.sources)
        while ahead:
            path = ahead.pop()
            page = source_place(path, path in self.files)
            if page in made:
                continue
            if path in self.files:
                made[page] = self.source(path)
            else:
                made[page], inside = self.folder(path, page)
                ahead += inside
        return made

    def source(self, path):
        text = (self.root / path).read_text(encoding="utf-8", errors="replace")
        if len(text) > LONGEST_SOURCE:
            return hidden(path) + f"{len(text.splitlines())} lines, which this page leaves out.\n"
        language = LANGUAGES.get(pathlib.PurePath(path).suffix)
        if language is None:
            language = "python" if "python3" in text[:40] else "sh" if text.startswith("#!") else "text"
            language = "make" if path.endswith("Makefile") else language
        fence = "`" * max([3] + [len(ticks) + 1 for ticks in re.findall(r"`{3,}", text)])
        return hidden(path) + f"{fence}{language}\n{text.rstrip()}\n{fence}\n"

    def folder(self, path, page):
        inside = sorted({path + "/" + name.removeprefix(path + "/").partition("/")[0] for name in self.files
                         if name.startswith(path + "/")})
        inside = [name for name in inside if self.is_text(name)]
        lines = [f"- [{name.rpartition('/')[2]}]({relative(source_place(name, name in self.files), page)})"
                 for name in inside if name not in self.markdown_places]
        return hidden(path + "/") + "\n".join(lines) + "\n", [name for name in inside if name not in self.markdown_places]

    def is_text(self, name):
        return name not in self.files or (b"\0" not in (self.root / name).read_bytes()
                                          and (self.root / name).stat().st_size < LONGEST_SOURCE)


def hidden(title):
    """The head of a page that the search leaves out."""
    return f"---\ntitle: {title}\nsearch:\n  exclude: true\n---\n\n# `{title}`\n\n"


def source_place(path, is_file):
    return f"source/{path}.md" if is_file else f"source/{path}/index.md"


def relative(place, page):
    return os.path.relpath(place, os.path.dirname(page) or ".")
