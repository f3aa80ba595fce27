"""What the numbers of a device mean: offset, scale, precision, limits and values that are not available. mbm reads, writes and
publishes them with servers of libmodbus and pymodbus, and with mbm serve."""

import json
import struct

import peers
import pytest
from peers import DONE, EXCEPTION, PATIENT, ROOT, WRONG, pymodbus, run, wait
from services import Broker, Subscriber, metrics
from test_header import COMPILERS, WARNINGS

FIELDS = """\
unit: 17
interval: 200ms
not_available: standard
fields:
  - {name: power, table: holding, address: 0, type: int16, scale: power_sf, unit_of_measurement: W}
  - {name: power_sf, table: holding, address: 1, type: int16}
  - {name: temperature, table: holding, address: 2, type: uint16, scale: 0.1, offset: -273.15, precision: 1, access: read-write,
     min_value: -10, max_value: 50.85}
  - {name: energy, table: holding, address: 3, type: uint32, not_available: [0x7FFFFFFF], precision: 0}
  - {name: level, table: holding, address: 5, type: float, access: read-write, min_value: 0, step: 0.5}
  - {name: limit, table: holding, address: 7, type: int16, scale: power_sf, access: read-write, min_value: 0, max_value: 500,
     step: 5}
  - {name: phases, table: holding, address: 8, type: int16, count: 3}
  - {name: label, table: holding, address: 11, type: text, count: 4}
"""
AT_FIRST = [1234, 0xFFFF, 3000, 0, 70000 & 0xFFFF, 0x41A8, 0, 25, 1, 0x8000, 3, 0x6162, 0]
VALUES = {"power": 123.4, "power_sf": -1, "temperature": 26.9, "energy": 70000 & 0xFFFF, "level": 21, "limit": 2.5,
          "phases": [1, None, 3], "label": "ab"}


class Device:
    """A server whose holding registers from 0 on a test sets."""

    def __init__(self, tool, line):
        self.tool, self.line = tool, line

    def set(self, address, *values):
        found = self.tool("write", self.line, "--unit", "17", "--multiple", str(address), *map(str, values), *PATIENT)
        assert found.code == DONE, found

    def get(self, address):
        found = self.tool("read", self.line, "--unit", "17", str(address), *PATIENT)
        assert found.code == DONE, found
        return int(found.out.split()[1])


@pytest.fixture(params=["libmodbus", "pymodbus", "mbm"])
def device(request, plain):
    if request.param == "libmodbus":
        line = f"tcp://127.0.0.1:{peers.libmodbus()[2]}"
    elif request.param == "pymodbus":
        line = f"tcp://127.0.0.1:{pymodbus('tcp', '--port', '0').ready[0]}"
    else:
        serving = plain.begin("serve", "tcp://127.0.0.1:0", "--echo", "--unit", "17")
        line = serving.last_word()
    found = Device(plain, line)
    found.set(0, *AT_FIRST)
    return found


@pytest.fixture
def poll(mbm, write):
    path = write("device.yaml", FIELDS)

    def poll(device, *options):
        found = mbm("poll", device.line, path, "--once", "--json", "-q", *options, *PATIENT)
        assert found.code == DONE, found
        return {one["name"]: one for one in map(json.loads, found.out.splitlines())}

    return poll


def values(found):
    return {name: one["value"] for name, one in found.items()}


# --- reading ---

def test_a_number_that_means_not_available_is_null_with_a_status_of_its_own(device, poll):
    device.set(2, 0xFFFF, 0x7FFF, 0xFFFF, 0x7FC0, 0)
    device.set(8, 0x8000, 0x8000, 0x8000, 0, 0)
    found = poll(device)
    for name in ("temperature", "energy", "level", "label"):
        assert (found[name]["value"], found[name]["status"], found[name]["code"]) == (None, "not available", DONE)
    assert (found["phases"]["value"], found["phases"]["status"]) == ([None, None, None], "not available")
    assert found["power"]["value"] == 123.4


def test_a_value_whose_power_of_ten_is_not_available_is_not_available(device, poll):
    for power in (0x8000, 11, 0xFFF5):
        device.set(1, power)
        found = poll(device)
        assert (found["power"]["value"], found["power"]["status"]) == (None, "not available")
        assert (found["limit"]["value"], found["limit"]["status"]) == (None, "not available")
    device.set(1, 2)
    assert values(poll(device))["power"] == 123400


