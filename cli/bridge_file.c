/* Checks and keeps the settings of a bridge, from options or a file, and reads that file. */
#include "bridge_file.h"

#include "device_plan.h"
#include "numbers.h"
#include "report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_LINE = 1500, LONGEST_VALUE = 1000, LONGEST_PREFIX = 50 };

const char *const bridge_names[] = {
    "broker",         "topic", "id",         "user",           "ca",
    "cert",           "key",   "keep_alive", "discovery",      "discovery_prefix",
    "plain",          "all",   "gap",        "write_function", "lines",
    REACH_FILE_NAMES, NULL};

enum { LINE, THE_FILE, LINE_TOPIC, LINE_REACH, LINE_KEYS = LINE_REACH + REACH_FILE_KEYS };
static const char *const LINE_NAMES[] = {"line", "file", "topic", REACH_FILE_NAMES, NULL};
static const char *const DISCOVERIES[] = {"homeassistant", NULL};

/* --- settings --- */

/* Reads HOST, HOST:PORT, [IPV6] or [IPV6]:PORT. `host` may be NULL. */
static const char *read_broker(const char *text, char *host, size_t capacity, int *port)
{
    const char *end = *text == '[' ? strchr(text, ']') : NULL;
    const char *colon = strchr(end ? end : text, ':'), *wrong;
    size_t length;
    int64_t number = 0;

    if (strpbrk(text, ", /@") || (colon && (strchr(colon + 1, ':') || (end && colon != end + 1))))
        return say("\"%s\" is not HOST or HOST:PORT; an IPv6 address needs brackets, such as "
                   "[::1]:1883",
                   text);
    wrong = colon ? number_read(colon + 1, 1, 65535, &number) : NULL;
    if (wrong)
        return say("its port %s", wrong);
    length = end ? (size_t)(end - text - 1) : colon ? (size_t)(colon - text) : strlen(text);
    if (length == 0)
        return say("\"%s\" has no host", text);
    if (host) {
        snprintf(host, capacity, "%.*s", (int)length, text + (end != NULL));
        *port = (int)number;
    }
    return NULL;
}

static const char *check_topic(const char *text)
{
    if (strlen(text) <= BROKER_TOPIC_BYTES && *text && !strpbrk(text, "+#"))
        return NULL;
    return say("\"%s\" is not 1 to %d bytes without + and #", text, BROKER_TOPIC_BYTES);
}

static const char *check_value(int setting, const char *text)
{
    uint32_t milliseconds;
    int64_t number;
    uint8_t is_yes;
    int index;

    switch (setting) {
    case BRIDGE_BROKER: return read_broker(text, NULL, 0, NULL);
    case BRIDGE_TOPIC: return check_topic(text);
    case BRIDGE_KEEP_ALIVE: return number_time(text, 5000, 3600000, &milliseconds);
    case BRIDGE_DISCOVERY: return number_word(text, DISCOVERIES, &index);
    case BRIDGE_DISCOVERY_PREFIX:
        if (strlen(text) > LONGEST_PREFIX || !*text || strpbrk(text, "+# "))
            return say("\"%s\" is not 1 to %d bytes without +, # and space", text, LONGEST_PREFIX);
        return NULL;
    case BRIDGE_PLAIN:
    case BRIDGE_ALL: return number_answer(text, &is_yes);
    case BRIDGE_GAP: return number_read(text, 0, 123, &number);
    case BRIDGE_WRITE_FUNCTION: return number_word(text, device_functions, &index);
    default: return NULL;
    }
}

const char *bridge_setup_value(bridge_setup *to, int setting, const char *text)
{
    const char *wrong = check_value(setting, text);
    char *copy;

    if (wrong)
        return wrong;
    copy = strdup(text);
    if (!copy)
        return REPORT_NO_MEMORY;
    free(to->values[setting]);
    to->values[setting] = copy;
    return NULL;
}

const char *bridge_setup_check(const bridge_setup *of, const char *dash)
{
    char *const *values = of->values;

    if (!values[BRIDGE_CA] && (values[BRIDGE_CERT] || values[BRIDGE_KEY]))
        return say("%scert and %skey need %sca", dash, dash, dash);
    if (!values[BRIDGE_CERT] != !values[BRIDGE_KEY])
        return say("%scert and %skey need each other", dash, dash);
    if (values[BRIDGE_DISCOVERY_PREFIX] && !values[BRIDGE_DISCOVERY])
        return say("a prefix of discovery needs %sdiscovery", dash);
    return NULL;
}

