/* A machine whose registers c-tests/test_baremetal.c plays. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO 1u
#define UART_BASE 0x40000000u
#define UART_HZ 8000000u
#define UART_INTERRUPT 5u
#define UART_TX_PIN 1u
#define UART_RX_PIN 2u

#endif
