/* Bad arguments, objects and buffers: each call returns a status, never crashes, and sends
 * nothing malformed. */
#include "every_call.h"
#include "sim.h"
#include "test.h"

fixture each_test = {sim_setup, sim_teardown};

/* Calls all others except begin, setFrame and statusText. */
static void all_others_answer(mbm_line *l, mbm_node *m, uint8_t status)
{
    IS(status, mbm_node_poll(m));
    IS(status, mbm_node_cancel(m));
    IS(status, mbm_node_status(m));
    IS(status, mbm_node_setSlaveID(m, 1));
    IS(status, mbm_node_setResponseTimeout(m, 1));
    IS(status, mbm_node_setLenient(m, 1));
    IS(status, mbm_node_setBlocking(m, 1));
    every_line_call_returns(status, l);
    IS(status, mbm_node_beginTransmission(m, 1));
    IS(status, mbm_node_send(m, 1));
    IS(status, mbm_node_send(m, 1));
    IS(status, mbm_node_sendBit(m, 1));
    IS(status, mbm_node_send8(m, 1));
    IS(status, mbm_node_send32(m, 1));
    IS(status, mbm_node_setTransmitBuffer(m, 0, 1));
    IS(status, mbm_node_clearTransmitBuffer(m));
    IS(status, mbm_node_clearResponseBuffer(m));
    IS(status, mbm_node_idle(m, NULL));
    IS(status, mbm_node_preTransmission(m, NULL));
    IS(status, mbm_node_postTransmission(m, NULL));
    assert_int_equal(mbm_node_getResponseBuffer(m, 0), 0xFFFF);
    assert_int_equal(mbm_node_requestFrom(m, 0, 1), 0);
    assert_int_equal(mbm_node_getExceptionCode(m), 0);
    assert_int_equal(mbm_node_getSlaveID(m), 0);
    assert_int_equal(mbm_node_available(m), 0);
    assert_int_equal(mbm_node_receive(m), 0xFFFF);
}

SIM_TEST(null_is_an_invalid_argument_everywhere)
{
    mbm_line l = MBM_INIT;
    uint16_t words[2] = {0, 0};
    uint8_t frame[16];

    every_node_request_returns(MBM_INVALID_ARGUMENT, NULL);
    all_others_answer(NULL, NULL, MBM_INVALID_ARGUMENT);
    IS(MBM_INVALID_ARGUMENT, mbm_line_beginRtu(NULL, &s->port, frame, 16));
    IS(MBM_INVALID_ARGUMENT, mbm_line_beginRtu(NULL, NULL, frame, 16));
    IS(MBM_INVALID_ARGUMENT, mbm_line_setFrame(NULL, frame, 16));
    IS(MBM_INVALID_ARGUMENT, mbm_node_begin(NULL, &l, 1, words, 2, words, 2));
}

TEST(a_zeroed_object_is_not_initialised_and_stays_zero)
{
    static mbm_line l;
    static const mbm_line zero_line;
    static mbm_node m;
    static const mbm_node zero;

    every_node_request_returns(MBM_NOT_INITIALISED, &m);
    all_others_answer(&l, &m, MBM_NOT_INITIALISED);
    assert_memory_equal(&l, &zero_line, sizeof l);
    assert_memory_equal(&m, &zero, sizeof m);
}

SIM_TEST(a_line_without_a_frame_buffer_sends_no_request)
{
    mbm_line l = MBM_INIT;
    mbm_node m = MBM_INIT;

    OK(mbm_line_beginRtu(&l, &s->port, NULL, 0));
    OK(mbm_node_begin(&m, &l, 17, NULL, 0, NULL, 0));
    every_node_request_returns(MBM_NOT_INITIALISED, &m);
    sim_assert_order(s, "PWFOIR", "");
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send(&m, 1));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_sendBit(&m, 1));
    IS(MBM_NOT_INITIALISED, mbm_node_poll(&m));
}

