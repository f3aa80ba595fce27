/* The ports of ports/freertos, over the few calls of FreeRTOS that c-tests/shim plays: tasks are
 * threads. `make check-real KIT=freertos` runs the ports with the real kernel. */
#include "freertos.h"
#include "await.h"
#include "mbm_tty.h"
#include "server.h"
#include "uart.h"

enum { UNIT = 17, LONG = 20000 /* ms */, SHORT = 40 /* ms */ };

static mbm_line line;
static mbm_node node;
static uint16_t words[10];
static uint8_t frame[MBM_MAX_FRAME];
static server peer;

static void master_begin(mbm_node *n, uint8_t unit, uint16_t *response, uint16_t timeout)
{
    memset(n, 0, sizeof *n);
    OK(mbm_node_begin(n, &line, unit, response, 10, NULL, 0));
    OK(mbm_node_setResponseTimeout(n, timeout));
}

/* A master on the UART, and libmodbus's server at the other end. */
static void setup(void)
{
    server_start(&peer, UNIT);
    uart_settings();
    OK(mbm_freertos_open(&uart, &port));
    uart_start(peer.line.ours);
    memset(&line, 0, sizeof line);
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_line_setBaudRate(&line, UART_BAUD));
    master_begin(&node, UNIT, words, LONG);
    freertos_sleeps = freertos_yields = freertos_given = 0;
}

static void teardown(void)
{
    uart_stop();
    server_stop(&peer);
}

fixture each_test = {setup, teardown};

static void is_right(void)
{
    OK(mbm_node_readHoldingRegisters(&node, 20, 10));
    for (unsigned i = 0; i < 10; i++)
        assert_int_equal(words[i], server_pattern(20 + i));
}

TEST(a_blocking_call_sleeps_until_bytes_come_and_does_not_poll)
{
    const unsigned times = 20;

    for (unsigned i = 0; i < times; i++)
        is_right();
    /* Bytes come one by one at most: 25 of a reply, and the sleeps of the gap and of the frame. */
    assert_in_range(freertos_sleeps, times, times * 40);
    /* One that comes before the task sleeps ends no sleep, so there may be more of them. */
    assert_in_range(freertos_given, times, times * 40);
    assert_int_equal(freertos_yields, 0);
    assert_int_equal(mbm_freertos_lost(&uart), 0);
}

static void a_byte_arrives(void)
{
    static const uint8_t byte = 0x55;
    BaseType_t woken;

    mbm_freertos_receivedFromISR(&uart, &byte, 1, &woken);
}

/* The sleeps would end only by a notification. */
TEST(a_byte_that_comes_just_before_the_sleep_ends_it)
{
    freertos_before_check = a_byte_arrives;
    mbm_freertos_wait(&uart.line, UINT32_MAX);
    assert_int_equal(freertos_sleeps, 0);
    freertos_before_sleep = a_byte_arrives;
    mbm_freertos_wait(&uart.line, UINT32_MAX);
    assert_int_equal(freertos_sleeps, 1);
    a_byte_arrives();
    mbm_freertos_wait(&uart.line, UINT32_MAX);
    assert_int_equal(freertos_sleeps, 1);
    is_right();
}

TEST(other_notifications_of_the_task_are_left_alone)
{
    TaskHandle_t self = xTaskGetCurrentTaskHandle();

    xTaskNotifyGiveIndexed(self, 0);
    is_right();
    assert_int_equal(ulTaskNotifyTakeIndexed(0, pdTRUE, 0), 1);
}

/* --- several tasks */

enum { TASKS = 3, REQUESTS = 60 };
static unsigned right[TASKS];

