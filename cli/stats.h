/* The statistics of a service: numbers of the whole program and of each of its lines, as JSON and
 * in Prometheus' text format.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef STATS_H
#define STATS_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

/* A number: its name in JSON, which Prometheus' name has too, and what it counts. */
typedef struct stats_kind {
    const char *name, *help;
    uint8_t is_counter; /* it only grows: Prometheus' name ends with _total */
} stats_kind;

enum { STATS_LINES = 32, STATS_OF_LINE = 10, STATS_OF_PROGRAM = 12 };

/* What is known of a line. */
typedef struct stats_line {
    const char *name;
    const mbm_counters *counters;
    const mbm_linkCounters *link; /* NULL: the line has no link */
    uint8_t is_up;
} stats_line;

typedef struct stats {
    const char *command;     /* "gateway" */
    const stats_kind *kinds; /* of the program */
    size_t count;
    uint64_t values[STATS_OF_PROGRAM];
    stats_line lines[STATS_LINES];
    size_t line_count;
} stats;

/* Return a text that the caller frees, or NULL without memory. */
char *stats_json(const stats *from);
char *stats_prometheus(const stats *from);

#endif
