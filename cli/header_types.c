/* The part of a device's header for types that a plan does not know: functions that take the value
 * of a field out of registers and put it into them, and that get it of a plan with its scale. */
#include "header.h"

#include "numbers.h"

#include <inttypes.h>
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

/* Those of a function that gets, as arguments. */
static void write_arguments(FILE *out, const mbm_planField *planned)
{
    fprintf(out, "%s%s", device_values_in(planned) > 1 ? "index, " : "",
            value_is_text(planned->type) ? "text, capacity" : "value");
}

/* The address of a value. */
static const char *address_of(const mbm_planField *planned)
{
    return device_values_in(planned) > 1 ? say("(uint16_t)(%uu + %uu * index)", planned->address,
                                               value_registers(planned->type, 1))
                                         : say("%uu", planned->address);
}

/* Writes the call of a function on mbm_registers, on the registers that `registers` points to, with
 * the value in `value`. */
static void write_call(FILE *out, const device_field *field, const mbm_planField *planned, int sets,
                       const char *registers, const char *value)
{
    const char *verb = sets ? "set" : "get", *order = value_order_names[planned->order];
    const accessor *own = accessor_of(planned);

    if (value_is_text(planned->type)) {
        fprintf(out, "mbm_registers_%sText(%s, %uu, %uu, MBM_ORDER_%s, %uu, text%s)", verb,
                registers, planned->address, planned->count, order, value_text_form(planned->type),
                sets ? "" : ", capacity");
        return;
    }
    fprintf(out, "mbm_registers_%s%s(%s, %s, ", verb, own->name, registers, address_of(planned));
    if (own->has_count)
        fprintf(out, "%uu, ", value_registers(planned->type, 1));
    fprintf(out, "MBM_ORDER_%s, ", order);
    if (device_is_wide_part(planned))
        fprintf(out, "%uu, %uu, ", planned->bit, planned->count);
    if (planned->type >= VALUE_DATE_OF_1)
        fprintf(out, "\"%s\", %u, ", field->layout, planned->type >= VALUE_DATE_BCD_OF_1);
    if (*own->cast)
        fprintf(out, sets ? "(const %s *)" : "(%s *)", own->cast);
    fprintf(out, "%s%s)", sets && own->by_pointer && !is_date(planned) ? "&" : "", value);
}

/* --- not available --- */

/* Whether each number of a type has one form in the registers, so that numbers can be compared in
 * place of registers. */
static int is_one_to_one(uint8_t type)
{
    switch (type) {
    case MBM_TYPE_UINT64:
    case MBM_TYPE_INT64:
    case VALUE_INT48:
    case VALUE_UINT48:
    case VALUE_UNIX32:
    case VALUE_UNIX64:
    case VALUE_UNIX64_MS:
    case VALUE_SECONDS_2000:
    /* Of these not all bits of the registers count. */
    case VALUE_INT24:
    case VALUE_UINT24:
    case VALUE_BITS32:
    case VALUE_BITS64: return 1;
    default: return 0;
    }
}

/* The numbers of a field that mean "not available". */
static unsigned listed(const device_field *field)
{
    return field->conversion ? field->conversion->number_count : 0;
}

static int is_standard(const device_field *field, const mbm_planField *planned)
{
    return field->conversion && field->conversion->is_standard &&
           (value_is_text(planned->type) || planned->type == MBM_TYPE_UINT64 ||
            planned->type == MBM_TYPE_INT64);
}

/* Whether the registers of a field are compared with a list. */
static int has_list(const device_field *field, const mbm_planField *planned)
{
    return listed(field) > 0 && !is_one_to_one(planned->type);
}

/* A number that means "not available", as a constant in C. */
static const char *number_of(const device_field *field, const mbm_planField *planned, unsigned at)
{
    const uint16_t size = value_registers(planned->type, 1);
    const uint8_t order = planned->order;
    mbm_registers registers;
    uint64_t number = 0;
    int32_t two = 0;

    (void)mbm_registers_ofWords(&registers, field->conversion->numbers[at], size, 0);
    switch (planned->type) {
    case VALUE_INT24:
        (void)mbm_registers_getInt24(&registers, 0, order, &two);
        number = (uint64_t)(int64_t)two;
        break;
    case VALUE_UINT24: (void)mbm_registers_getBits(&registers, 0, 2, order, 0, 24, &number); break;
    case VALUE_INT48: (void)mbm_registers_getInt48(&registers, 0, order, (int64_t *)&number); break;
    case VALUE_BITS32:
    case VALUE_BITS64:
        (void)mbm_registers_getBits(&registers, 0, size, order, planned->bit,
                                    (uint8_t)planned->count, &number);
        break;
    default:
        (void)mbm_registers_getBits(&registers, 0, size, order, 0, (uint8_t)(16 * size), &number);
    }
    return accessor_of(planned)->type[0] == 'i' ? say("%" PRId64, (int64_t)number)
                                                : say("%" PRIu64, number);
}

