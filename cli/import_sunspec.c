/* Imports the description of a SunSpec model: its points and groups, in JSON. */
#include "import.h"

#include "numbers.h"
#include "report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_GROUPS = 10, NAME_BYTES = 150, MOST_REGISTERS = 65536 };

typedef struct point_type {
    const char *theirs, *ours;
    enum { NUMBER, ENUMERATION, BITS, COUNTER, FACTOR, TEXT } kind;
} point_type;

static const point_type TYPES[] = {
    {"int16", "int16", NUMBER},        {"uint16", "uint16", NUMBER},
    {"count", "uint16", NUMBER},       {"acc16", "uint16", COUNTER},
    {"enum16", "uint16", ENUMERATION}, {"bitfield16", "uint16", BITS},
    {"raw16", "uint16", NUMBER},       {"sunssf", "int16", FACTOR},
    {"int32", "int32", NUMBER},        {"uint32", "uint32", NUMBER},
    {"acc32", "uint32", COUNTER},      {"enum32", "uint32", ENUMERATION},
    {"bitfield32", "uint32", BITS},    {"ipaddr", "uint32", NUMBER},
    {"int64", "int64", NUMBER},        {"uint64", "uint64", NUMBER},
    {"acc64", "uint64", COUNTER},      {"bitfield64", "uint64", BITS},
    {"float32", "float", NUMBER},      {"float64", "double", NUMBER},
    {"string", "text", TEXT},
};

static const point_type *find_type(const char *theirs)
{
    size_t i;

    for (i = 0; i < sizeof TYPES / sizeof TYPES[0]; i++)
        if (strcmp(TYPES[i].theirs, theirs) == 0)
            return &TYPES[i];
    return NULL;
}

/* Units that SunSpec writes otherwise than Home Assistant. */
static const import_words UNITS[] = {
    {"C", "\u00B0C"},      {"Pct", "%"},     {"Secs", "s"},         {"Mins", "min"},
    {"VAr", "var"},        {"VArh", "varh"}, {"Degrees", "\u00B0"}, {"deg", "\u00B0"},
    {"W/m2", "W/m\u00B2"}, {"hours", "h"},   {"HPa", "hPa"},        {"mps", "m/s"},
    {"Mm", "mm"},          {NULL, NULL},
};

static const char *unit_of(const char *theirs)
{
    const char *ours = import_word(UNITS, theirs);

    return ours ? ours : theirs;
}

/* Where an import is: the address of the next point, and what stands before its name. */
typedef struct position {
    import *j;
    uint32_t address;
    unsigned depth;
} position;

/* --- a point --- */

/* Writes the symbols of a point as an enumeration: numbers to names. */
static void set_enumeration(import *j, unsigned field, tree *symbols)
{
    char *text = NULL;
    size_t length = 0;
    FILE *out;
    tree *at;

    if (!symbols || symbols->kind != TREE_LIST || !symbols->first)
        return;
    out = open_memstream(&text, &length);
    if (!out) {
        j->is_out_of_memory = 1;
        return;
    }
    for (at = symbols->first; at; at = at->next)
        fprintf(out, "%s%s: %s", at == symbols->first ? "{" : ", ", tree_text(at, "value", "0"),
                import_quote(tree_text(at, "name", "?")));
    fputc('}', out);
    (void)fclose(out);
    import_set(j, field, symbols->line, "enumeration", "%s", text);
    free(text);
}

/* Adds a bit for each symbol of a bit field of one register; those of wider ones keep their number.
 */
static void add_bits(position *p, tree *point, const char *name, uint32_t address, tree *symbols)
{
    const unsigned long size = strtoul(tree_text(point, "size", "1"), NULL, 10);
    tree *at;

    for (at = tree_items(symbols); at; at = at->next) {
        const unsigned long bit = strtoul(tree_text(at, "value", "0"), NULL, 10);
        const unsigned field =
            import_field(p->j, at->line, say("%s %s", name, tree_text(at, "name", "?")));

        if (bit >= 16 * size) {
            import_lose(p->j, at->line, name, "it has no bit %lu", bit);
            import_drop(p->j);
            continue;
        }
        import_set(p->j, field, at->line, "table", "holding");
        /* The high register comes first. */
        import_set(p->j, field, at->line, "address", "%lu", address + size - 1 - bit / 16);
        import_set(p->j, field, at->line, "type", "bit");
        import_set(p->j, field, at->line, "bit", "%lu", bit % 16);
    }
}

/* Sets the scale: a number, or the name of the field that has the power of ten. It is in the group
 * of the point, or in one around it; its name has the same words before it. */
static void set_scale(import *j, unsigned field, tree *point, const char *before)
{
    const char *factor = tree_text(point, "sf", NULL);
    char name[NAME_BYTES + 64], *end;
    long power;
    size_t length;
    unsigned i;

    if (!factor)
        return;
    power = strtol(factor, &end, 10);
    if (!*end) {
        import_set(j, field, point->line, "scale", "1e%ld", power);
        return;
    }
    snprintf(name, sizeof name, "%s", before);
    for (;;) {
        length = strlen(name);
        snprintf(name + length, sizeof name - length, "%s", factor);
        for (i = 0; i < j->field_count; i++)
            if (strcmp(import_name(j, i), name) == 0) {
                import_set_text(j, field, point->line, "scale", name);
                return;
            }
        name[length] = '\0';
        if (length == 0)
            break;
        /* The group around it: without the last word and the number of the group. */
        name[length - 1] = '\0';
        for (i = 0; i < 2; i++)
            if (strrchr(name, ' '))
                *strrchr(name, ' ') = '\0';
            else
                name[0] = '\0';
        if (*name)
            strcat(name, " ");
    }
    /* A factor that follows its points: the reader of the device file looks for it. */
    import_set_text(j, field, point->line, "scale", say("%s%s", before, factor));
}

