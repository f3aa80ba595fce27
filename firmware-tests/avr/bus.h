/* A line between a board with a server and a libmodbus client: a pty whose bytes the
 * simulated wire carries. */
#pragma once

#include "board.h"
#include "pty.h"

#include <modbus.h>
#include <pthread.h>
#include <stdatomic.h>

/* Called with each frame of the board, before the client receives it. */
typedef void (*bus_watcher)(void *context, const wire *w, size_t length);

typedef struct bus {
    board *on;
    wire *line;
    modbus_t *client;
    bus_watcher watcher;
    void *context;
    uint8_t last[FRAME]; /* the last frame of the board */
    size_t length;
    /* private */
    pty ends;
    pthread_t thread;
    atomic_int going;
} bus;

/* Connects a client of `unit` to UART `uart`. The board stands still. */
void bus_open(bus *l, board *b, char uart, int unit);
void bus_close(bus *l);

/* bus_go lets the board run while the client works, bus_halt stops it so that a test can
 * look at it. Between the two only the client may be used. */
void bus_go(bus *l);
void bus_halt(bus *l);

/* With the board halted: lets it receive what the client wrote without waiting for a
 * response, then silence. */
void bus_settle(bus *l);

/* With the board halted: sends a frame, good or bad. Returns whether a frame came back
 * within 100 ms of the board's time. */
int bus_send(bus *l, const uint8_t *frame, size_t length);
