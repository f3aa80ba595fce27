/* mbm_client_setAccept, mbm_client_setLenient and mbm_client_setMessageWait: with and without a
 * link, and in each framing. tests/client_tolerant.rs has the rules themselves. */
#include "linked.h"

/* A reply in TCP frames to the request that was sent last, with this number and unit; with `more`
 * registers beside the one that was asked. */
static void answer_as(uint16_t number, uint8_t unit, uint8_t more)
{
    uint8_t reply[] = {
        0,    0, 0, 0, 0, (uint8_t)(5 + 2 * more), unit, 3, (uint8_t)(2 + 2 * more), 0x12,
        0x34, 9, 9, 9, 9};

    reply[0] = (uint8_t)(number >> 8);
    reply[1] = (uint8_t)number;
    memory_port_bytes(&m, reply, (size_t)(11 + 2 * more));
}

static uint16_t number_sent(void)
{
    return (uint16_t)(m.sent[0] << 8 | m.sent[1]);
}

static void sends_read(void)
{
    m.sent_count = 0;
    words[0] = 0;
    queue_read(&request);
    memory_port_send(&m, &client);
    assert_int_equal(m.sent_count, 12);
}

static void is_right(void)
{
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(words[0], 0x1234);
    assert_int_equal(request.length, 2);
}

/* Without a link, with one, and with one that is begun after the settings. */
enum { ALONE, LINKED, LINKED_LATER, WAYS };

static void begin_tcp(int way)
{
    begin_up(MBM_FRAMING_TCP);
    if (way != LINKED)
        OK(mbm_link_end(&kept));
    OK(mbm_client_setInFlight(&client, 1));
}

static void link_later(int way)
{
    if (way != LINKED_LATER)
        return;
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_client_poll(&client));
}

TEST(a_reply_with_another_number_or_unit_is_taken_if_it_was_set)
{
    for (int way = 0; way < WAYS; way++)
        for (uint8_t accept = 0; accept < 4; accept++) {
            begin_tcp(way);
            OK(mbm_client_setAccept(&client, accept));
            link_later(way);
            sends_read();
            answer_as((uint16_t)(number_sent() + 100), UNIT, 0);
            if (accept & MBM_ACCEPT_TRANSACTION)
                is_right();
            else
                IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
            begin_tcp(way);
            OK(mbm_client_setAccept(&client, accept));
            link_later(way);
            sends_read();
            answer_as(number_sent(), 0, 0);
            if (accept & MBM_ACCEPT_UNIT)
                is_right();
            else
                IS(MBM_INVALID_SLAVE_ID, memory_port_run(&m, &client, &request, 1000));
        }
}

TEST(a_lenient_client_takes_the_registers_that_it_asked_for)
{
    for (int way = 0; way < WAYS; way++) {
        begin_tcp(way);
        request.replyBytes = 2;
        OK(mbm_client_setLenient(&client, 1));
        link_later(way);
        sends_read();
        answer_as(number_sent(), UNIT, 1);
        is_right();
        OK(mbm_client_setLenient(&client, 0));
        sends_read();
        answer_as(number_sent(), UNIT, 1);
        IS(MBM_MALFORMED_REPLY, memory_port_run(&m, &client, &request, 1000));
    }
}

TEST(a_lenient_client_of_an_rtu_line_does_too_whatever_else_is_set)
{
    static const uint8_t four[] = {UNIT, 3, 4, 0x12, 0x34, 9, 9};
    static const uint8_t rtu_framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_RTU_OVER_TCP};

    for (unsigned i = 0; i < COUNT(rtu_framings); i++)
        for (int echo = 0; echo < 3; echo++) {
            begin_up(rtu_framings[i]);
            if (echo == 1)
                OK(mbm_client_setEchoDiscard(&client, 1));
            OK(mbm_client_setLenient(&client, 1));
            if (echo == 2)
                OK(mbm_client_setEchoDiscard(&client, 1));
            queue_read(&request);
            memory_port_send(&m, &client);
            if (echo)
                memory_port_bytes(&m, m.sent, m.sent_count);
            memory_port_rtu(&m, four, sizeof four);
            is_right();
            OK(mbm_client_setLenient(&client, 0));
            m.sent_count = 0;
            queue_read(&request);
            memory_port_send(&m, &client);
            if (echo)
                memory_port_bytes(&m, m.sent, m.sent_count);
            memory_port_rtu(&m, four, sizeof four);
            IS(MBM_MALFORMED_REPLY, memory_port_run(&m, &client, &request, 1000));
        }
}

