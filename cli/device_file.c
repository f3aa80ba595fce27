/* Reads the keys of a device file, each field with its value and enumeration, and refuses what
 * contradicts itself. */
#include "device.h"

#include "device_keys.h"
#include "report.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_DESCRIPTION = 10000 };

/* The keys of the file and of a field. The numbers count from 0 here. */
enum {
    DEVICE,
    DEVICE_UNIT,
    DEVICE_INTERVAL,
    DEVICE_ORDER,
    MASK_WRITE,
    FIELDS,
    NOTATION,
    ONE_BASED,
    DEVICE_WRITE_FUNCTION,
    DEVICE_TIME_ZONE,
    LIMITS,
    DEVICE_NOT_AVAILABLE = LIMITS + LIMITS_KEYS,
    REACH,
    DEVICE_KEYS = REACH + REACH_FILE_KEYS
};
static const char *const DEVICE_NAMES[] = {
    "device",         "unit",      "interval",          "order",
    "mask_write",     "fields",    "notation",          "one_based",
    "write_function", "time_zone", DEVICE_LIMITS_NAMES, "not_available",
    REACH_FILE_NAMES, NULL};
enum {
    NAME,
    TABLE,
    ADDRESS,
    TYPE,
    BIT,
    COUNT,
    SCALE,
    MEASURE,
    ACCESS,
    INTERVAL,
    VALUE,
    FIELD_UNIT,
    ORDER,
    DESCRIPTION,
    ENUMERATION,
    WRITE_FUNCTION,
    FIELD_REPEAT,
    DEVICE_CLASS,
    STATE_CLASS,
    PRESS,
    NOT_AVAILABLE,
    OFFSET,
    PRECISION,
    MIN_VALUE,
    MAX_VALUE,
    STEP,
    BITS_OF,
    LAYOUT,
    TIME_ZONE,
    FIELD_KEYS
};
static const char *const FIELD_NAMES[] = {"name",          "table",
                                          "address",       "type",
                                          "bit",           "count",
                                          "scale",         "unit_of_measurement",
                                          "access",        "interval",
                                          "value",         "unit",
                                          "order",         "description",
                                          "enumeration",   "write_function",
                                          "repeat",        "device_class",
                                          "state_class",   "press",
                                          "not_available", "offset",
                                          "precision",     "min_value",
                                          "max_value",     "step",
                                          "bits",          "layout",
                                          "time_zone",     NULL};

#define NEEDED_OF_FIELD (1u << NAME | 1u << ADDRESS)

/* Words whose numbers are their places, from 1 on, like the words of value.h. */
static const char *const ACCESS_NAMES[] = {"", "read", "write", "read-write", NULL};

/* --- a field --- */

/* Reads table and address; `offset` is that of a repetition. Returns 0 after a refusal. */
static int read_address(yaml_file *file, const yaml_node_t *field, const yaml_node_t *const *values,
                        const device *of, uint32_t offset, mbm_planField *planned)
{
    device_place at = {0};

    if (!device_address_read_table(file, values[TABLE], &at.table) ||
        !device_address_read(file, "address", values[ADDRESS], of, &at))
        return 0;
    if (at.table == 0)
        return yaml_file_refuse(file, field, "the field has no key table");
    if (at.address + offset > 65535)
        return yaml_file_refuse(file, values[ADDRESS],
                                "the field is %u addresses after %s: addresses end at 65535",
                                (unsigned)offset, device_address_text(of, at.table, at.address));
    planned->table = at.table;
    planned->address = (uint16_t)(at.address + offset);
    return 1;
}

/* The keys that complete a type. */
static device_type_keys keys_of_type(const yaml_node_t *const *values)
{
    const device_type_keys keys = {.type = values[TYPE],
                                   .order = values[ORDER],
                                   .bit = values[BIT],
                                   .bits = values[BITS_OF],
                                   .count = values[COUNT],
                                   .layout = values[LAYOUT],
                                   .time_zone = values[TIME_ZONE]};

    return keys;
}

