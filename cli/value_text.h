/* The values of a plan's fields as text.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef VALUE_TEXT_H
#define VALUE_TEXT_H

#include "device.h"

/* The longest value as text: 2000 bits or 125 numbers, or a text. */
enum { VALUE_TEXT_LONGEST = 16384 };

/* Writes the value that the plan has of a field: plain, or as JSON if `is_json` is 1. Several
 * values are separated by commas, in JSON in an array. Returns 0 if no value has arrived yet. */
int value_text(const mbm_plan *plan, const device *of, uint16_t field, int is_json,
               char text[VALUE_TEXT_LONGEST]);

/* How many values a field has: several numbers in a row or bits of a table; otherwise 1. */
uint16_t value_count(const mbm_planField *planned);

/* Returns the name that the enumeration of a field has for one of its values. NULL if it has none,
 * or if no value has arrived yet. */
const char *value_name(const mbm_plan *plan, const device *of, uint16_t field, uint16_t index);

#endif
