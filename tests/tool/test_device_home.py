"""What mbm bridge tells Home Assistant of a device file: device classes, state classes and buttons; and the keys of the file that
are refused for it."""

import glob
import os
import re

import pytest
from home import messages
from peers import ROOT, WRONG, wait
from services import Broker, Subscriber

FILES = sorted(glob.glob(f"{ROOT}/examples/devices/*.yaml"))

METER = """\
device: meter
interval: 100ms
fields:
- {name: import energy, table: input, address: 0, type: uint32, scale: 0.1, unit_of_measurement: kWh, state_class: total_increasing, value: 104.2}
- {name: balance, table: input, address: 2, type: int32, unit_of_measurement: kWh, state_class: total}
- {name: energy, table: input, address: 4, type: uint32, unit_of_measurement: kWh}
- {name: stored, table: input, address: 6, type: uint16, unit_of_measurement: kWh, device_class: energy_storage}
- {name: voltage, table: input, address: 7, type: uint16, unit_of_measurement: V}
- {name: load, table: input, address: 8, type: uint16, unit_of_measurement: "%"}
- {name: charge, table: input, address: 9, type: uint16, unit_of_measurement: "%", device_class: battery}
- {name: CO2, table: input, address: 10, type: uint16, unit_of_measurement: ppm, device_class: carbon_dioxide}
- {name: correction, table: holding, address: 11, type: int16, unit_of_measurement: \u00b0C, device_class: none, access: read-write}
- {name: setpoint, table: holding, address: 12, type: int16, unit_of_measurement: \u00b0C, access: read-write}
- {name: factor, table: input, address: 13, type: int16, scale: 0.001, device_class: power_factor}
- {name: starts, table: input, address: 14, type: uint16, state_class: total_increasing}
- {name: raw, table: input, address: 15, type: uint16, unit_of_measurement: V, device_class: none, state_class: none}
- {name: state, table: input, address: 16, type: uint16, unit_of_measurement: V, enumeration: {0: off, 1: on}}
- {name: runs, table: discrete, address: 0, device_class: running}
- {name: socket, table: coils, address: 0, access: read-write, device_class: outlet}
- {name: reset, table: holding, address: 20, type: uint16, access: write, press: 31750, device_class: restart}
- {name: acknowledge, table: coils, address: 1, access: write, press: on}
- {name: command, table: holding, address: 21, type: text, count: 8, access: write, press: '"go"'}
- {name: mode, table: holding, address: 30, type: uint16, access: write, press: 2, enumeration: {1: slow, 2: fast}}
- {name: frost, table: holding, address: 31, type: uint16, offset: -40, access: write, press: -10}
"""


@pytest.fixture
def home(plain, folder, write):
    """The messages of the meter, with a broker and a device."""
    home = lambda: None
    home.broker, file = Broker(folder).come(), write("meter.yaml", METER)
    # The device lets its buttons be read.
    home.device = plain.serve("tcp://127.0.0.1:0", write("device.yaml", re.sub(r"access: write, press: [^,}]+(, device_class: restart)?", "access: read-write", METER)))
    plain.begin("bridge", "-b", home.broker.place, "-t", "home", "--discovery", "homeassistant", "--timeout", "20s", home.device, file)
    home.subscriber = Subscriber(home.broker)
    home.subscriber.expect_value("home/import_energy", 104.2)
    home.found = messages(home.broker.retained())
    return home


def test_an_energy_meter_is_on_the_energy_dashboard_without_yaml_by_hand(home):
    component, config = home.found["import energy"]
    keys = ("device_class", "state_class", "unit_of_measurement")
    assert (component, *map(config.get, keys)) == ("sensor", "energy", "total_increasing", "kWh")


def test_classes_are_those_of_the_file_or_go_with_the_unit(home):
    found = {name: (component, config.get("device_class"), config.get("state_class")) for name, (component, config) in home.found.items()}
    assert found == {
        "import energy": ("sensor", "energy", "total_increasing"), "balance": ("sensor", "energy", "total"), "energy": ("sensor", "energy", None),
        "stored": ("sensor", "energy_storage", "measurement"), "voltage": ("sensor", "voltage", "measurement"), "load": ("sensor", None, "measurement"),
        "charge": ("sensor", "battery", "measurement"), "CO2": ("sensor", "carbon_dioxide", "measurement"), "correction": ("number", None, None),
        "setpoint": ("number", "temperature", None), "factor": ("sensor", "power_factor", "measurement"),
        "starts": ("sensor", None, "total_increasing"), "raw": ("sensor", None, None), "state": ("sensor", "enum", None),
        "runs": ("binary_sensor", "running", None), "socket": ("switch", "outlet", None), "reset": ("button", "restart", None),
        "acknowledge": ("button", None, None), "command": ("button", None, None), "mode": ("button", None, None), "frost": ("button", None, None)}


