/* For calls from within hooks that must change nothing. */
#ifndef UNCHANGED_H
#define UNCHANGED_H

#include "test.h"

#include <string.h>

/* How often a hook has made its calls. */
static unsigned entered;

/* Asserts that the calls leave the object as it was. */
#define UNCHANGED_BY(object, calls)                                                                \
    do {                                                                                           \
        static uint8_t before[sizeof(object)];                                                     \
        memcpy(before, &(object), sizeof(object));                                                 \
        calls;                                                                                     \
        assert_memory_equal(before, &(object), sizeof(object));                                    \
        entered++;                                                                                 \
    } while (0)

#endif
