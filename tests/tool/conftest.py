"""Fixtures of the tests of mbm. `make test-tool` builds what they need; ONLY="words" runs the tests whose names have them."""

import json
import logging
import sys
import types

import pytest

sys.dont_write_bytecode = True
pytest.register_assert_rewrite("home", "peers", "services")
import peers  # noqa: E402
from peers import BUILD, DONE, PATIENT, Program, SerialDevice, TcpDevice, Wire, run  # noqa: E402

logging.disable(logging.CRITICAL)


@pytest.fixture(autouse=True)
def nothing_stays():
    """Ends what a test began."""
    since = len(peers.endings)
    yield
    peers.end_all(since)


@pytest.fixture(scope="session", autouse=True)
def no_peer_stays():
    yield
    peers.end_all()


class Tool:
    """A build of mbm. Called with the words of a command it runs that to its end."""

    def __init__(self, build):
        self.build, self.path = build, f"{BUILD}/{build}/mbm"

    def __call__(self, *words, **options):
        return run(self.path, *words, **options)

    def begin(self, *words, **options):
        return Program(self.path, *words, **options)

    def serve(self, *words):
        """Runs mbm serve; returns the place that it prints."""
        return self.begin("serve", *words).await_output("^serving").split()[-1]

    def prints(self, wanted, *words):
        assert self(*words, *PATIENT) == (DONE, wanted, "")

    def json(self, *words, code=DONE):
        """The object that it prints with --json."""
        found = self(*words, "--json", *PATIENT)
        assert found.code == code, found
        return json.loads(found.out)

    def fails(self, code, sentence, *words):
        """Expects an exit code, no output, and a sentence on stderr, of which `sentence` is a part."""
        found = self(*words)
        assert (found.code, found.out) == (code, ""), found
        assert sentence in found.error and found.error.startswith(f"mbm {words[0]}: "), found.error


@pytest.fixture(params=["plain", "sanitized"])
def mbm(request):
    return Tool(request.param)


@pytest.fixture
def plain():
    """The build without sanitizers alone: for tests of other programs, and for those that count."""
    return Tool("plain")


@pytest.fixture
def folder(tmp_path):
    return str(tmp_path)


@pytest.fixture
def write(tmp_path):
    """Writes a file of the test's folder; returns its path."""

    def write(name, text):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return str(tmp_path / name)

    return write


@pytest.fixture
def device():
    """A device on Modbus TCP whose registers are all 42."""
    return TcpDevice()


@pytest.fixture
def silent():
    return TcpDevice(lambda pdu: None)


@pytest.fixture
def serial(folder):
    """A device on a serial line whose registers are all 7."""
    return SerialDevice(folder)


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture(scope="module")
def libmodbus():
    """libmodbus's servers: unit 17 on a pty, and any unit over TCP."""
    program, path, port = peers.libmodbus()
    return types.SimpleNamespace(program=program, path=path, port=int(port), rtu=f"rtu:{path}?baud=115200&parity=none", tcp=f"tcp://127.0.0.1:{port}")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    """The last lines: what tests measured, and the totals."""
    yield
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if not reporter or hasattr(session.config, "workerinput"):
        return
    passed = reporter.stats.get("passed", [])
    for name, value in (pair for report in passed for pair in report.user_properties):
        reporter.write_line(f"{name}: {value}")
    wrong = sum(len(reporter.stats.get(kind, [])) for kind in ("failed", "error"))
    reporter.write_line(f"test-tool: {len(passed)} tests of mbm passed, {wrong} failed")
