/* A line of the bridge: reads the fields of its table with a plan, publishes them, and writes what
 * the broker sends.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef BRIDGE_LINE_H
#define BRIDGE_LINE_H

#include "bridge_table.h"
#include "broker.h"
#include "line.h"

enum {
    BRIDGE_LINES = 32,
    BRIDGE_WRITES = 8,       /* writes of a line that are pending */
    BRIDGE_TOPIC_BYTES = 100 /* of the topic of a line */
};

typedef struct bridge_write {
    mbm_clientRequest request;
    uint16_t words[MBM_MAX_WRITE_REGISTERS];
    char name[DEVICE_NAME_BYTES + 1]; /* of the field, since a reload may move it */
    struct bridge_line *line;
    uint8_t is_used;
} bridge_write;

typedef struct bridge_line {
    line at;
    place where;
    char *text, *path, *topic;          /* `topic` is empty if the bridge has one line */
    char below[BRIDGE_TOPIC_BYTES + 2]; /* before the names of its fields: topic and /, or empty */
    bridge_table *table;
    mbm_plan plan;
    bridge_write writes[BRIDGE_WRITES];
} bridge_line;

/* What all lines have in common. */
typedef struct bridge_settings {
    broker mqtt;
    uint8_t is_plain, is_every, has_discovery;
    unsigned long written, refused;
} bridge_settings;

extern bridge_settings bridge;

/* Makes a line of copies of these texts, without its table. Returns NULL without memory. The place
 * was read from the same text. */
bridge_line *bridge_line_make(const char *text, const char *path, const char *topic,
                              const place *where);

/* Opens the line, and begins to read the table, which it owns from then on. `is_patient`: a
 * terminal need not be there yet. Returns an exit code, after reporting the reason; the table is
 * not owned if it is not CODE_DONE. */
int bridge_line_begin(bridge_line *l, bridge_table *table, int is_patient);

/* Reads another table from now on, and removes what is retained of fields that it does not have. */
void bridge_line_replace(bridge_line *l, bridge_table *next);

/* Removes all that is retained of the line: it is gone from the bridge. */
void bridge_line_clear(bridge_line *l);

/* Closes the line and frees it. */
void bridge_line_end(bridge_line *l);

void bridge_line_poll(bridge_line *l);

/* For how many microseconds the line has nothing to do. */
uint32_t bridge_line_delay(bridge_line *l);

/* Subscribes, and publishes everything that has been read: the broker is connected. */
void bridge_line_connected(bridge_line *l);

/* Carries out a write to a field of the line. `name` is that after `below`. */
void bridge_line_write(bridge_line *l, const char *name, const broker_event *event);

#endif
