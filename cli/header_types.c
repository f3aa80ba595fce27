/* The part of a device's header for types that a plan does not know: functions that take the value
 * of a field out of registers, and put it into them.
 *
 * Licence: MIT OR Apache-2.0. */
#include "header.h"

#include "numbers.h"

#include <stdlib.h>
#include <string.h>

/* A pair of functions on mbm_registers. */
typedef struct accessor {
    const char *name;   /* what follows mbm_registers_get and mbm_registers_set */
    const char *type;   /* of the value in C */
    const char *cast;   /* of a pointer to it, or "" */
    uint8_t has_count;  /* they take the number of registers */
    uint8_t by_pointer; /* the value to be set is passed by pointer */
} accessor;

static const accessor ACCESSORS[] = {
    [MBM_TYPE_UINT64] = {"Uint64", "uint64_t", "", 0, 1},
    [MBM_TYPE_INT64] = {"Uint64", "int64_t", "uint64_t", 0, 1},
    [MBM_TYPE_DOUBLE] = {"Double", "double", "", 0, 1},
    [VALUE_INT24] = {"Int24", "int32_t", "", 0, 0},
    [VALUE_UINT24] = {"Uint24", "uint32_t", "", 0, 0},
    [VALUE_INT48] = {"Int48", "int64_t", "", 0, 1},
    [VALUE_UINT48] = {"Uint48", "uint64_t", "", 0, 1},
    [VALUE_SIGN_MAGNITUDE16] = {"SignMagnitude", "int32_t", "", 1, 0},
    [VALUE_SIGN_MAGNITUDE32] = {"SignMagnitude", "int32_t", "", 1, 0},
    [VALUE_BCD16] = {"Bcd", "uint32_t", "", 1, 0},
    [VALUE_BCD32] = {"Bcd", "uint32_t", "", 1, 0},
    [VALUE_INT32_M10K] = {"SignedM10k", "int64_t", "", 1, 1},
    [VALUE_UINT32_M10K] = {"M10k", "uint64_t", "", 1, 1},
    [VALUE_INT48_M10K] = {"SignedM10k", "int64_t", "", 1, 1},
    [VALUE_UINT48_M10K] = {"M10k", "uint64_t", "", 1, 1},
    [VALUE_INT64_M10K] = {"SignedM10k", "int64_t", "", 1, 1},
    [VALUE_UINT64_M10K] = {"M10k", "uint64_t", "", 1, 1},
    [VALUE_FLOAT16] = {"Half", "float", "", 0, 1},
    [VALUE_UNIX32] = {"Uint32", "uint32_t", "", 0, 0},
    [VALUE_UNIX64] = {"Uint64", "int64_t", "uint64_t", 0, 1},
    [VALUE_UNIX64_MS] = {"Uint64", "int64_t", "uint64_t", 0, 1},
    [VALUE_SECONDS_2000] = {"Uint32", "uint32_t", "", 0, 0},
    [VALUE_IEC870] = {"IecDate", "mbm_date", "", 1, 1},
    [VALUE_IEC870_3] = {"IecDate", "mbm_date", "", 1, 1},
    [VALUE_BITS32] = {"Bits", "uint64_t", "", 1, 1},
    [VALUE_BITS64] = {"Bits", "uint64_t", "", 1, 1},
};
static const accessor DATE = {"Date", "mbm_date", "", 0, 1};

int header_is_special(const mbm_planField *planned)
{
    return !value_is_of_plan(planned->type, planned->order);
}

static const accessor *accessor_of(const mbm_planField *planned)
{
    return planned->type >= VALUE_DATE_OF_1 ? &DATE : &ACCESSORS[planned->type];
}

const char *header_number_type(const mbm_planField *planned)
{
    return header_is_special(planned) ? accessor_of(planned)->type : header_type(planned);
}

static int is_date(const mbm_planField *planned)
{
    return strcmp(accessor_of(planned)->type, "mbm_date") == 0;
}

/* The parameters of the functions of a field, beside the registers. */
static void write_parameters(FILE *out, const mbm_planField *planned, int sets)
{
    const char *type = value_is_text(planned->type) ? NULL : accessor_of(planned)->type;

    if (device_values_in(planned) > 1)
        fprintf(out, "uint16_t index, ");
    if (!type)
        fprintf(out, sets ? "const char *text" : "char *text, uint16_t capacity");
    else if (sets)
        fprintf(out, is_date(planned) ? "const %s *value" : "%s value", type);
    else
        fprintf(out, "%s *value", type);
}