/* Writes the list of a field, as its registers have the numbers. */
static void write_list(const header *h, const device_field *field, const mbm_planField *planned)
{
    const unsigned size = value_registers(planned->type, 1);
    unsigned i;

    fprintf(h->out, "    static const uint16_t numbers[%u] = {", listed(field) * size);
    for (i = 0; i < listed(field) * size; i++)
        fprintf(h->out, "%s0x%04Xu", i > 0 ? ", " : "",
                field->conversion->numbers[i / size][i % size]);
    fprintf(h->out,
            "};\n\n    if (%s_is_one_of(registers, %s, %uu, numbers, %uu))\n"
            "        return MBM_NOT_AVAILABLE;\n",
            h->lower, address_of(planned), size, listed(field));
}

/* Writes the body of a function that compares the number with those that are not available. */
static void write_comparison(const header *h, const device_field *field,
                             const mbm_planField *planned)
{
    unsigned i;

    fprintf(h->out, "    %s number = 0;\n    const uint8_t status = ", accessor_of(planned)->type);
    write_call(h->out, field, planned, 0, "registers", "&number");
    fprintf(h->out, ";\n\n    if (status != MBM_OK)\n        return status;\n    if (");
    for (i = 0; i < listed(field); i++) {
        fprintf(h->out, "%snumber == ", i > 0 ? " || " : "");
        header_write_constant(h->out, number_of(field, planned, i));
    }
    if (is_standard(field, planned))
        fprintf(h->out, "%snumber == %s", i > 0 ? " || " : "",
                planned->type == MBM_TYPE_INT64 ? "INT64_MIN" : "UINT64_MAX");
    fprintf(h->out,
            ")\n        return MBM_NOT_AVAILABLE;\n    *value = number;\n    return MBM_OK;\n");
}

/* Writes the functions of C that those of fields call, if one does. */
static void write_helpers(const header *h)
{
    int has_lists = 0, has_texts = 0;
    uint16_t i;

    for (i = 0; i < h->of->count; i++) {
        const mbm_planField *planned = &h->of->planned[i];

        if (!header_is_special(planned))
            continue;
        has_lists |= has_list(&h->of->fields[i], planned);
        has_texts |= value_is_text(planned->type) && is_standard(&h->of->fields[i], planned);
    }
    if (has_lists)
        fprintf(
            h->out,
            "\n/* Whether registers are one of `count` numbers of `size` words. */\n"
            "static inline int %s_is_one_of(const mbm_registers *registers, uint16_t address, "
            "uint8_t size,\n    const uint16_t *numbers, uint8_t count)\n{\n"
            "    for (; count > 0; count--, numbers += size) {\n"
            "        uint16_t word = 0;\n        uint8_t i = 0;\n\n"
            "        while (i < size && mbm_registers_getUint16(registers, (uint16_t)(address + i), "
            "MBM_ORDER_ABCD, &word) == MBM_OK && word == numbers[i])\n            i++;\n"
            "        if (i == size)\n            return 1;\n    }\n    return 0;\n}\n",
            h->lower);
    if (has_texts)
        fprintf(h->out,
                "\n/* Whether registers are all 0. */\n"
                "static inline int %s_are_zero(const mbm_registers *registers, uint16_t address, "
                "uint16_t count)\n{\n    uint16_t word = 0;\n\n"
                "    for (; count > 0; count--, address++)\n"
                "        if (mbm_registers_getUint16(registers, address, MBM_ORDER_ABCD, &word) != "
                "MBM_OK || word != 0)\n            return 0;\n    return 1;\n}\n",
                h->lower);
}

/* --- out of registers and into them --- */

static void write_take(const header *h, uint16_t at, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];

    fprintf(h->out, "\nstatic inline uint8_t %s_take_%s(const mbm_registers *registers, ", h->lower,
            name);
    write_parameters(h->out, planned, 0);
    fprintf(h->out, ")\n{\n");
    if (is_one_to_one(planned->type) && (listed(field) > 0 || is_standard(field, planned))) {
        write_comparison(h, field, planned);
    } else {
        if (has_list(field, planned))
            write_list(h, field, planned);
        else if (is_standard(field, planned))
            fprintf(h->out,
                    "    if (%s_are_zero(registers, %uu, %uu))\n"
                    "        return MBM_NOT_AVAILABLE;\n",
                    h->lower, planned->address, (unsigned)device_size(planned));
        fprintf(h->out, "    return ");
        write_call(h->out, field, planned, 0, "registers", "value");
        fprintf(h->out, ";\n");
    }
    fprintf(h->out, "}\n");
}

