/* A device of the tests' own at the far end of a pty: unit 17 of the model, on
 * a line that spoils one of its replies. */
#ifndef DEVICE_H
#define DEVICE_H

#include "model.h"
#include "pty.h"

#include <pthread.h>

/* Puts what the line makes of a reply into `wire`, which holds twice the
 * longest frame; returns its length. */
typedef size_t (*device_fault)(uint8_t *wire, const uint8_t *reply, size_t length);

typedef struct device {
    pty line;
    model memory;
    unsigned number;    /* requests seen, to any unit; the first is number 1 */
    unsigned malformed; /* bytes that began no request, and requests that were none */
    uint64_t at[32];    /* when each request was complete, in microseconds */
    unsigned faulty;    /* the request whose reply is spoilt, from 1 on */
    device_fault fault;
    int stop[2];
    pthread_t thread;
} device;

/* Without a fault the line is good. */
void device_start(device *d, unsigned faulty, device_fault fault);
void device_stop(device *d);

#endif
