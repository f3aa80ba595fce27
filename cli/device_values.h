/* The keys of a field in a device file that say what its numbers mean: scale, offset, precision,
 * not_available, min_value, max_value and step.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_VALUES_H
#define DEVICE_VALUES_H

#include "device.h"
#include "yaml_file.h"

/* The values of these keys; NULL without one. */
typedef struct device_values {
    const yaml_node_t *scale, *offset, *precision, *not_available, *least, *most, *step;
} device_values;

/* Reads the keys of a field, whose type, table and access are known. `shared` is not_available at
 * the head of the file, or NULL. Returns 0 after a refusal. */
int device_values_read(yaml_file *file, const device_values *values, const yaml_node_t *shared,
                       const mbm_planField *planned, device_field *field);

/* Checks not_available at the head of the file, which may be NULL. Returns 0 after a refusal. */
int device_values_check_shared(yaml_file *file, const yaml_node_t *shared);

/* When all fields are read: finds the field that has the power of ten of a field, and gives its
 * form the scale that the file's value of that field means. Returns 0 after a refusal. */
int device_values_find_power(yaml_file *file, device *of, uint16_t field);

#endif
