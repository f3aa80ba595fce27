/* Devices that deviate from the standard, and mbm_node_setLenient: a reply with the
 * right unit, function and CRC is accepted if no better one comes. On the simulated
 * clock; unit 17 is 11 on the wire. */
#include "crc.h"
#include "sim.h"
#include "test.h"

enum { TIMEOUT_MS = 200, TIMEOUT = 200000 };

/* The simulation with a lenient master. */
static void make_lenient(sim *s)
{
    OK(mbm_node_setResponseTimeout(&s->node, TIMEOUT_MS));
    OK(mbm_node_setLenient(&s->node, 1));
}

#define LENIENT_TEST(name) SIM_TEST_WITH(name, make_lenient)

LENIENT_TEST(a_write_whose_reply_repeats_other_content_is_accepted)
{
    static const char *const values[] = {"11 06 00 01 00 08 +", "11 06 00 02 00 07 +"};

    for (unsigned i = 0; i < 2; i++) {
        sim_answer(s, 1, 500, values[i]);
        OK(mbm_node_writeSingleRegister(n, 1, 7));
        assert_true(s->now - s->frames[s->sent - 1].end >= TIMEOUT);
    }
    sim_answer(s, 1, 500, "11 05 00 01 00 00 +");
    OK(mbm_node_writeSingleCoil(n, 1, 1));
    sim_answer(s, 1, 500, "11 10 00 01 00 01 +");
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
    sim_answer(s, 1, 500, "11 0F 00 02 00 02 +");
    OK(mbm_node_writeMultipleCoils(n, 1, 2));
    sim_answer(s, 1, 500, "11 16 00 01 00 02 00 04 +");
    OK(mbm_node_maskWriteRegister(n, 1, 2, 3));
    assert_int_equal(s->counters.replies, 6);
    assert_int_equal(s->counters.timeouts, 0);
}

LENIENT_TEST(without_it_the_same_replies_are_malformed)
{
    OK(mbm_node_setLenient(n, 0));
    sim_answer(s, 1, 500, "11 06 00 01 00 08 +");
    IS(MBM_MALFORMED_REPLY, mbm_node_writeSingleRegister(n, 1, 7));
    sim_answer(s, 1, 500, "11 03 04 00 01 00 02 +");
    IS(MBM_MALFORMED_REPLY, mbm_node_readHoldingRegisters(n, 0, 1));
}

