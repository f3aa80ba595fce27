/* Xtensa dc233c in QEMU's machine "sim", 10 MHz: a core with register windows, like the
 * ESP32's.
 * Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO 10u

#endif
