/* The table and the page of mbm poll while it polls: both show the values at any time, and wait
 * together with the line. */
#pragma once

#include "http.h"
#include "polled.h"

/* --- the table, in watch.c --- */

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

/* --- the page, cli/page.html, and the values in JSON --- */

typedef struct page {
    followed *of;
    uint32_t round, intervalMs; /* of the last values; the program sets them */
    http http;
} page;

/* --- both --- */

typedef struct live {
    /* What the command line says. */
    uint8_t watches;        /* --watch */
    const char *http_place; /* --http; NULL: no page */

    polled *of;
    followed followed;
    watch watch;
    page page;
    uint8_t is_new, is_over; /* something is to be drawn; the user has ended it */
    int64_t drawn_at;
} live;

/* Whether there is a table or a page. */
int live_is_wanted(const live *l);

/* Begins both; the fields are read every `intervalMs` at the soonest. Returns CODE_DONE, or another
 * exit code after reporting the reason. */
int live_begin(live *l, polled *of, uint32_t intervalMs);
void live_end(live *l);

/* A read of a field has ended; a round has. */
void live_note(live *l, uint16_t field);
void live_note_round(live *l, uint32_t round);

/* Waits for the line, for keys and for visitors of the page, at most for a time, and serves them.
 */
void live_wait(live *l, uint32_t milliseconds);
