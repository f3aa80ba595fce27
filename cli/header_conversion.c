/* The part of a device's header that converts what a plan has read: offsets, powers of ten, and
 * numbers that mean "not available", as constants with functions around them. */
#include "header.h"

#include "decimal.h"
#include "numbers.h"
#include "report.h"

#include <inttypes.h>

int header_is_scaled(const device_field *field)
{
    return field->form.scale.digits != 0 && !field->power_name;
}

/* Whether SunSpec's reserved number is all that its numbers mean: such fields share a constant. */
static int is_standard_only(const device_field *field)
{
    const conversion *of = field->conversion;

    return !field->power_name && of && of->is_standard && of->offset.digits == 0 &&
           of->number_count == 0;
}

static int is_converted(const device_field *field)
{
    const conversion *of = field->conversion;

    return field->power_name ||
           (of && (of->offset.digits != 0 || of->is_standard || of->number_count > 0));
}

/* --- what it is, in words --- */

void header_write_number(FILE *out, const char *before, const value_scale *number)
{
    char text[DECIMAL_BYTES];

    decimal_print_scale(number, text);
    fprintf(out, "%s%s", before, text);
}

void header_write_meaning(FILE *out, const device_field *field, const char *before,
                          const char *after)
{
    if (field->power_name) {
        fprintf(out, "%stimes 10^(", before);
        header_comment(out, field->power_name);
        fputc(')', out);
        before = ", ";
    }
    if (conversion_has_offset(field->conversion))
        header_write_number(out, say("%splus ", before), &field->conversion->offset);
    if (field->power_name || conversion_has_offset(field->conversion))
        fputs(after, out);
}

/* --- constants --- */

int header_find_offset(const header *h, const device_field *field, int32_t *offset,
                       unsigned *decimals)
{
    const value_scale *of = field->conversion ? &field->conversion->offset : NULL;
    uint64_t amount = of ? of->digits : 0;
    long exponent = of ? of->exponent : 0;

    *offset = 0;
    *decimals = 0;
    if (amount == 0)
        return 1;
    for (; exponent > 0 && amount <= INT32_MAX; exponent--)
        amount *= 10;
    if (amount > INT32_MAX || exponent < -9) {
        (void)report(CODE_WRONG,
                     "%s:%d: offset has more than 9 decimals, or more digits than fit in 32 bits, "
                     "as firmware needs it",
                     h->path, field->line);
        return 0;
    }
    *offset = of->is_negative ? -(int32_t)amount : (int32_t)amount;
    *decimals = (unsigned)-exponent;
    return 1;
}

/* Writes the numbers that mean "not available", the most significant word first. Returns how many
 * words they have. */
static unsigned write_numbers(const header *h, uint16_t at, const char *lower)
{
    const conversion *of = h->of->fields[at].conversion;
    const mbm_planField *planned = &h->of->planned[at];
    const uint16_t size = value_registers(planned->type, 1);
    const uint8_t order = planned->type == MBM_TYPE_BIT ? MBM_ORDER_ABCD : planned->order;
    unsigned i, words = 0;
    mbm_registers registers;
    uint64_t number = 0;
    uint32_t two = 0;
    uint16_t one = 0;
    int place;

    if (!of || of->number_count == 0)
        return 0;
    fprintf(h->out, "static const uint16_t %s_%s_not_available[%u] = {", h->lower, lower,
            of->number_count * (unsigned)size);
    for (i = 0; i < of->number_count; i++) {
        (void)mbm_registers_ofWords(&registers, of->numbers[i], size, 0);
        (void)mbm_registers_getUint16(&registers, 0, order, &one);
        (void)mbm_registers_getUint32(&registers, 0, order, &two);
        (void)mbm_registers_getUint64(&registers, 0, order, &number);
        number = size == 1 ? one : size == 2 ? two : number;
        for (place = size - 1; place >= 0; place--, words++)
            fprintf(h->out, "%s0x%04Xu", words ? ", " : "",
                    (unsigned)(number >> (16 * place)) & 0xFFFFu);
    }
    fprintf(h->out, "};\n");
    return words;
}

static void write_flags(FILE *out, const device_field *field)
{
    const int is_standard = field->conversion && field->conversion->is_standard;

    fprintf(out, "%s%s%s", is_standard ? "MBM_CONVERSION_STANDARD" : "",
            is_standard && field->power_name ? " | " : "",
            field->power_name ? "MBM_CONVERSION_POWER"
            : is_standard     ? ""
                              : "0u");
}

