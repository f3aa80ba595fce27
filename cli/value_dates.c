/* Reads and writes dates as text, and converts them to the forms that registers have. */
#include "value.h"

#include "numbers.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* From 1970-01-01 to 2000-01-01. */
static const int64_t SECONDS_TO_2000 = 946684800;

/* What a text of a date has: a day and a time, or only one of them. */
typedef enum extent { MOMENT, DAY, TIME } extent;

static int is_seconds(uint8_t type)
{
    return type >= VALUE_UNIX32 && type <= VALUE_SECONDS_2000;
}

static int is_bcd(uint8_t type)
{
    return type >= VALUE_DATE_BCD_OF_1;
}

static extent extent_of(const value_form *form)
{
    if (form->type < VALUE_DATE_OF_1)
        return MOMENT;
    return !strchr(form->layout, 'M') ? TIME : strchr(form->layout, 'h') ? MOMENT : DAY;
}

static int has_milliseconds(const value_form *form)
{
    return form->type == VALUE_UNIX64_MS || form->type == VALUE_IEC870 ||
           (form->type >= VALUE_DATE_OF_1 && strchr(form->layout, 'f'));
}

/* --- time zones and layouts --- */

/* Takes two digits. Returns 0 if there are none. */
static int take_two(cursor *in, unsigned *number)
{
    const char *at = in->at;

    if (in->end - at < 2 || at[0] < '0' || at[0] > '9' || at[1] < '0' || at[1] > '9')
        return 0;
    *number = (unsigned)((at[0] - '0') * 10 + at[1] - '0');
    in->at += 2;
    return 1;
}

/* Takes Z, or an offset such as +01:00, +0100 or +01. */
static int take_zone(cursor *in, int16_t *minutes)
{
    unsigned hours, rest = 0;
    int is_west;

    *minutes = 0;
    if (cursor_skip_char(in, 'Z') || cursor_skip_char(in, 'z'))
        return 1;
    is_west = cursor_skip_char(in, '-');
    if (!is_west && !cursor_skip_char(in, '+'))
        return 0;
    if (!take_two(in, &hours))
        return 0;
    if (in->at < in->end) {
        (void)cursor_skip_char(in, ':');
        if (!take_two(in, &rest))
            return 0;
    }
    if (rest > 59 || hours * 60 + rest > VALUE_ZONE_MOST)
        return 0;
    *minutes = (int16_t)(hours * 60 + rest);
    if (is_west)
        *minutes = (int16_t) - *minutes;
    return 1;
}

int value_zone_read(const char *text, int16_t *minutes)
{
    cursor in = {text, text + strlen(text)};

    return take_zone(&in, minutes) && in.at == in.end;
}

const char *value_layout_check(const char *layout, uint8_t *registers)
{
    uint16_t words[VALUE_DATE_REGISTERS] = {0};
    const char *at;
    mbm_registers view;
    mbm_date date;
    unsigned count = 1;

    for (at = layout; *at; at++)
        count += *at == ' ';
    (void)mbm_registers_ofWords(&view, words, VALUE_DATE_REGISTERS, 0);
    if (count > VALUE_DATE_REGISTERS)
        return say("\"%s\" has %u registers: a date has at most %d", layout, count,
                   VALUE_DATE_REGISTERS);
    if (mbm_registers_getDate(&view, 0, MBM_ORDER_ABCD, layout, 0, &date) == MBM_INVALID_ARGUMENT)
        return say("\"%s\" is no layout of a date, such as \"Y M D h m s\" for six registers, or "
                   "\"yM Dh ms\" for three with two parts each",
                   layout);
    *registers = (uint8_t)count;
    return NULL;
}

/* --- from registers to text --- */

/* The date that so many seconds, or milliseconds, after 1970 are. */
static uint8_t date_of_seconds(int64_t seconds, uint8_t type, mbm_date *date)
{
    int64_t rest = 0;
    uint8_t status;

    if (type == VALUE_UNIX64_MS) {
        rest = seconds % 1000;
        seconds = seconds / 1000 - (rest < 0);
        rest += rest < 0 ? 1000 : 0;
    }
    status = mbm_date_setSeconds(date, &seconds);
    date->millisecond = (uint16_t)rest;
    return status == MBM_OK ? MBM_OK : MBM_MALFORMED_VALUE;
}

