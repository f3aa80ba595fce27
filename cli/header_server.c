/* The part of a device's header for a server: tables of cells, and functions that get and set the
 * value of a field in them. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "header.h"

#include "report.h"

#include <stdlib.h>
#include <string.h>

/* A hole of so many registers or bits takes more memory than a table of its own. A unit has at most
 * MBM_MAX_SERVICES records, of which some are left for others. */
enum { CELLS = 65536, HOLE = 32, BIT_HOLE = 512, TABLES = 3 };

/* What a unit has at an address. */
enum { HAS_CELL = 1, HAS_READ = 2, HAS_WRITE = 4 };

/* The cells of one table of one unit, and its parts: from first[i] to last[i], each with an array
 * of its own. */
typedef struct cells {
    uint8_t has[CELLS];
    uint16_t words[CELLS]; /* what the file says */
    uint32_t first[TABLES], last[TABLES];
    int parts;
} cells;

static const char *const NAMES[] = {"", "coils", "discrete", "holding", "input"};

static int is_bits(uint8_t table)
{
    return table <= MBM_TABLE_DISCRETE_INPUTS;
}

/* --- the cells --- */

/* Adds a part; the two that are nearest become one if there are too many. */
static void add_part(cells *of, uint32_t first, uint32_t last)
{
    uint32_t firsts[TABLES + 1], lasts[TABLES + 1];
    int i, nearest = 0, count = of->parts + 1;

    memcpy(firsts, of->first, sizeof of->first);
    memcpy(lasts, of->last, sizeof of->last);
    firsts[count - 1] = first;
    lasts[count - 1] = last;
    if (count > TABLES) {
        for (i = 1; i + 1 < count; i++)
            if (firsts[i + 1] - lasts[i] < firsts[nearest + 1] - lasts[nearest])
                nearest = i;
        lasts[nearest] = lasts[nearest + 1];
        for (i = nearest + 1; i + 1 < count; i++) {
            firsts[i] = firsts[i + 1];
            lasts[i] = lasts[i + 1];
        }
        count--;
    }
    memcpy(of->first, firsts, sizeof of->first);
    memcpy(of->last, lasts, sizeof of->last);
    of->parts = count;
}

/* Finds the cells of a table of a unit. */
static void find_cells(const header *h, uint16_t unit, uint8_t table, cells *into)
{
    const uint32_t hole = is_bits(table) ? BIT_HOLE : HOLE;
    uint32_t at;
    uint16_t i;

    memset(into, 0, sizeof *into);
    for (i = 0; i < h->of->count; i++) {
        const mbm_planField *planned = &h->of->planned[i];
        const device_field *field = &h->of->fields[i];
        const uint16_t mask = device_mask(planned);

        if (planned->unit != unit || planned->table != table)
            continue;
        for (at = 0; at < device_size(planned); at++) {
            const uint32_t address = planned->address + at;

            into->has[address] = (uint8_t)(into->has[address] | HAS_CELL |
                                           (field->access & DEVICE_READ ? HAS_READ : 0) |
                                           (field->access & DEVICE_WRITE ? HAS_WRITE : 0));
            if (field->words)
                into->words[address] =
                    (uint16_t)((into->words[address] & ~mask) | field->words[at]);
        }
    }
    for (at = 0; at < CELLS; at++) {
        if (!into->has[at])
            continue;
        if (into->parts > 0 && at - into->last[into->parts - 1] <= hole)
            into->last[into->parts - 1] = at;
        else
            add_part(into, at, at);
    }
}

static int part_of(const cells *of, uint16_t address)
{
    int part = 0;

    while (address > of->last[part])
        part++;
    return part;
}

/* --- names --- */

/* Writes the name of a part of a table: sdm120_holding, or sdm120_unit17_holding_400. */
static void write_name(const header *h, uint16_t unit, uint8_t table, const cells *of, int part)
{
    fprintf(h->out, "%s_", h->lower);
    if (h->unit == 0)
        fprintf(h->out, "unit%u_", unit);
    fprintf(h->out, "%s", NAMES[table]);
    if (part > 0)
        fprintf(h->out, "_%u", (unsigned)of->first[part]);
}

/* --- tables --- */

