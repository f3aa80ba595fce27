/* Reads the lines, the map of units and the settings of a gateway, and its file. */
#include "gateway_file.h"

#include "numbers.h"
#include "report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_LINE = 1500, LONGEST_UNITS = 1023 };

enum {
    LISTEN,
    CONNECTIONS,
    REQUESTS,
    IDLE,
    QUEUE_TIME,
    QUIET_TIME,
    IN_FLIGHT,
    REPLACE_AFTER,
    THE_LINES,
    GATEWAY_REACH,
    GATEWAY_KEYS = GATEWAY_REACH + REACH_FILE_KEYS
};
static const char *const GATEWAY_NAMES[] = {
    "listen",    "connections",   "requests", "idle",           "queue_time", "quiet_time",
    "in_flight", "replace_after", "lines",    REACH_FILE_NAMES, NULL};
enum {
    LINE,
    UNITS,
    LINE_QUIET_TIME,
    LINE_IN_FLIGHT,
    LINE_REPLACE_AFTER,
    LINE_REACH,
    LINE_KEYS = LINE_REACH + REACH_FILE_KEYS
};
static const char *const LINE_NAMES[] = {
    "line", "units", "quiet_time", "in_flight", "replace_after", REACH_FILE_NAMES, NULL};

/* --- the map of units --- */

/* Reads a number from 0 to 255. Returns what follows it, or NULL. */
static const char *read_unit(const char *text, unsigned *unit)
{
    const size_t digits = strspn(text, "0123456789");

    *unit = digits > 0 && digits <= 3 ? (unsigned)strtoul(text, NULL, 10) : 256;
    return *unit <= 255 ? text + digits : NULL;
}

/* Adds FIRST[-LAST][=UNIT]. Returns NULL, or what is wrong with it. */
static const char *add_route(gateway_setup *to, const char *text)
{
    unsigned first, last, unit, i;

    if (to->route_count == UINT8_MAX)
        return "a gateway has at most 255 ranges";
    text = read_unit(text, &first);
    last = first;
    if (text && *text == '-')
        text = read_unit(text + 1, &last);
    unit = first;
    if (text && *text == '=')
        text = read_unit(text + 1, &unit);
    if (!text || *text)
        return "units are FIRST-LAST or FIRST-LAST=UNIT, from 0 to 255, such as 1-31 or 101-131=1";
    if (first > last)
        return "the first unit of a range is above its last one";
    if (unit == 0 && first > 0 && to->lines[to->line_count - 1].place.framing != MBM_FRAMING_TCP)
        return "0 on a line is a broadcast, which no device answers, except on a line tcp://. "
               "Elsewhere only 0 of clients leads there, as 0=0";
    if (unit + last - first > 255)
        return "the last unit of the range would be above 255 on the line";
    for (i = 0; i < to->route_count; i++)
        if (first <= to->routes[i].last && last >= to->routes[i].first)
            return "a range before has one of these units";
    if (unit == 0 && first > 0)
        unit = MBM_GATEWAY_UNIT_0;
    to->routes[to->route_count++] = (mbm_gatewayRoute){
        (uint16_t)first, (uint16_t)last, (uint8_t)(to->line_count - 1), (uint16_t)unit};
    return NULL;
}

const char *gateway_setup_units(gateway_setup *to, const char *text)
{
    char copy[LONGEST_UNITS + 1], *rest = NULL, *range;
    const char *wrong = NULL;

    if (strlen(text) >= sizeof copy || !*text || text[strlen(text) - 1] == ',')
        wrong = "units are ranges with commas between them, such as 1-31,101-131=1";
    snprintf(copy, sizeof copy, "%s", text);
    for (range = strtok_r(copy, ",", &rest); range && !wrong; range = strtok_r(NULL, ",", &rest))
        wrong = add_route(to, range);
    return wrong ? say("\"%s\": %s", text, wrong) : NULL;
}

/* --- lines --- */

const char *gateway_setup_line(gateway_setup *to, const char *text)
{
    const char *wrong;
    uint8_t i;

    if (to->line_count == GATEWAY_LINES)
        return say("\"%s\" is one line too many: %d are allowed", text, GATEWAY_LINES);
    for (i = 0; i < to->line_count; i++)
        if (strcmp(to->lines[i].text, text) == 0)
            return say("the line %s is there twice", text);
    to->lines[i].text = strdup(text);
    if (!to->lines[i].text)
        return REPORT_NO_MEMORY;
    to->line_count++;
    to->lines[i].pace = (gateway_pace){0};
    wrong = place_read(&to->lines[i].place, to->lines[i].text, 0);
    if (!wrong && (to->lines[i].place.kind == PLACE_UDP || to->lines[i].place.kind == PLACE_TLS))
        wrong = "a line of a gateway is rtu:, ascii:, tcp:// or rtu+tcp://";
    return wrong;
}

