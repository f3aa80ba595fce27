"""The rules of arduino-lint for a library and its examples, with their numbers there
(https://arduino.github.io/arduino-lint/latest/rules/library/). Debian has no package of that
program. check imports this file.

Each rule is a function that takes a Library and yields a text for each fault. The warnings of
arduino-lint are errors here.
"""

import difflib
import pathlib
import re

# Rules that are not checked, and the reason.
NOT_HELD = {
    "LP013": "for Arduino's own libraries",
    "LP017": "needs the index of the Library Manager; check has a list of names that are taken",
    "LP018": "for libraries that are in that index",
    "LP022": "for libraries that are in that index",
    "LP042": "needs the network",
    "LP048": "needs the index of the Library Manager",
    "SD001": "for sketches outside a library",
    "SD002": "for sketches outside a library",
}

KNOWN = ["name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures",
         "includes", "precompiled", "ldflags", "depends", "dot_a_linkage", "license", "email"]
CATEGORIES = ["Display", "Communication", "Signal Input/Output", "Sensors", "Device Control", "Timing",
              "Data Storage", "Data Processing", "Other"]
# Names of architectures in PlatformIO, and Arduino's names.
ALIASES = {"atmelavr": ["avr"], "atmelmegaavr": ["megaavr"], "atmelsam": ["sam", "samd"], "espressif32": ["esp32"],
           "espressif8266": ["esp8266"], "intel_arc32": ["arc32"], "nordicnrf52": ["nRF5", "nrf52", "mbed"],
           "raspberrypi": ["mbed", "mbed_nano", "rp2040"], "ststm32": ["stm32", "STM32F1", "STM32F4"]}
ARCHITECTURES = ["arc32", "avr", "esp32", "esp8266", "mbed", "mbed_edge", "mbed_giga", "mbed_nano", "mbed_nicla",
                 "mbed_opta", "mbed_portenta", "mbed_rp2040", "megaavr", "nRF5", "nrf52", "renesas",
                 "renesas_portenta", "renesas_uno", "rp2040", "sam", "samd", "samd_beta", "stm32", "STM32F1",
                 "STM32F4", "teensy"]
# A short list of our own. arduino-lint uses the list of another program.
MISSPELT = {"accross", "adress", "agressive", "alot", "arguement", "asynchronus", "becuase", "begining", "beleive",
            "calender", "comming", "compatability", "definately", "dependancy", "existance", "finaly", "freind",
            "garantee", "independant", "lenght", "libary", "lisence", "neccessary", "occured", "occurence", "paramter",
            "protocoll", "reciever", "recieve", "recieved", "refered", "seperate", "succesful", "successfull",
            "supress", "teh", "thier", "transfered", "untill", "usefull", "wich", "writen"}

LONGEST_NAME = 63
RELAXED = r"\d+(\.\d+){0,2}(-[0-9A-Za-z.-]+)?(\+[0-9A-Za-z.-]+)?"
SEMVER = r"(0|[1-9]\d*)(\.(0|[1-9]\d*)){2}(-[0-9A-Za-z.-]+)?(\+[0-9A-Za-z.-]+)?"
CODE = [".h", ".hh", ".hpp", ".c", ".cpp", ".ino", ".pde"]


class Library:
    """A library, as the rules see it. `rows` is empty if library.properties cannot be read."""

    def __init__(self, root: pathlib.Path):
        self.root, self.rows, self.unreadable = root, {}, None
        self.entries = sorted(root.iterdir())
        self.files = sorted(p for p in root.rglob("*") if p.is_file() or p.is_symlink())
        path = root / "library.properties"
        if path.is_file():
            try:
                self.rows = parse(path.read_text())
            except ValueError as error:
                self.unreadable = str(error)
        self.name = self.rows.get("name", "")
        source = root / "src" if (root / "src").is_dir() else root
        self.headers = sorted(p.name for p in source.glob("*") if p.suffix in (".h", ".hh", ".hpp"))
        self.sketches = sorted(p for p in (root / "examples").glob("*") if p.is_dir())

    def folders(self) -> list:
        return [p.name for p in self.entries if p.is_dir()]


