/* Connections that a listener has not accepted yet. */
#ifndef TCP_WAITING_H
#define TCP_WAITING_H

#include <stdint.h>

/* Returns how many connections wait until they are accepted. */
unsigned tcp_waiting(int listener);

/* Makes `count` connections to a listener, and waits until the system has them. */
void tcp_connect_some(int *fds, unsigned count, int listener, uint16_t port);

#endif