int bridge_setup_options(const bridge_setup *of, broker_options *to)
{
    static bridge_setup copy;
    static char host[256];
    char *const *values = copy.values;
    uint32_t milliseconds = 0;

    if (!bridge_setup_copy(&copy, of))
        return 0;
    *to = (broker_options){.host = "localhost",
                           .topic = values[BRIDGE_TOPIC] ? values[BRIDGE_TOPIC] : "modbus",
                           .id = values[BRIDGE_ID],
                           .user = values[BRIDGE_USER],
                           .ca_file = values[BRIDGE_CA],
                           .cert_file = values[BRIDGE_CERT],
                           .key_file = values[BRIDGE_KEY]};
    if (values[BRIDGE_BROKER]) {
        (void)read_broker(values[BRIDGE_BROKER], host, sizeof host, &to->port);
        to->host = host;
    }
    if (to->port == 0)
        to->port = to->ca_file ? 8883 : 1883;
    if (values[BRIDGE_KEEP_ALIVE])
        (void)number_time(values[BRIDGE_KEEP_ALIVE], 5000, 3600000, &milliseconds);
    to->keep_alive = (int)(milliseconds / 1000);
    return 1;
}

int bridge_setup_gap(const bridge_setup *of)
{
    const char *text = of->values[BRIDGE_GAP];

    return text ? (int)strtoul(text, NULL, 10) : DEVICE_PLAN_OWN_GAP;
}

uint8_t bridge_setup_function(const bridge_setup *of)
{
    const char *text = of->values[BRIDGE_WRITE_FUNCTION];
    int index = -1;

    if (text)
        (void)number_word(text, device_functions, &index);
    return (uint8_t)(index + 1);
}

int bridge_setup_is(const bridge_setup *of, int setting)
{
    const char *value = of->values[setting];
    uint8_t is_yes = 0;

    if (value)
        (void)number_answer(value, &is_yes);
    return is_yes;
}

/* --- lines --- */

/* The name of a file without folders and without its end, such as meter of /etc/meter.yaml. */
static void stem_of(const char *path, char stem[LONGEST_VALUE])
{
    const char *slash = strrchr(path, '/');
    char *dot;

    snprintf(stem, LONGEST_VALUE, "%s", slash ? slash + 1 : path);
    dot = strrchr(stem, '.');
    if (dot && dot > stem)
        *dot = '\0';
}

/* Whether one topic is the other, or its beginning. */
static int overlap(const char *one, const char *other)
{
    const size_t length = strlen(one) < strlen(other) ? strlen(one) : strlen(other);
    const char *longer = strlen(one) < strlen(other) ? other : one;

    return strncmp(one, other, length) == 0 && (longer[length] == '\0' || longer[length] == '/');
}

/* Whether it is a topic by the rule of names. */
static int is_topic(const char *text)
{
    char *topic = names_topic(text);
    const int is_same = topic && strcmp(topic, text) == 0;

    free(topic);
    return is_same && names_levels(text) <= NAMES_LEVELS;
}

static const char *check_line_topic(const bridge_setup *of, const char *topic)
{
    uint8_t i;

    if (!is_topic(topic))
        return say("the topic \"%s\" of the line has a space, + or #, begins with /, has more than "
                   "%d levels, or is one of the bridge's own: NAME/set, NAME/result, status, "
                   "unit/N/status",
                   topic, NAMES_LEVELS);
    if (strlen(topic) > BRIDGE_TOPIC_BYTES)
        return say("the topic of the line has more than %d bytes", BRIDGE_TOPIC_BYTES);
    for (i = 0; i < of->line_count; i++)
        if (overlap(topic, of->lines[i].topic))
            return say(
                "the topic \"%s\" of the line is, or begins, or goes on, the topic \"%s\" of "
                "one before",
                topic, of->lines[i].topic);
    return NULL;
}

static const char *add_line(bridge_setup *to, const char *name, const char *path, const char *topic)
{
    const uint8_t at = to->line_count;
    const char *wrong = *topic ? check_line_topic(to, topic) : NULL;

    if (wrong)
        return wrong;
    to->lines[at].text = strdup(name);
    to->lines[at].path = strdup(path);
    to->lines[at].topic = strdup(topic);
    to->line_count++;
    if (!to->lines[at].text || !to->lines[at].path || !to->lines[at].topic)
        return REPORT_NO_MEMORY;
    return place_read(&to->lines[at].place, to->lines[at].text, 0);
}

const char *bridge_setup_line(bridge_setup *to, const char *name, const char *path,
                              const char *topic)
{
    char stem[LONGEST_VALUE], *made;
    const char *wrong;

    if (to->line_count == BRIDGE_LINES)
        return say("\"%s\" is one line too many: %d are allowed", name, BRIDGE_LINES);
    if (topic)
        return add_line(to, name, path, topic);
    stem_of(path, stem);
    made = names_topic(stem);
    wrong = made ? add_line(to, name, path, made) : REPORT_NO_MEMORY;
    free(made);
    return wrong;
}

/* --- the file --- */

