/* Converts values as their form says, in decimal arithmetic, on the text that value.c writes and
 * reads of a number: so it holds for every type. */
#include "conversion.h"

#include "decimal.h"
#include "numbers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const conversion NONE = {.precision = 0};

static const conversion *conversion_of(const value_form *form)
{
    return form->conversion ? form->conversion : &NONE;
}

value_scale conversion_power(int power)
{
    value_scale scale = {.digits = 1, .exponent = power};
    char text[16];

    (void)snprintf(text, sizeof text, "1e%d", power);
    scale.value = strtod(text, NULL);
    return scale;
}

/* --- not available --- */

const char *conversion_add(conversion *to, const value_form *form, const char *text)
{
    value_form plain = *form;
    const char *wrong;

    memset(&plain.scale, 0, sizeof plain.scale);
    plain.is_hex = text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
    memset(to->numbers[to->number_count], 0, sizeof to->numbers[0]);
    if (value_read(&plain, text, strlen(text), to->numbers[to->number_count], &wrong) == 0)
        return wrong;
    to->number_count++;
    return NULL;
}

/* The number that SunSpec reserves in a type, as one of value.c in hexadecimal; NULL for none. */
static const char *reserved(uint8_t type)
{
    switch (type) {
    case MBM_TYPE_INT16: return "8000";
    case MBM_TYPE_UINT16: return "FFFF";
    case MBM_TYPE_INT32: return "80000000";
    case MBM_TYPE_UINT32: return "FFFFFFFF";
    case MBM_TYPE_INT64: return "8000000000000000";
    case MBM_TYPE_UINT64: return "FFFFFFFFFFFFFFFF";
    default: return NULL;
    }
}

static int is_reserved(const value_form *form, const uint16_t words[VALUE_WORDS], size_t bytes)
{
    const value_form plain = {.type = form->type, .order = form->order, .is_hex = 1};
    const char *number = reserved(form->type), *wrong;
    uint16_t own[VALUE_WORDS];

    return number && value_read(&plain, number, strlen(number), own, &wrong) > 0 &&
           memcmp(own, words, bytes) == 0;
}

/* Whether all registers of a text are 0. */
static int is_empty(uint8_t type, const mbm_registers *registers, uint16_t address, uint16_t count)
{
    uint16_t i, word = 0;

    for (i = 0; i < value_registers(type, count); i++) {
        (void)mbm_registers_getUint16(registers, (uint16_t)(address + i), MBM_ORDER_ABCD, &word);
        if (word != 0)
            return 0;
    }
    return 1;
}

/* Which bits of the nth register of a value count. */
static uint16_t mask_of(const value_form *form, uint16_t nth)
{
    const int is_24 = form->type == VALUE_INT24 || form->type == VALUE_UINT24;

    return is_24 ? value_mask(VALUE_BITS32, form->order, 0, 24, nth)
                 : value_mask(form->type, form->order, form->first, form->bits, nth);
}

/* Whether the registers have a number, or a text, that means "not available". */
static int is_listed(const value_form *form, const mbm_registers *registers, uint16_t address,
                     uint16_t count)
{
    const conversion *of = conversion_of(form);
    uint16_t words[VALUE_WORDS] = {0}, size, i, at;

    if (value_is_text(form->type))
        return of->is_standard && is_empty(form->type, registers, address, count);
    if (!of->is_standard && of->number_count == 0)
        return 0;
    size = value_registers(form->type, 1);
    for (i = 0; i < size && i < VALUE_WORDS; i++) {
        (void)mbm_registers_getUint16(registers, (uint16_t)(address + i), MBM_ORDER_ABCD,
                                      &words[i]);
        words[i] &= mask_of(form, i);
    }
    for (at = 0; at < of->number_count; at++) {
        for (i = 0; i < size && words[i] == (of->numbers[at][i] & mask_of(form, i));)
            i++;
        if (i == size)
            return 1;
    }
    return of->is_standard && is_reserved(form, words, size * sizeof *words);
}

/* --- values as text --- */

/* Reads the number of the registers without scale and offset. Returns 0 if it is infinite, or not a
 * number, which sets `is_nan`. */
