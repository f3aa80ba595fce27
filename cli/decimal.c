/* Adds, multiplies, rounds and compares decimal numbers, digit by digit. */
#include "decimal.h"

#include "numbers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* SHORT_DIGITS: of a scale, a limit or an offset. FAR: an exponent beyond it makes each number too
 * large or too small for every type. WIDEST: the most characters of a number without exponent. */
enum { SHORT_DIGITS = 18, FAR = 100000, WIDEST = 40, KEPT = 17 };

/* Removes the zeros at both ends. */
static void trim(decimal_number *number)
{
    size_t zeros = 0;

    while (number->count > 0 && number->digits[number->count - 1] == 0) {
        number->count--;
        number->exponent++;
    }
    while (zeros < number->count && number->digits[zeros] == 0)
        zeros++;
    number->count -= zeros;
    memmove(number->digits, number->digits + zeros, number->count);
    if (number->count == 0) {
        number->exponent = 0;
        number->is_negative = 0;
    }
}

int decimal_read(const char *text, size_t length, decimal_number *number)
{
    cursor in = {text, text + length};
    long exponent = 0;
    int is_fraction = 0, is_small;

    number->count = 0;
    number->exponent = 0;
    if (length > VALUE_LONGEST || !cursor_skip_number(&in) || in.at != in.end)
        return 0;
    in.at = text;
    number->is_negative = cursor_skip_char(&in, '-');
    for (; in.at < in.end && *in.at != 'e' && *in.at != 'E'; in.at++) {
        if (*in.at == '.') {
            is_fraction = 1;
            continue;
        }
        number->digits[number->count++] = (uint8_t)(*in.at - '0');
        number->exponent -= is_fraction;
    }
    if (in.at < in.end) {
        in.at++;
        is_small = cursor_skip_char(&in, '-');
        if (!is_small)
            (void)cursor_skip_char(&in, '+');
        for (; cursor_is_digit(&in); in.at++)
            if (exponent < FAR)
                exponent = exponent * 10 + (*in.at - '0');
        number->exponent += is_small ? -exponent : exponent;
    }
    trim(number);
    return 1;
}

int decimal_shorten(const decimal_number *number, value_scale *scale)
{
    char text[VALUE_LONGEST + 1];
    size_t at;

    if (number->count > SHORT_DIGITS)
        return 0;
    scale->digits = 0;
    for (at = 0; at < number->count; at++)
        scale->digits = scale->digits * 10 + number->digits[at];
    scale->exponent = number->exponent;
    scale->is_negative = (uint8_t)number->is_negative;
    (void)decimal_print_exact(number, text);
    scale->value = strtod(text, NULL);
    return 1;
}

int decimal_read_short(const char *text, value_scale *number)
{
    static decimal_number read;

    memset(number, 0, sizeof *number);
    return decimal_read(text, strlen(text), &read) && read.exponent >= -SHORT_DIGITS &&
           read.exponent + (long)read.count <= SHORT_DIGITS && decimal_shorten(&read, number);
}

void decimal_of_scale(const value_scale *scale, decimal_number *number)
{
    char text[32];
    size_t at;

    number->count = (size_t)snprintf(text, sizeof text, "%llu", (unsigned long long)scale->digits);
    for (at = 0; at < number->count; at++)
        number->digits[at] = (uint8_t)(text[at] - '0');
    number->exponent = scale->exponent;
    number->is_negative = scale->is_negative;
    trim(number);
}

int decimal_multiply(decimal_number *number, const value_scale *factor)
{
    enum { MORE = 20 };
    uint64_t carry = 0;
    size_t at;

    if (number->count + MORE > DECIMAL_DIGITS)
        return 0;
    memmove(number->digits + MORE, number->digits, number->count);
    memset(number->digits, 0, MORE);
    number->count += MORE;
    for (at = number->count; at-- > 0;) {
        /* At most 9 * 10^18 and a tenth of that. */
        carry += number->digits[at] * factor->digits;
        number->digits[at] = (uint8_t)(carry % 10);
        carry /= 10;
    }
    number->exponent += factor->exponent;
    number->is_negative ^= factor->is_negative;
    trim(number);
    return 1;
}

