/* BBC micro:bit: nRF51822, Cortex-M0 at 16 MHz. Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO 1u
#define UART_BASE 0x40002000u
#define UART_TX_PIN 24u
#define UART_RX_PIN 25u

#endif
