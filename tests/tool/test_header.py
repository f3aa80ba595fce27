"""mbm header: each header of examples/devices, and that of c-tests/cells.yaml, compiles everywhere, and is a client and a
server as mbm poll and mbm serve are of the same file."""

import glob
import json
import os
import re

import pytest
from peers import BUILD, DONE, PATIENT, ROOT, WRONG, Client, Program, run

WARNINGS = "-Wall -Wextra -Wpedantic -Wtype-limits -Wconversion -Wshadow -Wundef -Werror".split()
EXAMPLES = {"eastron-sdm120": "SDM120", "eastron-sdm630": "SDM630", "sunspec-inverter": "SUNSPEC_INVERTER", "xy-md02": "XY_MD02",
            "invt-goodrive350": "GOODRIVE350"}
CELLS = f"{ROOT}/c-tests/cells.yaml"
DEVICES = {**{f"{ROOT}/examples/devices/{file}.yaml": name for file, name in EXAMPLES.items()}, CELLS: "CELLS"}
# The others, which have fields that can only be written, types that a plan does not know, or several units.
OTHERS = sorted(set(glob.glob(f"{ROOT}/examples/devices/*.yaml")) - set(DEVICES))
AVR, ARM = "avr-gcc -mmcu=atmega328p", "arm-none-eabi-gcc -mthumb -mcpu=cortex-m0plus"
COMPILERS = [f"{compiler} -std={standard} -x {language}".split() for language, standards, compilers in (
    ("c", ("c99", "c11"), ("gcc", "clang", AVR, ARM)),
    ("c++", ("c++11", "c++17"), ("g++", "clang++", AVR, ARM)),
    ("c++", ("c++20",), ("g++", "clang++", ARM))) for standard in standards for compiler in compilers]


def each(devices):
    return pytest.mark.parametrize("file, name", devices.items(), ids=devices.values())