static void *task(void *context)
{
    const unsigned index = (unsigned)(uintptr_t)context;
    uint16_t response[10];
    mbm_node own;

    memset(&own, 0, sizeof own);
    freertos_enter();
    mbm_node_begin(&own, &line, UNIT, response, 10, NULL, 0);
    freertos_exit();
    for (unsigned i = 0; i < REQUESTS; i++) {
        const uint16_t address = (uint16_t)(100 * index + i);

        if (mbm_freertos_take(&uart.line, portMAX_DELAY) != MBM_OK)
            return NULL;
        mbm_node_setResponseTimeout(&own, LONG);
        if (mbm_node_readHoldingRegisters(&own, address, 10) == MBM_OK)
            right[index] += response[9] == server_pattern(address + 9u);
        mbm_freertos_give(&uart.line);
    }
    return NULL;
}

TEST(tasks_that_take_the_line_share_it)
{
    pthread_t threads[TASKS];

    memset(right, 0, sizeof right);
    for (uintptr_t i = 0; i < TASKS; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, task, (void *)i), 0);
    for (unsigned i = 0; i < TASKS; i++) {
        pthread_join(threads[i], NULL);
        assert_int_equal(right[i], REQUESTS);
    }
}

static void *take_in_vain(void *context)
{
    return (void *)(uintptr_t)mbm_freertos_take(&uart.line, SHORT);
}

TEST(a_line_that_another_task_has_is_busy_when_the_time_is_over_and_free_afterwards)
{
    pthread_t other;
    void *status;

    OK(mbm_freertos_take(&uart.line, portMAX_DELAY));
    assert_int_equal(pthread_create(&other, NULL, take_in_vain, NULL), 0);
    pthread_join(other, &status);
    assert_int_equal((uintptr_t)status, MBM_BUSY);
    IS(MBM_BUSY, mbm_freertos_take(&uart.line, 0));
    is_right();
    mbm_freertos_give(&uart.line);
    OK(mbm_freertos_take(&uart.line, 0));
    mbm_freertos_give(&uart.line);
}

/* --- faults */

TEST(a_uart_that_is_not_started_is_a_busy_line_and_the_next_request_is_right_once_it_is)
{
    chip.is_started = 0;
    OK(mbm_node_setResponseTimeout(&node, SHORT));
    for (unsigned i = 1; i <= 3; i++) {
        freertos_sleeps = 0;
        IS(MBM_LINE_BUSY, mbm_node_readHoldingRegisters(&node, 20, 10));
        /* It sleeps for the frame or a tick at a time, and lets others run. */
        assert_in_range(freertos_sleeps, 1, 4 * SHORT);
        assert_int_equal(mbm_freertos_stalled(&uart), i);
    }
    /* Its interrupt, which was pending, finds nothing to send. */
    chip.is_started = 1;
    uart.startSending(NULL);
    /* The reply is held for a response timeout, because others may be late. */
    OK(mbm_node_setResponseTimeout(&node, 500));
    AWAIT(mbm_node_readHoldingRegisters(&node, 20, 10) == MBM_OK);
    OK(mbm_node_setResponseTimeout(&node, LONG));
    is_right();
    assert_int_equal(mbm_freertos_stalled(&uart), 3);
}

static void *close_later(void *context)
{
    AWAIT(uart.line.waiting != NULL && !uart.isSending);
    mbm_freertos_close(&uart);
    return NULL;
}

TEST(a_line_that_is_closed_wakes_its_task_with_a_lost_link_and_opens_again)
{
    static mbm_node absent;
    pthread_t other;

    master_begin(&absent, UNIT + 1, words, LONG);
    assert_int_equal(pthread_create(&other, NULL, close_later, NULL), 0);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&absent, 20, 10));
    pthread_join(other, NULL);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 20, 10));
    mbm_freertos_close(&uart);
    OK(mbm_freertos_open(&uart, &port));
    is_right();
}

TEST(bytes_that_find_no_place_and_overruns_of_the_uart_are_counted_and_the_next_request_is_right)
{
    uint8_t noise[UART_RING + 5] = {0};
    BaseType_t woken;

    mbm_freertos_receivedFromISR(&uart, noise, sizeof noise, &woken);
    assert_int_equal(mbm_freertos_lost(&uart), 6);
    mbm_freertos_overrunFromISR(&uart);
    assert_int_equal(mbm_freertos_lost(&uart), 7);
    is_right();
    mbm_freertos_close(&uart);
    OK(mbm_freertos_open(&uart, &port));
    assert_int_equal(mbm_freertos_lost(&uart), 0);
    is_right();
}