def test_the_table_of_poll_shows_a_value_that_is_not_available_without_its_unit(device, mbm, write):
    device.set(0, 0x8000)
    found = mbm("poll", device.line, write("device.yaml", FIELDS), "--once", "-q", *PATIENT)
    row = next(line for line in found.out.splitlines() if line.split()[0] == "power")
    assert row.split()[1] == "-" and row.endswith("not available") and " W " not in row


# --- read and write ---

def test_read_converts_and_says_what_is_not_available(device, mbm):
    read = lambda *words: mbm("read", device.line, "--unit", "17", *words, *PATIENT).out
    assert read("2", "--scale", "0.1", "--offset", "-273.15") == "    2  26.85\n"
    assert read("2", "--scale", "0.1", "--offset", "-273.15", "--precision", "1") == "    2  26.9\n"
    assert read("8", "3", "--type", "int16", "--not-available", "standard") == "    8  1\n    9  not available\n   10  3\n"
    rows = read("8", "3", "--type", "int16", "--not-available", "0x8000,3", "--csv").splitlines()
    assert [row.split(",")[2:] for row in rows] == [["status", "8", "9", "10"], ["success", "1", "", ""]]
    found = json.loads(read("9", "--type", "int16", "--not-available", "-32768", "--json"))
    assert (found["status"], found["values"]) == ("not available", [{"address": 9, "value": None, "status": "not available"}])


def test_a_float_that_is_not_a_number_is_not_available_without_an_option(device, mbm):
    device.set(5, 0x7FC0, 0)
    read = lambda *words: mbm("read", device.line, "--unit", "17", "--type", "float", "5", *words, *PATIENT).out
    assert read() == "    5  not available\n"
    assert json.loads(read("--json"))["values"][0] == {"address": 5, "value": None, "status": "not available"}


def test_write_takes_the_offset_away(device, mbm):
    words = ("write", device.line, "--unit", "17", "2", "--scale", "0.1", "--offset", "-273.15")
    assert mbm(*words, "20.05", *PATIENT).code == DONE
    assert device.get(2) == 2932
    refused = mbm(*words, "20", *PATIENT)
    assert refused.code == WRONG and "is not the offset and a multiple of the scale" in refused.error


def test_serve_refuses_what_is_outside_the_limits_of_a_field(mbm, plain, write):
    line = plain.begin("serve", "tcp://127.0.0.1:0", write("device.yaml", FIELDS)).last_word()
    device = Device(plain, line)
    put = lambda address, *words: mbm("write", line, "--unit", "17", str(address), *map(str, words), *PATIENT).code
    # 263.15 and 324 kelvin.
    assert [put(2, number) for number in (2631, 2632, 3240, 3241)] == [EXCEPTION, DONE, DONE, EXCEPTION]
    assert device.get(2) == 3240
    # 21.5; 21.25, which is no step; a float that is not a number.
    assert put(5, 0x41AC, 0) == DONE
    assert put(5, 0x41AA, 0) == EXCEPTION
    assert put(5, 0x7FC0, 0) == EXCEPTION
    # The other half of a float stays: 21.5 with another low word is no step.
    assert put(6, 1) == EXCEPTION
    # The power of ten is 0.
    assert [put(7, number) for number in (500, 505, 3)] == [DONE, EXCEPTION, EXCEPTION]


# --- the bridge ---

# libmodbus's server serves one connection, which the bridge has.
serves_several = pytest.mark.parametrize("device", ["pymodbus", "mbm"], indirect=True)


@pytest.fixture
def hall(device, plain, folder, write):
    broker = Broker(folder).come()
    path = write("device.yaml", FIELDS)
    begin = lambda *options: plain.begin("bridge", "-b", broker.place, "-t", "hall", "--timeout", "2s", "--metrics", "127.0.0.1:0",
                                         *options, device.line, path)
    return begin, broker


