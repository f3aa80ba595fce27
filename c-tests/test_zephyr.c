/* Faults of a board with Zephyr on the port of ports/zephyr: the drivers, the kernel's calls and
 * the wire are those of packaging/zephyr/stand-in, which plays them. Each fault is a status, and
 * the next request works once its cause is gone. Numbers are those of issues of
 * zephyrproject-rtos/zephyr. */
#include "crc.h"
#include "line.h"
#include "mbm_zephyr.h"
#include "test.h"
#include "zephyr_board.h"

enum { BAUD = 19200, TIMEOUT = 500 /* ms */, MOST = 60 /* ms: a short frame, twice, and 50 */ };

static mbm_zephyrLine uart;
static mbm_port port;
static mbm_line line;
static mbm_node node;
static uint16_t words[10];
static uint8_t frame[MBM_MAX_FRAME];

static void settings(void)
{
    memset(&uart, 0, sizeof uart);
    uart.uart = &stand_in_uart;
    uart.driver = (struct gpio_dt_spec){.port = &stand_in_gpio, .pin = STAND_IN_PIN};
    uart.currentSpeed = uart.baud = BAUD;
    uart.parity = UART_CFG_PARITY_EVEN;
}

static void begin(void)
{
    OK(mbm_zephyr_open(&uart, &port));
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_line_setBaudRate(&line, BAUD));
    OK(mbm_node_begin(&node, &line, LINE_UNIT, words, 10, NULL, 0));
    OK(mbm_node_setResponseTimeout(&node, TIMEOUT));
}

static void setup(void)
{
    memset(&board_faults, 0, sizeof board_faults);
    line_reset();
    line_begin(BAUD);
    settings();
    begin();
}

fixture each_test = {setup, NULL};

static uint8_t read_words(void)
{
    memset(words, 0, sizeof words);
    return mbm_node_readHoldingRegisters(&node, LINE_ADDRESS, 2);
}

static void is_right(void)
{
    OK(read_words());
    assert_int_equal(words[0], LINE_FIRST);
    assert_int_equal(words[1], LINE_SECOND);
    assert_false(line_is_driving());
}

/* --- opening */

TEST(a_uart_that_is_not_ready_is_refused_and_opened_once_it_is)
{
    settings();
    board_faults.uartIsNotReady = true;
    assert_int_equal(mbm_zephyr_open(&uart, &port), -ENODEV);
    board_faults.uartIsNotReady = false;
    begin();
    is_right();
}

TEST(a_uart_that_is_not_set_up_is_refused_and_opened_once_it_is)
{
    settings();
    board_faults.configure = -ENOTSUP;
    assert_int_equal(mbm_zephyr_open(&uart, &port), -ENOTSUP);
    board_faults.configure = 0;
    begin();
    is_right();
}

TEST(a_pin_that_is_not_there_is_refused_and_opened_once_it_is)
{
    settings();
    board_faults.gpioIsNotReady = true;
    assert_int_equal(mbm_zephyr_open(&uart, &port), -ENODEV);
    board_faults.gpioIsNotReady = false;
    board_faults.pinConfigure = -EIO;
    assert_int_equal(mbm_zephyr_open(&uart, &port), -EIO);
    board_faults.pinConfigure = 0;
    begin();
    is_right();
}

/* --- transmission */

static void transmission_ends(void)
{
    const uint32_t began = line_micros();

    IS(MBM_LINK_LOST, read_words());
    assert_in_range(line_micros() - began, 1, (MOST + 10) * 1000);
    assert_int_equal(uart.stalled, 1);
    assert_false(line_is_driving());
}

TEST(a_transmitter_that_stands_still_is_a_lost_link_and_then_works)
{
    is_right();
    line_stop(true);
    transmission_ends();
    IS(MBM_LINK_LOST, read_words());
    assert_int_equal(uart.stalled, 2);
    line_stop(false);
    is_right();
    assert_int_equal(uart.stalled, 2);
}

TEST(a_transmit_interrupt_that_never_comes_is_a_lost_link_and_then_works)
{
    board_faults.hasNoTxInterrupt = true;
    transmission_ends();
    board_faults.hasNoTxInterrupt = false;
    is_right();
}

