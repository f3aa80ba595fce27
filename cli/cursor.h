/* Bytes that are read one after the other: what numbers and JSON share.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef CURSOR_H
#define CURSOR_H

/* The bytes that have not been read yet. */
typedef struct cursor {
    const char *at, *end;
} cursor;

int cursor_is_digit(const cursor *in);

/* Each returns 0 if the next bytes are not what it skips. */
int cursor_skip_char(cursor *in, char one);
int cursor_skip_digits(cursor *in);

/* A number as JSON has it (RFC 8259, 6). */
int cursor_skip_number(cursor *in);

#endif