/* Returns whether every cell of a part has this; or none, if `wanted` is 0. */
static int is_all(const cells *of, int part, uint8_t what, int wanted)
{
    uint32_t at;

    for (at = of->first[part]; at <= of->last[part]; at++)
        if (of->has[at] && ((of->has[at] & what) != 0) != wanted)
            return 0;
    return 1;
}

/* Writes the map of the cells that exist, if there are holes. */
static int write_valid(const header *h, uint16_t unit, uint8_t table, const cells *of, int part)
{
    const uint32_t first = of->first[part], last = of->last[part];
    uint32_t at, count = 0;

    for (at = first; at <= last; at++)
        count += of->has[at] != 0;
    if (count == last - first + 1)
        return 0;
    fprintf(h->out, "static const uint8_t ");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_valid[%u] = {", (unsigned)((last - first) / 8 + 1));
    for (at = first; at <= last; at += 8) {
        unsigned bit, byte = 0;

        for (bit = 0; bit < 8 && at + bit <= last; bit++)
            byte |= (unsigned)(of->has[at + bit] != 0) << bit;
        if ((at - first) % 96 == 0)
            fprintf(h->out, "\n   ");
        fprintf(h->out, " 0x%02Xu%s", byte, at + 8 <= last ? "," : "");
    }
    fprintf(h->out, "\n};\n");
    return 1;
}

/* Writes a function that allows requests for some cells of a part only. */
static void write_guard(const header *h, uint16_t unit, uint8_t table, const cells *of, int part,
                        uint8_t what, const char *name)
{
    const uint32_t first = of->first[part], last = of->last[part];
    const char *word = last == CELLS - 1 ? "last" : "end";
    uint32_t at, end;
    int ranges = 0;

    fprintf(h->out, "static inline uint8_t ");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_%s(void *context, const mbm_access *access)\n{\n", name);
    if (is_all(of, part, what, 0)) {
        fprintf(h->out, "    (void)context;\n    (void)access;\n"
                        "    return MBM_ILLEGAL_DATA_ADDRESS;\n}\n");
        return;
    }
    /* On a small machine the end after address 65535 is 0. */
    fprintf(h->out,
            "    const unsigned %s = (unsigned)access->address + access->quantity%s;\n\n"
            "    (void)context;\n    (void)%s;\n    return ",
            word, last == CELLS - 1 ? " - 1u" : "", word);
    for (at = first; at <= last; at = end + 1) {
        const int is_allowed = (of->has[at] & what) != 0;

        for (end = at; end < last && ((of->has[end + 1] & what) != 0) == is_allowed;)
            end++;
        if (!is_allowed)
            continue;
        fprintf(h->out, "%s(", ranges++ > 0 ? " ||\n                   " : "");
        /* The server has checked that the cells are in the table. */
        if (at > first)
            fprintf(h->out, "access->address >= %uu", (unsigned)at);
        if (at > first && end < last)
            fprintf(h->out, " && ");
        if (end < last)
            fprintf(h->out, "%s <= %uu", word, (unsigned)(last == CELLS - 1 ? end : end + 1));
        fprintf(h->out, ")");
    }
    fprintf(h->out, "\n               ? MBM_OK\n               : MBM_ILLEGAL_DATA_ADDRESS;\n}\n");
}

/* Writes the guards of a part. Returns whether there are some. */
static int write_guards(const header *h, uint16_t unit, uint8_t table, const cells *of, int part)
{
    const int is_input = table == MBM_TABLE_DISCRETE_INPUTS || table == MBM_TABLE_INPUT_REGISTERS;
    const int guards_read = !is_all(of, part, HAS_READ, 1);
    const int guards_write = !is_input && !is_all(of, part, HAS_WRITE, 1);

    if (!guards_read && !guards_write)
        return 0;
    if (guards_read)
        write_guard(h, unit, table, of, part, HAS_READ, "before_read");
    if (guards_write)
        write_guard(h, unit, table, of, part, HAS_WRITE, "before_write");
    fprintf(h->out, "static const mbm_accessHooks ");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_hooks = {NULL, ");
    if (guards_read)
        write_name(h, unit, table, of, part);
    fprintf(h->out, guards_read ? "_before_read, " : "NULL, ");
    if (guards_write)
        write_name(h, unit, table, of, part);
    fprintf(h->out, guards_write ? "_before_write, NULL};\n" : "NULL, NULL};\n");
    return 1;
}

/* Writes the array of a part and its record. */
static void write_part(const header *h, uint16_t unit, uint8_t table, const cells *of, int part)
{
    const uint32_t first = of->first[part], size = of->last[part] - first + 1;
    int has_holes;

    fprintf(h->out, "\n/* %s", NAMES[table]);
    if (h->unit == 0)
        fprintf(h->out, " of unit %u", unit);
    fprintf(h->out, ": addresses %u to %u */\n", (unsigned)first, (unsigned)of->last[part]);
    fprintf(h->out, is_bits(table) ? "static uint8_t " : "static uint16_t ");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "[%u];\n", (unsigned)(is_bits(table) ? (size + 7) / 8 : size));
    has_holes = write_valid(h, unit, table, of, part);
    fprintf(h->out, is_bits(table) ? "static mbm_bitTable " : "static mbm_registerTable ");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_table = {\n    MBM_INIT, ");
    write_name(h, unit, table, of, part);
    fprintf(h->out, ", ");
    if (has_holes)
        write_name(h, unit, table, of, part);
    fprintf(h->out, "%s, MBM_INIT, %uu, %uu};\n", has_holes ? "_valid" : "NULL", (unsigned)first,
            (unsigned)size);
}

/* Writes the call that serves a part. */
static void write_serve(const header *h, uint16_t unit, uint8_t table, const cells *of, int part,
                        int is_guarded, int is_first)
{
    static const char *const CALLS[] = {"", "Coils", "DiscreteInputs", "HoldingRegisters",
                                        "InputRegisters"};

    fprintf(h->out, "    %s = mbm_unit_serve%s(unit, &", is_first ? "status" : "other",
            CALLS[table]);
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_table);\n");
    if (!is_first)
        fprintf(h->out, "    if (status == MBM_OK)\n        status = other;\n");
    if (!is_guarded)
        return;
    fprintf(h->out, "    (void)mbm_%sTable_setHooks(&", is_bits(table) ? "bit" : "register");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_table, &");
    write_name(h, unit, table, of, part);
    fprintf(h->out, "_hooks);\n");
}

/* Writes the tables of a unit and the function that serves them. */
static void write_unit(const header *h, uint16_t unit, cells *of)
{
    uint8_t guarded[MBM_TABLE_INPUT_REGISTERS + 1][TABLES] = {{0}};
    int parts = 0, part;
    uint8_t table;

    for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
        find_cells(h, unit, table, of);
        parts += of->parts;
        for (part = 0; part < of->parts; part++) {
            write_part(h, unit, table, of, part);
            guarded[table][part] = (uint8_t)write_guards(h, unit, table, of, part);
        }
    }
    fprintf(h->out,
            "\n/* Registers these tables for a unit. Returns MBM_OK, or the first status that "
            "is another. */\n"
            "static inline uint8_t %s_",
            h->lower);
    if (h->unit == 0)
        fprintf(h->out, "unit%u_", unit);
    fprintf(h->out, "serve(mbm_unit *unit)\n{\n    uint8_t status%s;\n\n",
            parts > 1 ? ", other" : "");
    parts = 0;
    for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
        find_cells(h, unit, table, of);
        for (part = 0; part < of->parts; part++)
            write_serve(h, unit, table, of, part, guarded[table][part], parts++ == 0);
    }
    fprintf(h->out, "    return status;\n}\n");
}

