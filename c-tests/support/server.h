/* A libmodbus RTU server in a thread, at the far end of a pty. */
#ifndef SERVER_H
#define SERVER_H

#include "pty.h"

#include <modbus.h>
#include <pthread.h>

enum { SERVER_BITS = 3000, SERVER_REGISTERS = 500 };

typedef struct server {
    pty line;
    modbus_t *peer;
    modbus_mapping_t *mapping; /* the server's own memory, which tests may read */
    int stop[2];
    pthread_t thread;
} server;

/* Starts a server for `unit` whose memory holds a known pattern. */
void server_start(server *s, int unit);
void server_stop(server *s);

/* Allocates a memory with this pattern, as every libmodbus server here has. */
modbus_mapping_t *server_memory(void);

/* The pattern: each register and bit differs from its neighbours. */
uint16_t server_pattern(unsigned address);
uint8_t server_bit_pattern(unsigned address);

#endif
