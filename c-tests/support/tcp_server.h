/* A real libmodbus TCP server in a thread, on a port of its own; it takes one
 * connection after the other. */
#ifndef TCP_SERVER_H
#define TCP_SERVER_H

#include <modbus.h>
#include <pthread.h>
#include <stdint.h>

typedef struct tcp_server {
    uint16_t port;
    int listener;
    modbus_t *peer;
    modbus_mapping_t *mapping; /* the server's own memory, for tests to look at */
    int stop[2];
    pthread_t thread;
} tcp_server;

/* Starts a server whose memory holds the pattern of server.h. */
void tcp_server_start(tcp_server *s);
void tcp_server_stop(tcp_server *s);

/* A socket that listens on a free port of this machine, and one connected to such. */
int tcp_listen(uint16_t *port);
int tcp_connect(uint16_t port);

/* One that keeps a free port for listeners with SO_REUSEADDR: nobody else gets it. */
int tcp_reserve(uint16_t *port);

#endif