static void write_put(const header *h, uint16_t at, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];

    fprintf(h->out, "\nstatic inline uint8_t %s_put_%s(const mbm_registers *registers, ", h->lower,
            name);
    write_parameters(h->out, planned, 1);
    fprintf(h->out, ")\n{\n");
    if (header_is_checked(h, at))
        fprintf(h->out,
                "    const uint8_t status = %s_check_%s(value);\n\n"
                "    if (status != MBM_OK)\n        return status;\n",
                h->lower, name);
    fprintf(h->out, "    return ");
    write_call(h->out, &h->of->fields[at], planned, 1, "registers", "value");
    fprintf(h->out, ";\n}\n");
}

/* --- with its scale --- */

/* Whether a field has a value that is more than what is taken out of the registers. */
static int is_converted(const device_field *field, const mbm_planField *planned)
{
    return !value_is_text(planned->type) && !value_is_date(planned->type) &&
           (header_is_scaled(field) || field->power_name || listed(field) > 0 ||
            is_standard(field, planned) || conversion_has_offset(field->conversion));
}

/* Whether all numbers of a type have 32 bits. */
static int is_short(uint8_t type)
{
    const value_range range = value_range_of(type);

    return value_is_integer(type) && !value_is_wide_bits(type) &&
           (range.below_zero == 0 ? range.most <= UINT32_MAX
                                  : range.below_zero <= (uint64_t)INT32_MAX + 1);
}

/* The type of the plan that has the numbers of a field, without MBM_TYPE_. */
static const char *type_as(const mbm_planField *planned)
{
    const char own = accessor_of(planned)->type[0];

    if (own == 'f')
        return "FLOAT";
    if (own == 'd')
        return "DOUBLE";
    if (is_short(planned->type))
        return own == 'i' ? "INT32" : "UINT32";
    return own == 'i' ? "INT64" : "UINT64";
}

/* Writes the constants that describe the number as a field of a plan: its registers are the first
 * ones of a view, and those of its power of ten follow. Returns 0 after reporting a refusal. */
static int write_as(const header *h, uint16_t at, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    const header_scale *scale = &h->scales[at];
    const int is_scaled = header_is_scaled(field), has_power = field->power_name != NULL;
    unsigned decimals;
    int32_t offset;

    if (!header_find_offset(h, field, &offset, &decimals))
        return 0;
    fprintf(h->out,
            "\nstatic const mbm_planField %s_%s_as[%u] = {\n"
            "    {1u, MBM_TABLE_HOLDING_REGISTERS, MBM_TYPE_%s, MBM_ORDER_ABCD, 0u, 0u, 1u, 1000u, "
            "%" PRId32 ", %" PRId32 "}%s};\n",
            h->lower, name, has_power ? 2 : 1, type_as(planned), is_scaled ? scale->multiplier : 0,
            is_scaled ? scale->divisor : 0,
            has_power
                ? ",\n    {1u, MBM_TABLE_HOLDING_REGISTERS, MBM_TYPE_INT16, MBM_ORDER_ABCD, 0u, "
                  "4u, 1u, 1000u, 0, 0}"
                : "");
    fprintf(h->out,
            "static const mbm_planConversion %s_%s_conversion = {NULL, %" PRId32 ", %uu, 0u, %uu, "
            "%s};\n",
            h->lower, name, offset, has_power, decimals, has_power ? "MBM_CONVERSION_POWER" : "0u");
    if (has_power)
        fprintf(h->out,
                "static const mbm_planConversion %s_%s_power = {NULL, 0, %s_%s, 0u, 0u, "
                "MBM_CONVERSION_POWER};\n",
                h->lower, name, h->upper, h->fields[field->power_field]);
    return 1;
}

/* Writes the function that copies the number of a plan, and the power of ten after it, to such a
 * view. */
