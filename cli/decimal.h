/* Decimal numbers that are added, multiplied, rounded and compared exactly. */
#pragma once

#include "value.h"

enum {
    DECIMAL_DIGITS = 800,
    DECIMAL_BYTES = 64 /* hold any number as decimal_print writes it */
};

/* digits * 10^exponent. The digits neither begin nor end with 0; zero has none. */
typedef struct decimal_number {
    uint8_t digits[DECIMAL_DIGITS + 2]; /* the most significant first */
    size_t count;
    long exponent;
    int is_negative;
} decimal_number;

/* Reads all of a number that is written as in JSON, of at most VALUE_LONGEST bytes. Returns 0 if
 * the text is anything else. */
int decimal_read(const char *text, size_t length, decimal_number *number);

/* Gives a number the form of a scale. Returns 0 if it has more than 18 digits. */
int decimal_shorten(const decimal_number *number, value_scale *scale);

/* Reads such a number of at most 18 digits, 0 too, in the form of a scale. Returns 0 if the text is
 * anything else, or if the number is greater than 10^18 or has more than 18 decimals. */
int decimal_read_short(const char *text, value_scale *number);

/* The number that a scale is. One without digits is 0. */
void decimal_of_scale(const value_scale *scale, decimal_number *number);

/* Return 0 if the result has too many digits; the number is undefined then. */
int decimal_multiply(decimal_number *number, const value_scale *factor);
int decimal_add(decimal_number *number, const value_scale *other, int is_subtracted);

/* Divides a number by a whole one of at most 18 digits: the quotient without its sign, and whether
 * something is left over. Returns 0 if the quotient has more than 64 bits. */
int decimal_divide(const decimal_number *number, uint64_t divisor, uint64_t *quotient,
                   int *has_rest);

/* Less than 0, 0 or more than 0: as `one` is less than, equal to or greater than `other`. */
int decimal_compare(const decimal_number *one, const value_scale *other);

/* Whether a number is a whole multiple of a step, which is not 0. */
int decimal_is_multiple(const decimal_number *number, const value_scale *step);

/* Rounds to so many digits after the point, halves away from 0. */
void decimal_round(decimal_number *number, unsigned places);

/* Writes a number as JSON has it: with all its digits, and with `places` digits after the point at
 * least. A number that is too long for that has an exponent and 17 digits. */
void decimal_print(const decimal_number *number, unsigned places, char text[DECIMAL_BYTES]);

/* Writes the number that a scale is, with all its digits. */
void decimal_print_scale(const value_scale *scale, char text[DECIMAL_BYTES]);

/* Writes a number with an exponent, for value_read. Returns 0 if it has too many digits. */
int decimal_print_exact(const decimal_number *number, char text[VALUE_LONGEST + 1]);
