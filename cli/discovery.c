/* Writes the topics and the JSON of Home Assistant's MQTT discovery. */
#include "discovery.h"

#include "home.h"
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TOPIC_BYTES = 512, ID_BYTES = 300 };

/* --- names --- */

/* Writes a text with only the characters of an identifier, [a-zA-Z0-9_-]. If other characters were
 * replaced, a number at the end tells the text from others. */
static void write_id(const char *text, char id[ID_BYTES])
{
    uint32_t digest = 0x811C9DC5u;
    int is_changed = 0;
    size_t at = 0;

    for (; *text && at < ID_BYTES - 16; text++) {
        const int is_same = (*text >= 'a' && *text <= 'z') || (*text >= 'A' && *text <= 'Z') ||
                            (*text >= '0' && *text <= '9') || *text == '_' || *text == '-';

        id[at++] = (char)(is_same ? *text : '_');
        is_changed |= !is_same;
        digest = (digest ^ (uint8_t)*text) * 0x01000193u;
    }
    id[at] = '\0';
    if (is_changed)
        snprintf(id + at, ID_BYTES - at, "_%08x", digest);
}

/* Writes the identifier of a line: the beginning of all its topics. */
static void line_id(const discovery_line *line, char id[ID_BYTES])
{
    char text[TOPIC_BYTES];

    snprintf(text, sizeof text, "%s%s%s", line->topic, *line->below ? "/" : "", line->below);
    if (*line->below)
        text[strlen(text) - 1] = '\0';
    write_id(text, id);
}

static const char *component_of(const device *of, uint16_t field)
{
    return home_components[home_component(&of->fields[field], &of->planned[field])];
}

void discovery_topic(const discovery_line *line, const device *of, uint16_t field,
                     char topic[DISCOVERY_TOPIC_BYTES])
{
    char node[ID_BYTES];

    line_id(line, node);
    snprintf(topic, DISCOVERY_TOPIC_BYTES, "%s/%s/%s/%s/config", line->prefix,
             component_of(of, field), node, of->fields[field].identifier);
}

/* --- its message --- */

/* The greatest numbers that a type holds, as Home Assistant's floats show them exactly. */
static void range_of(const mbm_planField *planned, double *least, double *most)
{
    static const double EXACT = 9007199254740992.0, FLOAT = 3.4028234663852886e38, HALF = 65504;
    const value_range range = value_range_of(planned->type);

    if (planned->type == MBM_TYPE_BIT) {
        *least = 0;
        *most = (double)((1u << planned->count) - 1);
    } else if (value_is_float(planned->type)) {
        *most = planned->type == VALUE_FLOAT16 ? HALF : FLOAT;
        *least = -*most;
    } else {
        *least = range.below_zero > 0 ? -fmin((double)range.below_zero, EXACT) : 0;
        *most = fmin((double)range.most, EXACT);
    }
}

/* Adds what a number may be: what its type holds, or the limits of the file. */
static void add_range(cJSON *to, const device_field *field, const mbm_planField *planned)
{
    const int is_float = value_is_float(planned->type);
    const double scale = field->form.scale.digits != 0 ? field->form.scale.value : 1;
    const conversion *of = field->conversion;
    /* The device may change a power of ten. */
    const double factor = field->power_name ? pow(10, DEVICE_POWER) : is_float ? 1 : scale;
    double one, other, least, most, step = is_float || field->power_name ? 0.001 : fabs(scale);

    range_of(planned, &one, &other);
    /* A negative scale turns the range. */
    least = fmin(one * factor, other * factor);
    most = fmax(one * factor, other * factor);
    if (of) {
        least = of->has_least ? of->least.value : least + of->offset.value;
        most = of->has_most ? of->most.value : most + of->offset.value;
        step = of->has_step ? of->step.value : step;
    }
    cJSON_AddNumberToObject(to, "min", least);
    cJSON_AddNumberToObject(to, "max", most);
    /* Home Assistant has no smaller step. */
    cJSON_AddNumberToObject(to, "step", fmax(step, 0.001));
    cJSON_AddStringToObject(to, "mode", "box");
}

static void add_topic(cJSON *to, const char *key, const discovery_line *line, const char *name,
                      const char *last)
{
    char topic[TOPIC_BYTES];

    snprintf(topic, sizeof topic, "%s/%s%s%s", line->topic, line->below, name, last);
    cJSON_AddStringToObject(to, key, topic);
}

