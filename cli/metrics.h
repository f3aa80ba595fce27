/* A responder of HTTP/1.0 for Prometheus, at an address of this machine only. It never blocks, has
 * a fixed number of places, and renders at most ten times a second, so that a slow or hostile
 * scraper does not delay the program.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef METRICS_H
#define METRICS_H

#include <poll.h>
#include <stdint.h>

enum { METRICS_PLACES = 4, METRICS_WAITS = METRICS_PLACES + 1 };

/* Reads ADDRESS:PORT: 127.0.0.1:9100, [::1]:9100; port 0 is a free one. Returns NULL, or what is
 * wrong: a clause. */
const char *metrics_check(const char *text);

/* Begins to listen there. Returns the port, or -1 with errno set. */
int metrics_listen(const char *text);

/* What to poll, at most METRICS_WAITS, and for how long at most, in microseconds. */
nfds_t metrics_wait(struct pollfd *waits);
uint32_t metrics_delay(void);

/* Notes what a poll of those `count` waits has found. */
void metrics_polled(const struct pollfd *waits, nfds_t count);

/* Accepts, reads and answers, if the last poll has found something. `render` returns the text of a
 * reply, which is freed then. */
void metrics_work(char *(*render)(void));

void metrics_close(void);

#endif
