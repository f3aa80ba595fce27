/* The part of a device's header on what may be written to a field: in words, and as constants that
 * compare with the number in the registers. */
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

int header_is_checked(const header *h, uint16_t at)
{
    const device_field *field = &h->of->fields[at];

    /* With a power of ten in another field the registers' number is not known here. */
    return conversion_has_limits(field->conversion) && !field->power_name;
}

/* --- constants --- */

/* The whole part of a number, without its sign; `has_rest`: the number has a fraction too. */
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

/* Converts a limit to the number in the registers, times the multiplier of the scale: the caller
 * divides by that. Returns 0 if the result has too many digits. */
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
                        int is_short)
{
    char text[DECIMAL_BYTES];
    int digits = 5;
    double value;

    decimal_print(raw, 0, text);
    value = strtod(text, NULL) / h->scales[at].multiplier;
    do
        snprintf(text, sizeof text, "%.*g", ++digits, value);
    while (digits < 17 &&
           (is_short ? strtof(text, NULL) != (float)value : strtod(text, NULL) != value));
    fprintf(h->out, "#define %s_%s%s (%s%s%s)\n", h->upper, h->fields[at], suffix, text,
            strpbrk(text, ".e") ? "" : ".0", is_short ? "f" : "");
}

/* Whether the numbers of a field are floats, and whether they have a sign. */
static int is_float(const header *h, uint16_t at)
{
    const char *type = header_number_type(&h->of->planned[at]);

    return type[0] == 'f' || type[0] == 'd';
}

static int is_signed(const header *h, uint16_t at)
{
    return header_number_type(&h->of->planned[at])[0] == 'i';
}

/* Rounds a limit to a whole number that the C type of the field, or a longer one, has: up if
 * `round` is 1, down if it is -1. Returns 0 if there is no such number. */
static int round_whole(whole *limit, int round, int has_sign)
{
    if (limit->has_rest && limit->is_negative == (round < 0)) {
        if (limit->amount == UINT64_MAX)
            return 0;
        limit->amount++;
    }
    if (limit->is_negative && !has_sign) {
        if (round < 0 && limit->amount > 0)
            return 0;
        limit->amount = 0;
    }
    limit->is_negative = limit->is_negative && limit->amount > 0;
    return !has_sign || limit->amount <= INT64_MAX;
}

/* Converts a limit to a whole number in the registers; `round` is 0 for the step, which must be one
 * already. Returns 0 if there is no such number. */
static int find_whole(const header *h, uint16_t at, const value_scale *limit, int round,
                      whole *number)
{
    static decimal_number raw;

    if (!find_raw(h, at, limit, round == 0, &raw) ||
        !divide(&raw, h->scales[at].multiplier, number))
        return 0;
    if (round == 0)
        number->is_negative = 0;
    return (round != 0 || !number->has_rest) && round_whole(number, round, is_signed(h, at));
}

/* Writes a limit of an integer, in the C type that the field has or in a longer one. */
static void write_whole(const header *h, uint16_t at, const char *suffix, const whole *limit)
{
    const uint64_t amount = limit->amount;
    const char *ending;

    if (is_signed(h, at))
        ending = amount <= INT16_MAX ? "" : amount <= INT32_MAX ? "l" : "ll";
    else
        ending = amount <= UINT16_MAX ? "u" : amount <= UINT32_MAX ? "ul" : "ull";
    fprintf(h->out,
            limit->is_negative ? "#define %s_%s%s (-%" PRIu64 "%s)\n"
                               : "#define %s_%s%s %" PRIu64 "%s\n",
            h->upper, h->fields[at], suffix, amount, ending);
}

