/* Reads numbers into registers, and writes registers as text, without rounding. */
#include "value.h"

#include "decimal.h"
#include "numbers.h"

#include <ctype.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const value_table_names[] = {"", "coils", "discrete", "holding", "input", NULL};
const char *const value_order_names[] = {"",         "ABCD",     "CDAB",     "BADC",     "DCBA",
                                         "EFGHABCD", "CDABGHEF", "FEHGBADC", "DCBAHGFE", NULL};

static const char OUT_OF_RANGE[] = "is out of range";
static const value_scale ONE = {.digits = 1, .value = 1};

int value_scale_read(const char *text, value_scale *scale)
{
    decimal_number number;

    /* A value of infinity or 0 is too large or too small for a double. */
    return decimal_read(text, strlen(text), &number) && number.count > 0 &&
           decimal_shorten(&number, scale) && isfinite(scale->value) && scale->value != 0;
}

static int is_one(const value_scale *scale)
{
    return scale->digits == 1 && scale->exponent == 0 && !scale->is_negative;
}

/* Divides a number by a scale. Returns NULL and the quotient without its sign, or why the number is
 * refused. */
static const char *divide(const decimal_number *number, const value_scale *scale,
                          uint64_t *quotient)
{
    const char *wrong = is_one(scale) ? "is not a whole number" : "is not a multiple of the scale";
    decimal_number scaled = *number;
    int has_rest;

    scaled.exponent -= scale->exponent;
    /* The digits of a number do not end with 0, so no integer times 10 has them. */
    if (scaled.count > 0 && scaled.exponent < 0)
        return wrong;
    if (!decimal_divide(&scaled, scale->digits, quotient, &has_rest))
        return OUT_OF_RANGE;
    return has_rest ? wrong : NULL;
}

/* The greatest number of wide bits. */
static uint64_t mask_of(const value_form *form)
{
    return UINT64_MAX >> (64 - form->bits);
}

/* Converts a number to the integer of a field, as two's complement. Returns NULL, or why it is
 * refused. */
static const char *to_integer(const decimal_number *number, const value_scale *scale,
                              const value_form *form, uint64_t *integer)
{
    const value_range range = value_is_wide_bits(form->type) ? (value_range){0, mask_of(form)}
                                                             : value_range_of(form->type);
    const int is_negative = number->is_negative != scale->is_negative;
    const char *wrong = divide(number, scale, integer);

    if (wrong)
        return wrong;
    if (*integer > (is_negative ? range.below_zero : range.most))
        return OUT_OF_RANGE;
    if (is_negative)
        *integer = ~*integer + 1;
    return NULL;
}

/* Rounds to a float so that a second rounding, to a half float, is as one from the double would be:
 * towards 0, with the lowest bit set if anything was lost. */
static float to_odd(double real)
{
    float single = (float)real;
    uint32_t bits;

    if (fabs((double)single) > fabs(real))
        single = nextafterf(single, 0);
    if ((double)single == real)
        return single;
    memcpy(&bits, &single, sizeof bits);
    bits |= 1;
    memcpy(&single, &bits, sizeof bits);
    return single;
}

/* Writes a half float. Returns 0 if it is out of range. */
static int to_half(double real, uint16_t *word, uint8_t order)
{
    const float single = to_odd(real);
    mbm_registers registers;

    (void)mbm_registers_intoWords(&registers, word, 1, 0);
    return mbm_registers_setHalf(&registers, 0, order, &single) == MBM_OK;
}

/* Whether a float that was made of an integer without a scale is that integer. Numbers with a point
 * or an exponent are rounded instead. */
static int is_same_integer(cursor in, const decimal_number *number, double real)
{
    char digits[VALUE_LONGEST * 3];
    decimal_number other;

    for (; in.at < in.end; in.at++)
        if (!cursor_is_digit(&in) && *in.at != '-')
            return 1;
    (void)snprintf(digits, sizeof digits, "%.0f", real);
    return decimal_read(digits, strlen(digits), &other) && other.count == number->count &&
           other.exponent == number->exponent &&
           memcmp(other.digits, number->digits, number->count) == 0;
}

