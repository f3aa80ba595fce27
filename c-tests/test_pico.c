/* The port for the Raspberry Pi Pico, over a model of its UART and of TinyUSB. */
#include "mbm_pico.h"
#include "pico_model.h"
#include "test.h"

#include "hardware/irq.h"

enum { DRIVER = 6, RECEIVED = 8, LONG_RESPONSE = 245 };

static mbm_picoUart line;
static mbm_picoUsb usb;
static mbm_port port;
static mbm_unit unit;
static uint16_t words[120];
static mbm_registerTable table;
static mbm_server server;
static uint8_t frame[MBM_MAX_FRAME];
/* Reads registers 0 and 1 of unit 1, and the response. */
static const uint8_t request[] = {1, 3, 0, 0, 0, 2, 0xC4, 0x0B};
static const uint8_t response[] = {1, 3, 4, 2, 0x2B, 0, 100, 0x8A, 0x68};
/* Reads 120 registers. TinyUSB's buffer and the endpoint together do not hold its response. */
static const uint8_t long_request[] = {1, 3, 0, 0, 0, 120, 0x45, 0xE8};

static void set_up(void)
{
    pico_reset();
    memset(&line, 0, sizeof line);
    memset(&usb, 0, sizeof usb);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    line.uart = uart1;
    line.baud = 19200;
    line.parity = UART_PARITY_EVEN;
    line.txPin = 4;
    line.rxPin = 5;
    line.driverPin = DRIVER;
    line.hasDriver = true;
    words[0] = 555;
    words[1] = 100;
    table.words = words;
    table.size = COUNT(words);
    unit.id = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
}

fixture each_test = {set_up, NULL}, all_tests;

static void receive(const uint8_t *bytes, unsigned length)
{
    for (unsigned i = 0; i < length; i++)
        pico_receive(bytes[i]);
}

/* --- UART */

TEST(a_server_on_the_uart_answers_and_switches_the_driver_off_after_the_last_bit)
{
    OK(mbm_picoUart_open(&line, &port));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, line.baud));
    receive(request, sizeof request);
    for (int i = 0; i < 100 && chip.sent < sizeof response; i++, chip.now += 500) {
        assert_true(mbm_server_poll(&server) >= MBM_OK);
        /* As long as a character leaves, the driver is on. */
        if (uart_get_hw(uart1)->fr & UART_UARTFR_BUSY_BITS)
            assert_true(chip.pins[DRIVER]);
        pico_send();
    }
    assert_int_equal(chip.sent, sizeof response);
    assert_memory_equal(chip.line, response, sizeof response);
    mbm_server_poll(&server);
    assert_false(chip.pins[DRIVER]);
}

TEST(a_frame_longer_than_the_fifo_is_taken_whole_and_sent_by_the_interrupt)
{
    uint8_t bytes[MBM_MAX_FRAME];

    for (unsigned i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)i;
    OK(mbm_picoUart_open(&line, &port));
    assert_int_equal(port.write(port.context, bytes, sizeof bytes), sizeof bytes);
    assert_int_equal(port.write(port.context, bytes, sizeof bytes), 0);
    assert_int_equal(port.flush(port.context), 0);
    while (pico_send())
        ;
    assert_int_equal(chip.sent, sizeof bytes);
    assert_memory_equal(chip.line, bytes, sizeof bytes);
    assert_int_equal(port.flush(port.context), 1);
}

/* The interrupt for received characters, as an echo or noise make it, comes in the middle of a
 * write. */
static void hear(void)
{
    if (uart_get_hw(uart1)->fr & UART_UARTFR_BUSY_BITS) {
        chip.putting = NULL;
        receive(request, 4);
    }
}

TEST(an_interrupt_in_a_write_neither_repeats_a_byte_nor_holds_the_line)
{
    OK(mbm_picoUart_open(&line, &port));
    chip.putting = hear;
    assert_int_equal(port.write(port.context, response, sizeof response), sizeof response);
    while (pico_send())
        ;
    assert_int_equal(chip.sent, sizeof response);
    assert_memory_equal(chip.line, response, sizeof response);
    assert_int_equal(port.flush(port.context), 1);
    assert_int_equal(port.write(port.context, response, sizeof response), sizeof response);
}

TEST(what_is_in_the_fifo_is_read_without_an_interrupt)
{
    uint8_t taken[RECEIVED];

    OK(mbm_picoUart_open(&line, &port));
    receive(request, 3);
    assert_int_equal(port.read(port.context, taken, sizeof taken), 3);
    assert_memory_equal(taken, request, 3);
}

