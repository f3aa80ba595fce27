/* Imports the TOML of telegraf's inputs.modbus, in its styles register, request and metric. */
#include "import.h"

#include "numbers.h"
#include "reach.h"
#include "report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A type of telegraf; the registers of a value, 0 for a text or for as many as there are addresses.
 */
typedef struct type_of_theirs {
    const char *theirs, *ours;
    unsigned registers;
} type_of_theirs;

static const type_of_theirs TYPES[] = {
    {"INT16", "int16", 1},     {"UINT16", "uint16", 1},        {"INT32", "int32", 2},
    {"UINT32", "uint32", 2},   {"INT64", "int64", 4},          {"UINT64", "uint64", 4},
    {"FLOAT16", "float16", 1}, {"FLOAT16-IEEE", "float16", 1}, {"FLOAT32-IEEE", "float", 2},
    {"FLOAT64", "double", 4},  {"FLOAT64-IEEE", "double", 4},  {"STRING", "text", 0},
    {"BIT", "bit", 1},
};

static const import_words ORDERS[] = {
    {"AB", "ABCD"},   {"ABCD", "ABCD"},     {"ABCDEFGH", "ABCD"}, {"BA", "BADC"},
    {"BADC", "BADC"}, {"BADCFEHG", "BADC"}, {"CDAB", "CDAB"},     {"GHEFCDAB", "CDAB"},
    {"DCBA", "DCBA"}, {"HGFEDCBA", "DCBA"}, {NULL, NULL},
};

/* Finds a type. FLOAT32 is a number with a fixed point in the style register, and a float in the
 * others; FIXED and UFIXED are such numbers, too. */
static const type_of_theirs *find_type(const char *theirs, unsigned addresses)
{
    static type_of_theirs fixed;
    const int is_fixed = strcmp(theirs, "FIXED") == 0;
    size_t i;

    if (addresses == 0 && strcmp(theirs, "FLOAT32") == 0)
        theirs = "FLOAT32-IEEE";
    if (is_fixed || strcmp(theirs, "UFIXED") == 0 || strcmp(theirs, "FLOAT32") == 0) {
        fixed = (type_of_theirs){theirs,
                                 addresses == 1   ? is_fixed ? "int16" : "uint16"
                                 : addresses == 2 ? is_fixed ? "int32" : "uint32"
                                 : addresses == 4 ? is_fixed ? "int64" : "uint64"
                                                  : NULL,
                                 addresses};
        return fixed.ours ? &fixed : NULL;
    }
    for (i = 0; i < sizeof TYPES / sizeof TYPES[0]; i++)
        if (strcmp(TYPES[i].theirs, theirs) == 0)
            return &TYPES[i];
    return NULL;
}

/* --- a field --- */

/* What a field takes from its request. */
typedef struct context {
    const char *table, *order, *unit, *measurement;
    const char *location; /* of the characters of a text in a register: lower, upper or both */
    int is_bits;
} context;

/* Begins a field: its name with the measurement before it, if that is another one than that of the
 * plugin. */
static unsigned begin(import *j, tree *from, const context *of)
{
    const char *measurement = tree_text(from, "measurement", of->measurement);
    const char *name = tree_text(from, "name", "field");
    const unsigned field =
        import_field(j, from->line, measurement ? say("%s %s", measurement, name) : name);

    if (of->unit)
        import_set(j, field, from->line, "unit", "%s", of->unit);
    import_set(j, field, from->line, "table", "%s", of->table);
    return field;
}

