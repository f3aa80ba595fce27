/* The fields that mbm poll reads, and what it says of each of them: in its table, in JSON, and on
 * its page. */
#pragma once

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

/* --- what has become of the values --- */

/* Bytes of the longest number as text. */
enum { FOLLOWED_NUMBER_BYTES = 48 };

typedef struct followed_field {
    char *text;         /* the value as polled_value writes it; NULL before the first */
    int64_t changed_at; /* of the monotonic clock, in milliseconds; 0: it has not changed */
    int direction;      /* of the last change: 1 up, -1 down, 0 if it is no number */
    uint8_t has_number; /* it had one at least once */
    long double number, least, most;
    char least_text[FOLLOWED_NUMBER_BYTES], most_text[FOLLOWED_NUMBER_BYTES];
} followed_field;

/* How the reads of a unit ended. A read is a request, whatever number of fields it has. */
typedef struct followed_unit {
    uint8_t unit;
    uint32_t reads, no_reply, exceptions, damaged, link;
} followed_unit;

typedef struct followed {
    polled *of;
    followed_field *fields;
    followed_unit *units; /* in the order of the fields */
    uint16_t unit_count;
    uint16_t *leaders; /* of each read of the plan: the field that counts it, and one more */
} followed;

/* Begins. Returns 0, or -1 without memory. */
int followed_begin(followed *f, polled *of);
void followed_end(followed *f);

/* A read of a field has ended, as the plan's update says. */
void followed_note(followed *f, uint16_t field);

/* Forgets minimum and maximum of all fields; the values of now are the first ones. */
void followed_forget(followed *f);

/* How many of the reads of a unit have failed. */
uint32_t followed_failures(const followed_unit *unit);

/* Writes how the reads of a unit ended: "unit 17: 240 reads, 2 without reply". Returns `text`. */
enum { FOLLOWED_UNIT_BYTES = 160 };
const char *followed_unit_text(const followed_unit *unit, char text[FOLLOWED_UNIT_BYTES]);
