/* Dates and times of registers as text of ISO 8601, and back: exactly, or not at all. */
#pragma once

#include "value.h"

enum { VALUE_DATE_BYTES = 48, VALUE_ZONE_MOST = 14 * 60, VALUE_LAYOUT_BYTES = 32 };

/* Reads a time zone: Z, or hours and minutes east of UTC such as +01:00. Returns 0 if the text is
 * anything else. */
int value_zone_read(const char *text, int16_t *minutes);

/* Checks a layout of mbm_registers_getDate. Returns NULL with the number of its registers, or what
 * is wrong: a sentence without its full stop, which begins with the layout in quotes. */
const char *value_layout_check(const char *layout, uint8_t *registers);

/* Writes the date at an address: "2026-11-27T20:15:00Z", with milliseconds if the registers have
 * them; a day alone as "2026-11-27", a time of day as "20:15:00". Returns MBM_OK, or
 * MBM_MALFORMED_VALUE. */
uint8_t value_date_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                         char text[VALUE_DATE_BYTES]);

/* Converts such a text of `length` bytes, in any time zone, to the words of a value. Returns the
 * number of words, or 0 with the reason in `wrong`: a clause. */
uint16_t value_date_read(const value_form *form, const char *text, size_t length,
                         uint16_t words[VALUE_WORDS], const char **wrong);
