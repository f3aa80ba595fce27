/* Imports the YAML of Home Assistant's integration modbus: the keys of its documentation. */
#include "import.h"

#include "numbers.h"
#include "report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const import_words TABLES[] = {
    {"holding", "holding"}, {"holdings", "holding"},        {"input", "input"}, {"coil", "coils"},
    {"coils", "coils"},     {"discrete_input", "discrete"}, {NULL, NULL}};
static const import_words TYPES[] = {
    {"int16", "int16"},     {"int32", "int32"},   {"int64", "int64"},   {"uint16", "uint16"},
    {"uint32", "uint32"},   {"uint64", "uint64"}, {"float32", "float"}, {"float64", "double"},
    {"float16", "float16"}, {"string", "text"},   {"custom", "custom"}, {NULL, NULL}};
static const import_words ORDERS[] = {
    {"byte", "BADC"}, {"word", "CDAB"}, {"word_byte", "DCBA"}, {"none", ""}, {NULL, NULL}};
/* One letter of Python's struct, of big-endian values. */
static const import_words STRUCTURES[] = {{">h", "int16"},  {">H", "uint16"},  {">i", "int32"},
                                          {">I", "uint32"}, {">l", "int32"},   {">L", "uint32"},
                                          {">q", "int64"},  {">Q", "uint64"},  {">f", "float"},
                                          {">d", "double"}, {">e", "float16"}, {NULL, NULL}};

/* How many registers a value of a type has; 0 of a text. */
static unsigned registers_of(const char *type)
{
    return strcmp(type, "text") == 0                           ? 0
           : strstr(type, "64") || strcmp(type, "double") == 0 ? 4
           : strstr(type, "32") || strcmp(type, "float") == 0  ? 2
                                                               : 1;
}

static int is_true(const char *text)
{
    return text && (strcasecmp(text, "true") == 0 || strcasecmp(text, "yes") == 0 ||
                    strcasecmp(text, "on") == 0);
}

/* --- what every entity has --- */

/* Begins a field with what every entity has: unit and interval. `more` follows the name. */
static unsigned begin(import *j, tree *entity, const char *more)
{
    const char *unit = tree_text(entity, "device_address", tree_text(entity, "slave", NULL));
    const char *interval = tree_text(entity, "scan_interval", NULL);
    const unsigned field =
        import_field(j, entity->line, say("%s%s", tree_text(entity, "name", "field"), more));

    /* Home Assistant knows an entity by it; mbm makes one of its own. */
    (void)tree_find(entity, "unique_id");
    if (unit)
        import_set(j, field, tree_line(entity, "slave"), "unit", "%s", unit);
    if (interval && strcmp(interval, "0") == 0)
        import_lose(j, tree_line(entity, "scan_interval"), import_name(j, field),
                    "scan_interval 0, which is no polling, is not taken over");
    else if (interval)
        import_set(j, field, tree_line(entity, "scan_interval"), "interval", "%ss", interval);
    return field;
}

static void set_place(import *j, unsigned field, int line, const char *table, const char *address)
{
    import_set(j, field, line, "table", "%s", table);
    import_set(j, field, line, "address", "%s", address);
}

/* Copies keys that both have, as texts or as they are. */
static void copy_key(import *j, unsigned field, tree *entity, const char *theirs, const char *ours)
{
    const char *text = tree_text(entity, theirs, NULL);

    if (text)
        import_set_text(j, field, tree_line(entity, theirs), ours, text);
}

/* Copies a number as it is: YAML of Home Assistant has them as 0.1, 1e-3 and "0.1". */
static void copy_number(import *j, unsigned field, tree *entity, const char *theirs,
                        const char *ours, double neutral)
{
    const char *text = tree_text(entity, theirs, NULL);
    char *end;

    if (text && (strtod(text, &end) != neutral || *end))
        import_set(j, field, tree_line(entity, theirs), ours, "%s", text);
}

/* --- values in registers --- */

/* Returns our type of an entity, or NULL after naming why there is none. */
static const char *type_of(import *j, tree *entity, const char *name)
{
    const char *theirs = tree_text(entity, "data_type", "int16");
    const char *structure = tree_text(entity, "structure", NULL);
    const char *type = import_word(TYPES, theirs);

    if (type && strcmp(type, "custom") == 0)
        type = structure ? import_word(STRUCTURES, structure) : NULL;
    if (!type)
        import_lose(j, tree_line(entity, structure ? "structure" : "data_type"), name,
                    "the data_type %s%s%s has no counterpart: the field is left out", theirs,
                    structure ? " " : "", structure ? structure : "");
    return type;
}