/* Writes the conversion of a field. Returns 0 after reporting a refusal. */
static int write_constant(const header *h, uint16_t at, const char *lower)
{
    const device_field *field = &h->of->fields[at];
    unsigned decimals, words;
    int32_t offset;

    if (!header_find_offset(h, field, &offset, &decimals))
        return 0;
    fputc('\n', h->out);
    words = write_numbers(h, at, lower);
    fprintf(h->out, "static const mbm_planConversion %s_%s_conversion = {\n    ", h->lower, lower);
    if (words > 0)
        fprintf(h->out, "%s_%s_not_available", h->lower, lower);
    else
        fprintf(h->out, "NULL");
    fprintf(h->out, ", %" PRId32 ", ", offset);
    if (field->power_name)
        fprintf(h->out, "%s_%s", h->upper, h->fields[field->power_field]);
    else
        fprintf(h->out, "0u");
    fprintf(h->out, ", %uu, %uu, ", words, decimals);
    write_flags(h->out, field);
    fprintf(h->out, "};\n");
    return 1;
}

void header_begin_getter(const header *h, uint16_t at, int is_decimal)
{
    fprintf(h->out, "\nstatic inline uint8_t %s_%s_%s(const mbm_plan *plan, %s%s *value)\n{\n",
            h->lower, h->lowers[at], is_decimal ? "decimal" : "number",
            device_values_in(&h->of->planned[at]) > 1 ? "uint16_t index, " : "",
            is_decimal ? "uint8_t decimals, int32_t" : "double");
}

/* Writes the functions that get the values of a field; `with` is the name of its conversion. */
static void write_getters(const header *h, uint16_t at, const char *lower, const char *with)
{
    const mbm_planField *planned = &h->of->planned[at];
    int is_decimal;

    if (planned->type == MBM_TYPE_TEXT) {
        fprintf(h->out,
                "\nstatic inline uint8_t %s_%s_available(const mbm_plan *plan)\n{\n"
                "    return mbm_plan_checkAvailable(plan, %s_%s, 0, &%s_%s);\n}\n",
                h->lower, lower, h->upper, h->fields[at], h->lower, with);
        return;
    }
    for (is_decimal = 0; is_decimal <= (planned->type <= MBM_TYPE_INT32); is_decimal++) {
        header_begin_getter(h, at, is_decimal);
        fprintf(h->out, "    return mbm_plan_%s(plan, %s_%s, %s, &%s_%s, %svalue);\n}\n",
                is_decimal ? "getDecimal" : "getConverted", h->upper, h->fields[at],
                device_values_in(planned) > 1 ? "index" : "0", h->lower, with,
                is_decimal ? "decimals, " : "");
    }
}

static int write_field(const header *h, uint16_t at)
{
    const int is_shared = is_standard_only(&h->of->fields[at]);
    const char *lower = h->lowers[at];

    if (!is_shared && !write_constant(h, at, lower))
        return 0;
    write_getters(h, at, lower, is_shared ? "standard" : say("%s_conversion", lower));
    return 1;
}

/* Writes the constant that fields share, if one needs it. */
static void write_shared(const header *h)
{
    uint16_t i;

    for (i = 0; i < h->of->readable; i++)
        if (is_standard_only(&h->of->fields[i])) {
            fprintf(h->out,
                    "static const mbm_planConversion %s_standard = {\n"
                    "    NULL, 0, 0u, 0u, 0u, MBM_CONVERSION_STANDARD};\n",
                    h->lower);
            return;
        }
}

/* Whether the header has a conversion for a field. */
static int has_constant(const header *h, uint16_t at)
{
    return is_converted(&h->of->fields[at]) && !header_is_special(&h->of->planned[at]);
}

/* Writes the conversions in the order of the fields of the plan. */
static void write_table(const header *h)
{
    uint16_t i;

    fprintf(h->out,
            "\n/* The conversions of all fields of the plan, NULL for those that have none. */\n"
            "static const mbm_planConversion *const %s_conversions[%s_FIELDS] = {\n",
            h->lower, h->upper);
    for (i = 0; i < h->of->readable; i++) {
        const uint16_t at = h->order[i];
        const char *comma = i + 1 < h->of->readable ? "," : "";

        if (!has_constant(h, at))
            fprintf(h->out, "    NULL%s\n", comma);
        else if (is_standard_only(&h->of->fields[at]))
            fprintf(h->out, "    &%s_standard%s\n", h->lower, comma);
        else
            fprintf(h->out, "    &%s_%s_conversion%s\n", h->lower, h->lowers[at], comma);
    }
    fprintf(h->out, "};\n");
}

int header_write_conversions(header *h)
{
    int is_first = 1;
    uint16_t i;

    for (i = 0; i < h->of->readable; i++) {
        const uint16_t at = h->order[i];

        if (!has_constant(h, at))
            continue;
        if (is_first) {
            fprintf(h->out,
                    "\n/* What the numbers of these fields mean, and functions that get their "
                    "values: as a double, and\n * times 10^decimals. They return "
                    "MBM_NOT_AVAILABLE if the device has no value. */\n");
            write_shared(h);
        }
        is_first = 0;
        if (!write_field(h, at))
            return 0;
    }
    if (!is_first)
        write_table(h);
    return 1;
}
