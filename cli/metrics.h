/* A responder of HTTP/1.0 for Prometheus, at an address of this machine only. It never blocks, has
 * a fixed number of places, and renders at most ten times a second, so that a slow or hostile
 * scraper does not delay the program.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef METRICS_H
#define METRICS_H

#include <poll.h>
#include <stddef.h>
#include <stdint.h>

enum {
    METRICS_PLACES = 4,
    METRICS_WAITS = METRICS_PLACES + 1,
    METRICS_REQUEST_BYTES = 2048 /* of the longest request */
};

typedef struct metrics_visitor {
    int fd; /* 0: a free place */
    int64_t sinceMs;
    size_t have, length, sent;
    char *reply; /* NULL while the request is read */
    char request[METRICS_REQUEST_BYTES];
} metrics_visitor;

/* A responder. It is zeroed at first. */
typedef struct metrics {
    metrics_visitor visitors[METRICS_PLACES];
    int listener, is_ready; /* no descriptor of it is 0: that is standard input */
    char *(*render)(void *context);
    void *context;
    char *rendered;
    int64_t rendered_at, tired_until; /* no connection is accepted before that time */
} metrics;

/* Reads ADDRESS:PORT: 127.0.0.1:9100, [::1]:9100; port 0 is a free one. Returns NULL, or what is
 * wrong: a clause. */
const char *metrics_check(const char *text);

/* Begins to listen there. `render` returns the text of a reply, which is freed then. Returns the
 * port, or -1 with errno set. */
int metrics_listen(metrics *m, const char *text, char *(*render)(void *context), void *context);

/* What to poll, at most METRICS_WAITS, and for how long at most, in microseconds. */
nfds_t metrics_wait(const metrics *m, struct pollfd *waits);
uint32_t metrics_delay(const metrics *m);

/* Notes what a poll of those `count` waits has found. */
void metrics_polled(metrics *m, const struct pollfd *waits, nfds_t count);

/* Accepts, reads and answers, if the last poll has found something. */
void metrics_work(metrics *m);

void metrics_close(metrics *m);

#endif
