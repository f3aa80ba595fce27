/* The payload of a write of `mbm bridge`: from text to registers, exactly or not at all. */
#pragma once

#include "value.h"

enum {
    PAYLOAD_BYTES = VALUE_LONGEST, /* of the longest payload of a single value */
    PAYLOAD_LONGEST = 3000,        /* bytes of the longest payload of a text or of several values */
    PAYLOAD_WORDS = 2000           /* the most words of a payload: a word for each coil */
};

/* Converts a payload of `length` bytes to the words of a write. The whole payload must be a number,
 * a truth value, or a JSON object with one member "value" that is a number or a truth value. White
 * space as in JSON may surround each of them. Only a bit takes a truth value; it becomes the word 0
 * or 1. docs/mqtt.md says which numbers a field takes. Returns the number of words, or 0 with the
 * reason in `wrong`, which the next call overwrites. */
uint16_t payload_parse(const value_form *form, const char *payload, size_t length,
                       uint16_t words[VALUE_WORDS], const char **wrong);

/* As payload_parse, for a text of `count` characters, or for `count` values. The payload of a text
 * is the text itself, as UTF-8, a JSON string, or a JSON object with such a member "value"; the
 * rest of the registers is 0. Several values are numbers or truth values with commas between them,
 * without or with the brackets of a JSON array, or an object with such an array as "value". */
uint16_t payload_parse_all(const value_form *form, uint16_t count, const char *payload,
                           size_t length, uint16_t words[PAYLOAD_WORDS], const char **wrong);