/* --- the values of fields --- */

/* Writes one register of a field as an integer: that with the given number of 16 bits, from the
 * least significant on. */
static void write_register(const header *h, uint16_t at, const cells *of, unsigned significance)
{
    const mbm_planField *planned = &h->of->planned[at];
    const unsigned size = value_registers(planned->type, 1);
    const int part = part_of(of, planned->address);
    const int is_low_first = planned->order == MBM_ORDER_CDAB || planned->order == MBM_ORDER_DCBA;
    const unsigned offset = (unsigned)(planned->address - of->first[part]) +
                            (is_low_first ? significance : size - 1 - significance);

    write_name(h, planned->unit, planned->table, of, part);
    if (planned->count > 1 && !device_is_part(planned)) {
        fprintf(h->out, "[%uu + ", offset);
        fprintf(h->out, size > 1 ? "%uu * index]" : "index]", size);
    } else {
        fprintf(h->out, "[%u]", offset);
    }
}

static int is_swapped(const mbm_planField *planned)
{
    return planned->order == MBM_ORDER_BADC || planned->order == MBM_ORDER_DCBA;
}

/* The same, with the bytes in the machine's order. */
static void write_word(const header *h, uint16_t at, const cells *of, unsigned significance)
{
    const int swaps = is_swapped(&h->of->planned[at]);

    if (swaps)
        fprintf(h->out, "%s_swap(", h->lower);
    write_register(h, at, of, significance);
    if (swaps)
        fprintf(h->out, ")");
}

