/* What a line of the bridge reads and writes: a device file, with the storage of its plan and what
 * was published of its fields.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef BRIDGE_TABLE_H
#define BRIDGE_TABLE_H

#include "device.h"
#include "yaml_file.h"

enum { BRIDGE_REQUESTS = 4 /* reads in the client's queue at once */ };

/* What was published of a field. */
typedef struct published {
    char *value; /* NULL: nothing */
    uint8_t status;
    uint8_t is_answered; /* the unit answered the last read */
    uint8_t has_ended;   /* the first read has ended */
} published;

/* A unit: how many of its fields have which state. */
typedef struct unit_state {
    uint16_t fields, answered, ended;
    enum { UNIT_UNKNOWN, UNIT_OFFLINE, UNIT_ONLINE } state;
} unit_state;

typedef struct bridge_table {
    device fields;
    uint64_t digest; /* of the file */
    published *last; /* of the fields that can be read */
    unit_state units[256];
    mbm_planSetup setup; /* complete, but for `update` and `context` */
} bridge_table;

/* Reads a device file for the bridge, and checks that a plan can read it. Returns NULL after a
 * failure; `code` has its exit code and `wrong` the reason, a sentence without its full stop. */
bridge_table *bridge_table_read(const char *path, uint8_t register_gap, int *code,
                                char wrong[YAML_FILE_WRONG_BYTES]);
void bridge_table_free(bridge_table *table);

#endif