TEST(an_overrun_of_the_fifo_is_counted)
{
    OK(mbm_picoUart_open(&line, &port));
    /* Another interrupt takes the processor. */
    irq_set_enabled(UART1_IRQ, false);
    for (unsigned i = 0; i < PICO_FIFO + 3; i++)
        pico_receive('a');
    irq_set_enabled(UART1_IRQ, true);
    pico_idle();
    pico_receive('b');
    pico_idle();
    assert_int_equal(line.overruns, 1);
    assert_int_equal(mbm_ring_available(&line.ring), PICO_FIFO + 1);
}

TEST(bytes_that_the_program_reads_too_late_are_counted)
{
    OK(mbm_picoUart_open(&line, &port));
    for (unsigned i = 0; i < MBM_MAX_FRAME + 4; i++)
        pico_receive('a');
    assert_int_equal(mbm_picoUart_lost(&line), 4);
    assert_int_equal(mbm_picoUart_lost(NULL), 0);
}

TEST(damaged_characters_are_counted_and_passed_on)
{
    uint8_t taken[RECEIVED];

    OK(mbm_picoUart_open(&line, &port));
    pico_receive('a' | UART_UARTDR_FE_BITS);
    pico_receive('b' | UART_UARTDR_PE_BITS);
    pico_receive(UART_UARTDR_BE_BITS | UART_UARTDR_FE_BITS);
    assert_int_equal(port.read(port.context, taken, sizeof taken), 3);
    assert_int_equal(line.faulty, 3);
}

/* --- a frame that does not leave */

/* Begins a server, and polls it until it sends the response to a request. */
static void begin_to_answer(void)
{
    OK(mbm_picoUart_open(&line, &port));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, line.baud));
    receive(long_request, sizeof long_request);
    while (!chip.pins[DRIVER]) {
        chip.now += 500;
        mbm_server_poll(&server);
    }
}

/* Polls a server whose response does not leave, until the driver is off. Returns how long that
 * took, in milliseconds. */
static uint32_t until_given_up(void)
{
    const uint32_t since = chip.now;

    while (chip.pins[DRIVER]) {
        chip.now += 1000;
        assert_in_range(chip.now - since, 0, 10000000);
        mbm_server_poll(&server);
    }
    return (chip.now - since) / 1000;
}

/* Reads all that the UART sends as response to the short request. */
static void answers_on_the_uart(void)
{
    chip.sent = 0;
    receive(request, sizeof request);
    for (int i = 0; i < 100; i++, chip.now += 500) {
        mbm_server_poll(&server);
        pico_send();
    }
    assert_int_equal(chip.sent, sizeof response);
    assert_memory_equal(chip.line, response, sizeof response);
    assert_false(chip.pins[DRIVER]);
}

TEST(a_response_that_stops_at_any_character_is_given_up_and_the_next_one_is_whole)
{
    for (unsigned at = 0; at < LONG_RESPONSE; at++) {
        set_up();
        begin_to_answer();
        while (chip.sent < at)
            pico_send();
        /* Twice the time of its characters and of a full FIFO, at 12 bits each, and 50 ms. */
        assert_in_range(until_given_up(), 396, 397);
        assert_int_equal(line.stalled, 1);
        IS(MBM_LINK_LOST, mbm_server_poll(&server));
        assert_int_equal(mbm_server_poll(&server), MBM_OK);
        chip.now += 1000000;
        answers_on_the_uart();
        assert_int_equal(line.stalled, 1);
    }
}

TEST(a_response_whose_interrupt_does_not_come_is_given_up)
{
    begin_to_answer();
    irq_set_enabled(UART1_IRQ, false);
    while (pico_send())
        ;
    assert_int_equal(chip.sent, PICO_FIFO);
    until_given_up();
    assert_int_equal(line.stalled, 1);
    irq_set_enabled(UART1_IRQ, true);
    IS(MBM_LINK_LOST, mbm_server_poll(&server));
    chip.now += 1000000;
    answers_on_the_uart();
}

