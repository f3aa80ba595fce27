/* The part of a device's header for a server: its tables, and what clients may do with their cells.
 * Licence: MIT OR Apache-2.0. */
#include "header_cells.h"

#include "report.h"

#include <stdlib.h>

/* --- tables --- */

/* Returns whether every cell of a part has this; or none, if `wanted` is 0. */
static int is_all(const header_cells *of, int part, uint8_t what, int wanted)
{
    uint32_t at;

    for (at = of->first[part]; at <= of->last[part]; at++)
        if (of->has[at] && ((of->has[at] & what) != 0) != wanted)
            return 0;
    return 1;
}

/* Writes the map of the cells that exist, if there are holes. */
static int write_valid(const header *h, const header_cells *of, int part)
{
    const uint32_t first = of->first[part], last = of->last[part];
    uint32_t at, count = 0;

    for (at = first; at <= last; at++)
        count += of->has[at] != 0;
    if (count == last - first + 1)
        return 0;
    fprintf(h->out, "static const uint8_t ");
    header_write_name(h, of, part);
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
static void write_guard(const header *h, const header_cells *of, int part, uint8_t what,
                        const char *name)
{
    const uint32_t first = of->first[part], last = of->last[part];
    const char *word = last == HEADER_CELLS - 1 ? "last" : "end";
    uint32_t at, end;
    int ranges = 0;

    fprintf(h->out, "static inline uint8_t ");
    header_write_name(h, of, part);
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
            word, last == HEADER_CELLS - 1 ? " - 1u" : "", word);
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
            fprintf(h->out, "%s <= %uu", word,
                    (unsigned)(last == HEADER_CELLS - 1 ? end : end + 1));
        fprintf(h->out, ")");
    }
    fprintf(h->out, "\n               ? MBM_OK\n               : MBM_ILLEGAL_DATA_ADDRESS;\n}\n");
}

/* Writes the guards of a part. Returns whether there are some. */
static int write_guards(const header *h, const header_cells *of, int part)
{
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
    fprintf(h->out, "static const mbm_accessHooks ");
    header_write_name(h, of, part);
    fprintf(h->out, "_hooks = {NULL, ");
    if (guards_read)
        header_write_name(h, of, part);
    fprintf(h->out, guards_read ? "_before_read, " : "NULL, ");
    if (guards_write)
        header_write_name(h, of, part);
    fprintf(h->out, guards_write ? "_before_write, NULL};\n" : "NULL, NULL};\n");
    return 1;
}

/* Writes the array of a part and its record. */
static void write_part(const header *h, const header_cells *of, int part)
{
    const uint32_t first = of->first[part], size = of->last[part] - first + 1;
    int has_holes;

    fprintf(h->out, "\n/* %s", header_table_name(of->table));
    if (h->unit == 0)
        fprintf(h->out, " of unit %u", of->unit);
    fprintf(h->out, ": addresses %u to %u */\n", (unsigned)first, (unsigned)of->last[part]);
    fprintf(h->out, header_is_bits(of->table) ? "static uint8_t " : "static uint16_t ");
    header_write_name(h, of, part);
    fprintf(h->out, "[%u];\n", (unsigned)(header_is_bits(of->table) ? (size + 7) / 8 : size));
    has_holes = write_valid(h, of, part);
    fprintf(h->out,
            header_is_bits(of->table) ? "static mbm_bitTable " : "static mbm_registerTable ");
    header_write_name(h, of, part);
    fprintf(h->out, "_table = {\n    MBM_INIT, ");
    header_write_name(h, of, part);
    fprintf(h->out, ", ");
    if (has_holes)
        header_write_name(h, of, part);
    fprintf(h->out, "%s, MBM_INIT, %uu, %uu};\n", has_holes ? "_valid" : "NULL", (unsigned)first,
            (unsigned)size);
}

/* Writes the call that serves a part. */
static void write_serve(const header *h, const header_cells *of, int part, int is_guarded,
                        int is_first)
{
    static const char *const CALLS[] = {"", "Coils", "DiscreteInputs", "HoldingRegisters",
                                        "InputRegisters"};

    fprintf(h->out, "    %s = mbm_unit_serve%s(unit, &", is_first ? "status" : "other",
            CALLS[of->table]);
    header_write_name(h, of, part);
    fprintf(h->out, "_table);\n");
    if (!is_first)
        fprintf(h->out, "    if (status == MBM_OK)\n        status = other;\n");
    if (!is_guarded)
        return;
    fprintf(h->out, "    (void)mbm_%sTable_setHooks(&",
            header_is_bits(of->table) ? "bit" : "register");
    header_write_name(h, of, part);
    fprintf(h->out, "_table, &");
    header_write_name(h, of, part);
    fprintf(h->out, "_hooks);\n");
}

