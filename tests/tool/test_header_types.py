"""mbm header: fields of types that a plan does not know have the keys of the others: what their functions say is what mbm poll
says of the same registers."""

import fractions
import json
import os
import struct

import pytest
from peers import DONE, PATIENT, ROOT, TcpDevice, run
from test_header import COMPILERS, WARNINGS, compiled, has_of, header_of

FILE = """\
device: types
unit: 17
fields:
  - {name: sf, table: holding, address: 0, type: int16}
  - {name: bcd, table: holding, address: 1, type: bcd16, scale: 0.1, offset: 1, not_available: 0xFFFF, access: read-write,
     min_value: 1.5, max_value: 900, step: 0.5}
  - {name: energy, table: holding, address: 2, type: uint64_m10k, order: CDAB, scale: sf, offset: -0.5, not_available: 0xFFFFFFFFFFFFFFFF}
  - {name: mode, table: holding, address: 6, type: uint32, bits: 12-19, not_available: [255, 254]}
  - {name: small, table: holding, address: 8, type: int24, count: 2, not_available: [-1, 0x800000], scale: 2, offset: -40}
  - {name: half, table: holding, address: 12, type: float16, scale: 2, not_available: -9, access: read-write, min_value: 0, max_value: 10}
  - {name: swap, table: holding, address: 13, type: uint64, order: EFGHABCD, not_available: standard, scale: 0.001, access: read-write,
     min_value: 0, max_value: 1e17, step: 0.002}
  - {name: least, table: holding, address: 17, type: int64, order: CDABGHEF, not_available: standard, scale: -0.5}
  - {name: wide, table: holding, address: 21, type: int48, not_available: -2, offset: 7}
  - {name: sign, table: holding, address: 24, type: sign_magnitude16, not_available: 0x8000, scale: sf}
  - {name: m10k, table: holding, address: 25, type: int32_m10k, not_available: 0x80008000, offset: 0.25}
  - {name: real, table: holding, address: 27, type: double, order: EFGHABCD, scale: 0.5, offset: 1}
  - {name: plain, table: holding, address: 31, type: uint24, scale: 0.25}
  - {name: since, table: holding, address: 33, type: unix32, not_available: 0xFFFFFFFF}
  - {name: clock, table: holding, address: 35, type: iec870_3, not_available: "2000-01-01T00:00:00Z"}
  - {name: serial, table: holding, address: 38, type: text_low, count: 4, not_available: standard}
"""
NUMBERS = {"bcd": 3, "energy": None, "mode": None, "small": 1, "half": None, "swap": None, "least": None, "wide": None, "sign": 4, "m10k": 2,
           "real": None, "plain": 2}
"""The fields that have a value as a double, and with how many decimals, if they have any, they are read as an integer."""


def words(text):
    return [int(word, 16) for word in text.split()]


def double(value):
    data = struct.pack(">d", value)
    return list(struct.unpack(">4H", data[4:] + data[:4]))


HALF = struct.unpack(">H", struct.pack(">e", -4.5))[0]
STATES = {
    "values": [0xFFFE, 0x2345, *words("0108 18d4 002b 0000"), *words("000a 5000"), *words("ffff fffb 1200 0007"), 0x4500,
               *words("0506 0708 0102 0304"), *words("0304 0102 0708 0506"), *words("ffff ffff fffd"), 0x83E8, *words("fb2e e9d2"),
               *double(0.1), *words("ff00 0003"), *words("6926 1234"), *words("001a 0b1b 173b"), *words("0041 0042 0031 0000")],
    "nothing": [3, 0xFFFF, *words("ffff ffff ffff ffff"), *words("000f f000"), *words("00ff ffff 0080 0000"), HALF,
                *words("ffff ffff ffff ffff"), *words("0000 0000 0000 8000"), *words("ffff ffff fffe"), 0x8000, *words("8000 8000"),
                *double(float("nan")), *words("0000 0000"), *words("ffff ffff"), *words("0000 0101 0000"), *words("0000 0000 0000 0000")],
    "no_power": [0x8000, 0x0000, *words("0108 18d4 002b 0000"), *words("0000 0000"), *words("0000 0000 0000 0000"), 0x7E00,
                 *words("0000 0000 0000 0000"), *words("0000 0000 0000 0000"), *words("0000 0000 0000"), 0x0001, *words("0000 0000"),
                 *double(1e300), *words("0000 0000"), *words("0000 0000"), *words("001a 0b1b 173b"), *words("0000 0000 0000 0031")],
    "malformed": [0, 0x00AB, *words("2710 0000 0000 0000"), *words("000f e000"), *words("ff80 0000 00ff ffff"), 0x0001,
                  *words("0000 0000 0000 0001"), *words("0000 0000 0000 0001"), *words("8000 0000 0000"), 0x8001, *words("2710 0000"),
                  *double(-1.5), *words("00ff ffff"), *words("0000 0000"), *words("ffff ffff ffff"), *words("0041 0000 0000 0000")],
}


