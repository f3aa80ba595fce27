/* Writes values, names and statuses of polled fields. */
#include "polled.h"

#include "clock.h"
#include "report.h"
#include "screen.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
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

/* --- following values --- */

int followed_begin(followed *f, polled *of)
{
    const uint16_t count = of->meter.readable;
    uint16_t i, j;

    f->of = of;
    f->unit_count = 0;
    f->fields = (followed_field *)calloc(count, sizeof *f->fields);
    f->units = (followed_unit *)calloc(count, sizeof *f->units);
    f->leaders = (uint16_t *)calloc(count, sizeof *f->leaders);
    if (!f->fields || !f->units || !f->leaders)
        return -1;
    for (i = 0; i < count; i++) {
        for (j = 0; j < f->unit_count && f->units[j].unit != of->meter.planned[i].unit; j++)
            ;
        f->units[j].unit = (uint8_t)of->meter.planned[i].unit;
        if (j == f->unit_count)
            f->unit_count++;
    }
    return 0;
}

void followed_end(followed *f)
{
    uint16_t i;

    for (i = 0; f->fields && i < f->of->meter.readable; i++)
        free(f->fields[i].text);
    free(f->fields);
    free(f->units);
    free(f->leaders);
    memset(f, 0, sizeof *f);
}

/* --- units --- */

/* Finds the read that has a field. Returns 0 if the plan has none. */
static int find_read(const followed *f, uint16_t field, uint16_t *index)
{
    const mbm_planField *planned = &f->of->meter.planned[field];
    mbm_planReadInfo read;

    for (*index = 0; mbm_plan_getRead(&f->of->plan, *index, &read) == MBM_OK; (*index)++)
        if (read.unit == planned->unit && read.table == planned->table &&
            read.intervalMs == planned->intervalMs && planned->address >= read.address &&
            planned->address - read.address < read.quantity)
            return 1;
    return 0;
}

/* Whether the end of a read is counted with this field: its first one. If the plan has been made
 * anew, the leader may be of another read. */
static int is_leader(followed *f, uint16_t field)
{
    uint16_t read, other;

    if (!find_read(f, field, &read) || read >= f->of->meter.readable)
        return 0;
    if (f->leaders[read] == 0 || !find_read(f, (uint16_t)(f->leaders[read] - 1), &other) ||
        other != read)
        f->leaders[read] = (uint16_t)(field + 1);
    return f->leaders[read] == field + 1;
}

static void count_read(followed *f, uint16_t field, uint8_t status)
{
    followed_unit *unit = f->units;

    while (unit->unit != f->of->meter.planned[field].unit)
        unit++;
    unit->reads++;
    switch (report_code_of(status, polled_exception(status))) {
    case CODE_NO_REPLY: unit->no_reply++; break;
    case CODE_EXCEPTION: unit->exceptions++; break;
    case CODE_DAMAGED: unit->damaged++; break;
    case CODE_LINE: unit->link++; break;
    default: break;
    }
}

uint32_t followed_failures(const followed_unit *unit)
{
    return unit->no_reply + unit->exceptions + unit->damaged + unit->link;
}

static size_t add_count(char *text, size_t length, uint32_t count, const char *one,
                        const char *more)
{
    if (count == 0)
        return length;
    return length + (size_t)snprintf(text + length, FOLLOWED_UNIT_BYTES - length, ", %u %s",
                                     (unsigned)count, count == 1 ? one : more);
}

const char *followed_unit_text(const followed_unit *unit, char text[FOLLOWED_UNIT_BYTES])
{
    size_t length = (size_t)snprintf(text, FOLLOWED_UNIT_BYTES, "unit %u: %u read%s", unit->unit,
                                     (unsigned)unit->reads, unit->reads == 1 ? "" : "s");

    length = add_count(text, length, unit->no_reply, "without reply", "without reply");
    length = add_count(text, length, unit->exceptions, "exception", "exceptions");
    length = add_count(text, length, unit->damaged, "damaged reply", "damaged replies");
    (void)add_count(text, length, unit->link, "without link", "without link");
    return text;
}

/* --- values --- */

/* Reads the number that a field has now. An enumeration, a bit and several values have none. */
static int read_number(const followed *f, uint16_t field, long double *number,
                       char text[FOLLOWED_NUMBER_BYTES])
{
    static char value[DEVICE_TEXT_LONGEST];
    const device *meter = &f->of->meter;
    char *end;

    if (meter->fields[field].label_count > 0 ||
        !device_plan_text(&f->of->plan, meter, field, 1, "", value) ||
        !strchr("-0123456789", value[0]) || strlen(value) >= FOLLOWED_NUMBER_BYTES)
        return 0;
    *number = strtold(value, &end);
    strcpy(text, value);
    return *end == '\0';
}

/* Notes a number for minimum and maximum. Returns in which direction it has moved. */
static int note_number(followed *f, uint16_t field)
{
    followed_field *one = &f->fields[field];
    char text[FOLLOWED_NUMBER_BYTES];
    long double number;
    int direction = 0;

    if (!read_number(f, field, &number, text))
        return 0;
    if (one->has_number)
        direction = number > one->number ? 1 : number < one->number ? -1 : 0;
    if (!one->has_number || number < one->least) {
        one->least = number;
        strcpy(one->least_text, text);
    }
    if (!one->has_number || number > one->most) {
        one->most = number;
        strcpy(one->most_text, text);
    }
    one->number = number;
    one->has_number = 1;
    return direction;
}

void followed_note(followed *f, uint16_t field)
{
    static char value[POLLED_VALUE_BYTES];
    followed_field *one = &f->fields[field];
    const uint8_t status = mbm_plan_getStatus(&f->of->plan, field, NULL);
    int direction, has_value;
    char *copy;

    if (status == MBM_CANCELLED)
        return;
    if (is_leader(f, field))
        count_read(f, field, status);
    /* A value stays when its read fails. */
    has_value = polled_value(f->of, field, value);
    if (one->text ? strcmp(one->text, value) == 0 : !has_value)
        return;
    copy = strdup(value);
    if (!copy)
        return;
    direction = note_number(f, field);
    if (one->text) {
        one->changed_at = clock_milliseconds();
        one->direction = direction;
    }
    free(one->text);
    one->text = copy;
}

void followed_forget(followed *f)
{
    uint16_t i;

    for (i = 0; i < f->of->meter.readable; i++) {
        f->fields[i].has_number = 0;
        (void)note_number(f, i);
    }
}
