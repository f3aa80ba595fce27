/* An event of the sniffer as JSON.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef EVENT_JSON_H
#define EVENT_JSON_H

#include "mbm.h"

/* Prints an event as one line with one JSON object. `micros` is the time of the event since the
 * sniffer began, and negative if it was before, `epoch` that time since 1970, or 0 if it is not
 * known. */
void event_json_print(const mbm_event *event, int64_t micros, uint64_t epoch);

#endif
