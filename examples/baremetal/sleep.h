/* What the application that sleeps wants of a board, beside board.h: a UART whose
 * interrupt fills a ring, and a sleep that its bytes end.
 * Licence: MIT OR Apache-2.0. */
#ifndef SLEEP_H
#define SLEEP_H

#include <stdint.h>

/* Whether bytes wait in the ring; asked with interrupts held back. */
uint8_t uart_has_bytes(void);

/* Bytes that the ring had no room for. */
uint16_t uart_lost(void);

void sleep_start(void);

/* Sleeps until a byte is there or the time is over; not at all for 0. Now and
 * then it is shorter, so that the clock is read in time. */
void sleep_at_most(uint32_t micros);

/* How often the core slept. */
extern uint32_t sleeps;

/* The handlers, for the machine's vectors. */
void uart_interrupt(void);
void sleep_interrupt(void);

#endif
