/* A Modbus TCP server on a loopback socket, in a thread, that plays the faults of bad
 * networks and bad devices at chosen requests:
 *
 *     tcp_peer *peer = tcp_peer_new();
 *     uint16_t port = tcp_peer_start(peer, 0);
 *     tcp_peer_fault(peer, 3, FAULT_RESET, 0);     // at the third request
 *     ...
 *     tcp_peer_stop(peer);
 *
 * libmodbus makes the right replies, from a memory that tests may read. The number of a
 * request and the script alone decide what happens to it, so a run can be repeated. */
#ifndef TCP_PEER_H
#define TCP_PEER_H

#include "held_clock.h"

#include <modbus.h>
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

enum {
    TCP_PEER_CELLS = 500,     /* of each of the four tables, from address 0 on */
    TCP_PEER_CONNECTIONS = 8, /* the most at the same time; further ones are closed at once */
    TCP_PEER_SCRIPT = 4096,   /* the most faults that are still to be played */
    TCP_PEER_FRAME = 260      /* bytes of the longest frame */
};

/* What happens to the reply of a request. The comments say what `argument` is. */
typedef enum tcp_fault {
    FAULT_NONE,          /* the right reply, at once */
    FAULT_DELAY,         /* the right reply, `argument` ms late; later replies do not wait for it */
    FAULT_HOLD,          /* the right reply, after the next `argument` replies, or 250 ms late */
    FAULT_JOIN,          /* in one send with the next `argument` replies, or 250 ms late */
    FAULT_DROP,          /* the request is carried out, without a reply */
    FAULT_TWICE,         /* the right reply twice */
    FAULT_SPLIT,         /* byte by byte, with pauses of `argument` ms */
    FAULT_OTHER_ID,      /* a reply with the transaction id plus `argument`, without a right one */
    FAULT_ALSO_OTHER_ID, /* the same, then the right reply */
    FAULT_WRONG_PROTOCOL, /* a reply of protocol `argument`, without a right one */
    FAULT_WRONG_UNIT,     /* a reply of unit plus `argument`, without a right one */
    FAULT_WRONG_FUNCTION, /* a reply of function `argument`, without a right one */
    FAULT_EXCEPTION,      /* exception `argument`; the request is not carried out */
    FAULT_GARBAGE,        /* `argument` bytes that begin no header, then the right reply */
    FAULT_SHORT_LENGTH,   /* the right reply, its length field too small by `argument` */
    FAULT_HALF,           /* the first `argument` bytes of the reply, then the end of the stream */
    FAULT_CLOSE,          /* the end of the stream instead of a reply */
    FAULT_RESET,          /* a reset (RST) of the connection instead of a reply */
    FAULTS
} tcp_fault;

typedef struct tcp_peer tcp_peer;

/* What the peer has counted since its start. */
typedef struct tcp_peer_counts {
    unsigned connections, refused;
    unsigned requests,
        replies; /* complete requests; right replies sent, one that is sent twice counts once */
    unsigned malformed;      /* byte sequences that are no request: the connection is closed */
    unsigned faults[FAULTS]; /* how often each fault was played */
} tcp_peer_counts;

tcp_peer *tcp_peer_new(void);

/* For a client that must never find the peer late: a clock that waits for the peer. Delays
 * are counted by it too. A client that connects anew must call held_clock_forget first. */
void tcp_peer_clock(tcp_peer *peer, held_clock *clock);

/* Listens at 127.0.0.1. Port 0 means any free port. Returns the port. A stopped peer may be
 * started again, also at the same port. */
uint16_t tcp_peer_start(tcp_peer *peer, uint16_t port);

/* Plays a fault at request number `n`. Requests are counted from 1 on, over all connections. */
void tcp_peer_fault(tcp_peer *peer, unsigned n, tcp_fault fault, unsigned argument);

/* From now on, plays a fault at `percent` of the requests that have none of their own. A
 * generator that starts with `seed` chooses one of `kinds`. The arguments are small and
 * suit the fault. Delays are at most `longest` ms. */
void tcp_peer_chaos(tcp_peer *peer, uint32_t seed, unsigned percent, const tcp_fault *kinds,
                    size_t count, unsigned longest);

/* Closes every connection, as a device does when it restarts. */
void tcp_peer_hang_up(tcp_peer *peer);

/* Returns the counts since the start. */
tcp_peer_counts tcp_peer_count(tcp_peer *peer);

/* The memory. Other threads may read it while no request is pending. */
modbus_mapping_t *tcp_peer_memory(tcp_peer *peer);

/* The values that the tables hold at first. */
uint16_t tcp_peer_word(unsigned address);
uint8_t tcp_peer_bit(unsigned address);

/* Closes everything. The peer may be started again. */
void tcp_peer_halt(tcp_peer *peer);
/* Halts the peer and frees it. */
void tcp_peer_stop(tcp_peer *peer);

#endif