def parse(text: str) -> dict:
    rows = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        if "=" not in line:
            raise ValueError(f"line {number} is not key=value")
        key, value = (part.strip() for part in line.split("=", 1))
        if key in rows:
            raise ValueError(f"line {number}: {key} is there twice")
        rows[key] = value
    return rows


RULES = {}


def rule(*numbers):
    """Registers a function that yields texts for one rule, or pairs of rule and text for several."""
    def register(function):
        for number in numbers:
            RULES[number] = function
        return function
    return register


def findings(library: Library) -> list:
    found = []
    for function in dict.fromkeys(RULES.values()):
        numbers = [number for number, other in RULES.items() if other is function]
        for item in function(library):
            found.append(f"{numbers[0]}: {item}" if isinstance(item, str) else f"{item[0]}: {item[1]}")
    return sorted(found)


def alike(names: list, right: str) -> list:
    """Returns the names that are probably misspellings of `right`."""
    return [name for name in names if name.lower() != right and
            difflib.SequenceMatcher(None, name.lower(), right).ratio() >= 0.85]


def other_case(names: list, right: str) -> list:
    return [name for name in names if name.lower() == right and name != right]


# --- structure

@rule("LS001")
def invalid(library):
    if not library.headers:
        yield "no header"


@rule("LS002", "LS003")
def folder_name(library):
    name = library.root.name
    if len(name) > LONGEST_NAME:
        yield "LS002", f"the folder's name is longer than {LONGEST_NAME} characters"
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", name):
        yield "LS003", f"the folder's name {name!r} has characters that are not allowed"


@rule("LS004", "LS005", "LS006", "LS007")
def odd_files(library):
    for path in library.files:
        where = path.relative_to(library.root)
        if path.name in (".git", ".gitmodules"):
            yield "LS004", f"{where}: a Git submodule"
        if path.is_symlink():
            yield "LS005", f"{where} is a symbolic link"
        if str(where) == ".development":
            yield "LS006", "the Library Manager refuses a library with .development"
        if path.suffix.lower() == ".exe":
            yield "LS007", f"{where}: the Library Manager refuses a library with this file"


@rule("LS008")
def header_of_that_name(library):
    if library.name and library.name.replace(" ", "_") not in [name.rsplit(".", 1)[0] for name in library.headers]:
        yield f"no header is called {library.name}"


@rule("LS009", "LS010", "LS011", "LS012")
def folders(library):
    names = library.folders()
    for name in other_case(names, "src"):
        yield "LS009", f"the folder {name} must be called src"
    if "src" in names and "utility" in names:
        yield "LS010", "the folder utility is not compiled, because there is a folder src"
    for name in alike(names, "extras"):
        yield "LS011", f"the folder {name}: is extras meant?"
    for name in other_case(names, "extras"):
        yield "LS012", f"the folder {name} must be called extras"


# --- library.properties

@rule("LP001", "LP002", "LP003", "LP004", "LP005", "LP006")
def file_of_properties(library):
    names = [p.name for p in library.entries if p.is_file()]
    right = "library.properties"
    if right not in names:
        yield "LP001", "library.properties is missing"
    for name in alike(names, right):
        yield "LP002", f"{name}: is library.properties meant?"
    for name in other_case(names, right):
        yield "LP003", f"{name} must be called library.properties"
    for path in library.files:
        if path.name == right and path.parent != library.root:
            yield "LP004", f"{path.relative_to(library.root)} is not read"
    if library.unreadable:
        yield "LP005", f"library.properties: {library.unreadable}"
    for key in library.rows:
        if key not in KNOWN:
            yield "LP006", f"the field {key} is unknown"


MISSING = {"name": "LP007", "version": "LP019", "author": "LP023", "maintainer": "LP025", "sentence": "LP031",
           "paragraph": "LP034", "category": "LP037", "url": "LP040", "architectures": "LP043"}
