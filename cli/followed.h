/* What has become of the values that mbm poll reads: when each changed the last time, its minimum
 * and maximum, and how the reads of each unit ended.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef FOLLOWED_H
#define FOLLOWED_H

#include "polled.h"

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

#endif
