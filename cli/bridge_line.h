/* A line of the bridge, and its table: reads the fields of a device file with a plan, publishes
 * them, and writes what the broker sends. */
#pragma once

#include "broker.h"
#include "line.h"
#include "payload.h"
#include "yaml_file.h"

enum {
    BRIDGE_LINES = 32,
    BRIDGE_REQUESTS = 4,     /* reads in the queue of a line's client at once */
    BRIDGE_WRITES = 8,       /* writes of a line that are pending */
    BRIDGE_TOPIC_BYTES = 100 /* of the topic of a line */
};

/* What was published of a field. */
typedef struct published {
    char *value; /* NULL: nothing */
    uint8_t status;
    uint8_t is_answered; /* the unit answered the last read */
    uint8_t has_ended;   /* the first read has ended */
    uint8_t is_refused;  /* the device does not have it, and that was logged */
} published;

/* A unit: how many of its fields have which state. */
typedef struct unit_state {
    uint16_t fields, answered, ended;
    enum { UNIT_UNKNOWN, UNIT_OFFLINE, UNIT_ONLINE } state;
} unit_state;

/* What a line reads and writes: a device file, with the storage of its plan and what was published
 * of its fields. */
typedef struct bridge_table {
    device fields;
    uint64_t digest; /* of the file */
    published *last; /* of the fields that can be read */
    unit_state units[256];
    mbm_planSetup setup; /* complete, but for `update` and `context` */
    mbm_planSplitting splitting;
} bridge_table;

/* Reads a device file for the bridge, and checks that a plan can read it. `register_gap` is that of
 * device_plan_make; `function` writes the fields whose file does not say how. Returns NULL after a
 * failure; `code` has its exit code and `wrong` the reason, a sentence without its full stop. */
bridge_table *bridge_table_read(const char *path, int register_gap, uint8_t function, int *code,
                                char wrong[YAML_FILE_WRONG_BYTES]);
void bridge_table_free(bridge_table *table);

/* What all lines have in common. */
typedef struct bridge_settings {
    broker mqtt;
    uint8_t is_plain, is_every, has_discovery;
    const char *discovery_prefix; /* NULL: "homeassistant" */
    unsigned long written, refused;
} bridge_settings;

typedef struct bridge_write {
    mbm_clientRequest request;
    uint16_t words[MBM_MAX_WRITE_REGISTERS];
    char name[DEVICE_NAME_BYTES + 2]; /* the topic of the field, since a reload may move it */
    struct bridge_line *line;
    uint8_t is_used;
} bridge_write;

typedef struct bridge_line {
    bridge_settings *bridge;
    line at;
    place where;
    char *text, *path, *topic;          /* `topic` is empty if the bridge has one line */
    char below[BRIDGE_TOPIC_BYTES + 2]; /* before the names of its fields: topic and /, or empty */
    bridge_table *table;
    mbm_plan plan;
    bridge_write writes[BRIDGE_WRITES];
} bridge_line;

/* Makes a line of copies of these texts, without its table; the bridge must outlive it. Returns
 * NULL without memory. The place was read from the same text. */
bridge_line *bridge_line_make(bridge_settings *bridge, const char *text, const char *path,
                              const char *topic, const place *where);

/* Opens the line, and begins to read the table, which it owns from then on. `is_patient`: a
 * terminal need not be there yet. Returns an exit code, after reporting the reason; the table is
 * not owned if it is not CODE_DONE. */
int bridge_line_begin(bridge_line *l, bridge_table *table, int is_patient);

/* Reads another table from now on, and removes the retained messages of fields that it does not
 * have. */
void bridge_line_replace(bridge_line *l, bridge_table *next);

/* Sets what the device needs from now on. */
void bridge_line_reach(bridge_line *l, const reach *what);

/* Removes all retained messages of the line, which is gone from the bridge. */
void bridge_line_clear(bridge_line *l);

/* Closes the line and frees it. */
void bridge_line_end(bridge_line *l);

void bridge_line_poll(bridge_line *l);

/* How many of its values are not available. */
unsigned bridge_line_not_available(const bridge_line *l);

/* For how many microseconds the line has nothing to do. */
uint32_t bridge_line_delay(bridge_line *l);

/* Subscribes, and publishes everything that has been read: the broker is connected. */
void bridge_line_connected(bridge_line *l);

/* Carries out a write to a field of the line. `name` is that after `below`. */
void bridge_line_write(bridge_line *l, const char *name, const broker_event *event);