static int get_number(const value_form *form, const mbm_registers *registers, uint16_t address,
                      decimal_number *number, int *is_nan)
{
    value_form plain = *form;
    char text[VALUE_TEXT_BYTES];

    plain.scale.digits = 0;
    plain.is_hex = 0;
    value_print(&plain, registers, address, 1, 0, text);
    *is_nan = strstr(text, "nan") != NULL;
    return decimal_read(text, strlen(text), number);
}

/* Makes a value of a number. Returns 0 if it has too many digits. */
static int convert(const value_form *form, decimal_number *number)
{
    return (form->scale.digits == 0 || decimal_multiply(number, &form->scale)) &&
           decimal_add(number, &conversion_of(form)->offset, 0);
}

uint8_t conversion_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                         uint16_t count, int is_json, char text[VALUE_TEXT_BYTES])
{
    static decimal_number number;
    const conversion *of = conversion_of(form);
    const int is_converted = (of->offset.digits != 0 || of->has_precision) && !form->is_hex &&
                             !value_is_text(form->type) && !value_is_date(form->type) &&
                             form->type != MBM_TYPE_BIT;
    int is_nan = 0, is_finite = 0;

    /* Only a float can be no number. */
    if (is_converted || value_is_float(form->type))
        is_finite = get_number(form, registers, address, &number, &is_nan);

    if (is_nan || is_listed(form, registers, address, count)) {
        strcpy(text, is_json ? "null" : "");
        return MBM_NOT_AVAILABLE;
    }
    if (!is_converted || !is_finite || !convert(form, &number))
        return value_print(form, registers, address, count, is_json, text);
    if (of->has_precision)
        decimal_round(&number, of->precision);
    decimal_print(&number, of->has_precision ? of->precision : 0, text);
    return MBM_OK;
}

/* --- values from text --- */

uint16_t conversion_read(const value_form *form, const char *text, size_t length,
                         uint16_t words[VALUE_WORDS], const char **wrong)
{
    static decimal_number number;
    char shifted[VALUE_LONGEST + 1];
    uint16_t count;

    if (form->is_hex || conversion_of(form)->offset.digits == 0 ||
        !decimal_read(text, length, &number))
        return value_read(form, text, length, words, wrong);
    if (!decimal_add(&number, &conversion_of(form)->offset, 1) ||
        !decimal_print_exact(&number, shifted)) {
        *wrong = "has too many digits";
        return 0;
    }
    count = value_read(form, shifted, strlen(shifted), words, wrong);
    if (count == 0 && strstr(*wrong, "multiple"))
        *wrong = "is not the offset and a multiple of the scale";
    else if (count == 0 && strstr(*wrong, "whole"))
        *wrong = "is not the offset and a whole number";
    return count;
}

/* --- limits --- */

static const char *limit_text(const value_scale *limit)
{
    char text[DECIMAL_BYTES];

    decimal_print_scale(limit, text);
    return say("%s", text);
}

static const char *check(const conversion *of, decimal_number *number)
{
    if (of->has_least && decimal_compare(number, &of->least) < 0)
        return say("is less than min_value, which is %s", limit_text(&of->least));
    if (of->has_most && decimal_compare(number, &of->most) > 0)
        return say("is greater than max_value, which is %s", limit_text(&of->most));
    if (!of->has_step)
        return NULL;
    if (of->has_least && !decimal_add(number, &of->least, 1))
        return "has too many digits";
    if (decimal_is_multiple(number, &of->step))
        return NULL;
    return of->has_least ? say("is not min_value, %s, and a multiple of step, which is %s",
                               limit_text(&of->least), limit_text(&of->step))
                         : say("is not a multiple of step, which is %s", limit_text(&of->step));
}

int conversion_has_offset(const conversion *of)
{
    return of && of->offset.digits != 0;
}

int conversion_has_limits(const conversion *of)
{
    return of && (of->has_least || of->has_most || of->has_step);
}

const char *conversion_check(const value_form *form, const char *text, size_t length)
{
    static decimal_number number;

    /* What is no number is refused by conversion_read. */
    if (!conversion_has_limits(form->conversion) || !decimal_read(text, length, &number))
        return NULL;
    return check(form->conversion, &number);
}

const char *conversion_check_registers(const value_form *form, const mbm_registers *registers,
                                       uint16_t address)
{
    static decimal_number number;
    int is_nan;

    if (!conversion_has_limits(form->conversion))
        return NULL;
    if (!get_number(form, registers, address, &number, &is_nan) || !convert(form, &number))
        return "is no number";
    return check(form->conversion, &number);
}
