/* A line of the gateway: a serial line, or a device or gateway on TCP. A link opens it, and opens
 * it again when it was lost. Unlike the line of line.h, it need not be there when the gateway
 * begins.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef GATEWAY_LINE_H
#define GATEWAY_LINE_H

#include "found_port.h"
#include "gateway_file.h"
#include "received.h"

#include <poll.h>

typedef struct gateway_line {
    mbm_client client;
    mbm_counters counters, known; /* `known`: at the last good reply */
    mbm_link link;
    mbm_linkCounters losses;
    uint8_t is_used;     /* 0: a place for a line, which refuses every request */
    uint8_t is_silent;   /* and that was reported */
    uint8_t is_replaced; /* that a silent device is connected to anew was reported */
    mbm_counters opened; /* `counters` when the line was opened the last time */
    char *text;
    place place;
    mbm_tty tty;
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    char reason[80]; /* why it is not open, as printed */
    int reserve;     /* a descriptor that is kept for the line while it is not open; 0: none */
    uint32_t replace_after, in_flight;
    uint32_t tried;     /* when the last attempt began */
    uint32_t looked_up; /* when the host was last looked up and not found */
    found_port found;
    received received; /* since the last request */
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint8_t outgoing[MBM_MAX_TCP_FRAME]; /* of Modbus TCP */
} gateway_line;

/* Begins the client and the link, which opens the line in the first poll of the client. The text of
 * the place is copied. Returns 0 without memory. */
int gateway_line_begin(gateway_line *line, const place *where, const gateway_pace *pace);

/* Sets what a reload may change of a line. */
void gateway_line_set(gateway_line *line, const gateway_pace *pace);

/* Makes a zeroed or closed line a place that refuses every request: requests that it had end. */
void gateway_line_leave(gateway_line *line);

/* Reports devices that have become silent or damaged, and that answer again. */
void gateway_line_watch(gateway_line *line);

/* `isReady` of mbm_gatewayLine. A line that is not open is opened for a request, but at most once a
 * second. */
uint8_t gateway_line_isReady(void *context);

/* What to poll for the line. Returns 0 if it has no descriptor. */
int gateway_line_wait(const gateway_line *line, struct pollfd *wait);

/* Closes the line, which may be begun again. */
void gateway_line_close(gateway_line *line);

#endif
