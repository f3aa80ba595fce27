/* The line of a test on the chip that is played, with the driver of a transceiver at a pin. */
#ifndef UART_H
#define UART_H

#include "mbm_stm32.h"

extern mbm_stm32Line uart;
extern mbm_port port;

/* A new chip, and the line as before its first opening. */
void uart_start(uint8_t byDma);
void uart_open(void);

/* Fails unless the driver was on for each character that left, off for each that arrived, and is
 * off now. */
void uart_is_quiet(void);

#endif
