/* Ports over other ports: one that passes all calls on, and two that read only when a wait has
 * found bytes. */
#pragma once

#include "mbm.h"

#include <poll.h>

/* Copies the port `real` to `below`, which is the first member of a struct. Returns a port whose
 * context is that struct, and whose calls go to the copy. The caller replaces the hooks that do
 * more. */
mbm_port port_over(mbm_port *below, const mbm_port *real);

/* --- found_port ---
 *
 * A wait for several descriptors knows which of them have bytes. Until the end of the round that
 * begins with it, a port without bytes reads nothing, and its clock stands still at the time of
 * the wait: so no silence and no timeout is over that was not waited for. The same holds once a
 * read has taken all bytes, at the time before that read. A write ends that, and so does the
 * round. Without a round all calls pass. */

typedef struct found_round {
    uint64_t number;  /* of the last round */
    uint32_t beganUs; /* when, by CLOCK_MONOTONIC */
    int is_on;
} found_round;

typedef struct found_port {
    mbm_port below;
    const found_round *round; /* that of the last wait; NULL before it */
    uint64_t empty_in;        /* the round in which it has no bytes; 0: none */
    uint32_t timeUs;          /* of the clock meanwhile */
} found_port;

/* Begins. Returns the port to use in place of the one below, whose clock is CLOCK_MONOTONIC; `port`
 * must outlive it. The one below keeps no bytes that its descriptor does not show, as that of TLS
 * does. */
mbm_port found_port_begin(found_port *port, const mbm_port *below);

/* A wait has ended just now: a round begins. */
void found_port_begin_round(found_round *round);

/* What the wait has found for the descriptor of a port, which the round must outlive. */
void found_port_note(found_port *port, const found_round *round, const struct pollfd *found);

/* The round ends. Call it before asking for how long to sleep. */
void found_port_end_round(found_round *round);

/* --- ahead_port ---
 *
 * The port of a client's connection. When a wait has found bytes, it reads all that have come, for
 * a gateway that asks for the first bytes of a frame, and then for the rest. */

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
