/* A line of the gateway: a serial line, or a device or gateway on TCP. A link opens it, and opens
 * it again when it was lost. Unlike the line of line.h, it need not be there when the gateway
 * begins.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef GATEWAY_LINE_H
#define GATEWAY_LINE_H

#include "place.h"

#include <poll.h>

typedef struct gateway_line {
    mbm_client client;
    mbm_counters counters;
    mbm_link link;
    place place;
    mbm_tty tty;
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    char reason[80];    /* why it is not open, as printed */
    int reserve;        /* a descriptor that is kept for the line while it is not open; 0: none */
    uint32_t tried;     /* when the last attempt began */
    uint32_t looked_up; /* when the host was last looked up and not found */
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint8_t outgoing[MBM_MAX_TCP_FRAME]; /* of Modbus TCP */
} gateway_line;

/* Reads the name of a line. Returns NULL, or what is wrong with it. */
const char *gateway_line_read(gateway_line *line, const char *text);

/* Begins the client and the link, which opens the line in the first poll of the client. */
void gateway_line_begin(gateway_line *line, uint16_t timeoutMs, uint16_t quietMs);

/* `isReady` of mbm_gatewayLine. A line that is not open is opened for a request, but at most once a
 * second. */
uint8_t gateway_line_isReady(void *context);

/* What to poll for the line. Returns 0 if it has no descriptor. */
int gateway_line_wait(const gateway_line *line, struct pollfd *wait);

void gateway_line_close(gateway_line *line);

#endif
