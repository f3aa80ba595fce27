/* The port for ESP-IDF over a model of its UART driver: faults, what they are to the program, and
 * the next request when the cause is gone. */
#include "mbm_esp_idf.h"
#include "port_user.h"
#include "test.h"
#include "uart_model.h"

enum { MOST = 4000000 /* microseconds: the longest time of a request */ };

static mbm_espIdfLine uart;
static const mbm_espIdfDriver drivers[] = {MBM_ESP_IDF_NO_DRIVER, MBM_ESP_IDF_DRIVER_BY_UART,
                                           MBM_ESP_IDF_DRIVER_BY_PIN};

static void set_up(void)
{
    esp_chip_reset();
    memset(&uart, 0, sizeof uart);
    user_forget();
    uart.uart = UART_NUM_1;
    uart.txPin = 4;
    uart.rxPin = 5;
    uart.driverPin = ESP_DRIVER_PIN;
    uart.driver = MBM_ESP_IDF_DRIVER_BY_UART;
    uart.baud = 19200;
    uart.parity = UART_PARITY_EVEN;
    chip.reply = reply;
    chip.replyLength = sizeof reply;
}

fixture each_test = {set_up, NULL}, all_tests;

static void begin_master(mbm_espIdfDriver driver)
{
    set_up();
    uart.driver = driver;
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_OK);
    user_begin_master();
}

static void begin_server(mbm_espIdfDriver driver)
{
    set_up();
    chip.reply = NULL;
    uart.driver = driver;
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_OK);
    user_begin_server();
}

/* A request, which ends in bounded time. */
static uint8_t ask(void)
{
    const int64_t begun = chip.now;
    const uint8_t status = mbm_node_readHoldingRegisters(&node, 0, 2);

    assert_true(chip.now - begun < MOST);
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
    if (uart.driver != MBM_ESP_IDF_NO_DRIVER) {
        assert_int_equal(chip.undriven, 0);
        assert_false(chip.isDriving);
    }
}

static void poll_for(int64_t micros)
{
    const int64_t end = chip.now + micros;

    while (chip.now < end) {
        mbm_server_poll(&server);
        mbm_espIdf_wait(mbm_server_pollDelay(&server));
    }
}

static void answers(void)
{
    const unsigned sent = chip.sent;

    esp_chip_receive(request, sizeof request);
    poll_for(100000);
    assert_int_equal(chip.sent - sent, sizeof reply);
    assert_memory_equal(chip.line + sent, reply, sizeof reply);
    assert_false(chip.isDriving);
}

/* --- the transmitter */

TEST(a_request_is_answered_with_each_kind_of_driver)
{
    for (size_t i = 0; i < COUNT(drivers); i++) {
        begin_master(drivers[i]);
        works(0);
        assert_int_equal(uart.overruns + uart.faulty + uart.stalled, 0);
    }
}

/* esp-idf 6695, 17798 and 18183: uart_write_bytes waits for ever when CTS stays high. */
TEST(a_transmitter_that_stops_is_a_status_in_bounded_time_and_then_works)
{
    for (size_t i = 0; i < COUNT(drivers); i++) {
        begin_master(drivers[i]);
        works(0);
        chip.isStopped = true;
        for (uint8_t round = 1; round < 10; round++) {
            const unsigned sent = chip.sent;

            IS(MBM_LINE_BUSY, ask());
            assert_int_equal(uart.stalled, round);
            assert_false(chip.isDriving);
            assert_int_equal(chip.sent, sent);
        }
        /* A request that was given up never leaves. */
        chip.isStopped = false;
        works(sizeof request);
    }
}

static void stop_in_frame(void)
{
    if (chip.sent == 3)
        chip.isStopped = true;
}

TEST(a_transmitter_that_stops_within_a_frame_sends_no_rest_of_it_later)
{
    for (size_t i = 0; i < COUNT(drivers); i++) {
        begin_master(drivers[i]);
        chip.pass = stop_in_frame;
        IS(MBM_LINE_BUSY, ask());
        assert_int_equal(chip.sent, 3);
        assert_false(chip.isDriving);
        chip.pass = NULL;
        chip.isStopped = false;
        works(3);
    }
}

TEST(a_write_while_a_frame_leaves_takes_nothing_and_never_waits)
{
    begin_master(MBM_ESP_IDF_NO_DRIVER);
    chip.isStopped = true;
    assert_int_equal(port.write(port.context, frame, sizeof frame), sizeof frame);
    for (int i = 0; i < 100; i++)
        assert_int_equal(port.write(port.context, frame, sizeof frame), 0);
    chip.isStopped = false;
    while (!port.flush(port.context))
        ;
    assert_int_equal(chip.sent, sizeof frame);
    assert_int_equal(port.write(port.context, frame, sizeof frame), sizeof frame);
}