TEST(a_request_that_does_not_leave_ends_its_call_and_the_next_one_leaves)
{
    mbm_line bus = MBM_INIT;
    mbm_node node = MBM_INIT;
    uint16_t taken[2] = {0};

    OK(mbm_picoUart_open(&line, &port));
    OK(mbm_line_beginRtu(&bus, &port, frame, sizeof frame));
    OK(mbm_line_setBaudRate(&bus, line.baud));
    OK(mbm_node_begin(&node, &bus, 1, taken, 2, NULL, 0));
    OK(mbm_node_setBlocking(&node, 0));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&node, 0, 2));
    while (mbm_node_poll(&node) == MBM_PENDING)
        chip.now += 1000;
    IS(MBM_LINK_LOST, mbm_node_status(&node));
    assert_int_equal(line.stalled, 1);
    assert_false(chip.pins[DRIVER]);
    chip.now += 1000000;
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&node, 0, 2));
    while (chip.sent < sizeof request) {
        chip.now += 500;
        IS(MBM_PENDING, mbm_node_poll(&node));
        pico_send();
    }
    assert_memory_equal(chip.line, request, sizeof request);
    IS(MBM_PENDING, mbm_node_poll(&node));
    receive(response, sizeof response);
    while (mbm_node_poll(&node) == MBM_PENDING)
        chip.now += 500;
    OK(mbm_node_status(&node));
    assert_int_equal(taken[0], 555);
}

/* A piece of a frame in ASCII is taken while the FIFO still holds 32 characters of the one
 * before, which last 320 ms. */
TEST(a_short_piece_after_a_full_fifo_is_not_given_up)
{
    const uint32_t character = 12 * 1000000 / 1200;

    line.baud = 1200;
    OK(mbm_picoUart_open(&line, &port));
    assert_int_equal(port.write(port.context, long_request, sizeof long_request),
                     sizeof long_request);
    for (unsigned pieces = 0; pieces < 3; pieces++)
        port.write(port.context, long_request, sizeof long_request);
    assert_int_equal(port.write(port.context, long_request, 1), 1);
    for (unsigned sent = 0; sent < PICO_FIFO + 1; sent++) {
        chip.now += character;
        assert_int_equal(port.flush(port.context), 0);
        assert_true(pico_send());
    }
    assert_int_equal(port.flush(port.context), 1);
    assert_int_equal(line.stalled, 0);
}

TEST(a_frame_that_has_left_is_not_given_up_when_the_program_comes_late)
{
    OK(mbm_picoUart_open(&line, &port));
    assert_int_equal(port.write(port.context, response, sizeof response), sizeof response);
    while (pico_send())
        ;
    chip.now += 60000000;
    assert_int_equal(port.flush(port.context), 1);
    assert_int_equal(port.write(port.context, response, sizeof response), sizeof response);
    assert_int_equal(line.stalled, 0);
}

TEST(a_line_whose_frame_does_not_leave_is_opened_again_after_its_time)
{
    OK(mbm_picoUart_open(&line, &port));
    assert_int_equal(port.write(port.context, frame, sizeof frame), sizeof frame);
    chip.now += 300000;
    IS(MBM_BUSY, mbm_picoUart_open(&line, &port));
    chip.now += 500000;
    OK(mbm_picoUart_open(&line, &port));
    assert_int_equal(port.write(port.context, frame, sizeof frame), sizeof frame);
}

TEST(a_uart_that_cannot_be_is_refused)
{
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(NULL, &port));
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, NULL));
    line.driverPin = 30;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, &port));
    line.driverPin = DRIVER;
    line.baud = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, &port));
    line.baud = PICO_CLOCK / 16 + 1;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, &port));
    line.baud = PICO_CLOCK / 16 / 65535 - 1;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, &port));
    assert_int_equal(chip.baud, 0);
    line.baud = 9600;
    chip.hasNoClock = true;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, &port));
    chip.hasNoClock = false;
    line.uart = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUart_open(&line, &port));
    line.uart = uart1;
    OK(mbm_picoUart_open(&line, &port));
    for (unsigned i = 0; i < 2; i++)
        port.write(port.context, frame, sizeof frame);
    IS(MBM_BUSY, mbm_picoUart_open(&line, &port));
}

/* --- USB */

static void serve_usb(void)
{
    OK(mbm_picoUsb_open(&usb, &port));
    OK(mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, frame, sizeof frame));
}

/* A pass of the main loop of examples/pico/serve_usb.c. */
static void turn(void)
{
    chip.now += 100;
    if (mbm_server_poll(&server) == MBM_LINK_LOST)
        mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, frame, sizeof frame);
}

static void answers(void)
{
    chip.toHostLength = 0;
    pico_from_host(request, sizeof request);
    for (int i = 0; i < 10; i++)
        turn();
    assert_int_equal(chip.toHostLength, sizeof response);
    assert_memory_equal(chip.toHost, response, sizeof response);
}

