/* Reads numbers, times and words, and says what is wrong with them.
 *
 * Licence: MIT OR Apache-2.0. */
#include "numbers.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const char *say(const char *format, ...)
{
    static char said[4][1700];
    static unsigned next;
    char *const text = said[next++ % 4];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof *said, format, arguments);
    va_end(arguments);
    return text;
}

/* Reads digits, and returns what follows them, or NULL if there is none. A number that is too large
 * becomes UINT64_MAX. */
static const char *digits(const char *text, uint64_t *number)
{
    const char *at = text;

    for (*number = 0; *at >= '0' && *at <= '9'; at++) {
        const unsigned digit = (unsigned)(*at - '0');

        *number = *number > (UINT64_MAX - digit) / 10 ? UINT64_MAX : *number * 10 + digit;
    }
    return at == text ? NULL : at;
}

const char *number_read(const char *text, int64_t least, int64_t most, int64_t *number)
{
    const int is_negative = least < 0 && *text == '-';
    uint64_t amount;
    const char *rest = digits(text + is_negative, &amount);
    int64_t value;

    if (!rest || *rest)
        return say("\"%.60s\" is not a whole decimal number, here from %" PRId64 " to %" PRId64,
                   text, least, most);
    value = amount > INT64_MAX ? INT64_MAX : (int64_t)amount;
    if (is_negative)
        value = -value;
    if (amount > INT64_MAX || value < least || value > most)
        return say("\"%.60s\" is out of range: from %" PRId64 " to %" PRId64 " is allowed", text,
                   least, most);
    *number = value;
    return NULL;
}

static const struct {
    const char *name;
    uint32_t milliseconds;
} units[] = {{"h", 3600000}, {"m", 60000}, {"s", 1000}, {"ms", 1}};

const char *number_time(const char *text, uint32_t least, uint32_t most, uint32_t *milliseconds)
{
    char from[32], to[32];
    uint64_t amount;
    const char *rest = digits(text, &amount);
    size_t i;

    for (i = 0; i < 4 && (!rest || strcmp(rest, units[i].name) != 0); i++) {
    }
    if (i == 4)
        return say(
            "\"%.60s\" is not a time: write a whole number and its unit, such as 500ms, 2s or 1m",
            text);
    if (amount > most || amount * units[i].milliseconds < least ||
        amount * units[i].milliseconds > most)
        return say("\"%.60s\" is out of range: from %s to %s is allowed", text,
                   number_time_text(least, from), number_time_text(most, to));
    *milliseconds = (uint32_t)amount * units[i].milliseconds;
    return NULL;
}

const char *number_time_text(uint32_t milliseconds, char text[32])
{
    size_t i = 0;

    while (i < 3 && (milliseconds == 0 || milliseconds % units[i].milliseconds != 0))
        i++;
    snprintf(text, 32, "%u%s", (unsigned)(milliseconds / units[i].milliseconds), units[i].name);
    return text;
}

const char *number_word(const char *text, const char *const *words, int *index)
{
    char list[1200] = "";
    size_t length = 0;
    int i;

    for (i = 0; words[i]; i++) {
        if (strcmp(text, words[i]) == 0) {
            *index = i;
            return NULL;
        }
        if (length < sizeof list)
            length += (size_t)snprintf(list + length, sizeof list - length, "%s%s",
                                       i == 0         ? ""
                                       : words[i + 1] ? ", "
                                                      : " and ",
                                       words[i]);
    }
    return say("\"%.60s\" is not one of %s", text, list);
}

const char *number_hex(const char *text, uint8_t *bytes, size_t capacity, size_t *count)
{
    const char *at = text;

    while (*at) {
        unsigned value;

        if (*at == ' ') {
            at++;
            continue;
        }
        if (!isxdigit((unsigned char)at[0]) || !isxdigit((unsigned char)at[1]))
            return say("\"%.60s\" is not hexadecimal bytes, pairs of digits such as 03 or 0A0B",
                       text);
        if (*count == capacity)
            return say("\"%.60s\" has more than %zu bytes with those before", text, capacity);
        (void)sscanf(at, "%2x", &value);
        bytes[(*count)++] = (uint8_t)value;
        at += 2;
    }
    return NULL;
}

/* --- bytes that are read one after the other --- */

int cursor_is_digit(const cursor *in)
{
    return in->at < in->end && *in->at >= '0' && *in->at <= '9';
}

int cursor_skip_char(cursor *in, char one)
{
    if (in->at == in->end || *in->at != one)
        return 0;
    in->at++;
    return 1;
}

static int skip_digits(cursor *in)
{
    if (!cursor_is_digit(in))
        return 0;
    while (cursor_is_digit(in))
        in->at++;
    return 1;
}

int cursor_skip_number(cursor *in)
{
    (void)cursor_skip_char(in, '-');
    if (!cursor_skip_char(in, '0') && !skip_digits(in))
        return 0;
    if (cursor_skip_char(in, '.') && !skip_digits(in))
        return 0;
    if (!cursor_skip_char(in, 'e') && !cursor_skip_char(in, 'E'))
        return 1;
    if (!cursor_skip_char(in, '-'))
        (void)cursor_skip_char(in, '+');
    return skip_digits(in);
}
