/* Netduino Plus 2: STM32F405, Cortex-M4F at 168 MHz. Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO (256u * 168u)
#define UART_BASE 0x40011000u /* USART1, on the faster peripheral bus */
#define UART_HZ 84000000u

#endif
