#define _GNU_SOURCE
#include "mqtt_payload.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* SCALE_DIGITS: a remainder of a division by the scale, with one more digit, fits in 64 bits.
 * RANGE_DIGITS: a number with more digits is out of range, whatever the scale is.
 * FAR: an exponent beyond it makes each number too large or too small for all types. */
enum { SCALE_DIGITS = 18, RANGE_DIGITS = SCALE_DIGITS + 20, FAR = 100000 };

static const char OUT_OF_RANGE[] = "the number is out of range";

/* The bytes that have not been read yet. */
typedef struct cursor {
    const char *at, *end;
} cursor;

/* A number: digits * 10^exponent. The digits neither begin nor end with 0. Zero has none. */
typedef struct decimal {
    char digits[MQTT_LONGEST_WRITE];
    size_t count;
    long exponent;
    int is_negative;
} decimal;

/* --- JSON (RFC 8259). Each function returns 0 if the next bytes are not what it skips. --- */

static int skip_value(cursor *in);

static int is_digit(const cursor *in)
{
    return in->at < in->end && *in->at >= '0' && *in->at <= '9';
}

static int is_space(char one)
{
    return one == ' ' || one == '\t' || one == '\r' || one == '\n';
}

static void skip_space(cursor *in)
{
    while (in->at < in->end && is_space(*in->at))
        in->at++;
}

static int skip_char(cursor *in, char one)
{
    if (in->at == in->end || *in->at != one)
        return 0;
    in->at++;
    return 1;
}

static int skip_word(cursor *in, const char *word)
{
    const size_t length = strlen(word);

    if ((size_t)(in->end - in->at) < length || memcmp(in->at, word, length) != 0)
        return 0;
    in->at += length;
    return 1;
}

static int skip_digits(cursor *in)
{
    if (!is_digit(in))
        return 0;
    while (is_digit(in))
        in->at++;
    return 1;
}

static int skip_number(cursor *in)
{
    (void)skip_char(in, '-');
    if (!skip_char(in, '0') && !skip_digits(in))
        return 0;
    if (skip_char(in, '.') && !skip_digits(in))
        return 0;
    if (!skip_char(in, 'e') && !skip_char(in, 'E'))
        return 1;
    if (!skip_char(in, '-'))
        (void)skip_char(in, '+');
    return skip_digits(in);
}

static int skip_escape(cursor *in)
{
    int left = 4;

    if (in->at == in->end || !strchr("\"\\/bfnrtu", *in->at) || !*in->at)
        return 0;
    if (*in->at++ != 'u')
        return 1;
    while (left > 0 && in->at < in->end && *in->at && strchr("0123456789abcdefABCDEF", *in->at)) {
        in->at++;
        left--;
    }
    return left == 0;
}

static int skip_string(cursor *in)
{
    if (!skip_char(in, '"'))
        return 0;
    while (in->at < in->end && *in->at != '"') {
        const unsigned char one = (unsigned char)*in->at++;

        if (one < ' ' || (one == '\\' && !skip_escape(in)))
            return 0;
    }
    return skip_char(in, '"');
}

/* After a bracket: skips the items or members up to the bracket that closes them. If `value` is not
 * NULL, it gets the member of that name, and each name must be plain and "value" be there once. */
static int skip_rest(cursor *in, char closing, cursor *value)
{
    skip_space(in);
    if (skip_char(in, closing))
        return 1;
    for (;;) {
        cursor name, found;
        int is_value;

        skip_space(in);
        name.at = in->at;
        if (closing == '}') {
            if (!skip_string(in))
                return 0;
            name.end = in->at;
            skip_space(in);
            if (!skip_char(in, ':'))
                return 0;
            skip_space(in);
        }
        found.at = in->at;
        if (!skip_value(in))
            return 0;
        found.end = in->at;
        if (value) {
            /* An escape could spell "value" in another way. */
            if (memchr(name.at, '\\', (size_t)(name.end - name.at)))
                return 0;
            is_value = skip_word(&name, "\"value\"");
            if (is_value && value->at)
                return 0;
            if (is_value)
                *value = found;
        }
        skip_space(in);
        if (skip_char(in, closing))
            return 1;
        if (!skip_char(in, ','))
            return 0;
    }
}