static void write_fetch(const header *h, uint16_t at, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    const int is_several = device_values_in(planned) > 1, has_power = field->power_name != NULL;
    const char *type = type_as(planned), *own = accessor_of(planned)->type;
    const int is_real = own[0] == 'f' || own[0] == 'd';

    fprintf(h->out,
            "static inline uint8_t %s_fetch_%s(const mbm_plan *plan, %suint16_t words[5], "
            "mbm_registers *own)\n{\n    mbm_registers registers;\n%s    %s number = 0;\n"
            "    uint8_t status = mbm_plan_getRegisters(plan, %s_%s, &registers);\n\n"
            "    if (status == MBM_OK)\n        status = %s_take_%s(&registers, %s&number);\n",
            h->lower, name, is_several ? "uint16_t index, " : "",
            has_power ? "    int32_t power = 0;\n" : "", own, h->upper, h->fields[at], h->lower,
            name, is_several ? "index, " : "");
    if (has_power)
        fprintf(h->out,
                "    if (status == MBM_OK)\n"
                "        status = mbm_plan_checkAvailable(plan, %s_%s, 0, &%s_%s_power);\n"
                "    if (status == MBM_OK)\n"
                "        status = mbm_plan_getInt32(plan, %s_%s, 0, &power);\n",
                h->upper, h->fields[at], h->lower, name, h->upper, h->fields[field->power_field]);
    fprintf(h->out,
            "    if (status != MBM_OK)\n        return status;\n%s"
            "    (void)mbm_registers_intoWords(own, words, 5u, 0u);\n    return ",
            has_power ? "    words[4] = (uint16_t)power;\n" : "");
    if (is_real)
        fprintf(h->out, "mbm_registers_set%s(own, 0u, MBM_ORDER_ABCD, &number);\n}\n",
                own[0] == 'f' ? "Float" : "Double");
    else if (is_short(planned->type))
        fprintf(h->out, "mbm_registers_setUint32(own, 0u, MBM_ORDER_ABCD, (uint32_t)number);\n}\n");
    else
        fprintf(h->out, "mbm_registers_setUint64(own, 0u, MBM_ORDER_ABCD, %s&number);\n}\n",
                type[0] == 'I' ? "(const uint64_t *)" : "");
}

/* Writes the functions that get the value of a plan. Returns 0 after reporting a refusal. */
static int write_getters(const header *h, uint16_t at, const char *name)
{
    const mbm_planField *planned = &h->of->planned[at];
    int is_decimal;

    if (at >= h->of->readable || !is_converted(&h->of->fields[at], planned))
        return 1;
    fprintf(h->out, "\n#ifdef %s_PLAN", h->upper);
    if (!write_as(h, at, name))
        return 0;
    write_fetch(h, at, name);
    for (is_decimal = 0; is_decimal <= is_short(planned->type); is_decimal++) {
        header_begin_getter(h, at, is_decimal);
        fprintf(h->out,
                "    uint16_t words[5];\n    mbm_registers own;\n"
                "    const uint8_t status = %s_fetch_%s(plan, %swords, &own);\n\n"
                "    return status != MBM_OK ? status : mbm_registers_%s(&own, %s_%s_as, 0, 0, "
                "&%s_%s_conversion, %svalue);\n}\n",
                h->lower, name, device_values_in(planned) > 1 ? "index, " : "",
                is_decimal ? "getDecimal" : "getConverted", h->lower, name, h->lower, name,
                is_decimal ? "decimals, " : "");
    }
    fprintf(h->out, "#endif\n");
    return 1;
}

/* Writes the functions of a field. Returns 0 after reporting a refusal. */
static int write_field(const header *h, uint16_t at)
{
    const char *name = h->lowers[at];

    fprintf(h->out, "\n/* ");
    header_comment(h->out, h->of->fields[at].name);
    fprintf(h->out, " */");
    write_take(h, at, name);
    write_put(h, at, name);
    return write_getters(h, at, name);
}

int header_write_types(const header *h)
{
    uint16_t i, count = 0;

    for (i = 0; i < h->of->count; i++)
        count = (uint16_t)(count + header_is_special(&h->of->planned[i]));
    if (count == 0)
        return 1;
    header_begin_shared(h, "Values that have functions of mbm/values.h. Take one out of registers, "
                           "such as those of\n * mbm_plan_getRegisters, or put one into them. They "
                           "return a status.");
    write_helpers(h);
    for (i = 0; i < h->of->count; i++)
        if (header_is_special(&h->of->planned[i]) && !write_field(h, i))
            return 0;
    fprintf(h->out, "#endif\n");
    return 1;
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
                "    (void)mbm_registers_intoWords(&registers, %s, %uu, %uu);\n    return ",
                array, (unsigned)(last - first + 1), (unsigned)first);
        if (sets) {
            write_call(h->out, &h->of->fields[at], planned, 1, "&registers", "value");
        } else {
            fprintf(h->out, "%s_take_%s(&registers, ", h->lower, name);
            write_arguments(h->out, planned);
            fputc(')', h->out);
        }
        fprintf(h->out, ";\n}\n");
    }
}
