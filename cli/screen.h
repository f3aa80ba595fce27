/* The terminal as a screen of its own: another page of it, keys without Enter, its size. Whatever
 * ends the program, except SIGKILL, the terminal is as it was before.
 *
 * Escapes of every terminal since the VT100 are enough for a table that is drawn as a whole; a
 * library such as ncurses would want the waiting for itself, which belongs to the line. */
#pragma once

#include <stddef.h>

/* Keys beside characters. */
enum {
    SCREEN_UP = 0x100,
    SCREEN_DOWN,
    SCREEN_PAGE_UP,
    SCREEN_PAGE_DOWN,
    SCREEN_HOME,
    SCREEN_END,
    SCREEN_GONE /* the terminal was closed */
};

/* Returns NULL, or why there can be no screen: a clause. */
const char *screen_wrong(void);

/* Begin and end it. A program that was stopped by Ctrl-Z gets it back. */
int screen_begin(void);
void screen_end(void);

/* Returns the next key that was pressed, or 0. Does not wait: poll standard input. */
int screen_key(void);

/* Stops the program if Ctrl-Z was pressed. Returns whether the screen is to be drawn anew, since
 * its size has changed or the program went on. */
int screen_is_new(void);

void screen_size(int *rows, int *columns);

/* Draws lines from the top left on, and clears what is below them. Each but the last one ends with
 * SCREEN_NEXT, and has one column less than the screen. */
#define SCREEN_NEXT "\033[K\n"
void screen_draw(const char *text, size_t length);

/* --- texts in UTF-8 --- */

/* Returns how many columns a text takes. */
int screen_width(const char *text);

/* Returns how many bytes of a text fit into so many columns. */
size_t screen_fit(const char *text, int columns);
