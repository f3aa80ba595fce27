/* What a gateway is made of: its lines, the map of units and its settings, from the command line or
 * from a file:
 *
 *     listen: tcp://:502
 *     timeout: 500ms
 *     lines:
 *       - line: rtu:/dev/ttyUSB0?baud=9600
 *         units: 1-31
 *       - {line: "tcp://192.168.0.7", units: 101-131=1, in_flight: 4}
 *
 * docs/gateway.md describes every key. */
#pragma once

#include "place.h"
#include "yaml_file.h"

enum {
    GATEWAY_LINES = 32,
    GATEWAY_REQUESTS = 128, /* the places for requests beside one for each connection */
    GATEWAY_CONNECTIONS = UINT8_MAX
};

/* The settings that a line may have of its own. */
typedef struct gateway_pace {
    uint32_t quietMs, in_flight, replace_after;
} gateway_pace;

typedef struct gateway_setup {
    char *listen_text;
    place listen;
    uint32_t idleMs, queueMs, connections, requests;
    gateway_pace pace; /* of lines that have no other */
    reach reach;       /* the same, of the file */

    uint8_t line_count, route_count;
    struct {
        char *text;
        place place;
        gateway_pace pace;
    } lines[GATEWAY_LINES];
    mbm_gatewayRoute routes[UINT8_MAX]; /* their `line` is an index of `lines` */

    char wrong[YAML_FILE_WRONG_BYTES];
} gateway_setup;

/* Add the name of a line, and UNITS of the last line. Return NULL, or what is wrong, in a buffer
 * that the next call overwrites. */
const char *gateway_setup_line(gateway_setup *to, const char *text);
const char *gateway_setup_units(gateway_setup *to, const char *text);

/* Adds to what a line's device needs, after what its name says. `dash` is before the names of keys:
 * "--", or nothing. Returns as gateway_setup_line. */
const char *gateway_setup_reach(gateway_setup *to, unsigned index, const reach *more,
                                const char *dash);

/* Reads the place where the gateway listens. Returns as gateway_setup_line. */
const char *gateway_setup_listen(gateway_setup *to, const char *text);

/* Reads a file. `into` has the settings for keys that the file does not have, and nothing else.
 * Returns CODE_DONE; or CODE_SYSTEM or CODE_WRONG with the reason in `wrong`, a sentence without
 * its full stop: "gateway.yaml:3: ...". Free it in both cases. */
int gateway_file_read(gateway_setup *into, const char *path);
void gateway_setup_free(gateway_setup *setup);