def program_of(names):
    """The function print_more: a line for each value, with the name, the status and the value."""
    rows = []
    for name, decimals in names.items():
        index = "index, " if name == "small" else ""
        rows.append(f'status = types_{name}_number(of, {index}&number);\n    printf("{name} %u %.17g\\n", status, status == MBM_OK ? number : 0);')
        if decimals is not None:
            rows.append(f'status = types_{name}_decimal(of, {index}{decimals}, &whole);\n'
                        f'    printf("{name} %u %.17g\\n", status, status == MBM_OK ? (double)whole / 1e{decimals} : 0);')
    takes = "".join(f'(void)mbm_plan_getRegisters(of, TYPES_{name.upper()}, &view);\n    printf("{name} %u\\n", types_take_{name}(&view, {rest}));\n    '
                    for name, rest in (("since", "&seconds"), ("clock", "&date"), ("serial", "text, sizeof text")))
    one = "\n    ".join(rows)
    return ("static void print_more(const mbm_plan *of)\n{\n    mbm_date date = MBM_INIT;\n    char text[8] = \"\";\n    mbm_registers view;\n"
            "    uint32_t seconds = 0;\n    double number = 0;\n    int32_t whole = 0;\n    uint16_t index = 0;\n    uint8_t status;\n\n"
            f"    printf(\"more\\n\");\n    {takes}{one}\n" +
            '    for (index = 1; index < 3; index++) {\n        status = types_small_number(of, index, &number);\n'
            '        printf("small%u %u %.17g\\n", index, status, status == MBM_OK ? number : 0);\n    }\n}\n')


NOT_AVAILABLE = 0xF8


@pytest.mark.parametrize("state", STATES)
def test_the_functions_of_a_header_say_what_poll_says(mbm, folder, write, compiled, state):
    file, registers = write("types.yaml", FILE), STATES[state]
    header_of(mbm, folder, file, "TYPES")
    write("more.h", program_of(NUMBERS))
    program = compiled("device", '-DHEADER="types.h"', "-DUPPER=TYPES", "-DLOWER=types", "-DTYPES_PLAN", "-DTYPES_SERVER", '-DMORE="more.h"',
                       *has_of(f"{folder}/types.h", "types"))

    def reply(pdu):
        first, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        return bytes([3, 2 * count]) + struct.pack(f">{count}H", *registers[first:first + count])

    rows = {row["name"]: row for row in map(json.loads, mbm("poll", TcpDevice(reply).line, file, "--once", "--json", *PATIENT).out.splitlines())}
    done = run(program, "poll", "127.0.0.1", TcpDevice(reply).line.rsplit(":", 1)[1])
    assert done.code == 0, done
    found = [line.split() for line in done.out.split("more\n")[1].splitlines()]
    assert len(found) == len(NUMBERS) + sum(one is not None for one in NUMBERS.values()) + 3 + 2
    for name, status, *value in found:
        wanted = rows[name.rstrip("12")]["value"]
        if isinstance(wanted, list):
            wanted = wanted[int(name[-1]) if name[-1].isdigit() else 0] if not name.endswith("2") else None
        if wanted is None:
            assert int(status) != 0, name
            if rows[name.rstrip("12")].get("status") == "not available":
                assert int(status) == NOT_AVAILABLE or name == "small2", name
        else:
            assert int(status) == 0, (name, rows[name.rstrip("12")])
            assert not value or float(value[0]) == pytest.approx(float(wanted), rel=1e-3 if name == "half" else 1e-15), (name, value, wanted)


