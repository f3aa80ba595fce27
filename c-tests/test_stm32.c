/* The port for STM32 on a chip that is played: at every position of the DMA, with errors at every
 * character, before a quick device, and with every fault of a program or a board.
 * scripts/check/real_stm32.py runs these tests with ST's HAL. */
#include "crc.h"
#include "machine.h"
#include "test.h"
#include "uart.h"

enum { UNIT = 17, TIMEOUT = 100 /* ms */ };

static mbm_line line;
static mbm_node node;
static uint16_t words[125];
static uint8_t frame[MBM_MAX_FRAME];

/* --- a device that answers from the wire's side */

static unsigned answered;         /* how much of the wire it has read */
static uint32_t pause;            /* microseconds between the last bit and its reply */
static unsigned faultyAt, errors; /* the character of its reply that has these errors */
static uint8_t isMute;

static uint16_t value(unsigned number)
{
    return (uint16_t)(number * 40503u + 77u);
}

/* Answers a read of holding registers with its last bit. */
static void device(void)
{
    uint8_t reply[MBM_MAX_FRAME] = {UNIT, 3};
    const uint8_t *request = m.sent + answered;
    unsigned quantity, length, i;

    if (m.sentCount - answered < 8 || crc16(request, 8) != 0)
        return;
    answered = m.sentCount;
    if (isMute || request[0] != UNIT)
        return;
    quantity = request[5];
    reply[2] = (uint8_t)(2 * quantity);
    for (i = 0; i < quantity; i++) {
        reply[3 + 2 * i] = (uint8_t)(value(request[3] + i) >> 8);
        reply[4 + 2 * i] = (uint8_t)value(request[3] + i);
    }
    length = (unsigned)seal(reply, 3 + 2 * quantity);
    if (errors == 0) {
        machine_receive(reply, length, pause);
        return;
    }
    machine_receive(reply, faultyAt, pause);
    machine_receive_faulty(reply[faultyAt], errors);
    machine_receive(reply + faultyAt + 1, length - faultyAt - 1, 0);
}

static void start(uint8_t byDma)
{
    uart_start(byDma);
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    answered = pause = faultyAt = errors = 0;
    isMute = 0;
    m.device = device;
}

static void open_line(void)
{
    uart_open();
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_line_setBaudRate(&line, huart1.Init.BaudRate));
    OK(mbm_node_begin(&node, &line, UNIT, words, 125, NULL, 0));
    OK(mbm_node_setResponseTimeout(&node, TIMEOUT));
    OK(mbm_node_setBlocking(&node, 0));
}

/* Begins to read registers, and polls every `step` microseconds until so many characters of the
 * request have left. */
static uint8_t begin_read(uint16_t address, uint16_t quantity, unsigned characters, uint32_t step)
{
    unsigned end = m.sentCount + characters;
    uint8_t status = mbm_node_readHoldingRegisters(&node, address, quantity);

    while (m.sentCount < end) {
        machine_run(step);
        status = mbm_node_poll(&node);
    }
    return status;
}

/* Polls every `step` microseconds until a request has ended, whose status now is `status`. */
static uint8_t end_read(uint8_t status, uint32_t step)
{
    uint64_t end = m.now + 5000000000u;

    while (status == MBM_PENDING) {
        machine_run(step);
        status = mbm_node_poll(&node);
        if (m.now > end)
            fail_msg("a request never ends");
    }
    return status;
}

/* Reads registers, with a main loop that comes every `step` microseconds. */
static uint8_t read_words(uint16_t address, uint16_t quantity, uint32_t step)
{
    return end_read(mbm_node_readHoldingRegisters(&node, address, quantity), step);
}

static void reads(uint16_t address, uint16_t quantity, uint32_t step)
{
    memset(words, 0, sizeof words);
    OK(read_words(address, quantity, step));
    for (unsigned i = 0; i < quantity; i++)
        assert_int_equal(words[i], value(address + i));
}

/* --- reception */

