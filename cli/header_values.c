/* The functions of a device's header that get and set the value of a field in the tables of a
 * server. Licence: MIT OR Apache-2.0. */
#include "header_cells.h"

#include <stdlib.h>
#include <string.h>

/* Writes one register of a field as an integer: that with the given number of 16 bits, from the
 * least significant on. */
static void write_register(const header *h, uint16_t at, const header_cells *of,
                           unsigned significance)
{
    const mbm_planField *planned = &h->of->planned[at];
    const unsigned size = value_registers(planned->type, 1);
    const int part = header_part_of(of, planned->address);
    const int is_low_first = planned->order == MBM_ORDER_CDAB || planned->order == MBM_ORDER_DCBA;
    const unsigned offset = (unsigned)(planned->address - of->first[part]) +
                            (is_low_first ? significance : size - 1 - significance);

    header_write_name(h, of, part);
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
static void write_word(const header *h, uint16_t at, const header_cells *of, unsigned significance)
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
static void write_bit(const header *h, uint16_t at, const header_cells *of, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const int part = header_part_of(of, planned->address);
    const unsigned offset = (unsigned)(planned->address - of->first[part]);
    const int is_many = planned->count > 1;

    write_head(h, "uint8_t", "get", name, is_many ? "uint16_t index" : "void");
    fprintf(h->out, "    return (uint8_t)((");
    header_write_name(h, of, part);
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
    header_write_name(h, of, part);
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
static void write_bits(const header *h, uint16_t at, const header_cells *of, const char *name)
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
static void write_number(const header *h, uint16_t at, const header_cells *of, const char *name)
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
static void write_by_view(const header *h, uint16_t at, const header_cells *of, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const int is_text = planned->type == MBM_TYPE_TEXT, is_many = !is_text && planned->count > 1;
    const int part = header_part_of(of, planned->address);
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
        header_write_name(h, of, part);
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

int header_write_accessors(const header *h, uint16_t at, const header_cells *of)
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

/* Whether the functions of a field swap bytes themselves. */
static int needs_swap(const mbm_planField *planned)
{
    return is_swapped(planned) && planned->type < MBM_TYPE_DOUBLE &&
           !(planned->type == MBM_TYPE_BIT && header_is_bits(planned->table));
}

void header_write_swap(const header *h)
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