@pytest.mark.parametrize("compiler", COMPILERS, ids=" ".join)
def test_each_compiler_takes_the_functions_of_all_types(plain, folder, write, compiler):
    header_of(plain, folder, write("types.yaml", FILE), "TYPES")
    write("more.h", program_of(NUMBERS))
    program = write("types.c", '#define TYPES_PLAN\n#define TYPES_SERVER\n#include "types.h"\n#include <stdio.h>\n#include "more.h"\n'
                    "void use(const mbm_plan *plan);\nvoid use(const mbm_plan *plan)\n{\n    print_more(plan);\n}\n")
    done = run(*compiler, *WARNINGS, f"-I{ROOT}/include", f"-I{folder}", "-Os", "-c", "-o", os.devnull, program)
    assert done.code == 0, done.error


# --- limits

LIMITS = [
    ("int16", "scale: 0.1, min_value: -5, max_value: 30, step: 0.5"), ("int16", "scale: -2, offset: 1, min_value: -5, max_value: 30, step: 4"),
    ("int16", "scale: 0.1, min_value: -5.05, max_value: 30.07"), ("int16", "min_value: -32768, max_value: 32767, step: 100000"),
    ("int16", "min_value: 40000"), ("int16", "max_value: -40000"), ("int16", "step: 7"), ("int16", "min_value: -40000, max_value: 40000"),
    ("uint16", "min_value: 0, max_value: 50000, step: 4"), ("uint16", "min_value: 0, max_value: 65535"), ("uint16", "max_value: -5"),
    ("uint16", "min_value: -5, max_value: 0"), ("uint16", "min_value: 3, step: 5"), ("uint16", "max_value: 70000, step: 70000"),
    ("uint32", "min_value: 1, max_value: 4294967295, step: 3"), ("int32", "min_value: -2147483648, step: 1000"),
    ("uint64", "min_value: 7, max_value: 1e17, step: 5"), ("int64", "min_value: -9e17, max_value: 9e17, step: 3"),
    ("bcd16", "scale: 0.1, min_value: 1, max_value: 900, step: 0.5"), ("int24", "min_value: -100, max_value: 100, step: 10"),
    ("int48_m10k", "min_value: -100, max_value: 1e10"), ("uint48", "min_value: 0, max_value: 1e10, step: 1000"),
    ("sign_magnitude16", "offset: 0.5, max_value: 100"), ("float", "min_value: 0, max_value: 30, step: 1"), ("float16", "max_value: 30"),
]
LIMITED = "device: limited\nfields:\n" + "".join(f"  - {{name: f{at}, table: holding, address: {4 * at}, access: read-write, type: {kind}, {keys}}}\n"
                                              for at, (kind, keys) in enumerate(LIMITS))
RAW = sorted({sign * (amount + near) for amount in (0, 1, 2, 3, 6, 10, 16, 50, 100, 300, 4095, 9000, 32767, 40000, 50000, 65535, 70000, 2**31, 2**32,
                                                    10**10, 10**17, 9 * 10**17) for near in (-1, 0, 1, 2) for sign in (-1, 1)})
RANGES = {"int16": (-2**15, 2**15 - 1), "uint16": (0, 2**16 - 1), "uint32": (0, 2**32 - 1), "int32": (-2**31, 2**31 - 1), "uint64": (0, 2**64 - 1),
          "int64": (-2**63, 2**63 - 1), "bcd16": (0, 2**32 - 1), "int24": (-2**31, 2**31 - 1), "int48_m10k": (-2**63, 2**63 - 1),
          "uint48": (0, 2**64 - 1), "sign_magnitude16": (-2**31, 2**31 - 1), "float": (-2**15, 2**15), "float16": (-2**11, 2**11)}