/* Whether the bridge reads a field of the unit, and so knows whether it answers. */
static int is_read(const device *of, uint16_t unit)
{
    uint16_t field;

    for (field = 0; field < of->readable; field++)
        if (of->planned[field].unit == unit)
            return 1;
    return 0;
}

/* The entity is online while the bridge is connected and the unit answers. */
static void add_availability(cJSON *to, const discovery_line *line, const device *of,
                             const mbm_planField *planned)
{
    cJSON *list = cJSON_AddArrayToObject(to, "availability"), *one = cJSON_CreateObject();
    char topic[TOPIC_BYTES];

    snprintf(topic, sizeof topic, "%s/status", line->topic);
    cJSON_AddStringToObject(one, "topic", topic);
    cJSON_AddItemToArray(list, one);
    if (is_read(of, planned->unit)) {
        one = cJSON_CreateObject();
        snprintf(topic, sizeof topic, "%s/%sunit/%u/status", line->topic, line->below,
                 planned->unit);
        cJSON_AddStringToObject(one, "topic", topic);
        cJSON_AddItemToArray(list, one);
    }
    cJSON_AddStringToObject(to, "availability_mode", "all");
}

static void add_device(cJSON *to, const discovery_line *line, const device *of,
                       const mbm_planField *planned)
{
    cJSON *block = cJSON_AddObjectToObject(to, "device"), *ids;
    char id[ID_BYTES], text[ID_BYTES + 32];

    line_id(line, id);
    snprintf(text, sizeof text, "mbm_%s_%u", id, planned->unit);
    ids = cJSON_AddArrayToObject(block, "identifiers");
    cJSON_AddItemToArray(ids, cJSON_CreateString(text));
    snprintf(text, sizeof text, "%.250s unit %u", of->name ? of->name : id, planned->unit);
    cJSON_AddStringToObject(block, "name", text);
    if (of->name)
        cJSON_AddStringToObject(block, "model", of->name);
}

/* What Home Assistant makes of a payload of the bridge. */
static const char *template_of(const mbm_planField *planned, int is_plain)
{
    if (is_plain)
        return home_is_several(planned) ? "{{ value[:255] }}" : NULL;
    if (home_is_several(planned))
        return "{{ ((value_json.value or []) | join(','))[:255] }}";
    if (value_is_text(planned->type))
        return "{{ value_json.value or '' }}";
    return "{{ value_json.value }}";
}

/* --- the names of numbers --- */

/* Returns a text as a literal of JSON, for cJSON_free, or NULL without memory. */
static char *literal_of(const char *text)
{
    cJSON *string = cJSON_CreateString(text);
    char *literal = cJSON_PrintUnformatted(string);

    cJSON_Delete(string);
    return literal;
}

/* Writes a text as a literal of Jinja, which the literals of JSON are. */
static void write_literal(FILE *out, const char *text)
{
    char *literal = literal_of(text);

    fputs(literal ? literal : "\"\"", out);
    cJSON_free(literal);
}

/* A template looks up one of these: a number, as JSON or as a text, or a name. */
typedef enum lookup { BY_NUMBER, BY_TEXT, BY_NAME } lookup;

/* Adds a template: a table of numbers and names, and the `end` that looks one up. */
static void add_names(cJSON *to, const char *key, const device_field *one, lookup by,
                      const char *end)
{
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    uint16_t i;

    if (!out)
        return;
    fputs("{{ {", out);
    for (i = 0; i < one->label_count; i++) {
        const device_label *label = &one->labels[i];

        fputs(i == 0 ? "" : ", ", out);
        if (by == BY_NAME) {
            write_literal(out, label->name);
            fprintf(out, ": %s", label->number);
        } else {
            fprintf(out, by == BY_TEXT ? "\"%s\": " : "%s: ", label->number);
            write_literal(out, label->name);
        }
    }
    fprintf(out, "}%s }}", end);
    if (fclose(out) == 0)
        cJSON_AddStringToObject(to, key, text);
    free(text);
}

static void add_options(cJSON *to, const device_field *one)
{
    cJSON *list = cJSON_AddArrayToObject(to, "options");
    uint16_t i;

    for (i = 0; i < one->label_count; i++)
        cJSON_AddItemToArray(list, cJSON_CreateString(one->labels[i].name));
}