const char *gateway_setup_reach(gateway_setup *to, unsigned index, const reach *more,
                                const char *dash)
{
    const reach_line has = place_reach(&to->lines[index].place, to->lines[index].pace.in_flight);
    reach own = *more;

    /* What the lines share is for those that can have it. */
    (void)reach_fit(&own, &has);
    reach_fill(&to->lines[index].place.reach, &own);
    return reach_check(&to->lines[index].place.reach, &has, dash);
}

const char *gateway_setup_listen(gateway_setup *to, const char *text)
{
    const char *wrong;

    to->listen_text = strdup(text);
    if (!to->listen_text)
        return REPORT_NO_MEMORY;
    wrong = place_read(&to->listen, to->listen_text, 1);
    if (wrong || to->listen.kind == PLACE_TCP)
        return wrong;
    return say("\"%s\": a gateway listens at tcp://, such as tcp://:502", text);
}

/* --- the file --- */

/* Reads the settings that a line may have of its own. The keys follow each other. */
static int read_pace(yaml_file *file, const yaml_node_t *const *values, gateway_pace *pace)
{
    return yaml_file_time(file, "quiet_time", values[0], 0, UINT16_MAX, &pace->quietMs) &&
           yaml_file_number(file, "in_flight", values[1], 1, MBM_CLIENT_DEPTH, &pace->in_flight) &&
           yaml_file_number(file, "replace_after", values[2], 0, 100, &pace->replace_after);
}

static int read_line(yaml_file *file, const yaml_node_t *node, gateway_setup *into)
{
    const yaml_node_t *values[LINE_KEYS] = {NULL};
    reach own = {0};
    const char *text, *wrong;

    if (!yaml_file_keys(file, "the line", node, LINE_NAMES, 1u << LINE | 1u << UNITS, values))
        return 0;
    text = yaml_file_text(file, "line", values[LINE], LONGEST_LINE);
    if (!text)
        return 0;
    wrong = gateway_setup_line(into, text);
    if (wrong)
        return yaml_file_refuse(file, values[LINE], "line: %s", wrong);
    text = yaml_file_text(file, "units", values[UNITS], LONGEST_UNITS);
    if (!text)
        return 0;
    wrong = gateway_setup_units(into, text);
    if (wrong)
        return yaml_file_refuse(file, values[UNITS], "units: %s", wrong);
    into->lines[into->line_count - 1].pace = into->pace;
    if (!read_pace(file, &values[LINE_QUIET_TIME], &into->lines[into->line_count - 1].pace) ||
        !reach_read_nodes(file, values + LINE_REACH, &own))
        return 0;
    reach_fill(&into->lines[into->line_count - 1].place.reach, &own);
    wrong = gateway_setup_reach(into, into->line_count - 1u, &into->reach, "");
    return wrong ? yaml_file_refuse(file, node, "%s", wrong) : 1;
}

static int read_root(yaml_file *file, const yaml_node_t *root, void *setup)
{
    gateway_setup *into = (gateway_setup *)setup;
    const yaml_node_t *values[GATEWAY_KEYS] = {NULL};
    const char *text, *wrong;
    size_t count, at;

    if (!yaml_file_keys(file, "the file", root, GATEWAY_NAMES, 1u << LISTEN | 1u << THE_LINES,
                        values))
        return 0;
    text = yaml_file_text(file, "listen", values[LISTEN], LONGEST_LINE);
    if (!text)
        return 0;
    wrong = gateway_setup_listen(into, text);
    if (wrong)
        return yaml_file_refuse(file, values[LISTEN], "listen: %s", wrong);
    if (!yaml_file_number(file, "connections", values[CONNECTIONS], 1, GATEWAY_CONNECTIONS,
                          &into->connections) ||
        !yaml_file_number(file, "requests", values[REQUESTS], 1, GATEWAY_REQUESTS,
                          &into->requests) ||
        !yaml_file_time(file, "idle", values[IDLE], 0, 1000000000, &into->idleMs) ||
        !yaml_file_time(file, "queue_time", values[QUEUE_TIME], 0, UINT16_MAX, &into->queueMs) ||
        !read_pace(file, &values[QUIET_TIME], &into->pace) ||
        !reach_read_nodes(file, values + GATEWAY_REACH, &into->reach))
        return 0;
    count = yaml_file_items(file, "lines", values[THE_LINES], GATEWAY_LINES);
    for (at = 0; at < count; at++)
        if (!read_line(file, yaml_file_item(file, values[THE_LINES], at), into))
            return 0;
    return count > 0;
}

int gateway_file_read(gateway_setup *into, const char *path)
{
    return yaml_file_read(path, read_root, into, into->wrong);
}

void gateway_setup_free(gateway_setup *setup)
{
    while (setup->line_count > 0)
        free(setup->lines[--setup->line_count].text);
    free(setup->listen_text);
    setup->listen_text = NULL;
    setup->route_count = 0;
}
