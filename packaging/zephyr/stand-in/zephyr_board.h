/* The faults of the UART and of the GPIO that board.c plays. All zero is a board without a fault.
 * Licence: MIT OR Apache-2.0. */
#ifndef ZEPHYR_BOARD_H
#define ZEPHYR_BOARD_H

#include <stdbool.h>

extern struct board_faults {
    /* device_is_ready */
    bool uartIsNotReady, gpioIsNotReady;
    /* what these functions return */
    int configure, pinConfigure, pinSet;
    /* uart_err_check: the flags that are set; a driver that does not clear them; one without it */
    int errors;
    bool keepsErrors, hasNoErrCheck;
    /* nothing is received until uart_err_check has cleared the flags */
    bool isDeafUntilChecked;
    /* no interrupt comes for the transmitter; the last one does not come */
    bool hasNoTxInterrupt, hasNoLastInterrupt;
    /* uart_configure leaves the FIFO of the transmitter as it is */
    bool keepsFifo;
} board_faults;

/* How often the handler was called. */
extern unsigned board_interrupts;

/* An interrupt of the transmitter, whether a frame leaves or not. */
void board_interrupt(void);

#endif
