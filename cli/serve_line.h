/* Where mbm serve serves: a terminal, a pseudo terminal, a socket or a listener with connections.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef SERVE_LINE_H
#define SERVE_LINE_H

#include "fault.h"
#include "served.h"

/* Opens the place. Returns CODE_DONE, or another exit code after reporting the reason. `name`
 * receives the place as its masters write it, with the port or the terminal that the system has
 * chosen. */
enum { SERVE_LINE_NAME_BYTES = 600 };
int serve_line_open(const place *where, char name[SERVE_LINE_NAME_BYTES]);

/* Serves until Ctrl-C, or until the line is lost. Returns an exit code. */
int serve_line_run(served_units *units);

/* The hook of the units: counts each request and chooses its faults. Its context is the list. */
uint8_t serve_line_before(void *context, const mbm_request *request);

void serve_line_close(void);

#endif
