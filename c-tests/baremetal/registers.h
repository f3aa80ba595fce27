/* Included before each file of ports/baremetal/uart in tests: its registers are those of
 * c-tests/test_baremetal.c, and its functions have the names PREFIX_uart_read and so on, so that
 * one program has them all. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*register_at(address))
#define REGISTER8(address) (*(volatile uint8_t *)register_at(address))

/* Finds out what the last access has done, and prepares this register to be read or written. */
volatile uint32_t *register_at(uint32_t address);

#ifdef PREFIX
#define JOINED(prefix, name) prefix##_##name
#define NAMED(prefix, name) JOINED(prefix, name)
#define uart_start NAMED(PREFIX, uart_start)
#define uart_read NAMED(PREFIX, uart_read)
#define uart_write NAMED(PREFIX, uart_write)
#define uart_flush NAMED(PREFIX, uart_flush)
#define uart_lost NAMED(PREFIX, uart_lost)
#define uart_stalled NAMED(PREFIX, uart_stalled)
#define uart_has_bytes NAMED(PREFIX, uart_has_bytes)
#define uart_interrupt NAMED(PREFIX, uart_interrupt)
#endif

#endif
