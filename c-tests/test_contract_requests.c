/* The contract with programs for ModbusMaster: the buffers of words and the queue. The bytes that
 * each function sends and takes are in test_exchanges.c. Unit 17 is 11 on the wire. */
#include "sim.h"
#include "test.h"

#define WORD(index) s->response[index]
#define LAST(text) sim_assert_sent(s, s->sent - 1, text)

/* Queues a word for the empty queue of address 7, and writes the queue. */
static void one_queued_word_is_written(sim *s)
{
    OK(mbm_node_send(&s->node, 0xBBBB));
    sim_answer(s, 1, 100, "11 10 00 07 00 01 +");
    OK(mbm_node_writeQueuedRegisters(&s->node));
    LAST("11 10 00 07 00 01 02 BB BB +");
}

SIM_TEST(a_transmit_word_that_the_program_sets_leaves_the_queue)
{
    OK(mbm_node_beginTransmission(n, 7));
    s->transmit[122] = 1;
    s->transmit[0] = 0xAAAA;
    one_queued_word_is_written(s);
}

/* The program clears the words of both buffers: by the calls, or itself. */
static void indices_stay(sim *s, int by_call)
{
    mbm_node *n = &s->node;

    sim_answer(s, 1, 100, "11 03 04 00 01 00 02 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    assert_int_equal(mbm_node_receive(n), 1);
    if (by_call)
        OK(mbm_node_clearResponseBuffer(n));
    else
        memset(s->response, 0, sizeof s->response);
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(mbm_node_receive(n), 0);
    OK(mbm_node_beginTransmission(n, 3));
    OK(mbm_node_send(n, 0x1111));
    if (by_call)
        OK(mbm_node_clearTransmitBuffer(n));
    else
        memset(s->transmit, 0, sizeof s->transmit);
    OK(mbm_node_send(n, 0x2222));
    sim_answer(s, 1, 100, "11 10 00 03 00 02 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 03 00 02 04 00 00 22 22 +");
}

SIM_ROW(words_that_the_program_changes_leave_the_indices_alone, indices_stay(s, 0))
SIM_ROW(clearing_the_buffers_leaves_the_indices_alone, indices_stay(s, 1))

SIM_TEST(get_response_buffer_returns_ffff_past_the_end)
{
    OK(mbm_node_clearResponseBuffer(n));
    assert_int_equal(mbm_node_getResponseBuffer(n, 124), 0);
    assert_int_equal(mbm_node_getResponseBuffer(n, 125), 0xFFFF);
    assert_int_equal(mbm_node_getResponseBuffer(n, 255), 0xFFFF);
}

SIM_TEST(set_transmit_buffer_returns_2_past_the_end_and_leaves_the_queue)
{
    OK(mbm_node_beginTransmission(n, 7));
    OK(mbm_node_setTransmitBuffer(n, 122, 1));
    IS(2, mbm_node_setTransmitBuffer(n, 123, 1));
    IS(2, mbm_node_setTransmitBuffer(n, 255, 1));
    OK(mbm_node_setTransmitBuffer(n, 0, 0xAAAA));
    one_queued_word_is_written(s);
}

SIM_TEST(response_words_survive_a_failure_and_transmit_words_every_request)
{
    sim_answer(s, 1, 100, "11 03 04 12 34 56 78 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    OK(mbm_node_setTransmitBuffer(n, 1, 0x4711));
    sim_answer(s, 1, 100, "11 83 02 +");
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, 0, 2));
    assert_int_equal(mbm_node_getResponseBuffer(n, 1), 0x5678);
    sim_answer(s, 1, 100, "11 10 00 09 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 9, 2));
    LAST("11 10 00 09 00 02 04 00 00 47 11 +");
}

SIM_TEST(request_from_returns_how_many_words_receive_will_return)
{
    sim_answer(s, 1, 100, "11 03 04 AB CD 00 07 +");
    assert_int_equal(mbm_node_requestFrom(n, 6, 2), 2);
    LAST("11 03 00 06 00 02 +");
    assert_int_equal(mbm_node_available(n), 2);
    assert_int_equal(mbm_node_receive(n), 0xABCD);
    assert_int_equal(mbm_node_receive(n), 7);
    assert_int_equal(mbm_node_receive(n), 0xFFFF);
    sim_answer(s, 1, 100, "11 83 02 +");
    assert_int_equal(mbm_node_requestFrom(n, 6, 1), 0);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_status(n));
    assert_int_equal(mbm_node_requestFrom(n, 0, 126), 0);
    assert_int_equal(mbm_node_requestFrom(n, 65535, 2), 0);
}

