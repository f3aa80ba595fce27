/* The receive ring: one thread puts bytes in, another takes them out. */
#include "refused.h"
#include "mbm.h"
#include "test.h"

#include <pthread.h>
#include <sched.h>

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

/* --- Each function of the ring is held to its comment in mbm.h: results, limits, NULL --- */

static mbm_ring ring;
static uint8_t storage[65535];

static void setup(void)
{
    memset(&ring, 0, sizeof ring);
}

TEST_WITH(a_ring_that_was_never_begun_is_empty_and_takes_nothing, setup, NULL)
{
    uint8_t bytes[4] = {1, 2, 3, 4};
    mbm_ring *rings[] = {&ring, NULL};

    for (unsigned i = 0; i < COUNT(rings); i++) {
        assert_int_equal(mbm_ring_put(rings[i], 1), 0);
        assert_int_equal(mbm_ring_write(rings[i], bytes, 4), 0);
        assert_int_equal(mbm_ring_read(rings[i], bytes, 4), 0);
        assert_int_equal(mbm_ring_available(rings[i]), 0);
        assert_int_equal(mbm_ring_lost(rings[i]), 0);
    }
    assert_int_equal(bytes[0], 1);
}

TEST_WITH(a_refused_call_changes_nothing, setup, NULL)
{
    uint8_t taken[8];

    INVALID(ring, mbm_ring_begin(&ring, NULL, 8));
    OK(mbm_ring_begin(&ring, storage, 8));
    assert_int_equal(mbm_ring_write(&ring, (const uint8_t *)"abcd", 4), 4);
    INVALID(ring, mbm_ring_begin(&ring, NULL, 8));
    INVALID(ring, mbm_ring_begin(&ring, storage, 1));
    INVALID(ring, mbm_ring_begin(&ring, storage, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_ring_begin(NULL, storage, 8));
    REFUSED(0, ring, mbm_ring_write(&ring, NULL, 4));
    REFUSED(0, ring, mbm_ring_read(&ring, NULL, 4));
    assert_int_equal(mbm_ring_read(&ring, taken, 8), 4);
    assert_memory_equal(taken, "abcd", 4);
}

TEST_WITH(a_ring_holds_one_byte_less_than_its_storage, setup, NULL)
{
    static const uint16_t sizes[] = {2, 3, 255, 256, 257, 65535};
    static uint8_t bytes[65535], back[65535];

    for (unsigned at = 0; at < sizeof bytes; at++)
        bytes[at] = (uint8_t)(7 * at);
    for (unsigned i = 0; i < COUNT(sizes); i++) {
        uint16_t holds = (uint16_t)(sizes[i] - 1);

        OK(mbm_ring_begin(&ring, storage, sizes[i]));
        assert_int_equal(mbm_ring_available(&ring), 0);
        assert_int_equal(mbm_ring_write(&ring, bytes, sizes[i]), holds);
        assert_int_equal(mbm_ring_available(&ring), holds);
        assert_int_equal(mbm_ring_lost(&ring), 1);
        assert_int_equal(mbm_ring_put(&ring, 1), 0);
        assert_int_equal(mbm_ring_lost(&ring), 2);
        assert_int_equal(mbm_ring_read(&ring, back, 1), 1);
        assert_int_equal(mbm_ring_put(&ring, 0xAB), 1);
        assert_int_equal(mbm_ring_read(&ring, back + 1, 65534), holds);
        assert_memory_equal(back, bytes, holds);
        assert_int_equal(back[holds], 0xAB);
        assert_int_equal(mbm_ring_lost(&ring), 2);
    }
}

TEST_WITH(no_bytes_may_be_null, setup, NULL)
{
    OK(mbm_ring_begin(&ring, storage, 4));
    assert_int_equal(mbm_ring_write(&ring, NULL, 0), 0);
    mbm_ring_put(&ring, 1);
    assert_int_equal(mbm_ring_read(&ring, NULL, 0), 0);
    assert_int_equal(mbm_ring_available(&ring), 1);
    assert_int_equal(mbm_ring_lost(&ring), 0);
}

TEST_WITH(a_ring_that_was_read_empty_goes_on_counting, setup, NULL)
{
    uint8_t byte = 0;

    OK(mbm_ring_begin(&ring, storage, 2));
    mbm_ring_put(&ring, 1);
    mbm_ring_put(&ring, 2);
    while (mbm_ring_read(&ring, &byte, 1) > 0)
        continue;
    assert_int_equal(mbm_ring_available(&ring), 0);
    assert_int_equal(mbm_ring_lost(&ring), 1);
    assert_int_equal(mbm_ring_put(&ring, 3), 1);
    assert_int_equal(mbm_ring_read(&ring, &byte, 1), 1);
    assert_int_equal(byte, 3);
    OK(mbm_ring_begin(&ring, storage, 2));
    assert_int_equal(mbm_ring_lost(&ring), 0);
}

TEST_WITH(the_count_of_lost_bytes_wraps_at_65536, setup, NULL)
{
    OK(mbm_ring_begin(&ring, storage, 2));
    mbm_ring_put(&ring, 1);
    for (unsigned i = 0; i < 65535; i++)
        assert_int_equal(mbm_ring_put(&ring, 2), 0);
    assert_int_equal(mbm_ring_lost(&ring), 65535);
    mbm_ring_put(&ring, 2);
    assert_int_equal(mbm_ring_lost(&ring), 0);
}