static void reads_at_every_position(uint8_t byDma)
{
    start(byDma);
    open_line();
    /* Replies of every length up to half of the buffer begin and end at every place of it. */
    for (uint16_t quantity = 1; quantity <= 25; quantity++)
        for (unsigned round = 0; round < 64; round++)
            reads((uint16_t)round, quantity, 250 + 7 * round);
    assert_int_equal(mbm_stm32_lost(&uart), 0);
    assert_int_equal(uart.overruns + uart.faulty + uart.restarts + uart.stalled, 0);
    uart_is_quiet();
}

TEST(by_dma_a_master_reads_at_every_position_of_the_buffer)
{
    reads_at_every_position(1);
}

TEST(by_interrupt_a_master_reads_at_every_position_of_the_buffer)
{
    reads_at_every_position(0);
}

static void long_reply_is_taken_in_parts(uint8_t byDma)
{
    start(byDma);
    open_line();
    /* 255 characters through a buffer of 64, with a main loop that comes in time. */
    for (unsigned round = 0; round < 70; round++)
        reads((uint16_t)round, 125, 3000);
    assert_int_equal(mbm_stm32_lost(&uart), 0);
}

TEST(a_reply_that_is_longer_than_the_buffer_is_taken_in_parts)
{
    long_reply_is_taken_in_parts(0);
    long_reply_is_taken_in_parts(1);
}

static void late_main_loop_is_counted(uint8_t byDma)
{
    uint16_t lost = 0;

    start(byDma);
    open_line();
    for (unsigned round = 0; round < 30; round++) {
        IS(MBM_PENDING, begin_read(3, 125, 8, 200));
        /* The main loop is away for the whole reply, 255 characters, and one more. */
        machine_run(40000 + 10 * round);
        assert_int_not_equal(end_read(mbm_node_poll(&node), 500), MBM_OK);
        lost = (uint16_t)(lost + 255 - 63);
        assert_int_equal(mbm_stm32_lost(&uart), lost);
        machine_run(300000);
        reads(3, 2, 500);
    }
    /* The count does not begin again with reception. */
    chip_abort_reception();
    machine_run(1000);
    reads(3, 2, 500);
    assert_int_equal(mbm_stm32_lost(&uart), lost);
}

TEST(bytes_that_the_main_loop_was_too_late_for_are_counted_and_the_next_request_works)
{
    late_main_loop_is_counted(0);
    late_main_loop_is_counted(1);
}

static void errors_at_every_character(uint8_t byDma)
{
    static const unsigned kinds[] = {FRAMING, NOISE, PARITY, OVERRUN, FRAMING | NOISE};

    for (unsigned kind = 0; kind < COUNT(kinds); kind++) {
        uint16_t seen;

        start(byDma);
        open_line();
        for (unsigned round = 0; round < 64; round++) {
            uint8_t status;

            faultyAt = round % 9;
            errors = kinds[kind];
            status = read_words(7, 2, 100);
            if (status != MBM_OK && status != MBM_INVALID_CRC && status != MBM_RESPONSE_TIMED_OUT)
                fail_msg("status %02X", status);
            errors = 0;
            machine_run(2 * TIMEOUT * 1000);
            reads(9, 3, 100);
        }
        seen = kinds[kind] & OVERRUN ? uart.overruns : uart.faulty;
        if (seen < 60)
            fail_msg("of 64 errors %u, %u were counted", kinds[kind], seen);
        uart_is_quiet();
    }
}

TEST(by_dma_reception_goes_on_after_each_error_at_each_character)
{
    errors_at_every_character(1);
}

TEST(by_interrupt_reception_goes_on_after_each_error_at_each_character)
{
    errors_at_every_character(0);
}

static void reply_before_disturbed_characters_is_read(uint8_t byDma)
{
    static const unsigned kinds[] = {FRAMING, NOISE, PARITY};

    start(byDma);
    open_line();
    pause = 500;
    for (unsigned round = 0; round < 96; round++) {
        unsigned end = m.sentCount + 8;

        IS(MBM_PENDING, begin_read(5, 2, 7, 50));
        while (m.sentCount < end)
            machine_run(10);
        /* The reply arrives, and nobody reads it. Then the device's driver disturbs the line. */
        machine_run(2000 + round);
        for (unsigned glitches = round % 4; glitches > 0; glitches--)
            machine_receive_faulty(0, kinds[round % 3]);
        machine_run(1000);
        OK(end_read(mbm_node_poll(&node), 50));
        assert_int_equal(words[1], value(6));
        machine_run(1000);
    }
}

