/* What the sleeping application needs from a board in addition to board.h: a UART whose
 * interrupt fills a ring, and a sleep that received bytes end.
 * Licence: MIT OR Apache-2.0. */
#ifndef SLEEP_H
#define SLEEP_H

#include <stdint.h>

/* Returns whether bytes wait in the ring. Called while interrupts are held back. */
uint8_t uart_has_bytes(void);

/* Returns how many bytes the ring lost because it was full. */
uint16_t uart_lost(void);

void sleep_start(void);

/* Sleeps until a byte has arrived or the time is over; does not sleep for 0. A sleep may be
 * shorter, so that the clock is read often enough. */
void sleep_at_most(uint32_t micros);

/* How often the core has slept. */
extern uint32_t sleeps;

/* The interrupt handlers, for the machine's vectors. */
void uart_interrupt(void);
void sleep_interrupt(void);

#endif