/* Sets type, count, order, scale and the like. Returns 0 if the field has no type here. */
static int set_value(import *j, unsigned field, tree *entity, const char *scale, const char *offset)
{
    const char *precision = tree_text(entity, "precision", NULL);
    const char *name = import_name(j, field), *type = type_of(j, entity, name);
    const char *swap = tree_text(entity, "swap", "none"), *order = import_word(ORDERS, swap);
    const char *count = tree_text(entity, "count", NULL);
    const int line = tree_line(entity, "count");

    if (!type)
        return 0;
    import_set(j, field, tree_line(entity, "data_type"), "type", "%s", type);
    if (strcmp(type, "text") == 0)
        import_set(j, field, line, "count", "%lu", 2 * strtoul(count ? count : "1", NULL, 10));
    else if (count && strtoul(count, NULL, 10) != registers_of(type))
        import_lose(j, line, name, "count %s is not the %u registers of %s", count,
                    registers_of(type), type);
    if (order && *order)
        import_set(j, field, tree_line(entity, "swap"), "order", "%s", order);
    copy_number(j, field, entity, scale, "scale", 1);
    copy_number(j, field, entity, offset, "offset", 0);
    if (precision)
        import_set(j, field, tree_line(entity, "precision"), "precision", "%s", precision);
    return 1;
}

/* --- sensors --- */

/* Repeats a field for a device whose values follow each other. Home Assistant numbers them from the
 * second one on. */
static void set_repetition(import *j, unsigned field, tree *entity, unsigned every)
{
    const char *count = tree_text(entity, "virtual_count", tree_text(entity, "slave_count", NULL));
    const unsigned long more = count ? strtoul(count, NULL, 10) : 0;

    if (more > 0)
        import_set(j, field, entity->line, "repeat", "{count: %lu, every: %u, first: 0}", more + 1,
                   every);
}

static unsigned every_of(import *j, unsigned field)
{
    unsigned k, every = 1;

    for (k = 0; k < j->fields[field].count; k++) {
        const import_pair *pair = &j->fields[field].pairs[k];

        if (strcmp(pair->key, "type") == 0 && strcmp(pair->value, "text") != 0)
            every = registers_of(pair->value);
        if (strcmp(pair->key, "count") == 0)
            every = (unsigned)(strtoul(pair->value, NULL, 10) / 2);
    }
    return every;
}

static void import_sensor(import *j, tree *entity)
{
    const unsigned field = begin(j, entity, "");
    const char *table = import_word(TABLES, tree_text(entity, "input_type", "holding"));
    const char *nan = tree_text(entity, "nan_value", NULL);

    set_place(j, field, entity->line, table ? table : "holding", tree_text(entity, "address", ""));
    if (!set_value(j, field, entity, "scale", "offset")) {
        import_drop(j);
        return;
    }
    copy_key(j, field, entity, "unit_of_measurement", "unit_of_measurement");
    copy_key(j, field, entity, "device_class", "device_class");
    copy_key(j, field, entity, "state_class", "state_class");
    if (nan)
        import_set(j, field, tree_line(entity, "nan_value"), "not_available", "[%s]", nan);
    set_repetition(j, field, entity, every_of(j, field));
    import_lose_rest(j, entity, import_name(j, field));
}

static void import_binary_sensor(import *j, tree *entity)
{
    const unsigned field = begin(j, entity, "");
    const char *table = import_word(TABLES, tree_text(entity, "input_type", "coil"));
    const int is_register = table && (table[0] == 'h' || table[0] == 'i');

    set_place(j, field, entity->line, table ? table : "coils", tree_text(entity, "address", ""));
    if (is_register) {
        /* Home Assistant takes the lowest bit. */
        import_set(j, field, entity->line, "type", "bit");
        import_set(j, field, entity->line, "bit", "0");
    } else {
        set_repetition(j, field, entity, 1);
    }
    copy_key(j, field, entity, "device_class", "device_class");
    import_lose_rest(j, entity, import_name(j, field));
}

/* --- switches, lights and fans --- */

/* Sets the enumeration of two numbers, unless they are those of a bit. */
static void set_on_off(import *j, unsigned field, int line, const char *off, const char *on)
{
    import_set(j, field, line, "enumeration", "{%s: \"off\", %s: \"on\"}", off, on);
}

