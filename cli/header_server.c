/* The part of a device's header for a server: its tables, what clients may do with their cells, and
 * the functions that get and set the value of a field in them. */
#include "header.h"

#include "numbers.h"
#include "report.h"

#include <stdlib.h>
#include <string.h>

/* TABLES is the most tables of a kind that a unit has: they leave some of its MBM_MAX_SERVICES
 * records for others. From the size HOLE or BIT_HOLE on, in registers or bits, a hole takes more
 * memory than a second table. A name has the name of the device, the unit, the table and an
 * address. */
enum { CELLS = 65536, TABLES = 3, HOLE = 32, BIT_HOLE = 512, NAME_BYTES = HEADER_NAME_BYTES + 40 };

/* What a unit has at an address. */
enum { HAS_CELL = 1, HAS_READ = 2, HAS_WRITE = 4 };

/* The cells of one table of one unit, and its parts: from first[i] to last[i], each with an array
 * of its own. A hole that is small is within a part. */
typedef struct cells {
    uint16_t unit;
    uint8_t table;
    uint8_t has[CELLS];
    uint16_t words[CELLS]; /* what the file says */
    uint32_t first[TABLES], last[TABLES];
    char names[TABLES][NAME_BYTES]; /* in C: sdm120_holding, or sdm120_unit17_holding_400 */
    int parts;                      /* 0 if the unit has no such table */
} cells;

static const char *const NAMES[] = {"", "coils", "discrete", "holding", "input"};