TEST(a_server_whose_transmitter_stops_answers_again_once_it_works)
{
    for (size_t i = 0; i < COUNT(drivers); i++) {
        begin_server(drivers[i]);
        answers();
        chip.isStopped = true;
        esp_chip_receive(request, sizeof request);
        poll_for(MOST);
        assert_int_equal(uart.stalled, 1);
        assert_false(chip.isDriving);
        assert_int_equal(chip.sent, sizeof reply);
        chip.isStopped = false;
        answers();
    }
}

TEST(a_frame_longer_than_the_fifo_leaves_without_a_gap_and_has_its_driver)
{
    static const uint8_t long_request[] = {17, 3, 0, 0, 0, 120, 0x47, 0x78};

    for (size_t i = 1; i < COUNT(drivers); i++) {
        begin_server(drivers[i]);
        esp_chip_receive(long_request, sizeof long_request);
        poll_for(400000);
        assert_int_equal(chip.sent, 245);
        assert_int_equal(chip.undriven, 0);
        assert_false(chip.isDriving);
    }
}

/* The driver is off before a device may reply, 3.5 characters after the last bit. */
TEST(without_parity_and_with_one_stop_bit_the_driver_goes_off_in_time)
{
    static const uint8_t long_request[] = {17, 3, 0, 0, 0, 120, 0x47, 0x78};

    begin_server(MBM_ESP_IDF_DRIVER_BY_PIN);
    mbm_espIdf_close(&uart);
    uart.parity = UART_PARITY_DISABLE;
    uart.stopBits = UART_STOP_BITS_1;
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_OK);
    assert_int_equal(chip.bits, 10);
    esp_chip_receive(long_request, sizeof long_request);
    poll_for(400000);
    assert_int_equal(chip.sent, 245);
    assert_in_range(chip.freeAt - chip.sentAt, 0, 35 * 1000000 / 19200);
}

/* --- the UART */

TEST(a_uart_that_another_part_of_the_program_has_removed_is_a_status_and_then_works)
{
    for (size_t i = 0; i < COUNT(drivers); i++) {
        begin_master(drivers[i]);
        works(0);
        uart_driver_delete(UART_NUM_1);
        chip.isHeapFull = true;
        for (int round = 0; round < 5; round++)
            IS(MBM_LINK_LOST, ask());
        chip.isHeapFull = false;
        works(sizeof request);
        assert_int_equal(chip.bits, 11);
    }
}

TEST(a_server_goes_on_when_the_driver_is_installed_again)
{
    begin_server(MBM_ESP_IDF_DRIVER_BY_UART);
    uart_driver_delete(UART_NUM_1);
    chip.isHeapFull = true;
    poll_for(100000);
    chip.isHeapFull = false;
    poll_for(100000);
    answers();
}

static void refused(esp_err_t error)
{
    const mbm_port before = port;
    const mbm_espIdfLine settings = uart;

    assert_int_equal(mbm_espIdf_open(&uart, &port), error);
    assert_memory_equal(&port, &before, sizeof port);
    assert_memory_equal(&uart, &settings, sizeof uart);
    assert_false(esp_chip_is_installed());
}

TEST(a_uart_that_cannot_be_opened_is_an_error_that_changes_nothing_and_then_opens)
{
    uart.uart = UART_NUM_MAX;
    refused(ESP_FAIL);
    uart.uart = UART_NUM_1;
    chip.isForeign = true;
    refused(ESP_FAIL);
    chip.isForeign = false;
    chip.isHeapFull = true;
    refused(ESP_FAIL);
    chip.isHeapFull = false;
    uart.baud = 0;
    refused(ESP_ERR_INVALID_ARG);
    uart.baud = -9600;
    refused(ESP_ERR_INVALID_ARG);
    uart.baud = 6000000;
    refused(ESP_FAIL);
    uart.baud = 19200;
    assert_int_equal(mbm_espIdf_open(NULL, &port), ESP_ERR_INVALID_ARG);
    assert_int_equal(mbm_espIdf_open(&uart, NULL), ESP_ERR_INVALID_ARG);
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_OK);
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_ERR_INVALID_STATE);
    assert_true(esp_chip_is_installed());
}

