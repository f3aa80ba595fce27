/* Xtensa dc233c in QEMU's machine "sim", 10 MHz: register windows, as the
 * ESP32's core has. Licence: MIT OR Apache-2.0. */
#ifndef MACHINE_H
#define MACHINE_H

#define TICKS_PER_MICRO 10u

#endif
