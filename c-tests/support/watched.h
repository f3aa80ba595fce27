/* Hooks around reads and writes that write down what they are called with. */
#ifndef WATCHED_H
#define WATCHED_H

#include "served.h"

typedef struct watched {
    /* Each call as a text: the hook (r before a read, w before a write, a after a write), the
     * unit, the function in hex, the first address and the quantity, and the data in hex. Before
     * the address of a record stands the file. "w17/10 104+2 00010002;" */
    char text[4000];
    size_t length;
    const void *connection;            /* that the last call came from */
    uint8_t refuse_read, refuse_write; /* what the hooks return */
    /* Unless NULL, called within each hook. */
    void (*within)(char hook, const mbm_access *access);
    mbm_accessHooks hooks;
} watched;

extern watched watching;

/* Zeroes `watching` but for its hooks, whose context is `watching`. */
void watched_reset(void);

/* Sets the hooks of the tables and the files of a server. */
void watched_set(served *s);

/* Fails unless these were the calls; then forgets them. */
void watched_were(const char *calls);

#endif
