/* Skips a test where the machine cannot play it. */
#ifndef SKIP_H
#define SKIP_H

#include "test.h"

#include <valgrind/valgrind.h>

/* For tests of a shortage of descriptors. Under valgrind a limit binds neither the test nor a
 * program that it starts. */
#define SKIP_WITHOUT_LIMITS()                                                                      \
    do {                                                                                           \
        if (RUNNING_ON_VALGRIND)                                                                   \
            skip();                                                                                \
    } while (0)

/* For tests that need a system call which QEMU's user mode lacks: it fills in nothing of TCP_INFO,
 * and knows no other rates than those of termios, no TIOCEXCL and no RS-485. `make test-aarch64`
 * sets MBM_EMULATOR. */
#define SKIP_IF_EMULATED()                                                                         \
    do {                                                                                           \
        if (getenv("MBM_EMULATOR"))                                                                \
            skip();                                                                                \
    } while (0)

#endif