static uint8_t get_date(const value_form *form, const mbm_registers *registers, uint16_t address,
                        mbm_date *date)
{
    uint32_t two = 0;
    int64_t seconds = 0;

    memset(date, 0, sizeof *date);
    switch (form->type) {
    case VALUE_UNIX32:
    case VALUE_SECONDS_2000:
        (void)mbm_registers_getUint32(registers, address, form->order, &two);
        return date_of_seconds(
            two + (form->type == VALUE_SECONDS_2000 ? SECONDS_TO_2000 : INT64_C(0)), form->type,
            date);
    case VALUE_UNIX64:
    case VALUE_UNIX64_MS:
        (void)mbm_registers_getUint64(registers, address, form->order, (uint64_t *)&seconds);
        return date_of_seconds(seconds, form->type, date);
    case VALUE_IEC870:
    case VALUE_IEC870_3:
        return mbm_registers_getIecDate(registers, address, value_registers(form->type, 1),
                                        form->order, date);
    default:
        return mbm_registers_getDate(registers, address, form->order, form->layout,
                                     (uint8_t)is_bcd(form->type), date);
    }
}

uint8_t value_date_print(const value_form *form, const mbm_registers *registers, uint16_t address,
                         char text[VALUE_DATE_BYTES])
{
    const extent has = extent_of(form);
    char *const end = text + VALUE_DATE_BYTES, *at = text;
    mbm_date date;
    const uint8_t status = get_date(form, registers, address, &date);
    int minutes = form->zone;

    if (status != MBM_OK)
        return status;
    if (date.flags & MBM_DATE_SUMMER_TIME)
        minutes += 60;
    if (has != TIME)
        at += snprintf(at, (size_t)(end - at), "%04u-%02u-%02u", date.year, date.month, date.day);
    if (has == MOMENT)
        *at++ = 'T';
    if (has != DAY)
        at +=
            snprintf(at, (size_t)(end - at), "%02u:%02u:%02u", date.hour, date.minute, date.second);
    if (has_milliseconds(form))
        at += snprintf(at, (size_t)(end - at), ".%03u", date.millisecond);
    if (has == MOMENT && minutes == 0)
        *at++ = 'Z';
    else if (has == MOMENT)
        at += snprintf(at, (size_t)(end - at), "%c%02d:%02d", minutes < 0 ? '-' : '+',
                       (minutes < 0 ? -minutes : minutes) / 60,
                       (minutes < 0 ? -minutes : minutes) % 60);
    *at = '\0';
    return MBM_OK;
}

/* --- from text to registers --- */

/* Takes a day, such as 2026-11-27. */
static int take_day(cursor *in, mbm_date *date)
{
    unsigned century, year, month, day;

    if (!take_two(in, &century) || !take_two(in, &year) || !cursor_skip_char(in, '-') ||
        !take_two(in, &month) || !cursor_skip_char(in, '-') || !take_two(in, &day))
        return 0;
    date->year = (uint16_t)(century * 100 + year);
    date->month = (uint8_t)month;
    date->day = (uint8_t)day;
    return 1;
}

/* Takes a time, such as 20:15, 20:15:30 or 20:15:30.125. */
static int take_time(cursor *in, mbm_date *date)
{
    unsigned hour, minute, second = 0, place = 1000;

    if (!take_two(in, &hour) || !cursor_skip_char(in, ':') || !take_two(in, &minute))
        return 0;
    if (cursor_skip_char(in, ':') && !take_two(in, &second))
        return 0;
    date->hour = (uint8_t)hour;
    date->minute = (uint8_t)minute;
    date->second = (uint8_t)second;
    if (!cursor_skip_char(in, '.'))
        return 1;
    if (!cursor_is_digit(in))
        return 0;
    for (; cursor_is_digit(in); in->at++) {
        place /= 10;
        /* What is less than a millisecond must be 0. */
        if (place == 0 && *in->at != '0')
            return 0;
        date->millisecond = (uint16_t)(date->millisecond + place * (unsigned)(*in->at - '0'));
    }
    return 1;
}

