"""mbm reads, writes, calls, scans and identifies servers of libmodbus and pymodbus, whose data are known."""

import json
import re
import ssl
import struct
import types

import pytest
from peers import (CERTIFICATES, DONE, EXCEPTION, LINE, NO_REPLY, PATIENT, PLAIN, WRONG, Wire, bit, bits, context, keys, libmodbus, numbered,
                   pymodbus, run, served, ten_registers, tls_line, word, words)

ADDRESS = "exception 02: illegal data address"
# pymodbus has so many objects, which need several responses.
OBJECTS = 20


def of_libmodbus(framing):
    """libmodbus has only the server id. On a serial line it does not answer function 2B."""
    _, path, port = libmodbus()
    if framing == "rtu":
        return dict(line=f"rtu:{path}?baud=115200", unit=17, refusal="no complete reply in time", units=("14-20", [17], ("--timeout", "1s")))
    return dict(line=f"tcp://127.0.0.1:{port}", unit=5, refusal="exception 01: illegal function", port=port,
                units=("1-30,40", [*range(1, 31), 40], PATIENT))


def of_pymodbus(framing):
    """It answers for units that it does not have, so only its own unit is scanned."""
    more = ("--objects", str(OBJECTS))
    if framing in ("rtu", "ascii"):
        theirs, ours = Wire().names
        pymodbus(framing, "--tty", theirs, *more)
        return dict(line=f"{framing}:{ours}?baud=115200", unit=17, units=("17", [17], PATIENT))
    port, = pymodbus(framing, "--port", "0", *more).ready
    # pymodbus answers only the first of several requests in one TCP segment.
    return dict(line=f"{'tcp' if framing == 'tcp' else 'rtu+tcp'}://127.0.0.1:{port}", unit=17, options=("--in-flight", 1), port=port)


@pytest.fixture(scope="module", params=["libmodbus rtu", "libmodbus tcp", "pymodbus rtu", "pymodbus ascii", "pymodbus tcp", "pymodbus rtu-over-tcp"])
def server(request):
    who, framing = request.param.split()
    made = {"options": (), "units": ("17", [17], ("--in-flight", 1, *PATIENT)), "port": None, "refusal": None,
            **(of_libmodbus if who == "libmodbus" else of_pymodbus)(framing)}
    made["read"] = ("read", made["line"], "-u", made["unit"], *made["options"])
    return types.SimpleNamespace(**made)


def test_read_prints_the_values_of_each_table(mbm, server):
    mbm.prints(numbered(100, words(100, 3)), *server.read, 100, 3)
    mbm.prints(numbered(101, words(100, 3)), *server.read, 101, 3, "--one-based")
    mbm.prints(numbered(8, words(8, 2, 0xFFFF)), *server.read, 8, 2, "--table", "input")
    mbm.prints(numbered(30, bits(30, 9)), *server.read, 30, 9, "-t", "coils")
    mbm.prints(numbered(30, bits(30, 9, 1)), *server.read, 30, 9, "-t", "discrete")
    mbm.prints(numbered(100, [f"0x{v:04X}" for v in words(100, 2)]), *server.read, "--hex", 100, 2)
    low_first = [a | b << 16 for a, b in (words(100, 2), words(102, 2))]
    mbm.prints(f"  100  {low_first[0]}\n  102  {low_first[1]}\n", *server.read, "-T", "uint32", "-o", "CDAB", 100, 2)


def test_a_long_read_takes_several_requests_whose_borders_are_at_borders_of_values(mbm, server):
    mbm.prints(numbered(0, words(0, 300)), *server.read, 0, 300)
    found = mbm.json(*server.read, "--type", "int64", 0, 100)
    high_first = [struct.unpack(">q", struct.pack(">4H", *words(a, 4)))[0] for a in range(0, 400, 4)]
    assert [value["value"] for value in found["values"]] == high_first


def test_read_prints_json(mbm, server):
    found = mbm.json(*server.read, "-t", "coils", 30, 2)
    del found["time"]
    assert found == {"unit": server.unit, "table": "coils", "type": "bit", "code": 0, "status": "success",
                     "values": [{"address": 30 + i, "value": bool(v)} for i, v in enumerate(bits(30, 2))]}
    found = mbm.json(*server.read, 60000, 1, code=EXCEPTION)
    assert (found["code"], found["status"]) == (5, ADDRESS)
    assert found["values"] == [{"address": 60000, "count": 1, "status": ADDRESS}]


