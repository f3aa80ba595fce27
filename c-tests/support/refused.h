/* Checks of calls that are refused. */
#ifndef REFUSED_H
#define REFUSED_H

#include "test.h"

#include <string.h>
#include <valgrind/memcheck.h>

/* Asserts that a call returns a status and leaves an object as it was, byte for byte. The
 * padding of an object may never have been written, and valgrind would report that it is
 * compared. */
#define REFUSED(status, object, call) UNCHANGED(object, IS(status, call))
#define UNCHANGED(object, calls)                                                                   \
    do {                                                                                           \
        (void)VALGRIND_MAKE_MEM_DEFINED(&(object), sizeof(object));                                \
        memcpy(before, &(object), sizeof(object));                                                 \
        calls;                                                                                     \
        assert_memory_equal(before, &(object), sizeof(object));                                    \
    } while (0)

#define INVALID(object, call) REFUSED(MBM_INVALID_ARGUMENT, object, call)

/* Makes calls while a variable has another value. */
#define WITH(variable, value, calls)                                                               \
    do {                                                                                           \
        const __typeof__(variable) kept = (variable);                                              \
                                                                                                   \
        (variable) = (value);                                                                      \
        calls;                                                                                     \
        (variable) = kept;                                                                         \
    } while (0)

/* Asserts that a setting of an object accepts `most` and refuses the next value. */
#define RANGE(object, most, set)                                                                   \
    do {                                                                                           \
        OK(set(&(object), most));                                                                  \
        INVALID(object, set(&(object), (most) + 1));                                               \
    } while (0)

static uint8_t before[32768];

#endif