/* Whether the type is known and goes with the table. Returns 0 after a refusal. */
static int read_type(yaml_file *file, const yaml_node_t *field, const yaml_node_t *const *values,
                     mbm_planField *planned, device_field *into)
{
    const device_type_keys keys = keys_of_type(values);
    const int is_bits = device_is_of_bits(planned->table);

    if (!values[TYPE] && !is_bits)
        return yaml_file_refuse(file, field, "the field has no key type");
    planned->type = MBM_TYPE_BIT;
    if (!yaml_file_kind(file, "type", values[TYPE], value_type_names + 1, &planned->type))
        return 0;
    if (is_bits && planned->type != MBM_TYPE_BIT)
        return yaml_file_refuse(file, values[TYPE],
                                "type is %s: the type of coils and discrete inputs is bit",
                                value_type_name(planned->type));
    if (values[BIT] && !device_is_part(planned))
        return yaml_file_refuse(file, values[BIT],
                                "bit is for fields of the type bit in the tables holding and "
                                "input");
    return device_types_read_layout(file, field, &keys, planned, into);
}

/* Reads bit and count, which must not reach beyond a request or the table. */
static int read_size(yaml_file *file, const yaml_node_t *field, const yaml_node_t *const *values,
                     const device *of, mbm_planField *planned)
{
    uint32_t bit = 0, count = 1, size;
    const int is_bits = device_is_of_bits(planned->table);

    if (value_is_text(planned->type) && !values[COUNT])
        return yaml_file_refuse(file, field, "a text needs its number of characters as count");
    if (!yaml_file_number(file, "bit", values[BIT], 0, 15, &bit) ||
        !yaml_file_number(file, "count", values[COUNT], 1, MBM_MAX_READ_BITS, &count))
        return 0;
    planned->count = (uint16_t)count;
    planned->bit = (uint8_t)bit;
    if (device_is_part(planned) && bit + count > 16)
        return yaml_file_refuse(
            file, values[COUNT] ? values[COUNT] : field,
            "the field has %u bits from bit %u on: a register has the bits 0 to 15", count, bit);
    size = device_size(planned);
    if (size > (is_bits ? MBM_MAX_READ_BITS : MBM_MAX_READ_REGISTERS))
        return yaml_file_refuse(
            file, values[COUNT] ? values[COUNT] : field,
            "count is %u: these are %u registers, and one request reads at most %d", count, size,
            MBM_MAX_READ_REGISTERS);
    if (planned->address + size > 65536)
        return yaml_file_refuse(file, values[ADDRESS],
                                "the field has %u %s from address %s on: addresses end at %s", size,
                                is_bits ? "bits" : "registers",
                                device_address_text(of, planned->table, planned->address),
                                device_address_text(of, planned->table, 65535));
    return 1;
}

/* Reads what a field takes from the device unless it has its own. */
static int read_shared(yaml_file *file, const yaml_node_t *unit, const yaml_node_t *interval,
                       const yaml_node_t *order, mbm_planField *planned)
{
    uint32_t number = planned->unit;

    if (!yaml_file_number(file, "unit", unit, 0, 255, &number) ||
        !yaml_file_time(file, "interval", interval, 1, MBM_PLAN_LONGEST_INTERVAL,
                        &planned->intervalMs) ||
        !yaml_file_kind(file, "order", order, value_order_names + 1, &planned->order))
        return 0;
    planned->unit = (uint16_t)number;
    return 1;
}

static int read_access(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       int writes_masks, device_field *field)
{
    const int is_input =
        planned->table == MBM_TABLE_DISCRETE_INPUTS || planned->table == MBM_TABLE_INPUT_REGISTERS;

    field->access = DEVICE_READ;
    if (!yaml_file_kind(file, "access", node, ACCESS_NAMES + 1, &field->access))
        return 0;
    if (field->access > DEVICE_READ && is_input)
        return yaml_file_refuse(file, node,
                                "access is %s: only coils and holding registers can be written",
                                ACCESS_NAMES[field->access]);
    if (field->access > DEVICE_READ && device_is_wide_part(planned))
        return yaml_file_refuse(file, node,
                                "access is %s: bits of several registers cannot be written at once",
                                ACCESS_NAMES[field->access]);
    if (field->access > DEVICE_READ && device_is_part(planned) && !writes_masks)
        return yaml_file_refuse(file, node,
                                "access is %s: bits of a register cannot be written, unless the "
                                "device has function 22 and the file says \"mask_write: yes\"",
                                ACCESS_NAMES[field->access]);
    return 1;
}

