/* A server with the unit 17 on the line of uart.h. */
#ifndef SERVED_UNIT_H
#define SERVED_UNIT_H

#include "uart.h"

enum { UNIT = 17 };

extern uint16_t cells[125]; /* the unit's holding registers */
extern mbm_server server;

/* A new chip, an open line, and a server over it whose registers begin at the address `base`. */
void served_unit_start(uint8_t byDma, uint16_t base);

/* Polls the server, each time after `pause` microseconds, until `characters` more characters have
 * left. Fails if that takes more than `polls` polls. */
void served_unit_sends(unsigned characters, unsigned polls, uint32_t pause);

#endif
