/* A network of one wire in memory for lwIP, and a clock that the test moves.
 *
 * The interface has the address 10.0.0.1, and its far end is the same lwIP: what is sent to
 * 10.0.0.2 comes back with both addresses swapped, as if 10.0.0.2 had sent it to 10.0.0.1. So a
 * connection to 10.0.0.2 reaches a listener of this program, and so does one to fd00::2. All runs
 * in the test's thread, as with NO_SYS. */
#ifndef LWIP_WIRE_H
#define LWIP_WIRE_H

#include "lwip/ip_addr.h"
#include "lwip/pbuf.h"

#include <stdint.h>

typedef struct wire {
    uint32_t ms;      /* the time that lwIP sees */
    ip_addr_t far;    /* 10.0.0.2 */
    ip_addr_t far6;   /* fd00::2, if lwIP has IPv6 */
    uint8_t isCut;    /* packets vanish */
    uint16_t first;   /* bytes of data in the first pbuf of a received packet; 0: all */
    uint16_t others;  /* bytes in each of the others; 0: the rest */
    uint32_t packets; /* number of packets that were delivered */
    uint32_t resets;  /* how many of them had the flag RST */
} wire;

extern wire the_wire;

/* Begins lwIP, once in a program, and the wire anew. */
void wire_begin(void);

/* Frees what a test has left, and fails if it has left a connection. */
void wire_end(void);

/* Number of packets that are under way. */
uint32_t wire_underWay(void);

/* Delivers the packets that are under way. */
void wire_deliver(void);

/* Lets a time pass, with a step of at most 50 ms: the timers of lwIP run, and packets arrive.
 * `each` is called in each step; it may be NULL. */
void wire_pass(uint32_t ms, void (*each)(void));

/* Takes the cable of the interface out, and puts it in again. */
void wire_unplug(void);
void wire_plug(void);

/* Gives the interface another address, 10.0.0.`last`, as DHCP may do. */
void wire_readdress(uint8_t last);

#endif