TEST(a_server_on_usb_answers)
{
    serve_usb();
    answers();
}

TEST(after_the_cable_was_pulled_in_a_request_the_next_one_is_answered)
{
    serve_usb();
    pico_from_host(request, 5);
    turn();
    chip.isUp = false;
    IS(MBM_LINK_LOST, mbm_server_poll(&server));
    turn();
    chip.isUp = true;
    answers();
}

TEST(after_the_host_closed_its_port_in_a_request_the_next_one_is_answered)
{
    serve_usb();
    pico_from_host(request, 5);
    turn();
    chip.isOpen = false;
    turn();
    chip.isOpen = true;
    answers();
}

TEST(a_host_that_does_not_set_dtr_is_answered)
{
    chip.isOpen = false;
    serve_usb();
    answers();
}

TEST(a_response_waits_for_a_host_that_does_not_read)
{
    serve_usb();
    turn();
    chip.reads = false;
    pico_from_host(long_request, sizeof long_request);
    for (int i = 0; i < 20; i++)
        turn();
    assert_int_equal(chip.toHostLength, 0);
    chip.reads = true;
    for (int i = 0; i < 20; i++)
        turn();
    assert_int_equal(chip.toHostLength, LONG_RESPONSE);
    answers();
}

/* The packet in the endpoint cannot be taken back. */
TEST(of_a_response_that_was_not_read_the_next_program_gets_one_packet_at_most)
{
    serve_usb();
    turn();
    chip.reads = false;
    pico_from_host(long_request, sizeof long_request);
    for (int i = 0; i < 10; i++)
        turn();
    chip.isOpen = false;
    turn();
    chip.isOpen = chip.reads = true;
    for (int i = 0; i < 10; i++)
        turn();
    assert_int_equal(chip.toHostLength, PICO_PACKET);
    answers();
}

TEST(a_host_that_closes_its_port_while_the_last_bytes_wait_is_a_lost_link)
{
    serve_usb();
    chip.reads = false;
    for (int i = 0; i < 2; i++) {
        pico_from_host(request, sizeof request);
        OK(mbm_server_poll(&server));
    }
    chip.isOpen = false;
    mbm_server_poll(&server);
    IS(MBM_LINK_LOST, mbm_server_poll(&server));
    chip.isOpen = chip.reads = true;
    turn();
    answers();
}

/* Polls for a second, in which the host reads nothing of a response. */
static void is_given_up_in_a_second(void)
{
    const uint32_t since = chip.now;
    uint8_t status = MBM_OK;

    while (status != MBM_LINK_LOST) {
        assert_true(chip.now - since < 1010000);
        chip.now += 1000;
        status = mbm_server_poll(&server);
    }
    assert_in_range(chip.now - since, 1000000, 1010000);
    assert_int_equal(usb.stalled, 1);
}

TEST(a_response_that_the_host_does_not_read_is_given_up_and_the_next_one_is_whole)
{
    for (int isShort = 0; isShort < 2; isShort++) {
        set_up();
        serve_usb();
        turn();
        chip.reads = false;
        /* The endpoint takes a short response. Behind it another one waits in the buffer. */
        for (int i = 0; i <= isShort; i++) {
            pico_from_host(isShort ? request : long_request, sizeof request);
            turn();
        }
        is_given_up_in_a_second();
        chip.reads = true;
        turn();
        answers();
        assert_int_equal(usb.stalled, 1);
    }
}

TEST(a_host_that_reads_slowly_gets_the_whole_response)
{
    serve_usb();
    turn();
    pico_from_host(long_request, sizeof long_request);
    while (chip.toHostLength < LONG_RESPONSE) {
        /* It takes a packet every 900 ms. */
        chip.reads = chip.now % 900000 < 1000;
        chip.now += 1000;
        IS(MBM_OK, mbm_server_poll(&server));
    }
    assert_true(chip.now > 3 * 900000);
    assert_int_equal(usb.stalled, 0);
    chip.reads = true;
    answers();
}

TEST(a_program_may_call_tud_task_itself)
{
    usb.hasOwnTask = true;
    serve_usb();
    turn();
    assert_int_equal(chip.tasks, 0);
}

TEST(a_serial_port_that_is_not_there_is_refused)
{
    usb.number = 1;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUsb_open(&usb, &port));
    IS(MBM_INVALID_ARGUMENT, mbm_picoUsb_open(NULL, &port));
    usb.number = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_picoUsb_open(&usb, NULL));
}