/* Imports where the state is, if that is another place. */
static void import_state(import *j, tree *entity, tree *verify, const char *table,
                         const char *address, const char *off, const char *on)
{
    const char *theirs = tree_text(verify, "input_type", NULL);
    const char *other_table = theirs ? import_word(TABLES, theirs) : table;
    const char *other = tree_text(verify, "address", address);
    unsigned field;

    if (!other_table || (strcmp(other_table, table) == 0 && strcmp(other, address) == 0))
        return;
    field = begin(j, entity, " state");
    set_place(j, field, verify->line, other_table, other);
    if (other_table[0] == 'h' || other_table[0] == 'i') {
        import_set(j, field, verify->line, "type", "uint16");
        set_on_off(j, field, verify->line, tree_text(verify, "state_off", off),
                   tree_text(verify, "state_on", on));
    }
}

static void import_switch(import *j, tree *entity)
{
    const unsigned field = begin(j, entity, "");
    const char *write_type = tree_text(entity, "write_type", "holding");
    const char *table = import_word(TABLES, write_type),
               *address = tree_text(entity, "address", "");
    const char *off = tree_text(entity, "command_off", "0"),
               *on = tree_text(entity, "command_on", "1");
    tree *verify = tree_find(entity, "verify");

    table = table ? table : "holding";
    set_place(j, field, entity->line, table, address);
    if (strcmp(table, "holding") == 0)
        import_set(j, field, entity->line, "type", "uint16");
    /* Without this key Home Assistant does not read it. */
    import_set(j, field, entity->line, "access", verify ? "read-write" : "write");
    if (strcmp(write_type, "holdings") == 0 || strcmp(write_type, "coils") == 0)
        import_set(j, field, tree_line(entity, "write_type"), "write_function", "multiple");
    if (strcmp(table, "holding") == 0)
        set_on_off(j, field, entity->line, off, on);
    else
        copy_key(j, field, entity, "device_class", "device_class");
    import_lose_rest(j, entity, import_name(j, field));
    if (verify && verify->kind == TREE_MAP) {
        import_state(j, entity, verify, table, address, off, on);
        import_lose_rest(j, verify, import_name(j, field));
    }
}

static void import_cover(import *j, tree *entity)
{
    const unsigned field = begin(j, entity, "");
    const char *table = import_word(TABLES, tree_text(entity, "input_type", "holding"));

    table = table ? table : "holding";
    set_place(j, field, entity->line, table, tree_text(entity, "address", ""));
    import_set(j, field, entity->line, "access", "read-write");
    if (strcmp(table, "holding") == 0) {
        import_set(j, field, entity->line, "type", "uint16");
        import_set(j, field, entity->line, "enumeration",
                   "{%s: closed, %s: open, %s: opening, %s: closing}",
                   tree_text(entity, "state_closed", "0"), tree_text(entity, "state_open", "1"),
                   tree_text(entity, "state_opening", "2"),
                   tree_text(entity, "state_closing", "3"));
    }
    import_lose_rest(j, entity, import_name(j, field));
}

/* --- climates --- */

/* The first of one number or a list of them. */
static const char *first_of(const tree *node)
{
    if (node && node->kind == TREE_LIST)
        node = node->first;
    return node && node->kind == TREE_WORD ? node->text : NULL;
}

/* Imports a register of modes: its address, and numbers with the names of their keys without the
 * beginning. */
static void import_modes(import *j, tree *entity, const char *key, const char *more,
                         const char *access)
{
    tree *modes = tree_find(entity, key), *values, *at;
    const char *address = modes ? first_of(tree_find(modes, "address")) : NULL;
    char text[800] = "{";
    size_t length = 1;
    unsigned field;

    if (!modes || modes->kind != TREE_MAP || !address)
        return;
    field = begin(j, entity, more);
    set_place(j, field, modes->line, tree_text(modes, "input_type", "holding"), address);
    import_set(j, field, modes->line, "type", "uint16");
    import_set(j, field, modes->line, "access", "%s", access);
    if (is_true(tree_text(modes, "write_registers", NULL)))
        import_set(j, field, modes->line, "write_function", "multiple");
    values = tree_find(modes, "values");
    for (at = values && values->kind == TREE_MAP ? values->first : NULL; at; at = at->next) {
        const char *number = first_of(at), *name = strchr(at->key, '_');

        if (!number || length + 80 > sizeof text)
            continue;
        if (name && strncmp(name, "_state_", 7) == 0)
            name += 6;
        else if (name && strncmp(name, "_mode_state_", 12) == 0)
            name += 11;
        length += (size_t)snprintf(text + length, sizeof text - length, "%s%.20s: %.50s",
                                   length > 1 ? ", " : "", number,
                                   import_quote(name ? name + 1 : at->key));
        if (at->kind == TREE_LIST && at->first && at->first->next)
            import_lose(j, at->line, import_name(j, field), "%s: only %s of several numbers",
                        at->key, number);
    }
    import_set(j, field, modes->line, "enumeration", "%s}", text);
    import_lose_rest(j, modes, import_name(j, field));
}

