/* The receive rings: one thread, or a DMA, puts bytes in, another takes them out. */
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

/* --- the ring that a DMA fills. The DMA is played: its counter, and its interrupts --- */

static mbm_dmaRing dma;
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
    memset(&dma, 0, sizeof dma);
    written = 0;
    size = bytes;
    OK(mbm_dmaRing_begin(&dma, storage, size, remaining, &written));
}

/* The DMA writes bytes. Its interrupts note half and all of the storage. */
static void write_bytes(uint32_t count)
{
    while (count-- > 0) {
        storage[written % size] = value(written);
        written++;
        if (written % size == 0 || written % size == size / 2u)
            mbm_dmaRing_note(&dma);
    }
}

static void holds(uint32_t first, uint16_t count)
{
    static uint8_t taken[65535];

    assert_int_equal(mbm_dmaRing_available(&dma), count);
    assert_int_equal(mbm_dmaRing_read(&dma, taken, sizeof taken), count);
    for (uint16_t i = 0; i < count; i++)
        if (taken[i] != value(first + i))
            fail_msg("byte %u is %u", first + i, taken[i]);
    assert_int_equal(mbm_dmaRing_available(&dma), 0);
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
    assert_int_equal(mbm_dmaRing_lost(&dma), 0);
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
        assert_int_equal(mbm_dmaRing_lost(&dma), (uint16_t)(written - 2u * most));
    }
}

TEST(bytes_are_taken_one_at_a_time)
{
    uint8_t byte = 0;

    begin(4);
    for (uint32_t number = 0; number < 40; number++) {
        write_bytes(1);
        assert_int_equal(mbm_dmaRing_read(&dma, &byte, 1), 1);
        assert_int_equal(byte, value(number));
        assert_int_equal(mbm_dmaRing_read(&dma, &byte, 1), 0);
    }
}

TEST(a_dma_ring_that_was_never_begun_is_empty)
{
    uint8_t bytes[4] = {1};
    mbm_dmaRing *rings[] = {&dma, NULL};

    memset(&dma, 0, sizeof dma);
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
    INVALID(dma, mbm_dmaRing_begin(&dma, NULL, 8, remaining, NULL));
    INVALID(dma, mbm_dmaRing_begin(&dma, storage, 1, remaining, NULL));
    INVALID(dma, mbm_dmaRing_begin(&dma, storage, 0, remaining, NULL));
    INVALID(dma, mbm_dmaRing_begin(&dma, storage, 8, NULL, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_dmaRing_begin(NULL, storage, 8, remaining, NULL));
    REFUSED(0, dma, mbm_dmaRing_read(&dma, NULL, 4));
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

        OK(mbm_dmaRing_begin(&dma, storage, 8, wrong_counter, &counter));
        mbm_dmaRing_note(&dma);
        assert_int_equal(mbm_dmaRing_available(&dma), 0);
        assert_int_equal(mbm_dmaRing_read(&dma, &byte, 1), 0);
        assert_int_equal(mbm_dmaRing_lost(&dma), 0);
    }
}

TEST(a_dma_ring_that_is_begun_again_is_empty_and_has_lost_nothing)
{
    begin(4);
    write_bytes(13);
    holds(10, 3);
    assert_int_equal(mbm_dmaRing_lost(&dma), 10);
    written = 0;
    OK(mbm_dmaRing_begin(&dma, storage, size, remaining, NULL));
    assert_int_equal(mbm_dmaRing_available(&dma), 0);
    assert_int_equal(mbm_dmaRing_lost(&dma), 0);
    write_bytes(2);
    holds(0, 2);
}
