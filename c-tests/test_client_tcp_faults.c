/* The client against a TCP peer that plays one fault in each test: how the request that
 * meets the fault ends, without a retry and with one, and that the next requests succeed. */
#define _GNU_SOURCE
#include "client.h"
#include "tcp_peer.h"
#include "test.h"

#include <string.h>
#include <unistd.h>

enum { TIMEOUT = 150, WORDS = 5, MET = 3, ASKED = 8 };

static asker a;
static held_clock by_clock;
static tcp_peer *peer;
static mbm_clientRequest requests[ASKED];
static uint16_t words[ASKED][WORDS];

static void begin(void)
{
    peer = tcp_peer_new();
    held_clock_start(&by_clock);
    tcp_peer_clock(peer, &by_clock);
    asker_begin_tcp_by(&a, tcp_peer_start(peer, 0), &by_clock);
    OK(mbm_client_setInFlight(&a.client, ASKED));
    OK(mbm_client_setResponseTimeout(&a.client, TIMEOUT));
}

static void end(void)
{
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(peer);
}

fixture each_test = {begin, end};

static void queue_read(unsigned i)
{
    memset(&requests[i], 0, sizeof requests[i]);
    memset(words[i], 0, sizeof words[i]);
    requests[i].unit = 7;
    requests[i].reply = words[i];
    requests[i].replyBytes = sizeof words[i];
    requests[i].transaction = (uint16_t)(i + 1);
    IS(MBM_PENDING,
       mbm_client_readHoldingRegisters(&a.client, &requests[i], (uint16_t)(20 * i), WORDS));
}

static void is_right(unsigned i)
{
    assert_int_equal(requests[i].status, MBM_OK);
    for (unsigned word = 0; word < WORDS; word++)
        assert_int_equal(words[i][word], tcp_peer_word(20 * i + word));
}

/* Polls until all requests have ended. Connects anew if the connection was lost. */
static void finish(void)
{
    while (mbm_client_poll(&a.client) == MBM_PENDING)
        asker_rest(&a);
    if (!mbm_client_isConnected(&a.client) && mbm_tcp_isConnected(&a.tcp) < 0)
        IS(MBM_PENDING, mbm_client_reconnect(&a.client, &a.link));
}

/* Makes eight requests, one after the other. The third meets the fault. */
static void assert_ends_with(tcp_fault fault, unsigned argument, uint8_t status)
{
    tcp_peer_fault(peer, MET, fault, argument);
    for (unsigned i = 1; i <= ASKED; i++) {
        queue_read(i - 1);
        finish();
        if (i == MET && status != MBM_OK)
            assert_int_equal(requests[i - 1].status, status);
        else
            is_right(i - 1);
    }
    assert_int_equal(tcp_peer_count(peer).faults[fault], 1);
    assert_int_equal(tcp_peer_count(peer).requests, ASKED);
}

/* The same with one retry. A lost link and an exception are not retried. */
static void meets_and_retries(tcp_fault fault, unsigned argument)
{
    OK(mbm_client_setRetries(&a.client, 1));
    tcp_peer_fault(peer, MET, fault, argument);
    for (unsigned i = 0; i < ASKED; i++) {
        queue_read(i);
        finish();
        is_right(i);
    }
    assert_int_equal(tcp_peer_count(peer).requests, ASKED + 1);
}

#define MEETS(name, fault, argument, status)                                                       \
    TEST(name)                                                                                     \
    {                                                                                              \
        assert_ends_with(fault, argument, status);                                                 \
    }

#define MEETS_AND_RETRIES(name, fault, argument, status)                                           \
    MEETS(name, fault, argument, status)                                                           \
    TEST(name##_and_a_retry_helps)                                                                 \
    {                                                                                              \
        meets_and_retries(fault, argument);                                                        \
    }

MEETS(a_response_in_time_is_waited_for, FAULT_DELAY, TIMEOUT / 3, MBM_OK)
MEETS(a_response_in_single_bytes_is_put_together, FAULT_SPLIT, 1, MBM_OK)
MEETS(the_second_of_two_responses_is_dropped, FAULT_TWICE, 0, MBM_OK)
MEETS(a_response_of_another_id_before_the_right_one_is_dropped, FAULT_ALSO_OTHER_ID, 9, MBM_OK)
MEETS(garbage_before_the_response_is_skipped, FAULT_GARBAGE, 9, MBM_OK)
MEETS(an_exception_is_reported, FAULT_EXCEPTION, 6, MBM_SERVER_DEVICE_BUSY)
MEETS(half_a_response_and_the_end_is_a_lost_link, FAULT_HALF, 6, MBM_LINK_LOST)
MEETS(the_end_of_the_stream_is_a_lost_link, FAULT_CLOSE, 0, MBM_LINK_LOST)
MEETS(a_reset_is_a_lost_link, FAULT_RESET, 0, MBM_LINK_LOST)
MEETS_AND_RETRIES(a_response_that_never_comes_times_out, FAULT_DROP, 0, MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_late_response_answers_nothing_else, FAULT_DELAY, 2 * TIMEOUT,
                  MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_response_of_another_id_only_times_out, FAULT_OTHER_ID, 9,
                  MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_response_of_another_protocol_times_out, FAULT_WRONG_PROTOCOL, 1,
                  MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_response_of_another_unit_is_reported, FAULT_WRONG_UNIT, 1, MBM_INVALID_SLAVE_ID)
MEETS_AND_RETRIES(a_response_of_another_function_is_reported, FAULT_WRONG_FUNCTION, 4,
                  MBM_INVALID_FUNCTION)
MEETS_AND_RETRIES(a_length_that_is_too_small_is_malformed, FAULT_SHORT_LENGTH, 2,
                  MBM_MALFORMED_REPLY)

TEST(responses_in_another_order_are_matched)
{
    tcp_peer_fault(peer, 1, FAULT_HOLD, 5);
    tcp_peer_fault(peer, 2, FAULT_HOLD, 2);
    tcp_peer_fault(peer, 5, FAULT_DELAY, 20);
    for (unsigned i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (unsigned i = 0; i < ASKED; i++)
        is_right(i);
    assert_int_equal(a.counters.foreignFrames, 0);
}

TEST(responses_in_one_segment_are_separated)
{
    tcp_peer_fault(peer, 1, FAULT_JOIN, ASKED - 1);
    for (unsigned i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (unsigned i = 0; i < ASKED; i++)
        is_right(i);
}

TEST(a_reset_ends_all_requests_in_flight)
{
    unsigned i, lost = 0;

    tcp_peer_fault(peer, MET, FAULT_RESET, 0);
    for (i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (i = 0; i < ASKED; i++) {
        assert_true(requests[i].status == MBM_OK || requests[i].status == MBM_LINK_LOST);
        lost += requests[i].status == MBM_LINK_LOST;
    }
    assert_true(lost >= ASKED - MET + 1);
    for (i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (i = 0; i < ASKED; i++)
        is_right(i);
}
