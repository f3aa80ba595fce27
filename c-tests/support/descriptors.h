/* Tests of a shortage of descriptors. Valgrind keeps a limit to itself: neither the test
 * nor a program that it starts is bound by it, so there is nothing to test. */
#ifndef DESCRIPTORS_H
#define DESCRIPTORS_H

#include "test.h"

#include <valgrind/valgrind.h>

#define SKIP_WITHOUT_LIMITS()                                                                      \
    do {                                                                                           \
        if (RUNNING_ON_VALGRIND)                                                                   \
            skip();                                                                                \
    } while (0)

#endif