/* Reads what the numbers of a field mean. `shared` is not_available at the head of the file. */
static int read_meaning(yaml_file *file, const yaml_node_t *const *values,
                        const yaml_node_t *shared, const mbm_planField *planned,
                        device_field *field)
{
    const device_values keys = {.scale = values[SCALE],
                                .offset = values[OFFSET],
                                .precision = values[PRECISION],
                                .not_available = values[NOT_AVAILABLE],
                                .least = values[MIN_VALUE],
                                .most = values[MAX_VALUE],
                                .step = values[STEP]};

    return device_values_read(file, &keys, shared, planned, field);
}

/* --- the fields together --- */

/* Returns whether two fields have an address in common for which the file gives other values. */
static int is_contradiction(const device *of, uint16_t one, uint16_t other)
{
    const mbm_planField *a = &of->planned[one], *b = &of->planned[other];
    const uint32_t end_a = a->address + device_size(a), end_b = b->address + device_size(b);
    uint32_t at = a->address > b->address ? a->address : b->address;

    if (a->unit != b->unit || a->table != b->table || !of->fields[one].words ||
        !of->fields[other].words)
        return 0;
    for (; at < end_a && at < end_b; at++) {
        const uint32_t in_a = at - a->address, in_b = at - b->address;
        const uint16_t mask = device_mask(a, in_a) & device_mask(b, in_b);

        if ((of->fields[one].words[in_a] ^ of->fields[other].words[in_b]) & mask)
            return 1;
    }
    return 0;
}

/* Whether the value of a field goes with those of the fields before `end`. Returns 0 after a
 * refusal. */
static int check_value(yaml_file *file, const device *of, uint16_t field, uint16_t end)
{
    const device_field *fields = of->fields;
    uint16_t i;

    for (i = 0; i < end; i++)
        if (i != field && is_contradiction(of, i, field))
            return yaml_file_refuse_line(file, fields[field].line,
                                         "%s shares an address with %s of line %d, and has another "
                                         "value",
                                         fields[field].name, fields[i].name, fields[i].line);
    return 1;
}

/* Whether the last field goes with those before it. Returns 0 after a refusal. */
static int check_others(yaml_file *file, const yaml_node_t *node, const device *of)
{
    const uint16_t last = (uint16_t)(of->count - 1);
    const device_field *fields = of->fields;
    uint16_t i;

    for (i = 0; i < last; i++)
        if (strcmp(fields[i].name, fields[last].name) == 0)
            return yaml_file_refuse(file, node, "the field in line %d has the name %s too",
                                    fields[i].line, fields[i].name);
    return check_value(file, of, last, last);
}

/* Reads what waits until all fields are known: the values of fields whose power of ten another
 * field has. Returns 0 after a refusal. */
static int read_late(yaml_file *file, device *into)
{
    uint16_t i;

    for (i = 0; i < into->count; i++) {
        device_field *field = &into->fields[i];

        if (field->power_name && (!device_values_find_power(file, into, i) ||
                                  !device_initial_read(file, (const yaml_node_t *)field->late_value,
                                                       &into->planned[i], field) ||
                                  !check_value(file, into, i, into->count)))
            return 0;
        field->late_value = NULL;
    }
    return 1;
}

/* What fields take from the head of the file. */
typedef struct head {
    mbm_planField planned;
    uint8_t write_function;
    const yaml_node_t *not_available;
    int16_t zone; /* of the device's clock, in minutes east of UTC */
} head;

/* Reads the value of a field, or keeps it for read_late. */
static int read_or_keep_value(yaml_file *file, const yaml_node_t *node,
                              const mbm_planField *planned, device_field *field)
{
    field->late_value = field->power_name ? node : NULL;
    return field->power_name || device_initial_read(file, node, planned, field);
}

