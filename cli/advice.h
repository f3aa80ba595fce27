/* What to look at after a failure, in sentences without their full stop. The texts are in buffers
 * that later calls overwrite; they are empty if nothing helps. */
#pragma once

#include "place.h"

/* What a request was made from. */
enum {
    ADVICE_READ,  /* ADDRESS and COUNT of the command line */
    ADVICE_WRITE, /* ADDRESS and VALUE of the command line */
    ADVICE_FILE,  /* a field of a device file */
    ADVICE_CALL,  /* HEX of the command line */
    ADVICE_DEVICE /* nothing that the user has written: scan, identify */
};

/* After a request that ended with a status. `why` says what came in place of a reply, or is NULL.
 */
const char *advice_on(const place *where, int about, uint8_t status, uint8_t exception,
                      const char *why);

/* After requests that nobody answered, and after damaged replies, on a line that serves several
 * units. */
const char *advice_silent(const place *where);
const char *advice_damaged(const place *where);

/* Keeps the words of the command line for advice_on, which repeats them with another ADDRESS. */
void advice_keep(int argc, char **argv, const char *address_text);

/* Manuals write 40101 for the holding register with address 100, 30101 for such an input register
 * and 10101 for such a discrete input; with six digits 400101, 300101 and 100101. Sets the address
 * of such a number and returns its table, or 0 if it is none for a field of `table`. */
uint8_t advice_manual(uint8_t table, uint32_t number, uint16_t *address);

/* Explains an ADDRESS that is such a number, with the command to use; or returns an empty text. */
const char *advice_on_number(uint32_t number);
