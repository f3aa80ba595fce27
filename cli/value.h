/* Values of registers and bits as text: exactly, or not at all. */
#pragma once

#include "value_types.h"

#include <stddef.h>
#include <stdint.h>

enum {
    VALUE_WORDS = 8,          /* the most registers of a number or a date */
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
    uint8_t type;  /* one of MBM_TYPE_ or VALUE_ */
    uint8_t order; /* one of MBM_ORDER_ */
    uint8_t is_hex;
    uint8_t first, bits; /* of wide bits: the lowest, and how many they are */
    int16_t zone;        /* of a date: the minutes by which the device's clock is east of UTC */
    value_scale scale;
    const struct conversion *conversion; /* for the functions of conversion.h; NULL for none */
    const char *layout;                  /* of VALUE_DATE_OF_ and VALUE_DATE_BCD_OF_ */
} value_form;

/* The names of tables and orders, each at its number in mbm.h; the first is no name, and NULL ends
 * them. */
extern const char *const value_table_names[], *const value_order_names[];

/* Reads a scale, written as in JSON, such as 0.1 or -12.5e-1. Returns 0 if the text is anything
 * else or longer, or if the number is 0 or has more than 18 digits. */
int value_scale_read(const char *text, value_scale *scale);

/* Converts a number of `length` bytes, written as in JSON, or a date to the words of a value; a bit
 * becomes the word 0 or 1, and wide bits have the other bits as 0. Not for texts. Returns the
 * number of words, or 0 with the reason in `wrong`: a clause such as "is out of range". */
uint16_t value_read(const value_form *form, const char *text, size_t length,
                    uint16_t words[VALUE_WORDS], const char **wrong);

/* Writes a text of the registers of a field: `text` has the rest as NULs or spaces. Returns NULL,
 * or why it is refused: a clause such as "ends with a space". */
const char *value_set_text(const value_form *form, const mbm_registers *registers, uint16_t address,
                           uint16_t count, const char *text);

/* Writes the value at an address. In JSON a bit is true or false, infinity and not-a-number are
 * null, and text, dates and hexadecimal numbers have quotes. A text has `count` characters; bytes
 * above 127 are taken as Latin-1. Returns MBM_OK; MBM_MALFORMED_VALUE, with null in JSON and else
 * an empty text, if the registers hold no value of the type. */
uint8_t value_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                    uint16_t count, int is_json, char text[VALUE_TEXT_BYTES]);

/* --- dates and times of registers as text of ISO 8601, and back: exactly, or not at all --- */

enum { VALUE_DATE_BYTES = 48, VALUE_ZONE_MOST = 14 * 60, VALUE_LAYOUT_BYTES = 32 };

/* Reads a time zone: Z, or hours and minutes east of UTC such as +01:00. Returns 0 if the text is
 * anything else. */
int value_zone_read(const char *text, int16_t *minutes);

/* Checks a layout of mbm_registers_getDate. Returns NULL with the number of its registers, or what
 * is wrong: a sentence without its full stop, which begins with the layout in quotes. */
const char *value_layout_check(const char *layout, uint8_t *registers);

/* Writes the date at an address: "2026-11-27T20:15:00Z", with milliseconds if the registers have
 * them; a day alone as "2026-11-27", a time of day as "20:15:00". Returns MBM_OK, or
 * MBM_MALFORMED_VALUE. */
uint8_t value_date_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                         char text[VALUE_DATE_BYTES]);

/* Converts such a text of `length` bytes, in any time zone, to the words of a value. Returns the
 * number of words, or 0 with the reason in `wrong`: a clause. */
uint16_t value_date_read(const value_form *form, const char *text, size_t length,
                         uint16_t words[VALUE_WORDS], const char **wrong);
