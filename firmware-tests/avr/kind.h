/* The boards that sketches are compiled for, and their pins. */
#ifndef KIND_H
#define KIND_H

#include "board.h"

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

#endif
