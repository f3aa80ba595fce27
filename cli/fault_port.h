/* A port between a server and its line, which changes, delays or drops answers.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef FAULT_PORT_H
#define FAULT_PORT_H

#include "fault.h"
#include "mbm.h"

/* Noise, an answer of another unit, and the answer twice. */
enum { FAULT_PORT_BYTES = 2048, FAULT_PORT_PIECES = 4 };

typedef struct fault_port {
    mbm_port below;
    uint8_t framing, is_datagrams, is_lost, is_closing;
    fault_choice chosen; /* the faults of the request that is answered; all 0: none */
    /* What is to be sent: pieces, each after a pause. */
    uint8_t bytes[FAULT_PORT_BYTES];
    uint16_t ends[FAULT_PORT_PIECES];
    uint32_t pauses[FAULT_PORT_PIECES]; /* microseconds */
    uint16_t count, piece, sent, end;
    uint32_t since, pause; /* the next byte is due `pause` after `since`, in microseconds */
    uint32_t random;
} fault_port;

/* Begins it on a port, which may send each frame as a datagram. Returns the port for the server,
 * whose context is the fault_port. */
mbm_port fault_port_begin(fault_port *port, const mbm_port *below, uint8_t framing,
                          int is_datagrams);

/* How long nothing is due, in microseconds: 0 if the link is lost, UINT32_MAX if nothing is to be
 * sent. */
uint32_t fault_port_delay(fault_port *port);

#endif