static void import_point(position *p, tree *point, const char *before)
{
    import *j = p->j;
    const char *theirs = tree_text(point, "type", ""), *own = tree_text(point, "name", "?");
    const uint32_t address = p->address;
    const unsigned long size = strtoul(tree_text(point, "size", "1"), NULL, 10);
    const char *label = tree_text(point, "label", NULL), *units = tree_text(point, "units", NULL);
    const char *description = tree_text(point, "desc", NULL);
    const int is_written = strcmp(tree_text(point, "access", "R"), "RW") == 0;
    const int is_static = strcmp(tree_text(point, "static", "D"), "S") == 0;
    const point_type *type = find_type(theirs);
    tree *symbols = tree_find(point, "symbols");
    char name[NAME_BYTES + 64];
    unsigned field;

    p->address += (uint32_t)size;
    snprintf(name, sizeof name, "%s%s", before, own);
    if (strcmp(theirs, "pad") == 0)
        return;
    if (!type) {
        import_lose(j, point->line, name, "the type %s has no counterpart: the field is left out",
                    theirs);
        return;
    }
    field = import_field(j, point->line, name);
    import_set(j, field, point->line, "table", "holding");
    import_set(j, field, point->line, "address", "%u", address);
    import_set(j, field, point->line, "type", "%s", type->ours);
    if (type->kind == TEXT)
        import_set(j, field, point->line, "count", "%lu", 2 * size);
    if (type->kind == NUMBER || type->kind == COUNTER)
        set_scale(j, field, point, before);
    if (type->kind == NUMBER || type->kind == ENUMERATION)
        import_set(j, field, point->line, "not_available", "standard");
    if (units && type->kind != TEXT)
        import_set_text(j, field, point->line, "unit_of_measurement", unit_of(units));
    if (type->kind == COUNTER && units)
        import_set(j, field, point->line, "state_class", "total_increasing");
    if (label || description)
        import_set_text(j, field, point->line, "description", description ? description : label);
    if (is_written)
        import_set(j, field, point->line, "access", "read-write");
    if (is_static)
        import_set(j, field, point->line, "interval", "1m");
    if (type->kind == ENUMERATION)
        set_enumeration(j, field, symbols);
    if (type->kind == BITS)
        add_bits(p, point, name, address, symbols);
}

/* --- a group --- */

static void import_group(position *p, tree *group, const char *before);

/* How often a group is there. Its count may be that of a point, or 0: as often as the length of the
 * model says. Then --count says it. */
static uint32_t count_of(position *p, tree *group, const char *name)
{
    const char *text = tree_text(group, "count", "1");
    char *end;
    const unsigned long count = strtoul(text, &end, 10);

    if (!*end && count > 0)
        return (uint32_t)count;
    if (!p->j->has_count)
        import_lose(p->j, group->line, name,
                    "the device says how often it is there: give that with --count. One is taken");
    return p->j->has_count ? p->j->count : 1;
}

static void import_groups(position *p, tree *groups, const char *before)
{
    tree *at;
    uint32_t i;

    for (at = tree_items(groups); at; at = at->next) {
        const char *name = tree_text(at, "name", "group");
        const uint32_t count = count_of(p, at, name);

        for (i = 0; i < count && p->address < MOST_REGISTERS; i++) {
            char inside[NAME_BYTES];

            snprintf(inside, sizeof inside, "%s%.40s %u ", before, name, i + 1);
            import_group(p, at, inside);
        }
    }
}

static void import_group(position *p, tree *group, const char *before)
{
    tree *points = tree_find(group, "points"), *at;

    if (p->depth == MOST_GROUPS) {
        import_lose(p->j, group->line, before, "groups are nested too deeply");
        return;
    }
    p->depth++;
    for (at = tree_items(points); at; at = at->next)
        if (at->kind == TREE_MAP)
            import_point(p, at, before);
    import_groups(p, tree_find(group, "groups"), before);
    p->depth--;
}

int import_sunspec(import *j)
{
    char wrong[YAML_FILE_WRONG_BYTES];
    int code;
    tree *root = tree_read_yaml(j->path, &code, wrong), *group = tree_peek(root, "group");
    position p = {.j = j, .address = j->address};

    if (!root)
        return report(code, "%s", wrong);
    if (!group || group->kind != TREE_MAP || !tree_peek(group, "points"))
        code =
            report(CODE_WRONG,
                   "%s: this is no model of SunSpec: it has no \"group\" with \"points\"", j->path);
    else if (!j->has_address && !tree_has(root, "id", "1"))
        code = report(CODE_WRONG,
                      "%s: give the address of the model's ID with --address: mbm scan --sunspec "
                      "finds it",
                      j->path);
    else {
        /* Model 1 follows the mark SunS at 40000. */
        p.address = j->has_address ? j->address : 40002;
        import_set_text(j, IMPORT_HEAD, group->line, "device",
                        tree_text(group, "label", tree_text(group, "name", "SunSpec")));
        import_set(j, IMPORT_HEAD, group->line, "unit", "%u", j->has_unit ? j->unit : 1);
        import_group(&p, group, "");
    }
    tree_free(root);
    return code;
}
