/* A libmodbus TCP server in a thread, on a port of its own. It serves one connection after
 * the other. */
#ifndef TCP_SERVER_H
#define TCP_SERVER_H

#include <modbus.h>
#include <pthread.h>
#include <stdint.h>

typedef struct tcp_server {
    uint16_t port;
    int listener;
    modbus_t *peer;
    modbus_mapping_t *mapping; /* the server's own memory, which tests may read */
    int stop[2];
    pthread_t thread;
} tcp_server;

/* Starts a server whose memory holds the pattern of server.h. */
void tcp_server_start(tcp_server *s);
void tcp_server_stop(tcp_server *s);

/* Makes a libmodbus client for requests to a unit on a port of this machine. It is not connected
 * yet, and waits long for its responses. */
modbus_t *tcp_clientOf(uint16_t port, int unit);

/* tcp_listenOnFree makes a socket that listens on a free port of this machine; tcp_connectTo makes
 * one that is connected to such a port. */
int tcp_listenOnFree(uint16_t *port);
int tcp_connectTo(uint16_t port);

/* Makes the close of a socket a reset. Returns 0, or -1 if the system refuses. */
int tcp_resetAtClose(int fd);

/* Makes a socket that reserves a free port for listeners with SO_REUSEADDR: no other
 * program gets it. */
int tcp_reserve(uint16_t *port);

#endif
