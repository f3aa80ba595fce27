/* A recording of a bus as text. A line is a time in milliseconds, a colon and bytes in hexadecimal:
 *
 *     120: 11 03 00 6B
 *
 * Without time and colon it is 10 ms after the line before. `#` at the beginning of a line makes
 * it a comment.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef RECORDING_H
#define RECORDING_H

#include <stdint.h>
#include <stdio.h>

/* Microseconds from a line to the next one without a time. */
enum { RECORDING_STEP = 10000, RECORDING_BYTES = 2700 };

typedef struct recording {
    FILE *file;
    unsigned line; /* the number of the last line, from 1 */
    uint64_t time; /* of the last line, in microseconds */
    uint16_t length;
    uint8_t bytes[RECORDING_BYTES];
} recording;

/* Reads the next line that is no comment. Returns 1, or 0 at the end of the file, or -1 with the
 * reason in `wrong`. */
int recording_next(recording *from, const char **wrong);

#endif