TEST(a_line_without_a_port_sends_no_request)
{
    mbm_line l = MBM_INIT;
    mbm_node m = MBM_INIT;
    uint16_t words[2] = {0, 0};
    uint8_t frame[32];

    OK(mbm_node_begin(&m, &l, 17, words, 1, words + 1, 1));
    OK(mbm_line_setFrame(&l, frame, sizeof frame));
    every_node_request_returns(MBM_NOT_INITIALISED, &m);
    IS(MBM_NOT_INITIALISED, mbm_node_poll(&m));
    OK(mbm_line_used(&l));
    OK(mbm_line_usedAt(&l, 1));
    OK(mbm_line_cancel(&l));
    OK(mbm_node_cancel(&m));
}

SIM_TEST(a_port_without_its_three_hooks_is_refused)
{
    const mbm_port empty = {0};
    mbm_line l = MBM_INIT;
    mbm_node m = MBM_INIT;

    OK(mbm_node_begin(&m, &l, 1, NULL, 0, NULL, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_line_beginRtu(&l, &empty, s->buffer, MBM_MAX_FRAME));
    every_node_request_returns(MBM_NOT_INITIALISED, &m);
    /* A begin that is refused leaves a line that was begun before as it was. */
    IS(MBM_INVALID_ARGUMENT, mbm_line_beginRtu(&s->line, &empty, s->buffer, 8));
    assert_int_equal(mbm_node_getSlaveID(n), 17);
    sim_answer(s, 1, 500, "11 03 02 00 01 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
}

/* Buffers of exactly these sizes, so that sanitizers report an access to one byte more. */
typedef struct buffers {
    uint16_t *response, *transmit;
    uint8_t *frame;
} buffers;

static buffers give_buffers(sim *s, uint16_t response, uint16_t transmit, uint16_t frame)
{
    buffers b;

    b.response = (uint16_t *)calloc(response + 1u, 2);
    b.transmit = (uint16_t *)calloc(transmit + 1u, 2);
    b.frame = (uint8_t *)malloc(frame);
    assert_true(b.response && b.transmit && b.frame);
    b.response = (uint16_t *)realloc(b.response, response ? response * 2u : 1u);
    b.transmit = (uint16_t *)realloc(b.transmit, transmit ? transmit * 2u : 1u);
    OK(mbm_node_begin(&s->node, &s->line, 17, b.response, response, b.transmit, transmit));
    OK(mbm_line_setFrame(&s->line, b.frame, frame));
    return b;
}

static void free_buffers(sim *s, buffers b)
{
    sim_begin(s, 17);
    free(b.response);
    free(b.transmit);
    free(b.frame);
}

SIM_TEST(a_request_is_sent_whole_or_not_at_all)
{
    mbm_line_setGap(&s->line, 0);
    mbm_line_setQuietTime(&s->line, 0);
    mbm_node_setResponseTimeout(n, 50);
    for (uint16_t bytes = 8; bytes < 24; bytes++) {
        buffers b = give_buffers(s, 4, 4, bytes);

        s->sent = 0;
        mbm_node_writeSingleRegister(n, 0, 1);
        assert_int_equal(s->sent, 1);
        mbm_node_maskWriteRegister(n, 0, 1, 2);
        assert_int_equal(s->sent, 1 + (bytes >= 10));
        s->sent = 0;
        mbm_node_writeMultipleCoils(n, 0, 17);
        assert_int_equal(s->sent, bytes >= 12);
        s->sent = 0;
        mbm_node_writeMultipleRegisters(n, 0, 4);
        assert_int_equal(s->sent, bytes >= 17);
        s->sent = 0;
        IS(bytes >= 21 ? MBM_RESPONSE_TIMED_OUT : MBM_BUFFER_TOO_SMALL,
           mbm_node_readWriteMultipleRegisters(n, 0, 1, 0, 4));
        assert_int_equal(s->sent, bytes >= 21);
        free_buffers(s, b);
    }
}

SIM_TEST(a_reply_longer_than_the_frame_buffer_is_too_long_and_changes_nothing)
{
    for (uint16_t bytes = 8; bytes <= 13; bytes++) {
        buffers b = give_buffers(s, 4, 4, bytes);

        s->answered = 0;
        sim_answer(s, 1, 500, "11 03 08 11 11 22 22 33 33 44 44 +");
        IS(bytes >= 13 ? MBM_OK : MBM_BUFFER_TOO_SMALL, mbm_node_readHoldingRegisters(n, 0, 4));
        assert_int_equal(b.response[3], bytes >= 13 ? 0x4444 : 0);
        assert_int_equal(mbm_node_available(n), bytes >= 13 ? 4 : 0);
        sim_answer(s, 1, 500, "11 83 02 +");
        IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, 0, 4));
        sim_answer(s, 1, 500, "11 03 02 12 34 +");
        OK(mbm_node_readHoldingRegisters(n, 0, 1));
        free_buffers(s, b);
    }
}

