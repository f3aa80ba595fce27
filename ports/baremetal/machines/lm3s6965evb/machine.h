/* TI LM3S6965: Cortex-M3 at 50 MHz. Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO (256u * 50u)
#define UART_BASE 0x4000C000u
#define UART_HZ 50000000u
#define UART_INTERRUPT 5u

#endif
