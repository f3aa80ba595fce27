/* The value and the enumeration that the device file gives a field.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_VALUE_H
#define DEVICE_VALUE_H

#include "device.h"
#include "yaml_file.h"

/* Read `node`, the value of the key value or enumeration, into a field whose other keys are read.
 * Of a node that is NULL the field stays. They return 0 after a refusal. */
int device_value_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field);
int device_enumeration_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                            device_field *field);

#endif