TEST(a_pin_that_is_not_there_is_an_error_that_changes_nothing_and_then_opens)
{
    static const int pins[] = {UART_PIN_NO_CHANGE, ESP_BAD_PIN, 64, 1000, -7};

    for (size_t i = 0; i < COUNT(pins); i++) {
        uart.driver = MBM_ESP_IDF_DRIVER_BY_PIN;
        uart.driverPin = pins[i];
        refused(ESP_ERR_INVALID_ARG);
        uart.driver = MBM_ESP_IDF_DRIVER_BY_UART;
        refused(pins[i] == ESP_BAD_PIN ? ESP_FAIL : ESP_ERR_INVALID_ARG);
    }
    uart.driverPin = ESP_DRIVER_PIN;
    uart.txPin = ESP_BAD_PIN;
    refused(ESP_FAIL);
    begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
    works(0);
}

TEST(a_line_that_was_closed_is_a_lost_link_and_may_be_opened_again)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_PIN);
    mbm_espIdf_close(&uart);
    mbm_espIdf_close(&uart);
    IS(MBM_LINK_LOST, ask());
    assert_false(esp_chip_is_installed());
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_OK);
    works(0);
}

/* --- reception */

static const uint8_t flood[3000];

/* arduino-esp32 6326 and 6336: after an overflow nothing is received any more. */
TEST(bytes_that_the_program_is_too_late_for_are_counted_and_the_next_request_works)
{
    for (unsigned length = 1300; length <= sizeof flood; length += 100) {
        begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
        esp_chip_receive(flood, length);
        assert_true(user_read_all() < length);
        assert_true(uart.overruns > 0);
        works(0);
    }
}

/* esp-idf 7965: bytes are lost after 128. */
TEST(an_interrupt_that_comes_too_late_is_an_overrun_that_is_counted)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
    chip.isMasked = true;
    esp_chip_receive(flood, ESP_FIFO);
    esp_chip_unmask();
    assert_int_equal(user_read_all(), ESP_FIFO);
    assert_int_equal(uart.overruns, 0);
    chip.isMasked = true;
    esp_chip_receive(flood, ESP_FIFO + 1);
    esp_chip_unmask();
    assert_true(user_read_all() <= ESP_FIFO);
    assert_int_equal(uart.overruns, 1);
    works(0);
}

/* The driver drops the events that its queue does not take, so an overrun may be among them. */
TEST(an_overrun_whose_event_found_the_queue_full_is_counted)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
    esp_chip_receive(flood, MBM_MAX_FRAME);
    chip.isMasked = true;
    esp_chip_receive(flood, ESP_FIFO + 1);
    esp_chip_unmask();
    assert_true(user_read_all() < MBM_MAX_FRAME + ESP_FIFO + 1);
    assert_int_equal(uart.overruns, 1);
    works(0);
}

TEST(a_frame_between_two_reads_counts_nothing_and_a_full_buffer_loses_nothing)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
    esp_chip_receive(flood, MBM_MAX_FRAME - 1);
    assert_int_equal(user_read_all(), MBM_MAX_FRAME - 1);
    assert_int_equal(uart.overruns, 0);
    /* The ring is full, and the FIFO nearly. */
    esp_chip_receive(flood, 1024 + 1 + ESP_FIFO);
    assert_int_equal(user_read_all(), 1024 + 1 + ESP_FIFO);
    works(0);
}

/* esp-modbus 20, 78: such characters are not counted, and others of the frame are lost with them.
 */
TEST(a_damaged_character_is_counted_and_the_reply_after_it_is_right)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
    esp_chip_receive_faulty(0, UART_PARITY_ERR);
    works(0);
    assert_int_equal(uart.faulty, 1);
    esp_chip_receive_faulty(0xFF, UART_FRAME_ERR);
    works(sizeof request);
    assert_int_equal(uart.faulty, 2);
    assert_int_equal(uart.overruns, 0);
}

static void damage_reply(void)
{
    if (chip.sent == sizeof request && uart.faulty == 0)
        esp_chip_receive_faulty(0, UART_FRAME_ERR);
}

/* esp-modbus 145: a faulty byte drops the right reply that follows. */
TEST(a_spike_before_the_reply_loses_no_byte_of_it)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_PIN);
    chip.pass = damage_reply;
    works(0);
    assert_true(uart.faulty > 0);
}

TEST(counters_begin_at_0_when_the_line_is_opened)
{
    begin_master(MBM_ESP_IDF_DRIVER_BY_UART);
    esp_chip_receive(flood, sizeof flood);
    (void)user_read_all();
    chip.isStopped = true;
    IS(MBM_LINE_BUSY, ask());
    mbm_espIdf_close(&uart);
    assert_true(uart.overruns > 0 && uart.stalled > 0);
    assert_int_equal(mbm_espIdf_open(&uart, &port), ESP_OK);
    assert_int_equal(uart.overruns + uart.faulty + uart.stalled, 0);
}