/* Appends zeros until the exponent is this one. Returns 0 if there are too many. */
static int lower_exponent(decimal_number *number, long exponent)
{
    const long zeros = number->exponent - exponent;

    if (number->count == 0)
        return 1;
    if (zeros < 0 || (size_t)zeros + number->count + 1 > DECIMAL_DIGITS)
        return zeros == 0;
    memset(number->digits + number->count, 0, (size_t)zeros);
    number->count += (size_t)zeros;
    number->exponent = exponent;
    return 1;
}

/* The digit of an integer at a place from the right, 0 beyond its first. */
static int digit_at(const decimal_number *number, size_t place)
{
    return place < number->count ? number->digits[number->count - 1 - place] : 0;
}

/* Compares the digits of two numbers with the same exponent. */
static int compare_digits(const decimal_number *one, const decimal_number *other)
{
    if (one->count != other->count)
        return one->count < other->count ? -1 : 1;
    return memcmp(one->digits, other->digits, one->count);
}

/* Gives two numbers the same exponent. Returns 0 if one gets too many digits. */
static int align(decimal_number *one, decimal_number *other)
{
    if (one->count == 0 || other->count == 0)
        return 1;
    return one->exponent < other->exponent ? lower_exponent(other, one->exponent)
                                           : lower_exponent(one, other->exponent);
}

/* Sets the digits of a number to `large` plus or minus `small`, which is not larger. */
static void combine(decimal_number *result, const decimal_number *large,
                    const decimal_number *small, int is_difference)
{
    const size_t count = large->count + 1;
    size_t place;
    int carry = 0;

    result->count = count;
    for (place = 0; place < count; place++) {
        const int own = digit_at(large, place), other = digit_at(small, place) + carry;
        const int digit = is_difference ? own - other : own + other;

        carry = digit < 0 || digit > 9;
        result->digits[count - 1 - place] = (uint8_t)(digit < 0   ? digit + 10
                                                      : digit > 9 ? digit - 10
                                                                  : digit);
    }
}

int decimal_add(decimal_number *number, const value_scale *other, int is_subtracted)
{
    static decimal_number added, before;
    int is_same_sign;

    decimal_of_scale(other, &added);
    if (added.count == 0)
        return 1;
    added.is_negative ^= is_subtracted;
    if (number->count == 0) {
        *number = added;
        return 1;
    }
    if (!align(number, &added))
        return 0;
    before = *number;
    is_same_sign = before.is_negative == added.is_negative;
    if (compare_digits(&before, &added) >= 0) {
        combine(number, &before, &added, !is_same_sign);
    } else {
        combine(number, &added, &before, !is_same_sign);
        number->is_negative = added.is_negative;
    }
    trim(number);
    return 1;
}

int decimal_compare(const decimal_number *one, const value_scale *other)
{
    static decimal_number a, b;
    int order;

    a = *one;
    decimal_of_scale(other, &b);
    if (a.count == 0 || b.count == 0 || a.is_negative != b.is_negative) {
        const int sign_a = a.count == 0 ? 0 : a.is_negative ? -1 : 1;
        const int sign_b = b.count == 0 ? 0 : b.is_negative ? -1 : 1;

        return sign_a - sign_b;
    }
    /* Without a common exponent they differ by hundreds of digits. */
    order = align(&a, &b) ? compare_digits(&a, &b) : a.exponent > b.exponent ? 1 : -1;
    return a.is_negative ? -order : order;
}

