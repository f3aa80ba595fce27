/* Reads numbers into registers, and writes registers as text, without rounding.
 *
 * Licence: MIT OR Apache-2.0. */
#include "value.h"

#include "numbers.h"

#include <ctype.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* SCALE_DIGITS: a remainder of a division by the scale, with one more digit, fits in 64 bits.
 * RANGE_DIGITS: a number with more digits is out of range, whatever the scale is.
 * FAR: an exponent beyond it makes each number too large or too small for all types. */
enum { SCALE_DIGITS = 18, RANGE_DIGITS = SCALE_DIGITS + 20, FAR = 100000 };

const char *const value_table_names[] = {"", "coils", "discrete", "holding", "input", NULL};
const char *const value_type_names[] = {"",       "bit",   "uint16", "int16",  "uint32", "int32",
                                        "uint64", "int64", "float",  "double", "text",   NULL};
const char *const value_order_names[] = {"", "ABCD", "CDAB", "BADC", "DCBA", NULL};

static const char OUT_OF_RANGE[] = "is out of range";
static const value_scale ONE = {.digits = 1, .value = 1};

/* A number: digits * 10^exponent. The digits neither begin nor end with 0. Zero has none. */
typedef struct decimal {
    char digits[VALUE_LONGEST];
    size_t count;
    long exponent;
    int is_negative;
} decimal;

uint16_t value_registers(uint8_t type, uint16_t count)
{
    static const uint8_t registers[MBM_TYPE_TEXT + 1] = {0, 1, 1, 1, 2, 2, 4, 4, 2, 4, 0};

    return type == MBM_TYPE_TEXT ? (uint16_t)((count + 1) / 2) : registers[type];
}

/* Reads all bytes as one number. */
static int read_decimal(cursor in, decimal *number)
{
    const cursor all = in;
    long exponent = 0;
    int is_fraction = 0;

    memset(number, 0, sizeof *number);
    if (!cursor_skip_number(&in) || in.at != in.end || all.end - all.at > VALUE_LONGEST)
        return 0;
    in = all;
    number->is_negative = cursor_skip_char(&in, '-');
    for (; cursor_is_digit(&in) || (in.at < in.end && *in.at == '.'); in.at++) {
        if (*in.at == '.') {
            is_fraction = 1;
            continue;
        }
        number->exponent -= is_fraction;
        if (number->count > 0 || *in.at != '0')
            number->digits[number->count++] = *in.at;
    }
    while (number->count > 0 && number->digits[number->count - 1] == '0') {
        number->count--;
        number->exponent++;
    }
    if (in.at < in.end) {
        int is_negative;

        in.at++;
        is_negative = cursor_skip_char(&in, '-');
        if (!is_negative)
            (void)cursor_skip_char(&in, '+');
        while (cursor_is_digit(&in)) {
            if (exponent < FAR)
                exponent = exponent * 10 + (*in.at - '0');
            in.at++;
        }
        number->exponent += is_negative ? -exponent : exponent;
    }
    return 1;
}

int value_scale_read(const char *text, value_scale *scale)
{
    const cursor all = {text, text + strlen(text)};
    decimal number;
    size_t at;

    if (!read_decimal(all, &number) || number.count == 0 || number.count > SCALE_DIGITS)
        return 0;
    scale->value = strtod(text, NULL);
    /* Too large or too small for a double. */
    if (!isfinite(scale->value) || scale->value == 0)
        return 0;
    scale->digits = 0;
    for (at = 0; at < number.count; at++)
        scale->digits = scale->digits * 10 + (uint64_t)(number.digits[at] - '0');
    scale->exponent = number.exponent;
    scale->is_negative = (uint8_t)number.is_negative;
    return 1;
}

static int is_one(const value_scale *scale)
{
    return scale->digits == 1 && scale->exponent == 0 && !scale->is_negative;
}

/* Divides a number by a scale, digit by digit. Returns NULL and the quotient without its sign, or
 * why the number is refused. */
