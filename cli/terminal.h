/* The terminals of serial lines, which the tool opens for itself alone: two programs that read one
 * terminal each get a part of its bytes. */
#pragma once

#include "place.h"

/* Open the terminal of a serial place, for this program alone unless the place is shared. A program
 * that has it open without a lock, such as cat, counts too. terminal_open returns as
 * mbm_tty_openWith, terminal_connect as mbm_tty_connect; both with EBUSY if another one has it. */
int terminal_open(mbm_tty *tty, const place *where);
uint8_t terminal_connect(mbm_tty *tty, const place *where);

/* Opens a pseudo terminal to others again, if the program that had it for itself was killed. `fd`
 * is a descriptor of it, which keeps the mark of that program. */
void terminal_free(int fd);

/* An error number of a place in words. EBUSY of a terminal names the program that has it. */
const char *terminal_error_text(const place *where, int error);
