/* The names of a device's fields: what they become elsewhere.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_NAMES_H
#define DEVICE_NAMES_H

#include "device.h"
#include "yaml_file.h"

/* Gives each field of a device its topic and its identifier. Returns 0 after refusing a name that
 * has none, or two names that become the same. */
int device_names_make(yaml_file *file, device *of);

#endif
