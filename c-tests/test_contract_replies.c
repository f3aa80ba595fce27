/* The contract with programs for ModbusMaster about replies, beside the exchanges of
 * test_exchanges.c: all exception codes and lengths, pauses, echoes and counters. */
#include "sim.h"
#include "test.h"

#define WORD(index) s->response[index]

static uint8_t read_words(sim *s, uint16_t quantity, const char *reply)
{
    sim_answer(s, 1, 500, reply);
    return mbm_node_readHoldingRegisters(&s->node, 0, quantity);
}

/* The bytes of the previous transaction must not spoil the next one. */
static void recovers_at_once(sim *s)
{
    OK(read_words(s, 1, "11 03 02 00 2A +"));
    assert_int_equal(s->response[0], 42);
}

SIM_TEST(exception_codes_of_the_device_are_returned_unchanged)
{
    for (unsigned code = 1; code < 0x80; code++) {
        char reply[20];

        snprintf(reply, sizeof reply, "11 83 %02X +", code);
        s->answered = 0;
        assert_int_equal(read_words(s, 1, reply), code);
        assert_int_equal(mbm_node_getExceptionCode(n), code);
        assert_int_equal(mbm_node_status(n), code);
        if (s->sent > SIM_FRAMES - 2)
            s->sent = 0;
    }
    assert_int_equal(s->counters.exceptions, 0x7F);
    recovers_at_once(s);
    assert_int_equal(mbm_node_getExceptionCode(n), 0);
}

SIM_TEST(a_bad_crc_fails_after_t35_and_not_after_the_timeout)
{
    IS(MBM_INVALID_CRC, read_words(s, 1, "11 03 02 00 01 00 00"));
    uint64_t over = s->frames[0].end + 500 + 7 * s->character;
    assert_in_range(s->now, over + 4000, over + 4100);
}

SIM_TEST(all_125_registers_and_2000_bits_are_readable)
{
    uint8_t reply[256];
    char text[1024];

    unsigned at = (unsigned)snprintf(text, sizeof text, "11 03 FA ");
    for (unsigned i = 0; i < 250; i++)
        at += (unsigned)snprintf(text + at, sizeof text - at, "%02X ", i);
    snprintf(text + at, sizeof text - at, "+");
    assert_int_equal(sim_bytes(reply, text), 255);
    OK(read_words(s, 125, text));
    assert_int_equal(mbm_node_available(n), 125);
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(mbm_node_receive(n), (2 * i) << 8 | (2 * i + 1));
    text[4] = '1';
    sim_answer(s, 1, 500, text);
    OK(mbm_node_readCoils(n, 0, 2000));
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(WORD((uint8_t)i), (2 * i + 1) << 8 | (2 * i));
}

/* Four bytes that look like the start of a longer reply. An exception after them is found,
 * also if the line was silent between. */
SIM_TEST(an_exception_after_noise_that_looks_like_a_longer_reply_is_found)
{
    (void)n;
    IS(MBM_ILLEGAL_DATA_ADDRESS, read_words(s, 10, "11 03 14 00 / 11 83 02 +"));
    sim_answer(s, 1, 500, "11 03 14 00");
    sim_answer(s, 1, 20000, "11 83 02 +");
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, 0, 10));
    assert_true(s->now - s->frames[1].end < 30000);
}

SIM_TEST(a_reply_in_two_pieces_is_found_at_the_end_of_the_second)
{
    sim_answer(s, 1, 500, "11 03 04 12 34");
    /* The CRC of the whole frame, as a device would send it. */
    sim_answer(s, 1, 50000, "56 78 90 C6");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    assert_int_equal(WORD(1), 0x5678);
}

/* Noise that looks like the start of our reply, then a pause, then the reply. However the
 * first call ends, its reply must not become the second call's data. */
SIM_TEST(a_reply_after_noise_and_a_pause_is_not_taken_for_the_next)
{
    sim_answer(s, 1, 500, "11 03 02 00 00 00 00");
    sim_answer(s, 1, 6500, "11 03 02 11 11 +");
    uint8_t status = mbm_node_readHoldingRegisters(n, 100, 1);
    assert_true(status == MBM_OK || status == MBM_INVALID_CRC);
    sim_answer(s, 1, 5000, "11 03 02 22 22 +");
    if (mbm_node_readHoldingRegisters(n, 200, 1) == MBM_OK)
        assert_int_equal(WORD(0), 0x2222);
}

/* Data may have any value, so a pause within the data must not end the request. */
SIM_TEST(a_pause_after_data_like_a_damaged_exception_does_not_end_the_request)
{
    sim_answer(s, 1, 500, "11 03 08 11 83 01 02 03 04");
    sim_answer(s, 1, 50000, "05 06 09 D9");
    OK(mbm_node_readHoldingRegisters(n, 0, 4));
    assert_int_equal(WORD(3), 0x0506);
}