/* Whether the table has bits, and not registers. */
/* --- cells --- */

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
    const uint32_t hole = device_is_of_bits(table) ? BIT_HOLE : HOLE;
    uint32_t at;
    uint16_t i;

    into->parts = 0;
    for (i = 0;
         i < h->of->count && (h->of->planned[i].unit != unit || h->of->planned[i].table != table);)
        i++;
    if (i == h->of->count)
        return;
    memset(into, 0, sizeof *into);
    into->unit = unit;
    into->table = table;
    for (i = 0; i < h->of->count; i++) {
        const mbm_planField *planned = &h->of->planned[i];
        const device_field *field = &h->of->fields[i];

        if (planned->unit != unit || planned->table != table)
            continue;
        for (at = 0; at < device_size(planned); at++) {
            const uint32_t address = planned->address + at;
            const uint16_t mask = device_mask(planned, at);

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
    for (i = 0; i < into->parts; i++) {
        const char *in_unit = h->unit == 0 ? say("unit%u_", unit) : "";
        const char *from = i > 0 ? say("_%u", (unsigned)into->first[i]) : "";

        snprintf(into->names[i], NAME_BYTES, "%s_%s%s%s", h->lower, in_unit, NAMES[table], from);
    }
}

/* Returns the part that has an address. */
static int part_of(const cells *of, uint16_t address)
{
    int part = 0;

    while (address > of->last[part])
        part++;
    return part;
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
static int write_valid(const header *h, const cells *of, int part)
{
    const uint32_t first = of->first[part], last = of->last[part];
    uint32_t at, count = 0;

    for (at = first; at <= last; at++)
        count += of->has[at] != 0;
    if (count == last - first + 1)
        return 0;
    fprintf(h->out, "static const uint8_t %s_valid[%u] = {", of->names[part],
            (unsigned)((last - first) / 8 + 1));
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
static void write_guard(const header *h, const cells *of, int part, uint8_t what, const char *name)
{
    const uint32_t first = of->first[part], last = of->last[part];
    const char *word = last == CELLS - 1 ? "last" : "end";
    uint32_t at, end;
    int ranges = 0;

    fprintf(h->out, "static inline uint8_t %s_%s(void *context, const mbm_access *access)\n{\n",
            of->names[part], name);
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
static int write_guards(const header *h, const cells *of, int part)
{
    const char *name = of->names[part];
    const int is_input =
        of->table == MBM_TABLE_DISCRETE_INPUTS || of->table == MBM_TABLE_INPUT_REGISTERS;
    const int guards_read = !is_all(of, part, HAS_READ, 1);
    const int guards_write = !is_input && !is_all(of, part, HAS_WRITE, 1);

    if (!guards_read && !guards_write)
        return 0;
    if (guards_read)
        write_guard(h, of, part, HAS_READ, "before_read");
    if (guards_write)
        write_guard(h, of, part, HAS_WRITE, "before_write");
    fprintf(h->out, "static const mbm_accessHooks %s_hooks = {NULL, %s%s, %s%s, NULL};\n", name,
            guards_read ? name : "", guards_read ? "_before_read" : "NULL",
            guards_write ? name : "", guards_write ? "_before_write" : "NULL");
    return 1;
}

/* Writes the array of a part and its record. */
static void write_part(const header *h, const cells *of, int part)
{
    const uint32_t first = of->first[part], size = of->last[part] - first + 1;
    const char *name = of->names[part];
    int has_holes;

    fprintf(h->out, "\n/* %s%s: addresses %u to %u */\nstatic %s %s[%u];\n", NAMES[of->table],
            h->unit == 0 ? say(" of unit %u", of->unit) : "", (unsigned)first,
            (unsigned)of->last[part], device_is_of_bits(of->table) ? "uint8_t" : "uint16_t", name,
            (unsigned)(device_is_of_bits(of->table) ? (size + 7) / 8 : size));
    has_holes = write_valid(h, of, part);
    fprintf(h->out,
            "static mbm_%sTable %s_table = {\n    MBM_INIT, %s, %s%s, MBM_INIT, %uu, %uu};\n",
            device_is_of_bits(of->table) ? "bit" : "register", name, name, has_holes ? name : "",
            has_holes ? "_valid" : "NULL", (unsigned)first, (unsigned)size);
}

/* Writes the call that serves a part. */
static void write_serve(const header *h, const cells *of, int part, int is_guarded, int is_first)
{
    static const char *const CALLS[] = {"", "Coils", "DiscreteInputs", "HoldingRegisters",
                                        "InputRegisters"};
    const char *name = of->names[part];

    fprintf(h->out, "    %s = mbm_unit_serve%s(unit, &%s_table);\n%s",
            is_first ? "status" : "other", CALLS[of->table], name,
            is_first ? "" : "    if (status == MBM_OK)\n        status = other;\n");
    if (is_guarded)
        fprintf(h->out, "    (void)mbm_%sTable_setHooks(&%s_table, &%s_hooks);\n",
                device_is_of_bits(of->table) ? "bit" : "register", name, name);
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
            write_part(h, of, part);
            guarded[table][part] = (uint8_t)write_guards(h, of, part);
        }
    }
    if (parts == 0)
        return;
    fprintf(
        h->out,
        "\n/* Registers these tables for a unit. Returns MBM_OK, or the first status that is "
        "another. */\nstatic inline uint8_t %s_%sserve(mbm_unit *unit)\n{\n    uint8_t status%s;\n\n",
        h->lower, h->unit == 0 ? say("unit%u_", unit) : "", parts > 1 ? ", other" : "");
    parts = 0;
    for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
        find_cells(h, unit, table, of);
        for (part = 0; part < of->parts; part++)
            write_serve(h, of, part, guarded[table][part], parts++ == 0);
    }
    fprintf(h->out, "    return status;\n}\n");
}

/* --- the functions of a field --- */

static int is_swapped(const mbm_planField *planned)
{
    return planned->order == MBM_ORDER_BADC || planned->order == MBM_ORDER_DCBA;
}

/* The text of one register of a field: that with the given number of 16 bits, from the least
 * significant on. It is in a buffer of say. */
static const char *register_of(const mbm_planField *planned, const cells *of, unsigned significance)
{
    const unsigned size = value_registers(planned->type, 1);
    const int part = part_of(of, planned->address);
    const int is_low_first = planned->order == MBM_ORDER_CDAB || planned->order == MBM_ORDER_DCBA;
    const unsigned offset = (unsigned)(planned->address - of->first[part]) +
                            (is_low_first ? significance : size - 1 - significance);

    if (planned->count == 1 || device_is_part(planned))
        return say("%s[%u]", of->names[part], offset);
    return size > 1 ? say("%s[%uu + %uu * index]", of->names[part], offset, size)
                    : say("%s[%uu + index]", of->names[part], offset);
}

/* A text with its bytes in the machine's order, and back: with the call that swaps the bytes of a
 * register, if the field needs it. */
static const char *swapped(const header *h, const mbm_planField *planned, const char *text)
{
    return is_swapped(planned) ? say("%s_swap(%s)", h->lower, text) : text;
}

/* Writes the head of a function that gets or sets a field. */
static void write_head(const header *h, const char *result, const char *verb, const char *name,
                       const char *parameters)
{
    fprintf(h->out, "\nstatic inline %s %s_%s_%s(%s)\n{\n", result, h->lower, verb, name,
            parameters);
}

/* A coil or discrete input. */
static void write_bit(const header *h, const mbm_planField *planned, const cells *of,
                      const char *name)
{
    const int part = part_of(of, planned->address);
    const unsigned offset = (unsigned)(planned->address - of->first[part]);
    const char *array = of->names[part];

    if (planned->count > 1) {
        write_head(h, "uint8_t", "get", name, "uint16_t index");
        fprintf(h->out,
                "    return (uint8_t)((%s[(%uu + index) / 8u] >> ((%uu + index) %% 8u)) & 1);\n}\n",
                array, offset, offset);
        write_head(h, "void", "set", name, "uint16_t index, uint8_t on");
        fprintf(h->out,
                "    const uint8_t bit = (uint8_t)(1u << ((%uu + index) %% 8u));\n"
                "    uint8_t *byte = &%s[(%uu + index) / 8u];\n\n"
                "    *byte = (uint8_t)(on ? *byte | bit : *byte & (uint8_t)~bit);\n}\n",
                offset, array, offset);
        return;
    }
    write_head(h, "uint8_t", "get", name, "void");
    fprintf(h->out, "    return (uint8_t)((%s[%u] >> %u) & 1);\n}\n", array, offset / 8,
            offset % 8);
    write_head(h, "void", "set", name, "uint8_t on");
    fprintf(h->out,
            "    uint8_t *byte = &%s[%u];\n\n"
            "    *byte = (uint8_t)(on ? *byte | 0x%02Xu : *byte & 0x%02Xu);\n}\n",
            array, offset / 8, 1u << offset % 8, 0xFFu & ~(1u << offset % 8));
}

/* Bits of a register. */
static void write_bits(const header *h, const mbm_planField *planned, const cells *of,
                       const char *name)
{
    const unsigned mask = (1u << planned->count) - 1, shifted = mask << planned->bit;
    const char *type = header_type(planned), *at = register_of(planned, of, 0);
    const char *word = swapped(h, planned, at);

    write_head(h, type, "get", name, "void");
    fprintf(h->out, "    return (%s)((%s >> %u) & 0x%Xu);\n}\n", type, word, planned->bit, mask);
    write_head(h, "void", "set", name, say("%s value", type));
    fprintf(h->out,
            "    const uint16_t word = (uint16_t)((%s & 0x%04Xu) | (((unsigned)value << %u) & "
            "0x%04Xu));\n\n    %s = %s;\n}\n",
            word, 0xFFFFu & ~shifted, planned->bit, shifted, at, swapped(h, planned, "word"));
}

/* An integer or a float. */
static void write_number(const header *h, const mbm_planField *planned, const cells *of,
                         const char *name)
{
    static const char *const UNSIGNED[] = {"", "uint16_t", "uint32_t", "", "uint64_t"};
    const unsigned size = value_registers(planned->type, 1);
    const char *type = header_type(planned), *bits = UNSIGNED[size];
    const int is_float = planned->type == MBM_TYPE_FLOAT, is_same = strcmp(type, bits) == 0;
    const int is_cast = size > 1 && !is_same && !is_float, is_many = planned->count > 1;
    const char *value = is_same ? "value" : "bits";
    unsigned i;

    write_head(h, type, "get", name, is_many ? "uint16_t index" : "void");
    fprintf(h->out,
            is_float  ? "    const uint32_t bits = "
            : is_same ? "    return "
                      : "    return (%s)",
            type);
    fprintf(h->out, "%s", is_cast ? "(" : "");
    for (i = size; i-- > 0;) {
        const char *word = swapped(h, planned, register_of(planned, of, i));

        if (i > 0)
            fprintf(h->out, "((%s)%s << %u) | ", bits, word, 16 * i);
        else
            fprintf(h->out, "%s%s;\n", word, is_cast ? ")" : "");
    }
    fprintf(h->out, "%s}\n",
            is_float ? "    float value;\n\n    memcpy(&value, &bits, sizeof value);\n"
                       "    return value;\n"
                     : "");
    write_head(h, "void", "set", name, say("%s%s value", is_many ? "uint16_t index, " : "", type));
    if (is_float)
        fprintf(h->out, "    uint32_t bits;\n\n    memcpy(&bits, &value, sizeof bits);\n");
    else if (!is_same)
        fprintf(h->out, "    const %s bits = (%s)value;\n\n", bits, bits);
    for (i = size; i-- > 0;) {
        const char *word = i > 0 ? say("(%s >> %u)", value, 16 * i) : value;

        if (size > 1)
            word = say("(uint16_t)%s", word);
        word = swapped(h, planned, word);
        fprintf(h->out, "    %s = %s;\n", register_of(planned, of, i), word);
    }
    fprintf(h->out, "}\n");
}

/* A text or a double, by the functions of mbm/values.h. */
static void write_by_view(const header *h, const mbm_planField *planned, const cells *of,
                          const char *name)
{
    const int is_text = planned->type == MBM_TYPE_TEXT, is_many = !is_text && planned->count > 1;
    const int part = part_of(of, planned->address);
    const char *order = value_order_names[planned->order];
    int sets;

    for (sets = 0; sets < 2; sets++) {
        const char *verb = sets ? "set" : "get";

        if (is_text)
            write_head(h, "uint8_t", verb, name,
                       sets ? "const char *text" : "char *text, uint16_t capacity");
        else if (sets)
            write_head(h, "void", verb, name,
                       is_many ? "uint16_t index, double value" : "double value");
        else
            write_head(h, "double", verb, name, is_many ? "uint16_t index" : "void");
        fprintf(h->out,
                "    mbm_registers registers;\n%s\n    (void)mbm_registers_intoWords(&registers, "
                "%s, %uu, %uu);\n",
                is_text || sets ? "" : "    double value = 0;\n", of->names[part],
                (unsigned)(of->last[part] - of->first[part] + 1), (unsigned)of->first[part]);
        fprintf(h->out, "    %smbm_registers_%s%s(&registers, ", is_text ? "return " : "(void)",
                verb, is_text ? "String" : "Double");
        if (is_text)
            fprintf(h->out, "%uu, %uu, MBM_ORDER_%s, text%s);\n}\n", planned->address,
                    planned->count, order, sets ? "" : ", capacity");
        else
            fprintf(h->out, is_many ? "(uint16_t)(%uu + 4u * index), " : "%uu, ", planned->address);
        if (!is_text)
            fprintf(h->out, "MBM_ORDER_%s, &value);\n%s}\n", order,
                    sets ? "" : "    return value;\n");
    }
}

/* Writes the functions of the fields of a table. */
static void write_functions(const header *h, const cells *of)
{
    uint16_t i;

    for (i = 0; i < h->of->count; i++) {
        const mbm_planField *planned = &h->of->planned[i];
        const char *name = h->lowers[i];

        if (planned->unit != of->unit || planned->table != of->table)
            continue;
        fprintf(h->out, "\n/* ");
        header_comment(h->out, h->of->fields[i].name);
        fprintf(h->out, " */");
        if (header_is_special(planned))
            header_write_special(h, i, name, of->names[part_of(of, planned->address)],
                                 of->first[part_of(of, planned->address)],
                                 of->last[part_of(of, planned->address)]);
        else if (device_is_part(planned))
            write_bits(h, planned, of, name);
        else if (planned->type == MBM_TYPE_BIT)
            write_bit(h, planned, of, name);
        else if (planned->type == MBM_TYPE_TEXT || planned->type == MBM_TYPE_DOUBLE)
            write_by_view(h, planned, of, name);
        else
            write_number(h, planned, of, name);
    }
}

/* Whether the functions of a field swap bytes themselves. */
static int needs_swap(const mbm_planField *planned)
{
    return is_swapped(planned) && planned->type < MBM_TYPE_DOUBLE && !header_is_special(planned) &&
           !(planned->type == MBM_TYPE_BIT && device_is_of_bits(planned->table));
}

/* Writes the function that swaps bytes, if one of those needs it. */
static void write_swap(const header *h)
{
    uint16_t i;

    for (i = 0; i < h->of->count && !needs_swap(&h->of->planned[i]);)
        i++;
    if (i < h->of->count)
        fprintf(h->out,
                "\nstatic inline uint16_t %s_swap(uint16_t word)\n{\n"
                "    return (uint16_t)((word << 8) | (word >> 8));\n}\n",
                h->lower);
}

/* --- the part --- */

/* Writes the assignments of the file's values to the cells of a table. */
static void write_values(const header *h, const cells *of)
{
    const uint32_t step = device_is_of_bits(of->table) ? 8 : 1;
    uint32_t at, bit;
    int part;

    for (part = 0; part < of->parts; part++)
        for (at = of->first[part]; at <= of->last[part]; at += step) {
            unsigned value = of->words[at];

            for (bit = 1; bit < step && at + bit <= of->last[part]; bit++)
                value |= (unsigned)(of->words[at + bit] << bit);
            if (value == 0)
                continue;
            fprintf(h->out, "    %s[%u] = 0x%0*Xu;\n", of->names[part],
                    (unsigned)((at - of->first[part]) / step), step == 8 ? 2 : 4, value);
        }
}

/* Calls a function for each table of each unit. */
static void for_each_table(const header *h, cells *of,
                           void (*write)(const header *h, const cells *of))
{
    uint16_t unit;
    uint8_t table;

    for (unit = 1; unit <= 255; unit++)
        for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
            find_cells(h, unit, table, of);
            if (of->parts > 0)
                write(h, of);
        }
}

