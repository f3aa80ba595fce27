/* The fields that mbm poll reads, and what it says of each of them: in its table, in JSON, and on
 * its page.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef POLLED_H
#define POLLED_H

#include "device_plan.h"
#include "line.h"

typedef struct polled {
    line at;
    device meter;
    mbm_plan plan;
    mbm_planSetup setup;
    mbm_planSplitting splitting;
} polled;

/* How many columns of a table the names take: those of the longest one, up to POLLED_LONGEST_NAME.
 */
enum { POLLED_LONGEST_NAME = 40 };
int polled_name_width(const polled *p);

/* How many fields have been read, and their last read has ended well. */
uint16_t polled_read_count(polled *p);

/* The code of an exception, or 0 for another status. */
uint8_t polled_exception(uint8_t status);

/* The status of a field in words; a lost link has the reason too. Returns `text`. */
const char *polled_status(polled *p, uint8_t status, char text[256]);

/* Writes the value of a field with its unit of measurement and the names of its enumeration: "230.1
 * V", "4 (MPPT)". A value that is not available is "-". Returns 0 if none has arrived yet; it is
 * "-" then. */
enum { POLLED_VALUE_BYTES = DEVICE_TEXT_LONGEST + 3 * DEVICE_NAME_BYTES };
int polled_value(polled *p, uint16_t field, char text[POLLED_VALUE_BYTES]);

/* Adds to an object what JSON has of a field, from its unit to the status of its last read. */
struct cJSON;
void polled_add_json(polled *p, uint16_t field, struct cJSON *object);

#endif