/* 104210: the last interrupt comes while the last byte still leaves, and no other one. */
TEST(a_transmission_whose_last_interrupt_does_not_come_is_noticed)
{
    board_faults.hasNoLastInterrupt = true;
    for (unsigned i = 0; i < 20; i++)
        is_right();
    assert_int_equal(uart.stalled, 0);
}

/* The interrupt of a FIFO that is not full would keep the thread from running. */
TEST(the_interrupt_of_a_transmitter_that_stands_still_is_ended_in_the_interrupt)
{
    unsigned before;

    line_stop(true);
    assert_int_equal(port.write(port.context, frame, 8), 8);
    for (unsigned i = 0; i < MOST; i++) {
        line_interrupt();
        line_sleep(1000);
    }
    assert_int_equal(uart.stalled, 1);
    before = board_interrupts;
    line_interrupt();
    assert_int_equal(board_interrupts, before);
    line_stop(false);
    assert_int_equal(port.read(port.context, frame, 1), -1);
    is_right();
}

/* 39268: an interrupt that finds nothing to send must be switched off, or it comes without end. */
TEST(an_interrupt_without_a_frame_is_switched_off)
{
    unsigned before;

    is_right();
    before = board_interrupts;
    board_interrupt();
    assert_int_equal(board_interrupts, before + 1);
    line_sleep(10000);
    assert_int_equal(board_interrupts, before + 1);
    is_right();
}

TEST(a_uart_that_cannot_be_set_up_again_after_a_stall_is_a_lost_link_and_then_works)
{
    board_faults.configure = -EIO;
    line_stop(true);
    transmission_ends();
    line_stop(false);
    IS(MBM_LINK_LOST, read_words());
    board_faults.configure = 0;
    is_right();
    assert_int_equal(uart.stalled, 1);
}

TEST(a_frame_that_was_given_up_does_not_leave_later)
{
    line_stop(true);
    IS(MBM_LINK_LOST, mbm_node_writeSingleRegister(&node, LINE_ADDRESS, 7));
    line_stop(false);
    is_right();
}

/* A driver that cannot be configured keeps what is in its FIFO. */
TEST(a_request_that_leaves_later_all_the_same_gives_no_wrong_words)
{
    settings();
    uart.driver.port = NULL;
    line_reset();
    begin();
    board_faults.keepsFifo = true;
    line_stop(true);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, LINE_ADDRESS, 1));
    line_stop(false);
    for (unsigned i = 0; i < 3; i++)
        if (mbm_node_readHoldingRegisters(&node, LINE_ADDRESS + 1, 1) == MBM_OK)
            assert_int_equal(words[0], LINE_SECOND);
    is_right();
}

TEST(a_line_whose_transmitter_stands_still_may_be_opened_again)
{
    line_stop(true);
    assert_int_equal(port.write(port.context, frame, 8), 8);
    assert_int_equal(mbm_zephyr_open(&uart, &port), -EINVAL);
    line_sleep(MOST * 1000);
    begin();
    line_stop(false);
    is_right();
}

/* --- a server */

static mbm_server server;
static uint16_t cells[10];

static void no_device(uint32_t now) {}

static void server_begin(void)
{
    static mbm_unit unit;
    static mbm_registerTable holding;

    line_replace_device(no_device);
    memset(&server, 0, sizeof server);
    unit = (mbm_unit){.id = LINE_UNIT};
    holding = (mbm_registerTable){.words = cells, .base = LINE_ADDRESS, .size = COUNT(cells)};
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, BAUD));
}

/* Sends a request to the server, and polls it for 100 ms. Returns how many bytes it has sent. */
static uint16_t answered(void)
{
    uint8_t request[8] = {LINE_UNIT, 3, 0, LINE_ADDRESS, 0, 10}, response[64];

    assert_int_equal(line_write_as_device(request, (uint16_t)seal(request, 6)), sizeof request);
    for (unsigned i = 0; i < 100; i++) {
        (void)mbm_server_poll(&server);
        line_sleep(1000);
    }
    return line_read_as_device(response, sizeof response);
}

