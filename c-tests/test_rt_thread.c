/* The port for RT-Thread over a model of its serial framework: faults, what they are to the
 * program, and the next request when the cause is gone. */
#include "mbm_rt_thread.h"
#include "port_user.h"
#include "serial_model.h"
#include "test.h"

enum { MOST = 4000000 /* microseconds: the longest time of a request */ };

static mbm_rtThreadLine uart;

static void set_up(void)
{
    mbm_rtThread_close(&uart);
    rtt_chip_reset();
    memset(&uart, 0, sizeof uart);
    user_forget();
    uart.uart = "uart2";
    uart.driverPin = RTT_DRIVER_PIN;
    uart.baud = 19200;
    uart.parity = PARITY_EVEN;
    chip.reply = reply;
    chip.replyLength = sizeof reply;
}

fixture each_test = {set_up, NULL}, all_tests;

static void begin_master(void)
{
    assert_int_equal(mbm_rtThread_open(&uart, &port), RT_EOK);
    user_begin_master();
}

static void begin_server(void)
{
    chip.reply = NULL;
    assert_int_equal(mbm_rtThread_open(&uart, &port), RT_EOK);
    user_begin_server();
}

/* A request, which ends in bounded time. */
static uint8_t ask(void)
{
    const uint64_t begun = chip.now;
    const uint8_t status = mbm_node_readHoldingRegisters(&node, 0, 2);

    assert_true(chip.now - begun < MOST);
    assert_false(chip.isDriving);
    return status;
}

/* The next request works, and no byte but its own has left since `sent`. */
static void works(unsigned sent)
{
    response[0] = 0;
    OK(ask());
    assert_int_equal(response[0], 555);
    assert_int_equal(chip.sent - sent, sizeof request);
    assert_memory_equal(chip.line + sent, request, sizeof request);
    assert_int_equal(chip.undriven, 0);
}

static void poll_for(uint64_t micros)
{
    const uint64_t end = chip.now + micros;

    while (chip.now < end) {
        mbm_server_poll(&server);
        mbm_rtThread_wait(mbm_server_pollDelay(&server));
    }
    assert_false(chip.isDriving);
}

static void answers(void)
{
    const unsigned sent = chip.sent;

    rtt_chip_receive(request, sizeof request);
    poll_for(100000);
    assert_int_equal(chip.sent - sent, sizeof reply);
    assert_memory_equal(chip.line + sent, reply, sizeof reply);
}

/* --- the transmitter */

TEST(a_request_is_answered)
{
    begin_master();
    works(0);
    assert_int_equal(mbm_rtThread_lost(&uart) + uart.stalled, 0);
}

/* freemodbus 8: a master waits for ever, and no request ends. */
TEST(a_transmitter_that_stops_is_a_status_in_bounded_time_and_then_works)
{
    begin_master();
    works(0);
    for (uint8_t round = 1; round < 10; round++) {
        const uint64_t begun = chip.now;

        chip.stopsAfter = sizeof request;
        IS(MBM_LINK_LOST, ask());
        /* Twice the time of 256 characters, two ticks, and the silence before a request. */
        assert_in_range(chip.now - begun, 1, 2 * 256 * 11 * 1000 / 19 + 5000);
        assert_int_equal(uart.stalled, round);
        assert_int_equal(chip.sent, sizeof request);
    }
    chip.stopsAfter = 0;
    works(sizeof request);
}

TEST(a_transmitter_that_stops_within_a_frame_sends_no_rest_of_it_later)
{
    begin_master();
    chip.stopsAfter = 3;
    IS(MBM_LINK_LOST, ask());
    assert_int_equal(chip.sent, 3);
    chip.stopsAfter = 0;
    rtt_chip_pass(1000000);
    assert_int_equal(chip.sent, 3);
    works(3);
}

TEST(a_server_whose_transmitter_stops_answers_again_once_it_works)
{
    begin_server();
    answers();
    chip.stopsAfter = sizeof reply;
    rtt_chip_receive(request, sizeof request);
    poll_for(MOST);
    assert_int_equal(uart.stalled, 1);
    chip.stopsAfter = 0;
    answers();
}

TEST(a_long_frame_leaves_as_a_whole)
{
    static const uint8_t long_request[] = {17, 3, 0, 0, 0, 120, 0x47, 0x78};

    begin_server();
    rtt_chip_receive(long_request, sizeof long_request);
    poll_for(400000);
    assert_int_equal(chip.sent, 245);
    assert_int_equal(chip.undriven, 0);
    assert_int_equal(uart.stalled, 0);
}

#ifndef RT_USING_SERIAL_V2
/* rt-thread 9964: a driver waits too short a time for a character at a low rate. What it says did
 * not leave has left: to send it again would repeat it. */
TEST(a_driver_that_gives_up_a_character_is_a_status_and_no_character_is_repeated)
{
    begin_master();
    chip.characterTimeout = 1;
    IS(MBM_LINK_LOST, ask());
    assert_int_equal(chip.sent, 1);
    assert_int_equal(uart.stalled, 1);
    chip.characterTimeout = 0;
    rtt_chip_pass(100000);
    works(1);
}
#endif

/* --- the device */

TEST(a_device_that_another_part_of_the_program_closes_is_a_status_and_then_works)
{
    begin_master();
    works(0);
    rtt_chip_close();
    chip.failsToOpen = true;
    for (int round = 0; round < 5; round++)
        IS(MBM_LINK_LOST, ask());
    chip.failsToOpen = false;
    IS(MBM_LINK_LOST, ask());
    works(sizeof request);
}

TEST(a_server_goes_on_when_the_device_is_open_again)
{
    begin_server();
    rtt_chip_close();
    chip.failsToOpen = true;
    poll_for(100000);
    chip.failsToOpen = false;
    poll_for(100000);
    answers();
}

