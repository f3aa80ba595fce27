/* What the program `timing` measures, one function for each file. Each prints its
 * rows of docs/reports/timing.md. */
#ifndef TIMING_H
#define TIMING_H

#include "board.h"

/* Transactions that are left out at first, and that are counted. */
enum { SKIP = 2, COUNTED = 20 };

/* An Uno that runs build/avr/FOLDER/NAME.elf. */
board *timed_board(const char *folder, const char *name);

/* A master, and with `peer` the library ModbusMaster beside it: the folder with the
 * sketches that are compiled with it, or NULL. */
void time_master(const char *peer);
/* The gap before a request while the baud rate is untold. */
void time_default_gap(void);
/* A master that waits for a reply, and what arrives is none. */
void time_master_flood(void);
void time_server(void);
/* A server, and noise without silence. */
void time_server_flood(void);

#endif