def test_a_read_that_is_refused_says_what_to_check(mbm, server):
    mbm.fails(EXCEPTION, f"unit {server.unit}: {ADDRESS}. Check address and count", *server.read, 60000, 2, *PATIENT)


def test_rounds_are_printed_as_tables_and_as_csv(mbm, server):
    read = (*server.read, "--every", "20ms", *PATIENT)
    wanted = "".join(f"unit {server.unit}, holding, round {n}: 3 of 3 values read\n" + numbered(100, words(100, 3), "  ") for n in (1, 2))
    assert mbm(*read, "--times", 2, 100, 3) == (DONE, wanted, "mbm read: 2 rounds, 0 of them with failures.\n")
    code, out, error = mbm(*read, "--times", 3, 100, 4, "--csv", "--quiet")
    head, *samples = out.splitlines()
    assert (code, head, error, len(samples)) == (DONE, "time,unit,status,100,101,102,103", "", 3)
    right = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z," + f"{server.unit},success,{','.join(map(str, words(100, 4)))}")
    assert all(map(right.fullmatch, samples)), samples
    code, out, _ = mbm(*read, "--times", 1, 60000, 2, "--csv")
    assert (code, out.splitlines()[1].split(",", 1)[1]) == (EXCEPTION, f"{server.unit},{ADDRESS},,")


def test_what_is_written_is_read_back(mbm, server):
    """And what was there before is written at the end."""
    write, unit, read = ("write", *server.read[1:4]), server.unit, server.read[:4]
    mbm.prints(f"unit {unit}: wrote 1 holding register from address 250 on, function 06\n", *write, 250, 1234)
    mbm.prints(numbered(250, [1234]), *read, 250)
    mbm.prints(f"unit {unit}: wrote 2 holding registers from address 250 on, function 10\n", *write, "-T", "int16", 250, -2, 3)
    mbm.prints(numbered(250, [-2, 3]), *read, "-T", "int16", 250, 2)
    for address, values, found in ((250, (1, 0, 1), [1, 0, 1]), (251, (1,), [1, 1, 1]), (250, bits(250, 3), bits(250, 3))):
        mbm.prints("", *write, "-q", "-t", "coils", address, *values)
        mbm.prints(numbered(250, found), *read, "-t", "coils", 250, 3)
    assert mbm.json(*write, 250, *words(250, 2)) == {"unit": unit, "table": "holding", "address": 250, "count": 2, "function": 16,
                                                     "code": 0, "status": "success"}
    mbm.fails(EXCEPTION, f"unit {unit}: {ADDRESS}", *write, 60000, 1, *PATIENT)


def test_call_prints_the_response_in_bytes_and_in_words(mbm, server):
    call, unit = ("call", server.line, "-u", server.unit), server.unit
    values = " ".join(f"{v >> 8:02X} {v & 255:02X}" for v in words(100, 2))
    said = f"unit {unit:<2}  reply      03 read holding registers: {' '.join(map(str, words(100, 2)))}"
    mbm.prints(f"03 04 {values}\n{said}\n", *call, "03", "00", "64", "00", "02")
    mbm.prints(f"03 04 {values}\n{said}\n", *call, "0300640002")
    code, out, error = mbm(*call, "03 ea60 0001", *PATIENT)
    assert (code, out.splitlines()[0]) == (EXCEPTION, "83 02")
    assert f"unit {unit}: {ADDRESS}" in error
    found = mbm.json(*call, "0300640001")
    assert (found["request"], found["response"]) == ("03 00 64 00 01", f"03 02 {values[:5]}")


