/* For preparations of a test, in threads too, where cmocka's asserts do not work. */
#ifndef MUST_H
#define MUST_H

#include <stdio.h>
#include <stdlib.h>

/* Ends the program with the error of errno if a step of the preparations has failed. */
static inline void must(int ok, const char *step)
{
    if (!ok) {
        perror(step);
        abort();
    }
}

#endif
