/* Repeated fields: a device with ten equal channels is described once.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_REPEAT_H
#define DEVICE_REPEAT_H

#include "yaml_file.h"

/* How often, how many addresses apart, and the number of the first one. */
typedef struct device_repeat {
    uint32_t count, every, first;
} device_repeat;

/* Reads a repetition; without a node there is one. Returns 0 after a refusal. */
int device_repeat_read(yaml_file *file, const yaml_node_t *node, device_repeat *into);

/* Begin the repetition at a place, from 0 on: its number stands in all words until the end. */
void device_repeat_begin(yaml_file *file, const device_repeat *repeat, uint32_t at);
void device_repeat_end(yaml_file *file);

/* Returns the fields of a group that is repeated, and sets `repeat` to its key; NULL for a field. A
 * refusal ends it too: the caller looks at the code of the file. */
const yaml_node_t *device_repeat_group(yaml_file *file, const yaml_node_t *item,
                                       const yaml_node_t **repeat);

/* Reads the name of a field. In a repetition it has the number in place of each {n}; a name without
 * {n} has it at its end. Returns 0 after a refusal. */
int device_repeat_name(yaml_file *file, const yaml_node_t *node, size_t most, char **name);

#endif