def test_identify_prints_the_objects_of_each_category(mbm, server):
    if server.refusal:
        code, out, error = mbm("identify", server.line, "-u", server.unit, "--timeout", "2s")
        refusals = [f"mbm identify: identification: {server.refusal}.", "mbm identify: event counter: exception 01: illegal function."]
        assert (code, error.splitlines()) == (DONE, refusals)
        assert re.fullmatch(r"server id: .*LMB[\d.]+\n", out)
        return
    names = {"vendor name": "Vendor", "product code": "PC", "revision": "V2.11", "vendor URL": "example.org"}
    private = {f"object {i:02X}": f"object {i:02X} ".ljust(60, ".") for i in range(0x80, 0x80 + OBJECTS)}
    for category, objects in (("basic", dict(list(names.items())[:3])), ("regular", names), ("extended", {**names, **private})):
        code, out, error = mbm("identify", server.line, "-u", server.unit, "-c", category, *PATIENT)
        *found, server_id, events = out.splitlines()
        assert (code, found, error) == (DONE, [f"{n}: {v}" for n, v in objects.items()], "")
        assert server_id == "server id: Vendor-PC-V2.11\\xFF"
        assert re.fullmatch(r"events: \d+(, busy)?", events)
    found = mbm.json("identify", server.line, "-u", server.unit)
    assert (found["objects"], found["server id"], found["refused"]) == ({**names, **private}, "Vendor-PC-V2.11\\xFF", {})


def test_scan_finds_the_units_that_answer(mbm, server):
    units, answering, options = server.units
    code, out, error = mbm("scan", server.line, "--units", units, *options)
    assert (code, out) == (DONE, "".join(f"unit {unit:3}: holding register 0 is {word(0)}\n" for unit in answering))
    assert f": {len(answering)} of " in error
    code, out, error = mbm("scan", server.line, "--units", units, "--json", "-q", *options)
    assert (code, [json.loads(line)["unit"] for line in out.splitlines()], error) == (DONE, answering, "")


@pytest.mark.parametrize("server", ["libmodbus tcp", "pymodbus tcp"], indirect=True)
def test_the_example_calls_reads_and_writes(server):
    calls = f"{PLAIN}/linux/calls"
    wanted = [row for a in range(100, 104) for row in (f"register {a}: {word(a)}", f"coil {a}: {bit(a)}")]
    assert run(calls, "127.0.0.1", server.port, server.unit) == (0, "\n".join(wanted) + "\n", "")
    code, out, error = run(calls, "127.0.0.1", "1", server.unit)
    assert (code, out, bool(error)) == (1, "", True)


def test_scan_tries_each_rate_and_parity(mbm, libmodbus):
    code, out, _ = mbm("scan", f"rtu:{libmodbus.path}", "--units", "17", "--rates", "9600,19200", "--parities", "none,even", *PATIENT)
    assert (code, [line.split()[:4] for line in out.splitlines()]) == (
        DONE, [[rate, parity, "unit", "17:"] for rate in ("9600", "19200") for parity in ("none", "even")])


def test_unit_0_is_a_unit_over_tcp_and_a_broadcast_on_a_serial_line(mbm, libmodbus):
    wrote, high, low = "unit 0: wrote 1 holding register from address 250 on, function 06\n", word(250) >> 8, word(250) & 255
    mbm.prints(wrote, "write", libmodbus.tcp, "-u", 0, 250, word(250))
    mbm.prints(f"03 02 {high:02X} {low:02X}\nunit 0   reply      03 read holding registers: {word(250)}\n",
               "call", libmodbus.tcp, "-u", 0, "03 00 FA 00 01")
    mbm.prints(wrote, "write", f"rtu:{libmodbus.path}?baud=115200", "-u", 0, 250, word(250))


def test_identify_stops_at_a_device_that_repeats_itself(mbm):
    port, = pymodbus("tcp", "--port", "0", "--endless").ready
    code, out, error = mbm("identify", f"tcp://127.0.0.1:{port}", "-u", 17, *PATIENT)
    assert (code, error) == (DONE, "mbm identify: identification: the device repeats itself without an end.\n")
    assert out.splitlines()[4:5] == ["object F0: " + "a" * 200]


def test_several_units_have_a_table_a_row_or_an_object_each(mbm, libmodbus):
    """libmodbus answers as each unit over TCP."""
    read = ("read", libmodbus.tcp, *PATIENT)
    table = lambda unit, round="": f"unit {unit}, holding{round}: 2 of 2 values read\n" + numbered(100, words(100, 2), "  ")
    mbm.prints(table(1) + table(2) + table(17), *read, "-u", "17,1-2", 100, 2)
    found = mbm(*read, "-u", "1,2", 100, 2, "--every", "20ms", "--times", 2)
    wanted = "".join(table(unit, f", round {n}") for n in (1, 2) for unit in (1, 2))
    assert found == (DONE, wanted, "mbm read: 2 rounds, 0 of them with failures.\n")
    code, out, _ = mbm(*read, "-u", "1,2", 60000, "--csv")
    assert (code, [row.split(",", 1)[1] for row in out.splitlines()]) == (EXCEPTION, ["unit,status,60000", f"1,{ADDRESS},", f"2,{ADDRESS},"])
    code, out, _ = mbm(*read, "-u", "1,2", 100, "--json")
    assert (code, [(row["unit"], row["values"][0]["value"]) for row in map(json.loads, out.splitlines())]) == (
        DONE, [(1, word(100)), (2, word(100))])


