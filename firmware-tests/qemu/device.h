/* A device of the tests' own at the far end of a pty: unit 17 of the model. The line spoils
 * one of its replies. */
#pragma once

#include "model.h"
#include "pty.h"

#include <pthread.h>

/* Writes what the line makes of a reply to `wire`, which holds twice the longest frame.
 * Returns its length. */
typedef size_t (*device_fault)(uint8_t *wire, const uint8_t *reply, size_t length);

typedef struct device {
    pty line;
    model memory;
    unsigned number;    /* number of requests to any unit so far; the first is number 1 */
    unsigned malformed; /* bytes that begin no request, and bad requests */
    uint64_t at[32];    /* when each request was complete, in microseconds */
    unsigned faulty;    /* the number of the request whose reply is spoilt */
    device_fault fault;
    int stop[2];
    pthread_t thread;
} device;

/* Starts the device. With `spoil` NULL the line is good. */
void device_start(device *d, unsigned faulty, device_fault spoil);
void device_stop(device *d);

/* What a bad wire makes of the reply to a read of ten registers. */
typedef struct fault {
    const char *name;
    device_fault spoil;
    uint8_t status;            /* of the request that meets the fault */
    uint8_t resynchronisation; /* 1: the reply is found after bytes that are no frame */
    uint8_t foreign;           /* 1: a frame of another unit or function comes first */
} fault;

extern const fault faults[];
extern const unsigned fault_count;
