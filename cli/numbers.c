/* Reads numbers, times and words, and says what is wrong with them. */
#include "numbers.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

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

/* --- words --- */

enum {
    MANY_WORDS = 30, /* a sentence lists at most 30 words; of more words it lists the nearest */
    NEAREST = 4,
    FIRST = 10,
    LONGEST_WORD = 40
};

static size_t least_of(size_t a, size_t b, size_t c)
{
    const size_t less = a < b ? a : b;

    return less < c ? less : c;
}

/* A capital is the same letter. */
static int is_same_letter(char one, char other)
{
    return tolower((unsigned char)one) == tolower((unsigned char)other);
}

/* How many letters must be written, left out or changed to make one word of the other. */
static size_t distance(const char *one, const char *other)
{
    size_t row[LONGEST_WORD + 1], i, j;
    const size_t columns = strlen(other);

    if (columns > LONGEST_WORD)
        return SIZE_MAX;
    for (j = 0; j <= columns; j++)
        row[j] = j;
    for (i = 1; one[i - 1]; i++) {
        size_t diagonal = row[0];

        row[0] = i;
        for (j = 1; j <= columns; j++) {
            const size_t above = row[j];
            const size_t changed = is_same_letter(one[i - 1], other[j - 1]) ? 0 : 1;

            row[j] = least_of(above + 1, row[j - 1] + 1, diagonal + changed);
            diagonal = above;
        }
    }
    return row[columns];
}

/* Appends words of a list with commas between them: those at the places in `chosen`, or the first.
 */
static void list_words(char *list, size_t capacity, const char *const *words, const int *chosen,
                       int count)
{
    size_t length = 0;
    int i;

    for (i = 0; i < count && length < capacity; i++)
        length += (size_t)snprintf(list + length, capacity - length, "%s%s",
                                   i == 0          ? ""
                                   : i + 1 < count ? ", "
                                                   : " and ",
                                   words[chosen ? chosen[i] : i]);
}

/* Finds the words that a wrong one may have been meant for, the nearest first. */
static int find_near(const char *text, const char *const *words, int chosen[NEAREST])
{
    size_t at[NEAREST];
    int i, j, count = 0;

    for (i = 0; words[i]; i++) {
        const int is_beginning = strncasecmp(text, words[i], strlen(text)) == 0;
        const size_t far = is_beginning ? 0 : distance(text, words[i]);

        if (far > strlen(text) / 2)
            continue;
        for (j = count; j > 0 && far < at[j - 1]; j--)
            if (j < NEAREST) {
                at[j] = at[j - 1];
                chosen[j] = chosen[j - 1];
            }
        if (j < NEAREST) {
            at[j] = far;
            chosen[j] = i;
            count += count < NEAREST;
        }
    }
    return count;
}

const char *number_word(const char *text, const char *const *words, int *index)
{
    char list[1200] = "";
    int near[NEAREST], count, found;

    for (count = 0; words[count]; count++)
        if (strcmp(text, words[count]) == 0) {
            *index = count;
            return NULL;
        }
    /* Completion asks for all words by an empty one. */
    if (count <= MANY_WORDS || !*text) {
        list_words(list, sizeof list, words, NULL, count);
        return say("\"%.60s\" is not one of %s", text, list);
    }
    found = strlen(text) > LONGEST_WORD ? 0 : find_near(text, words, near);
    list_words(list, sizeof list, words, found > 0 ? near : NULL, found > 0 ? found : FIRST);
    return say("\"%.60s\" is not one of the %d words in docs/device-file.md: %s %s", text, count,
               found == 0   ? "among them are"
               : found == 1 ? "the nearest is"
                            : "the nearest are",
               list);
}

const char *number_answer(const char *text, uint8_t *is_yes)
{
    static const char *const ANSWERS[] = {"no", "yes", "false", "true", NULL};
    int index;
    const char *wrong = number_word(text, ANSWERS, &index);

    if (!wrong)
        *is_yes = index & 1;
    return wrong;
}

/* --- bytes --- */

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
