/* The key `value` of a field in a device file: what it has at first.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_INITIAL_H
#define DEVICE_INITIAL_H

#include "device.h"
#include "yaml_file.h"

/* Reads the value of a field whose form is known. The node may be NULL. Returns 0 after a refusal.
 */
int device_initial_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                        device_field *field);

/* Whether a node is a value of a field, which has one, and whose form is known. Returns 0 after a
 * refusal, which names the key. */
int device_initial_check(yaml_file *file, const char *key, const yaml_node_t *node,
                         const mbm_planField *planned, const device_field *field);

#endif
