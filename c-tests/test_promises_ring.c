/* Each function of the ring is held to its comment in mbm.h: results, limits, NULL. */
#include "refused.h"
#include "mbm.h"
#include "test.h"

#include <string.h>

static mbm_ring ring;
static uint8_t storage[65535];

static void setup(void)
{
    memset(&ring, 0, sizeof ring);
}

fixture each_test = {setup, NULL};

TEST(a_ring_that_was_never_begun_is_empty_and_takes_nothing)
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

TEST(a_refused_begin_changes_nothing)
{
    OK(mbm_ring_begin(&ring, storage, 8));
    mbm_ring_put(&ring, 5);
    REFUSED(MBM_INVALID_ARGUMENT, ring, mbm_ring_begin(&ring, NULL, 8));
    REFUSED(MBM_INVALID_ARGUMENT, ring, mbm_ring_begin(&ring, storage, 1));
    REFUSED(MBM_INVALID_ARGUMENT, ring, mbm_ring_begin(&ring, storage, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_ring_begin(NULL, storage, 8));
    assert_int_equal(mbm_ring_available(&ring), 1);
}

TEST(a_ring_holds_one_byte_less_than_its_storage)
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

TEST(no_bytes_may_be_null)
{
    OK(mbm_ring_begin(&ring, storage, 4));
    assert_int_equal(mbm_ring_write(&ring, NULL, 0), 0);
    mbm_ring_put(&ring, 1);
    assert_int_equal(mbm_ring_read(&ring, NULL, 0), 0);
    assert_int_equal(mbm_ring_available(&ring), 1);
    assert_int_equal(mbm_ring_lost(&ring), 0);
}

TEST(a_ring_that_was_read_empty_goes_on_counting)
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

TEST(the_count_of_lost_bytes_wraps_at_65536)
{
    OK(mbm_ring_begin(&ring, storage, 2));
    mbm_ring_put(&ring, 1);
    for (unsigned i = 0; i < 65535; i++)
        assert_int_equal(mbm_ring_put(&ring, 2), 0);
    assert_int_equal(mbm_ring_lost(&ring), 65535);
    mbm_ring_put(&ring, 2);
    assert_int_equal(mbm_ring_lost(&ring), 0);
}
