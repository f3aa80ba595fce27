"""Opens the documentation site in the Chromium that is installed, over a server on this machine or from the disk."""

import contextlib
import functools
import http.server
import pathlib
import shutil
import sys
import threading

from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[2]
SITE = ROOT / "build/site"
DESKTOP, PHONE = (1280, 900), (390, 844)


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Server(http.server.ThreadingHTTPServer):
    def handle_error(self, *where):
        # The browser leaves a page before all of it has come.
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(*where)


@contextlib.contextmanager
def served(folder=SITE):
    """The address of a server on this machine that has a folder."""
    server = Server(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()


@contextlib.contextmanager
def browser():
    with sync_playwright() as playwright:
        # Chromium refuses its sandbox to root, and the pages are our own.
        started = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        try:
            yield started
        finally:
            started.close()


def opened(started, size, scheme="light"):
    return started.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme).new_page()
