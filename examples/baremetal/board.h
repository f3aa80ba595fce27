/* What the application wants of a board: a UART without waiting, a clock, and
 * somewhere to say how it went. Each has one file per kind of hardware.
 * Licence: MIT OR Apache-2.0. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

/* 8 data bits, no parity, 1 stop bit. Slow, since that makes the silence behind
 * a frame long: QEMU's UARTs have no rate, but a busy computer may pause inside
 * a frame for longer than any wire would. */
enum { BAUD = 2400 };

/* Clocks and pins, before all else. */
void machine_start(void);

/* The hooks of mbm_port; there is one UART, so context is not used. */
void uart_start(void);
int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity);
int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length);
uint8_t uart_flush(void *context);

void clock_start(void);
uint32_t clock_micros(void *context);

/* The debugger's console; QEMU plays the debugger. On a board of your own, an
 * LED and an endless loop do as well. */
void console_print(const char *text);
_Noreturn void console_exit(uint8_t code);

int main(void);

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#endif
