/* What the application needs from a board: a UART whose functions do not wait, a clock, and
 * a console. Each has one file for each kind of hardware.
 * Licence: MIT OR Apache-2.0. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

/* 8 data bits, no parity, 1 stop bit. The low rate makes the silence after a frame long.
 * QEMU's UARTs have no rate, but a busy computer may pause inside a frame for longer than
 * any wire would. */
#define BAUD 2400u

/* Sets up clocks and pins. Called before all other functions. */
void machine_start(void);

/* The hooks of mbm_port. There is one UART, so they do not use `context`. A transmitter that stands
 * still for half a second is given up: the UART is started again, and the next hook returns a lost
 * link. */
void uart_start(void);
int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity);
int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length);
uint8_t uart_flush(void *context);

/* Returns how often the UART overran, and with a ring also how many bytes it had no place for. */
uint16_t uart_lost(void);

/* Returns how often the transmitter was given up. */
uint16_t uart_stalled(void);

void clock_start(void);
uint32_t clock_micros(void *context);

/* Prints to the debugger's console. QEMU plays the debugger. On your own board, use an LED
 * and an endless loop instead. */
void console_print(const char *text);
_Noreturn void console_exit(uint8_t code);

int main(void);

/* The tests play the registers. */
#ifndef REGISTER
#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define REGISTER8(address) (*(volatile uint8_t *)(uintptr_t)(address))
#endif

/* A free-running counter. clock/counter.c makes microseconds of it. */
void counter_start(void);

/* Counts up, TICKS_PER_MICRO (machine.h) in a microsecond, and wraps at 2^32. */
uint32_t counter_read(void);

/* --- for the sleeping application: a UART whose interrupt fills a ring, and a sleep that received
 * bytes end --- */

/* Returns whether bytes wait in the ring. Called while interrupts are held back. */
uint8_t uart_has_bytes(void);

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
