/* The boards that sketches are compiled for, the devices at their wires, and what tests observe of
 * a sketch: the text that it prints, and how often it switches a pin. */
#pragma once

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

/* --- the devices that a sketch sends requests to --- */

/* A device for board_uart and board_pins. Its context is a server. Simulated time stands
 * still until the server has answered, so that a busy host changes nothing. */
void peer_libmodbus(wire *w, const uint8_t *frame, size_t length);

/* Writes the reply of a device to functions 03, 06 and 10. Each of its registers has a
 * value of its own. Returns the reply's length. */
size_t peer_right_reply(uint8_t *reply, const uint8_t *request);
uint16_t peer_value(unsigned address);

/* A device without a context: answers every request with the right reply after one
 * millisecond. */
void peer_right(wire *w, const uint8_t *frame, size_t length);
