/* A network of the program's own, with the loopback interface alone, that a test takes down as a
 * cable that is pulled out. */
#ifndef OWN_NETWORK_H
#define OWN_NETWORK_H

#include <stdint.h>

/* Enters the network, once in a program, and skips the test where the system does not allow that.
 */
void own_network(void);

/* Takes the interface up or down. What is sent meanwhile is lost. */
void own_network_set(int is_up);

/* The number of sockets whose own TCP port is this one, also of those that are closed and have
 * bytes that the system still sends. */
unsigned own_network_sockets(uint16_t port);

#endif
