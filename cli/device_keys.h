/* The readers of a device file's keys, in groups; device_file.c calls them. Each returns 0 after a
 * refusal. A node may be NULL where a key may be missing. */
#pragma once

#include "device.h"
#include "yaml_file.h"

/* --- addresses, as the manual prints them --- */

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

/* --- what one request may do, what none may read, and by which functions fields are written --- */

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

/* --- what completes the type of a field --- */

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

/* --- what the numbers of a field mean --- */

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

/* --- the enumeration --- */

/* Reads the enumeration of a field whose type and scale are known. The node may be NULL. Returns 0
 * after a refusal. */
int device_labels_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       device_field *field);

/* --- the value at first --- */

/* Reads the value of a field whose form is known. The node may be NULL. Returns 0 after a refusal.
 */
int device_initial_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                        device_field *field);

/* Whether a node is a value of a field, which has one, and whose form is known. Returns 0 after a
 * refusal, which names the key. */
int device_initial_check(yaml_file *file, const char *key, const yaml_node_t *node,
                         const mbm_planField *planned, const device_field *field);

/* --- Home Assistant --- */

/* Reads the keys of a field whose other keys are read; a node may be NULL. Returns 0 after a
 * refusal. */
int device_home_read(yaml_file *file, const yaml_node_t *device_class,
                     const yaml_node_t *state_class, const yaml_node_t *press,
                     const mbm_planField *planned, device_field *field);

/* --- repeated fields --- */

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

/* --- what names become elsewhere --- */

/* Gives each field of a device its topic and its identifier. Returns 0 after refusing a name that
 * has none, or two names that become the same. */
int device_names_make(yaml_file *file, device *of);
