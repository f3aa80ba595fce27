/* The payload of a write of `mbm bridge`: from text to registers, exactly or not at all.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef PAYLOAD_H
#define PAYLOAD_H

#include "value.h"

/* Bytes of the longest payload of a write. */
enum { PAYLOAD_BYTES = VALUE_LONGEST };

/* Converts a payload of `length` bytes to the words of a write. The whole payload must be a number,
 * a truth value, or a JSON object with one member "value" that is a number or a truth value. White
 * space as in JSON may surround each of them. Only a bit takes a truth value; it becomes the word 0
 * or 1. docs/mqtt.md says which numbers a field takes. Returns the number of words, or 0 with the
 * reason in `wrong`, which the next call overwrites. */
uint16_t payload_parse(const value_form *form, const char *payload, size_t length,
                       uint16_t words[VALUE_WORDS], const char **wrong);

#endif
