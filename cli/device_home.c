/* Reads the keys of a field for Home Assistant, and refuses what Home Assistant would refuse. */
#include "device_keys.h"

#include "home.h"
#include "numbers.h"

#include <stdio.h>
#include <string.h>

enum { LONGEST_CLASS = 50, LONGEST_LIST = 1000 };

/* Write words with commas between them: names of classes, or units that "|" separates. */
static const char *list_classes(const home_class *classes, unsigned count)
{
    static char text[LONGEST_LIST];
    size_t length = 0;
    unsigned i;

    text[0] = '\0';
    for (i = 0; i < count && length < sizeof text; i++)
        length += (size_t)snprintf(text + length, sizeof text - length, "%s%s",
                                   i == 0           ? ""
                                   : i + 1 == count ? " and "
                                                    : ", ",
                                   classes[i].name);
    return text;
}

static const char *list_units(const home_class *of)
{
    static char text[LONGEST_LIST];
    const char *from = of->units;
    size_t length = 0;

    for (; *from && length + 3 < sizeof text; from++)
        if (*from == '|') {
            text[length++] = ',';
            text[length++] = ' ';
        } else {
            text[length++] = *from;
        }
    text[length] = '\0';
    return text;
}

/* Returns what an entity is called in a sentence, such as "a switch". */
static const char *entity_of(int component)
{
    return say("a %s", home_components[component]);
}

static int refuse_unit(yaml_file *file, const yaml_node_t *node, const home_class *of,
                       const char *unit)
{
    if (!unit)
        return yaml_file_refuse(file, node,
                                "device_class: %s needs a unit_of_measurement, one of %s", of->name,
                                list_units(of));
    if (!*of->units)
        return yaml_file_refuse(file, node, "device_class: %s has no unit_of_measurement",
                                of->name);
    return yaml_file_refuse(
        file, node, "device_class: %s does not go with the unit_of_measurement %s, but %s%s",
        of->name, unit, list_units(of), of->is_unit_free ? ", or none" : "");
}

static int read_class(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field)
{
    const int component = home_component(field, planned);
    const home_class *classes, *found;
    const unsigned count = home_classes(component, &classes);
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, "device_class", node, LONGEST_CLASS);
    if (!text)
        return 0;
    if (strcmp(text, "none") == 0) {
        field->device_class = "none";
        return 1;
    }
    if (count == 0 || (component == HOME_SENSOR && !home_is_number(field, planned)))
        return yaml_file_refuse(file, node,
                                "device_class: Home Assistant makes %s of this field, which has no "
                                "device class: only one number and one bit have one",
                                home_has_names(field, planned) && component == HOME_SENSOR
                                    ? "a sensor of the class enum"
                                    : entity_of(component));
    found = home_find_class(component, text);
    if (!found)
        return yaml_file_refuse(file, node, "device_class: \"%s\" is not one that %s has: none, %s",
                                text, entity_of(component), list_classes(classes, count));
    if (!home_has_unit(found, field->unit_of_measurement))
        return refuse_unit(file, node, found, field->unit_of_measurement);
    field->device_class = found->name;
    return 1;
}

/* The state classes that go with a device class. */
static const char *list_states(const home_class *of)
{
    static char text[LONGEST_LIST];
    size_t length = (size_t)snprintf(text, sizeof text, "none");
    int i;

    for (i = HOME_MEASUREMENT; home_states[i]; i++)
        if (of->states >> i & 1)
            length +=
                (size_t)snprintf(text + length, sizeof text - length, " and %s", home_states[i]);
    return text;
}

static int read_state(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field)
{
    const int component = home_component(field, planned);
    const char *name = home_class_of(field, planned);
    const home_class *of = name ? home_find_class(HOME_SENSOR, name) : NULL;
    int state = HOME_NO_STATE;

    if (!node)
        return 1;
    if (!yaml_file_word(file, "state_class", node, home_states, &state))
        return 0;
    field->has_state_class = 1;
    field->state_class = (uint8_t)state;
    if (state == HOME_NO_STATE)
        return 1;
    if (component != HOME_SENSOR || !home_is_number(field, planned))
        return yaml_file_refuse(file, node,
                                "state_class: Home Assistant makes %s of this field: only one "
                                "number that is read and not written has a state class",
                                component == HOME_SENSOR ? "a text" : entity_of(component));
    if (of && !(of->states >> state & 1))
        return yaml_file_refuse(file, node,
                                "state_class: %s does not go with the device_class %s, but %s",
                                home_states[state], of->name, list_states(of));
    if (state == HOME_ANGLE &&
        (!field->unit_of_measurement || strcmp(field->unit_of_measurement, "\u00B0") != 0))
        return yaml_file_refuse(file, node,
                                "state_class: measurement_angle needs the unit_of_measurement "
                                "\u00B0");
    return 1;
}

/* --- press --- */

static int read_press(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field)
{
    if (!node)
        return 1;
    if (field->access != DEVICE_WRITE)
        return yaml_file_refuse(file, node, "press is for fields with \"access: write\"");
    if (home_is_several(planned))
        return yaml_file_refuse(file, node, "press is for fields of one value: count is %u",
                                planned->count);
    return yaml_file_copy(file, "press", node, VALUE_LONGEST, &field->press) &&
           device_initial_check(file, "press", node, planned, field);
}

int device_home_read(yaml_file *file, const yaml_node_t *device_class,
                     const yaml_node_t *state_class, const yaml_node_t *press,
                     const mbm_planField *planned, device_field *field)
{
    return read_press(file, press, planned, field) &&
           read_class(file, device_class, planned, field) &&
           read_state(file, state_class, planned, field);
}
