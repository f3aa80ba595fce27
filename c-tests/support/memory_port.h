/* A port in memory with a clock of its own: the test reads what was sent, and writes
 * what arrives. */
#ifndef MEMORY_PORT_H
#define MEMORY_PORT_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

typedef struct memory_port {
    uint8_t sent[1024], arriving[1024];
    size_t sent_count, arriving_count;
    uint32_t now; /* microseconds */
    int is_lost;
} memory_port;

/* The port to begin a client with. */
mbm_port memory_port_of(memory_port *m);

/* Lets bytes arrive, and an RTU frame: the CRC is appended. */
void memory_port_bytes(memory_port *m, const uint8_t *bytes, size_t count);
void memory_port_rtu(memory_port *m, const uint8_t *bytes, size_t count);

/* Polls until bytes are sent, and lets the time pass before. */
void memory_port_send(memory_port *m, mbm_client *client);

/* Polls, and lets the time pass that pollDelay returns, up to `steps` times or until
 * `request` has ended; its status. */
uint8_t memory_port_run(memory_port *m, mbm_client *client, const mbm_clientRequest *request,
                        unsigned steps);

#endif