/* Sets type, count and order. Returns 0 if there is no such type here. */
static int set_type(import *j, unsigned field, tree *from, const char *theirs, unsigned addresses,
                    const char *byte_order, const char *location)
{
    const char *order = byte_order ? import_word(ORDERS, byte_order) : "ABCD";
    const int is_lower = strcmp(location, "lower") == 0, is_upper = strcmp(location, "upper") == 0;
    const type_of_theirs *type = find_type(theirs, addresses);
    const int is_byte = strcmp(theirs, "UINT8L") == 0 || strcmp(theirs, "UINT8H") == 0;
    const char *length = tree_text(from, "length", NULL), *bit = tree_text(from, "bit", NULL);

    if (is_byte) {
        import_set(j, field, from->line, "type", "bit");
        import_set(j, field, from->line, "bit", theirs[5] == 'L' ? "0" : "8");
        import_set(j, field, from->line, "count", "8");
        return 1;
    }
    if (!type) {
        import_lose(j, from->line, import_name(j, field),
                    "the type %s has no counterpart: the field is left out", theirs);
        return 0;
    }
    if (strcmp(type->ours, "text") == 0) {
        import_set(j, field, from->line, "type", "text%s",
                   is_lower   ? "_low"
                   : is_upper ? "_high"
                              : "");
        import_set(j, field, from->line, "count", "%lu",
                   (is_lower || is_upper ? 1 : 2) *
                       (length ? strtoul(length, NULL, 10) : addresses));
    } else {
        import_set(j, field, from->line, "type", "%s", type->ours);
    }
    if (strcmp(type->ours, "bit") == 0)
        import_set(j, field, from->line, "bit", "%s", bit ? bit : "0");
    if (addresses > 0 && type->registers > 0 && addresses != type->registers)
        import_lose(j, from->line, import_name(j, field), "%s has %u registers and not %u", theirs,
                    type->registers, addresses);
    if (!order)
        import_lose(j, from->line, import_name(j, field), "the byte_order %s has no counterpart",
                    byte_order);
    else if (strcmp(order, "ABCD") != 0)
        import_set(j, field, from->line, "order", "%s", order);
    return 1;
}

static void set_scale(import *j, unsigned field, tree *from)
{
    const char *scale = tree_text(from, "scale", NULL);
    char *end;

    if (scale && (strtod(scale, &end) != 1 || *end) && strtod(scale, NULL) != 0)
        import_set(j, field, from->line, "scale", "%s", scale);
}

/* --- the style register --- */

/* Reads a list of addresses, which must follow each other. Returns their number, 0 after naming why
 * there is none. */
static unsigned read_addresses(import *j, tree *from, const char *name, const char **first)
{
    const tree *list = tree_find(from, "address"), *at;
    unsigned count = 0;
    unsigned long last = 0;

    for (at = tree_items(list); at; at = at->next) {
        const unsigned long address = at->text ? strtoul(at->text, NULL, 10) : 0;

        if (count > 0 && address != last + 1) {
            import_lose(j, list->line, name,
                        "its addresses do not follow each other: the field is left out");
            return 0;
        }
        last = address;
        if (count++ == 0)
            *first = at->text ? at->text : "";
    }
    if (count == 0)
        import_lose(j, from->line, name, "it has no address: the field is left out");
    return count;
}

static void import_register(import *j, tree *from, const context *of)
{
    const unsigned field = begin(j, from, of);
    const char *first = "";
    const unsigned count = read_addresses(j, from, import_name(j, field), &first);

    if (count > 0)
        import_set(j, field, from->line, "address", "%s", first);
    if (count == 0 ||
        (!of->is_bits && !set_type(j, field, from, tree_text(from, "data_type", "INT16"), count,
                                   tree_text(from, "byte_order", NULL), of->location))) {
        tree_use(from);
        import_drop(j);
        return;
    }
    if (!of->is_bits)
        set_scale(j, field, from);
    import_lose_rest(j, from, import_name(j, field));
}

static void import_registers(import *j, tree *plugin, const char *key, const char *table,
                             const char *location)
{
    const context of = {
        .table = table, .location = location, .is_bits = table[0] == 'c' || table[0] == 'd'};
    tree *list = tree_find(plugin, key), *at;

    for (at = tree_items(list); at; at = at->next)
        if (at->kind == TREE_MAP)
            import_register(j, at, &of);
}