"""The numbers that the C type of each type has."""


def is_allowed(raw, kind, keys):
    """Whether a field may have a number, by fractions."""
    of = {key: fractions.Fraction(value) for key, value in (one.split(": ") for one in keys.split(", "))}
    value = raw * of.get("scale", 1) + of.get("offset", 0)
    step = of.get("step") if not kind.startswith("float") else None
    return (of.get("min_value", value) <= value <= of.get("max_value", value) and
            (not step or (value - of.get("min_value", 0)) % step == 0))


def linked(folder, option):
    """The program of program.c."""
    done = run("gcc", option, f"-I{ROOT}/include", f"{folder}/program.c", f"{ROOT}/target/release/libmbm.a", "-o", f"{folder}/program")
    assert done.code == 0, done.error
    return f"{folder}/program"


def test_a_number_beyond_the_limits_of_a_field_is_refused_as_the_file_says(plain, folder, write):
    header_of(plain, folder, write("limited.yaml", LIMITED), "LIMITED")
    tried = [[raw for raw in RAW if RANGES[kind][0] <= raw <= RANGES[kind][1]] for kind, _ in LIMITS]
    calls = [f"limited_check_f{at}({raw}{'ull' if raw > 2**31 else 'll'})" for at, numbers in enumerate(tried) for raw in numbers]
    write("program.c", '#define LIMITED_SERVER\n#include "limited.h"\n#include <stdio.h>\nint main(void)\n{\n'
          + "".join(f'    printf("%u ", {call});\n' for call in calls) + "    return 0;\n}\n")
    program = linked(folder, "-w")
    wanted = [is_allowed(raw, kind, keys) for (kind, keys), numbers in zip(LIMITS, tried) for raw in numbers]
    found = [word == "0" for word in run(program).out.split()]
    assert [call for call, one, other in zip(calls, found, wanted, strict=True) if one != other] == []
    assert len(set(found)) == 2


def test_putting_refuses_a_number_beyond_the_limits_and_a_server_sets_any(plain, folder, write):
    header_of(plain, folder, write("types.yaml", FILE), "TYPES")
    write("program.c", """\
#define TYPES_SERVER
#include "types.h"
#include <stdio.h>
int main(void)
{
    static const uint32_t numbers[] = {4, 6, 10};
    uint16_t words[1] = {7};
    mbm_registers view;
    uint32_t value = 0;
    int i;

    (void)mbm_registers_intoWords(&view, words, 1, 1);
    for (i = 0; i < 3; i++) {
        printf("%u ", types_put_bcd(&view, numbers[i]));
        printf("%u ", words[0]);
    }
    printf("%u ", types_set_bcd(4));
    printf("%u\\n", types_get_bcd(&value));
    return value != 4;
}
""")
    program = linked(folder, "-std=c11")
    # 1.4, 1.6 and 2.0: of them only 2.0 is 1.5 and a multiple of 0.5.
    out_of_range = 246
    assert run(program) == (DONE, f"{out_of_range} 7 {out_of_range} 7 0 16 0 0\n", "")


@pytest.mark.parametrize("compiler", COMPILERS, ids=" ".join)
def test_each_compiler_takes_the_checks_of_limits(plain, folder, write, compiler):
    header_of(plain, folder, write("limited.yaml", LIMITED), "LIMITED")
    program = write("limited.c", '#define LIMITED_SERVER\n#include "limited.h"\nuint8_t use(int8_t value);\nuint8_t use(int8_t value)\n{\n    return '
                    + " | ".join(f"limited_check_f{at}({'(uint8_t)' if kind.startswith(('u', 'b')) else ''}value)" for at, (kind, _) in enumerate(LIMITS))
                    + ";\n}\n")
    done = run(*compiler, *(word for word in WARNINGS if word != "-Wconversion"), f"-I{ROOT}/include", f"-I{folder}", "-Os", "-c",
               "-o", os.devnull, program)
    assert done.code == 0, done.error