def test_a_button_writes_what_the_file_says(home, plain):
    for name, words, printed in (("reset", "20", "31750"), ("acknowledge", "--table coils 1", "1"), ("command", "--type text 21 8", '"go"'),
                                 ("mode", "30", "2"), ("frost", "31", "30")):
        config = home.found[name][1]
        assert not {"state_topic", "options", "unit_of_measurement"} & set(config)
        home.subscriber.expect_result(config["command_topic"].removesuffix("/set"), config["payload_press"], "success")
        assert wait(lambda: plain("read", home.device, *words.split(), "--timeout", "20s").out.split()[-1:] == [printed]), name


@pytest.mark.parametrize("file", FILES, ids=[os.path.basename(file)[:-5] for file in FILES])
def test_home_assistant_takes_each_field_of_each_file(plain, folder, file):
    broker = Broker(folder).come()
    plain.begin("bridge", "-b", broker.place, "--discovery", "homeassistant", "tcp://127.0.0.1:1", file)
    with open(file, encoding="utf-8") as lines:
        count = sum(line.startswith(("  - name:", "- name:", "  - {name:", "- {name:")) for line in lines)
    assert wait(lambda: len(messages(broker.retained())) >= count)
    if re.search("eastron|em340|energy-meter", file):
        counters = [config for _, config in messages(broker.retained()).values() if config.get("state_class") == "total_increasing"]
        assert {(config["device_class"], config["unit_of_measurement"]) for config in counters} == {("energy", "kWh")}


# --- what is refused

NUMBER = "table: input, address: 0, type: uint16"


@pytest.mark.parametrize("field, sentence", [
    (f"{NUMBER}, device_class: warmth", 'device_class: "warmth" is not one that a sensor has: none, absolute_humidity, apparent_power, '),
    (f"{NUMBER}, device_class: energy, unit_of_measurement: W",
     "device_class: energy does not go with the unit_of_measurement W, but J, kJ, "),
    (f"{NUMBER}, device_class: energy", "device_class: energy needs a unit_of_measurement, one of J, "),
    (f"{NUMBER}, device_class: ph, unit_of_measurement: V", "device_class: ph has no unit_of_measurement"),
    (f"{NUMBER}, device_class: power_factor, unit_of_measurement: V",
     "device_class: power_factor does not go with the unit_of_measurement V, but %, or none"),
    (f"{NUMBER}, state_class: counter", 'state_class: "counter" is not one of none, measurement, measurement_angle, total and total_increasing'),
    (f"{NUMBER}, unit_of_measurement: kWh, state_class: measurement",
     "state_class: measurement does not go with the device_class energy, but none and total and total_increasing"),
    (f"{NUMBER}, unit_of_measurement: V, state_class: total", "state_class: total does not go with the device_class voltage, but none and measurement"),
    (f"{NUMBER}, state_class: measurement_angle", "state_class: measurement_angle needs the unit_of_measurement \u00b0"),
    ("table: discrete, address: 0, device_class: energy", 'device_class: "energy" is not one that a binary_sensor has: none, battery, '),
    ("table: coils, address: 0, access: write, device_class: door", 'device_class: "door" is not one that a switch has: none, outlet and switch'),
    ("table: coils, address: 0, state_class: total", "state_class: Home Assistant makes a binary_sensor of this field"),
    ("table: holding, address: 0, type: uint16, access: read-write, state_class: total", "state_class: Home Assistant makes a number of this field"),
    ("table: input, address: 0, type: text, count: 4, device_class: energy",
     "device_class: Home Assistant makes a sensor of this field, which has no device class: only one number and one bit have one"),
    (f"{NUMBER}, count: 3, device_class: voltage, unit_of_measurement: V", "device_class: Home Assistant makes a sensor of this field, which has no"),
    (f"{NUMBER}, enumeration: {{0: off}}, device_class: voltage, unit_of_measurement: V",
     "device_class: Home Assistant makes a sensor of the class enum of this field"),
    ("table: coils, address: 0, access: read-write, press: on", 'press is for fields with "access: write"'),
    (f"{NUMBER}, press: 1", 'press is for fields with "access: write"'),
    ("table: holding, address: 0, type: uint16, access: write, press: 70000", 'press: "70000" is out of range'),
    ("table: coils, address: 0, access: write, press: 2", 'press: "2" is not one of 0, 1, false, true, off and on'),
    ("table: coils, address: 0, count: 2, access: write, press: 1", "press is for fields of one value: count is 2"),
    ("table: holding, address: 0, type: text, count: 2, access: write, press: abc", "press has 3 characters, and count is 2"),
    ("table: holding, address: 0, type: text, count: 4, access: write, press: \u2603", "press has a character that is not in Latin-1"),
    ("table: holding, address: 0, type: uint16, offset: -40, access: write, press: -50", 'press: "-50" is out of range of uint16'),
])
@pytest.mark.parametrize("command", ["poll tcp://127.0.0.1:1", "serve tcp://127.0.0.1:0", "bridge -b 127.0.0.1:1 tcp://127.0.0.1:1", "header"])
def test_a_class_that_home_assistant_refuses_is_refused_with_its_line(plain, write, command, field, sentence):
    plain.fails(WRONG, f":3: {sentence}", *command.split(),
                write("wrong.yaml", "fields:\n- {name: right, table: input, address: 9, type: uint16}\n- {name: wrong, " + field + "}\n"))
