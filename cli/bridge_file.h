/* What a bridge is made of: its broker and its lines, from the command line or from a file:
 *
 *     broker: broker.local
 *     topic: hall1
 *     lines:
 *       - line: rtu:/dev/ttyUSB0?baud=9600
 *         file: meter.yaml
 *       - {line: "tcp://192.168.0.7", file: pump.yaml, topic: pump}
 *
 * docs/mqtt.md describes every key. */
#pragma once

#include "bridge_line.h"
#include "yaml_file.h"

/* The settings of a bridge, as they are written. */
enum {
    BRIDGE_BROKER,
    BRIDGE_TOPIC,
    BRIDGE_ID,
    BRIDGE_USER,
    BRIDGE_CA,
    BRIDGE_CERT,
    BRIDGE_KEY,
    BRIDGE_KEEP_ALIVE,
    BRIDGE_DISCOVERY,
    BRIDGE_DISCOVERY_PREFIX,
    BRIDGE_PLAIN,
    BRIDGE_ALL,
    BRIDGE_GAP,
    BRIDGE_WRITE_FUNCTION,
    BRIDGE_THE_LINES,
    BRIDGE_REACH,
    BRIDGE_KEYS = BRIDGE_REACH + REACH_FILE_KEYS,
    BRIDGE_SETTINGS = BRIDGE_THE_LINES
};
/* Their keys in the file; those of the options have - for _. NULL ends them. */
extern const char *const bridge_names[];

typedef struct bridge_setup {
    char *values[BRIDGE_SETTINGS]; /* NULL: not given */
    reach reach;                   /* of all lines, as far as they can have it */
    uint8_t line_count;
    struct {
        char *text, *path, *topic;
        place place;
    } lines[BRIDGE_LINES];
    char wrong[YAML_FILE_WRONG_BYTES];
} bridge_setup;

/* Sets a setting, which is checked. Returns NULL, or what is wrong, in a buffer that the next call
 * overwrites. */
const char *bridge_setup_value(bridge_setup *to, int setting, const char *text);

/* Adds a line. `topic` NULL: that of the file's name. Returns as bridge_setup_value. */
const char *bridge_setup_line(bridge_setup *to, const char *name, const char *path,
                              const char *topic);

/* Checks what settings say of each other. `dash` is before their names: "--", or nothing in a file.
 * Returns as bridge_setup_value. */
const char *bridge_setup_check(const bridge_setup *of, const char *dash);

/* Makes the options of broker.h; texts are copied, the setup may be freed. Returns 0 without
 * memory. */
int bridge_setup_options(const bridge_setup *of, broker_options *to);

/* Whether a setting is yes. */
int bridge_setup_is(const bridge_setup *of, int setting);

/* The registers that one read may cover beside its fields; DEVICE_PLAN_OWN_GAP if that is not
 * given. */
int bridge_setup_gap(const bridge_setup *of);

/* By which function fields are written whose device file does not say it: one of DEVICE_BY_SIZE,
 * DEVICE_SINGLE and DEVICE_MULTIPLE. */
uint8_t bridge_setup_function(const bridge_setup *of);

/* Reads a file. `into` has the settings of the command line, which the file may replace, and no
 * line. Returns CODE_DONE; or CODE_SYSTEM or CODE_WRONG with the reason in `wrong`. */
int bridge_file_read(bridge_setup *into, const char *path);

/* Copies settings and lines. Returns 0 without memory. */
int bridge_setup_copy(bridge_setup *to, const bridge_setup *from);
void bridge_setup_free(bridge_setup *setup);
