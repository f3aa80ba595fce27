/* A simulated multi-drop bus with a clock of its own: what one tap sends, all others
 * hear a character time later, and what two send at once arrives garbled. */
#ifndef BUS_H
#define BUS_H

#include "mbm.h"

enum {
    BUS_BAUD = 19200,
    BUS_CHARACTER = 573, /* microseconds of 11 bits */
    BUS_TAPS = 8,
    BUS_BYTES = 200000 /* in one test */
};

typedef struct bus bus;

typedef struct bus_tap {
    bus *line;
    uint32_t clock_start; /* what its clock showed when the bus was started */
    uint64_t free;        /* when its last byte will have left */
    unsigned heard;       /* bytes of the bus that it has passed */
} bus_tap;

struct bus {
    uint64_t now;        /* in microseconds */
    unsigned collisions; /* bytes garbled */
    bus_tap taps[BUS_TAPS];
    unsigned tap_count;
    unsigned count;
    struct {
        uint64_t end;
        bus_tap *from;
        uint8_t byte, garbled;
    } bytes[BUS_BYTES];
};

/* Empties the bus and its taps. */
void bus_start(bus *b);

/* A new tap, with a clock that shows `clock_start` when the bus is started. */
mbm_port bus_port(bus *b, uint32_t clock_start);

#endif
