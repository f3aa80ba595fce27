/* Writes values, names and statuses of polled fields.
 *
 * Licence: MIT OR Apache-2.0. */
#include "polled.h"

#include "report.h"
#include "screen.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

int polled_name_width(const polled *p)
{
    int longest = 0;
    uint16_t i;

    for (i = 0; i < p->meter.readable; i++) {
        const int width = screen_width(p->meter.fields[i].name);

        if (width > longest)
            longest = width;
    }
    return longest < POLLED_LONGEST_NAME ? longest : POLLED_LONGEST_NAME;
}

uint16_t polled_read_count(polled *p)
{
    uint16_t i, right = 0;

    for (i = 0; i < p->meter.readable; i++) {
        const uint8_t code = device_plan_status(&p->plan, &p->meter, i, NULL);

        right = (uint16_t)(right + (code == MBM_OK || code == MBM_NOT_AVAILABLE));
    }
    return right;
}

uint8_t polled_exception(uint8_t status)
{
    return status < MBM_INVALID_SLAVE_ID ? status : 0;
}

const char *polled_status(polled *p, uint8_t status, char text[256])
{
    const char *reason = status == MBM_LINK_LOST ? line_reason(&p->at) : NULL;

    snprintf(text, 256, "%s%s%s", report_words(status, polled_exception(status)),
             reason ? ": " : "", reason ? reason : "");
    return text;
}

/* Appends the names of an enumeration, as far as they fit: " (off)", or " (off,on)" if there are
 * several values; "-" stands for a value without a name. Appends nothing if no value has a name. */
static void add_names(polled *p, uint16_t field, char *text, size_t capacity)
{
    const uint16_t count = device_values_in(&p->meter.planned[field]);
    size_t length = strlen(text);
    uint16_t i, named = 0;

    for (i = 0; i < count; i++)
        named = (uint16_t)(named + (device_plan_name(&p->plan, &p->meter, field, i) != NULL));
    for (i = 0; named > 0 && i < count && length < capacity; i++) {
        const char *name = device_plan_name(&p->plan, &p->meter, field, i);

        length += (size_t)snprintf(text + length, capacity - length, "%s%s%s", i == 0 ? " (" : ",",
                                   name ? name : "-", i + 1 == count ? ")" : "");
    }
}

int polled_value(polled *p, uint16_t field, char text[POLLED_VALUE_BYTES])
{
    const char *measure = p->meter.fields[field].unit_of_measurement;

    if (!device_plan_text(&p->plan, &p->meter, field, 0, "-", text)) {
        strcpy(text, "-");
        return 0;
    }
    /* A value that is not available has no unit. */
    if (text[strspn(text, "-,")] == '\0')
        return 1;
    if (measure)
        snprintf(text + strlen(text), DEVICE_NAME_BYTES + 2, " %s", measure);
    add_names(p, field, text, POLLED_VALUE_BYTES);
    return 1;
}

/* The names of an enumeration for JSON: a text or null, or an array of these for several values. */
static cJSON *json_names(polled *p, uint16_t field)
{
    const uint16_t count = device_values_in(&p->meter.planned[field]);
    cJSON *array = count > 1 ? cJSON_CreateArray() : NULL, *one = NULL;
    uint16_t i;

    for (i = 0; i < count; i++) {
        const char *name = device_plan_name(&p->plan, &p->meter, field, i);

        one = name ? cJSON_CreateString(name) : cJSON_CreateNull();
        if (array)
            cJSON_AddItemToArray(array, one);
    }
    return array ? array : one;
}

void polled_add_json(polled *p, uint16_t field, cJSON *object)
{
    static char value[DEVICE_TEXT_LONGEST];
    const device_field *of = &p->meter.fields[field];
    char status[256];
    uint32_t ageMs;

    const uint8_t code = device_plan_status(&p->plan, &p->meter, field, &ageMs);

    cJSON_AddNumberToObject(object, "unit", p->meter.planned[field].unit);
    cJSON_AddStringToObject(object, "name", of->name);
    if (device_plan_text(&p->plan, &p->meter, field, 1, "", value))
        cJSON_AddRawToObject(object, "value", value);
    else
        cJSON_AddNullToObject(object, "value");
    if (of->label_count > 0)
        cJSON_AddItemToObject(object, "value_name", json_names(p, field));
    if (of->unit_of_measurement)
        cJSON_AddStringToObject(object, "unit_of_measurement", of->unit_of_measurement);
    if (ageMs != UINT32_MAX)
        cJSON_AddNumberToObject(object, "age_ms", ageMs);
    report_add_json(object, code, polled_exception(code), polled_status(p, code, status));
}
