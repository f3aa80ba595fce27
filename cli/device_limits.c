/* Reads the limits of a device, and checks its fields against them. */
#include "device_keys.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_EXCLUDED = 255 };

enum { TABLE, ADDRESS, COUNT, UNIT, RANGE_KEYS };
static const char *const RANGE_NAMES[] = {"table", "address", "count", "unit", NULL};
enum { REGISTERS, BITS, GAP_KEYS };
static const char *const GAP_NAMES[] = {"registers", "bits", NULL};

static int read_number(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                       uint32_t most, uint16_t *into)
{
    uint32_t number = *into;

    if (!yaml_file_number(file, key, node, least, most, &number))
        return 0;
    *into = (uint16_t)number;
    return 1;
}

/* Reads a number for both, or a mapping. A gap of registers is never more than one request. */
static int read_gap(yaml_file *file, const yaml_node_t *node, device_limits *into)
{
    const yaml_node_t *values[GAP_KEYS] = {NULL};

    if (!node)
        return 1;
    if (node->type == YAML_MAPPING_NODE)
        return yaml_file_keys(file, "gap", node, GAP_NAMES, 0, values) &&
               read_number(file, "registers", values[REGISTERS], 0, MBM_MAX_READ_REGISTERS,
                           &into->register_gap) &&
               read_number(file, "bits", values[BITS], 0, MBM_MAX_READ_BITS, &into->bit_gap);
    if (!read_number(file, "gap", node, 0, MBM_MAX_READ_BITS, &into->bit_gap))
        return 0;
    into->register_gap =
        into->bit_gap < MBM_MAX_READ_REGISTERS ? into->bit_gap : MBM_MAX_READ_REGISTERS;
    return 1;
}

/* --- excluded addresses --- */

/* Reads a mapping such as {table: holding, address: 100, count: 20}. */
static int read_long(yaml_file *file, const yaml_node_t *node, const device *of, device_place *at,
                     uint16_t *unit)
{
    const yaml_node_t *values[RANGE_KEYS] = {NULL};
    uint32_t count = 1, number = 0;

    if (!yaml_file_keys(file, "the excluded range", node, RANGE_NAMES, 1u << ADDRESS, values) ||
        !device_address_read_table(file, values[TABLE], &at->table) ||
        !device_address_read(file, "address", values[ADDRESS], of, at) ||
        !yaml_file_number(file, "count", values[COUNT], 1, 65536, &count) ||
        !yaml_file_number(file, "unit", values[UNIT], 1, 255, &number))
        return 0;
    if (at->table == 0)
        return yaml_file_refuse(file, node, "the excluded range has no key table");
    *unit = (uint16_t)number;
    at->last = at->address + count - 1;
    if (at->last > 65535)
        return yaml_file_refuse(file, values[COUNT],
                                "%u addresses from %s on: addresses end at 65535", (unsigned)count,
                                device_address_text(of, at->table, at->address));
    return 1;
}

/* Reads a range: a mapping as above, one such as {holding: 100-119}, or in Modicon's notation a
 * word such as 40101-40120. */
static int read_range(yaml_file *file, const yaml_node_t *node, const device *of,
                      mbm_planExcludedRange *range)
{
    device_place at = {0};
    uint16_t unit = 0;

    if (node->type == YAML_MAPPING_NODE) {
        const yaml_file_pair pair = yaml_file_pair_at(file, node, 0);
        const char *key = yaml_file_size(node) == 1 && pair.key->type == YAML_SCALAR_NODE
                              ? (const char *)pair.key->data.scalar.value
                              : "address";

        if (strcmp(key, "address") == 0 || strcmp(key, "table") == 0) {
            if (!read_long(file, node, of, &at, &unit))
                return 0;
        } else if (!device_address_read_table(file, pair.key, &at.table) ||
                   !device_address_read_range(file, key, pair.value, of, &at)) {
            return 0;
        }
    } else if (!device_address_read_range(file, "excluded", node, of, &at)) {
        return 0;
    } else if (at.table == 0) {
        return yaml_file_refuse(file, node,
                                "the excluded range has no table: write \"holding: 100-119\", or "
                                "table, address and count");
    }
    range->unit = unit;
    range->table = at.table;
    range->first = (uint16_t)at.address;
    range->last = (uint16_t)at.last;
    return 1;
}