/* The same as arguments. */
static void write_arguments(FILE *out, const mbm_planField *planned, int sets)
{
    if (device_values_in(planned) > 1)
        fprintf(out, "index, ");
    if (value_is_text(planned->type))
        fprintf(out, sets ? "text" : "text, capacity");
    else
        fprintf(out, "value");
}

/* The address of a value. */
static const char *address_of(const mbm_planField *planned)
{
    return device_values_in(planned) > 1 ? say("(uint16_t)(%uu + %uu * index)", planned->address,
                                               value_registers(planned->type, 1))
                                         : say("%uu", planned->address);
}

/* Writes the call of a function on mbm_registers. */
static void write_call(FILE *out, const device_field *field, const mbm_planField *planned, int sets)
{
    const char *verb = sets ? "set" : "get", *order = value_order_names[planned->order];
    const accessor *own = accessor_of(planned);

    if (value_is_text(planned->type)) {
        fprintf(out, "mbm_registers_%sText(registers, %uu, %uu, MBM_ORDER_%s, %uu, text%s)", verb,
                planned->address, planned->count, order, value_text_form(planned->type),
                sets ? "" : ", capacity");
        return;
    }
    fprintf(out, "mbm_registers_%s%s(registers, %s, ", verb, own->name, address_of(planned));
    if (own->has_count)
        fprintf(out, "%uu, ", value_registers(planned->type, 1));
    fprintf(out, "MBM_ORDER_%s, ", order);
    if (device_is_wide_part(planned))
        fprintf(out, "%uu, %uu, ", planned->bit, planned->count);
    if (planned->type >= VALUE_DATE_OF_1)
        fprintf(out, "\"%s\", %u, ", field->layout, planned->type >= VALUE_DATE_BCD_OF_1);
    if (*own->cast)
        fprintf(out, sets ? "(const %s *)" : "(%s *)", own->cast);
    fprintf(out, sets && own->by_pointer && !is_date(planned) ? "&value)" : "value)");
}

/* Writes the functions that take a field out of registers and put it into them. */
static void write_pair(const header *h, uint16_t at)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    char *name = header_lower(h->fields[at]);
    int sets;

    fprintf(h->out, "\n/* ");
    header_comment(h->out, field->name);
    fprintf(h->out, " */");
    for (sets = 0; name && sets < 2; sets++) {
        fprintf(h->out, "\nstatic inline uint8_t %s_%s_%s(const mbm_registers *registers, ",
                h->lower, sets ? "put" : "take", name);
        write_parameters(h->out, planned, sets);
        fprintf(h->out, ")\n{\n    return ");
        write_call(h->out, field, planned, sets);
        fprintf(h->out, ";\n}\n");
    }
    free(name);
}

void header_write_types(const header *h)
{
    uint16_t i, count = 0;

    for (i = 0; i < h->of->count; i++)
        count = (uint16_t)(count + header_is_special(&h->of->planned[i]));
    if (count == 0)
        return;
    fprintf(h->out,
            "\n/* ==== Values that have functions of mbm/values.h. Take one out of registers, such "
            "as those of\n * mbm_plan_getRegisters, or put one into them. They return a status. "
            "==== */\n\n"
            "#if defined(%s_PLAN) || defined(%s_SERVER)\n#include \"mbm.h\"\n",
            h->upper, h->upper);
    for (i = 0; i < h->of->count; i++)
        if (header_is_special(&h->of->planned[i]))
            write_pair(h, i);
    fprintf(h->out, "#endif\n");
}

void header_write_special(const header *h, uint16_t at, const char *name, const char *array,
                          uint32_t first, uint32_t last)
{
    const mbm_planField *planned = &h->of->planned[at];
    int sets;

    for (sets = 0; sets < 2; sets++) {
        fprintf(h->out, "\nstatic inline uint8_t %s_%s_%s(", h->lower, sets ? "set" : "get", name);
        write_parameters(h->out, planned, sets);
        fprintf(h->out,
                ")\n{\n    mbm_registers registers;\n\n"
                "    (void)mbm_registers_intoWords(&registers, %s, %uu, %uu);\n"
                "    return %s_%s_%s(&registers, ",
                array, (unsigned)(last - first + 1), (unsigned)first, h->lower,
                sets ? "put" : "take", name);
        write_arguments(h->out, planned, sets);
        fprintf(h->out, ");\n}\n");
    }
}