EMPTY = {"name": "LP008", "author": "LP024", "maintainer": "LP026", "email": "LP029", "sentence": "LP032",
         "url": "LP056", "architectures": "LP044", "includes": "LP051", "ldflags": "LP055"}


@rule(*MISSING.values())
def missing(library):
    for key, number in MISSING.items():
        if library.rows and key not in library.rows:
            yield number, f"the field {key} is missing"


@rule(*EMPTY.values())
def empty(library):
    for key, number in EMPTY.items():
        if library.rows.get(key) == "":
            yield number, f"the field {key} is empty"


@rule("LP009", "LP010", "LP011", "LP012", "LP014", "LP015", "LP016")
def name(library):
    name = library.name
    if len(name) > LONGEST_NAME:
        yield "LP009", f"the name is longer than {LONGEST_NAME} characters"
    if len(name) > 32:
        yield "LP010", "the name is longer than the 32 characters that are recommended"
    if name and not re.fullmatch(r"(?=.*[A-Za-z])[A-Za-z0-9][A-Za-z0-9_. -]*", name):
        yield "LP011", "the name has characters that are not allowed"
    if name.lower().startswith("arduino"):
        yield "LP012", "names with Arduino in front are reserved"
    if "arduino" in name.lower():
        yield "LP014", "the name has the needless word Arduino"
    if " " in name:
        yield "LP015", "the name has a space"
    if "library" in name.lower():
        yield "LP016", "the name has the needless word library"


@rule("LP020", "LP021")
def version(library):
    version = library.rows.get("version")
    if version is not None and not re.fullmatch(RELAXED, version):
        yield "LP020", f"{version!r} is not a version"
    elif version is not None and not re.fullmatch(SEMVER, version):
        yield "LP021", f"the version {version!r} is not a version of semver.org"


@rule("LP027", "LP057", "LP028", "LP030")
def people(library):
    maintainer = library.rows.get("maintainer", "").lower()
    if maintainer.startswith("arduino"):
        yield "LP027", "the maintainer must not be Arduino"
    if "arduino" in maintainer:
        yield "LP057", "the maintainer's name has Arduino in it"
    if "email" in library.rows:
        yield "LP028", "the field email is the old name of maintainer"
    if library.rows.get("email", "").lower().startswith("arduino"):
        yield "LP030", "the email must not be Arduino's"


@rule("LP033", "LP035", "LP036")
def texts(library):
    for key, number in ("sentence", "LP033"), ("paragraph", "LP035"):
        for word in re.findall(r"[a-z]+", library.rows.get(key, "").lower()):
            if word in MISSPELT:
                yield number, f"{key}: {word} is misspelt"
    sentence = library.rows.get("sentence")
    if sentence and sentence in library.rows.get("paragraph", ""):
        yield "LP036", "the paragraph begins with the sentence, and the IDE shows both"


@rule("LP038", "LP039", "LP041")
def values(library):
    category = library.rows.get("category")
    if category == "Uncategorized":
        yield "LP039", "the category is Uncategorized"
    elif category is not None and category not in CATEGORIES:
        yield "LP038", f"the category {category!r} is unknown"
    url = library.rows.get("url")
    if url and not re.fullmatch(r"https?://[\w.-]+(/\S*)?", url):
        yield "LP041", f"the url {url!r} is not a web address"


@rule("LP045", "LP046")
def architectures(library):
    listed = [part.strip() for part in library.rows.get("architectures", "").split(",")]
    for alias, true in ALIASES.items():
        if alias in listed and not set(true) & set(listed):
            yield "LP045", f"the architecture {alias} is called {' or '.join(true)} by Arduino"
    for known in ARCHITECTURES:
        for given in listed:
            if given != known and given.lower() == known.lower() and known not in listed:
                yield "LP046", f"the architecture {given} is spelt {known}"


