/* The receive ring: one thread puts bytes in, another takes them out. */
#include "mbm.h"
#include "test.h"

#include <pthread.h>
#include <sched.h>
#include <string.h>

enum { BYTES = 200000 };

TEST(a_ring_returns_bytes_in_order)
{
    static mbm_ring ring;
    uint8_t storage[8], taken[8];

    OK(mbm_ring_begin(&ring, storage, sizeof storage));
    assert_int_equal(mbm_ring_put(&ring, 'a'), 1);
    assert_int_equal(mbm_ring_write(&ring, (const uint8_t *)"bcd", 3), 3);
    assert_int_equal(mbm_ring_available(&ring), 4);
    assert_int_equal(mbm_ring_read(&ring, taken, 3), 3);
    assert_memory_equal(taken, "abc", 3);
    assert_int_equal(mbm_ring_read(&ring, taken, sizeof taken), 1);
    assert_int_equal(mbm_ring_read(&ring, taken, sizeof taken), 0);
}

TEST(bytes_beyond_the_capacity_are_counted_and_no_others_are_lost)
{
    static mbm_ring ring;
    uint8_t storage[4], taken[8];

    OK(mbm_ring_begin(&ring, storage, sizeof storage));
    assert_int_equal(mbm_ring_write(&ring, (const uint8_t *)"abcde", 5), 3);
    assert_int_equal(mbm_ring_put(&ring, 'f'), 0);
    assert_int_equal(mbm_ring_lost(&ring), 3);
    assert_int_equal(mbm_ring_read(&ring, taken, sizeof taken), 3);
    assert_memory_equal(taken, "abc", 3);
    mbm_ring_put(&ring, 'g');
    assert_int_equal(mbm_ring_read(&ring, taken, sizeof taken), 1);
    assert_int_equal(taken[0], 'g');
    assert_int_equal(mbm_ring_available(&ring), 0);
}

TEST(a_ring_that_was_never_begun_accepts_and_returns_nothing)
{
    static mbm_ring zeroed;
    mbm_ring *rings[2];
    uint8_t byte = 0;

    rings[0] = NULL;
    rings[1] = &zeroed;
    for (unsigned i = 0; i < COUNT(rings); i++) {
        assert_int_equal(mbm_ring_put(rings[i], 1), 0);
        assert_int_equal(mbm_ring_write(rings[i], &byte, 1), 0);
        assert_int_equal(mbm_ring_read(rings[i], &byte, 1), 0);
        assert_int_equal(mbm_ring_available(rings[i]), 0);
        assert_int_equal(mbm_ring_lost(rings[i]), 0);
    }
}

TEST(begin_refuses_bad_arguments)
{
    static mbm_ring ring;
    uint8_t storage[4];

    IS(MBM_INVALID_ARGUMENT, mbm_ring_begin(NULL, storage, sizeof storage));
    IS(MBM_INVALID_ARGUMENT, mbm_ring_begin(&ring, NULL, 4));
    IS(MBM_INVALID_ARGUMENT, mbm_ring_begin(&ring, storage, 1));
    assert_int_equal(mbm_ring_put(&ring, 1), 0);
    OK(mbm_ring_begin(&ring, storage, sizeof storage));
    assert_int_equal(mbm_ring_write(&ring, NULL, 0), 0);
    assert_int_equal(mbm_ring_read(&ring, NULL, 0), 0);
}

static void *put_all(void *context)
{
    mbm_ring *ring = context;

    for (uint32_t number = 0; number < BYTES; number++)
        while (!mbm_ring_put(ring, (uint8_t)(number * 7)))
            sched_yield();
    return NULL;
}

TEST(one_thread_may_put_while_another_takes)
{
    static mbm_ring ring;
    uint8_t storage[33], taken[9];
    uint32_t expected = 0;
    pthread_t thread;

    OK(mbm_ring_begin(&ring, storage, sizeof storage));
    assert_int_equal(pthread_create(&thread, NULL, put_all, &ring), 0);
    while (expected < BYTES) {
        uint16_t i, count = mbm_ring_read(&ring, taken, sizeof taken);

        for (i = 0; i < count; i++, expected++)
            if (taken[i] != (uint8_t)(expected * 7))
                fail_msg("byte %u is %u", expected, taken[i]);
        if (count == 0)
            sched_yield();
    }
    pthread_join(thread, NULL);
    assert_int_equal(mbm_ring_available(&ring), 0);
}