static void import_setpoint(import *j, tree *entity, const char *degrees)
{
    tree *target = tree_find(entity, "target_temp_register");
    const char *address = first_of(target);
    const char *scale = tree_peek(entity, "target_temp_scale") ? "target_temp_scale" : "scale";
    const char *offset = tree_peek(entity, "target_temp_offset") ? "target_temp_offset" : "offset";
    unsigned field;

    if (!address)
        return;
    field = begin(j, entity, " setpoint");
    set_place(j, field, target->line, "holding", address);
    if (!set_value(j, field, entity, scale, offset)) {
        import_drop(j);
        return;
    }
    import_set(j, field, target->line, "access", "read-write");
    import_set_text(j, field, target->line, "unit_of_measurement", degrees);
    import_set(j, field, tree_line(entity, "min_temp"), "min_value", "%s",
               tree_text(entity, "min_temp", "5"));
    import_set(j, field, tree_line(entity, "max_temp"), "max_value", "%s",
               tree_text(entity, "max_temp", "35"));
    import_set(j, field, tree_line(entity, "temp_step"), "step", "%s",
               tree_text(entity, "temp_step", "0.5"));
    if (is_true(tree_text(entity, "target_temp_write_registers", NULL)))
        import_set(j, field, target->line, "write_function", "multiple");
    if (target->kind == TREE_LIST && target->first && target->first->next)
        import_lose(j, target->line, import_name(j, field),
                    "target_temp_register: only the first of several registers");
}

static void import_switched(import *j, tree *entity)
{
    const char *address = tree_text(entity, "hvac_onoff_register", NULL);
    const char *coil = tree_text(entity, "hvac_onoff_coil", NULL);
    const char *on = tree_text(entity, "hvac_on_value", "1");
    const char *off = tree_text(entity, "hvac_off_value", "0");
    unsigned field;

    if (!address && !coil)
        return;
    field = begin(j, entity, " on");
    set_place(j, field, entity->line, coil ? "coils" : "holding", coil ? coil : address);
    import_set(j, field, entity->line, "access", "read-write");
    if (coil)
        return;
    import_set(j, field, entity->line, "type", "uint16");
    set_on_off(j, field, entity->line, off, on);
}

static void import_climate(import *j, tree *entity)
{
    const char *name = tree_text(entity, "name", "climate");
    const char *scale = tree_peek(entity, "current_temp_scale") ? "current_temp_scale" : "scale";
    const char *offset =
        tree_peek(entity, "current_temp_offset") ? "current_temp_offset" : "offset";
    const char *degrees =
        strcasecmp(tree_text(entity, "temperature_unit", "C"), "F") == 0 ? "\u00B0F" : "\u00B0C";
    const char *table = import_word(TABLES, tree_text(entity, "input_type", "holding"));
    const unsigned field = begin(j, entity, " temperature");

    set_place(j, field, entity->line, table ? table : "holding", tree_text(entity, "address", ""));
    if (set_value(j, field, entity, scale, offset))
        import_set_text(j, field, entity->line, "unit_of_measurement", degrees);
    else
        import_drop(j);
    import_setpoint(j, entity, degrees);
    import_switched(j, entity);
    if (is_true(tree_text(entity, "write_registers", NULL)))
        import_lose(j, tree_line(entity, "write_registers"), name,
                    "write_registers: say \"write_function: multiple\" where the device needs it");
    import_modes(j, entity, "hvac_mode_register", " mode", "read-write");
    import_modes(j, entity, "hvac_action_register", " action", "read");
    import_modes(j, entity, "fan_mode_register", " fan mode", "read-write");
    import_modes(j, entity, "swing_mode_register", " swing mode", "read-write");
    import_lose_rest(j, entity, name);
}

/* --- a hub --- */

static void import_each(import *j, tree *hub, const char *key, void (*import_one)(import *, tree *))
{
    tree *list = tree_find(hub, key), *at;

    for (at = tree_items(list); at; at = at->next)
        if (at->kind == TREE_MAP)
            import_one(j, at);
        else
            import_lose(j, at->line, key, "an item that is no map");
    if (list && list->kind == TREE_WORD && *list->text)
        import_lose(j, list->line, key, "%s: import that file by itself", list->text);
}