static const char *divide(const decimal *number, const value_scale *scale, uint64_t *quotient)
{
    const char *wrong = is_one(scale) ? "is not a whole number" : "is not a multiple of the scale";
    const long count = (long)number->count;
    /* The zeros that follow the digits of the number. */
    const long zeros = count > 0 ? number->exponent - scale->exponent : 0;
    uint64_t remainder = 0;
    long at;

    *quotient = 0;
    /* The digits of the number do not end with 0, so no integer times 10 has them. */
    if (zeros < 0)
        return wrong;
    if (count + zeros > RANGE_DIGITS)
        return OUT_OF_RANGE;
    for (at = 0; at < count + zeros; at++) {
        const int digit = at < count ? number->digits[at] - '0' : 0;
        uint64_t next;

        remainder = remainder * 10 + (uint64_t)digit;
        next = remainder / scale->digits;
        remainder %= scale->digits;
        if (*quotient > (UINT64_MAX - next) / 10)
            return OUT_OF_RANGE;
        *quotient = *quotient * 10 + next;
    }
    return remainder == 0 ? NULL : wrong;
}

/* Converts a number to the integer of a field, as two's complement. Returns NULL, or why it is
 * refused. */
static const char *to_integer(const decimal *number, const value_scale *scale, uint8_t type,
                              uint64_t *integer)
{
    static const struct {
        uint64_t below_zero, most;
    } RANGES[MBM_TYPE_INT64 + 1] = {
        [MBM_TYPE_BIT] = {0, 1},
        [MBM_TYPE_UINT16] = {0, UINT16_MAX},
        [MBM_TYPE_INT16] = {(uint64_t)INT16_MAX + 1, INT16_MAX},
        [MBM_TYPE_UINT32] = {0, UINT32_MAX},
        [MBM_TYPE_INT32] = {(uint64_t)INT32_MAX + 1, INT32_MAX},
        [MBM_TYPE_UINT64] = {0, UINT64_MAX},
        [MBM_TYPE_INT64] = {(uint64_t)INT64_MAX + 1, INT64_MAX},
    };
    const int is_negative = number->is_negative != scale->is_negative;
    const char *wrong = divide(number, scale, integer);

    if (wrong)
        return wrong;
    if (*integer > (is_negative ? RANGES[type].below_zero : RANGES[type].most))
        return OUT_OF_RANGE;
    if (is_negative)
        *integer = ~*integer + 1;
    return NULL;
}

/* Converts a number to the nearest float or double. Returns 0 if it is too large, or if it is not 0
 * but becomes 0. */
static int to_real(cursor in, const decimal *number, const value_scale *scale, uint8_t type,
                   double *real)
{
    char text[VALUE_LONGEST + 1];
    const size_t length = (size_t)(in.end - in.at);

    memcpy(text, in.at, length);
    text[length] = '\0';
    *real = strtod(text, NULL) / scale->value;
    if (type == MBM_TYPE_FLOAT && fabs(*real) <= (double)FLT_MAX)
        /* A number without a scale is rounded once, not first to a double. */
        *real = scale->value == 1 ? (double)strtof(text, NULL) : (double)(float)*real;
    return fabs(*real) <= (type == MBM_TYPE_FLOAT ? (double)FLT_MAX : DBL_MAX) &&
           (*real != 0 || number->count == 0);
}

