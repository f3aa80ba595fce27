/* Numbers, times and words as people type them, read strictly.
 *
 * Each function returns NULL, or what is wrong with the text, as say makes it: a sentence without
 * its full stop, which begins with the text in quotes. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* Formats a sentence, in a buffer that the fourth next call overwrites. */
const char *say(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* A whole decimal number: digits, after a minus if `least` is negative. */
const char *number_read(const char *text, int64_t least, int64_t most, int64_t *number);

/* A time: a whole decimal number and ms, s, m or h. In milliseconds. */
const char *number_time(const char *text, uint32_t least, uint32_t most, uint32_t *milliseconds);

/* One of several words, whose list ends with NULL. `index` receives its place in the list. */
const char *number_word(const char *text, const char *const *words, int *index);

/* One of the words no, yes, false and true. */
const char *number_answer(const char *text, uint8_t *is_yes);

/* Hexadecimal bytes: pairs of digits, without or with spaces between them. Appends them to `bytes`,
 * which has `*count` of `capacity`. */
const char *number_hex(const char *text, uint8_t *bytes, size_t capacity, size_t *count);

/* Writes a time as number_time reads it. Returns `text`. */
const char *number_time_text(uint32_t milliseconds, char text[32]);

/* --- bytes that are read one after the other: what numbers and JSON share --- */

/* The bytes that have not been read yet. */
typedef struct cursor {
    const char *at, *end;
} cursor;

int cursor_is_digit(const cursor *in);

/* Returns 0 if the next byte is another one. */
int cursor_skip_char(cursor *in, char one);

/* Skips a number as JSON has it (RFC 8259, 6). Returns 0 if there is none. */
int cursor_skip_number(cursor *in);
