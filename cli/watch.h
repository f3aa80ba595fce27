/* The table of mbm poll --watch.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef WATCH_H
#define WATCH_H

#include "followed.h"

typedef struct watch {
    followed *of;
    uint32_t round;                /* of the last values; the program sets it */
    char time[16];                 /* when that was */
    char page[128];                /* the address of the page; empty: there is none */
    uint16_t top;                  /* the first field that is shown */
    int value_width, number_width; /* the widest so far, so that columns stay in their places */
} watch;

/* Takes the keys that were pressed. Returns whether the table is to be drawn, or -1 if the user
 * ends it. */
int watch_keys(watch *w);

/* Draws the table. */
void watch_draw(watch *w);

/* Prints all of it, for a terminal that keeps it. */
void watch_print(watch *w);

#endif