# --- UDP and TLS

@pytest.fixture(scope="module")
def secured():
    """The ports of two servers of pymodbus with TLS, by their certificate."""
    from pymodbus.server import ModbusTlsServer

    def port(name):
        made = context(name, ssl.PROTOCOL_TLS_SERVER)
        return served(lambda: ModbusTlsServer(ten_registers(), address=("127.0.0.1", 0), sslctx=made))

    return {name: port(name) for name in ("server", "stranger-server")}


def test_read_reads_over_udp(mbm):
    from pymodbus.server import ModbusUdpServer

    port = served(lambda: ModbusUdpServer(ten_registers(), address=("127.0.0.1", 0)))
    mbm.prints(numbered(100, range(1000, 1010)), "read", f"udp://127.0.0.1:{port}", "-u", 17, 100, 10)
    mbm.fails(NO_REPLY, "no right reply from unit 1 within 1s: Connection refused", "read", "udp://127.0.0.1:1", 0)


def test_registers_are_read_and_written_over_tls(mbm, secured):
    mbm.prints(numbered(100, range(1000, 1010)), "read", tls_line(secured["server"], "operator"), "-u", 17, 100, 10)
    line = tls_line(secured["server"], "operator", "&name=localhost")
    mbm.prints("unit 17: wrote 1 holding register from address 109 on, function 06\n", "write", line, "-u", 17, 109, 1009)
    mbm.prints(numbered(109, [1009]), "read", line, "-u", 17, 109)


@pytest.mark.parametrize("server, client, more, code, sentence", [
    ("server", "operator", "&name=pump.example", LINE, "the server's certificate is for another name. docs/security.md"),
    ("server", "stranger", "", LINE, "The server may refuse the certificate"),
    ("server", "nobody", "", WRONG, f"mbm read: {CERTIFICATES}/nobody.pem: No such file"),
    ("stranger-server", "operator", "", LINE, "no known authority signed the peer's certificate"),
])
def test_a_tls_line_that_fails_says_why(mbm, secured, server, client, more, code, sentence):
    mbm.fails(code, sentence, "read", tls_line(secured[server], client, more), 100)


@pytest.mark.parametrize("line, code, sentence", [
    ("tls://127.0.0.1?ca={0}&cert={0}&key=/none/key", WRONG, "mbm read: /none/key: No such file"),
    ("tls://127.0.0.1?ca=/dev&cert={0}&key={1}", WRONG, "mbm read: /dev: Is a directory"),
    (tls_line(1, "operator"), LINE, "Connection refused. Check host and port"),
])
def test_a_tls_line_without_its_files_or_its_server_says_why(mbm, line, code, sentence):
    mbm.fails(code, sentence, "read", line.format(*keys("operator")), 100)


# What each kind of line can have.
KEYS = {"tcp": ["accept=unit,transaction", "lenient=yes"], "rtu": ["lenient=yes"], "rtu+tcp": ["lenient=yes"], "ascii": []}
KEYS_OF_ALL = ["delay=100ms", "message_wait=10ms", "close=round,error", "retries=1", "busy_retries=2", "busy_wait=10ms"]


def test_keys_for_devices_that_deviate_cost_a_right_device_nothing(mbm, server):
    """Each key alone, and all together."""
    of_kind = KEYS[server.line.split(":")[0]] + KEYS_OF_ALL
    for keys_of_line in [[key] for key in of_kind if key[:9] != "busy_wait"] + [of_kind]:
        line = server.line + ("&" if "?" in server.line else "?") + "&".join(keys_of_line)
        mbm.prints(numbered(100, words(100, 300)), "read", line, "-u", server.unit, 100, 300)
        assert mbm("write", line, "-u", server.unit, 1, word(1), *PATIENT).code == DONE
