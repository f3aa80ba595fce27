/* The payload of a write of mqtt_bridge: from text to registers, exactly or not at all.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef MQTT_PAYLOAD_H
#define MQTT_PAYLOAD_H

#include "mqtt_fields.h"

#include <stddef.h>

enum {
    MQTT_WRITE_WORDS = 4,    /* the most registers that a write has */
    MQTT_LONGEST_WRITE = 128 /* bytes of the longest payload of a write */
};

/* Reads the number of an option scale=, written as in JSON, such as 0.1 or -12.5e-1. Returns 0 if
 * the text is anything else or longer, or if the number is 0 or has more than 18 digits. */
int mqtt_payload_scale(const char *text, mqtt_scale *scale);

/* Converts a payload of `length` bytes to the words of a write. The whole payload must be a number,
 * a truth value, or a JSON object with one member "value" that is a number or a truth value. White
 * space as in JSON may surround each of them. Only a bit takes a truth value; it becomes the word 0
 * or 1. docs/mqtt.md says which numbers a field takes. Returns the number of words, or 0 with the
 * reason in `wrong`. */
uint16_t mqtt_payload_parse(const mqtt_field *field, const mbm_planField *planned,
                            const char *payload, size_t length, uint16_t words[MQTT_WRITE_WORDS],
                            const char **wrong);

#endif
