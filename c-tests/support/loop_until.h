/* Waits in a loop of ports/linux. */
#ifndef LOOP_UNTIL_H
#define LOOP_UNTIL_H

#include "mbm_loop.h"
#include "test.h"

/* Lets a loop wait until a condition holds. */
#define UNTIL(loop, condition)                                                                     \
    do {                                                                                           \
        while (!(condition))                                                                       \
            assert_true(mbm_loop_wait((loop), MBM_LOOP_FOREVER) >= 0);                             \
    } while (0)

#endif
