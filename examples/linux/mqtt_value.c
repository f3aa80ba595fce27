#define _GNU_SOURCE
#include "mqtt_value.h"

#include <cjson/cJSON.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The longest text field: 125 registers. */
enum { LONGEST_TEXT = 250, LONGEST_NUMBER = 40 };

/* Writes the value of a float or double with as many digits as it takes to read the same value
 * back. JSON has no word for infinity and not-a-number. */
static void print_exact(char *text, double value, int is_float, int is_json)
{
    int digits = is_float ? FLT_DIG + 1 : DBL_DIG;
    const int most = is_float ? FLT_DECIMAL_DIG : DBL_DECIMAL_DIG;

    if (is_json && !isfinite(value)) {
        strcpy(text, "null");
        return;
    }
    do
        snprintf(text, LONGEST_NUMBER, "%.*g", digits, value);
    while (digits++ < most &&
           (is_float ? strtof(text, NULL) != (float)value : strtod(text, NULL) != value));
}

/* Writes a scaled value. */
static void print_real(char *text, double value, int digits, int is_json)
{
    if (is_json && !isfinite(value))
        strcpy(text, "null");
    else
        snprintf(text, LONGEST_NUMBER, "%.*g", digits, value);
}

/* Writes one number or bit. Returns 0 if no value has arrived yet. */
static int print_number(const mbm_plan *plan, const mqtt_field *field, const mbm_planField *planned,
                        uint16_t at, uint16_t index, int is_json, char text[LONGEST_NUMBER])
{
    const int is_float = planned->type == MBM_TYPE_FLOAT;
    int64_t integer;
    double real;
    uint8_t status;

    if (planned->type == MBM_TYPE_FLOAT || planned->type == MBM_TYPE_DOUBLE) {
        status = mbm_plan_getNumber(plan, at, index, &real);
        if (status != MBM_OK)
            return 0;
        if (field->is_scaled)
            print_real(text, real * field->scale.value, is_float ? 7 : 15, is_json);
        else
            print_exact(text, real, is_float, is_json);
        return 1;
    }
    status = mbm_plan_getInteger(plan, at, index, &integer);
    if (status == MBM_OUT_OF_RANGE) {
        /* A uint64 above the range of int64_t. */
        mbm_registers registers;
        uint64_t large = 0;

        status = mbm_plan_getRegisters(plan, at, &registers);
        if (status == MBM_OK)
            status = mbm_registers_getUint64(&registers, (uint16_t)(planned->address + 4 * index),
                                             planned->order, &large);
        if (field->is_scaled)
            print_real(text, (double)large * field->scale.value, 15, is_json);
        else
            snprintf(text, LONGEST_NUMBER, "%" PRIu64, large);
        return status == MBM_OK;
    }
    if (status != MBM_OK)
        return 0;
    if (planned->type == MBM_TYPE_BIT && is_json)
        strcpy(text, integer ? "true" : "false");
    else if (field->is_scaled)
        print_real(text, (double)integer * field->scale.value, 15, is_json);
    else
        snprintf(text, LONGEST_NUMBER, "%" PRId64, integer);
    return 1;
}

/* Writes a text. Bytes above 127 are taken as Latin-1. */
static int print_text(const mbm_plan *plan, uint16_t field, int is_json, char *text, size_t size)
{
    char latin[LONGEST_TEXT + 1], utf8[2 * LONGEST_TEXT + 1];
    size_t from, to = 0;
    cJSON *json;
    int fits;

    if (mbm_plan_getText(plan, field, latin, sizeof latin) != MBM_OK)
        return 0;
    for (from = 0; latin[from]; from++) {
        const unsigned char byte = (unsigned char)latin[from];

        if (byte >= 0x80)
            utf8[to++] = (char)(0xC0 | byte >> 6);
        utf8[to++] = (char)(byte >= 0x80 ? 0x80 | (byte & 0x3F) : byte);
    }
    utf8[to] = '\0';
    if (!is_json)
        return (size_t)snprintf(text, size, "%s", utf8) < size;
    json = cJSON_CreateString(utf8);
    fits = json && cJSON_PrintPreallocated(json, text, (int)size, 0);
    cJSON_Delete(json);
    return fits;
}

int mqtt_value_text(const mbm_plan *plan, const mqtt_fields *fields, uint16_t field, int is_json,
                    char *text, size_t size)
{
    const mbm_planField *planned = &fields->planned[field];
    const uint16_t count = planned->count ? planned->count : 1;
    const int is_array = is_json && count > 1;
    size_t length = 0;
    uint16_t index;

    if (planned->type == MBM_TYPE_TEXT)
        return print_text(plan, field, is_json, text, size);
    for (index = 0; index < count; index++) {
        const char *before = index > 0 ? "," : is_array ? "[" : "";
        char number[LONGEST_NUMBER];

        if (!print_number(plan, &fields->fields[field], planned, field, index, is_json, number))
            return 0;
        length += (size_t)snprintf(text + length, size - length, "%s%s", before, number);
        if (length + 2 > size)
            return 0;
    }
    if (is_array)
        strcpy(text + length, "]");
    return 1;
}