/* --- the styles request and metric --- */

static const char *table_of(const char *theirs)
{
    return strcmp(theirs, "coil") == 0 ? "coils" : theirs;
}

/* Returns whether a field is left out on purpose. */
static int is_omitted(tree *from)
{
    return strcmp(tree_text(from, "omit", "false"), "true") == 0;
}

static void import_requested(import *j, tree *from, const context *of)
{
    context own = *of;
    unsigned field;

    if (is_omitted(from)) {
        tree_use(from);
        return;
    }
    own.table = table_of(tree_text(from, "register", of->table));
    own.is_bits = own.table[0] == 'c' || own.table[0] == 'd';
    field = begin(j, from, &own);
    import_set(j, field, from->line, "address", "%s", tree_text(from, "address", ""));
    /* The type of what telegraf stores: mbm keeps numbers exactly. */
    (void)tree_find(from, "output");
    if (!own.is_bits) {
        if (!set_type(j, field, from, tree_text(from, "type", "INT16"), 0, of->order,
                      of->location)) {
            tree_use(from);
            import_drop(j);
            return;
        }
        set_scale(j, field, from);
    }
    import_lose_rest(j, from, import_name(j, field));
}

static void import_request(import *j, tree *request, const char *location)
{
    context of = {.table = table_of(tree_text(request, "register", "holding")),
                  .order = tree_text(request, "byte_order", "ABCD"),
                  .unit = tree_text(request, "slave_id", NULL),
                  .measurement = tree_text(request, "measurement", NULL),
                  .location = location};
    tree *fields = tree_find(request, "fields"), *at;

    for (at = tree_items(fields); at; at = at->next)
        if (at->kind == TREE_MAP)
            import_requested(j, at, &of);
    import_lose_rest(j, request, "a request");
}

static void import_requests(import *j, tree *plugin, const char *key, const char *location)
{
    tree *list = tree_find(plugin, key), *at;

    for (at = tree_items(list); at; at = at->next)
        if (at->kind == TREE_MAP)
            import_request(j, at, location);
}

/* --- a plugin --- */

/* The name of the line, of tcp://host:port or file:///dev/ttyUSB0. */
static void make_line(import *j, tree *plugin)
{
    const char *controller = tree_text(plugin, "controller", "");
    const char *mode = tree_text(plugin, "transmission_mode", "auto");
    const char *baud = tree_text(plugin, "baud_rate", "9600");
    const char *stop = tree_text(plugin, "stop_bits", "1");
    const char *data = tree_text(plugin, "data_bits", "8");
    const char *parity = tree_text(plugin, "parity", "N");
    const char *path = strncmp(controller, "file://", 7) == 0 ? controller + 7 : NULL;
    const char *host = strncmp(controller, "tcp://", 6) == 0 ? controller + 6 : NULL;

    if (path)
        import_serial_line(j, strcasecmp(mode, "ASCII") == 0 ? "ascii" : "rtu", path, baud, parity,
                           stop, data);
    else if (host)
        import_line(j, "%s://%s", strcasecmp(mode, "RTUoverTCP") == 0 ? "rtu+tcp" : "tcp", host);
    else if (*controller)
        import_lose(j, plugin->line, "controller", "%s has no counterpart", controller);
}

/* Copies a time or a number to the head, unless it is 0. */
static void copy_to_head(import *j, tree *from, const char *theirs, const char *ours)
{
    const char *text = tree_text(from, theirs, NULL);

    if (text && strtod(text, NULL) != 0)
        import_set(j, IMPORT_HEAD, tree_line(from, theirs), ours, "%s", text);
}

