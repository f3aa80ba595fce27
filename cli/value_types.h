/* The types of values: the ten of a plan, and those that the functions on mbm_registers have beside
 * them. A plan reads the latter as MBM_TYPE_REGISTERS. */
#pragma once

#include "mbm.h"

#include <stdint.h>

/* The numbers after those of the plan's types that have a value. The words of a file for types are
 * those up to VALUE_DATE_BCD. */
enum {
    VALUE_INT24 = MBM_TYPE_TEXT + 1,
    VALUE_UINT24,
    VALUE_INT48,
    VALUE_UINT48,
    VALUE_SIGN_MAGNITUDE16,
    VALUE_SIGN_MAGNITUDE32,
    VALUE_BCD16,
    VALUE_BCD32,
    VALUE_INT32_M10K,
    VALUE_UINT32_M10K,
    VALUE_INT48_M10K,
    VALUE_UINT48_M10K,
    VALUE_INT64_M10K,
    VALUE_UINT64_M10K,
    VALUE_FLOAT16,
    VALUE_TEXT_SPACES,
    VALUE_TEXT_LOW,
    VALUE_TEXT_LOW_SPACES,
    VALUE_TEXT_HIGH,
    VALUE_TEXT_HIGH_SPACES,
    VALUE_UNIX32,
    VALUE_UNIX64,
    VALUE_UNIX64_MS,
    VALUE_SECONDS_2000,
    VALUE_IEC870,
    VALUE_IEC870_3,
    VALUE_DATE,
    VALUE_DATE_BCD,
    /* Bits of a field of two and four registers. */
    VALUE_BITS32,
    VALUE_BITS64,
    /* VALUE_DATE and VALUE_DATE_BCD with a layout of 1, 2, ... VALUE_DATE_REGISTERS registers. */
    VALUE_DATE_OF_1 = 64,
    VALUE_DATE_BCD_OF_1 = 72,
    VALUE_DATE_REGISTERS = 8
};

/* The words for types, each at its number; the first is no word, and NULL ends them. */
extern const char *const value_type_names[];

/* The word for a type, also of those without a word of their own. */
const char *value_type_name(uint8_t type);

/* How many registers a value of a type has, or a text with `count` characters. A bit has 1; a type
 * of a date without a layout has 0. */
uint16_t value_registers(uint8_t type, uint16_t count);

/* What a type is. Each is one of these. */
int value_is_integer(uint8_t type); /* bits too */
int value_is_float(uint8_t type);
int value_is_text(uint8_t type);
int value_is_date(uint8_t type);

/* Whether it is bits of a field of two or four registers. */
int value_is_wide_bits(uint8_t type);

/* Whether it is one of the plan's own. */
int value_is_of_plan(uint8_t type, uint8_t order);

/* The range of the numbers of an integer type, but not of bits: the amount below 0, and the
 * greatest number. */
typedef struct value_range {
    uint64_t below_zero, most;
} value_range;
value_range value_range_of(uint8_t type);

/* The form of a text, MBM_TEXT_..., for mbm_registers_getText. */
uint8_t value_text_form(uint8_t type);

/* Which bits of its nth register a value has: `bits` from `first` on of wide bits, all of others.
 */
uint16_t value_mask(uint8_t type, uint8_t order, uint8_t first, uint8_t bits, uint32_t nth);

/* Get and set an integer of a type of registers, but not bits. Getting returns MBM_OK with the
 * amount and whether it is below 0, or MBM_MALFORMED_VALUE. What is set is in the range of the
 * type; `integer` is in two's complement. */
uint8_t value_get_integer(uint8_t type, uint8_t order, const mbm_registers *registers,
                          uint16_t address, uint64_t *amount, int *is_negative);
void value_set_integer(uint8_t type, uint8_t order, const mbm_registers *registers,
                       uint16_t address, uint64_t integer);