static void refused(rt_err_t error)
{
    const mbm_port before = port;

    assert_int_equal(mbm_rtThread_open(&uart, &port), error);
    assert_memory_equal(&port, &before, sizeof port);
    assert_null(uart.device);
    assert_int_equal(rtt_uart.ref_count, 0);
}

TEST(a_device_that_cannot_be_opened_is_an_error_that_changes_nothing_and_then_opens)
{
    chip.isAbsent = true;
    refused(-RT_ENOENT);
    chip.isAbsent = false;
    chip.failsToOpen = true;
    refused(-RT_ERROR);
    chip.failsToOpen = false;
    uart.baud = 0;
    refused(-RT_EINVAL);
    uart.baud = 19200;
    uart.uart = NULL;
    refused(-RT_EINVAL);
    uart.uart = "uart2";
    assert_int_equal(mbm_rtThread_open(NULL, &port), -RT_EINVAL);
    assert_int_equal(mbm_rtThread_open(&uart, NULL), -RT_EINVAL);
    begin_master();
    assert_int_equal(mbm_rtThread_open(&uart, &port), -RT_EINVAL);
    works(0);
}

/* Its buffer has another length. */
TEST(a_device_that_another_part_of_the_program_has_open_is_an_error)
{
    struct serial_configure config = RT_SERIAL_CONFIG_DEFAULT;

#ifdef RT_USING_SERIAL_V2
    config.rx_bufsz = 64;
#else
    config.bufsz = 64;
#endif
    assert_int_equal(rt_device_control(&rtt_uart, RT_DEVICE_CTRL_CONFIG, &config), RT_EOK);
    assert_int_equal(rt_device_open(&rtt_uart, 0), RT_EOK);
    assert_int_equal(mbm_rtThread_open(&uart, &port), -RT_EBUSY);
    assert_int_equal(rtt_uart.ref_count, 1);
    rtt_chip_close();
    begin_master();
    works(0);
}

TEST(a_pin_that_is_not_there_is_an_error_that_changes_nothing_and_then_opens)
{
    uart.driverPin = -RT_EINVAL; /* as rt_pin_get returns it */
    refused(-RT_EINVAL);
    uart.driverPin = -RT_ENOSYS;
    refused(-RT_EINVAL);
    uart.driverPin = RTT_PINS;
    refused(-RT_EINVAL);
    chip.knowsPins = false;
    uart.driverPin = -RT_EINVAL;
    refused(-RT_EINVAL);
    uart.driverPin = RTT_DRIVER_PIN;
    begin_master();
    works(0);
}

TEST(a_driver_of_pins_that_knows_no_errors_is_no_hindrance)
{
    chip.knowsPins = false;
    begin_master();
    works(0);
}

TEST(a_line_that_was_closed_is_a_lost_link_and_may_be_opened_again)
{
    begin_master();
    mbm_rtThread_close(&uart);
    mbm_rtThread_close(&uart);
    assert_int_equal(rtt_uart.ref_count, 0);
    IS(MBM_LINK_LOST, ask());
    assert_int_equal(rtt_uart.ref_count, 0);
    uart.stalled = 1;
    assert_int_equal(mbm_rtThread_open(&uart, &port), RT_EOK);
    assert_int_equal(uart.stalled, 0);
    works(0);
}

/* --- reception */

static const uint8_t flood[2000];

/* rt-thread 6365 and 8428: bytes are overwritten, and nothing says so. */
TEST(bytes_that_the_thread_is_too_late_for_are_counted_and_the_next_request_works)
{
    for (unsigned length = MBM_MAX_FRAME; length <= sizeof flood; length += 109) {
        set_up();
        begin_master();
        rtt_chip_receive(flood, length);
        assert_int_equal(user_read_all(), MBM_MAX_FRAME);
        assert_int_equal(mbm_rtThread_lost(&uart), length - MBM_MAX_FRAME);
        works(0);
        mbm_rtThread_close(&uart);
        assert_int_equal(mbm_rtThread_lost(&uart), length - MBM_MAX_FRAME);
        assert_int_equal(mbm_rtThread_open(&uart, &port), RT_EOK);
        assert_int_equal(mbm_rtThread_lost(&uart), 0);
    }
    assert_int_equal(mbm_rtThread_lost(NULL), 0);
}

TEST(bytes_that_waited_for_the_interrupt_are_all_received)
{
    begin_master();
    chip.isMasked = true;
    rtt_chip_receive(flood, 200);
    chip.isMasked = false;
    rtt_chip_receive(flood, 1);
    assert_int_equal(user_read_all(), 201);
    works(0);
}

TEST(bytes_are_received_after_the_device_was_opened_again)
{
    begin_master();
    chip.stopsAfter = 1;
    chip.reply = NULL;
    IS(MBM_LINK_LOST, ask());
    chip.stopsAfter = 0;
    rtt_chip_receive(flood, 300);
    assert_int_equal(mbm_rtThread_lost(&uart), 300 - MBM_MAX_FRAME);
    chip.reply = reply;
    works(1);
}

TEST(another_line_that_is_open_takes_no_bytes_of_this_one)
{
    static mbm_rtThreadLine other;
    mbm_port second;

    begin_master();
    memset(&other, 0, sizeof other);
    other.uart = "uart3";
    other.driverPin = MBM_RT_THREAD_NO_PIN;
    other.baud = 19200;
    assert_int_equal(mbm_rtThread_open(&other, &second), RT_EOK);
    works(0);
    mbm_rtThread_close(&other);
    /* Its memory is another's by now. */
    memset(&other, 0xAA, sizeof other);
    works(sizeof request);
}
