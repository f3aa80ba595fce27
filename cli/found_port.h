/* A port that reads only when a wait has found bytes.
 *
 * A wait for several descriptors knows which of them have bytes. Until the end of the round that
 * begins with it, a port without bytes reads nothing, and its clock stands still at the time of
 * the wait: so no silence and no timeout is over that was not waited for. The same holds once a
 * read has taken all bytes, at the time before that read. A write ends that, and so does the
 * round. Without a round all calls pass.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef FOUND_PORT_H
#define FOUND_PORT_H

#include "mbm.h"

#include <poll.h>

typedef struct found_port {
    mbm_port below;
    uint64_t empty_in; /* the round in which it has no bytes; 0: none */
    uint32_t time;     /* of the clock meanwhile */
} found_port;

/* Begins. Returns the port to use in place of the one below, whose clock is CLOCK_MONOTONIC; `port`
 * must outlive it. The one below keeps no bytes that its descriptor does not show, as that of TLS
 * does. */
mbm_port found_port_begin(found_port *port, const mbm_port *below);

/* A wait has ended just now: a round begins. */
void found_port_begin_round(void);

/* What the wait has found for the descriptor of a port. */
void found_port_note(found_port *port, const struct pollfd *found);

/* The round ends. Call it before asking for how long to sleep. */
void found_port_end_round(void);

#endif
