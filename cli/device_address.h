/* The addresses of a device file, as its manual prints them.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_ADDRESS_H
#define DEVICE_ADDRESS_H

#include "device.h"
#include "yaml_file.h"

/* Reads how the file writes addresses. Returns 0 after a refusal. */
int device_address_read_notation(yaml_file *file, const yaml_node_t *notation,
                                 const yaml_node_t *one_based, device *into);

/* An address, and the last one of a range; `table` is 0 as long as it is not known. */
typedef struct device_place {
    uint8_t table;
    uint32_t address, last;
} device_place;

/* Read the table, unless the node is NULL; an address that is written as the file writes them; one
 * such as 100, or a range such as 100-119. In Modicon's notation an address says its table, which
 * must be the one that is known. They return 0 after a refusal. */
int device_address_read_table(yaml_file *file, const yaml_node_t *node, uint8_t *table);
int device_address_read(yaml_file *file, const char *key, const yaml_node_t *node, const device *of,
                        device_place *into);
int device_address_read_range(yaml_file *file, const char *key, const yaml_node_t *node,
                              const device *of, device_place *into);

#endif
