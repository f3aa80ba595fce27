/* The plan that reads the fields of a device: its storage, a trial of it, and its values as text.
 */
#pragma once

#include "device.h"

/* Gives `setup` the fields of a device that can be read, its limits, and storage for their plan: as
 * much as any plan takes, and `requests` requests. One read may cover up to `gap` addresses between
 * two fields; DEVICE_PLAN_OWN_GAP for as many as the file says. Returns 0 without memory.
 * device_plan_free frees the storage in both cases. The device must outlive the plan. */
enum { DEVICE_PLAN_OWN_GAP = -1 };
int device_plan_make(mbm_planSetup *setup, const device *of, int gap, uint8_t requests);
void device_plan_free(mbm_planSetup *setup);

/* Gives `splitting` the storage for a plan with this setup, which is free()d as its `blocks`.
 * Returns 0 without memory. */
int device_plan_split(mbm_planSplitting *splitting, const mbm_planSetup *setup);

/* Whether the device does not have a field, or refuses it, by the status of the field. */
int device_plan_is_refused(uint8_t status);

/* Returns NULL, or why a line with these frames, one of MBM_FRAMING_, cannot read the device: a
 * sentence without its full stop, as device_plan_wrong. */
const char *device_plan_check(const device *of, const char *path, uint8_t framing);

/* Whether a read of a plan covers all of a field. */
int device_plan_covers(const mbm_planReadInfo *read, const mbm_planField *planned);

/* Begins a plan on a client that has no line, to see what the library makes of the fields. Returns
 * the status of mbm_plan_begin, which sets `wrong`. The caller ends the plan; another trial may
 * begin then. */
uint8_t device_plan_try(mbm_plan *plan, const mbm_planSetup *setup, uint16_t *wrong);

/* Returns why the plan of the device file at `path` was refused: a sentence without its full stop,
 * "meter.yaml:12: ...", in a buffer that the fourth next call overwrites. */
const char *device_plan_wrong(const device *of, const char *path, uint8_t status, uint16_t wrong);

/* The longest value as text: 2000 bits or 125 numbers, or a text. */
enum { DEVICE_TEXT_LONGEST = 16384 };

/* Writes the value that the plan has of a field: plain, or as JSON if `is_json` is 1. Several
 * values are separated by commas, in JSON in an array. A value that is not available is null in
 * JSON, and otherwise `none`. Returns 0 if no value has arrived yet. */
int device_plan_text(mbm_plan *plan, const device *of, uint16_t field, int is_json,
                     const char *none, char text[DEVICE_TEXT_LONGEST]);

/* As mbm_plan_getStatus, and MBM_NOT_AVAILABLE or MBM_MALFORMED_VALUE if the last read has ended
 * well, and the registers have none of the values of the field. `ageMs` may be NULL. */
uint8_t device_plan_status(mbm_plan *plan, const device *of, uint16_t field, uint32_t *ageMs);

/* Whether a status of device_plan_status says that the last read has ended well. */
int device_plan_is_read(uint8_t status);

/* Sets the form of a field's values as they are now: with the power of ten that another field has.
 * Returns MBM_OK; MBM_NOT_AVAILABLE if that field has none. */
uint8_t device_plan_form(mbm_plan *plan, const device *of, uint16_t field, value_form *form);

/* Returns the name that the enumeration of a field has for one of its values. NULL if it has none,
 * or if no value has arrived yet. */
const char *device_plan_name(const mbm_plan *plan, const device *of, uint16_t field,
                             uint16_t index);