/* The depth of its calls is limited by the length of the payload. */
static int skip_value(cursor *in)
{
    if (skip_char(in, '{'))
        return skip_rest(in, '}', NULL);
    if (skip_char(in, '['))
        return skip_rest(in, ']', NULL);
    if (in->at < in->end && *in->at == '"')
        return skip_string(in);
    return skip_word(in, "true") || skip_word(in, "false") || skip_word(in, "null") ||
           skip_number(in);
}

/* --- numbers --- */

/* Reads all bytes as one number. */
static int read_decimal(cursor in, decimal *number)
{
    const cursor all = in;
    long exponent = 0;
    int is_fraction = 0;

    memset(number, 0, sizeof *number);
    if (!skip_number(&in) || in.at != in.end || all.end - all.at > MQTT_LONGEST_WRITE)
        return 0;
    in = all;
    number->is_negative = skip_char(&in, '-');
    for (; is_digit(&in) || (in.at < in.end && *in.at == '.'); in.at++) {
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
        is_negative = skip_char(&in, '-');
        if (!is_negative)
            (void)skip_char(&in, '+');
        while (is_digit(&in)) {
            if (exponent < FAR)
                exponent = exponent * 10 + (*in.at - '0');
            in.at++;
        }
        number->exponent += is_negative ? -exponent : exponent;
    }
    return 1;
}

int mqtt_payload_scale(const char *text, mqtt_scale *scale)
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

/* Divides a number by a scale, digit by digit. Returns NULL and the quotient without its sign, or
 * why the number is refused. */
static const char *divide(const decimal *number, const mqtt_scale *scale, uint64_t *quotient)
{
    const char *wrong = scale->digits == 1 && scale->exponent == 0
                            ? "the number is not whole"
                            : "the number is not a multiple of the scale";
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
static const char *to_integer(const decimal *number, const mqtt_scale *scale, uint8_t type,
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
static int to_real(cursor in, const decimal *number, const mqtt_scale *scale, uint8_t type,
                   double *real)
{
    char text[MQTT_LONGEST_WRITE + 1];
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

/* --- payloads --- */

/* Returns the value in a payload: all of it without the space around it, or the member "value".
 * Without one, the result is empty. */
static cursor find_value(const char *payload, size_t length)
{
    cursor in = {payload, payload + length}, value = {NULL, NULL};

    skip_space(&in);
    while (in.at < in.end && is_space(in.end[-1]))
        in.end--;
    if (!skip_char(&in, '{'))
        return in;
    if (!skip_rest(&in, '}', &value) || in.at != in.end)
        value.at = value.end = NULL;
    return value;
}

/* Returns 0 or 1, or -1 if the value is no truth value. */
static int read_truth(cursor value)
{
    static const char *const WORDS[] = {"false", "true", "off", "on", "OFF", "ON"};
    int at;

    for (at = 0; value.at && at < 6; at++) {
        cursor in = value;

        if (skip_word(&in, WORDS[at]) && in.at == in.end)
            return at & 1;
    }
    return -1;
}

uint16_t mqtt_payload_parse(const mqtt_field *field, const mbm_planField *planned,
                            const char *payload, size_t length, uint16_t words[MQTT_WRITE_WORDS],
                            const char **wrong)
{
    const uint8_t order = planned->order;
    mbm_registers registers;
    uint64_t integer = 0;
    decimal number;
    cursor value;
    double real;
    float single;

    *wrong = length > MQTT_LONGEST_WRITE ? "the payload is too long" : NULL;
    if (*wrong)
        return 0;
    value = find_value(payload, length);
    if (planned->type == MBM_TYPE_BIT && read_truth(value) >= 0) {
        words[0] = (uint16_t)read_truth(value);
        return 1;
    }
    (void)mbm_registers_intoWords(&registers, words, MQTT_WRITE_WORDS, 0);
    if (!value.at || !read_decimal(value, &number)) {
        *wrong = "the payload is no number";
    } else if (planned->type == MBM_TYPE_FLOAT || planned->type == MBM_TYPE_DOUBLE) {
        if (!to_real(value, &number, &field->scale, planned->type, &real))
            *wrong = OUT_OF_RANGE;
    } else {
        *wrong = to_integer(&number, &field->scale, planned->type, &integer);
    }
    if (*wrong)
        return 0;
    switch (planned->type) {
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
