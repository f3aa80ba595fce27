/* Values of registers and bits as text: exactly, or not at all.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef VALUE_H
#define VALUE_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

enum {
    VALUE_WORDS = 4,          /* the most registers of a number */
    VALUE_LONGEST = 128,      /* bytes of the longest number that is read */
    VALUE_LONGEST_TEXT = 250, /* characters of the longest text: 125 registers */
    VALUE_TEXT_BYTES = 1600   /* hold any value as value_print writes it */
};

/* The factor of a scale: (-)digits * 10^exponent, exactly. All 0: no scale, a factor of 1. */
typedef struct value_scale {
    uint64_t digits;
    long exponent;
    double value; /* the same, rounded */
    uint8_t is_negative;
} value_scale;

struct conversion;

/* How registers stand for a value. */
typedef struct value_form {
    uint8_t type;  /* one of MBM_TYPE_ */
    uint8_t order; /* one of MBM_ORDER_ */
    uint8_t is_hex;
    value_scale scale;
    const struct conversion *conversion; /* for the functions of conversion.h; NULL for none */
} value_form;

/* The names of tables, types and orders, each at its number in mbm.h; the first is no name, and
 * NULL ends them. */
extern const char *const value_table_names[], *const value_type_names[], *const value_order_names[];

/* How many registers a value of a type has, or a text with `count` characters. A bit has 1. */
uint16_t value_registers(uint8_t type, uint16_t count);

/* Reads a scale, written as in JSON, such as 0.1 or -12.5e-1. Returns 0 if the text is anything
 * else or longer, or if the number is 0 or has more than 18 digits. */
int value_scale_read(const char *text, value_scale *scale);

/* Converts a number of `length` bytes, written as in JSON, to the words of a value; a bit becomes
 * the word 0 or 1. Not for texts. Returns the number of words, or 0 with the reason in `wrong`: a
 * clause such as "is out of range". */
uint16_t value_read(const value_form *form, const char *text, size_t length,
                    uint16_t words[VALUE_WORDS], const char **wrong);

/* Writes the value at an address. In JSON a bit is true or false, infinity and not-a-number are
 * null, and text and hexadecimal numbers have quotes. A text has `count` characters; bytes above
 * 127 are taken as Latin-1. */
void value_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                 uint16_t count, int is_json, char text[VALUE_TEXT_BYTES]);

#endif