TEST(a_reply_is_not_lost_because_disturbed_characters_follow_it)
{
    reply_before_disturbed_characters_is_read(0);
    reply_before_disturbed_characters_is_read(1);
}

static void reception_that_was_aborted_begins_again(uint8_t byDma)
{
    start(byDma);
    open_line();
    for (unsigned at = 1; at <= 9; at++) {
        uint8_t status = begin_read(5, 2, 8, 50);

        machine_run(96 * at);
        chip_abort_reception();
        status = end_read(status, 50);
        /* What had arrived before is not lost. */
        if (at == 9)
            OK(status);
        machine_run(300000);
        reads(1, 2, 300);
        assert_int_equal(uart.restarts, at);
    }
}

TEST(reception_that_another_part_of_the_program_ends_begins_again)
{
    reception_that_was_aborted_begins_again(0);
    reception_that_was_aborted_begins_again(1);
}

TEST(interrupts_that_wait_for_some_characters_lose_nothing_by_dma)
{
    start(1);
    open_line();
    for (unsigned round = 0; round < 64; round++) {
        uint8_t status = mbm_node_readHoldingRegisters(&node, 5, 12);

        while (status == MBM_PENDING) {
            m.isMasked = m.sentCount % 8 == 0 && machine_coming() > 4 && machine_coming() < 25;
            machine_run(100);
            status = mbm_node_poll(&node);
        }
        OK(status);
        assert_int_equal(words[11], value(16));
    }
    assert_int_equal(mbm_stm32_lost(&uart), 0);
}

TEST(an_interrupt_that_comes_too_late_for_a_character_is_an_overrun_that_is_counted)
{
    uint8_t status;
    unsigned kept;

    start(0);
    open_line();
    kept = chip_kept();
    status = mbm_node_readHoldingRegisters(&node, 5, (uint16_t)(4 + kept));
    while (status == MBM_PENDING) {
        m.isMasked = machine_coming() > 4 && machine_coming() < 7 + kept;
        machine_run(50);
        status = mbm_node_poll(&node);
    }
    assert_int_not_equal(status, MBM_OK);
    assert_true(uart.overruns > 0);
    m.isMasked = 0;
    machine_run(300000);
    reads(5, 4, 50);
}

/* --- transmission */

static void quick_device(uint8_t byDma, uint32_t step)
{
    unsigned sent;

    start(byDma);
    open_line();
    for (unsigned round = 0; round < 100; round++) {
        reads((uint16_t)round, 2, step + round);
        sent = m.sentCount;
        /* In the interrupt, so with the last bit. */
        assert_true(m.driverOff == m.sentAt[sent - 1]);
        m.sentCount = answered = 0;
    }
    assert_int_equal(m.driverChanges, 200);
    uart_is_quiet();
}

TEST(a_device_that_replies_with_the_last_bit_is_received_100_of_100_times)
{
    quick_device(0, 50);
    quick_device(1, 50);
    quick_device(0, 5000);
    quick_device(1, 5000);
}

TEST(a_single_wire_receives_with_the_last_bit)
{
    for (uint8_t byDma = 0; byDma < 2; byDma++) {
        start(byDma);
        uart.driverPort = NULL;
        chip_single_wire();
        open_line();
        for (unsigned round = 0; round < 100; round++)
            reads((uint16_t)round, 2, 5000);
        uart_is_quiet();
        assert_int_equal(m.driverChanges, 200);
    }
}

