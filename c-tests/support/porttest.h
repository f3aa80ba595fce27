/* The test kit for ports in cmocka. */
#ifndef PORTTEST_H
#define PORTTEST_H

#include "mbm_porttest.h"
#include "test.h"

/* Prints a finding. */
static inline void porttest_say(void *context, mbm_portFinding kind, const char *sentence)
{
    (void)context;
    print_message("%s: %s\n", mbm_portFinding_name(kind), sentence);
}

/* Runs the test of a port that has no fault. */
static inline void porttest_passes(mbm_portTest *test)
{
    assert_int_equal(mbm_portTest_run(test), 0);
    assert_int_equal(test->wrong, 0);
}

/* The test of a connection: its near end and its far end. `begin` connects them again, and
 * `hang_up` closes the far end. */
static inline mbm_portTest porttest_connection(const mbm_port *near_end, const mbm_port *far_end,
                                               uint8_t (*begin)(void *), void (*hang_up)(void *))
{
    return (mbm_portTest){.port = near_end,
                          .other = far_end,
                          .begin = begin,
                          .hangUp = hang_up,
                          .say = porttest_say,
                          .holds = 256};
}

#endif
