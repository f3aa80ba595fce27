/* The limits of a device: how much one request may read and write, what must not be read, what may
 * be read over, and by which functions it is written.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_LIMITS_H
#define DEVICE_LIMITS_H

#include "device.h"
#include "yaml_file.h"

/* The keys of the head, in the order of `values` of device_limits_read. */
enum {
    LIMITS_READ_REGISTERS,
    LIMITS_READ_BITS,
    LIMITS_WRITE_REGISTERS,
    LIMITS_WRITE_BITS,
    LIMITS_EXCLUDED,
    LIMITS_GAP,
    LIMITS_KEYS
};
#define DEVICE_LIMITS_NAMES                                                                        \
    "max_read_registers", "max_read_bits", "max_write_registers", "max_write_bits", "excluded",    \
        "gap"

/* Reads the limits. The notation of the file is known. Returns 0 after a refusal. */
int device_limits_read(yaml_file *file, const yaml_node_t *const *values, device *into);

/* Reads by which function fields are written, of the head or of a field. Without a node the value
 * stays. Returns 0 after a refusal. */
int device_limits_read_function(yaml_file *file, const yaml_node_t *node, uint8_t *function);

/* Reads the function of a field, and checks the field against the limits. `field` has its access,
 * and the function of the head. Returns 0 after a refusal. */
int device_limits_check(yaml_file *file, const yaml_node_t *node, const yaml_node_t *function,
                        const device *of, const mbm_planField *planned, device_field *field);

#endif
