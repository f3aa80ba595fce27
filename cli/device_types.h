/* The keys of a field in a device file that complete its type: bits of a wide field, the layout of
 * a date, and the time zone of the device's clock.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_TYPES_H
#define DEVICE_TYPES_H

#include "device.h"
#include "yaml_file.h"

/* The values of these keys; NULL without one. */
typedef struct device_type_keys {
    const yaml_node_t *type, *order, *bit, *bits, *count, *layout, *time_zone;
} device_type_keys;

/* Reads a time zone, such as +01:00, in minutes east of UTC. Without a node it stays. Returns 0
 * after a refusal. */
int device_types_read_zone(yaml_file *file, const yaml_node_t *node, int16_t *minutes);

/* Reads the layout of a field whose type is known: a date's type then says how many registers it
 * has. Returns 0 after a refusal. */
int device_types_read_layout(yaml_file *file, const yaml_node_t *field,
                             const device_type_keys *keys, mbm_planField *planned,
                             device_field *into);

/* Reads bits and time zone of a field whose order is known, and gives its form what it has of the
 * type. `zone` is that of the head of the file. Returns 0 after a refusal. */
int device_types_complete(yaml_file *file, const device_type_keys *keys, int16_t zone,
                          mbm_planField *planned, device_field *into);

#endif
