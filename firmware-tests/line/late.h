/* A server whose function is pending for 300 ms, and a client at the other end of the line that
 * gives up after 100 ms and sends its next request. The program of a port calls late_begin before
 * it opens the line, then polls with late_poll and sleeps for the time that it returns. The program
 * ends with success if the server answers the next request soon after the late reply, and one more.
 * Licence: MIT OR Apache-2.0. */
#ifndef LATE_H
#define LATE_H

#include "mbm.h"

/* Puts the client at the other end of the line. */
void late_begin(void);

/* Begins the server on a port. */
void late_serve(const mbm_port *port, uint32_t baud);

/* Polls the server. Returns its mbm_server_pollDelay. */
uint32_t late_poll(void);

#endif
