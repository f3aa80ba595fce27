/* The port of a client's connection: reads only when a wait has found bytes, and then all that have
 * come, for a gateway that asks for the first bytes of a frame, and then for the rest.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef AHEAD_PORT_H
#define AHEAD_PORT_H

#include "mbm.h"

typedef struct ahead_port {
    mbm_port below;
    uint8_t is_ready; /* a wait has found bytes or the end, and they were not all read */
    uint16_t at, end; /* of the bytes that were read and not asked for */
    uint8_t bytes[MBM_MAX_TCP_FRAME];
} ahead_port;

/* Begins. Returns the port to use in place of the one below; `port` must outlive it. */
mbm_port ahead_port_begin(ahead_port *port, const mbm_port *below);

/* Whether it has bytes that its descriptor does not show any more. */
int ahead_port_has_bytes(const ahead_port *port);

#endif