/* Writes the head of a function that gets or sets a field. */
static void write_head(const header *h, const char *result, const char *verb, const char *name,
                       const char *parameters)
{
    fprintf(h->out, "\nstatic inline %s %s_%s_%s(%s)\n{\n", result, h->lower, verb, name,
            parameters);
}

/* A coil or discrete input. */
static void write_bit(const header *h, uint16_t at, const cells *of, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const int part = part_of(of, planned->address);
    const unsigned offset = (unsigned)(planned->address - of->first[part]);
    const int is_many = planned->count > 1;

    write_head(h, "uint8_t", "get", name, is_many ? "uint16_t index" : "void");
    fprintf(h->out, "    return (uint8_t)((");
    write_name(h, planned->unit, planned->table, of, part);
    if (is_many)
        fprintf(h->out, "[(%uu + index) / 8u] >> ((%uu + index) %% 8u)) & 1);\n}\n", offset,
                offset);
    else
        fprintf(h->out, "[%u] >> %u) & 1);\n}\n", offset / 8, offset % 8);
    write_head(h, "void", "set", name, is_many ? "uint16_t index, uint8_t on" : "uint8_t on");
    if (is_many)
        fprintf(h->out,
                "    const uint8_t bit = (uint8_t)(1u << ((%uu + index) %% 8u));\n"
                "    uint8_t *byte = &",
                offset);
    else
        fprintf(h->out, "    uint8_t *byte = &");
    write_name(h, planned->unit, planned->table, of, part);
    if (is_many)
        fprintf(h->out,
                "[(%uu + index) / 8u];\n\n    *byte = (uint8_t)(on ? *byte | bit : *byte & "
                "(uint8_t)~bit);\n}\n",
                offset);
    else
        fprintf(h->out,
                "[%u];\n\n    *byte = (uint8_t)(on ? *byte | 0x%02Xu : *byte & 0x%02Xu);\n}\n",
                offset / 8, 1u << offset % 8, 0xFFu & ~(1u << offset % 8));
}

/* Bits of a register. */
static void write_bits(const header *h, uint16_t at, const cells *of, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const unsigned mask = (1u << planned->count) - 1, shifted = mask << planned->bit;
    const char *type = header_type(planned);
    char parameters[32];

    write_head(h, type, "get", name, "void");
    fprintf(h->out, "    return (%s)((", type);
    write_word(h, at, of, 0);
    fprintf(h->out, " >> %u) & 0x%Xu);\n}\n", planned->bit, mask);
    snprintf(parameters, sizeof parameters, "%s value", type);
    write_head(h, "void", "set", name, parameters);
    fprintf(h->out, "    const uint16_t word = (uint16_t)((");
    write_word(h, at, of, 0);
    fprintf(h->out, " & 0x%04Xu) | (((unsigned)value << %u) & 0x%04Xu));\n\n    ",
            0xFFFFu & ~shifted, planned->bit, shifted);
    write_register(h, at, of, 0);
    fprintf(h->out, is_swapped(planned) ? " = %s_swap(word);\n}\n" : " = word;\n}\n", h->lower);
}