TEST(a_frame_that_is_longer_than_the_send_buffer_keeps_the_driver_on)
{
    static mbm_client client;
    static mbm_clientRequest request;
    static uint8_t ascii[513];
    static uint16_t data[123];
    unsigned changes;

    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    start(1);
    m.device = NULL;
    uart_open();
    OK(mbm_client_beginAscii(&client, &port, ascii, sizeof ascii));
    OK(mbm_client_setBaudRate(&client, 115200));
    request.unit = 0;
    request.data = data;
    changes = m.driverChanges;
    IS(MBM_PENDING, mbm_client_writeMultipleRegisters(&client, &request, 0, 123));
    while (request.status == MBM_PENDING) {
        machine_run(400);
        mbm_client_poll(&client);
    }
    OK(request.status);
    assert_int_equal(m.sentCount, 2 * (7 + 246 + 1) + 3);
    assert_int_equal(m.sent[m.sentCount - 1], '\n');
    assert_int_equal(m.driverChanges, changes + 2);
    uart_is_quiet();
}

/* --- faults of program and board: a status, and the next request works */

TEST(a_uart_that_is_not_started_is_a_status_and_then_works)
{
    uint8_t nothing[MBM_STM32_RECEIVE_BYTES];

    start(1);
    chip_stop_uart();
    assert_int_equal(mbm_stm32_open(&uart, &huart1, &port), MBM_STM32_NOT_STARTED);
    chip_start_uart();
    open_line();
    reads(5, 2, 500);
    chip_stop_uart();
    IS(MBM_LINK_LOST, read_words(5, 2, 500));
    IS(MBM_LINK_LOST, read_words(5, 2, 500));
    chip_start_uart();
    assert_int_equal(port.read(&uart, nothing, sizeof nothing), 0);
    machine_run(10000);
    reads(5, 2, 500);
    uart_is_quiet();
}

TEST(a_transmission_that_does_not_end_is_a_status_and_then_works)
{
    for (uint8_t byDma = 0; byDma < 2; byDma++) {
        start(byDma);
        open_line();
        OK(mbm_node_setResponseTimeout(&node, 1000));
        m.txDmaStops = 1;
        IS(MBM_LINK_LOST, read_words(5, 2, 500));
        assert_int_equal(uart.stalled, 1);
        assert_int_equal(m.isDriving, 0);
        m.txDmaStops = 0;
        machine_run(10000);
        answered = m.sentCount;
        reads(5, 2, 500);
    }
}

TEST(a_reception_dma_that_stops_is_a_status_and_then_works)
{
    start(1);
    open_line();
    reads(5, 2, 500);
    m.rxDmaStops = 1;
    IS(MBM_RESPONSE_TIMED_OUT, read_words(5, 2, 500));
    m.rxDmaStops = 0;
    machine_run(1000000);
    reads(5, 2, 500);
    assert_true(uart.restarts > 0);
}

TEST(a_pin_that_keeps_nothing_is_a_status_and_then_works)
{
    start(1);
    open_line();
    m.hasNoPin = 1;
    IS(MBM_LINK_LOST, read_words(5, 2, 500));
    assert_int_equal(m.sentCount, 0);
    m.hasNoPin = 0;
    reads(5, 2, 500);
    uart_is_quiet();
}

TEST(another_transmission_on_the_uart_is_a_status_and_then_works)
{
    start(0);
    open_line();
    huart1.gState = HAL_UART_STATE_BUSY_TX;
    IS(MBM_LINE_BUSY, read_words(5, 2, 500));
    huart1.gState = HAL_UART_STATE_READY;
    reads(5, 2, 500);
    uart_is_quiet();
}

TEST(a_device_that_is_mute_is_a_timeout_and_then_heard)
{
    start(1);
    open_line();
    isMute = 1;
    IS(MBM_RESPONSE_TIMED_OUT, read_words(5, 2, 500));
    isMute = 0;
    reads(5, 2, 500);
}

/* --- the call that begins */

static void refused(uint8_t fault)
{
    mbm_stm32Line before = uart;

    assert_int_equal(mbm_stm32_open(&uart, &huart1, &port), fault);
    assert_memory_equal(&before, &uart, sizeof uart);
    assert_true(strlen(mbm_stm32_text(fault)) > 10);
}

