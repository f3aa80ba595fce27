/* Xtensa lx106, the core of the ESP8266, in QEMU's machine "sim", 40 MHz.
 * Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO 40u

#endif