/* Converts a number to the nearest float of a type. Returns NULL; or why it is refused: if it is
 * too large, if it is not 0 but becomes 0, or if it is an integer that the float is not. */
static const char *to_real(cursor in, const decimal_number *number, const value_scale *scale,
                           uint8_t type, double *real)
{
    const double most = type == MBM_TYPE_FLOAT ? (double)FLT_MAX : DBL_MAX;
    char text[VALUE_LONGEST + 1];
    const size_t length = (size_t)(in.end - in.at);
    mbm_registers registers;
    uint16_t word;
    float half = 0;

    memcpy(text, in.at, length);
    text[length] = '\0';
    *real = strtod(text, NULL) / scale->value;
    if (type == MBM_TYPE_FLOAT && fabs(*real) <= (double)FLT_MAX)
        /* A number without a scale is rounded once, not first to a double. */
        *real = scale->value == 1 ? (double)strtof(text, NULL) : (double)(float)*real;
    if (type == VALUE_FLOAT16) {
        if (!to_half(*real, &word, MBM_ORDER_ABCD))
            return OUT_OF_RANGE;
        (void)mbm_registers_ofWords(&registers, &word, 1, 0);
        (void)mbm_registers_getHalf(&registers, 0, MBM_ORDER_ABCD, &half);
        *real = (double)half;
    }
    if (!(fabs(*real) <= most) || (*real == 0 && number->count != 0))
        return OUT_OF_RANGE;
    return is_one(scale) && !is_same_integer(in, number, *real)
               ? "is a whole number that the type cannot hold exactly"
               : NULL;
}

/* Reads hexadecimal digits, after 0x or not. Returns NULL, or why they are refused. */
static const char *read_hex(cursor in, uint8_t type, uint64_t *integer)
{
    const unsigned registers = value_registers(type, 1);
    const unsigned bits = type == MBM_TYPE_BIT ? 1 : 16 * registers;
    const char *from;

    if (registers > 4)
        return "has more registers than a hexadecimal number, which has four";
    if (in.end - in.at > 2 && in.at[0] == '0' && (in.at[1] == 'x' || in.at[1] == 'X'))
        in.at += 2;
    from = in.at;
    for (*integer = 0; in.at < in.end && isxdigit((unsigned char)*in.at); in.at++) {
        const char digit[] = {*in.at, '\0'};

        if (*integer >> 60)
            return OUT_OF_RANGE;
        *integer = *integer << 4 | strtoul(digit, NULL, 16);
    }
    if (in.at == from || in.at != in.end)
        return "is not a hexadecimal number";
    return bits < 64 && *integer >> bits ? OUT_OF_RANGE : NULL;
}

/* Sets the words of a value from an integer or a float. Returns how many they are. */
static uint16_t set_number(const value_form *form, uint64_t integer, double real,
                           uint16_t words[VALUE_WORDS])
{
    const uint16_t count = value_registers(form->type, 1);
    const float single = (float)real;
    mbm_registers registers;

    memset(words, 0, VALUE_WORDS * sizeof *words);
    (void)mbm_registers_intoWords(&registers, words, VALUE_WORDS, 0);
    if (form->is_hex && form->type != MBM_TYPE_BIT && !value_is_wide_bits(form->type))
        (void)mbm_registers_setBits(&registers, 0, count, form->order, 0, (uint8_t)(16 * count),
                                    &integer);
    else if (value_is_wide_bits(form->type))
        (void)mbm_registers_setBits(&registers, 0, count, form->order, form->first, form->bits,
                                    &integer);
    else if (form->type == MBM_TYPE_FLOAT)
        (void)mbm_registers_setFloat(&registers, 0, form->order, &single);
    else if (form->type == MBM_TYPE_DOUBLE)
        (void)mbm_registers_setDouble(&registers, 0, form->order, &real);
    else if (form->type == VALUE_FLOAT16)
        (void)to_half(real, words, form->order);
    else
        value_set_integer(form->type, form->order, &registers, 0, integer);
    return count;
}