/* An integer or a float. */
static void write_number(const header *h, uint16_t at, const cells *of, const char *name)
{
    static const char *const UNSIGNED[] = {"", "uint16_t", "uint32_t", "", "uint64_t"};
    const mbm_planField *planned = &h->of->planned[at];
    const unsigned size = value_registers(planned->type, 1);
    const char *type = header_type(planned), *bits = UNSIGNED[size];
    const int is_float = planned->type == MBM_TYPE_FLOAT, is_same = strcmp(type, bits) == 0;
    char parameters[48];
    unsigned i;

    write_head(h, type, "get", name, planned->count > 1 ? "uint16_t index" : "void");
    fprintf(h->out,
            is_float  ? "    const uint32_t bits = "
            : is_same ? "    return "
                      : "    return (%s)",
            type);
    fprintf(h->out, size > 1 && !is_same && !is_float ? "(" : "");
    for (i = size; i-- > 0;) {
        if (i > 0)
            fprintf(h->out, "((%s)", bits);
        write_word(h, at, of, i);
        if (i > 0)
            fprintf(h->out, " << %u) | ", 16 * i);
    }
    fprintf(h->out, size > 1 && !is_same && !is_float ? ");\n" : ";\n");
    if (is_float)
        fprintf(
            h->out,
            "    float value;\n\n    memcpy(&value, &bits, sizeof value);\n    return value;\n");
    fprintf(h->out, "}\n");

    snprintf(parameters, sizeof parameters, "%s%s value",
             planned->count > 1 ? "uint16_t index, " : "", type);
    write_head(h, "void", "set", name, parameters);
    if (is_float)
        fprintf(h->out, "    uint32_t bits;\n\n    memcpy(&bits, &value, sizeof bits);\n");
    else if (!is_same)
        fprintf(h->out, "    const %s bits = (%s)value;\n\n", bits, bits);
    for (i = size; i-- > 0;) {
        fprintf(h->out, "    ");
        write_register(h, at, of, i);
        fprintf(h->out, " = ");
        if (is_swapped(planned))
            fprintf(h->out, "%s_swap(", h->lower);
        if (size > 1)
            fprintf(h->out, "(uint16_t)");
        if (i > 0)
            fprintf(h->out, "(%s >> %u)", is_same ? "value" : "bits", 16 * i);
        else
            fprintf(h->out, "%s", is_same ? "value" : "bits");
        fprintf(h->out, is_swapped(planned) ? ");\n" : ";\n");
    }
    fprintf(h->out, "}\n");
}

/* A text or a double, by the functions of mbm/values.h. */
static void write_by_view(const header *h, uint16_t at, const cells *of, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const int is_text = planned->type == MBM_TYPE_TEXT, is_many = !is_text && planned->count > 1;
    const int part = part_of(of, planned->address);
    const char *order = value_order_names[planned->order];
    int sets;

    for (sets = 0; sets < 2; sets++) {
        if (is_text)
            write_head(h, "uint8_t", sets ? "set" : "get", name,
                       sets ? "const char *text" : "char *text, uint16_t capacity");
        else if (sets)
            write_head(h, "void", "set", name,
                       is_many ? "uint16_t index, double value" : "double value");
        else
            write_head(h, "double", "get", name, is_many ? "uint16_t index" : "void");
        fprintf(h->out,
                "    mbm_registers registers;\n%s\n    (void)mbm_registers_intoWords(&registers, ",
                is_text || sets ? "" : "    double value = 0;\n");
        write_name(h, planned->unit, planned->table, of, part);
        fprintf(h->out, ", %uu, %uu);\n", (unsigned)(of->last[part] - of->first[part] + 1),
                (unsigned)of->first[part]);
        fprintf(h->out, is_text ? "    return " : "    (void)");
        fprintf(h->out, "mbm_registers_%s%s(&registers, ", sets ? "set" : "get",
                is_text ? "String" : "Double");
        if (is_many)
            fprintf(h->out, "(uint16_t)(%uu + 4u * index), ", planned->address);
        else
            fprintf(h->out, "%uu, ", planned->address);
        if (is_text)
            fprintf(h->out, "%uu, MBM_ORDER_%s, text%s);\n}\n", planned->count, order,
                    sets ? "" : ", capacity");
        else
            fprintf(h->out, "MBM_ORDER_%s, &value);\n%s}\n", order,
                    sets ? "" : "    return value;\n");
    }
}

/* Writes the functions that get and set a field. Returns 0 without memory. */
static int write_accessors(const header *h, uint16_t at, cells *of)
{
    const mbm_planField *planned = &h->of->planned[at];
    char *name = header_lower(h->fields[at]);

    if (!name)
        return 0;
    fprintf(h->out, "\n/* ");
    header_comment(h->out, h->of->fields[at].name);
    fprintf(h->out, " */");
    if (device_is_part(planned))
        write_bits(h, at, of, name);
    else if (planned->type == MBM_TYPE_BIT)
        write_bit(h, at, of, name);
    else if (planned->type == MBM_TYPE_TEXT || planned->type == MBM_TYPE_DOUBLE)
        write_by_view(h, at, of, name);
    else
        write_number(h, at, of, name);
    free(name);
    return 1;
}

