/* QEMU's RISC-V machine "virt". Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define UART_BASE 0x10000000u
#define UART_HZ 3686400u
#define MTIME 0x0200BFF8u
#define TICKS_PER_MICRO 10u

#endif