static int has_float(const header *h)
{
    uint16_t i;

    for (i = 0; i < h->of->count && h->of->planned[i].type != MBM_TYPE_FLOAT;)
        i++;
    return i < h->of->count;
}

/* Writes it, with memory for the cells. */
static void write_all(const header *h, cells *of)
{
    uint16_t unit;

    fprintf(h->out,
            "\n/* ==== The server: the device's cells. Define %s_SERVER in one file of a program "
            "==== */\n\n#ifdef %s_SERVER\n#include \"mbm.h\"\n",
            h->upper, h->upper);
    if (has_float(h))
        fprintf(h->out, "\n#include <string.h>\n");
    for (unit = 1; unit <= 255; unit++)
        write_unit(h, unit, of);
    write_swap(h);
    fprintf(h->out, "\n/* Get and set the value of a field: the number that is in the registers, "
                    "without its scale. An index\n * counts from 0 and is less than the field's "
                    "_COUNT. */\n");
    for_each_table(h, of, write_functions);
    fprintf(h->out,
            "\n/* Sets the values of the device file. */\n"
            "static inline void %s_initialise(void)\n{\n",
            h->lower);
    for_each_table(h, of, write_values);
    fprintf(h->out, "}\n#endif\n");
}

int header_write_server(header *h)
{
    cells *of = (cells *)malloc(sizeof *of);

    if (!of) {
        (void)report(CODE_SYSTEM, REPORT_NO_MEMORY);
        return 0;
    }
    write_all(h, of);
    free(of);
    return 1;
}
