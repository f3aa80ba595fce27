/* What a sketch talks to: a real libmodbus server, or a script. */
#ifndef PEER_H
#define PEER_H

#include "board.h"
#include "server.h"

/* A device for board_uart and board_pins; its context is a server. Simulated
 * time stands still until the server has answered, so that a busy host changes
 * nothing. */
void peer_libmodbus(wire *w, const uint8_t *frame, size_t length);

/* The reply that a device with a value of its own in each register gives to
 * functions 03, 06 and 10; returns its length. */
size_t peer_right_reply(uint8_t *reply, const uint8_t *request);
uint16_t peer_value(unsigned address);

/* The context is nobody: answers every request rightly after one millisecond. */
void peer_right(wire *w, const uint8_t *frame, size_t length);

#endif