uint16_t value_read(const value_form *form, const char *text, size_t length,
                    uint16_t words[VALUE_WORDS], const char **wrong)
{
    const value_scale *scale = form->scale.digits ? &form->scale : &ONE;
    const cursor in = {text, text + length};
    uint64_t integer = 0;
    decimal_number number;
    double real = 0;

    *wrong = NULL;
    if (value_is_date(form->type) && !form->is_hex)
        return value_date_read(form, text, length, words, wrong);
    if (form->is_hex)
        *wrong = read_hex(in, form->type, &integer);
    else if (!decimal_read(text, length, &number))
        *wrong = "is not a decimal number";
    else if (value_is_float(form->type))
        *wrong = to_real(in, &number, scale, form->type, &real);
    else
        *wrong = to_integer(&number, scale, form, &integer);
    if (!*wrong && value_is_wide_bits(form->type) && integer > mask_of(form))
        *wrong = OUT_OF_RANGE;
    return *wrong ? 0 : set_number(form, integer, real, words);
}

/* --- values as text --- */

enum { NUMBER_BYTES = 40 };

/* Writes the value of a float or double with as many digits as it takes to read the same value
 * back. JSON has no word for infinity and not-a-number. */
static void print_exact(char *text, double value, int is_float, int is_json)
{
    int digits = is_float ? FLT_DIG + 1 : DBL_DIG;
    const int most = is_float ? FLT_DECIMAL_DIG : DBL_DECIMAL_DIG;

    if (is_json && !isfinite(value)) {
        strcpy(text, "null");
        return;
    }
    do
        snprintf(text, NUMBER_BYTES, "%.*g", digits, value);
    while (digits++ < most &&
           (is_float ? strtof(text, NULL) != (float)value : strtod(text, NULL) != value));
}

/* Writes a scaled value. */
static void print_real(char *text, double value, int digits, int is_json)
{
    if (is_json && !isfinite(value))
        strcpy(text, "null");
    else
        snprintf(text, NUMBER_BYTES, "%.*g", digits, value);
}

/* Writes a text without control characters, which could do anything to a terminal: those of ASCII,
 * and those from 0x80 to 0x9F (0x9B begins a sequence like ESC [). */
static void print_text(const value_form *form, const mbm_registers *registers, uint16_t address,
                       uint16_t count, int is_json, char *text)
{
    char latin[VALUE_LONGEST_TEXT + 1] = "";
    size_t from;

    (void)mbm_registers_getText(registers, address, count, form->order, value_text_form(form->type),
                                latin, sizeof latin);
    if (is_json)
        *text++ = '"';
    for (from = 0; latin[from]; from++) {
        const unsigned char byte = (unsigned char)latin[from];
        const int is_control = byte < ' ' || (byte >= 0x7F && byte < 0xA0);

        if (is_control && is_json) {
            text += snprintf(text, 7, "\\u%04x", byte);
        } else if (is_control) {
            *text++ = '.';
        } else if (byte >= 0x80) {
            *text++ = (char)(0xC0 | byte >> 6);
            *text++ = (char)(0x80 | (byte & 0x3F));
        } else {
            if (is_json && (byte == '"' || byte == '\\'))
                *text++ = '\\';
            *text++ = (char)byte;
        }
    }
    if (is_json)
        *text++ = '"';
    *text = '\0';
}

/* Writes a half float with as many digits as it takes to read the same half float back. */
static void print_half(char *text, float value, int is_json)
{
    uint16_t wanted, back;
    int digits = 3;

    if (!isfinite(value) || value == 0) {
        print_exact(text, (double)value, 1, is_json);
        return;
    }
    if (value == truncf(value)) {
        snprintf(text, NUMBER_BYTES, "%.0f", (double)value);
        return;
    }
    (void)to_half((double)value, &wanted, MBM_ORDER_ABCD);
    do
        snprintf(text, NUMBER_BYTES, "%.*g", digits, (double)value);
    while (digits++ < FLT_DECIMAL_DIG &&
           (!to_half(strtod(text, NULL), &back, MBM_ORDER_ABCD) || back != wanted));
}

