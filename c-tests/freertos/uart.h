/* The UART of a test of ports/freertos. It is one end of a pty, with a thread as its interrupt. */
#ifndef UART_H
#define UART_H

#include "mbm_freertos_uart.h"

#include <pthread.h>

enum { UART_BAUD = 115200, UART_RING = 64 };

/* The registers are flags. */
extern struct uart_chip {
    int fd;
    int to_do[2]; /* a byte for each call of startSending, and 'q' for the end */
    volatile int is_started;
    volatile int driver, driver_was_on, driver_in_interrupt, pin_fails;
    pthread_t thread;
} chip;

extern mbm_freertosUart uart;
extern mbm_port port;

/* Zeroes the line and sets its public fields. */
void uart_settings(void);

/* Starts and ends the interrupt. */
void uart_start(int fd);
void uart_stop(void);

#endif
