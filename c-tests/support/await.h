/* Waits for what another thread or process does. */
#ifndef AWAIT_H
#define AWAIT_H

#include "test.h"

#include <poll.h>
#include <unistd.h>

/* The longest wait, in milliseconds. On a busy machine a thread may not run for seconds.
 * The wait ends as soon as the condition holds. */
enum { PATIENCE_MS = 20000 };

/* Waits until a condition holds that another thread or process brings about. Do not use it
 * for what must not happen: for that, make a pause. A slow machine cannot make such a check
 * fail. */
#define AWAIT(condition)                                                                           \
    do {                                                                                           \
        int naps_ = 0;                                                                             \
                                                                                                   \
        while (!(condition)) {                                                                     \
            if (naps_++ == PATIENCE_MS)                                                            \
                fail_msg("this did not happen in time: %s", #condition);                           \
            poll(NULL, 0, 1);                                                                      \
        }                                                                                          \
    } while (0)

/* Lets a loop of ports/linux wait until a condition holds. */
#define LOOP_UNTIL(loop, condition)                                                                \
    do {                                                                                           \
        while (!(condition))                                                                       \
            assert_true(mbm_loop_wait((loop), MBM_LOOP_FOREVER) >= 0);                             \
    } while (0)

/* Reads exactly `count` bytes from a descriptor, as they arrive. */
static inline void await_bytes(int fd, uint8_t *bytes, size_t count)
{
    struct pollfd readable = {fd, POLLIN, 0};

    while (count > 0) {
        ssize_t got;

        assert_int_equal(poll(&readable, 1, PATIENCE_MS), 1);
        got = read(fd, bytes, count);
        assert_true(got > 0);
        bytes += got;
        count -= (size_t)got;
    }
}

#endif
