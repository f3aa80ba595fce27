/* Home Assistant's MQTT discovery: a retained message for each field, from which Home Assistant
 * makes an entity. The keys are those of its documentation of MQTT sensor, binary sensor, number,
 * switch and text. */
#pragma once

#include "device.h"

enum { DISCOVERY_TOPIC_BYTES = 1000 };

/* Where the fields are published: at TOPIC/BELOWNAME. The topics of discovery begin with `prefix`.
 */
typedef struct discovery_line {
    const char *prefix, *topic, *below;
    uint8_t is_plain;
} discovery_line;

/* Writes the topic of a field's message. */
void discovery_topic(const discovery_line *line, const device *of, uint16_t field,
                     char topic[DISCOVERY_TOPIC_BYTES]);

/* Returns the message, which the caller frees, or NULL without memory, and writes its topic. */
char *discovery_config(const discovery_line *line, const device *of, uint16_t field,
                       char topic[DISCOVERY_TOPIC_BYTES]);
