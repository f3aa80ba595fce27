/* A line of the gateway: a place for a serial line, or for a device or gateway on TCP. It need not
 * be there when the gateway begins.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef GATEWAY_LINE_H
#define GATEWAY_LINE_H

#include "gateway_file.h"
#include "line.h"

typedef struct gateway_line {
    line at;
    char *text;
    mbm_counters known; /* the counters at the last good reply */
    uint32_t in_flight;
    uint8_t is_used;   /* 0: a place for a line, which refuses every request */
    uint8_t is_silent; /* and that was reported */
} gateway_line;

/* Begins the client and the link, which opens the line in the first poll of the client. The text of
 * the place is copied. Returns 0 without memory. */
int gateway_line_begin(gateway_line *l, const place *where, const gateway_pace *pace);

/* Sets what a reload may change of a line. */
void gateway_line_set(gateway_line *l, const gateway_pace *pace, const reach *what);

/* Makes a zeroed or closed line a place that refuses every request: requests that it had end. */
void gateway_line_leave(gateway_line *l);

/* Reports devices that have become silent or damaged, and that answer again. */
void gateway_line_watch(gateway_line *l);

/* `isReady` of mbm_gatewayLine. */
uint8_t gateway_line_isReady(void *context);

/* Closes the line, which may be begun again. */
void gateway_line_close(gateway_line *l);

#endif
