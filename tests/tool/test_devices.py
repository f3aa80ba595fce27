"""Each file of examples/devices works with every command, and names become topics and identifiers by one rule."""

import glob
import json
import os

import pytest
from peers import DONE, PATIENT, ROOT, WRONG, run, wait
from services import Broker, Subscriber

FILES = sorted(glob.glob(f"{ROOT}/examples/devices/*.yaml"))
WARNINGS = "-std=c11 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wundef -Werror".split()

COMPILERS = [["gcc"], ["avr-gcc", "-mmcu=atmega328p"], ["arm-none-eabi-gcc", "-mthumb", "-mcpu=cortex-m0plus"]]


def of_each_file(test):
    return pytest.mark.parametrize("file", FILES, ids=[os.path.basename(file)[:-5] for file in FILES])(test)


def test_there_are_ten_device_files():
    assert len(FILES) >= 10


@of_each_file
def test_poll_reads_each_field_of_the_device_that_serve_is(plain, file):
    found = plain("poll", plain.serve("tcp://127.0.0.1:0", file), file, "--once", "--json", *PATIENT)
    rows = [json.loads(row) for row in found.out.splitlines()]
    assert found.code == DONE and rows, found.error
    assert all(row["status"] == "success" for row in rows), rows


@of_each_file
def test_a_bridge_publishes_each_field_and_its_entity(plain, folder, file):
    broker, place = Broker(folder).come(), plain.serve("tcp://127.0.0.1:0", file)
    rows = [json.loads(row) for row in plain("poll", place, file, "--once", "--json", *PATIENT).out.splitlines()]
    plain.begin("bridge", "-b", broker.place, "-t", "home", "--discovery", "homeassistant", "--timeout", "20s", place, file)
    subscriber = Subscriber(broker)
    entities = lambda: {config["name"]: config for topic, text in list(subscriber.last.items())
                        if topic.startswith("homeassistant/") and (config := json.loads(text))}
    assert wait(lambda: {row["name"] for row in rows} <= set(entities()))
    assert len({config["unique_id"] for config in entities().values()}) == len(entities())
    for row in rows:
        topic = entities()[row["name"]]["state_topic"]
        assert wait(lambda: topic in subscriber.last), topic
        message = json.loads(subscriber.last[topic])
        assert (message["status"], message["value"]) == ("success", row["value"]), row["name"]


@of_each_file
def test_the_header_of_each_file_compiles(plain, folder, file):
    assert plain("header", file, "-o", f"{folder}/device.h") == (DONE, "", "")
    with open(f"{folder}/device.h", encoding="utf-8") as header:
        plan, server = [line.split()[2] for line in header if line.startswith(" * Define ")]
    with open(f"{folder}/device.c", "w", encoding="utf-8") as program:
        program.write(f"#define {plan}\n#define {server}\n#include <mbm.h>\n#include \"device.h\"\nint main(void) {{ return 0; }}\n")
    for compiler in COMPILERS:
        assert run(*compiler, *WARNINGS, f"-I{ROOT}/include", "-c", f"{folder}/device.c", "-o", f"{folder}/device.o") == (DONE, "", "")


# --- names

NAMED = "fields:\n- {{name: '{}', table: input, address: 0, type: uint16}}\n- {{name: '{}', table: input, address: 1, type: uint16}}\n"


@pytest.mark.parametrize("one, other, sentence", [
    ("pump runs", "pump#runs", ":3: the name pump#runs and that of line 2, pump runs, become the same topic, pump_runs: choose another"),
    ("pump/runs", "Pump Runs", ":3: the name Pump Runs and that of line 2, pump/runs, become the same identifier, pump_runs: choose another"),
    ("level", "°", ":3: the name ° has no letter and no digit, of which identifiers are made"),
    ("level", "1/2/3/4/5/6/7/8/9", ":3: the name 1/2/3/4/5/6/7/8/9 has more than 8 levels with / between them"),
])
@pytest.mark.parametrize("command", ["poll tcp://127.0.0.1:1", "serve tcp://127.0.0.1:0", "bridge -b 127.0.0.1:1 tcp://127.0.0.1:1", "header"])
def test_names_that_become_the_same_are_refused_by_every_command(plain, write, command, one, other, sentence):
    plain.fails(WRONG, sentence, *command.split(), write("names.yaml", NAMED.format(one, other)))


def test_a_name_with_spaces_is_written_at_its_topic_and_the_name_of_a_file_too(plain, folder, write):
    broker = Broker(folder).come()
    text = "interval: 50ms\nfields:\n- {name: set point, table: holding, address: 0, type: uint16, access: read-write, value: 7}\n" \
        "- {name: status, table: holding, address: 1, type: uint16, value: 3}\n"
    file = write("heat pump.yaml", text)
    place = plain.serve("tcp://127.0.0.1:0", file)
    plain.begin("bridge", "-b", broker.place, "-t", "home", write("bridge.yaml", f"lines:\n- {{line: '{place}', file: heat pump.yaml}}\n"))
    subscriber = Subscriber(broker)
    subscriber.expect_value("home/heat_pump/set_point", 7)
    subscriber.expect_value("home/heat_pump/status_", 3)
    subscriber.expect_result("home/heat_pump/set_point", "8", "success")
    subscriber.expect_value("home/heat_pump/set_point", 8)
    subscriber.expect_result("home/heat_pump/set point", "8", "there is no such field")