/* Writes a limit, if the registers can have it. Returns 0 after reporting a refusal. */
static int write_limit(header *h, uint16_t at, const char *suffix, const value_scale *limit,
                       int round)
{
    static decimal_number raw;
    whole number;

    if (is_float(h, at)) {
        if (!find_raw(h, at, limit, round == 0, &raw))
            return 1;
        if (round == 0 && h->scales[at].multiplier < 0)
            raw.is_negative = 1;
        write_float(h, at, suffix, &raw, header_number_type(&h->of->planned[at])[0] == 'f');
    } else if (find_whole(h, at, limit, round, &number)) {
        write_whole(h, at, suffix, &number);
    } else {
        return 1;
    }
    return header_define(h, at, suffix, h->of->fields[at].line);
}

/* Whether a constant of the step makes sense: the step counts from min_value, which must be a whole
 * number in the registers unless they have a float; or else from 0, which must be 0 there. */
static int has_base(const header *h, uint16_t at)
{
    static const value_scale ZERO;
    const conversion *of = h->of->fields[at].conversion;
    static decimal_number raw;
    whole base;

    if (!find_raw(h, at, of->has_least ? &of->least : &ZERO, 0, &raw) ||
        !divide(&raw, h->scales[at].multiplier, &base))
        return 0;
    if (!of->has_least)
        return base.amount == 0 && !base.has_rest;
    return is_float(h, at) ||
           (!base.has_rest && (base.amount == 0 || !base.is_negative || is_signed(h, at)));
}

int header_write_limit_constants(header *h, uint16_t at)
{
    const conversion *of = h->of->fields[at].conversion;
    const int is_turned = h->scales[at].multiplier < 0;

    if (!header_is_checked(h, at))
        return 1;
    return (!of->has_least ||
            write_limit(h, at, is_turned ? "_MAX" : "_MIN", &of->least, is_turned ? -1 : 1)) &&
           (!of->has_most ||
            write_limit(h, at, is_turned ? "_MIN" : "_MAX", &of->most, is_turned ? 1 : -1)) &&
           (!of->has_step || !has_base(h, at) || write_limit(h, at, "_STEP", &of->step, 0));
}

/* --- functions that check --- */

/* The limits of a field as the registers have them: with a negative scale the maximum is that of
 * min_value. */
typedef struct limits {
    const value_scale *least, *most;
} limits;

static limits limits_of(const header *h, uint16_t at)
{
    const conversion *of = h->of->fields[at].conversion;
    const value_scale *least = of->has_least ? &of->least : NULL;
    const value_scale *most = of->has_most ? &of->most : NULL;
    const int is_turned = h->scales[at].multiplier < 0;

    return is_turned ? (limits){most, least} : (limits){least, most};
}

/* Bits of the C type of a field. */
static unsigned bits_of(const header *h, uint16_t at)
{
    const char *type = header_number_type(&h->of->planned[at]);

    return (unsigned)strtoul(type + strcspn(type, "123456789"), NULL, 10);
}

/* Compares a limit with the range of the C type of the field: -1 if it is the least number or below
 * it, 1 if it is the greatest or above it. `is_beyond`: it is not that number itself. */
static int compare_with_type(const header *h, uint16_t at, const whole *limit, int *is_beyond)
{
    const int has_sign = is_signed(h, at);
    const uint64_t most = UINT64_MAX >> (64 - bits_of(h, at) + (unsigned)has_sign);
    const uint64_t below = has_sign ? most + 1 : 0;

    *is_beyond = limit->amount > (limit->is_negative ? below : most);
    if (limit->is_negative || (limit->amount == 0 && !has_sign))
        return limit->amount >= below ? -1 : 0;
    return limit->amount >= most ? 1 : 0;
}

/* Which numbers of the C type a limit allows. Only for SOME the number is compared. */
enum { ALL, SOME, NONE };