SIM_TEST(request_from_returns_0_while_a_request_is_pending)
{
    sim_answer(s, 1, 100, "11 03 04 00 01 00 02 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    OK(mbm_node_setBlocking(n, 0));
    /* Its own request, which does not wait, and a second one. */
    assert_int_equal(mbm_node_requestFrom(n, 0, 1), 0);
    IS(MBM_PENDING, mbm_node_status(n));
    assert_int_equal(mbm_node_requestFrom(n, 0, 1), 0);
    OK(mbm_node_cancel(n));
}

SIM_TEST(send_queues_bytes_words_and_numbers_of_32_bits_with_the_low_word_first)
{
    OK(mbm_node_beginTransmission(n, 0x100));
    OK(mbm_node_send(n, 0x1234));
    OK(mbm_node_send8(n, 0xAB));
    OK(mbm_node_sendBit(n, 1));
    OK(mbm_node_send32(n, 0xDEADBEEF)); /* begins a word after the bit */
    sim_answer(s, 1, 100, "11 10 01 00 00 05 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 01 00 00 05 0A 12 34 00 AB 00 01 BE EF DE AD +");
}

SIM_TEST(a_number_of_32_bits_is_queued_with_both_words_or_none)
{
    OK(mbm_node_beginTransmission(n, 0));
    for (uint8_t i = 0; i < 122; i++)
        OK(mbm_node_send8(n, i));
    s->transmit[122] = 0x5555;
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send32(n, 0x00020003));
    assert_int_equal(s->transmit[122], 0x5555);
    OK(mbm_node_send8(n, 9));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send8(n, 1));
    assert_int_equal(s->transmit[122], 9);
}

SIM_TEST(begin_transmission_empties_the_queue_and_keeps_the_words)
{
    mbm_node_beginTransmission(n, 1);
    mbm_node_send(n, 0x1111);
    mbm_node_send(n, 0x2222);
    mbm_node_beginTransmission(n, 2);
    mbm_node_send(n, 0x3333);
    sim_answer(s, 1, 100, "11 10 00 02 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 02 00 01 02 33 33 +");
    sim_answer(s, 1, 100, "11 10 00 09 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 9, 2));
    LAST("11 10 00 09 00 02 04 33 33 22 22 +");
}

SIM_TEST(send_queues_words)
{
    mbm_node_beginTransmission(n, 0x100);
    OK(mbm_node_send(n, 0x1234));
    OK(mbm_node_send(n, 0xAB));
    sim_answer(s, 1, 100, "11 10 01 00 00 02 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 01 00 00 02 04 12 34 00 AB +");
}

SIM_TEST(send_bit_queues_bits_lowest_first)
{
    static const uint8_t bits[] = {1, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1, 9};

    memset(s->transmit, 0xFF, sizeof s->transmit);
    mbm_node_beginTransmission(n, 5);
    for (size_t i = 0; i < COUNT(bits); i++)
        OK(mbm_node_sendBit(n, bits[i]));
    sim_answer(s, 1, 100, "11 0F 00 05 00 12 +");
    OK(mbm_node_writeQueuedCoils(n));
    LAST("11 0F 00 05 00 12 03 8D 80 03 +");
}

SIM_TEST(a_word_after_bits_starts_a_new_word)
{
    mbm_node_beginTransmission(n, 5);
    mbm_node_sendBit(n, 1);
    mbm_node_sendBit(n, 1);
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 10 00 05 00 02 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 05 00 02 04 00 03 12 34 +");
}

SIM_TEST(queued_registers_are_complete_words_only)
{
    mbm_node_beginTransmission(n, 5);
    for (unsigned i = 0; i < 17; i++)
        mbm_node_sendBit(n, 1);
    sim_answer(s, 1, 100, "11 10 00 05 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 05 00 01 02 FF FF +");
}

SIM_TEST(words_beyond_the_transmit_buffer_are_not_queued)
{
    mbm_node_beginTransmission(n, 0);
    for (unsigned i = 0; i < 123; i++)
        OK(mbm_node_send(n, 1));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send(n, 3));
    assert_int_equal(s->transmit[122], 1);
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_sendBit(n, 1));
    sim_answer(s, 1, 100, "11 10 00 00 00 7B +");
    OK(mbm_node_writeQueuedRegisters(n));
    assert_int_equal(s->frames[0].length, 9 + 2 * 123);
}

