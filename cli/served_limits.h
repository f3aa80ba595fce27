/* Limits of what clients of mbm serve may write.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef SERVED_LIMITS_H
#define SERVED_LIMITS_H

#include "served.h"

/* Whether a write to cells of a device leaves each of its fields within min_value, max_value and
 * step. Returns 0, or the exception with which a device refuses it, 03. */
uint8_t served_limits_check(const served_cells *cells, const mbm_access *access);

#endif
