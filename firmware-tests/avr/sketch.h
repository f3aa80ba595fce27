/* The boards that sketches are compiled for, and what tests observe of a sketch: the text that it
 * prints, and how often it switches a pin. */
#ifndef SKETCH_H
#define SKETCH_H

#include "board.h"
#include "server.h"

#include <stdint.h>

/* A pin of one board, as port and bit. */
typedef struct pin {
    char port;
    int bit;
} pin;

typedef struct kind {
    const char *name, *mcu;
    char bus; /* the UART that the sketches call BUS */
    pin led, pin2, pin4;
} kind;

extern const kind uno, relaxed, mega, relaxed_mega, older_mega, atmega644p, atmega1284p;
extern const kind atmega328, atmega644; /* with one UART */
extern const kind uno_peer, mega_peer;  /* sketches with the library ModbusMaster */

/* Starts a board of this kind with a sketch. */
board *kind_start(const kind *k, const char *sketch);

int is_high(board *b, pin p);

/* The text that a sketch has printed. Zero before use. */
typedef struct printed_text {
    char text[8000];
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