FRAMING_TEST(a_message_wait_passes_between_two_requests_in_each_framing)
{
    uint32_t end;

    begin_up(framing);
    if (framing == MBM_FRAMING_TCP)
        OK(mbm_client_setInFlight(&client, 1));
    OK(mbm_client_setBaudRate(&client, 9600));
    OK(mbm_client_setMessageWait(&client, 50));
    for (unsigned turn = 0; turn < 3; turn++) {
        queue_read(&request);
        m.sent_count = 0;
        memory_port_send(&m, &client);
        answer(framing);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        end = m.now;
        queue_read(&other);
        m.sent_count = 0;
        memory_port_send(&m, &client);
        assert_in_range(m.now - end, 50 * MS, 51 * MS);
        answer(framing);
        IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
    }
}

TEST(a_message_wait_of_a_serial_line_is_never_shorter_than_its_gap)
{
    begin_up(MBM_FRAMING_RTU);
    OK(mbm_client_setBaudRate(&client, 1200));
    OK(mbm_client_setMessageWait(&client, 1));
    run(1000);
    memory_port_bytes(&m, frame, 1);
    OK(mbm_client_poll(&client));
    queue_read(&request);
    IS(MBM_PENDING, mbm_client_poll(&client));
    assert_in_range(mbm_client_pollDelay(&client), 32000, 33000);
}

TEST(settings_that_need_one_request_in_flight_are_refused_with_more)
{
    begin_tcp(ALONE);
    OK(mbm_client_setInFlight(&client, 2));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setMessageWait(&client, 1));
    OK(mbm_client_setAccept(&client, MBM_ACCEPT_UNIT));
    OK(mbm_client_setMessageWait(&client, 0));
    OK(mbm_client_setLenient(&client, 1));
    OK(mbm_client_setInFlight(&client, 1));
    OK(mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(&client, 2));
    OK(mbm_client_setAccept(&client, 0));
    OK(mbm_client_setMessageWait(&client, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(&client, 2));
    OK(mbm_client_setInFlight(&client, 1));
}

TEST(wrong_values_and_other_framings_are_refused)
{
    begin_tcp(ALONE);
    IS(MBM_INVALID_ARGUMENT, mbm_client_setAccept(&client, 4));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setAccept(NULL, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setMessageWait(&client, 65536));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setMessageWait(NULL, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setLenient(NULL, 1));
    for (unsigned i = 0; i < COUNT(framings); i++) {
        if (framings[i] == MBM_FRAMING_TCP)
            continue;
        begin_up(framings[i]);
        IS(MBM_INVALID_ARGUMENT, mbm_client_setAccept(&client, MBM_ACCEPT_UNIT));
        OK(mbm_client_setAccept(&client, 0));
    }
    begin_up(MBM_FRAMING_ASCII);
    IS(MBM_INVALID_ARGUMENT, mbm_client_setLenient(&client, 1));
    OK(mbm_client_setLenient(&client, 0));
}

/* The device answers three times as late as it may: over a connection that stays, its replies would
 * be those to other requests. */
TEST(however_late_a_reply_is_it_does_not_come_over_a_new_connection)
{
    begin_tcp(LINKED);
    OK(mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION));
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE));
    for (unsigned turn = 1; turn < 4; turn++) {
        sends_read();
        IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
        queue_read(&request);
        m.sent_count = 0;
        memory_port_send(&m, &client);
        assert_int_equal(connects, 1 + turn);
        answer_as(0, UNIT, 0);
        is_right();
    }
}

/* Without a link the client waits for the late reply instead. */
TEST(a_late_reply_is_not_taken_for_the_next_one)
{
    begin_tcp(ALONE);
    OK(mbm_client_setQuietTime(&client, 100));
    OK(mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION));
    sends_read();
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
    m.sent_count = 0;
    queue_read(&request);
    run(399);
    assert_int_equal(m.sent_count, 0);
    answer_as(0, UNIT, 0);
    run(2);
    IS(MBM_PENDING, request.status);
    assert_int_equal(m.sent_count, 12);
    words[0] = 0;
    answer_as(0, UNIT, 0);
    is_right();
}

TEST(a_client_that_is_begun_again_is_strict)
{
    begin_tcp(ALONE);
    OK(mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION | MBM_ACCEPT_UNIT));
    begin_client(MBM_FRAMING_TCP);
    sends_read();
    answer_as((uint16_t)(number_sent() + 1), UNIT, 0);
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
}
