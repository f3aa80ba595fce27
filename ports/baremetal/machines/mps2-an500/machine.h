/* Arm MPS2 with the AN500 image: Cortex-M7 at 25 MHz. Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO (256u * 25u)
#define UART_BASE 0x40004000u
#define UART_HZ 25000000u

#endif