/* Writes the tables of a unit and the function that serves them. */
static void write_unit(const header *h, uint16_t unit, header_cells *of)
{
    uint8_t guarded[MBM_TABLE_INPUT_REGISTERS + 1][HEADER_TABLES] = {{0}};
    int parts = 0, part;
    uint8_t table;

    for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
        header_find_cells(h, unit, table, of);
        parts += of->parts;
        for (part = 0; part < of->parts; part++) {
            write_part(h, of, part);
            guarded[table][part] = (uint8_t)write_guards(h, of, part);
        }
    }
    if (parts == 0)
        return;
    fprintf(h->out,
            "\n/* Registers these tables for a unit. Returns MBM_OK, or the first status that is "
            "another. */\nstatic inline uint8_t %s_",
            h->lower);
    if (h->unit == 0)
        fprintf(h->out, "unit%u_", unit);
    fprintf(h->out, "serve(mbm_unit *unit)\n{\n    uint8_t status%s;\n\n",
            parts > 1 ? ", other" : "");
    parts = 0;
    for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
        header_find_cells(h, unit, table, of);
        for (part = 0; part < of->parts; part++)
            write_serve(h, of, part, guarded[table][part], parts++ == 0);
    }
    fprintf(h->out, "    return status;\n}\n");
}

/* --- fields --- */

/* Writes the functions of the fields of a table. Returns 0 without memory. */
static int write_functions(const header *h, const header_cells *of)
{
    uint16_t i;

    for (i = 0; i < h->of->count; i++)
        if (h->of->planned[i].unit == of->unit && h->of->planned[i].table == of->table &&
            !header_write_accessors(h, i, of))
            return 0;
    return 1;
}

/* Writes the assignments that give the cells of a table the values of the file. */
static int write_values(const header *h, const header_cells *of)
{
    const int is_bits = header_is_bits(of->table);
    uint32_t at, bit;
    int part;

    for (part = 0; part < of->parts; part++)
        for (at = of->first[part]; at <= of->last[part]; at += is_bits ? 8 : 1) {
            unsigned value = of->words[at];

            for (bit = 1; is_bits && bit < 8 && at + bit <= of->last[part]; bit++)
                value |= (unsigned)(of->words[at + bit] << bit);
            if (value == 0)
                continue;
            fprintf(h->out, "    ");
            header_write_name(h, of, part);
            fprintf(h->out, "[%u] = 0x%0*Xu;\n",
                    (unsigned)((at - of->first[part]) / (is_bits ? 8 : 1)), is_bits ? 2 : 4, value);
        }
    return 1;
}

/* Calls a function for each table of each unit. Returns 0 if it does. */
static int for_each_table(const header *h, header_cells *of,
                          int (*write)(const header *h, const header_cells *of))
{
    uint16_t unit;
    uint8_t table;

    for (unit = 1; unit <= 255; unit++)
        for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
            header_find_cells(h, unit, table, of);
            if (of->parts > 0 && !write(h, of))
                return 0;
        }
    return 1;
}

/* --- the part --- */

static int has_float(const header *h)
{
    uint16_t i;

    for (i = 0; i < h->of->count && h->of->planned[i].type != MBM_TYPE_FLOAT;)
        i++;
    return i < h->of->count;
}

/* Writes it, with memory for the cells. Returns 0 without memory. */
static int write_all(const header *h, header_cells *of)
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
    header_write_swap(h);
    fprintf(h->out, "\n/* Get and set the value of a field: the number that is in the registers, "
                    "without its scale. An index\n * counts from 0 and is less than the field's "
                    "_COUNT. */\n");
    if (!for_each_table(h, of, write_functions))
        return 0;
    fprintf(h->out,
            "\n/* Sets the values of the device file. */\n"
            "static inline void %s_initialise(void)\n{\n",
            h->lower);
    (void)for_each_table(h, of, write_values);
    fprintf(h->out, "}\n#endif\n");
    return 1;
}

int header_write_server(header *h)
{
    header_cells *of = (header_cells *)malloc(sizeof *of);
    const int is_right = of && write_all(h, of);

    free(of);
    if (!is_right)
        (void)report(CODE_SYSTEM, "there is no memory");
    return is_right;
}