@serves_several
def test_the_bridge_publishes_null_with_the_status_and_counts_it(device, hall):
    begin, broker = hall
    bridge, subscriber = begin(), Subscriber(broker)
    for name, value in VALUES.items():
        subscriber.expect_value(f"hall/{name}", value)
    count = lambda: next(value for (name, _), value in metrics(bridge).items() if name == "mbm_bridge_values_not_available")
    assert count() == 0
    device.set(2, 0xFFFF)
    device.set(1, 0x8000)
    for name in ("temperature", "power", "limit"):
        subscriber.expect_value(f"hall/{name}", None)
        assert json.loads(subscriber.last[f"hall/{name}"])["status"] == "not available"
    # The power of ten itself is not available either. The unit answers.
    assert wait(lambda: count() == 4)
    assert subscriber.last["hall/unit/17/status"] == "online"
    device.set(1, 0, 3000)
    for name, value in (("temperature", 26.9), ("power", 1234), ("limit", 25)):
        subscriber.expect_value(f"hall/{name}", value)
    assert wait(lambda: count() == 0)


def test_what_is_written_over_the_bridge_comes_back_converted(device, hall):
    device.set(8, 0x8000, 0x8000, 0x8000)
    begin, broker = hall
    begin()
    subscriber = Subscriber(broker)
    subscriber.expect_value("hall/temperature", 26.9)
    subscriber.expect_value("hall/phases", [None, None, None])
    subscriber.expect_result("hall/temperature", "20.05", "success")
    subscriber.expect_value("hall/temperature", 20.1)
    subscriber.expect_result("hall/limit", "35", "success")
    subscriber.expect_value("hall/limit", 35)
    subscriber.expect_result("hall/limit", "501", "the number is greater than max_value, which is 500")
    subscriber.expect_result("hall/level", "21.5", "success")
    subscriber.expect_value("hall/level", 21.5)


@serves_several
def test_the_plain_text_of_a_value_that_is_not_available_is_none(device, hall):
    begin, broker = hall
    begin("--plain")
    subscriber = Subscriber(broker)
    subscriber.expect_last("hall/temperature", "26.9")
    device.set(2, 0xFFFF)
    subscriber.expect_last("hall/temperature", "None")
    subscriber.expect_last("hall/phases", "1,None,3")
    device.set(2, 3000)
    subscriber.expect_last("hall/temperature", "26.9")


@serves_several
def test_a_write_is_converted_and_kept_within_its_limits(device, hall):
    begin, broker = hall
    begin()
    subscriber = Subscriber(broker)
    subscriber.expect_value("hall/temperature", 26.9)
    subscriber.expect_result("hall/temperature", "20.05", "success")
    assert device.get(2) == 2932
    subscriber.expect_value("hall/temperature", 20.1)
    for name, payload, why in (
        ("temperature", "20", "the number is not the offset and a multiple of the scale"),
        ("temperature", "-10.05", "the number is less than min_value, which is -10"),
        ("temperature", '{"value": 50.95}', "the number is greater than max_value, which is 50.85"),
        ("level", "0.25", "the number is not min_value, 0, and a multiple of step, which is 0.5"),
        ("limit", "501", "the number is greater than max_value, which is 500"),
    ):
        subscriber.expect_result(f"hall/{name}", payload, why)
    assert device.get(2) == 2932
    # The power of ten is -1, and then 1.
    subscriber.expect_result("hall/limit", "35", "success")
    assert device.get(7) == 350
    device.set(1, 1)
    subscriber.expect_value("hall/power", 12340)
    subscriber.expect_result("hall/limit", "70", "success")
    assert device.get(7) == 7
    subscriber.expect_result("hall/limit", "75", "the number is not a multiple of the scale")
    device.set(1, 0x8000)
    subscriber.expect_value("hall/power", None)
    subscriber.expect_result("hall/limit", "70", "the power of ten of the field, power_sf, is not available")
    assert struct.unpack(">h", device.get(7).to_bytes(2, "big")) == (7,)


@serves_several
def test_home_assistant_learns_limits_and_precision(hall):
    begin, broker = hall
    begin("--discovery", "homeassistant")
    subscriber = Subscriber(broker)
    configs = lambda: {json.loads(payload)["name"]: json.loads(payload)
                       for topic, payload in subscriber.last.items() if topic.startswith("homeassistant/")}
    assert wait(lambda: len(configs()) == 8)
    of = configs()
    assert (of["temperature"]["min"], of["temperature"]["max"], of["temperature"]["step"]) == (-10, 50.85, 0.1)
    assert of["energy"]["suggested_display_precision"] == 0 and "suggested_display_precision" not in of["power"]
    assert (of["level"]["min"], of["level"]["step"]) == (0, 0.5)
    assert (of["limit"]["min"], of["limit"]["max"], of["limit"]["step"]) == (0, 500, 5)


