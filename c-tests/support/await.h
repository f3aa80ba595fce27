/* Waiting for what another thread or process does. */
#ifndef AWAIT_H
#define AWAIT_H

#include "test.h"

#include <poll.h>

/* How long, in milliseconds: on a busy machine a thread may not run for seconds. A
 * test that finds what it waits for is as quick as ever. */
enum { PATIENCE_MS = 20000 };

/* Waits until what another thread brings about holds. What is never to come
 * cannot be waited for: a pause shows it, and a slow machine does no harm. */
#define AWAIT(condition)                                                                           \
    do {                                                                                           \
        int naps_ = 0;                                                                             \
                                                                                                   \
        while (!(condition)) {                                                                     \
            if (naps_++ == PATIENCE_MS)                                                            \
                fail_msg("this never came about: %s", #condition);                                 \
            poll(NULL, 0, 1);                                                                      \
        }                                                                                          \
    } while (0)

#endif
