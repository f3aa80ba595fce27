/* Arm MPS2 with the AN505 image: Cortex-M33 at 20 MHz, in its secure state. Licence: MIT OR
 * Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO (256u * 20u)
#define UART_BASE 0x50200000u
#define UART_HZ 20000000u

#endif
