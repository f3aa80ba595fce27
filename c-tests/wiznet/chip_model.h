/* A W5500 in memory, with its eight sockets. The far end of each connection is a TCP connection of
 * this machine, so that libmodbus is its peer; or the test plays it. Faults are set in
 * `the_chip`. */
#ifndef CHIP_MODEL_H
#define CHIP_MODEL_H

#include <stdint.h>

enum { CHIP_SOCKETS = 8, CHIP_BUFFER = 2048, CHIP_ALWAYS = 0xFF };

typedef struct chip_model {
    uint8_t
        is_absent; /* all registers read as 0xFF, and each command waits for ever: a test fails */
    uint8_t has_no_address; /* socket() refuses: the network was not set */
    uint8_t is_unplugged;   /* SYN and data get no answer */
    uint8_t is_deaf;        /* no peer acknowledges the end of the stream */
    uint16_t most_sent;     /* free bytes of the transmit buffer; 0: 2048 */
    uint16_t most_received; /* bytes that show at once in the receive buffer; 0: all */
    uint8_t busy_sends; /* the next sends return SOCK_BUSY, or CHIP_ALWAYS: the last bytes are not
                           acknowledged */
    unsigned calls,
        fail_at; /* commands; the one that finds the connection reset, from 1 on; 0: none */
    uint16_t local_port[CHIP_SOCKETS];
    uint8_t keep_alive[CHIP_SOCKETS];
    uint32_t micros;      /* the clock of the board */
    uint32_t hard_closes; /* closes that dropped a connection */
    uint32_t soft_closes; /* DISCON */
} chip_model;

extern chip_model the_chip;

void chip_begin(void);
void chip_end(void);

/* The TCP port of this machine at which the chip's sockets that listen are reached. */
uint16_t chip_port(void);

/* The chip gives up what is not acknowledged: closes the socket, with the interrupt TIMEOUT. */
void chip_timeOut(uint8_t number);

/* A reset by the peer. */
void chip_reset(uint8_t number);

#endif