/* Whether there is such a day and such a time. */
static int exists(const mbm_date *date, extent has)
{
    mbm_date day = *date;
    int64_t seconds;

    if (has == TIME)
        day.year = day.month = day.day = 1;
    return mbm_date_getSeconds(&day, &seconds) == MBM_OK;
}

/* Takes a whole text apart. Returns NULL, or why it is refused. */
static const char *take(cursor in, extent has, mbm_date *date, int16_t *minutes)
{
    static const char *const EXAMPLES[] = {"is not a date and a time such as 2026-11-27T20:15:00Z",
                                           "is not a day such as 2026-11-27",
                                           "is not a time such as 20:15:00"};

    memset(date, 0, sizeof *date);
    *minutes = 0;
    if (has != TIME && !take_day(&in, date))
        return EXAMPLES[has];
    if (has == MOMENT && !cursor_skip_char(&in, 'T') && !cursor_skip_char(&in, 't') &&
        !cursor_skip_char(&in, ' '))
        return EXAMPLES[has];
    if (has != DAY && !take_time(&in, date))
        return EXAMPLES[has];
    if (has == MOMENT && in.at == in.end)
        return "has no time zone: Z, or such as +01:00";
    if ((has == MOMENT && !take_zone(&in, minutes)) || in.at != in.end)
        return EXAMPLES[has];
    return exists(date, has) ? NULL
           : has == TIME     ? "is no time of a day"
                             : "is a date that does not exist";
}

/* Moves a moment from one time zone to another. Returns 0 if no date is there. */
static int move(mbm_date *date, int minutes)
{
    const uint16_t millisecond = date->millisecond;
    int64_t seconds;

    if (mbm_date_getSeconds(date, &seconds) != MBM_OK)
        return 0;
    seconds += 60 * minutes;
    if (mbm_date_setSeconds(date, &seconds) != MBM_OK)
        return 0;
    date->millisecond = millisecond;
    return 1;
}

/* Sets seconds. Returns 0 if they are out of range. */
static int set_seconds(const value_form *form, const mbm_registers *registers, const mbm_date *date)
{
    uint64_t wide;
    int64_t seconds;

    (void)mbm_date_getSeconds(date, &seconds);
    if (form->type == VALUE_SECONDS_2000)
        seconds -= SECONDS_TO_2000;
    if (form->type == VALUE_UNIX64_MS)
        seconds = seconds * 1000 + date->millisecond;
    wide = (uint64_t)seconds;
    if (form->type == VALUE_UNIX64 || form->type == VALUE_UNIX64_MS)
        return mbm_registers_setUint64(registers, 0, form->order, &wide) == MBM_OK;
    return seconds >= 0 && seconds <= UINT32_MAX &&
           mbm_registers_setUint32(registers, 0, form->order, (uint32_t)seconds) == MBM_OK;
}

uint16_t value_date_read(const value_form *form, const char *text, size_t length,
                         uint16_t words[VALUE_WORDS], const char **wrong)
{
    const uint16_t count = value_registers(form->type, 1);
    const cursor in = {text, text + length};
    const extent has = extent_of(form);
    mbm_registers registers;
    mbm_date date;
    int16_t minutes;
    int is_set;

    *wrong = take(in, has, &date, &minutes);
    if (!*wrong && date.millisecond != 0 && !has_milliseconds(form))
        *wrong = "has milliseconds, for which the registers have no place";
    if (*wrong)
        return 0;
    (void)mbm_registers_intoWords(&registers, words, VALUE_WORDS, 0);
    is_set = has != MOMENT || move(&date, form->zone - minutes);
    if (is_set && is_seconds(form->type))
        is_set = set_seconds(form, &registers, &date);
    else if (is_set && form->type < VALUE_DATE_OF_1)
        is_set = mbm_registers_setIecDate(&registers, 0, count, form->order, &date) == MBM_OK;
    else if (is_set)
        is_set = mbm_registers_setDate(&registers, 0, form->order, form->layout,
                                       (uint8_t)is_bcd(form->type), &date) == MBM_OK;
    if (is_set)
        return count;
    *wrong = date.second != 0 &&
                     (form->type == VALUE_IEC870_3 || (form->layout && !strchr(form->layout, 's')))
                 ? "has seconds, for which the registers have no place"
                 : "is out of range";
    return 0;
}
