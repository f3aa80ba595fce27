/* The part of a device's header on what may be written to a field: in words, and as constants that
 * compare with the number in the registers.
 *
 * Licence: MIT OR Apache-2.0. */
#include "header.h"

#include "decimal.h"
#include "numbers.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* --- in words --- */

void header_write_limits(FILE *out, const device_field *field)
{
    const conversion *of = field->conversion;

    if (of->has_least)
        header_write_number(out, "at least ", &of->least);
    if (of->has_most)
        header_write_number(out, of->has_least ? ", at most " : "at most ", &of->most);
    if (of->has_step)
        header_write_number(out, of->has_least || of->has_most ? ", in steps of " : "in steps of ",
                            &of->step);
}

/* --- constants --- */

/* A whole number, and whether something of the same sign is beyond it. */
typedef struct whole {
    uint64_t amount;
    int is_negative, has_rest;
} whole;

/* Divides a decimal number. Returns 0 if the result has more than 64 bits. */
static int divide(const decimal_number *number, int32_t divisor, whole *result)
{
    const uint64_t by = (uint64_t)(divisor < 0 ? -(int64_t)divisor : divisor);

    result->is_negative = number->is_negative != (divisor < 0);
    return decimal_divide(number, by, &result->amount, &result->has_rest);
}

/* Finds the limit as the registers have it, of a number that is divided by `multiplier` then.
 * Returns 0 if it has too many digits. */
static int find_raw(const header *h, uint16_t at, const value_scale *limit, int is_step,
                    decimal_number *raw)
{
    const conversion *of = h->of->fields[at].conversion;
    const value_scale divisor = {.digits = (uint64_t)h->scales[at].divisor};

    decimal_of_scale(limit, raw);
    return (is_step || of->offset.digits == 0 || decimal_add(raw, &of->offset, 1)) &&
           decimal_multiply(raw, &divisor);
}

/* Writes a limit of a float: the nearest one, in the fewest digits. */
static void write_float(const header *h, uint16_t at, const char *suffix, const decimal_number *raw,
                        int is_float)
{
    char text[DECIMAL_BYTES];
    int digits = 5;
    double value;

    decimal_print(raw, 0, text);
    value = strtod(text, NULL) / h->scales[at].multiplier;
    do
        snprintf(text, sizeof text, "%.*g", ++digits, value);
    while (digits < 17 &&
           (is_float ? strtof(text, NULL) != (float)value : strtod(text, NULL) != value));
    fprintf(h->out, "#define %s_%s%s (%s%s%s)\n", h->upper, h->fields[at], suffix, text,
            strpbrk(text, ".e") ? "" : ".0", is_float ? "f" : "");
}

/* Writes a limit of an integer, in the C type that the field has or in a longer one. `round` is 1
 * for the next one above, -1 for the next one below. Returns 0 if there is none, and writes
 * nothing. */
static int write_whole(const header *h, uint16_t at, const char *suffix, const whole *limit,
                       int round, int is_signed)
{
    uint64_t amount = limit->amount;
    int is_negative = limit->is_negative;
    const char *ending;

    if (limit->has_rest && is_negative == (round < 0)) {
        if (amount == UINT64_MAX)
            return 0;
        amount++;
    }
    if (is_negative && !is_signed) {
        if (round < 0 && amount > 0)
            return 0;
        amount = 0;
    }
    is_negative = is_negative && amount > 0;
    if (is_signed && amount > INT64_MAX)
        return 0;
    if (is_signed)
        ending = amount <= INT16_MAX ? "" : amount <= INT32_MAX ? "l" : "ll";
    else
        ending = amount <= UINT16_MAX ? "u" : amount <= UINT32_MAX ? "ul" : "ull";
    fprintf(h->out,
            is_negative ? "#define %s_%s%s (-%" PRIu64 "%s)\n" : "#define %s_%s%s %" PRIu64 "%s\n",
            h->upper, h->fields[at], suffix, amount, ending);
    return 1;
}

/* Writes a limit, if the registers can have it. Returns 0 after reporting a refusal. */
static int write_limit(header *h, uint16_t at, const char *suffix, const value_scale *limit,
                       int round)
{
    const char *type = header_number_type(&h->of->planned[at]);
    static decimal_number raw;
    whole number;

    if (!find_raw(h, at, limit, round == 0, &raw))
        return 1;
    if (strcmp(type, "float") == 0 || strcmp(type, "double") == 0) {
        if (round == 0 && h->scales[at].multiplier < 0)
            raw.is_negative = 1;
        write_float(h, at, suffix, &raw, type[0] == 'f');
    } else {
        if (!divide(&raw, h->scales[at].multiplier, &number))
            return 1;
        if (round == 0)
            number.is_negative = 0;
        if ((round == 0 && number.has_rest) ||
            !write_whole(h, at, suffix, &number, round, type[0] == 'i'))
            return 1;
    }
    return header_define(h, at, suffix, h->of->fields[at].line);
}

/* Whether multiples of the step count from a constant that is written, or else from 0. */
static int has_base(const header *h, uint16_t at)
{
    static const value_scale ZERO;
    const conversion *of = h->of->fields[at].conversion;
    const char type = header_number_type(&h->of->planned[at])[0];
    static decimal_number raw;
    whole base;

    if (!find_raw(h, at, of->has_least ? &of->least : &ZERO, 0, &raw) ||
        !divide(&raw, h->scales[at].multiplier, &base))
        return 0;
    if (!of->has_least)
        return base.amount == 0 && !base.has_rest;
    return type == 'f' || type == 'd' ||
           (!base.has_rest && (base.amount == 0 || !base.is_negative || type == 'i'));
}

int header_write_limit_constants(header *h, uint16_t at)
{
    const device_field *field = &h->of->fields[at];
    const conversion *of = field->conversion;
    const int is_turned = h->scales[at].multiplier < 0;

    /* With a power of ten in another field the registers' number is not known here. */
    if (!conversion_has_limits(of) || field->power_name)
        return 1;
    return (!of->has_least ||
            write_limit(h, at, is_turned ? "_MAX" : "_MIN", &of->least, is_turned ? -1 : 1)) &&
           (!of->has_most ||
            write_limit(h, at, is_turned ? "_MIN" : "_MAX", &of->most, is_turned ? 1 : -1)) &&
           (!of->has_step || !has_base(h, at) || write_limit(h, at, "_STEP", &of->step, 0));
}