LENIENT_TEST(a_read_takes_the_registers_that_come)
{
    sim_answer(s, 1, 500, "11 03 06 00 01 00 02 00 03 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(mbm_node_available(n), 3);
    assert_int_equal(s->response[0], 1);
    assert_int_equal(s->response[2], 3);
    sim_answer(s, 1, 500, "11 04 02 00 09 +");
    OK(mbm_node_readInputRegisters(n, 0, 4));
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(s->response[0], 9);
    assert_int_equal(s->response[2], 3); /* as it was */
    sim_answer(s, 1, 500, "11 01 03 FF 01 02 +");
    OK(mbm_node_readCoils(n, 0, 3));
    assert_int_equal(mbm_node_available(n), 2);
    assert_int_equal(s->response[0], 0x01FF);
    assert_int_equal(s->response[1], 0x0002);
    sim_answer(s, 1, 500, "11 03 05 00 01 00 02 07 +"); /* half a register too many */
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(mbm_node_available(n), 2);
    assert_int_equal(s->counters.replies, 4);
    assert_int_equal(s->counters.foreignFrames, 0);
}

LENIENT_TEST(the_bytes_may_come_one_at_a_time_or_all_at_once)
{
    for (uint16_t piece = 1; piece < 20; piece++) {
        s->read_piece = piece;
        sim_answer(s, 1, 500, "11 03 06 00 01 11 03 11 83 +"); /* data like the head of a reply */
        OK(mbm_node_readHoldingRegisters(n, 0, 1));
        assert_int_equal(mbm_node_available(n), 3);
        assert_int_equal(s->response[1], 0x1103);
        assert_int_equal(s->response[2], 0x1183);
    }
    s->character = 0; /* all at once, with the next frame */
    s->read_piece = 0;
    sim_answer(s, 1, 500, "11 03 06 00 01 00 02 00 03 + / 09 03 02 00 01 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(mbm_node_available(n), 3);
}

/* Such a reply has a right CRC one byte before its end. */
LENIENT_TEST(a_reply_that_ends_with_the_byte_0_is_accepted)
{
    uint8_t read[9] = {17, 3, 4}, write[8] = {17, 6, 0, 1};
    unsigned value, reads = 0, writes = 0;

    for (value = 1; value < 3000; value++) {
        read[3] = write[4] = (uint8_t)(value >> 8);
        read[4] = write[5] = (uint8_t)value;
        (void)seal(read, 7);
        if (read[8] == 0) {
            sim_deliver(s, s->now + 8000, read, sizeof read);
            OK(mbm_node_readHoldingRegisters(n, 0, 1));
            assert_int_equal(mbm_node_available(n), 2);
            assert_int_equal(s->response[0], value);
            reads++;
        }
        (void)seal(write, 6);
        if (write[7] == 0) {
            sim_deliver(s, s->now + 8000, write, sizeof write);
            OK(mbm_node_writeSingleRegister(n, 1, 0));
            writes++;
        }
    }
    assert_true(reads > 5 && writes > 5);
}

LENIENT_TEST(a_right_reply_is_better_before_and_after_it)
{
    sim_answer(s, 1, 500, "11 03 04 00 01 00 02 + / 11 03 02 00 2A +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(s->response[0], 0x2A);
    assert_true(s->now - s->frames[0].end < 100000);
    sim_answer(s, 1, 500, "11 03 02 00 2B + / 11 03 04 00 01 00 02 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(s->response[0], 0x2B);
    sim_answer(s, 1, 500, "11 06 00 01 00 08 + / 11 06 00 01 00 07 +");
    OK(mbm_node_writeSingleRegister(n, 1, 7));
    assert_true(s->now - s->frames[2].end < 100000);
    sim_answer(s, 1, 500, "11 06 00 01 00 08 + / 11 86 02 +");
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_writeSingleRegister(n, 1, 7));
}

LENIENT_TEST(half_a_reply_in_front_hides_no_right_one)
{
    sim_answer(s, 1, 500, "11 03 20 00 01 / 11 03 02 00 2A +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(s->response[0], 0x2A);
    assert_int_equal(mbm_node_available(n), 1);
}

/* Unit, function and CRC must be right, and the byte count must be that of the frame. */
LENIENT_TEST(what_is_no_reply_to_the_request_is_not_accepted)
{
    static const struct {
        const char *bytes;
        uint8_t status;
    } rows[] = {
        {"12 03 04 00 01 00 02 +", MBM_INVALID_SLAVE_ID},
        {"11 04 04 00 01 00 02 +", MBM_INVALID_FUNCTION},
        {"11 03 04 00 01 00 02 00 00", MBM_MALFORMED_REPLY},
        {"11 03 06 00 01 00 02 +", MBM_MALFORMED_REPLY},
        {"11 03 00 +", MBM_MALFORMED_REPLY},
        {"11 83 00 +", MBM_MALFORMED_REPLY},
        {"11 03 00 00 00 01 +", MBM_MALFORMED_REPLY}, /* the request itself */
    };

    mbm_line_setQuietTime(&s->line, 0);
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        uint8_t status;
        sim_answer(s, 1, 500, rows[i].bytes);
        status = mbm_node_readHoldingRegisters(n, 0, 1);
        if (i == 2)
            assert_int_not_equal(status, MBM_OK);
        else
            assert_int_equal(status, rows[i].status);
        assert_int_equal(mbm_node_available(n), 0);
        assert_int_equal(s->response[0], 0);
    }
    sim_answer(s, 1, 500, "11 10 00 01 00 01 02 00 00 +"); /* an echo */
    assert_int_not_equal(mbm_node_writeMultipleRegisters(n, 1, 1), MBM_OK);
    sim_answer(s, 1, 500, "11 86 00 +");
    IS(MBM_MALFORMED_REPLY, mbm_node_writeSingleRegister(n, 1, 7));
}

/* A reply of 125 registers: values 0 to 124. */
static size_t largest_reply(uint8_t *frame)
{
    char text[3 * 250 + 16] = "11 03 FA";

    for (unsigned i = 0; i < 125; i++)
        sprintf(text + strlen(text), " 00 %02X", i);
    strcat(text, " +");
    return sim_bytes(frame, text);
}

static void answer_largest(sim *s, const sim_frame *frame)
{
    uint8_t bytes[256];
    size_t length = largest_reply(bytes);

    if (s->context != NULL) {
        bytes[200] ^= 0x10;
    }
    sim_deliver(s, frame->end + 500, bytes, length);
}

LENIENT_TEST(a_read_of_more_words_than_the_buffer_fills_it)
{
    static const uint16_t frames[] = {MBM_FRAME_BYTES(64), 255};

    s->device = answer_largest;
    OK(mbm_line_setQuietTime(&s->line, 0));
    for (unsigned i = 0; i < 2; i++) {
        OK(mbm_node_begin(n, &s->line, 17, s->response, 64, s->transmit, 64));
        OK(mbm_line_setFrame(&s->line, s->buffer, frames[i]));
        memset(s->response, 0xFF, sizeof s->response);
        OK(mbm_node_readHoldingRegisters(n, 0, 125));
        assert_int_equal(mbm_node_available(n), 64);
        for (unsigned word = 0; word < 64; word++)
            assert_int_equal(s->response[word], word);
        assert_int_equal(s->response[64], 0xFFFF);
        assert_true(s->now - s->frames[s->sent - 1].end < 255 * s->character + 20000);
        OK(mbm_node_setLenient(n, 0));
        IS(MBM_BUFFER_TOO_SMALL, mbm_node_readHoldingRegisters(n, 0, 125));
        OK(mbm_node_setLenient(n, 1));
    }
}

LENIENT_TEST(what_the_buffer_does_not_hold_is_checked_too)
{
    s->device = answer_largest;
    s->context = s;
    OK(mbm_node_begin(n, &s->line, 17, s->response, 64, s->transmit, 64));
    OK(mbm_line_setFrame(&s->line, s->buffer, MBM_FRAME_BYTES(64)));
    assert_int_not_equal(mbm_node_readHoldingRegisters(n, 0, 125), MBM_OK);
    assert_int_equal(s->response[0], 0);
}

LENIENT_TEST(a_small_frame_buffer_is_not_left)
{
    s->device = answer_largest;
    for (uint16_t size = 8; size < 255; size++) {
        uint8_t *frame = malloc(size); /* the sanitizer looks at its ends */
        uint8_t status;

        assert_non_null(frame);
        OK(mbm_line_setFrame(&s->line, frame, size));
        status = mbm_node_readHoldingRegisters(n, 0, 125);
        if (status == MBM_OK) {
            assert_int_equal(s->response[0], 0);
            assert_in_range(mbm_node_available(n), 1, (size - 3) / 2);
        } else {
            IS(MBM_BUFFER_TOO_SMALL, status);
            assert_true(size < 20);
        }
        OK(mbm_line_setFrame(&s->line, s->buffer, 255));
        free(frame);
    }
}

LENIENT_TEST(a_read_from_unit_0_is_sent_and_its_reply_accepted)
{
    OK(mbm_node_setSlaveID(n, 0));
    sim_answer(s, 1, 150000, "00 03 02 00 2A +"); /* later than the turnaround delay */
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    sim_assert_sent(s, 0, "00 03 00 00 00 01 +");
    assert_int_equal(s->response[0], 0x2A);
    assert_true(s->now - s->frames[0].end < 170000);
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(n, 0, 1));
    assert_in_range(s->now - s->frames[1].end, TIMEOUT, TIMEOUT + 500);
    /* A write is a broadcast as before. */
    OK(mbm_node_writeSingleRegister(n, 1, 2));
    assert_in_range(s->now - s->frames[2].end, 100000, 100500);
    OK(mbm_node_setLenient(n, 0));
    IS(MBM_BROADCAST_NOT_ALLOWED, mbm_node_readHoldingRegisters(n, 0, 1));
}

LENIENT_TEST(it_cannot_be_set_while_a_request_is_pending)
{
    OK(mbm_node_setBlocking(n, 0));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(n, 0, 1));
    IS(MBM_BUSY, mbm_node_setLenient(n, 0));
    sim_answer(s, 1, 500, "11 03 04 00 01 00 02 +");
    OK(sim_poll(s));
    assert_int_equal(mbm_node_available(n), 2);
    OK(mbm_node_setLenient(n, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_node_setLenient(NULL, 1));
}

/* After a failure a reply is held, for it may be the late one. */
LENIENT_TEST(a_late_reply_that_deviates_is_not_better_than_the_next)
{
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleRegister(n, 1, 7));
    sim_answer(s, 1, 500, "11 06 00 01 00 07 + / 11 06 00 02 00 08 +");
    OK(mbm_node_writeSingleRegister(n, 2, 8));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(n, 1, 1));
    sim_answer(s, 1, 500, "11 03 02 00 01 + / 11 03 04 00 02 00 03 +");
    OK(mbm_node_readHoldingRegisters(n, 2, 2));
    assert_int_equal(mbm_node_available(n), 2);
    assert_int_equal(s->response[0], 2);
}