/* Asks for 4 words with a frame buffer that holds 3, and has the device send `reply`. */
static void ends_in_12_bytes(sim *s, mbm_node *n, uint8_t status, const char *reply)
{
    buffers b = give_buffers(s, 4, 4, 12);

    sim_answer(s, 1, 500, reply);
    IS(status, mbm_node_readHoldingRegisters(n, 0, 4));
    free_buffers(s, b);
}

SIM_TEST(a_read_that_the_frame_buffer_is_too_small_for_ends_so_or_with_an_exception)
{
    mbm_line_setQuietTime(&s->line, 0);
    ends_in_12_bytes(s, n, MBM_BUFFER_TOO_SMALL, "");
    ends_in_12_bytes(s, n, MBM_BUFFER_TOO_SMALL,
                     "21 90 1C 04 / 11 03 08 11 11 22 22 33 33 44 44 +");
    ends_in_12_bytes(s, n, MBM_BUFFER_TOO_SMALL, "12 03 04 11 03 08 00 +");
    ends_in_12_bytes(s, n, MBM_ILLEGAL_DATA_ADDRESS, "12 03 04 11 03 08 00 + / 11 83 02 +");
}

SIM_TEST(a_whole_reply_longer_than_the_frame_buffer_ends_the_request_at_once)
{
    ends_in_12_bytes(s, n, MBM_BUFFER_TOO_SMALL, "11 03 08 11 11 22 22 33 33 44 44 +");
    assert_true(s->now < 100000);
}

SIM_TEST(a_read_of_66_words_with_buffers_for_64_returns_the_devices_exception)
{
    char reply[600] = "11 03 84";

    buffers b = give_buffers(s, 64, 64, MBM_FRAME_BYTES(64));
    sim_answer(s, 1, 500, "11 83 02 +");
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, 0, 66));
    sim_assert_sent(s, 0, "11 03 00 00 00 42 +");
    for (unsigned i = 0; i < 132; i++)
        strcat(reply, " 77");
    strcat(reply, " +");
    sim_answer(s, 1, 500, reply);
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_readHoldingRegisters(n, 0, 66));
    for (unsigned i = 0; i < 64; i++)
        assert_int_equal(b.response[i], 0);
    assert_int_equal(mbm_node_available(n), 0);
    free_buffers(s, b);
}

SIM_TEST(a_reply_longer_than_the_response_words_changes_none)
{
    buffers b = give_buffers(s, 2, 0, 256);
    sim_answer(s, 1, 500, "11 03 06 11 11 22 22 33 33 +");
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_readHoldingRegisters(n, 0, 3));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_status(n));
    sim_answer(s, 1, 500, "11 01 05 11 11 22 22 33 +");
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_readCoils(n, 0, 33));
    assert_int_equal(b.response[0], 0);
    assert_int_equal(b.response[1], 0);
    sim_answer(s, 1, 500, "11 01 04 11 11 22 22 +");
    OK(mbm_node_readCoils(n, 0, 32));
    free_buffers(s, b);
    b = give_buffers(s, 0, 0, 256);
    sim_answer(s, 1, 500, "11 03 02 11 11 +");
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_readHoldingRegisters(n, 0, 1));
    free_buffers(s, b);
}