# --- firmware ---

PROGRAM = """\
#define DEVICE_PLAN
#include "device.h"
#include <stdio.h>

/* The table and the conversions with registers in place of a plan. */
static void show(const mbm_registers *registers, uint16_t field, const mbm_planConversion *conversion)
{
    double value = 0;
    int32_t decimal = 0;
    const uint8_t status = mbm_registers_getConverted(registers, device_fields, field, 0, conversion, &value);

    (void)mbm_registers_getDecimal(registers, device_fields, field, 0, conversion, 2, &decimal);
    printf("%u %.10g %d\\n", status, value, (int)decimal);
}

int main(void)
{
    static uint16_t words[13] = {1234, 0xFFFF, 3000, 0, 4464, 0x41A8, 0, 25, 1, 0x8000, 3, 0x6162, 0};
    mbm_registers registers;

    (void)mbm_registers_ofWords(&registers, words, 13, 0);
    show(&registers, DEVICE_POWER, &device_power_conversion);
    show(&registers, DEVICE_TEMPERATURE, &device_temperature_conversion);
    show(&registers, DEVICE_ENERGY, &device_energy_conversion);
    show(&registers, DEVICE_LIMIT, &device_limit_conversion);
    show(&registers, DEVICE_PHASES, &device_standard);
    words[2] = 0xFFFF;
    words[3] = 0x7FFF;
    words[4] = 0xFFFF;
    words[8] = 0x8000;
    words[1] = 0x8000;
    show(&registers, DEVICE_POWER, &device_power_conversion);
    show(&registers, DEVICE_TEMPERATURE, &device_temperature_conversion);
    show(&registers, DEVICE_ENERGY, &device_energy_conversion);
    show(&registers, DEVICE_PHASES, &device_standard);
    (void)device_power_number;
    (void)device_phases_decimal;
    (void)device_label_available;
    return DEVICE_TEMPERATURE_PRECISION != 1;
}
"""


@pytest.fixture
def header(mbm, folder, write):
    assert mbm("header", write("device.yaml", FIELDS), "--name", "device", "-o", f"{folder}/device.h") == (DONE, "", "")
    return f"{folder}/device.h"


def test_the_header_has_the_conversions_of_the_fields(header, folder, write):
    source = write("program.c", PROGRAM)
    done = run("gcc", "-std=c11", *WARNINGS, f"-I{ROOT}/include", f"-I{folder}", source, f"{ROOT}/target/release/libmbm.a", "-o", f"{folder}/program")
    assert done.code == 0, done.error
    assert run(f"{folder}/program").out.splitlines() == [
        "0 123.4 12340", "0 26.85 2685", "0 4464 446400", "0 2.5 250", "0 1 100", "248 0 0", "248 0 0", "248 0 0", "248 0 0"]


@pytest.mark.parametrize("compiler", COMPILERS, ids=" ".join)
def test_a_header_with_conversions_compiles_without_a_warning(header, folder, compiler):
    source = f"{folder}/only.c"
    with open(source, "w") as file:
        file.write('#define DEVICE_PLAN\n#include "device.h"\nuint8_t get(const mbm_plan *plan, int32_t *value);\n'
                   "uint8_t get(const mbm_plan *plan, int32_t *value)\n{\n    return device_power_decimal(plan, 1, value);\n}\n")
    done = run(*compiler, *WARNINGS, f"-I{ROOT}/include", "-Os", "-c", source, "-o", f"{folder}/only.o")
    assert (done.code, done.error) == (0, "")


def test_an_offset_that_firmware_cannot_have_is_refused(mbm, write):
    text = "fields: [{name: a, table: holding, address: 0, type: int16, offset: 12345.678901}]\n"
    found = mbm("header", write("device.yaml", text))
    assert found.code == WRONG and "device.yaml:1: offset has more than 9 decimals, or more digits than fit in 32 bits" in found.error


def test_the_page_has_power_offset_and_limits(mbm, write):
    rows = mbm("header", write("device.yaml", FIELDS), "--markdown").out
    assert "| times 10^(power_sf) | W |" in rows
    assert "| 1/10, plus -273.15 |  | read, write: at least -10, at most 50.85 |" in rows
    assert "| read, write: at least 0, in steps of 0.5 |" in rows