/* The path of a device file: relative to the folder of the file that names it. */
static void join_path(const char *of, const char *path, char full[2 * LONGEST_VALUE])
{
    const char *slash = strrchr(of, '/');

    if (*path == '/' || !slash)
        snprintf(full, 2 * LONGEST_VALUE, "%s", path);
    else
        snprintf(full, 2 * LONGEST_VALUE, "%.*s/%s", (int)(slash - of < 900 ? slash - of : 900), of,
                 path);
}

/* Reads what the device needs. The name of the line counts first, and `shared` last. */
static int read_reach(yaml_file *file, const yaml_node_t *node, const yaml_node_t *const *values,
                      const reach *shared, place *into)
{
    const reach_line has = place_reach(into, 1);
    reach own = {0}, rest = *shared;
    const char *wrong;

    if (!reach_read_nodes(file, values, &own))
        return 0;
    (void)reach_fit(&rest, &has);
    reach_fill(&into->reach, &own);
    reach_fill(&into->reach, &rest);
    wrong = reach_check(&into->reach, &has, "");
    return wrong ? yaml_file_refuse(file, node, "%s", wrong) : 1;
}

static int read_line(yaml_file *file, const yaml_node_t *node, bridge_setup *into)
{
    const yaml_node_t *values[LINE_KEYS] = {NULL};
    const char *text, *path, *topic = NULL, *wrong;
    char full[2 * LONGEST_VALUE];

    if (!yaml_file_keys(file, "the line", node, LINE_NAMES, 1u << LINE | 1u << THE_FILE, values))
        return 0;
    text = yaml_file_text(file, "line", values[LINE], LONGEST_LINE);
    path = text ? yaml_file_text(file, "file", values[THE_FILE], LONGEST_VALUE) : NULL;
    if (!path)
        return 0;
    if (values[LINE_TOPIC]) {
        topic = yaml_file_text(file, "topic", values[LINE_TOPIC], LONGEST_VALUE);
        if (!topic)
            return 0;
    }
    join_path(file->path, path, full);
    wrong = bridge_setup_line(into, text, full, topic);
    if (wrong)
        return yaml_file_refuse(file, node, "%s", wrong);
    return read_reach(file, node, values + LINE_REACH, &into->reach,
                      &into->lines[into->line_count - 1].place);
}

static int read_root(yaml_file *file, const yaml_node_t *root, void *setup)
{
    bridge_setup *into = (bridge_setup *)setup;
    const yaml_node_t *values[BRIDGE_KEYS] = {NULL};
    const char *text, *wrong;
    size_t count, at;
    int setting;

    if (!yaml_file_keys(file, "the file", root, bridge_names, 1u << BRIDGE_THE_LINES, values))
        return 0;
    for (setting = 0; setting < BRIDGE_SETTINGS; setting++) {
        if (!values[setting])
            continue;
        text = setting == BRIDGE_GAP
                   ? yaml_file_decimal(file, bridge_names[setting], values[setting])
                   : yaml_file_text(file, bridge_names[setting], values[setting], LONGEST_VALUE);
        if (!text)
            return 0;
        wrong = bridge_setup_value(into, setting, text);
        if (wrong)
            return yaml_file_refuse(file, values[setting], "%s: %s", bridge_names[setting], wrong);
    }
    wrong = bridge_setup_check(into, "");
    if (wrong)
        return yaml_file_refuse(file, root, "%s", wrong);
    if (!reach_read_nodes(file, values + BRIDGE_REACH, &into->reach))
        return 0;
    count = yaml_file_items(file, "lines", values[BRIDGE_THE_LINES], BRIDGE_LINES);
    for (at = 0; at < count; at++)
        if (!read_line(file, yaml_file_item(file, values[BRIDGE_THE_LINES], at), into))
            return 0;
    return count > 0;
}

int bridge_file_read(bridge_setup *into, const char *path)
{
    return yaml_file_read(path, read_root, into, into->wrong);
}

/* --- memory --- */

int bridge_setup_copy(bridge_setup *to, const bridge_setup *from)
{
    int i;

    memset(to, 0, sizeof *to);
    for (i = 0; i < BRIDGE_SETTINGS; i++)
        if (from->values[i] && bridge_setup_value(to, i, from->values[i]))
            return 0;
    for (i = 0; i < from->line_count; i++) {
        if (bridge_setup_line(to, from->lines[i].text, from->lines[i].path, from->lines[i].topic))
            return 0;
        to->lines[i].place.reach = from->lines[i].place.reach;
    }
    return 1;
}

void bridge_setup_free(bridge_setup *setup)
{
    int i;

    for (i = 0; i < BRIDGE_SETTINGS; i++)
        free(setup->values[i]);
    for (i = 0; i < setup->line_count; i++) {
        free(setup->lines[i].text);
        free(setup->lines[i].path);
        free(setup->lines[i].topic);
    }
    memset(setup, 0, sizeof *setup);
}
