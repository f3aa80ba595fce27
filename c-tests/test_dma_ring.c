/* The receive ring that a DMA fills. The DMA is played: its counter, and its interrupts. */
#include "refused.h"
#include "mbm.h"
#include "test.h"

static mbm_dmaRing ring;
static uint8_t storage[65535];
static uint32_t written; /* bytes that the DMA has written */
static uint16_t size;
static void *given;

static uint16_t remaining(void *context)
{
    given = context;
    return (uint16_t)(size - written % size);
}

static uint8_t value(uint32_t number)
{
    return (uint8_t)(number * 7 + number / 251);
}

static void begin(uint16_t bytes)
{
    memset(&ring, 0, sizeof ring);
    written = 0;
    size = bytes;
    OK(mbm_dmaRing_begin(&ring, storage, size, remaining, &written));
}

/* The DMA writes bytes. Its interrupts note half and all of the storage. */
static void write_bytes(uint32_t count)
{
    while (count-- > 0) {
        storage[written % size] = value(written);
        written++;
        if (written % size == 0 || written % size == size / 2u)
            mbm_dmaRing_note(&ring);
    }
}

static void holds(uint32_t first, uint16_t count)
{
    static uint8_t taken[65535];

    assert_int_equal(mbm_dmaRing_available(&ring), count);
    assert_int_equal(mbm_dmaRing_read(&ring, taken, sizeof taken), count);
    for (uint16_t i = 0; i < count; i++)
        if (taken[i] != value(first + i))
            fail_msg("byte %u is %u", first + i, taken[i]);
    assert_int_equal(mbm_dmaRing_available(&ring), 0);
}

TEST(bytes_come_in_order_without_a_call_of_the_writer)
{
    uint32_t first = 0;

    begin(8);
    for (unsigned round = 0; round < 100; round++) {
        uint16_t count = round % 4;

        storage[written % size] = value(written);
        written++;
        write_bytes(count);
        holds(first, (uint16_t)(count + 1));
        first += count + 1;
    }
    assert_int_equal(mbm_dmaRing_lost(&ring), 0);
    assert_ptr_equal(given, &written);
}

TEST(a_main_loop_that_comes_too_late_gets_the_newest_bytes_and_the_count_of_the_others)
{
    static const uint16_t sizes[] = {2, 3, 255, 256, 257, 65535};

    for (unsigned i = 0; i < COUNT(sizes); i++) {
        uint16_t most = (uint16_t)(sizes[i] - 1);

        begin(sizes[i]);
        write_bytes(most);
        holds(0, most);
        write_bytes(3u * sizes[i] + 1);
        holds(written - most, most);
        assert_int_equal(mbm_dmaRing_lost(&ring), (uint16_t)(written - 2u * most));
    }
}

TEST(bytes_are_taken_one_at_a_time)
{
    uint8_t byte = 0;

    begin(4);
    for (uint32_t number = 0; number < 40; number++) {
        write_bytes(1);
        assert_int_equal(mbm_dmaRing_read(&ring, &byte, 1), 1);
        assert_int_equal(byte, value(number));
        assert_int_equal(mbm_dmaRing_read(&ring, &byte, 1), 0);
    }
}

TEST(a_dma_ring_that_was_never_begun_is_empty)
{
    uint8_t bytes[4] = {1};
    mbm_dmaRing *rings[] = {&ring, NULL};

    memset(&ring, 0, sizeof ring);
    for (unsigned i = 0; i < COUNT(rings); i++) {
        mbm_dmaRing_note(rings[i]);
        assert_int_equal(mbm_dmaRing_read(rings[i], bytes, 4), 0);
        assert_int_equal(mbm_dmaRing_available(rings[i]), 0);
        assert_int_equal(mbm_dmaRing_lost(rings[i]), 0);
    }
    assert_int_equal(bytes[0], 1);
}

TEST(a_refused_call_of_a_dma_ring_changes_nothing)
{
    begin(8);
    write_bytes(5);
    INVALID(ring, mbm_dmaRing_begin(&ring, NULL, 8, remaining, NULL));
    INVALID(ring, mbm_dmaRing_begin(&ring, storage, 1, remaining, NULL));
    INVALID(ring, mbm_dmaRing_begin(&ring, storage, 0, remaining, NULL));
    INVALID(ring, mbm_dmaRing_begin(&ring, storage, 8, NULL, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_dmaRing_begin(NULL, storage, 8, remaining, NULL));
    REFUSED(0, ring, mbm_dmaRing_read(&ring, NULL, 4));
    holds(0, 5);
}

static uint16_t wrong_counter(void *context)
{
    return *(uint16_t *)context;
}

TEST(a_counter_above_the_size_moves_nothing)
{
    uint16_t counter;

    for (counter = 9; counter != 0; counter = (uint16_t)(counter * 2u)) {
        uint8_t byte;

        OK(mbm_dmaRing_begin(&ring, storage, 8, wrong_counter, &counter));
        mbm_dmaRing_note(&ring);
        assert_int_equal(mbm_dmaRing_available(&ring), 0);
        assert_int_equal(mbm_dmaRing_read(&ring, &byte, 1), 0);
        assert_int_equal(mbm_dmaRing_lost(&ring), 0);
    }
}

TEST(a_dma_ring_that_is_begun_again_is_empty_and_has_lost_nothing)
{
    begin(4);
    write_bytes(13);
    holds(10, 3);
    assert_int_equal(mbm_dmaRing_lost(&ring), 10);
    written = 0;
    OK(mbm_dmaRing_begin(&ring, storage, size, remaining, NULL));
    assert_int_equal(mbm_dmaRing_available(&ring), 0);
    assert_int_equal(mbm_dmaRing_lost(&ring), 0);
    write_bytes(2);
    holds(0, 2);
}
