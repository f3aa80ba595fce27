/* The boards that sketches are compiled for, and where each has its pins. */
#ifndef KIND_H
#define KIND_H

#include "board.h"

/* A pin, and where one board and the other have it. */
typedef struct pin {
    char port;
    int bit;
} pin;

typedef struct kind {
    const char *name, *mcu;
    char bus; /* the UART that BUS is */
    pin led, pin2, pin4;
} kind;

extern const kind uno, minimal, mega, older_mega, atmega644p, atmega1284p;
extern const kind atmega328, atmega644; /* with one UART */

/* A board of this kind that runs a sketch. */
board *kind_start(const kind *k, const char *sketch);

int is_high(board *b, pin p);

#endif
