/* A device for the examples of ModbusMaster: a libmodbus server that has every address which they
 * use, and what the board sent. */
#pragma once

#include "board.h"
#include "server.h"

/* How many requests one loop of PhoenixContact_nanoLC makes. */
enum { UPSTREAM_ROUND = 13 };

typedef struct upstream_device upstream_device;

struct upstream_device {
    server peer;
    uint8_t functions[UPSTREAM_ROUND], quantities[UPSTREAM_ROUND];
    unsigned count; /* requests so far */
    char text[500]; /* sent bytes that are no frame */
    int driver;     /* the pin that switches the line's driver */
    unsigned driven;
    /* Optional: sees all that the board sends. */
    void (*heard)(upstream_device *d, const wire *w, const uint8_t *bytes, size_t length);
    void *context; /* of `heard` */
};

/* Starts the server. server_stop(&d->peer) ends it. */
void upstream_device_start(upstream_device *d, int unit);

/* The device at a wire whose context is an upstream_device. It refuses 66 registers, as the
 * controller does that PhoenixContact_nanoLC is for. */
void upstream_hear(wire *w, const uint8_t *frame, size_t length);