SIM_TEST(any_transaction_empties_the_queue_but_keeps_the_words)
{
    mbm_node_beginTransmission(n, 5);
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 03 02 00 01 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    /* A quantity of 0 gets the status that a device would return. Nothing is sent. */
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_writeQueuedRegisters(n));
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_writeQueuedCoils(n));
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_readWriteQueuedRegisters(n, 0, 1));
    assert_int_equal(s->sent, 1);
    assert_int_equal(s->transmit[0], 0x1234);
}

SIM_TEST(a_failed_transaction_empties_the_queue_and_rewinds_receive)
{
    sim_answer(s, 1, 100, "11 03 04 00 01 00 02 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    assert_int_equal(mbm_node_receive(n), 1);
    mbm_node_beginTransmission(n, 5);
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 86 04 +");
    IS(MBM_SERVER_DEVICE_FAILURE, mbm_node_writeSingleRegister(n, 1, 2));
    assert_int_equal(mbm_node_receive(n), 1);
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_writeQueuedRegisters(n));
}

SIM_TEST(the_write_address_is_shared_by_all_writing_functions)
{
    sim_answer(s, 1, 100, "11 06 00 55 00 09 +");
    OK(mbm_node_writeSingleRegister(n, 0x55, 9));
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 10 00 55 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 55 00 01 02 12 34 +");
    sim_answer(s, 1, 100, "11 05 00 66 00 00 +");
    OK(mbm_node_writeSingleCoil(n, 0x66, 0));
    mbm_node_sendBit(n, 1);
    sim_answer(s, 1, 100, "11 0F 00 66 00 01 +");
    OK(mbm_node_writeQueuedCoils(n));
    LAST("11 0F 00 66 00 01 01 01 +");
    sim_answer(s, 1, 100, "11 16 00 77 00 00 00 00 +");
    OK(mbm_node_maskWriteRegister(n, 0x77, 0, 0));
    mbm_node_send(n, 0xAAAA);
    sim_answer(s, 1, 100, "11 17 02 00 01 +");
    OK(mbm_node_readWriteQueuedRegisters(n, 3, 1));
    LAST("11 17 00 03 00 01 00 77 00 01 02 AA AA +");
}

SIM_TEST(single_writes_overwrite_the_first_transmit_words)
{
    memset(s->transmit, 0xEE, sizeof s->transmit);
    sim_answer(s, 1, 100, "11 06 00 01 12 34 +");
    OK(mbm_node_writeSingleRegister(n, 1, 0x1234));
    assert_int_equal(s->transmit[0], 0x1234);
    assert_int_equal(s->transmit[1], 0xEEEE);
    sim_answer(s, 1, 100, "11 16 00 01 00 0A 00 0B +");
    OK(mbm_node_maskWriteRegister(n, 1, 10, 11));
    assert_int_equal(s->transmit[0], 10);
    assert_int_equal(s->transmit[1], 11);
    assert_int_equal(s->transmit[2], 0xEEEE);
}

SIM_TEST(a_read_makes_exactly_its_words_available_to_receive)
{
    sim_answer(s, 1, 100, "11 03 02 AB CD +");
    OK(mbm_node_readHoldingRegisters(n, 6, 1));
    LAST("11 03 00 06 00 01 +");
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(mbm_node_receive(n), 0xABCD);
    assert_int_equal(mbm_node_available(n), 0);
    assert_int_equal(mbm_node_receive(n), 0xFFFF);
    sim_answer(s, 1, 100, "11 83 02 +");
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, 6, 1));
    assert_int_equal(mbm_node_available(n), 0);
}