/* Writes the assignments that give the cells of a table the values of the file. */
static void write_values(const header *h, uint16_t unit, uint8_t table, const cells *of)
{
    uint32_t at, bit;
    int part;

    for (part = 0; part < of->parts; part++)
        for (at = of->first[part]; at <= of->last[part]; at += is_bits(table) ? 8 : 1) {
            unsigned value = of->words[at];

            for (bit = 1; is_bits(table) && bit < 8 && at + bit <= of->last[part]; bit++)
                value |= (unsigned)(of->words[at + bit] << bit);
            if (value == 0)
                continue;
            fprintf(h->out, "    ");
            write_name(h, unit, table, of, part);
            fprintf(h->out, "[%u] = 0x%0*Xu;\n",
                    (unsigned)((at - of->first[part]) / (is_bits(table) ? 8 : 1)),
                    is_bits(table) ? 2 : 4, value);
        }
}

/* --- the part --- */

static int needs(const header *h, int (*what)(const mbm_planField *planned))
{
    uint16_t i;

    for (i = 0; i < h->of->count; i++)
        if (what(&h->of->planned[i]))
            return 1;
    return 0;
}

static int is_float(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_FLOAT;
}

/* Whether the functions of a field swap bytes themselves. */
static int needs_swap(const mbm_planField *planned)
{
    return is_swapped(planned) && !(planned->type == MBM_TYPE_BIT && is_bits(planned->table)) &&
           planned->type < MBM_TYPE_DOUBLE;
}

int header_write_server(header *h)
{
    cells *of = (cells *)malloc(sizeof *of);
    uint16_t unit, i;
    uint8_t table;
    int is_right = of != NULL;

    if (is_right) {
        fprintf(h->out,
                "\n/* ==== The server: the device's cells. Define %s_SERVER in one file of a "
                "program ==== */\n\n#ifdef %s_SERVER\n#include \"mbm.h\"\n",
                h->upper, h->upper);
        if (needs(h, is_float))
            fprintf(h->out, "\n#include <string.h>\n");
    }
    for (unit = 1; is_right && unit <= 255; unit++) {
        for (i = 0; i < h->of->count && h->of->planned[i].unit != unit;)
            i++;
        if (i < h->of->count)
            write_unit(h, unit, of);
    }
    if (is_right && needs(h, needs_swap))
        fprintf(h->out,
                "\nstatic inline uint16_t %s_swap(uint16_t word)\n{\n"
                "    return (uint16_t)((word << 8) | (word >> 8));\n}\n",
                h->lower);
    if (is_right)
        fprintf(
            h->out,
            "\n/* Get and set the value of a field: the number that is in the registers, without its scale. "
            "An index counts\n * from 0 and is less than the field's _COUNT. */\n");
    for (unit = 1; is_right && unit <= 255; unit++)
        for (table = MBM_TABLE_COILS; is_right && table <= MBM_TABLE_INPUT_REGISTERS; table++) {
            int is_found = 0;

            for (i = 0; is_right && i < h->of->count; i++) {
                if (h->of->planned[i].unit != unit || h->of->planned[i].table != table)
                    continue;
                if (!is_found++)
                    find_cells(h, unit, table, of);
                is_right = write_accessors(h, i, of);
            }
        }
    if (is_right)
        fprintf(
            h->out,
            "\n/* Sets the values of the device file. */\nstatic inline void %s_initialise(void)\n{\n",
            h->lower);
    for (unit = 1; is_right && unit <= 255; unit++)
        for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
            for (i = 0; i < h->of->count &&
                        (h->of->planned[i].unit != unit || h->of->planned[i].table != table);)
                i++;
            if (i == h->of->count)
                continue;
            find_cells(h, unit, table, of);
            write_values(h, unit, table, of);
        }
    if (is_right)
        fprintf(h->out, "}\n#endif\n");
    else
        (void)report(CODE_SYSTEM, "there is no memory");
    free(of);
    return is_right;
}
