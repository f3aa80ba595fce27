/* The devices that a sketch sends requests to: a libmodbus server or a script. */
#ifndef PEER_H
#define PEER_H

#include "board.h"
#include "server.h"

/* A device for board_uart and board_pins. Its context is a server. Simulated time stands
 * still until the server has answered, so that a busy host changes nothing. */
void peer_libmodbus(wire *w, const uint8_t *frame, size_t length);

/* Writes the reply of a device to functions 03, 06 and 10. Each of its registers has a
 * value of its own. Returns the reply's length. */
size_t peer_right_reply(uint8_t *reply, const uint8_t *request);
uint16_t peer_value(unsigned address);

/* A device without a context: answers every request with the right reply after one
 * millisecond. */
void peer_right(wire *w, const uint8_t *frame, size_t length);

#endif