SIM_TEST(begin_is_cheap_and_switches_slaves)
{
    s->transmit[3] = 0x4711;
    mbm_node_setResponseTimeout(n, 50);
    sim_begin(s, 2);
    sim_answer(s, 1, 100, "02 03 02 00 07 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    LAST("02 03 00 00 00 01 +");
    mbm_node_send(n, 1);
    sim_begin(s, 3);
    assert_int_equal(mbm_node_getSlaveID(n), 3);
    assert_int_equal(WORD(0), 7);
    assert_int_equal(s->transmit[3], 0x4711);
    /* The queue is empty, the settings stay. */
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_writeQueuedRegisters(n));
    s->limit = s->now + 100000;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(n, 0, 1));
}

/* One transaction of the contract with programs for ModbusMaster: the order of its steps
 * and the gap before it, on a simulated clock. Unit 17 is 11 on the wire. */

SIM_TEST(steps_come_in_order)
{
    sim_deliver_text(s, s->now, "DE AD BE EF");
    sim_reads(s, 5000);
    /* Old bytes dropped, driver on, write, flush, driver off, idle, reply. */
    sim_assert_order(s, "PWFOR", "RPWFOR");
    sim_assert_order(s, "POI", "IPOI");
    assert_int_equal(s->counters.resynchronisations, 0);
    sim_assert_sent(s, 0, "11 03 00 00 00 01 +");
}

SIM_TEST(steps_come_in_order_when_the_port_takes_bytes_one_by_one)
{
    s->write_piece = 1;
    s->write_busy = 3;
    sim_reads(s, 5000);
    sim_assert_order(s, "PWFO", "PWFO");
    assert_int_equal(s->counters.bytesSent, 8);
}

/* A port that takes a byte at every other call. */
SIM_TEST(bytes_are_counted_as_they_are_sent)
{
    OK(mbm_node_setBlocking(n, 0));
    s->write_piece = 1;
    s->write_busy = 1;
    s->character = 1000;
    for (unsigned again = 0; again < 2; again++) {
        const unsigned before = again * 8;

        IS(MBM_PENDING, sim_read_one(s));
        while (s->counters.bytesSent < before + 8) {
            const uint32_t sent = s->sent > again ? s->frames[again].length : 0;

            assert_int_equal(s->counters.bytesSent, before + sent);
            assert_int_equal(s->counters.requests, again + (sent > 0));
            IS(MBM_PENDING, mbm_node_poll(n));
            s->now += s->idle_step;
        }
        /* The last byte has not left yet. The end of the request counts nothing again. */
        assert_true(s->now < s->transmitted);
        while (s->driver_on) {
            IS(MBM_PENDING, mbm_node_poll(n));
            s->now += s->idle_step;
        }
        OK(mbm_node_cancel(n));
        assert_int_equal(s->counters.bytesSent, before + 8);
        assert_int_equal(s->counters.requests, again + 1);
    }
}

SIM_TEST(a_request_of_which_the_port_takes_no_byte_is_counted)
{
    OK(mbm_node_setResponseTimeout(n, 100));
    s->write_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    assert_int_equal(s->counters.requests, 1);
    assert_int_equal(s->counters.bytesSent, 0);
}