SIM_TEST(foreign_data_like_our_damaged_reply_do_not_end_the_request)
{
    sim_answer(s, 1, 500, "12 03 06 11 83 01 02 03 04 +");
    sim_answer(s, 1, 20000, "11 03 02 00 2A +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
}

SIM_TEST(an_echo_is_dropped_with_echo_discard_on)
{
    OK(mbm_line_setEchoDiscard(&s->line, 1));
    s->echo = 1;
    OK(read_words(s, 1, "11 03 02 00 2A +"));
    sim_answer(s, 1, 500, "11 06 00 01 00 02 +");
    OK(mbm_node_writeSingleRegister(n, 1, 2));
    sim_answer(s, 1, 500, "11 10 00 01 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
    sim_answer(s, 1, 500, "11 0F 00 01 00 09 +");
    OK(mbm_node_writeMultipleCoils(n, 1, 9));
    sim_answer(s, 1, 500, "11 16 00 01 00 02 00 03 +");
    OK(mbm_node_maskWriteRegister(n, 1, 2, 3));
    sim_answer(s, 1, 500, "11 17 02 00 2A +");
    OK(mbm_node_readWriteMultipleRegisters(n, 1, 1, 3, 1));
    sim_answer(s, 1, 500, "11 05 00 01 FF 00 +");
    OK(mbm_node_writeSingleCoil(n, 1, 1));
}

SIM_TEST(a_damaged_echo_does_not_hide_the_reply)
{
    OK(mbm_line_setEchoDiscard(&s->line, 1));
    s->transmit[0] = 0x1111;
    s->transmit[1] = 0x2222;
    sim_answer(s, 1, 0, "11 10 00 01 00 02 04 11 11 22 23 AB 23");
    sim_answer(s, 1, 3000, "11 10 00 01 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
    s->echo = 1;
    sim_answer(s, 1, 500, "11 10 00 01 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
}

SIM_TEST(noise_before_the_echo_does_not_hide_a_foreign_frame_after_it)
{
    OK(mbm_line_setEchoDiscard(&s->line, 1));
    IS(MBM_INVALID_SLAVE_ID, read_words(s, 1, "00 / 11 03 00 00 00 01 + / 12 03 02 00 01 +"));
    assert_int_equal(s->counters.foreignFrames, 1);
}

SIM_TEST(an_echo_alone_is_no_success)
{
    OK(mbm_line_setEchoDiscard(&s->line, 1));
    OK(mbm_node_setResponseTimeout(n, 100));
    s->echo = 1;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleRegister(n, 1, 2));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleCoil(n, 1, 1));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeMultipleRegisters(n, 1, 2));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_maskWriteRegister(n, 1, 2, 3));
}

SIM_TEST(with_discard_off_an_echo_that_is_no_reply_is_skipped)
{
    s->echo = 1;
    OK(read_words(s, 1, "11 03 02 00 2A +"));
    sim_answer(s, 1, 500, "11 10 00 01 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
}

SIM_TEST(a_device_that_does_not_echo_still_answers_reads_with_discard_on)
{
    OK(mbm_line_setEchoDiscard(&s->line, 1));
    OK(read_words(s, 1, "11 03 02 00 2A +"));
}

SIM_TEST(counters_count_what_happened)
{
    mbm_node_setResponseTimeout(n, 100);
    recovers_at_once(s);
    assert_int_equal(read_words(s, 1, "11 83 02 +"), 2);
    IS(MBM_RESPONSE_TIMED_OUT, read_words(s, 1, ""));
    IS(MBM_INVALID_CRC, read_words(s, 1, "11 03 02 00 01 00 00"));
    assert_int_equal(s->counters.resynchronisations, 0);
    assert_int_equal(s->counters.requests, 4);
    assert_int_equal(s->counters.replies, 2);
    assert_int_equal(s->counters.exceptions, 1);
    assert_int_equal(s->counters.timeouts, 1);
    assert_int_equal(s->counters.badCrc, 1);
    assert_int_equal(s->counters.bytesSent, 32);
    assert_int_equal(s->counters.bytesReceived, 7 + 5 + 7);
    /* Noise before the reply, and two frames of another unit. */
    OK(read_words(s, 1, "00 / 11 03 02 00 2A +"));
    OK(read_words(s, 1, "12 83 02 + / 12 03 02 00 01 + / 11 03 02 00 2A +"));
    assert_int_equal(s->counters.resynchronisations, 1);
    assert_int_equal(s->counters.foreignFrames, 2);
    OK(mbm_line_setCounters(&s->line, NULL));
    recovers_at_once(s);
    assert_int_equal(s->counters.requests, 6);
}

SIM_TEST(counters_miss_no_frame_of_a_crowded_line)
{
    for (int i = 0; i < 30; i++)
        sim_answer(s, 1, 30000 * (unsigned)i, TEN("12 07 + / "));
    sim_answer(s, 1, 900000, "11 03 02 00 2A +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(s->counters.foreignFrames, 300);
    assert_int_equal(s->counters.bytesReceived, 300 * 4 + 7);
    assert_int_equal(s->counters.requests, 1);
}

/* So the exception begins as a reply of one register does. */
SIM_TEST(an_exception_whose_code_is_the_byte_count_is_a_whole_frame)
{
    sim_answer(s, 1, 500, "11 83 02 +");
    IS(2, sim_read_one(s));
    assert_int_equal(s->counters.exceptions, 1);
    assert_int_equal(s->counters.resynchronisations, 0);
    assert_int_equal(s->counters.foreignFrames, 0);
}

SIM_TEST(a_right_crc_within_the_reply_is_no_frame)
{
    s->read_piece = 3; /* a reply that comes at once is not searched on a host */
    OK(read_words(s, 4, "11 03 08 12 34 + 56 78 9A BC +"));
    assert_int_equal(s->response[0], 0x1234);
    assert_int_equal(s->response[3], 0x9ABC);
    assert_int_equal(s->counters.replies, 1);
    assert_int_equal(s->counters.resynchronisations, 0);
    assert_int_equal(s->counters.foreignFrames, 0);
}
