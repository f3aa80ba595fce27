/* The SunSpec models of a device: mbm scan --sunspec.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef SUNSPEC_H
#define SUNSPEC_H

#include "line.h"

/* Finds the base address of a unit, and lists its chain of models. Returns an exit code, after
 * reporting the reason if it is not CODE_DONE. */
int sunspec_scan(line *l, uint8_t unit);

#endif
