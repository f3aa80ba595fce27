/* The measurements of the program `timing`, one function for each file. Each prints its
 * rows of docs/reports/timing.md. */
#pragma once

#include "board.h"

#include <stdint.h>

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

/* --- rows of the tables --- */

/* The smallest, the largest and the sum of the noted values. All zero: there are none. */
typedef struct span {
    uint64_t least, most, sum, count; /* of one type: tests compare spans with memcmp */
} span;

void note(span *s, uint64_t value);
unsigned long mean(const span *s);
span joined(const span *one, const span *other);

/* Prints a row of the table of limits. If `limit` is 0, the row has none. */
void row(const char *what, const char *unit, unsigned long least, unsigned long most,
         unsigned long limit);
/* The same for a span of cycles. */
void row_cycles(const char *what, const span *s, unsigned long limit);
/* The same, with the mean. */
void row_mean(const char *what, const span *s, unsigned long limit);

/* Prints a row of the comparison. If `theirs` is NULL, it was not measured, and the field
 * stays empty. */
void row_beside(const char *what, const span *ours, const span *theirs);
void row_beside_bytes(const char *what, unsigned long ours, const unsigned long *theirs);

/* The same for a time in cycles, which is printed in milliseconds; `theirs` is 0 if it was not
 * measured. */
void row_beside_time(const char *what, uint64_t ours, uint64_t theirs);

/* How many rows have exceeded their limit so far. */
unsigned rows_above(void);

/* Ends the program, since the measurement cannot be right. */
_Noreturn void give_up(const char *why);
