/* A line between a board that serves and a real libmodbus client: a pty, whose
 * bytes the simulated wire carries. */
#ifndef BUS_H
#define BUS_H

#include "board.h"
#include "pty.h"

#include <modbus.h>
#include <pthread.h>
#include <stdatomic.h>

/* Told of each frame of the board, before the client has it. */
typedef void (*bus_watcher)(void *context, const wire *w, size_t length);

typedef struct bus {
    board *on;
    wire *line;
    modbus_t *client;
    bus_watcher watcher;
    void *context;
    uint8_t last[FRAME]; /* the last frame of the board */
    size_t length;
    /* not for tests */
    pty ends;
    pthread_t thread;
    atomic_int going;
} bus;

/* A client of `unit` at UART `uart`. The board stands still. */
void bus_open(bus *l, board *b, char uart, int unit);
void bus_close(bus *l);

/* The board runs while the client talks, and stands still while a test looks
 * at it: between the two nothing but the client may be used. */
void bus_go(bus *l);
void bus_halt(bus *l);

/* With the board halted: it hears what the client wrote and did not wait for, and
 * silence behind it. */
void bus_settle(bus *l);

/* With the board halted: sends a frame, bad or good, and says whether a frame
 * came back within 100 ms of the board's time. */
int bus_send(bus *l, const uint8_t *frame, size_t length);

#endif