/* `round` is 1 for the least number, -1 for the greatest. */
static int what_a_limit_allows(const header *h, uint16_t at, const value_scale *limit, int round)
{
    static decimal_number raw;
    int is_beyond, place;
    whole number;

    if (!limit)
        return ALL;
    if (is_float(h, at))
        return find_raw(h, at, limit, 0, &raw) ? SOME : ALL;
    if (!find_whole(h, at, limit, round, &number)) {
        /* It has more than 64 bits, or it is negative and the C type has no sign. */
        if (!find_raw(h, at, limit, 0, &raw))
            return ALL;
        return (raw.is_negative != (h->scales[at].multiplier < 0)) == (round < 0) ? NONE : ALL;
    }
    place = compare_with_type(h, at, &number, &is_beyond);
    if (place == -round)
        return ALL;
    return place == round && is_beyond ? NONE : SOME;
}

/* Whether the step of a field can be checked: that of a float is not exact in binary. */
static int has_step(const header *h, uint16_t at)
{
    const conversion *of = h->of->fields[at].conversion;
    whole step;

    return of->has_step && !is_float(h, at) && has_base(h, at) &&
           find_whole(h, at, &of->step, 0, &step);
}

/* Writes the condition that a number is a multiple of the step. */
static void write_step(const header *h, uint16_t at, const limits *of)
{
    const conversion *own = h->of->fields[at].conversion;
    const unsigned bits = bits_of(h, at);
    const char *upper = h->upper, *name = h->fields[at];
    unsigned wide = bits < 16 ? 16 : bits;
    whole step;

    (void)find_whole(h, at, &own->step, 0, &step);
    if (!own->has_least) {
        fprintf(h->out, "value %% %s_%s_STEP == 0", upper, name);
        return;
    }
    /* Without a sign no difference overflows. */
    while (wide < 64 && step.amount >> wide)
        wide *= 2;
    if (of->least == &own->least)
        fprintf(h->out, "(uint%u_t)((uint%u_t)value - (uint%u_t)%s_%s_MIN)", wide, wide, wide,
                upper, name);
    else
        fprintf(h->out, "(uint%u_t)((uint%u_t)%s_%s_MAX - (uint%u_t)value)", wide, wide, upper,
                name, wide);
    fprintf(h->out, " %% (uint%u_t)%s_%s_STEP == 0", wide, upper, name);
}

/* Writes the function that checks a number. */
static void write_check(const header *h, uint16_t at)
{
    const limits of = limits_of(h, at);
    const int least = what_a_limit_allows(h, at, of.least, 1);
    const int most = what_a_limit_allows(h, at, of.most, -1);
    const char *and = "";

    fprintf(h->out, "\nstatic inline uint8_t %s_check_%s(%s value)\n{\n", h->lower, h->lowers[at],
            header_number_type(&h->of->planned[at]));
    if (least == NONE || most == NONE || (least == ALL && most == ALL && !has_step(h, at))) {
        fprintf(h->out, "    (void)value;\n    return %s;\n}\n",
                least == NONE || most == NONE ? "MBM_OUT_OF_RANGE" : "MBM_OK");
        return;
    }
    fprintf(h->out, "    return ");
    if (least == SOME) {
        fprintf(h->out, "value >= %s_%s_MIN", h->upper, h->fields[at]);
        and = " && ";
    }
    if (most == SOME) {
        fprintf(h->out, "%svalue <= %s_%s_MAX", and, h->upper, h->fields[at]);
        and = " && ";
    }
    if (has_step(h, at)) {
        fputs(and, h->out);
        write_step(h, at, &of);
    }
    fprintf(h->out, " ? MBM_OK : MBM_OUT_OF_RANGE;\n}\n");
}

void header_write_checks(const header *h)
{
    int is_first = 1;
    uint16_t i;

    for (i = 0; i < h->of->count; i++) {
        if (!header_is_checked(h, i))
            continue;
        if (is_first)
            header_begin_shared(h, "Limits: whether a number, as the registers have it, may be "
                                   "written: MBM_OK, or\n * MBM_OUT_OF_RANGE.");
        is_first = 0;
        write_check(h, i);
    }
    if (!is_first)
        fprintf(h->out, "#endif\n");
}