/* Modbus-STM32-HAL-FreeRTOS 17: a character that arrives ends the wait for the end of the
 * transmission. */
TEST(a_byte_that_arrives_while_a_frame_leaves_does_not_end_it)
{
    chip.is_started = 0;
    assert_int_equal(port.write(port.context, frame, 8), 8);
    freertos_before_sleep = a_byte_arrives;
    assert_int_equal(port.flush(port.context), 0);
    assert_null(freertos_before_sleep);
    assert_int_equal(mbm_freertos_stalled(&uart), 0);
}

TEST(a_frame_longer_than_its_storage_is_sent_in_parts)
{
    mbm_freertos_close(&uart);
    uart.toSendBytes = 3;
    OK(mbm_freertos_open(&uart, &port));
    is_right();
}

/* --- the driver of the transceiver */

TEST(the_driver_goes_off_in_the_interrupt_of_the_last_bit)
{
    is_right();
    assert_true(chip.driver_was_on);
    assert_int_equal(chip.driver, 0);
    assert_int_equal(chip.driver_in_interrupt, 1);
}

TEST(without_that_interrupt_the_driver_goes_off_in_the_task)
{
    mbm_freertos_close(&uart);
    uart.hasNoSentInterrupt = 1;
    OK(mbm_freertos_open(&uart, &port));
    OK(mbm_line_setPostFlushHold(&line, 1));
    is_right();
    assert_true(chip.driver_was_on);
    assert_int_equal(chip.driver, 0);
    assert_int_equal(chip.driver_in_interrupt, 0);
}

TEST(the_driver_goes_off_when_the_line_is_closed)
{
    port.preTransmission(port.context);
    assert_int_equal(chip.driver, 1);
    mbm_freertos_close(&uart);
    assert_int_equal(chip.driver, 0);
}

TEST(a_pin_that_cannot_be_set_is_a_lost_link_and_then_works)
{
    is_right();
    for (unsigned i = 0; i < 2; i++) {
        chip.pin_fails = 1;
        IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 20, 10));
        IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 20, 10));
        chip.pin_fails = 0;
        is_right();
        assert_int_equal(chip.driver, 0);
    }
}

TEST(a_pin_that_does_not_go_off_is_a_lost_link_and_goes_off_later)
{
    port.preTransmission(port.context);
    assert_int_equal(chip.driver, 1);
    chip.pin_fails = 1;
    port.postTransmission(port.context);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 20, 10));
    chip.pin_fails = 0;
    is_right();
    assert_int_equal(chip.driver, 0);
}

TEST(a_line_whose_pin_is_not_there_is_refused_and_opened_once_it_is)
{
    mbm_freertos_close(&uart);
    chip.pin_fails = 1;
    IS(MBM_LINK_LOST, mbm_freertos_open(&uart, &port));
    chip.pin_fails = 0;
    OK(mbm_freertos_open(&uart, &port));
    is_right();
}

/* --- a port of another kind */

static mbm_freertosPort over;
static mbm_tty tty;
static volatile int is_full, is_lost, is_over;
static pthread_t waking;

static int16_t tty_write(void *context, const uint8_t *bytes, uint16_t length)
{
    const mbm_port own = mbm_tty_port(&tty);

    return is_lost ? -1 : is_full ? 0 : own.write(own.context, bytes, length);
}

static void *wake(void *context)
{
    while (!is_over) {
        struct pollfd wait = {peer.line.ours, POLLIN, 0};
        BaseType_t woken;

        if (poll(&wait, 1, 1) == 1)
            mbm_freertos_wakeFromISR(&over.line, &woken);
    }
    return NULL;
}

