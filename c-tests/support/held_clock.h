/* A master's clock for tests with a device in another thread. It stands still from the time
 * at which a byte is written until the device has processed it. It does not go beyond the
 * time at which the device has something to do. So the device is never late because its
 * thread did not run, and tests can use short timeouts. Nor is a master late that says when it
 * sleeps: the clock waits for it to look. */
#ifndef HELD_CLOCK_H
#define HELD_CLOCK_H

#include "mbm.h"

#include <pthread.h>
#include <stdint.h>

/* The device has nothing to do at any time. */
#define HELD_CLOCK_NEVER INT64_MAX

typedef struct held_clock {
    pthread_mutex_t lock;
    int64_t lag;      /* microseconds by which this clock is late against the machine's */
    int64_t stopped;  /* the time that it shows while it stands still */
    int64_t readTime; /* the time that the master read last */
    int64_t due;      /* the time that it does not go beyond */
    int64_t seen;     /* nor beyond this one, once the master has called held_clock_sleep */
    uint32_t bytes;   /* bytes that were written and that the device has not processed */
    unsigned link;    /* how many connections were forgotten */
    mbm_port port;    /* the line's port */
} held_clock;

void held_clock_start(held_clock *c);

/* Returns microseconds. */
int64_t held_clock_now(held_clock *c);

/* For the master: the line's port, with this clock. */
mbm_port held_clock_port(held_clock *c, const mbm_port *line);

/* For a master that says when it sleeps: it calls this at its begin, and before it sleeps for
 * `microseconds`. From the end of the sleep on, the clock waits until the master looks. */
void held_clock_sleep(held_clock *c, int64_t microseconds);

/* For the device: it has processed `bytes` bytes of a link. `link` is the value that
 * held_clock_link returned when the link was made. A serial line is link 0. */
void held_clock_done(held_clock *c, unsigned link, uint32_t bytes);
unsigned held_clock_link(held_clock *c);

/* For the device, while it has bytes to process: lets time pass. */
void held_clock_pass(held_clock *c, int64_t microseconds);

/* For the device: it has something to do at this time. */
void held_clock_due(held_clock *c, int64_t at);

/* For the master, before it connects anew: the device will not process the bytes that were
 * written to the old connection. */
void held_clock_forget(held_clock *c);

#endif
