/* Values of mqtt_bridge: from registers to text.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef MQTT_VALUE_H
#define MQTT_VALUE_H

#include "mqtt_fields.h"

#include <stddef.h>

/* Writes the value of a field as text: plain, or as JSON if `is_json` is 1. Several values are
 * separated by commas, in JSON in an array. Returns 0 if no value has arrived yet, or if the text
 * needs more than `size` bytes. */
int mqtt_value_text(const mbm_plan *plan, const mqtt_fields *fields, uint16_t field, int is_json,
                    char *text, size_t size);

#endif