/* Makes space for another field. Returns 0 after a refusal. */
static int grow(yaml_file *file, const yaml_node_t *node, device *into)
{
    const size_t count = into->count, next = count < 16 ? 16 : 2 * count;
    void *fields, *planned;

    if (count == MBM_PLAN_MAX_FIELDS)
        return yaml_file_refuse(file, node, "the file has more than %u fields",
                                MBM_PLAN_MAX_FIELDS);
    if (count > 0 && (count < 16 || (count & (count - 1)) != 0))
        return 1;
    fields = realloc(into->fields, next * sizeof *into->fields);
    if (fields)
        into->fields = (device_field *)fields;
    planned = realloc(into->planned, next * sizeof *into->planned);
    if (planned)
        into->planned = (mbm_planField *)planned;
    return (fields && planned) || yaml_file_fail(file, ENOMEM);
}

/* Reads the next field, whose addresses are those of its values and `offset`. */
static int read_field(yaml_file *file, const yaml_node_t *node, const yaml_node_t *const *values,
                      const head *shared, uint32_t offset, device *into)
{
    const device_type_keys keys = keys_of_type(values);
    device_field *field;
    mbm_planField *planned;

    if (!grow(file, node, into))
        return 0;
    field = &into->fields[into->count];
    planned = &into->planned[into->count];
    memset(field, 0, sizeof *field);
    field->write_function = shared->write_function;
    field->line = (int)yaml_file_line(node);
    *planned = shared->planned;
    field->power_field = -1;
    into->count++;
    return device_repeat_name(file, values[NAME], DEVICE_NAME_BYTES, &field->name) &&
           yaml_file_copy(file, "unit_of_measurement", values[MEASURE], DEVICE_NAME_BYTES,
                          &field->unit_of_measurement) &&
           yaml_file_copy(file, "description", values[DESCRIPTION], MOST_DESCRIPTION,
                          &field->description) &&
           read_address(file, node, values, into, offset, planned) &&
           read_type(file, node, values, planned, field) &&
           read_size(file, node, values, into, planned) &&
           read_shared(file, values[FIELD_UNIT], values[INTERVAL], values[ORDER], planned) &&
           device_types_complete(file, &keys, shared->zone, planned, field) &&
           read_access(file, values[ACCESS], planned, into->writes_masks, field) &&
           device_limits_check(file, node, values[WRITE_FUNCTION], into, planned, field) &&
           read_meaning(file, values, shared->not_available, planned, field) &&
           read_or_keep_value(file, values[VALUE], planned, field) &&
           device_labels_read(file, values[ENUMERATION], planned, field) &&
           device_home_read(file, values[DEVICE_CLASS], values[STATE_CLASS], values[PRESS], planned,
                            field) &&
           check_others(file, node, into);
}

/* --- the file --- */

/* Reads a field as often as its file repeats it. `offset` is that of the group it is in, which is
 * repeated itself if `is_in_group` is 1. */
static int read_repeated(yaml_file *file, const yaml_node_t *node, const head *shared,
                         uint32_t offset, int is_in_group, device *into)
{
    const yaml_node_t *values[FIELD_KEYS] = {NULL};
    device_repeat repeat;
    uint32_t i;

    if (!yaml_file_keys(file, "the field", node, FIELD_NAMES, NEEDED_OF_FIELD, values))
        return 0;
    if (!values[FIELD_REPEAT])
        return read_field(file, node, values, shared, offset, into);
    if (is_in_group)
        return yaml_file_refuse(file, values[FIELD_REPEAT],
                                "a field of a group that is repeated is not repeated itself");
    if (!device_repeat_read(file, values[FIELD_REPEAT], &repeat))
        return 0;
    for (i = 0; i < repeat.count; i++) {
        device_repeat_begin(file, &repeat, i);
        if (!read_field(file, node, values, shared, i * repeat.every, into))
            return 0;
    }
    device_repeat_end(file);
    return 1;
}

/* Reads the fields of a group as often as its file repeats it: those of the first, those of the
 * second, and so on. */
