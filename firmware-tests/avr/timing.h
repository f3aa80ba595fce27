/* The measurements of the program `timing`, one function for each file. Each prints its
 * rows of docs/reports/timing.md. */
#ifndef TIMING_H
#define TIMING_H

#include "board.h"

/* The first transactions, which are not counted, and the number of those that are, where the time
 * depends less on the moment. */
enum { SKIP = 2, COUNTED = 20 };

/* An Uno that runs build/avr/FOLDER/NAME.elf. */
board *timed_board(const char *folder, const char *name);

/* Times a master and, if `peer` is not NULL, the library ModbusMaster: `peer` is the folder
 * of the sketches that are compiled with it. */
void time_master(const char *peer);
/* Times the gap before a request while no baud rate is set. */
void time_default_gap(void);
/* Times a master that waits for a reply while other bytes arrive. */
void time_master_flood(void);
/* Times sketches for the library ModbusMaster that were not changed, and measures their RAM. */
void time_unchanged(const char *peer);
void time_server(void);
/* Times a server while noise arrives without silence. */
void time_server_flood(void);

#endif
