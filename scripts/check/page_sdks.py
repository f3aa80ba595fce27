"""The folders of headers for the programs of pages. Programs for the SDK of somebody else are
compiled against the headers with which packaging/*/try plays that SDK. scripts/check/pages
imports this file."""

import pathlib

ROOT = pathlib.Path(__file__).resolve().parents[2]

# Commands of SDKs that are not installed here. A page may show them; they are not run.
TOOLS = ["idf.py", "west", "scons"]

# For each page: folders with headers, and files that the SDK's build would write.
PAGES = {
    "guide-esp-idf.md": (["examples/esp-idf", *(f"packaging/esp-idf/stand-in/{part}/include" for part in
                                                ("common", "esp_driver_uart", "esp_driver_gpio", "esp_timer"))], {}),
    "guide-zephyr.md": (["examples/zephyr", "packaging/zephyr/stand-in/include"],
                        {"devicetree.h": "#define STAND_IN_PIN 6\n#define STAND_IN_FLAGS 0\n"
                         "#define STAND_IN_CURRENT_SPEED 19200\n"}),
    "guide-rt-thread.md": (["examples/rt-thread", "packaging/rt-thread/stand-in/include"],
                           {"rtconfig.h": "#define RT_TICK_PER_SECOND 1000\n"}),
}


def flags(page: pathlib.Path, folder: pathlib.Path) -> list:
    """Writes the files of the page's SDK into the folder. Returns the compiler's flags for the page.
    Warnings in the headers of an SDK do not count."""
    if page.name not in PAGES:
        return ["-I", ROOT / "examples/linux"]
    folders, files = PAGES[page.name]
    for name, text in files.items():
        (folder / name).write_text(text)
    return [word for name in folders for word in ("-isystem", ROOT / name)] + ["-I", folder]
