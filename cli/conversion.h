/* Values with an offset, with a precision, with limits for writes, and values that are not
 * available: what value_form has beyond type, order and scale. */
#pragma once

#include "value.h"

enum { CONVERSION_PLACES = 18, CONVERSION_NUMBERS = 32 };

/* All 0: nothing is converted. The numbers have at most 18 digits; without digits they are 0. */
typedef struct conversion {
    value_scale offset;
    value_scale least, most, step;
    uint8_t has_least, has_most, has_step;
    uint8_t has_precision, precision; /* digits after the point of what is shown */
    uint8_t is_standard;              /* the number that SunSpec reserves means "not available" */
    uint8_t number_count;
    uint16_t (*numbers)[VALUE_WORDS]; /* that mean it too, as registers have them */
} conversion;

/* Reads a number that means "not available" for a form: in decimal as value_read does without a
 * scale, or the bits of the registers in hexadecimal after 0x. Appends it. Returns NULL, or what is
 * wrong: a clause. `numbers` has a place for it. */
const char *conversion_add(conversion *to, const value_form *form, const char *text);

/* The scale 10^power. */
value_scale conversion_power(int power);

/* As value_print, with the conversion of the form. Returns MBM_OK; MBM_NOT_AVAILABLE with "null" in
 * JSON, and else an empty text, if the registers have no value; MBM_MALFORMED_VALUE in the same way
 * if they hold none of the type. A float that is not a number never is one. */
uint8_t conversion_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                         uint16_t count, int is_json, char text[VALUE_TEXT_BYTES]);

/* As value_read, with the offset of the form; its precision and its limits do not count. */
uint16_t conversion_read(const value_form *form, const char *text, size_t length,
                         uint16_t words[VALUE_WORDS], const char **wrong);

/* Whether there is an offset; whether there are limits of what is written. The conversion may be
 * NULL. */
int conversion_has_offset(const conversion *of);
int conversion_has_limits(const conversion *of);

/* Whether a number of a write, as text or in registers, is within the limits of the form. Returns
 * NULL, or a clause such as "is less than min_value, which is 5". */
const char *conversion_check(const value_form *form, const char *text, size_t length);
const char *conversion_check_registers(const value_form *form, const mbm_registers *registers,
                                       uint16_t address);