static void wrapped_setup(void)
{
    server_start(&peer, UNIT);
    memset(&over, 0, sizeof over);
    memset(&line, 0, sizeof line);
    OK(mbm_tty_attach(&tty, peer.line.ours));
    over.link = mbm_tty_port(&tty);
    over.link.write = tty_write;
    over.link.micros = NULL;
    OK(mbm_freertos_wrap(&over, &port));
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_line_setBaudRate(&line, UART_BAUD));
    master_begin(&node, UNIT, words, LONG);
    is_full = is_lost = is_over = 0;
    freertos_sleeps = freertos_yields = freertos_given = 0;
    assert_int_equal(pthread_create(&waking, NULL, wake, NULL), 0);
}

static void wrapped_teardown(void)
{
    is_over = 1;
    pthread_join(waking, NULL);
    server_stop(&peer);
}

TEST_WITH(a_port_of_yours_sleeps_in_the_same_way, wrapped_setup, wrapped_teardown)
{
    for (unsigned i = 0; i < 20; i++)
        is_right();
    assert_in_range(freertos_sleeps, 20, 20 * 60);
    OK(mbm_freertos_take(&over.line, 0));
    IS(MBM_BUSY, mbm_freertos_take(&over.line, 0));
    mbm_freertos_give(&over.line);
}

TEST_WITH(a_port_that_takes_no_bytes_lets_other_tasks_run, wrapped_setup, wrapped_teardown)
{
    is_full = 1;
    OK(mbm_node_setResponseTimeout(&node, SHORT));
    IS(MBM_LINE_BUSY, mbm_node_readHoldingRegisters(&node, 20, 10));
    assert_in_range(freertos_sleeps, 1, 4 * SHORT);
    is_full = 0;
    OK(mbm_node_setResponseTimeout(&node, 500));
    AWAIT(mbm_node_readHoldingRegisters(&node, 20, 10) == MBM_OK);
}

TEST_WITH(a_port_whose_link_is_lost_says_so_and_works_again, wrapped_setup, wrapped_teardown)
{
    is_lost = 1;
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 20, 10));
    is_lost = 0;
    is_right();
}

TEST(a_port_without_read_or_write_is_not_wrapped)
{
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_wrap(NULL, &port));
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_wrap(&over, NULL));
    over.link.read = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_wrap(&over, &port));
    over.link = mbm_tty_port(&tty);
    over.link.write = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_wrap(&over, &port));
}

/* --- what is refused */

TEST(settings_without_a_part_are_refused)
{
    IS(MBM_BUSY, mbm_freertos_open(&uart, &port));
    uart_settings();
    IS(MBM_NOT_INITIALISED, mbm_freertos_take(&uart.line, 0));
    mbm_freertos_give(&uart.line);
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(NULL, &port));
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(&uart, NULL));
    uart.baud = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(&uart, &port));
    uart_settings();
    uart.startSending = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(&uart, &port));
    uart_settings();
    uart.toSendBytes = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(&uart, &port));
    uart_settings();
    uart.receivedBytes = 1;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(&uart, &port));
    uart_settings();
    uart.received = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_open(&uart, &port));
    IS(MBM_INVALID_ARGUMENT, mbm_freertos_take(NULL, 0));
    mbm_freertos_give(NULL);
    mbm_freertos_wait(NULL, 1);
    mbm_freertos_wake(NULL);
    mbm_freertos_wakeFromISR(NULL, NULL);
    mbm_freertos_close(NULL);
    assert_int_equal(mbm_freertos_lost(NULL) + mbm_freertos_stalled(NULL), 0);
    assert_int_equal(mbm_freertos_nextFromISR(NULL, frame), 0);
}

/* --- the clock */

TEST(the_clock_goes_on_when_the_tick_wraps)
{
    uint32_t last = port.micros(port.context);
    const uint32_t first = last;

    /* The played tick wraps 256 ms after the start. */
    AWAIT(xTaskGetTickCount() < 0x8000);
    for (unsigned i = 0; i < 100; i++) {
        const uint32_t now = port.micros(port.context);

        assert_in_range(now - last, 0, 1000000u * LONG);
        last = now;
    }
    assert_in_range(last - first, 0, 1000u * LONG);
}
