/* What the tests of the examples observe of a sketch: the text that it prints, and how often
 * it switches a pin. */
#ifndef SKETCH_H
#define SKETCH_H

#include "board.h"
#include "server.h"

#include <stdint.h>

/* The text that a sketch has printed. Zero before use. */
typedef struct printed_text {
    char text[2000];
} printed_text;

/* For board_uart, with a printed_text as its context: appends what a sketch prints. */
void collect_text(wire *w, const uint8_t *bytes, size_t length);

/* How often a pin was switched, and the longest time between two switches in cycles. */
typedef struct pin_rhythm {
    uint64_t last, longest;
    unsigned switches;
} pin_rhythm;

/* For board_watch_pin, with a pin_rhythm as its context. */
void measure_rhythm(void *context, int level, uint64_t cycle);

/* Sets two input registers of a server to a float, high word first. */
void set_input_float(server *s, unsigned address, float value);

#endif
