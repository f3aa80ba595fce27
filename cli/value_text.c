#define _GNU_SOURCE
#include "value_text.h"

#include <stdio.h>
#include <string.h>

/* Writes one value of a field. Returns 0 if none has arrived yet. */
static int print_one(const mbm_plan *plan, const device *of, uint16_t field, uint16_t index,
                     int is_json, char text[VALUE_TEXT_BYTES])
{
    const mbm_planField *planned = &of->planned[field];
    mbm_registers registers;
    uint16_t bit, size;
    int64_t integer;

    if (planned->type == MBM_TYPE_BIT) {
        if (mbm_plan_getInteger(plan, field, index, &integer) != MBM_OK)
            return 0;
        if (planned->count > 1 && device_is_part(planned)) {
            snprintf(text, VALUE_TEXT_BYTES, "%d", (int)integer);
            return 1;
        }
        bit = (uint16_t)integer;
        (void)mbm_registers_ofWords(&registers, &bit, 1, 0);
        value_print(&of->fields[field].form, &registers, 0, 1, is_json, text);
        return 1;
    }
    if (mbm_plan_getRegisters(plan, field, &registers) != MBM_OK)
        return 0;
    size = value_registers(planned->type, planned->count);
    value_print(&of->fields[field].form, &registers, (uint16_t)(planned->address + index * size),
                planned->count, is_json, text);
    return 1;
}

uint16_t value_count(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_TEXT || device_is_part(planned) ? 1 : planned->count;
}

const char *value_name(const mbm_plan *plan, const device *of, uint16_t field, uint16_t index)
{
    const mbm_planField *planned = &of->planned[field];
    const uint16_t size = value_registers(planned->type, 1);
    uint16_t words[VALUE_WORDS] = {0}, i;
    mbm_registers registers;
    int64_t integer;

    if (of->fields[field].label_count == 0)
        return NULL;
    if (planned->type == MBM_TYPE_BIT) {
        if (mbm_plan_getInteger(plan, field, index, &integer) != MBM_OK)
            return NULL;
        words[0] = (uint16_t)integer;
    } else {
        if (mbm_plan_getRegisters(plan, field, &registers) != MBM_OK)
            return NULL;
        for (i = 0; i < size; i++)
            (void)mbm_registers_getUint16(&registers,
                                          (uint16_t)(planned->address + index * size + i),
                                          MBM_ORDER_ABCD, &words[i]);
    }
    return device_label_of(of, field, words);
}

int value_text(const mbm_plan *plan, const device *of, uint16_t field, int is_json,
               char text[VALUE_TEXT_LONGEST])
{
    const uint16_t count = value_count(&of->planned[field]);
    const int is_array = is_json && count > 1;
    size_t length = 0;
    uint16_t index;

    for (index = 0; index < count; index++) {
        const char *before = index > 0 ? "," : is_array ? "[" : "";
        char one[VALUE_TEXT_BYTES];

        if (!print_one(plan, of, field, index, is_json, one))
            return 0;
        length += (size_t)snprintf(text + length, VALUE_TEXT_LONGEST - length, "%s%s", before, one);
    }
    if (is_array)
        strcpy(text + length, "]");
    return 1;
}
