/* What the examples need of a board with a WIZnet chip. Licence: MIT OR Apache-2.0. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

/* Starts the bus of the chip (reg_wizchip_spi_cbfunc, reg_wizchip_cs_cbfunc), its memory
 * (wizchip_init) and its address (wizchip_setnetinfo). */
void board_begin(void);

/* A clock in microseconds that wraps at 2^32: a millisecond tick times 1000 will do. */
uint32_t board_micros(void *none);

void board_print(const char *text);
void board_printNumber(unsigned long number);

#endif
