/* A master's clock for tests with a device in another thread: it stands still from
 * when a byte is written until the device has done with it, and where the device is
 * to do something it waits until that is done. So a device is never late because
 * its thread did not run, and a short timeout tells what it is to tell. */
#ifndef HELD_CLOCK_H
#define HELD_CLOCK_H

#include "mbm.h"

#include <pthread.h>
#include <stdint.h>

/* Nothing is to be done at any time. */
#define HELD_CLOCK_NEVER INT64_MAX

typedef struct held_clock {
    pthread_mutex_t lock;
    int64_t behind;  /* microseconds that the master's clock is behind the machine's */
    int64_t stopped; /* what it shows while it stands still */
    int64_t told;    /* the time that the master read last */
    int64_t due;     /* what it does not go beyond */
    uint32_t bytes;  /* written, and not done with */
    unsigned link;   /* connections that were forgotten */
    mbm_port port;   /* of the line */
} held_clock;

void held_clock_start(held_clock *c);

/* Microseconds. */
int64_t held_clock_now(held_clock *c);

/* For the master: the line's port, with this clock. */
mbm_port held_clock_port(held_clock *c, const mbm_port *line);

/* For the device: so many bytes of a link are done with, of the one that there was
 * as it was made. A serial line is link 0. */
void held_clock_done(held_clock *c, unsigned link, uint32_t bytes);
unsigned held_clock_link(held_clock *c);

/* For the device, with bytes to do: lets time pass. */
void held_clock_pass(held_clock *c, int64_t microseconds);

/* For the device: it is to do something at this time. */
void held_clock_due(held_clock *c, int64_t at);

/* For the master, before it makes a link anew: nobody will be done with what was
 * written to the one before. */
void held_clock_forget(held_clock *c);

#endif
