/* lwIP in a thread of its own (tcpip_thread) with an interface that loops back, and relays between
 * its TCP connections and those of the machine: so programs over sockets of the machine, such as
 * libmodbus, talk with programs over lwIP. */
#ifndef LWIP_RELAY_H
#define LWIP_RELAY_H

#include "lwip/ip_addr.h"

#include <stdint.h>

/* 127.0.0.1 in lwIP, which has nothing to do with that of the machine. */
extern ip_addr_t relay_loop;

/* Begins lwIP, once in a program. */
void relay_begin(void);

/* Takes lwIP's interfaces down or up. lwIP has no route then. */
void relay_setNetwork(int is_up);

/* Takes connections of the machine to the port that it returns, and connects each to a TCP port in
 * lwIP. */
uint16_t relay_toLwip(uint16_t lwip_port);

/* Takes connections in lwIP to a TCP port, and connects each to one of the machine. */
void relay_toMachine(uint16_t lwip_port, uint16_t machine_port);

/* Resets the newest connection, at both ends. */
void relay_reset(void);

/* Number of connections that are open. */
unsigned relay_count(void);

#endif
