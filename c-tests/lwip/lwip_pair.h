/* A server with three places, a client and a peer that speaks TCP by hand, all over the wire in
 * memory. */
#ifndef LWIP_PAIR_H
#define LWIP_PAIR_H

#include "lwip_wire.h"
#include "mbm_lwip.h"

enum { PLACES = 3, REGISTERS = 125, PORT = 502, FRAME = 12 };

/* --- the server: unit 1, whose registers hold a pattern */

extern uint16_t words[REGISTERS];
extern mbm_unit unit;
extern mbm_lwip_listener listener;
extern mbm_lwip places[PLACES];
extern mbm_server servers[PLACES];
extern uint32_t ends; /* connections whose end the server has seen */

/* A round of its main loop. */
void serve(void);
/* Resets all its connections, as if lwIP did. */
void serve_reset(void);
int places_inUse(void);

/* --- the client */

extern mbm_lwip device;
extern mbm_client client;
extern uint16_t reply[REGISTERS];
extern mbm_clientRequest request;

void client_start(void);
/* client_start, and connects. */
void client_connect(void);
/* Queues a read of as many registers. */
void client_queue(uint16_t quantity);
/* Reads all registers within ten seconds, and compares them. */
void client_reads(void);

/* Rounds of both main loops. */
void serve_and_poll(void);
void only_poll(void);

/* --- the peer */

typedef struct peer {
    struct tcp_pcb *pcb;
    uint8_t isDeaf; /* it takes no bytes from its window */
    uint8_t isConnected, isEnded;
    err_t error; /* of lwIP, when the connection has failed */
    uint32_t count;
    uint8_t bytes[0x30000]; /* what has come */
} peer;

extern peer peers[PLACES + 2];

void peer_connect(peer *one);
/* Sends bytes at once, in one segment. */
void peer_send(peer *one, const void *bytes, uint16_t length);
int peer_canAsk(const peer *one); /* lwIP takes a request now */
/* Sends the request number `number`, a read of registers from 0 on. */
void peer_ask(peer *one, uint16_t number, uint8_t quantity);
/* Asks for all registers and reads nothing, until the first place has a response that lwIP does not
 * take. A round is 10 ms, with `each` of wire_pass. Returns how many it has sent. */
uint16_t peer_askDeaf(peer *one, void (*each)(void));
/* Fails if other than these responses to peer_ask have come, from `first` on. */
void peer_expects(const peer *one, uint16_t first, uint16_t count, uint8_t quantity);
void peer_close(peer *one);
void peer_reset(peer *one);

/* --- lwIP's memory: the next calls of the port fail */

extern uint32_t failing_writes, failing_connections;
extern uint32_t writes; /* calls of tcp_write by the port */

void pair_begin(void);
void pair_end(void);

#endif
