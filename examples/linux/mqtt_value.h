/* Values of mqtt_bridge: from registers to text, and from the payload of a write to registers.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef MQTT_VALUE_H
#define MQTT_VALUE_H

#include "mqtt_fields.h"

#include <stddef.h>

/* The most registers that a write has. */
enum { MQTT_WRITE_WORDS = 4 };

/* Writes the value of a field as text: plain, or as JSON if `is_json` is 1. Several values are
 * separated by commas, in JSON in an array. Returns 0 if no value has arrived yet, or if the text
 * needs more than `size` bytes. */
int mqtt_value_text(const mbm_plan *plan, const mqtt_fields *fields, uint16_t field, int is_json,
                    char *text, size_t size);

/* Converts a payload to the words of a write: a number, a truth value, or a JSON object with a
 * member "value" that is one. A bit becomes the word 0 or 1. Returns the number of words, or 0 with
 * the reason in `wrong`. */
uint16_t mqtt_value_parse(const mqtt_fields *fields, uint16_t field, const char *payload,
                          uint16_t words[MQTT_WRITE_WORDS], const char **wrong);

#endif