@pytest.fixture
def compiled(mbm, folder):
    def compiled(program, *options):
        """Compiles a program of c-tests with the ports, the archive and the sanitizers of `mbm`."""
        parts, output = f"{BUILD}/{mbm.build}", f"{folder}/{program}"
        compiler = ["clang", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"] if mbm.build == "sanitized" else ["gcc"]
        archive = f"{parts}/libmbm.a" if mbm.build == "sanitized" else f"{ROOT}/target/release/libmbm.a"
        done = run(*compiler, "-std=c11", *WARNINGS, f"-I{ROOT}/include", f"-I{ROOT}/ports/linux", f"-I{folder}", *options,
                   f"{ROOT}/c-tests/{program}.c", *(f"{parts}/linux/mbm_{part}.o" for part in ("tcp", "tcp_listener", "tcp_set")), archive,
                   "-o", output)
        assert done.code == 0, done.error
        return output

    return compiled


def header_of(mbm, folder, file, name):
    header = f"{folder}/{name.lower()}.h"
    assert mbm("header", file, "-o", header) == (DONE, "", "")
    return header


def has_of(header, lower):
    """The options that say what a header has."""
    with open(header) as file:
        text = file.read()
    return [f"-D{word}" for word, part in (("CONVERSIONS", "conversions"), ("REACH", "configure_client")) if f"{lower}_{part}" in text]


@pytest.fixture
def served(mbm, folder, compiled, file, name):
    """A device: the port of mbm serve, the rows of mbm poll, the program that is made with the header, and the header."""
    header, lower = header_of(mbm, folder, file, name), name.lower()
    program = compiled("device", f'-DHEADER="{lower}.h"', f"-DUPPER={name}", f"-DLOWER={lower}", f"-D{name}_PLAN", f"-D{name}_SERVER",
                       *has_of(header, lower))
    port = mbm.serve("tcp://127.0.0.1:0", file).rsplit(":", 1)[1]
    return port, polled(mbm, port, file), program, header


def polled(mbm, port, file):
    code, out, error = mbm("poll", f"tcp://127.0.0.1:{port}", file, "--once", "--json", *PATIENT)
    assert code == DONE, error
    return [json.loads(row) for row in out.splitlines()]


def described(file):
    """Reads the fields of a device file whose lines are plain, not by mbm: what mbm poll must print of each."""
    fields = []
    with open(file, encoding="utf-8") as lines:
        for row in lines:
            item = re.fullmatch(r"(?:  - |    )([a-z_]+):(?: (.*))?\n", row)
            label = re.fullmatch(r"      (-?\d+): (.*)\n", row)
            if label:
                fields[-1]["enumeration"][int(label[1])] = label[2]
            elif item:
                if item[1] == "name":
                    fields.append({"enumeration": {}})
                if item[1] != "enumeration":
                    fields[-1][item[1]] = item[2].strip('"')
    for field in fields:
        value = field["value"]
        field["value"] = value == "on" if value in ("on", "off") else value if field["type"] == "text" else json.loads(value)
        field["times"] = int(re.search(r"count: (\d+)|$", field.get("repeat", ""))[1] or 1)
    return [{**field, "name": field["name"].replace("{n}", str(n + 1))} for field in fields for n in range(field["times"])]


@each({file: name for file, name in DEVICES.items() if file != CELLS})
def test_poll_prints_the_fields_of_an_example_device(mbm, file, name):
    rows = polled(mbm, mbm.serve("tcp://127.0.0.1:0", file).rsplit(":", 1)[1], file)
    for row, field in zip(rows, described(file), strict=True):
        assert (row["name"], row["value"], row.get("unit_of_measurement"), row.get("value_name")) == (
            field["name"], field["value"], field.get("unit_of_measurement"),
            field["enumeration"].get(int(field["value"])) if field["enumeration"] else None)


def as_numbers(text):
    """The values that device poll printed of a field, as mbm poll prints them."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return text


def is_near(one, other):
    """Whether two values are the same, rounded to a float."""
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return len(one) == len(other) and all(abs(a - b) <= 1e-6 * abs(b) for a, b in zip(one, other))


@each(DEVICES)
def test_a_client_made_with_a_header_reads_what_poll_reads(served, name):
    port, rows, program, header = served
    done = run(program, "poll", "127.0.0.1", port)
    printed = done.out.splitlines()
    assert (done.code, len(printed)) == (0, len(rows)), done.error
    # The fields of the plan are in the order of their requests.
    with open(header, encoding="utf-8") as text:
        printed = dict(zip(re.findall(r"^    /\* (\w+) \*/$", text.read(), re.M), printed, strict=True))
    for row in rows:
        value = row["value"] if isinstance(row["value"], (str, list)) else [row["value"]]
        text = printed[f"{name}_{re.sub('[^A-Z0-9]+', '_', row['name'].upper())}"]
        # A text of the device is in Latin-1.
        assert is_near(text if isinstance(value, str) and value.isascii() else value if isinstance(value, str) else as_numbers(text), value), row


def requests_of(mbm, file):
    """Requests around every place of a field: reads and writes of one cell, of several, and beyond an end. A
    table that the device does not have is left out: a server without it does not know its functions."""
    text = mbm("header", file).out
    tables = {"coil": (1, 5, 15), "discrete input": (2,), "holding register": (3, 6, 16), "input register": (4,)}
    for table, first, last in re.findall(r"^/\* .*?(coil|discrete input|holding register|input register)s? (\d+)(?: to (\d+))?", text, re.M):
        first, last = int(first), int(last or first)
        for address, count in {(first, last - first + 1), (first - 1, 1), (last, 2), (last + 1, 1), (first, 1), (first, 100)}:
            for function in tables[table] if 0 <= address <= 65535 else ():
                head, cells = bytes([function]) + address.to_bytes(2, "big"), count.to_bytes(2, "big")
                yield head + {5: b"\xFF\0", 6: b"\0\x07", 15: cells + bytes([(count + 7) // 8]) + b"\x55" * ((count + 7) // 8),
                              16: cells + bytes([2 * count & 255]) + bytes(range(2 * count))}.get(function, cells)


@each(DEVICES)
def test_a_server_made_with_a_header_answers_as_serve_does(mbm, served, file):
    port, rows, program, _ = served
    own = Program(program, "serve", "0")
    own.is_ours = False
    own_port = own.last_word()
    assert [row["value"] for row in polled(mbm, own_port, file)] == [row["value"] for row in rows]
    unit = int(re.search(r"_UNIT (\d+)u", mbm("header", file).out)[1])
    one, other, count = Client(port), Client(own_port), 0
    for request in requests_of(mbm, file):
        assert other.ask(unit, request) == one.ask(unit, request), request.hex()
        count += 1
    assert count > 50


@pytest.mark.parametrize("compiler", COMPILERS, ids=" ".join)
@each({**DEVICES, **{file: "DEVICE" + str(at) for at, file in enumerate(OTHERS)}})
def test_each_compiler_takes_a_header_twice_and_alone(plain, folder, write, file, name, compiler):
    header, lower = f"{folder}/{name.lower()}.h", name.lower()
    assert plain("header", file, "--name", name, "-o", header) == (DONE, "", "")
    program = write(f"{name}.c", f'#define {name}_PLAN\n#define {name}_SERVER\n#include "{lower}.h"\n#include "{lower}.h"\n'
                    "int main(void)\n{\n    return 0;\n}\n")
    for source in (program, header):
        done = run(*compiler, *WARNINGS, f"-I{ROOT}/include", "-Os", "-c", "-o", os.devnull, source)
        assert done.code == 0, done.error


def test_the_functions_of_a_header_get_and_set_fields(mbm, folder, compiled):
    header_of(mbm, folder, CELLS, "CELLS")
    assert run(compiled("cells"))[:2] == (0, "")


# --- what the device needs to be reached

REACH = "device: Shy\naccept: [unit, transaction]\nlenient: yes\ndelay: 600ms\nmessage_wait: 80ms\nretries: 1\nbusy_retries: 2\nbusy_wait: 10ms\ntimeout: 900ms\n"
FAR = "fields:\n" + "".join(f"- {{name: f{i}, table: holding, address: {300 * i}, type: uint16, value: {i + 7}}}\n" for i in range(3))
SHY = "unit=0 transaction=0 needs-delay=300ms needs-message-wait=50ms exception=6@2 deaf@4".split()


def test_a_header_sets_client_and_link_as_the_device_needs_them(mbm, folder, write, compiled):
    """The device answers as unit 0 with number 0, needs time and pauses, is busy once and silent once."""
    served = write("served.yaml", FAR)
    done = {}
    for name, text in ("SHY", REACH + FAR), ("PLAIN", "device: Plain\n" + FAR):
        header, lower = header_of(mbm, folder, write(f"{name}.yaml", text), name), name.lower()
        program = compiled("device", f'-DHEADER="{lower}.h"', f"-DUPPER={name}", f"-DLOWER={lower}", f"-D{name}_PLAN", f"-D{name}_SERVER",
                           *has_of(header, lower))
        line = mbm.serve("tcp://127.0.0.1:0", served, *(word for fault in SHY for word in ("--fault", fault)))
        done[name] = run(program, "poll", "127.0.0.1", line.rsplit(":", 1)[1])
    assert done["SHY"] == (0, "7\n8\n9\n", ""), done
    assert done["PLAIN"].code == 0 and not {"7", "8", "9"} & set(done["PLAIN"].out.splitlines()), done


@pytest.mark.parametrize("compiler", COMPILERS, ids=" ".join)
def test_each_compiler_takes_the_functions_of_the_reach(plain, folder, write, compiler):
    uses = {"client": "extern mbm_client c;\nuint8_t one(void);\nuint8_t one(void)\n{\n    return LOWER_configure_client(&c);\n}\n",
            "link": "extern mbm_link l;\nuint8_t two(void);\nuint8_t two(void)\n{\n    return LOWER_configure_link(&l);\n}\n"}
    for name, head, objects in ("SHY", REACH, "client link"), ("ONE", "device: One\nretries: 2\n", "client"), ("LINK", "device: Link\ndelay: 2s\n", "link"):
        header_of(plain, folder, write(f"{name}.yaml", head + LIMITED), name)
        program = write(f"{name}.c", f'#define {name}_PLAN\n#include "{name.lower()}.h"\n#if {name}_A_MIN != -50 || {name}_A_MAX != 300\n'
                        f"#error limits\n#endif\nfloat f = {name}_F_MAX;\n"
                        + "".join(uses[word].replace("LOWER", name.lower()) for word in objects.split()))
        done = run(*compiler, *WARNINGS, f"-I{ROOT}/include", f"-I{folder}", "-Os", "-c", "-o", os.devnull, program)
        assert done.code == 0, done.error


@pytest.mark.parametrize("head, macros, calls", [
    ("accept: unit\n", {"ACCEPT": "MBM_ACCEPT_UNIT"}, ["client_setAccept(client, HEADER_ACCEPT)"]),
    ("accept: transaction\n", {"ACCEPT": "MBM_ACCEPT_TRANSACTION", "CLOSE": "MBM_LINK_CLOSE_AFTER_FAILURE"},
     ["client_setAccept(client, HEADER_ACCEPT)", "link_setClose(link, HEADER_CLOSE)"]),
    ("accept: transaction\nclose: never\n", {"ACCEPT": "MBM_ACCEPT_TRANSACTION"}, ["client_setAccept(client, HEADER_ACCEPT)"]),
    ("close: [round, error]\n", {"CLOSE": "(MBM_LINK_CLOSE_WHEN_IDLE | MBM_LINK_CLOSE_AFTER_FAILURE)"}, ["link_setClose(link, HEADER_CLOSE)"]),
    ("close: round\n", {"CLOSE": "MBM_LINK_CLOSE_WHEN_IDLE"}, ["link_setClose(link, HEADER_CLOSE)"]),
    ("lenient: yes\n", {"LENIENT": "1u"}, ["client_setLenient(client, HEADER_LENIENT)"]),
    ("delay: 2s\n", {"DELAY_MS": "2000u"}, ["link_setDelayAfterConnect(link, HEADER_DELAY_MS)"]),
    ("message_wait_milliseconds: 30\n", {"MESSAGE_WAIT_MS": "30u"}, ["client_setMessageWait(client, HEADER_MESSAGE_WAIT_MS)"]),
    ("timeout: 5s\n", {"TIMEOUT_MS": "5000u"}, ["client_setResponseTimeout(client, HEADER_TIMEOUT_MS)"]),
    ("retries: 254\n", {"RETRIES": "254u"}, ["client_setRetries(client, HEADER_RETRIES)"]),
    ("busy_retries: 3\n", {"BUSY_RETRIES": "3u", "BUSY_WAIT_MS": "100u"},
     ["client_setBusyRetries(client, HEADER_BUSY_RETRIES, HEADER_BUSY_WAIT_MS)"]),
    ("busy_retries: 3\nbusy_wait: 0s\n", {"BUSY_RETRIES": "3u", "BUSY_WAIT_MS": "0u"},
     ["client_setBusyRetries(client, HEADER_BUSY_RETRIES, HEADER_BUSY_WAIT_MS)"]),
])
def test_each_key_of_the_reach_is_a_constant_and_a_call(mbm, write, head, macros, calls):
    out = mbm("header", write("header.yaml", head + HEAD)).out
    reach = out[out.index("==== Reach"):].split("#endif")[0]
    assert dict(re.findall(r"^#define HEADER_(\w+) (.*)$", reach, re.M)) == macros
    assert re.findall(r"mbm_(\w+\(.*\));", reach) == calls


def test_a_device_that_needs_nothing_has_the_header_that_it_had(mbm, write):
    defaults = "retries: 0\nclose: never\ndelay: 0s\nlenient: no\nbusy_retries: 0\nbusy_wait: 5s\n"
    before = mbm("header", write("header.yaml", HEAD)).out
    assert "Reach" not in before and mbm("header", write("header.yaml", defaults + HEAD)).out == before


def test_a_device_that_is_only_written_has_the_functions_of_the_reach(mbm, write):
    out = mbm("header", write("header.yaml", "delay: 1s\nfields:\n  - {name: a, table: holding, address: 0, type: uint16, access: write}\n")).out
    assert "Define HEADER_PLAN before you include it for the functions of a client" in out and "header_configure_link" in out


# --- limits of what is written

LIMITED = ("fields:\n- {name: a, table: holding, address: 0, type: int16, scale: 0.1, access: read-write, min_value: -5, max_value: 30, step: 0.5}\n"
           "- {name: f, table: holding, address: 1, type: float, access: read-write, max_value: 30}\n")


@pytest.mark.parametrize("keys, macros", [
    ("int16, scale: 0.1, min_value: -5, max_value: 30, step: 0.5", {"MIN": "(-50)", "MAX": "300", "STEP": "5"}),
    # Between two numbers of the registers: the next one that may be written. No multiple of the step is such a number.
    ("int16, scale: 0.1, min_value: -5.05, max_value: 30.07, step: 0.5", {"MIN": "(-50)", "MAX": "300"}),
    ("int16, scale: 0.1, max_value: -5.05", {"MAX": "(-51)"}),
    ("int16, scale: 0.1, step: 0.25", {}),
    # A negative scale turns them, and an offset is taken off: -5 is 3, and 30 is between -14 and -15.
    ("int16, scale: -2, offset: 1, min_value: -5, max_value: 30, step: 4", {"MIN": "(-14)", "MAX": "3", "STEP": "2"}),
    ("int16, offset: 1, step: 4", {}),
    # Constants are of the sign of the field, and fit where an int has 16 bits.
    ("uint16, min_value: -5, max_value: 50000, step: 4", {"MIN": "0u", "MAX": "50000u"}),
    ("uint16, min_value: 0, max_value: 50000, step: 4", {"MIN": "0u", "MAX": "50000u", "STEP": "4u"}),
    ("uint16, max_value: -5", {}),
    ("uint32, min_value: 65536, max_value: 4294967295", {"MIN": "65536ul", "MAX": "4294967295ul"}),
    ("int32, min_value: -32768, max_value: 32768", {"MIN": "(-32768l)", "MAX": "32768l"}),
    ("int64, min_value: -2147483648, max_value: 1e17", {"MIN": "(-2147483648ll)", "MAX": "100000000000000000ll"}),
    ("int64, scale: 0.01, max_value: 1e17", {}),
    ("uint64, scale: 0.01, max_value: 1e17", {"MAX": "10000000000000000000ull"}),
    ("float, min_value: 0.1, max_value: 30, step: 1e-9", {"MIN": "(0.1f)", "MAX": "(30.0f)", "STEP": "(1e-09f)"}),
    ("double, scale: 0.1, min_value: -0.1, max_value: 1e17", {"MIN": "(-1.0)", "MAX": "(1e+18)"}),
    ("bcd16, min_value: 1, max_value: 30", {"MIN": "1u", "MAX": "30u"}),
    ("int32_m10k, min_value: -100000", {"MIN": "(-100000l)"}),
    ("float16, min_value: 0.5", {"MIN": "(0.5f)"}),
])
def test_limits_are_constants_of_the_numbers_in_the_registers(mbm, write, keys, macros):
    text = f"fields:\n- {{name: level, table: holding, address: 7, access: read-write, type: {keys}}}\n"
    code, out, error = mbm("header", write("header.yaml", text))
    assert (code, dict(re.findall(r"^#define HEADER_LEVEL_(MIN|MAX|STEP) (.*)$", out, re.M))) == (DONE, macros), error


def test_limits_with_a_scale_in_another_field_are_no_constants(mbm, write):
    out = mbm("header", write("header.yaml", "fields:\n- {name: sf, table: holding, address: 0, type: int16}\n- {name: a, table: holding, "
                              "address: 1, type: int16, scale: sf, access: read-write, max_value: 30}\n")).out
    assert "at most 30" in out and "_MAX" not in out


# --- the command

HEAD = "fields:\n  - name: level\n    table: holding\n    address: 7\n    type: uint16\n"
OTHER = "  - {name: %s, table: holding, address: 8, type: uint16}\n"


@pytest.mark.parametrize("text, sentence", [
    (HEAD + OTHER % "level address", "FILE:6: the C name HEADER_LEVEL_ADDRESS is that of line 2 too"),
    (HEAD + OTHER % "fields", "FILE:6: the C name HEADER_FIELDS is one of the header itself"),
    (HEAD + "    enumeration:\n      1: on\n      2: ON\n", "FILE:8: the C name HEADER_LEVEL_ON is that of line 7 too: choose another."),
    (HEAD + "    enumeration:\n      1: size\n", "FILE:7: the C name HEADER_LEVEL_SIZE is that of line 2 too: choose another."),
    (HEAD + '    enumeration:\n      1: "\u00b0"\n', 'FILE:7: enumeration: the name "\u00b0" has none of the letters'),
    (HEAD + "    access: read\n    scale: 1e-10\n", "FILE:7: scale is not a fraction of two whole numbers up to 2147483647"),
    (HEAD + "    scale: 0.12345678901\n", "FILE:6: scale is not a fraction of two whole numbers"),
    (HEAD + "    scale: 3e9\n", "FILE:6: scale is not a fraction of two whole numbers"),
    ("retries: 1\n" + HEAD + OTHER % "retries", "FILE:7: the C name HEADER_RETRIES is one of the header itself"),
    (HEAD + "    access: read-write\n    max_value: 9\n" + OTHER % "level max", "FILE:8: the C name HEADER_LEVEL_MAX is that of line 2 too"),
    ("device: 1 meter\n" + HEAD, 'FILE: "1 meter" cannot be the device\'s name in C'),
    ("device: mbm\n" + HEAD, 'FILE: "mbm" cannot be the device\'s name in C'),
    (HEAD + "    enumeration: {1: on, 1: off}\n", "FILE:6: enumeration has the number 1 twice, first in line 6"),
    (HEAD + "    type: real\n", "FILE:6: type is there twice"),
])
def test_a_device_without_names_in_c_has_no_header(mbm, folder, write, text, sentence):
    file = write("header.yaml", text)
    mbm.fails(WRONG, f"mbm header: {sentence.replace('FILE', file)}", "header", file, "-o", f"{folder}/refused.h")
    assert not os.path.exists(f"{folder}/refused.h")


@pytest.mark.parametrize("scale, fraction", [("0.1", "1, 10"), ("-25e-2", "-1, 4"), ("1e3", "1000, 1"), ("2147483647", "2147483647, 1"),
                                             ("0.000000001", "1, 1000000000"), ("0.5e1", "5, 1"), ("1", "1, 1")])
def test_a_scale_becomes_a_fraction(mbm, write, scale, fraction):
    code, out, _ = mbm("header", write("header.yaml", f"{HEAD}    scale: {scale}\n"))
    assert code == DONE and f"MBM_ORDER_ABCD, 0u, 7u, 1u, 1000u, {fraction}}}" in out


@pytest.mark.parametrize("words, wanted", [((), ["3", "4", "1u, 1u, 1u"]), (("--gap", "2"), ["2", "6", "1u, 2u"]),
                                           (("--gap", "1"), ["3", "4", "1u, 1u, 1u"])])
def test_a_header_says_what_its_plan_needs(mbm, write, words, wanted):
    text = HEAD + "  - {name: other, table: holding, address: 10, type: uint16}\n  - {name: on, table: coils, address: 3, count: 17}\n"
    code, out, _ = mbm("header", write("header.yaml", text), *words)
    found = [re.search(rf"_{word} (\d+)u", out)[1] for word in ("READS", "DATA_WORDS")]
    assert (code, [*found, re.search(r"_counts\[.*\] = {(.*)}", out)[1]]) == (DONE, wanted)


def test_the_option_name_names_a_header(mbm, write):
    out = mbm("header", write("header.yaml", HEAD), "--name", "tank 1").out
    assert "#ifndef TANK_1_H" in out and "tank_1_fields" in out


def test_a_page_has_a_table_of_the_fields(mbm, write):
    text = "device: a | b\n" + HEAD + "    description: high < low\n    unit_of_measurement: mm\n    enumeration: {1: off, 2: on}\n"
    code, out, _ = mbm("header", write("header.yaml", text), "--markdown")
    assert code == DONE and out.startswith("# a \\| b\n")
    assert "| level | holding register 7 | uint16 |  | mm | read | high &lt; low: 1 off, 2 on |\n" in out


def test_fields_that_cannot_be_read_are_in_no_plan(mbm, write):
    code, out, _ = mbm("header", write("header.yaml", "fields:\n  - {name: a, table: holding, address: 0, type: uint16, access: write}\n"))
    assert code == DONE and "_PLAN" not in out and "header_set_a" in out