TEST(a_wrong_configuration_has_a_sentence_and_changes_nothing)
{
    static mbm_stm32Line other;

    start(1);
    assert_int_equal(mbm_stm32_open(NULL, &huart1, &port), MBM_STM32_NULL);
    assert_int_equal(mbm_stm32_open(&uart, NULL, &port), MBM_STM32_NULL);
    assert_int_equal(mbm_stm32_open(&uart, &huart1, NULL), MBM_STM32_NULL);
    /* 8 bits with the parity are 7 bits of data. */
    huart1.Init.WordLength = UART_WORDLENGTH_8B;
    refused(MBM_STM32_FORMAT);
    huart1.Init.Parity = UART_PARITY_NONE;
    huart1.Init.WordLength = UART_WORDLENGTH_9B;
    refused(MBM_STM32_FORMAT);
    huart1.Init.WordLength = UART_WORDLENGTH_8B;
    huart1.Init.Mode = UART_MODE_TX;
    refused(MBM_STM32_FORMAT);
    huart1.Init.Mode = UART_MODE_TX_RX;
    huart1.hdmarx->Init.Mode = DMA_NORMAL;
    refused(MBM_STM32_RECEIVE_DMA);
    huart1.hdmarx->Init.Mode = DMA_CIRCULAR;
    huart1.hdmatx->Init.Mode = DMA_CIRCULAR;
    refused(MBM_STM32_TRANSMIT_DMA);
    huart1.hdmatx->Init.Mode = DMA_NORMAL;
    huart1.RxState = HAL_UART_STATE_BUSY_RX;
    refused(MBM_STM32_BUSY);
    huart1.RxState = HAL_UART_STATE_READY;
    uart.driverPin = 0;
    refused(MBM_STM32_PIN);
    uart.driverPin = GPIO_PIN_8;
    open_line();
    refused(MBM_STM32_OPEN);
    assert_int_equal(mbm_stm32_open(&other, &huart1, &port), MBM_STM32_OPEN);
}

TEST(a_line_that_was_closed_is_a_lost_link_and_may_be_opened_again)
{
    start(1);
    open_line();
    reads(5, 2, 500);
    mbm_stm32_close(&uart);
    mbm_stm32_close(&uart);
    IS(MBM_LINK_LOST, read_words(5, 2, 500));
    assert_int_equal(huart1.RxState, HAL_UART_STATE_READY);
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    open_line();
    reads(5, 2, 500);
}

TEST(a_line_that_was_zeroed_while_it_was_open_may_be_opened_again)
{
    static UART_HandleTypeDef console;

    start(1);
    open_line();
    chip_abort_reception();
    memset(&uart, 0, sizeof uart);
    open_line();
    mbm_stm32_noteReceived(&console);
    reads(5, 2, 500);
}

/* The callbacks of the HAL are those of all UARTs. */
TEST(callbacks_of_another_uart_change_nothing)
{
    static UART_HandleTypeDef console;
    mbm_stm32Line before;

    start(1);
    open_line();
    before = uart;
    mbm_stm32_noteReceived(&console);
    mbm_stm32_noteTransmitted(&console);
    mbm_stm32_noteError(&console);
    assert_memory_equal(&before, &uart, sizeof uart);
}

static unsigned wakes;

static void count_wake(void *context)
{
    assert_ptr_equal(context, &wakes);
    wakes++;
}

TEST(a_task_is_woken_by_the_last_bit_and_by_the_idle_line)
{
    start(1);
    uart.wake = count_wake;
    uart.context = &wakes;
    wakes = 0;
    open_line();
    reads(5, 2, 500);
    machine_run(1000);
    assert_int_equal(wakes, 2);
}

TEST(the_clock_counts_microseconds_and_never_steps_back)
{
    uint32_t before, now;

    start(1);
    open_line();
    before = port.micros(&uart);
    for (unsigned step = 0; step < 20000; step++) {
        machine_run(7);
        now = port.micros(&uart);
        assert_true(now - before >= 6 && now - before <= 8);
        before = now;
    }
    /* Where the tick of the HAL is another timer's, the two are out of step. */
    for (unsigned step = 0; step < 20000; step++) {
        machine_run(7);
        SysTick->VAL = (SysTick->VAL + 7000) % 16000;
        now = port.micros(&uart);
        assert_true(now - before < 2000);
        before = now;
    }
}
