/* For tests that need a system call which QEMU's user mode lacks: it fills in nothing of TCP_INFO,
 * and knows no other rates than those of termios, no TIOCEXCL and no RS-485. Such a test is skipped
 * there; `make test-aarch64` sets MBM_EMULATOR. */
#ifndef EMULATED_H
#define EMULATED_H

#include "test.h"

#include <stdlib.h>

#define SKIP_IF_EMULATED()                                                                         \
    do {                                                                                           \
        if (getenv("MBM_EMULATOR"))                                                                \
            skip();                                                                                \
    } while (0)

#endif