@rule("LP047", "LP058")
def depends(library):
    for item in filter(None, re.split(r",(?![^(]*\))", library.rows.get("depends", ""))):
        found = re.fullmatch(r"\s*([A-Za-z0-9][A-Za-z0-9_. -]*?)\s*(\((.*)\))?\s*", item)
        if not found:
            yield "LP047", f"depends: {item.strip()!r} is not the name of a library"
        elif found.group(2) and not re.fullmatch(rf"[\s()!&|<>=^]*((<|<=|=|>=|>|\^){RELAXED}[\s()!&|]*)+",
                                                 found.group(3)):
            yield "LP058", f"depends: {found.group(2)} is not a version constraint"


@rule("LP049", "LP050", "LP053", "LP054")
def linkage(library):
    flat = "src" not in library.folders()
    dot_a, precompiled = library.rows.get("dot_a_linkage"), library.rows.get("precompiled")
    if dot_a not in (None, "true", "false"):
        yield "LP049", "dot_a_linkage is neither true nor false"
    if dot_a == "true" and flat:
        yield "LP050", "dot_a_linkage needs the folder src"
    if precompiled not in (None, "true", "full", "false"):
        yield "LP053", "precompiled is none of true, full, false"
    if precompiled in ("true", "full") and flat:
        yield "LP054", "precompiled needs the folder src"


@rule("LP052")
def included(library):
    for header in filter(None, (part.strip() for part in library.rows.get("includes", "").split(","))):
        if header not in library.headers:
            yield f"includes names {header}, which src does not have"


# --- code, documentation, and the sketches of examples

@rule("LC001", "SC001")
def arduino_header(library):
    for path in library.files:
        if path.suffix in CODE and not path.is_symlink():
            for wrong in re.findall(r'^\s*#\s*include\s*[<"](arduino\.h)[>"]', path.read_text(), re.M | re.I):
                if wrong != "Arduino.h":
                    inside = path.relative_to(library.root).parts[0] == "examples"
                    yield "SC001" if inside else "LC001", f"{path.name} includes {wrong} instead of Arduino.h"


@rule("LD001", "LD002")
def documents(library):
    names = [p.name.lower() for p in library.entries if p.is_file() and p.stat().st_size]
    if not any(re.fullmatch(r"readme(\.(md|mkd|txt|adoc|rst))?", name) for name in names):
        yield "LD001", "no README"
    if not any(re.fullmatch(r"(un)?licen[sc]e(\.(md|txt|rst))?|copying(\.(md|txt))?", name) for name in names):
        yield "LD002", "no licence"


@rule("LD003", "LD004", "LD005", "LD006")
def examples(library):
    for path in library.files:
        if path.suffix in (".ino", ".pde") and path.relative_to(library.root).parts[0] not in ("examples", "extras"):
            yield "LD003", f"{path.relative_to(library.root)}: sketches belong in examples"
    if not any((folder / f"{folder.name}.ino").is_file() for folder in library.sketches):
        yield "LD004", "no examples"
    names = library.folders()
    for name in alike(names, "examples"):
        yield "LD005", f"the folder {name}: is examples meant?"
    for name in other_case(names, "examples"):
        yield "LD006", f"the folder {name} must be called examples"


@rule("SS001", "SS002", "SS003", "SS004", "SS005")
def sketches(library):
    for folder in library.sketches:
        if not (folder / f"{folder.name}.ino").is_file():
            yield "SS001", f"examples/{folder.name} has no {folder.name}.ino"
        for path in sorted(folder.rglob("*")):
            where = path.relative_to(library.root)
            if path.is_file() and not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", path.name):
                yield "SS002", f"{where}: a name with characters that are not allowed"
            if path.is_file() and len(path.stem) > LONGEST_NAME:
                yield "SS003", f"{where}: a name of more than {LONGEST_NAME} characters"
            if path.suffix == ".pde":
                yield "SS004", f"{where} must end in .ino"
            if path.is_dir() and path.name.lower() == "src" and path.name != "src":
                yield "SS005", f"{where} must be called src"