static int read_excluded(yaml_file *file, const yaml_node_t *node, device *into)
{
    device_limits *limits = &into->limits;
    size_t count, i;

    if (!node)
        return 1;
    count = yaml_file_items(file, "excluded", node, MOST_EXCLUDED);
    if (count == 0)
        return 0;
    limits->excluded = (mbm_planExcludedRange *)calloc(count, sizeof *limits->excluded);
    if (!limits->excluded)
        return yaml_file_fail(file, ENOMEM);
    for (i = 0; i < count; i++)
        if (!read_range(file, yaml_file_item(file, node, i), into, &limits->excluded[i]))
            return 0;
    limits->excluded_count = (uint8_t)count;
    return 1;
}

/* --- the head --- */

int device_limits_read(yaml_file *file, const yaml_node_t *const *values, device *into)
{
    device_limits *limits = &into->limits;

    return read_number(file, "max_read_registers", values[LIMITS_READ_REGISTERS], 1,
                       MBM_MAX_READ_REGISTERS, &limits->read_registers) &&
           read_number(file, "max_read_bits", values[LIMITS_READ_BITS], 1, MBM_MAX_READ_BITS,
                       &limits->read_bits) &&
           read_number(file, "max_write_registers", values[LIMITS_WRITE_REGISTERS], 1,
                       MBM_MAX_WRITE_REGISTERS, &limits->write_registers) &&
           read_number(file, "max_write_bits", values[LIMITS_WRITE_BITS], 1, MBM_MAX_WRITE_BITS,
                       &limits->write_bits) &&
           read_gap(file, values[LIMITS_GAP], limits) &&
           read_excluded(file, values[LIMITS_EXCLUDED], into);
}

int device_limits_read_function(yaml_file *file, const yaml_node_t *node, uint8_t *function)
{
    return yaml_file_kind(file, "write_function", node, device_functions, function);
}

/* --- a field --- */

/* Whether one request may read a field. */
static int check_read(yaml_file *file, const yaml_node_t *node, const device *of,
                      const mbm_planField *planned)
{
    const device_limits *limits = &of->limits;
    const int is_bits = device_is_of_bits(planned->table);
    const uint16_t most = is_bits ? limits->read_bits : limits->read_registers;
    const uint32_t size = device_size(planned), last = planned->address + size - 1;
    int i;

    if (most > 0 && size > most)
        return yaml_file_refuse(file, node, "the field has %u %s, and %s is %u", (unsigned)size,
                                is_bits ? "bits" : "registers",
                                is_bits ? "max_read_bits" : "max_read_registers", most);
    for (i = 0; i < limits->excluded_count; i++) {
        const mbm_planExcludedRange *range = &limits->excluded[i];

        if (range->table == planned->table && (range->unit == 0 || range->unit == planned->unit) &&
            range->first <= last && range->last >= planned->address)
            return yaml_file_refuse(file, node,
                                    "the field has an address from %s to %s, which excluded says "
                                    "must not be read",
                                    device_address_text(of, range->table, range->first),
                                    device_address_text(of, range->table, range->last));
    }
    return 1;
}

/* Whether one request may write a field. */
static int check_write(yaml_file *file, const yaml_node_t *node, const device *of,
                       const mbm_planField *planned, const device_field *field)
{
    const int is_bits = planned->table == MBM_TABLE_COILS;
    const device_limits *limits = &of->limits;
    const uint16_t most = is_bits ? limits->write_bits : limits->write_registers;
    const uint32_t size = device_size(planned);

    if (most > 0 && size > most)
        return yaml_file_refuse(file, node, "the field has %u %s, and %s is %u", (unsigned)size,
                                is_bits ? "coils" : "registers",
                                is_bits ? "max_write_bits" : "max_write_registers", most);
    if (field->write_function == DEVICE_SINGLE && size > 1)
        return yaml_file_refuse(file, node,
                                "the field has %u %s, and \"write_function: single\" writes one: "
                                "only \"multiple\" can write it, if the device can",
                                (unsigned)size, is_bits ? "coils" : "registers");
    return 1;
}

int device_limits_check(yaml_file *file, const yaml_node_t *node, const yaml_node_t *function,
                        const device *of, const mbm_planField *planned, device_field *field)
{
    if (!device_limits_read_function(file, function, &field->write_function))
        return 0;
    if (function && !(field->access & DEVICE_WRITE))
        return yaml_file_refuse(file, function,
                                "write_function is for fields that can be written: access is read");
    if (function && device_is_part(planned))
        return yaml_file_refuse(file, function,
                                "bits of a register are written by function 22: write_function "
                                "says nothing about them");
    if ((field->access & DEVICE_READ) && !check_read(file, node, of, planned))
        return 0;
    return !(field->access & DEVICE_WRITE) || device_is_part(planned) ||
           check_write(file, node, of, planned, field);
}
