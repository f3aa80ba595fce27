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

/* Returns 0 if the next byte is another one. */
int cursor_skip_char(cursor *in, char one);

/* Skips a number as JSON has it (RFC 8259, 6). Returns 0 if there is none. */
int cursor_skip_number(cursor *in);

#endif