SIM_TEST(writes_beyond_the_transmit_words_return_3_and_nothing_is_sent)
{
    buffers b = give_buffers(s, 2, 2, 256);
    IS(3, mbm_node_writeMultipleRegisters(n, 0, 3));
    IS(3, mbm_node_writeMultipleCoils(n, 0, 33));
    IS(3, mbm_node_readWriteMultipleRegisters(n, 0, 1, 0, 3));
    assert_int_equal(s->sent, 0);
    sim_answer(s, 1, 500, "11 0F 00 00 00 20 +");
    OK(mbm_node_writeMultipleCoils(n, 0, 32));
    sim_answer(s, 1, 500, "11 10 00 00 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 0, 2));
    free_buffers(s, b);
}

SIM_TEST(single_writes_need_no_transmit_words)
{
    buffers b = give_buffers(s, 0, 0, 16);
    sim_answer(s, 1, 500, "11 06 00 01 12 34 +");
    OK(mbm_node_writeSingleRegister(n, 1, 0x1234));
    sim_answer(s, 1, 500, "11 16 00 01 12 34 56 78 +");
    OK(mbm_node_maskWriteRegister(n, 1, 0x1234, 0x5678));
    sim_answer(s, 1, 500, "11 05 00 01 FF 00 +");
    OK(mbm_node_writeSingleCoil(n, 1, 1));
    free_buffers(s, b);
}

SIM_TEST(a_frame_buffer_of_64_kilobytes_works)
{
    buffers b = give_buffers(s, 125, 123, 65535);
    sim_answer(s, 1, 500, "00 00 / 11 03 02 12 34 +");
    OK(mbm_node_readHoldingRegisters(n, 1, 1));
    free_buffers(s, b);
}

/* Ports that stall, lie or lose the link, and clocks that wrap: the call ends with a
 * status, the driver is off, and the next request works. Unit 17 is 11 on the wire. */

SIM_TEST(write_may_accept_a_byte_at_a_time)
{
    s->write_piece = 1;
    for (unsigned i = 0; i < 123; i++)
        s->transmit[i] = (uint16_t)(i * 0x0101);
    sim_answer(s, 1, 500, "11 10 00 00 00 7B +");
    OK(mbm_node_writeMultipleRegisters(n, 0, 123));
    assert_int_equal(s->frames[0].length, 255);
    assert_int_equal(s->frames[0].bytes[7 + 2 * 99], 99);
}

SIM_TEST(read_may_return_a_byte_at_a_time)
{
    s->read_piece = 1;
    sim_deliver_text(s, s->now, "01 02 03 04 05");
    sim_reads(s, 500);
}

SIM_TEST(a_write_that_never_accepts_a_byte_is_a_busy_line)
{
    s->write_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    assert_int_equal(s->sent, 0);
    sim_assert_order(s, "PO", "PO");
    assert_in_range(s->now, 2000000, 2500000);
    s->write_never = 0;
    sim_reads(s, 500);
}

SIM_TEST(a_flush_that_never_drains_is_a_busy_line)
{
    s->flush_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    sim_assert_order(s, "PO", "PO");
    assert_in_range(s->now, 2000000, 2500000);
    s->flush_never = 0;
    sim_reads(s, 500);
}

SIM_TEST(a_link_lost_in_the_gap_sends_nothing)
{
    s->read_dead = 1;
    IS(MBM_LINK_LOST, sim_read_one(s));
    IS(MBM_LINK_LOST, mbm_node_status(n));
    assert_int_equal(s->sent, 0);
    sim_assert_order(s, "PWO", "");
    s->read_dead = 0;
    sim_reads(s, 500);
}

static void die_mid_reply(sim *s)
{
    if (s->first > 3)
        s->read_dead = 1;
}

SIM_TEST(a_link_lost_mid_reply_ends_the_request_at_once)
{
    mbm_line_setRetries(&s->line, 3);
    s->on_idle = die_mid_reply;
    sim_answer(s, 1, 500, "11 03 02 00 07 +");
    IS(MBM_LINK_LOST, sim_read_one(s));
    assert_int_equal(s->sent, 1);
    assert_true(s->now < 20000);
    s->on_idle = NULL;
    s->read_dead = 0;
    sim_reads(s, 500);
}

SIM_TEST(a_link_lost_mid_write_switches_the_driver_off)
{
    s->cut_allowed = 7;
    for (uint16_t at = 1; at <= 8; at++) {
        s->write_dies_at = at;
        IS(MBM_LINK_LOST, sim_read_one(s));
        assert_int_equal(s->driver_on, 0);
    }
    s->write_dies_at = 0;
    sim_reads(s, 500);
    assert_int_equal(s->sent, 9);
}

/* Without the gap, a device would take the sent half and the next request for one frame. */
SIM_TEST(the_gap_is_kept_after_a_link_lost_mid_write)
{
    s->character = 0; /* bytes are on the wire as soon as they are handed over */
    s->cut_allowed = 1;
    s->write_dies_at = 5;
    IS(MBM_LINK_LOST, sim_read_one(s));
    s->write_dies_at = 0;
    sim_reads(s, 500);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 4000, 4100);
}

