/* What users of UARTs with DMA and of drivers for RS-485 reported in public, tried on the port for
 * STM32 on a chip that is played. scripts/check/real_stm32.py runs these tests with ST's HAL. */
#include "crc.h"
#include "machine.h"
#include "served_unit.h"
#include "test.h"

enum { RING = MBM_STM32_RECEIVE_BYTES };

static void start(uint8_t byDma)
{
    served_unit_start(byDma, 0);
}

static void ask(uint8_t quantity)
{
    uint8_t request[8] = {UNIT, 3, 0, 0, 0, quantity};

    seal(request, 6);
    machine_receive(request, sizeof request, 0);
}

/* In a second at most. */
static void serve(unsigned characters)
{
    served_unit_sends(characters, 10000, 50);
}

static void answers(uint8_t quantity)
{
    ask(quantity);
    serve(5u + 2u * quantity);
    machine_run(3000);
    mbm_server_poll(&server);
}

/* STM32CubeF4 196 and 204: an example drops a whole buffer of new bytes, because its end is where
 * the last one ended. */
TEST(a_buffer_of_new_bytes_that_ends_where_the_last_one_did_is_not_dropped_in_silence)
{
    uint8_t bytes[RING], read[RING];

    for (unsigned laps = 1; laps <= 3; laps++) {
        start(1);
        for (unsigned i = 0; i < RING; i++)
            bytes[i] = (uint8_t)(i + laps);
        for (unsigned lap = 0; lap < laps; lap++)
            machine_receive(bytes, RING, 0);
        machine_run(30000);
        assert_int_equal(port.read(&uart, read, sizeof read), RING - 1);
        assert_memory_equal(read, bytes + 1, RING - 1);
        assert_int_equal(mbm_stm32_lost(&uart), laps * RING - (RING - 1));
    }
}

static uint64_t woken;

static void note_wake(void *context)
{
    (void)context;
    woken = m.now;
}

/* stm32f4xx-hal-driver 23, STM32CubeH7 255: no event follows bytes that end with the buffer. */
TEST(the_last_byte_of_the_buffer_wakes_the_task_too)
{
    uint8_t bytes[RING] = {0}, read[RING];

    start(1);
    uart.wake = note_wake;
    for (uint8_t round = 1; round < RING; round++) {
        uint64_t arrived;

        machine_receive(bytes, round, 0);
        while (machine_coming() > 0)
            machine_run(10);
        arrived = m.now;
        machine_run(1000);
        assert_true(woken + 20000 > arrived);
        assert_int_equal(port.read(&uart, read, sizeof read), round);
    }
}

static void other_rate(uint8_t byDma)
{
    start(byDma);
    for (unsigned round = 0; round < 300; round++) {
        machine_receive_faulty((uint8_t)(round * 37), round % 3 ? FRAMING : FRAMING | NOISE);
        if (round % 7 == 0) {
            machine_run(400);
            mbm_server_poll(&server);
        }
    }
    machine_run(40000);
    mbm_server_poll(&server);
    machine_run(10000);
    mbm_server_poll(&server);
    answers(3);
    assert_true(uart.faulty > 0);
}

/* STM32CubeH7 263: after messages at another rate the error callback is missing, and reception
 * stays off. */
TEST(messages_at_another_rate_do_not_end_reception)
{
    other_rate(0);
    other_rate(1);
}

static void overrun_in_a_response(uint8_t byDma)
{
    start(byDma);
    for (unsigned at = 1; at < 40; at += 6) {
        ask(20);
        serve(at);
        /* The receiver of the transceiver is on, and gets what the program sends. */
        m.isLooped = 1;
        machine_receive_faulty(0, OVERRUN);
        serve(45 - at);
        m.isLooped = 0;
        machine_run(5000);
        mbm_server_poll(&server);
        machine_run(5000);
        mbm_server_poll(&server);
        answers(2);
    }
    assert_true(uart.overruns > 0);
}

/* rusefi 10100: an overrun while a large response leaves stops the DMA of reception until the power
 * is off. */
TEST(an_overrun_while_a_long_response_leaves_does_not_end_reception)
{
    overrun_in_a_response(0);
    overrun_in_a_response(1);
}

static void driver_of_first_frame(uint8_t byDma)
{
    for (uint8_t quantity = 1; quantity < 20; quantity++) {
        unsigned first;

        start(byDma);
        first = m.sentCount;
        answers(quantity);
        assert_true(m.driverOn <= m.sentAt[first] - m.character);
        assert_true(m.driverOff == m.sentAt[m.sentCount - 1]);
        assert_int_equal(m.driverChanges, 2);
        uart_is_quiet();
    }
}

/* stm8ef-modbus 45: the first transmission after a reset lets go of the bus a character too early.
 * Modbus-STM32-HAL-FreeRTOS 108: switching the driver needs delays. zephyr 38264 and 40578: the
 * driver goes off before the last character. */
TEST(the_first_frame_after_a_reset_has_its_driver_from_the_first_bit_to_the_last)
{
    driver_of_first_frame(0);
    driver_of_first_frame(1);
}

/* STM32CubeL4 84: an error of the DMA of reception ends the transmission that is under way. Once
 * the UART has the last character in its FIFO, or in its register, that DMA has ended, and the
 * response leaves whole. */
TEST(a_reception_dma_that_fails_while_a_response_leaves_is_counted_and_the_next_one_is_whole)
{
    for (unsigned at = 1; at < 40; at += 3) {
        start(1);
        ask(20);
        serve(at);
        m.isLooped = m.rxDmaFails = 1;
        for (unsigned polls = 0; polls < 400; polls++) {
            machine_run(100);
            mbm_server_poll(&server);
        }
        m.isLooped = m.rxDmaFails = 0;
        assert_int_equal(m.isDriving, 0);
        machine_run(100000);
        mbm_server_poll(&server);
        machine_run(1000);
        mbm_server_poll(&server);
        answers(2);
        assert_int_equal(uart.stalled, at + 1 + chip_kept() < 45);
        assert_true(uart.restarts > 0);
    }
}
