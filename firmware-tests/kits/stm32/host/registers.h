/* Registers at their addresses, on this machine. Each access of the program is caught: before it
 * the chip sets the register, after it the chip does what the register does. x86-64 Linux. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

/* Makes a page of registers. The chip itself uses them at the address that this returns, where
 * nothing is caught. */
uint8_t *registers_map(uint32_t page);
/* Begins to catch accesses, in each test, because cmocka takes the signal for itself. */
void registers_catch(void);
/* Makes a page of plain memory. */
void registers_plain(uint32_t page);

/* The chip's. */
void chip_before(uint32_t address);
void chip_after(uint32_t address, int isWrite);

#endif