static void import_workarounds(import *j, tree *plugin)
{
    tree *of = tree_find(plugin, "workarounds");

    if (!of || of->kind != TREE_MAP)
        return;
    copy_to_head(j, of, "pause_after_connect", "delay");
    copy_to_head(j, of, "pause_between_requests", "message_wait");
    copy_to_head(j, of, "max_word_registers_per_request", "max_read_registers");
    copy_to_head(j, of, "max_bit_registers_per_request", "max_read_bits");
    if (strcmp(tree_text(of, "close_connection_after_gather", "false"), "true") == 0)
        import_set(j, IMPORT_HEAD, of->line, "close", "round");
    import_lose_rest(j, of, "workarounds");
}

/* Takes timeout over, unless a device file cannot have it: Go may write 1m30s. */
static void import_timeout(import *j, tree *plugin)
{
    const char *text = tree_text(plugin, "timeout", NULL);
    reach read = {0};
    const char *wrong = text ? reach_read(&read, REACH_TIMEOUT, text) : NULL;

    if (wrong)
        import_lose(j, tree_line(plugin, "timeout"), "timeout", "%s", wrong);
    else if (text)
        import_set(j, IMPORT_HEAD, tree_line(plugin, "timeout"), "timeout", "%s", text);
}

static void import_plugin(import *j, tree *plugin, tree *agent)
{
    const char *name = tree_text(plugin, "name", NULL);
    const char *location =
        tree_text(tree_find(plugin, "workarounds"), "string_register_location", "both");

    if (!j->line)
        make_line(j, plugin);
    if (name && j->head.count == 0)
        import_set_text(j, IMPORT_HEAD, plugin->line, "device", name);
    import_set(j, IMPORT_HEAD, plugin->line, "unit", "%s",
               j->has_unit ? say("%u", j->unit) : tree_text(plugin, "slave_id", "1"));
    (void)tree_find(plugin, "slave_id");
    copy_to_head(j, tree_peek(plugin, "interval") || !agent ? plugin : agent, "interval",
                 "interval");
    (void)tree_find(plugin, "configuration_type");
    (void)tree_find(plugin, "debug_connection");
    (void)tree_find(plugin, "exclude_register_type_tag");
    import_timeout(j, plugin);
    copy_to_head(j, plugin, "busy_retries", "busy_retries");
    copy_to_head(j, plugin, "busy_retries_wait", "busy_wait");
    import_workarounds(j, plugin);
    import_registers(j, plugin, "discrete_inputs", "discrete", location);
    import_registers(j, plugin, "coils", "coils", location);
    import_registers(j, plugin, "input_registers", "input", location);
    import_registers(j, plugin, "holding_registers", "holding", location);
    import_requests(j, plugin, "request", location);
    import_requests(j, plugin, "metric", location);
    import_lose_rest(j, plugin, "inputs.modbus");
}

static int is_chosen(const import *j, const tree *plugin)
{
    return !j->hub || tree_has(plugin, "name", j->hub) || tree_has(plugin, "controller", j->hub);
}

int import_telegraf(import *j)
{
    char wrong[YAML_FILE_WRONG_BYTES];
    int code;
    tree *root = tree_read_toml(j->path, &code, wrong);
    tree *list = tree_peek(tree_peek(root, "inputs"), "modbus"), *at, *chosen = NULL;
    unsigned count = 0;

    if (!root)
        return report(code, "%s", wrong);
    for (at = tree_items(list); at; at = at->next)
        if (at->kind == TREE_MAP && is_chosen(j, at)) {
            chosen = at;
            count++;
        }
    if (count == 1)
        import_plugin(j, chosen, tree_peek(root, "agent"));
    else if (count == 0)
        code = report(CODE_WRONG, "%s: there is no [[inputs.modbus]]%s%s%s", j->path,
                      j->hub ? " with the name or controller \"" : "", j->hub ? j->hub : "",
                      j->hub ? "\"" : "");
    else
        code = report(CODE_WRONG,
                      "%s: there are %u [[inputs.modbus]]%s: choose one with --hub, by its name or "
                      "controller",
                      j->path, count, j->hub ? " of that name" : "");
    tree_free(root);
    return code;
}