TEST(a_server_whose_transmitter_stands_still_gives_its_response_up_and_answers_again)
{
    server_begin();
    assert_int_equal(answered(), 25);
    line_stop(true);
    assert_int_equal(answered(), 0);
    assert_int_equal(uart.stalled, 1);
    assert_false(line_is_driving());
    line_stop(false);
    assert_int_equal(answered(), 25);
    assert_int_equal(uart.stalled, 1);
}

/* --- reception */

TEST(overruns_and_damaged_characters_are_counted)
{
    uint8_t byte;

    board_faults.errors = UART_ERROR_OVERRUN;
    is_right();
    assert_int_equal(uart.overruns, 1);
    for (unsigned i = 1; i <= 3; i++) {
        board_faults.errors = UART_ERROR_FRAMING | UART_ERROR_NOISE;
        assert_int_equal(port.read(port.context, &byte, 1), 0);
        assert_int_equal(port.read(port.context, &byte, 1), 0);
        assert_int_equal(uart.faulty, i);
    }
    board_faults.errors = UART_ERROR_PARITY | UART_ERROR_OVERRUN;
    is_right();
    assert_int_equal(uart.faulty, 4);
    assert_int_equal(uart.overruns, 2);
    begin();
    assert_int_equal(uart.faulty + uart.overruns, 0);
}

TEST(a_driver_that_does_not_clear_an_error_counts_it_once)
{
    board_faults.keepsErrors = true;
    board_faults.errors = UART_ERROR_OVERRUN;
    for (unsigned i = 0; i < 5; i++)
        is_right();
    assert_int_equal(uart.overruns, 1);
}

TEST(a_driver_that_says_nothing_of_errors_counts_none)
{
    board_faults.hasNoErrCheck = true;
    board_faults.errors = UART_ERROR_OVERRUN;
    is_right();
    assert_int_equal(uart.overruns, 0);
}

/* 19700, 74643: after an error nothing is received until the program has asked for the errors. */
TEST(a_uart_that_is_deaf_until_its_errors_were_looked_at_receives_again)
{
    board_faults.isDeafUntilChecked = true;
    for (unsigned i = 1; i <= 5; i++) {
        board_faults.errors = UART_ERROR_FRAMING;
        is_right();
        assert_int_equal(uart.faulty, i);
    }
}

/* 107570: an adapter echoes without a pause, and the buffer runs over. */
TEST(bytes_that_find_no_place_are_counted_and_the_next_request_works)
{
    uint8_t noise[300] = {0}, rest[sizeof noise];

    line_replace_device(no_device);
    assert_int_equal(line_write_as_device(noise, sizeof noise), sizeof noise);
    line_sleep(300000);
    assert_int_equal(mbm_zephyr_lost(&uart), sizeof noise - MBM_MAX_FRAME);
    assert_int_equal(port.read(port.context, rest, sizeof rest), MBM_MAX_FRAME);
    line_replace_device(NULL);
    is_right();
    assert_int_equal(mbm_zephyr_lost(&uart), sizeof noise - MBM_MAX_FRAME);
}

/* --- the pin */

TEST(a_pin_that_cannot_be_set_is_a_lost_link_and_then_works)
{
    is_right();
    board_faults.pinSet = -EIO;
    IS(MBM_LINK_LOST, read_words());
    IS(MBM_LINK_LOST, read_words());
    board_faults.pinSet = 0;
    is_right();
    assert_int_equal(uart.stalled, 0);
}

/* For example an expander on a bus that is disturbed: the transceiver would hold the line. */
TEST(a_pin_that_does_not_go_off_is_a_lost_link_and_goes_off_later)
{
    port.preTransmission(port.context);
    assert_true(line_is_driving());
    board_faults.pinSet = -EIO;
    port.postTransmission(port.context);
    IS(MBM_LINK_LOST, read_words());
    board_faults.pinSet = 0;
    is_right();
}

TEST(null_is_refused)
{
    mbm_zephyrLine none = {.baud = BAUD};

    assert_int_equal(mbm_zephyr_open(NULL, &port), -EINVAL);
    assert_int_equal(mbm_zephyr_open(&uart, NULL), -EINVAL);
    assert_int_equal(mbm_zephyr_open(&none, &port), -EINVAL);
    assert_int_equal(mbm_zephyr_lost(NULL), 0);
    mbm_zephyr_wait(NULL, 1000);
}