SIM_TEST(a_client_counts_bytes_as_they_are_sent)
{
    static mbm_client client;
    static uint8_t frame[MBM_MAX_ASCII_FRAME];
    mbm_counters counters = {0};

    s->write_piece = 1;
    for (unsigned ascii = 0; ascii <= 1; ascii++) {
        const uint32_t length = ascii ? 17 : 8;
        mbm_clientRequest request = {.unit = 17};

        memset(&client, 0, sizeof client);
        memset(&counters, 0, sizeof counters);
        if (ascii)
            OK(mbm_client_beginAscii(&client, &s->port, frame, sizeof frame));
        else
            OK(mbm_client_beginRtu(&client, &s->port, frame, sizeof frame));
        OK(mbm_client_setCounters(&client, &counters));
        IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 0, 1));
        while (counters.bytesSent < length) {
            const uint32_t before = counters.bytesSent;

            IS(MBM_PENDING, mbm_client_poll(&client));
            assert_in_range(counters.bytesSent, before, before + 1);
            s->now += s->idle_step;
        }
        /* The request ends when its last bit has left. */
        s->now += 20 * s->character;
        OK(mbm_client_cancel(&client, &request));
        assert_int_equal(counters.bytesSent, length);
        assert_int_equal(counters.requests, 1);
    }
}

SIM_TEST(bytes_that_wait_in_the_receiver_are_no_part_of_the_reply)
{
    sim_deliver_text(s, s->now, "11 03 02 66 66 +");
    sim_reads(s, 500);
}

SIM_TEST(the_driver_is_switched_off_only_after_the_last_bit)
{
    s->character = 1146;
    sim_reads(s, 500);
    sim_assert_time(sim_time_of(s, 'O'), s->frames[0].end);
}

SIM_TEST(the_driver_is_held_on_after_an_early_flush)
{
    s->character = 1146;
    s->flush_lies = 1;
    OK(mbm_line_setBaudRate(&s->line, 9600));
    OK(mbm_line_setPostFlushHold(&s->line, 9));
    sim_reads(s, 500);
    assert_int_equal(s->post_before_last_bit, 0);
    sim_assert_time(sim_time_of(s, 'O') - sim_time_of(s, 'F'), 9 * 1146);
    assert_int_equal(s->idle_while_driving, 0);
}

SIM_TEST(without_a_baud_rate_the_hold_is_that_of_9600_baud)
{
    s->flush_lies = 1;
    OK(mbm_line_setPostFlushHold(&s->line, 2));
    sim_reads(s, 500);
    sim_assert_time(sim_time_of(s, 'O') - sim_time_of(s, 'F'), 2 * 1146);
}

SIM_TEST(all_hooks_except_three_may_be_missing)
{
    s->port.flush = NULL;
    s->port.preTransmission = NULL;
    s->port.postTransmission = NULL;
    s->port.idle = NULL;
    OK(mbm_line_beginRtu(&s->line, &s->port, s->buffer, MBM_MAX_FRAME));
    sim_reads(s, 500);
    sim_assert_order(s, "PFOI", "");
}

SIM_TEST(the_first_request_waits_for_the_gap_after_begin)
{
    sim_reads(s, 500);
    sim_assert_time(s->frames[0].silence, 4000);
}

static void gap_after_reply(sim *s, uint32_t wanted)
{
    sim_reads(s, 500);
    sim_reads(s, 500);
    sim_assert_time(s->frames[s->sent - 1].silence, wanted);
}

SIM_TEST(the_gap_is_4_ms_while_no_baud_rate_is_set)
{
    gap_after_reply(s, 4000);
    mbm_line_setBaudRate(&s->line, 115200);
    mbm_line_setBaudRate(&s->line, 0);
    gap_after_reply(s, 4000);
}

SIM_TEST(the_gap_is_three_and_a_half_characters_up_to_19200_baud)
{
    OK(mbm_line_setBaudRate(&s->line, 9600));
    gap_after_reply(s, 4011);
    OK(mbm_line_setBaudRate(&s->line, 1200));
    gap_after_reply(s, 32084);
    OK(mbm_line_setBaudRate(&s->line, 19200));
    gap_after_reply(s, 2006);
}

SIM_TEST(the_gap_is_1750_us_above_19200_baud)
{
    OK(mbm_line_setBaudRate(&s->line, 19201));
    gap_after_reply(s, 1750);
    OK(mbm_line_setBaudRate(&s->line, 1000000));
    gap_after_reply(s, 1750);
}

SIM_TEST(a_set_gap_holds_until_a_baud_rate_is_set)
{
    OK(mbm_line_setGap(&s->line, 20000));
    gap_after_reply(s, 20000);
    OK(mbm_line_setGap(&s->line, 0));
    gap_after_reply(s, 0);
    OK(mbm_line_setBaudRate(&s->line, 115200));
    gap_after_reply(s, 1750);
}

