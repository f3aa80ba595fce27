/* A simulated multi-drop bus with a clock of its own. All other taps receive what one tap sends one
 * character time later. If two taps send at the same time, the bytes arrive garbled. */
#ifndef BUS_H
#define BUS_H

#include "mbm.h"

enum {
    BUS_BAUD = 19200,
    BUS_CHARACTER = 573, /* microseconds of 11 bits */
    BUS_TAPS = 8,
    BUS_BYTES = 200000 /* the most bytes in one test */
};

typedef struct bus bus;

typedef struct bus_tap {
    bus *line;
    uint32_t clock_start; /* the time that the tap's clock shows when the bus is started */
    uint64_t free;        /* when the last byte of the tap will have left */
    unsigned next;        /* index of the next byte of the bus to read */
} bus_tap;

struct bus {
    uint64_t now;        /* in microseconds */
    unsigned collisions; /* number of garbled bytes */
    bus_tap taps[BUS_TAPS];
    unsigned tap_count;
    unsigned count;
    struct {
        uint64_t end;
        bus_tap *from;
        uint8_t byte, garbled;
    } bytes[BUS_BYTES];
};

/* Empties the bus and removes its taps. */
void bus_start(bus *b);

/* Adds a tap whose clock shows `clock_start` when the bus is started. */
mbm_port bus_port(bus *b, uint32_t clock_start);

#endif
