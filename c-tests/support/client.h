/* A client, and a line with one node, with buffers of full size, and what tests do with them. */
#ifndef CLIENT_H
#define CLIENT_H

#include "held_clock.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"

typedef struct asker {
    mbm_client client;
    mbm_port port;
    mbm_tty tty;
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    mbm_linkHooks link;
    held_clock *clock; /* NULL: the machine's clock */
    mbm_counters counters;
    char service[8];
    uint8_t incoming[1024], outgoing[1024];
} asker;

/* Zeroes it and begins a client on a terminal, at 115200 baud. */
void asker_begin_rtu(asker *a, int fd);
void asker_begin_ascii(asker *a, int fd);

/* Zeroes it and begins a client of a TCP port of this machine. */
void asker_begin_tcp(asker *a, uint16_t port);
void asker_begin_rtu_over_tcp(asker *a, uint16_t port);

/* The same with a clock that waits for the peer, also after `link` has connected anew. */
void asker_begin_tcp_by(asker *a, uint16_t port, held_clock *clock);

/* A request to a unit: `reply` receives the response, `data` is what the request sends. */
mbm_clientRequest asker_request(uint8_t unit, void *reply, uint16_t bytes, const void *data);

/* Sleeps until bytes arrive or the client has something else to do. */
void asker_rest(asker *a);

/* Polls, with sleeps between, until one request or all requests have ended. */
uint8_t asker_wait(asker *a, const mbm_clientRequest *request);
void asker_wait_all(asker *a);

/* A line on a terminal with one node. */
typedef struct node {
    mbm_line line;
    mbm_node node;
    mbm_tty tty;
    mbm_port port;
    mbm_counters counters;
    uint16_t response[MBM_MAX_READ_REGISTERS];
    uint16_t transmit[MBM_MAX_WRITE_REGISTERS];
    uint8_t frame[MBM_MAX_FRAME];
} node;

/* Zeroes the node, gives it its buffers and begins it for unit `slave` over `fd`. */
void node_begin(node *n, int fd, uint8_t slave);

/* Returns bit `index` of the response words. */
int node_bit(const node *n, unsigned index);

/* Sets bit `index` of the transmit words. */
void node_set_bit(node *n, unsigned index, int on);

#endif
