/* A Modbus TCP server on a loopback socket, in a thread, that does to chosen
 * requests what bad networks and bad devices do:
 *
 *     tcp_peer *peer = tcp_peer_new();
 *     uint16_t port = tcp_peer_start(peer, 0);
 *     tcp_peer_fault(peer, 3, FAULT_RESET, 0);     // at the third request
 *     ...
 *     tcp_peer_stop(peer);
 *
 * Right replies are libmodbus's own, from a memory that tests may look at. What
 * happens to a request depends on its number and the script alone, so a run
 * repeats itself. */
#ifndef TCP_PEER_H
#define TCP_PEER_H

#include "held_clock.h"

#include <modbus.h>
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

enum {
    TCP_PEER_CELLS = 500,     /* of each of the four tables, from address 0 on */
    TCP_PEER_CONNECTIONS = 8, /* at once; more are closed at once */
    TCP_PEER_SCRIPT = 4096,   /* faults to come */
    TCP_PEER_FRAME = 260      /* bytes of the longest frame */
};

/* What happens to the reply of a request; `argument` as said. */
typedef enum tcp_fault {
    FAULT_NONE,           /* the right reply, at once */
    FAULT_DELAY,          /* the right reply, `argument` ms late; those behind it are not held up */
    FAULT_HOLD,           /* the right reply, behind the next `argument` replies, or 250 ms late */
    FAULT_JOIN,           /* in one send with the next `argument` replies, or 250 ms late */
    FAULT_DROP,           /* carried out, and no reply */
    FAULT_TWICE,          /* the right reply twice */
    FAULT_SPLIT,          /* byte by byte, `argument` ms between */
    FAULT_OTHER_ID,       /* a reply with the transaction id plus `argument`, and no right one */
    FAULT_ALSO_OTHER_ID,  /* the same, and the right reply behind it */
    FAULT_WRONG_PROTOCOL, /* a reply of protocol `argument`, and no right one */
    FAULT_WRONG_UNIT,     /* a reply of unit plus `argument`, and no right one */
    FAULT_WRONG_FUNCTION, /* a reply of function `argument`, and no right one */
    FAULT_EXCEPTION,      /* exception `argument`; the request is not carried out */
    FAULT_GARBAGE,        /* `argument` bytes that begin no header, then the right reply */
    FAULT_SHORT_LENGTH,   /* the right reply, its length field `argument` too small */
    FAULT_HALF,           /* the first `argument` bytes of the reply, then the end of the stream */
    FAULT_CLOSE,          /* the end of the stream instead of a reply */
    FAULT_RESET,          /* a reset (RST) of the connection instead of a reply */
    FAULTS
} tcp_fault;

typedef struct tcp_peer tcp_peer;

/* What the peer has seen, as counts since its start. */
typedef struct tcp_peer_counts {
    unsigned connections, refused;
    unsigned requests, replies; /* whole requests; right replies sent, doubled ones once */
    unsigned malformed;         /* what came that is no request: the connection is closed */
    unsigned faults[FAULTS];    /* played */
} tcp_peer_counts;

tcp_peer *tcp_peer_new(void);

/* For a client that is never to find the peer late: a clock that waits for it, and
 * by which delays count. A client that connects anew forgets what it wrote before. */
void tcp_peer_clock(tcp_peer *peer, held_clock *clock);

/* Listens at 127.0.0.1; port 0 is one that is free. Returns the port. A stopped
 * peer may be started again, at the same port too. */
uint16_t tcp_peer_start(tcp_peer *peer, uint16_t port);

/* Plays a fault at request number `n`, counted from 1 on over all connections. */
void tcp_peer_fault(tcp_peer *peer, unsigned n, tcp_fault fault, unsigned argument);

/* From now on plays a fault at `percent` of the requests that have none of their
 * own, one of `kinds` by a generator that `seed` starts. The arguments are small
 * and fitting ones; delays up to `longest` ms. */
void tcp_peer_chaos(tcp_peer *peer, uint32_t seed, unsigned percent, const tcp_fault *kinds,
                    size_t count, unsigned longest);

/* Closes every connection, as a device that restarts. */
void tcp_peer_hang_up(tcp_peer *peer);

/* How often what has happened so far. */
tcp_peer_counts tcp_peer_count(tcp_peer *peer);

/* The memory; other threads may look while no request is under way. */
modbus_mapping_t *tcp_peer_memory(tcp_peer *peer);

/* The patterns that the tables hold at first. */
uint16_t tcp_peer_word(unsigned address);
uint8_t tcp_peer_bit(unsigned address);

/* Closes all, and may be started again. */
void tcp_peer_halt(tcp_peer *peer);
/* Halts and frees. */
void tcp_peer_stop(tcp_peer *peer);

#endif