/* The name of the line, as the command line of mbm has it. */
static void make_line(import *j, tree *hub)
{
    const char *type = tree_text(hub, "type", ""), *port = tree_text(hub, "port", "502");
    const char *host = tree_text(hub, "host", ""), *method = tree_text(hub, "method", "rtu");
    const char *parity = tree_text(hub, "parity", "N"), *size = tree_text(hub, "bytesize", "8");
    const char *baud = tree_text(hub, "baudrate", "19200"), *stop = tree_text(hub, "stopbits", "1");

    if (strcmp(type, "serial") == 0)
        import_serial_line(j, method, port, baud, parity, stop, size);
    else
        import_line(j, "%s://%s:%s",
                    strcmp(type, "udp") == 0          ? "udp"
                    : strcmp(type, "rtuovertcp") == 0 ? "rtu+tcp"
                                                      : "tcp",
                    host, port);
}

/* Reads timeout, a number of seconds that may have a fraction. Without it, Home Assistant waits
 * five seconds. */
static void import_timeout(import *j, tree *hub)
{
    const double seconds = strtod(tree_text(hub, "timeout", "5"), NULL);
    char time[32];

    if (seconds >= 0.001 && seconds <= 1000)
        import_set(j, IMPORT_HEAD, tree_line(hub, "timeout"), "timeout", "%s",
                   number_time_text((uint32_t)(seconds * 1000 + 0.5), time));
    else
        import_lose(j, tree_line(hub, "timeout"), "timeout", "a timeout is from 1ms to 1000s");
}

static void import_hub(import *j, tree *hub)
{
    const char *name = tree_text(hub, "name", NULL), *delay = tree_text(hub, "delay", "0");
    const char *pause = tree_text(hub, "message_wait_milliseconds", "0");

    make_line(j, hub);
    if (name)
        import_set_text(j, IMPORT_HEAD, tree_line(hub, "name"), "device", name);
    import_set(j, IMPORT_HEAD, hub->line, "unit", "%u", j->has_unit ? j->unit : 1);
    /* What Home Assistant does without scan_interval. */
    import_set(j, IMPORT_HEAD, hub->line, "interval", "15s");
    if (strcmp(delay, "0") != 0)
        import_set(j, IMPORT_HEAD, tree_line(hub, "delay"), "delay", "%ss", delay);
    if (strcmp(pause, "0") != 0)
        import_set(j, IMPORT_HEAD, tree_line(hub, "message_wait_milliseconds"), "message_wait",
                   "%sms", pause);
    if (is_true(tree_text(hub, "close_comm_on_error", NULL)))
        import_set(j, IMPORT_HEAD, tree_line(hub, "close_comm_on_error"), "close", "error");
    import_timeout(j, hub);
    import_each(j, hub, "sensors", import_sensor);
    import_each(j, hub, "binary_sensors", import_binary_sensor);
    import_each(j, hub, "switches", import_switch);
    import_each(j, hub, "lights", import_switch);
    import_each(j, hub, "fans", import_switch);
    import_each(j, hub, "covers", import_cover);
    import_each(j, hub, "climates", import_climate);
    import_lose_rest(j, hub, "the hub");
}

/* Returns whether a hub is the one that --hub names. */
static int is_chosen(const import *j, const tree *hub)
{
    return !j->hub || tree_has(hub, "name", j->hub) || tree_has(hub, "host", j->hub) ||
           tree_has(hub, "port", j->hub);
}

/* Finds the hub: the one of the file, or the one that --hub names. NULL after a report. */
static tree *choose_hub(const import *j, tree *root)
{
    tree *found = tree_peek(root, "modbus"), *at, *chosen = NULL;
    unsigned count = 0;

    found = found ? found : root;
    if (found->kind == TREE_MAP) {
        chosen = found;
        count = 1;
    }
    for (at = tree_items(found); at; at = at->next)
        if (at->kind == TREE_MAP && is_chosen(j, at)) {
            chosen = at;
            count++;
        }
    if (count == 0)
        (void)report(CODE_WRONG, "%s: there is no hub%s%s%s of the integration modbus", j->path,
                     j->hub ? " \"" : "", j->hub ? j->hub : "", j->hub ? "\"" : "");
    else if (count > 1)
        (void)report(CODE_WRONG,
                     "%s: there are %u hubs%s: choose one with --hub, by its name, host "
                     "or port",
                     j->path, count, j->hub ? " of that name" : "");
    return count == 1 ? chosen : NULL;
}

int import_homeassistant(import *j)
{
    char wrong[YAML_FILE_WRONG_BYTES];
    int code;
    tree *root = tree_read_yaml(j->path, &code, wrong), *hub;

    if (!root)
        return report(code, "%s", wrong);
    hub = choose_hub(j, root);
    if (hub)
        import_hub(j, hub);
    tree_free(root);
    return hub ? CODE_DONE : CODE_WRONG;
}
