/* A plan on a client without a line: what the library makes of a table of fields.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef TRIAL_H
#define TRIAL_H

#include "mbm.h"

/* Begins a plan on a client that has no line. Returns the status of mbm_plan_begin, which sets
 * `wrong`. The caller ends the plan; another trial may begin then. */
uint8_t trial_begin(mbm_plan *plan, const mbm_planSetup *setup, uint16_t *wrong);

#endif