/* Adds the classes of an entity, its unit, and the names of its numbers. */
static void add_class(cJSON *to, const device_field *one, const mbm_planField *planned)
{
    const int component = home_component(one, planned), state = home_state_of(one, planned);
    const char *name = home_class_of(one, planned);

    if (component == HOME_SENSOR && home_has_names(one, planned))
        name = "enum";
    if (name)
        cJSON_AddStringToObject(to, "device_class", name);
    if (state != HOME_NO_STATE)
        cJSON_AddStringToObject(to, "state_class", home_states[state]);
    if (component != HOME_BUTTON && home_has_names(one, planned))
        add_options(to, one);
    else if (one->unit_of_measurement && home_is_number(one, planned) &&
             (component == HOME_SENSOR || component == HOME_NUMBER))
        cJSON_AddStringToObject(to, "unit_of_measurement", one->unit_of_measurement);
    if (component == HOME_SENSOR && home_is_number(one, planned) && one->conversion &&
        one->conversion->has_precision)
        cJSON_AddNumberToObject(to, "suggested_display_precision", one->conversion->precision);
}

/* Adds what a button sends: the value, of a text as a JSON string. */
static void add_press(cJSON *to, const device_field *one, const mbm_planField *planned)
{
    char *literal = literal_of(one->press);

    if (literal)
        cJSON_AddStringToObject(to, "payload_press",
                                value_is_text(planned->type) ? literal : one->press);
    cJSON_free(literal);
}

/* --- state and command --- */

static void add_state(cJSON *to, const discovery_line *line, const device *of, uint16_t field)
{
    const mbm_planField *planned = &of->planned[field];
    const int component = home_component(&of->fields[field], planned);
    const char *how = template_of(planned, line->is_plain);
    const char *on = line->is_plain ? "1" : "True", *off = line->is_plain ? "0" : "False";

    if (field >= of->readable)
        return;
    add_topic(to, "state_topic", line, of->fields[field].topic, "");
    if (home_has_names(&of->fields[field], &of->planned[field]))
        /* Home Assistant shows a number without a name as unknown. */
        add_names(to, "value_template", &of->fields[field], line->is_plain ? BY_TEXT : BY_NUMBER,
                  line->is_plain ? ".get(value)" : ".get(value_json.value)");
    else if (how)
        cJSON_AddStringToObject(to, "value_template", how);
    if (component == HOME_SWITCH) {
        cJSON_AddStringToObject(to, "state_on", on);
        cJSON_AddStringToObject(to, "state_off", off);
    } else if (component == HOME_BINARY_SENSOR) {
        cJSON_AddStringToObject(to, "payload_on", on);
        cJSON_AddStringToObject(to, "payload_off", off);
    }
}

static void add_command(cJSON *to, const discovery_line *line, const device *of, uint16_t field)
{
    const device_field *one = &of->fields[field];
    const mbm_planField *planned = &of->planned[field];

    if (!(one->access & DEVICE_WRITE))
        return;
    add_topic(to, "command_topic", line, one->topic, "/set");
    switch (home_component(one, planned)) {
    case HOME_NUMBER: add_range(to, one, planned); return;
    case HOME_SELECT: add_names(to, "command_template", one, BY_NAME, "[value]"); return;
    case HOME_BUTTON: add_press(to, one, planned); return;
    case HOME_SWITCH:
        cJSON_AddStringToObject(to, "payload_on", "ON");
        cJSON_AddStringToObject(to, "payload_off", "OFF");
        return;
    default: break;
    }
    if (!value_is_text(planned->type))
        return;
    cJSON_AddNumberToObject(to, "max", planned->count);
    /* A JSON string is the text, whatever its first character is. */
    cJSON_AddStringToObject(to, "command_template", "{{ value | to_json }}");
}

char *discovery_config(const discovery_line *line, const device *of, uint16_t field,
                       char topic[DISCOVERY_TOPIC_BYTES])
{
    const device_field *one = &of->fields[field];
    cJSON *root = cJSON_CreateObject(), *origin;
    char node[ID_BYTES], id[DISCOVERY_TOPIC_BYTES];
    char *text;

    discovery_topic(line, of, field, topic);
    line_id(line, node);
    snprintf(id, sizeof id, "mbm_%s_%s", node, one->identifier);
    cJSON_AddStringToObject(root, "name", one->name);
    cJSON_AddStringToObject(root, "unique_id", id);
    add_state(root, line, of, field);
    add_command(root, line, of, field);
    add_class(root, one, &of->planned[field]);
    add_availability(root, line, of, &of->planned[field]);
    add_device(root, line, of, &of->planned[field]);
    origin = cJSON_AddObjectToObject(root, "origin");
    cJSON_AddStringToObject(origin, "name", "mbm bridge");
    cJSON_AddStringToObject(origin, "sw_version", mbm_version());
    text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}