SIM_TEST(the_gap_counts_from_the_last_foreign_byte)
{
    sim_reads(s, 500);
    sim_deliver_text(s, s->now + 3000, "05 03 02 00 01 +");
    sim_deliver_text(s, s->now + 6000, "99");
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].silence, 4000);
    sim_assert_order(s, "PR", "PRPR");
}

SIM_TEST(the_gap_counts_from_the_last_byte_sent)
{
    mbm_line_setTurnaroundDelay(&s->line, 0);
    mbm_node_setSlaveID(n, 0);
    OK(mbm_node_writeSingleCoil(n, 1, 1));
    OK(mbm_node_writeSingleCoil(n, 1, 1));
    sim_assert_time(s->frames[1].begin - s->frames[0].end, 4000);
}

SIM_TEST(a_gap_that_has_passed_already_is_not_waited_for)
{
    sim_reads(s, 500);
    s->now += 10000;
    uint64_t asked = s->now;
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 0);
}

SIM_TEST(line_used_makes_the_gap_count_from_now)
{
    sim_reads(s, 500);
    s->now += 10000;
    uint64_t asked = s->now;
    OK(mbm_line_used(&s->line));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 4000);
}

SIM_TEST(idle_is_not_called_while_bytes_wait)
{
    s->character = 0;
    s->read_piece = 1;
    sim_reads(s, 500);
    sim_assert_order(s, "IRO", "IOIR");
}

SIM_TEST(no_gap_is_waited_for_after_begin_on_a_silent_line)
{
    s->now += 10000;
    sim_begin(s, 17);
    uint64_t asked = s->now;
    sim_reads(s, 500);
    sim_assert_time(s->frames[0].begin - asked, 0);
    /* After a request of the object on that line the gap is kept. */
    sim_begin(s, 17);
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].silence, 4000);
}

SIM_TEST(bytes_that_arrive_after_begin_start_the_gap)
{
    s->now += 10000;
    sim_begin(s, 17);
    sim_deliver_text(s, s->now - 100, "05 03 02");
    sim_reads(s, 500);
    sim_assert_time(s->frames[0].silence, 4000);
}

SIM_TEST(the_gap_counts_from_the_reported_use_of_the_line)
{
    sim_reads(s, 500);
    s->now += 10000;
    uint64_t asked = s->now;
    OK(mbm_line_usedAt(&s->line, (uint32_t)s->now - 3000));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 1000);
    /* The line's own last byte is later than this. */
    OK(mbm_line_usedAt(&s->line, (uint32_t)asked - 3000));
    sim_reads(s, 500);
    sim_assert_time(s->frames[2].silence, 4000);
}

SIM_TEST(a_reported_use_counts_also_after_40_minutes_without_one)
{
    sim_reads(s, 500);
    s->now += 40ull * 60 * 1000000;
    s->limit = s->now + 1000000;
    uint64_t asked = s->now;
    OK(mbm_line_usedAt(&s->line, (uint32_t)s->now - 3000));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 1000);
}

/* Two objects that know nothing of each other, each with a line. */
SIM_TEST(several_lines_share_a_stream)
{
    mbm_line line = MBM_INIT;
    mbm_node other = MBM_INIT;
    uint16_t words[4];
    uint8_t frame[MBM_FRAME_BYTES(4)];

    OK(mbm_line_beginRtu(&line, &s->port, frame, sizeof frame));
    OK(mbm_node_begin(&other, &line, 3, words, 4, NULL, 0));
    sim_reads(s, 500);
    mbm_line_used(&line);
    sim_answer(s, 1, 500, "03 04 02 00 07 +");
    OK(mbm_node_readInputRegisters(&other, 0, 1));
    assert_int_equal(words[0], 7);
    sim_assert_time(s->frames[1].silence, 4000);
    assert_int_equal(s->response[0], 42);
    mbm_line_used(&s->line);
    sim_reads(s, 500);
}