/* Reads hexadecimal digits, after 0x or not. Returns NULL, or why they are refused. */
static const char *read_hex(cursor in, uint8_t type, uint64_t *integer)
{
    const uint16_t bits = type == MBM_TYPE_BIT ? 1 : (uint16_t)(16 * value_registers(type, 1));
    const char *from;

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

uint16_t value_read(const value_form *form, const char *text, size_t length,
                    uint16_t words[VALUE_WORDS], const char **wrong)
{
    const value_scale *scale = form->scale.digits ? &form->scale : &ONE;
    const cursor in = {text, text + length};
    const uint8_t order = form->order;
    mbm_registers registers;
    uint64_t integer = 0;
    decimal number;
    double real = 0;
    float single;

    *wrong = NULL;
    (void)mbm_registers_intoWords(&registers, words, VALUE_WORDS, 0);
    if (form->is_hex) {
        *wrong = read_hex(in, form->type, &integer);
    } else if (length > VALUE_LONGEST || !read_decimal(in, &number)) {
        *wrong = "is not a decimal number";
    } else if (form->type == MBM_TYPE_FLOAT || form->type == MBM_TYPE_DOUBLE) {
        if (!to_real(in, &number, scale, form->type, &real))
            *wrong = OUT_OF_RANGE;
    } else {
        *wrong = to_integer(&number, scale, form->type, &integer);
    }
    if (*wrong)
        return 0;
    switch (form->type) {
    case MBM_TYPE_FLOAT:
        single = (float)real;
        (void)mbm_registers_setFloat(&registers, 0, order, &single);
        return 2;
    case MBM_TYPE_DOUBLE: (void)mbm_registers_setDouble(&registers, 0, order, &real); return 4;
    case MBM_TYPE_UINT32:
    case MBM_TYPE_INT32:
        (void)mbm_registers_setUint32(&registers, 0, order, (uint32_t)integer);
        return 2;
    case MBM_TYPE_UINT64:
    case MBM_TYPE_INT64: (void)mbm_registers_setUint64(&registers, 0, order, &integer); return 4;
    case MBM_TYPE_BIT: words[0] = (uint16_t)integer; return 1;
    default: (void)mbm_registers_setUint16(&registers, 0, order, (uint16_t)integer); return 1;
    }
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
static void print_text(const mbm_registers *registers, uint16_t address, uint16_t count,
                       uint8_t order, int is_json, char *text)
{
    char latin[VALUE_LONGEST_TEXT + 1] = "";
    size_t from;

    (void)mbm_registers_getString(registers, address, count, order, latin, sizeof latin);
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

/* The integer at an address: for signed types its sign, and without it the amount. */
static uint64_t get_integer(const value_form *form, const mbm_registers *registers,
                            uint16_t address, int *is_negative)
{
    uint16_t word = 0;
    uint32_t two = 0;
    uint64_t four = 0;

    *is_negative = 0;
    switch (form->type) {
    case MBM_TYPE_UINT32:
    case MBM_TYPE_INT32:
        (void)mbm_registers_getUint32(registers, address, form->order, &two);
        four = form->type == MBM_TYPE_INT32 ? (uint64_t)(int32_t)two : two;
        break;
    case MBM_TYPE_UINT64:
    case MBM_TYPE_INT64:
        (void)mbm_registers_getUint64(registers, address, form->order, &four);
        break;
    default:
        (void)mbm_registers_getUint16(
            registers, address, form->type == MBM_TYPE_BIT ? MBM_ORDER_ABCD : form->order, &word);
        four = form->type == MBM_TYPE_INT16 ? (uint64_t)(int16_t)word : word;
    }
    if (form->type == MBM_TYPE_INT16 || form->type == MBM_TYPE_INT32 ||
        form->type == MBM_TYPE_INT64)
        *is_negative = four >> 63 != 0;
    return *is_negative ? ~four + 1 : four;
}

void value_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                 uint16_t count, int is_json, char text[VALUE_TEXT_BYTES])
{
    const int is_scaled = form->scale.digits != 0, is_float = form->type == MBM_TYPE_FLOAT;
    double real = 0;
    float single = 0;
    uint64_t integer;
    int is_negative;

    if (form->type == MBM_TYPE_TEXT) {
        print_text(registers, address, count, form->order, is_json, text);
        return;
    }
    if (is_float || form->type == MBM_TYPE_DOUBLE) {
        if (is_float)
            (void)mbm_registers_getFloat(registers, address, form->order, &single);
        else
            (void)mbm_registers_getDouble(registers, address, form->order, &real);
        if (is_float)
            real = (double)single;
        if (is_scaled)
            print_real(text, real * form->scale.value, is_float ? 7 : 15, is_json);
        else
            print_exact(text, real, is_float, is_json);
        return;
    }
    integer = get_integer(form, registers, address, &is_negative);
    if (form->type == MBM_TYPE_BIT) {
        strcpy(text, is_json ? (integer ? "true" : "false") : integer ? "1" : "0");
    } else if (form->is_hex) {
        const int digits = 4 * value_registers(form->type, 1);
        const uint64_t bits = is_negative ? ~integer + 1 : integer;

        snprintf(text, NUMBER_BYTES, is_json ? "\"0x%0*" PRIX64 "\"" : "0x%0*" PRIX64, digits,
                 digits < 16 ? bits & ((UINT64_C(1) << 4 * digits) - 1) : bits);
    } else if (is_scaled) {
        real = (double)integer * form->scale.value;
        print_real(text, is_negative ? -real : real, 15, is_json);
    } else {
        snprintf(text, NUMBER_BYTES, "%s%" PRIu64, is_negative ? "-" : "", integer);
    }
}