static int read_group(yaml_file *file, const yaml_node_t *list, const yaml_node_t *key,
                      const head *shared, device *into)
{
    const size_t count = yaml_file_items(file, "fields", list, MBM_PLAN_MAX_FIELDS);
    device_repeat repeat;
    size_t at;
    uint32_t i;

    if (count == 0 || !device_repeat_read(file, key, &repeat))
        return 0;
    for (i = 0; i < repeat.count; i++) {
        device_repeat_begin(file, &repeat, i);
        for (at = 0; at < count; at++)
            if (!read_repeated(file, yaml_file_item(file, list, at), shared, i * repeat.every, 1,
                               into))
                return 0;
    }
    device_repeat_end(file);
    return 1;
}

static int read_fields(yaml_file *file, const yaml_node_t *list, const head *shared, device *into)
{
    const size_t count = yaml_file_items(file, "fields", list, MBM_PLAN_MAX_FIELDS);
    size_t at;

    if (count == 0)
        return 0;
    for (at = 0; at < count; at++) {
        const yaml_node_t *item = yaml_file_item(file, list, at), *repeat = NULL;
        const yaml_node_t *group = device_repeat_group(file, item, &repeat);

        if (group ? !read_group(file, group, repeat, shared, into)
                  : !read_repeated(file, item, shared, 0, 0, into))
            return 0;
    }
    return 1;
}

/* Moves the fields that can be read before those that cannot. Returns 0 after a failure. */
static int sort_fields(yaml_file *file, device *into)
{
    const uint16_t count = into->count;
    device_field *fields = (device_field *)calloc(count, sizeof *fields);
    mbm_planField *planned = (mbm_planField *)calloc(count, sizeof *planned);
    uint16_t i, to = 0;
    int turn;

    if (!fields || !planned) {
        free(fields);
        free(planned);
        return yaml_file_fail(file, ENOMEM);
    }
    for (turn = 0; turn < 2; turn++) {
        for (i = 0; i < count; i++)
            if (((into->fields[i].access & DEVICE_READ) == 0) == turn) {
                fields[to] = into->fields[i];
                planned[to++] = into->planned[i];
            }
        if (turn == 0)
            into->readable = to;
    }
    free(into->fields);
    free(into->planned);
    into->fields = fields;
    into->planned = planned;
    return 1;
}

static int read_root(yaml_file *file, const yaml_node_t *root, void *from)
{
    device *into = (device *)from;
    head shared = {.planned = {.unit = 1, .intervalMs = 1000, .order = MBM_ORDER_ABCD}};
    const yaml_node_t *values[DEVICE_KEYS] = {NULL};

    if (!yaml_file_keys(file, "the file", root, DEVICE_NAMES, 1u << FIELDS, values) ||
        !yaml_file_copy(file, "device", values[DEVICE], DEVICE_NAME_BYTES, &into->name) ||
        !read_shared(file, values[DEVICE_UNIT], values[DEVICE_INTERVAL], values[DEVICE_ORDER],
                     &shared.planned) ||
        !device_values_check_shared(file, values[DEVICE_NOT_AVAILABLE]) ||
        !yaml_file_answer(file, "mask_write", values[MASK_WRITE], &into->writes_masks) ||
        !device_address_read_notation(file, values[NOTATION], values[ONE_BASED], into) ||
        !device_limits_read_function(file, values[DEVICE_WRITE_FUNCTION], &shared.write_function) ||
        !device_types_read_zone(file, values[DEVICE_TIME_ZONE], &shared.zone) ||
        !device_limits_read(file, values + LIMITS, into) ||
        !reach_read_nodes(file, values + REACH, &into->reach))
        return 0;
    shared.not_available = values[DEVICE_NOT_AVAILABLE];
    return read_fields(file, values[FIELDS], &shared, into) && device_names_make(file, into) &&
           sort_fields(file, into) && read_late(file, into);
}

int device_file_read(device *into, const char *path, char wrong[YAML_FILE_WRONG_BYTES])
{
    int code;

    memset(into, 0, sizeof *into);
    code = yaml_file_read(path, read_root, into, wrong);
    if (code != CODE_DONE)
        device_free(into);
    return code;
}
