"""What Home Assistant takes by MQTT discovery: small tables after its documentation of MQTT entities, and of the device classes
and state classes of sensors. `component_of` checks a message as Home Assistant does."""

import json
import re

COMMON = {"name": str, "unique_id": str, "availability": list, "availability_mode": str, "device": dict, "origin": dict,
          "state_topic": str, "value_template": str}
SCHEMAS = {
    "sensor": ({"unit_of_measurement": str, "device_class": str, "state_class": str, "options": list, "suggested_display_precision": int},
               {"state_topic"}),
    "select": ({"command_topic": str, "command_template": str, "options": list}, {"command_topic", "options"}),
    "binary_sensor": ({"payload_on": str, "payload_off": str, "device_class": str}, {"state_topic"}),
    "switch": ({"command_topic": str, "payload_on": str, "payload_off": str, "state_on": str, "state_off": str, "device_class": str},
               {"command_topic"}),
    "number": ({"command_topic": str, "min": float, "max": float, "step": float, "mode": str, "unit_of_measurement": str, "device_class": str},
               {"command_topic"}),
    "text": ({"command_topic": str, "max": int, "command_template": str}, {"command_topic"}),
    "button": ({"command_topic": str, "payload_press": str, "device_class": str}, {"command_topic"}),
}
DEVICE = {"identifiers": list, "name": str, "model": str}
TOPIC = re.compile(r"homeassistant/([a-z_]+)/[a-zA-Z0-9_-]+/[a-z0-9_]+/config")

# Of some device classes the units, and the state classes.
COUNTS, MEASURES = {"total", "total_increasing", None}, {"measurement", None}
CLASSES = {
    "energy": ({"Wh", "kWh", "MWh", "GJ"}, COUNTS), "energy_storage": ({"Wh", "kWh", "MWh"}, MEASURES), "power": ({"W", "kW", "MW"}, MEASURES),
    "apparent_power": ({"VA", "kVA"}, MEASURES), "reactive_power": ({"var", "kvar"}, MEASURES), "reactive_energy": ({"varh", "kvarh"}, COUNTS),
    "voltage": ({"V", "mV"}, MEASURES), "current": ({"A", "mA"}, MEASURES), "frequency": ({"Hz", "kHz"}, MEASURES),
    "temperature": ({"\u00b0C", "K"}, MEASURES), "temperature_delta": ({"\u00b0C", "K"}, MEASURES), "humidity": ({"%"}, MEASURES),
    "battery": ({"%"}, MEASURES), "carbon_dioxide": ({"ppm"}, MEASURES), "pressure": ({"bar", "Pa", "hPa", "kPa", "mbar"}, MEASURES),
    "power_factor": ({"%", None}, MEASURES), "distance": ({"mm", "m"}, {*COUNTS, *MEASURES}), "duration": ({"s", "min", "h"}, {*COUNTS, *MEASURES}),
    "volume_flow_rate": ({"m\u00b3/h", "L/min"}, MEASURES), "water": ({"L", "m\u00b3"}, COUNTS),
}
OTHER_CLASSES = {"binary_sensor": {"battery_charging", "lock", "problem", "running"}, "switch": {"outlet", "switch"}, "button": {"identify", "restart", "update"}}


def is_a(value, kind):
    return isinstance(value, (int, float)) if kind is float else isinstance(value, kind)


def check_classes(component, config):
    """A device class goes with the unit and the state class; an enum has options alone."""
    name, unit, state = (config.get(key) for key in ("device_class", "unit_of_measurement", "state_class"))
    if component == "sensor" and "options" in config:
        assert (name, unit, state) == ("enum", None, None), config
    elif component in ("sensor", "number") and name:
        units, states = CLASSES[name]
        assert unit in units and state in states, config
    elif component in OTHER_CLASSES:
        assert name is None or name in OTHER_CLASSES[component], config


def component_of(topic, config):
    """Checks a topic and its message. Returns the component."""
    component = TOPIC.fullmatch(topic)[1]
    optional, needed = SCHEMAS[component]
    keys = {**COMMON, **optional}
    assert all(key in keys and is_a(value, keys[key]) for key, value in config.items()), config
    assert needed | {"unique_id", "device", "availability"} <= set(config), config
    assert config["device"]["identifiers"] and all(key in DEVICE and is_a(value, DEVICE[key]) for key, value in config["device"].items())
    assert all(set(one) == {"topic"} for one in config["availability"]) and config["availability_mode"] == "all"
    if component == "number":
        assert config["min"] < config["max"] and config["step"] >= 0.001 and config["mode"] == "box"
    if component == "text" and "max" in config:
        assert 0 < config["max"] <= 255
    check_classes(component, config)
    return component


def messages(retained):
    """The messages of discovery among what a broker retains, each checked: by names, with their components."""
    found = {topic: json.loads(text) for topic, text in retained.items() if topic.startswith("homeassistant/")}
    return {config["name"]: (component_of(topic, config), config) for topic, config in found.items()}
