/* The key `enumeration` of a field in a device file.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_LABELS_H
#define DEVICE_LABELS_H

#include "device.h"
#include "yaml_file.h"

/* Reads the enumeration of a field whose type and scale are known. The node may be NULL. Returns 0
 * after a refusal. */
int device_labels_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       device_field *field);

#endif