static void print_float(const value_form *form, const mbm_registers *registers, uint16_t address,
                        int is_json, char *text)
{
    static const int DIGITS[] = {4, FLT_DIG + 1, DBL_DIG};
    const int width = form->type == VALUE_FLOAT16 ? 0 : form->type == MBM_TYPE_FLOAT ? 1 : 2;
    double real = 0;
    float single = 0;

    if (width == 0)
        (void)mbm_registers_getHalf(registers, address, form->order, &single);
    else if (width == 1)
        (void)mbm_registers_getFloat(registers, address, form->order, &single);
    else
        (void)mbm_registers_getDouble(registers, address, form->order, &real);
    if (width < 2)
        real = (double)single;
    if (form->scale.digits != 0)
        print_real(text, real * form->scale.value, DIGITS[width], is_json);
    else if (width == 0)
        print_half(text, single, is_json);
    else
        print_exact(text, real, width == 1, is_json);
}

/* Writes an integer. Returns MBM_OK, or MBM_MALFORMED_VALUE. */
static uint8_t print_integer(const value_form *form, const mbm_registers *registers,
                             uint16_t address, int is_json, char *text)
{
    const uint16_t count = value_registers(form->type, 1);
    int is_negative = 0;
    uint64_t integer = 0;
    uint8_t status;

    if (value_is_wide_bits(form->type))
        status = mbm_registers_getBits(registers, address, count, form->order, form->first,
                                       form->bits, &integer);
    else
        status =
            value_get_integer(form->type, form->order, registers, address, &integer, &is_negative);
    if (status != MBM_OK)
        return MBM_MALFORMED_VALUE;
    if (form->type == MBM_TYPE_BIT) {
        strcpy(text, is_json ? (integer ? "true" : "false") : integer ? "1" : "0");
    } else if (form->is_hex) {
        const int digits = 4 * count;
        const uint64_t bits = is_negative ? ~integer + 1 : integer;

        snprintf(text, NUMBER_BYTES, is_json ? "\"0x%0*" PRIX64 "\"" : "0x%0*" PRIX64, digits,
                 digits < 16 ? bits & ((UINT64_C(1) << 4 * digits) - 1) : bits);
    } else if (form->scale.digits != 0) {
        const double real = (double)integer * form->scale.value;

        print_real(text, is_negative ? -real : real, 15, is_json);
    } else {
        snprintf(text, NUMBER_BYTES, "%s%" PRIu64, is_negative ? "-" : "", integer);
    }
    return MBM_OK;
}

uint8_t value_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                    uint16_t count, int is_json, char text[VALUE_TEXT_BYTES])
{
    char date[VALUE_DATE_BYTES];
    uint8_t status = MBM_OK;

    if (value_is_text(form->type))
        print_text(form, registers, address, count, is_json, text);
    else if (value_is_float(form->type))
        print_float(form, registers, address, is_json, text);
    else if (!value_is_date(form->type))
        status = print_integer(form, registers, address, is_json, text);
    else if ((status = value_date_print(form, registers, address, date)) == MBM_OK)
        snprintf(text, VALUE_TEXT_BYTES, is_json ? "\"%s\"" : "%s", date);
    if (status != MBM_OK)
        strcpy(text, is_json ? "null" : "");
    return status;
}

const char *value_set_text(const value_form *form, const mbm_registers *registers, uint16_t address,
                           uint16_t count, const char *text)
{
    switch (mbm_registers_setText(registers, address, count, form->order,
                                  value_text_form(form->type), text)) {
    case MBM_OK: return NULL;
    case MBM_BUFFER_TOO_SMALL: return "is longer than the field";
    default: return "ends with a space, which would be lost among those that fill the field";
    }
}