SIM_TEST(hooks_that_claim_too_many_bytes_do_no_harm)
{
    s->overclaim = 1000;
    sim_reads(s, 500);
    assert_int_equal(s->counters.bytesSent, 8);
    s->read_piece = 0;
    sim_deliver_text(s, s->now, "01 02 03 04 05 06 07 08 09");
    sim_reads(s, 500);
    assert_int_equal(s->frames[1].length, 8);
}

/* One read with its gap, hold and reply takes 12 ms. The clock wraps at each quarter of a
 * character in this time. */
TEST(the_clock_may_wrap_at_any_time_of_a_transaction)
{
    for (uint32_t ahead = 0; ahead < 12000; ahead += 25) {
        sim *s = sim_of_test();

        s->clock_start = (uint32_t)(0u - ahead - s->now);
        mbm_line_setPostFlushHold(&s->line, 1);
        mbm_node_setResponseTimeout(&s->node, 5);
        sim_begin(s, 17);
        OK(mbm_line_used(&s->line));
        sim_answer(s, 1, 3000, "11 03 02 00 2A +");
        OK(sim_read_one(s));
        assert_in_range(s->frames[0].silence, 4000, 4100);
        IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
        assert_in_range(s->now - s->frames[1].end, 5000 + 1146, 5000 + 1146 + 100);
        sim_teardown();
        sim_setup();
    }
}

TEST(the_clock_may_wrap_in_a_long_wait)
{
    static const uint32_t ahead[] = {100, 5000, 50000, 500000, 1999000, 2050000, 2100000};

    for (size_t i = 0; i < COUNT(ahead); i++) {
        sim *s = sim_of_test();

        s->clock_start = (uint32_t)(0u - ahead[i] - s->now);
        sim_begin(s, 17);
        IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
        assert_in_range(s->now - s->frames[0].end, 2000000, 2000100);
        sim_reads(s, 500);
        assert_in_range(s->frames[1].silence, 2000000 + 100000, 2000000 + 100200);
        mbm_node_setSlaveID(&s->node, 0);
        OK(mbm_node_writeSingleCoil(&s->node, 0, 0));
        assert_in_range(s->now - s->frames[2].end, 100000, 100100);
        sim_teardown();
        sim_setup();
    }
}