int decimal_divide(const decimal_number *number, uint64_t divisor, uint64_t *quotient,
                   int *has_rest)
{
    const long before_point = (long)number->count + number->exponent;
    uint64_t rest = 0;
    long at;

    *quotient = 0;
    for (at = 0; at < before_point; at++) {
        uint64_t next;

        rest = rest * 10 + ((size_t)at < number->count ? number->digits[at] : 0u);
        next = rest / divisor;
        rest %= divisor;
        if (*quotient > (UINT64_MAX - next) / 10)
            return 0;
        *quotient = *quotient * 10 + next;
    }
    *has_rest = rest > 0 || (number->count > 0 && number->exponent < 0);
    return 1;
}

int decimal_is_multiple(const decimal_number *number, const value_scale *step)
{
    const uint64_t digits = step->digits;
    uint64_t rest = 0;
    long zeros = number->exponent - step->exponent;
    size_t at;

    if (number->count == 0)
        return 1;
    /* The digits of the number do not end with 0. */
    if (zeros < 0 || digits == 0)
        return 0;
    for (at = 0; at < number->count; at++)
        rest = (rest * 10 + number->digits[at]) % digits;
    for (; zeros > 0 && rest > 0; zeros--)
        rest = rest * 10 % digits;
    return rest == 0;
}

void decimal_round(decimal_number *number, unsigned places)
{
    const long less = -(long)places - number->exponent;
    size_t at;

    if (number->count == 0 || less <= 0)
        return;
    if ((size_t)less > number->count) {
        number->count = 0;
        trim(number);
        return;
    }
    at = number->count - (size_t)less;
    /* A zero before them takes the carry; the digit after them says how to round. */
    memmove(number->digits + 1, number->digits, at + 1);
    number->digits[0] = 0;
    number->count = at + 1;
    number->exponent += less;
    if (number->digits[at + 1] >= 5)
        for (at = number->count; ++number->digits[at - 1] > 9;)
            number->digits[--at] = 0;
    trim(number);
}

void decimal_print(const decimal_number *number, unsigned places, char text[DECIMAL_BYTES])
{
    long place = (long)number->count + number->exponent; /* digits before the point */
    const long after = number->exponent < -(long)places ? -number->exponent : (long)places;
    static decimal_number short_one;
    char *to = text;
    long at;

    if (place < 1)
        place = 1;
    if (number->is_negative)
        *to++ = '-';
    if (place + after > WIDEST) {
        short_one = *number;
        /* The digits after the first KEPT go. */
        if (short_one.count > KEPT) {
            short_one.exponent += (long)short_one.count - KEPT;
            short_one.count = KEPT;
            trim(&short_one);
        }
        *to++ = (char)('0' + short_one.digits[0]);
        if (short_one.count > 1)
            *to++ = '.';
        for (at = 1; at < (long)short_one.count; at++)
            *to++ = (char)('0' + short_one.digits[at]);
        (void)snprintf(to, 24, "e%+ld", short_one.exponent + (long)short_one.count - 1);
        return;
    }
    for (at = place - 1; at >= -after; at--) {
        const long from_right = at - number->exponent;

        if (at == -1)
            *to++ = '.';
        *to++ = (char)('0' + (from_right < 0 ? 0 : digit_at(number, (size_t)from_right)));
    }
    *to = '\0';
}

void decimal_print_scale(const value_scale *scale, char text[DECIMAL_BYTES])
{
    static decimal_number number;

    decimal_of_scale(scale, &number);
    decimal_print(&number, 0, text);
}

int decimal_print_exact(const decimal_number *number, char text[VALUE_LONGEST + 1])
{
    enum { EXPONENT = 20 };
    char *to = text;
    size_t at;

    if (number->count > VALUE_LONGEST - EXPONENT)
        return 0;
    if (number->is_negative)
        *to++ = '-';
    for (at = 0; at < number->count; at++)
        *to++ = (char)('0' + number->digits[at]);
    if (number->count == 0)
        *to++ = '0';
    (void)snprintf(to, EXPONENT, "e%ld", number->exponent);
    return 1;
}
