/* A port in memory with a clock of its own. The test reads the bytes that were sent and
 * writes the bytes that arrive. */
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

/* The port for the client's begin function. */
mbm_port memory_port_of(memory_port *m);

/* Lets bytes arrive. memory_port_rtu appends the CRC. */
void memory_port_bytes(memory_port *m, const uint8_t *bytes, size_t count);
void memory_port_rtu(memory_port *m, const uint8_t *bytes, size_t count);

/* Polls until bytes are sent. Between two polls the time of pollDelay passes. */
void memory_port_send(memory_port *m, mbm_client *client);

/* Polls and lets the time of pollDelay pass, up to `steps` times or until `request` has
 * ended. Returns the status of `request`. */
uint8_t memory_port_run(memory_port *m, mbm_client *client, const mbm_clientRequest *request,
                        unsigned steps);

#endif
