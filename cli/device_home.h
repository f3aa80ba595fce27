/* The keys of a field for Home Assistant: device_class, state_class and press.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_HOME_H
#define DEVICE_HOME_H

#include "device.h"
#include "yaml_file.h"

/* Reads the keys of a field whose other keys are read; a node may be NULL. Returns 0 after a
 * refusal. */
int device_home_read(yaml_file *file, const yaml_node_t *device_class,
                     const yaml_node_t *state_class, const yaml_node_t *press,
                     const mbm_planField *planned, device_field *field);

#endif
