/* For tests of a shortage of descriptors. Under valgrind a limit binds neither the test nor
 * a program that it starts, so such a test is skipped. */
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
