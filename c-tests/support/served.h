/* An mbm server with everything that it can serve, in a thread: at one end of a pty, or on
 * a listening loopback socket. Peers send requests to it. */
#ifndef SERVED_H
#define SERVED_H

#include "mbm.h"
#include "pty.h"

#include <pthread.h>

enum {
    SERVED_UNIT = 17,
    SERVED_BASE = 100, /* the address of the first register or bit of each table */
    SERVED_REGISTERS = 300,
    SERVED_BITS = 2400,
    SERVED_HOLE = 250,    /* the address of a holding register that does not exist */
    SERVED_REFUSED = 260, /* the address of a holding register that refuses the value BEEF */
    SERVED_CONNECTIONS = 4,
    SERVED_ECHO = 0x41 /* a function that returns its data */
};

typedef struct served {
    mbm_unit units[2]; /* the second has the next id, and ten holding registers */
    mbm_registerTable holding, inputs, other;
    mbm_bitTable coils, discrete;
    mbm_diagnostics diagnostics;
    mbm_exceptionStatus status;
    mbm_serverId id;
    mbm_files files;
    mbm_fifos fifos;
    mbm_identification identification;
    mbm_custom echo;
    uint16_t words[SERVED_REGISTERS], input_words[SERVED_REGISTERS], other_words[10];
    uint8_t bits[SERVED_BITS / 8], input_bits[SERVED_BITS / 8];
    uint8_t valid[(SERVED_REGISTERS + 7) / 8];
    uint16_t records[20], queue[31];
    mbm_file file;
    mbm_fifo fifo;
    mbm_accessHooks word_hooks, bit_hooks;
    unsigned written; /* how often the hook after a write was called */

    mbm_server servers[SERVED_CONNECTIONS];
    uint8_t frames[SERVED_CONNECTIONS][MBM_MAX_ASCII_FRAME];
    int fds[SERVED_CONNECTIONS];
    int listener;
    int port;
    pty line;
    int framing;
    int stop[2];
    pthread_t thread;
} served;

/* Fills the tables with a known pattern and registers what the units serve. */
void served_prepare(served *s);

uint16_t served_pattern(unsigned address);
uint8_t served_bit_pattern(unsigned address);

/* Serves on a pty whose far end is s->line.path, RTU or ASCII. */
void served_on_line(served *s, int framing);

/* Serves connections to 127.0.0.1, port s->port, TCP or RTU over TCP. Connections beyond
 * SERVED_CONNECTIONS are closed at once. */
void served_on_tcp(served *s, int framing);

void served_stop(served *s);

#endif
