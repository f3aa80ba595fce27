/* The client over a port in memory: when its link is known to be lost, how its waits vary,
 * and which transaction identifier is on the wire. */
#include "memory_port.h"
#include "test.h"

#include <string.h>

enum { UNIT = 7, SECOND = 1000000 };

static memory_port m;
static mbm_client client;
static mbm_clientRequest request;
static uint8_t frame[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[4];

static void begin(int framing)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    switch (framing) {
    case MBM_FRAMING_RTU: OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_ASCII: OK(mbm_client_beginAscii(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_RTU_OVER_TCP:
        OK(mbm_client_beginRtuOverTcp(&client, &port, frame, sizeof frame));
        break;
    default:
        OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
        OK(mbm_client_setInFlight(&client, MBM_CLIENT_DEPTH));
        break;
    }
    request.unit = UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
}

static void queue_read(void)
{
    m.sent_count = 0;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
}

/* Delivers the right reply to the last request. */
static void answer(int framing)
{
    static const uint8_t rtu[] = {UNIT, 3, 2, 0x12, 0x34};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 5, UNIT, 3, 2, 0x12, 0x34};

    if (framing == MBM_FRAMING_ASCII) {
        memory_port_bytes(&m,
                          (const uint8_t *)":07030212"
                                           "34AE\r\n",
                          15);
    } else if (framing == MBM_FRAMING_TCP) {
        memcpy(tcp, m.sent, 2);
        memory_port_bytes(&m, tcp, sizeof tcp);
    } else {
        memory_port_rtu(&m, rtu, sizeof rtu);
    }
}

static uint8_t connects_with;

static uint8_t reconnected(void *context)
{
    (void)context;
    return connects_with;
}

static const int framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                               MBM_FRAMING_RTU_OVER_TCP};

TEST(a_link_is_connected_once_connect_succeeds_or_a_reply_arrives)
{
    static const uint8_t statuses[] = {MBM_OK, MBM_PENDING, MBM_LINK_LOST, MBM_INVALID_ARGUMENT};
    const mbm_linkHooks link = {.connect = reconnected};

    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned k = 0; k < COUNT(statuses); k++) {
            begin(framings[i]);
            assert_int_equal(mbm_client_isConnected(&client), 1);
            m.is_lost = 1;
            queue_read();
            IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 100));
            assert_int_equal(mbm_client_isConnected(&client), 0);

            m.is_lost = 0;
            connects_with = statuses[k];
            IS(statuses[k], mbm_client_reconnect(&client, &link));
            assert_int_equal(mbm_client_isConnected(&client), statuses[k] == MBM_OK);
            /* A request without a reply does not show that there is a link. */
            queue_read();
            IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
            assert_int_equal(mbm_client_isConnected(&client), statuses[k] == MBM_OK);
            queue_read();
            memory_port_send(&m, &client);
            answer(framings[i]);
            IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
            assert_int_equal(mbm_client_isConnected(&client), 1);
        }
}

TEST(a_link_that_the_program_connected_is_connected)
{
    const mbm_linkHooks none = {.connect = NULL};

    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin(framings[i]);
        m.is_lost = 1;
        queue_read();
        IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 100));
        OK(mbm_client_reconnect(&client, i % 2 ? &none : NULL));
        assert_int_equal(mbm_client_isConnected(&client), 1);
    }
}

static uint32_t number;

/* Random functions whose values vary in different bits. */
static uint32_t of_32_bits(void *context)
{
    (void)context;
    number = number * 1664525u + 1013904223u;
    return number;
}

static uint32_t of_15_bits(void *context)
{
    return of_32_bits(context) >> 17;
}

static uint32_t of_16_bits(void *context)
{
    return of_32_bits(context) >> 16;
}

static uint32_t of_upper_bits(void *context)
{
    return of_32_bits(context) & 0xFFFF0000u;
}

TEST(any_random_function_gives_the_whole_range_of_jitter)
{
    uint32_t (*const generators[])(void *) = {of_32_bits, of_15_bits, of_16_bits, of_upper_bits};

    for (unsigned i = 0; i < COUNT(generators); i++) {
        uint32_t least = UINT32_MAX, most = 0, sum = 0;

        begin(MBM_FRAMING_TCP);
        OK(mbm_client_setResponseTimeout(&client, 1));
        OK(mbm_client_setRetries(&client, 255));
        OK(mbm_client_setBackoff(&client, MBM_BACKOFF_FIXED, 1000, 1000));
        OK(mbm_client_setJitter(&client, 100, generators[i], NULL));
        queue_read();
        memory_port_send(&m, &client);
        for (unsigned k = 0; k < 255; k++) {
            uint32_t sent_at = m.now, wait;

            m.sent_count = 0;
            memory_port_send(&m, &client);
            wait = m.now - sent_at - 1000;
            least = wait < least ? wait : least;
            most = wait > most ? wait : most;
            sum += wait / 255;
        }
        IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 10));
        assert_in_range(least, 0, SECOND / 20);
        assert_in_range(most, SECOND - SECOND / 20, SECOND);
        assert_in_range(sum, SECOND / 2 - SECOND / 10, SECOND / 2 + SECOND / 10);
    }
}

TEST(the_transaction_identifier_on_the_wire_can_be_read)
{
    mbm_clientRequest other = {0};
    uint16_t first;

    begin(MBM_FRAMING_TCP);
    assert_int_equal(mbm_client_wireTransaction(&request), 0);
    assert_int_equal(mbm_client_wireTransaction(NULL), 0);
    /* A second request, so that the identifier is not 0. */
    queue_read();
    memory_port_send(&m, &client);
    answer(MBM_FRAMING_TCP);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 10));
    request.transaction = 500;
    other.unit = UNIT;
    other.transaction = 501;
    queue_read();
    IS(MBM_PENDING, mbm_client_readCoils(&client, &other, 0, 1));
    memory_port_send(&m, &client);
    assert_int_equal(m.sent_count, 24);
    first = mbm_client_wireTransaction(&request);
    assert_int_equal(first, m.sent[0] << 8 | m.sent[1]);
    assert_int_equal(mbm_client_wireTransaction(&other), m.sent[12] << 8 | m.sent[13]);
    assert_int_not_equal(first, mbm_client_wireTransaction(&other));
    assert_int_equal(request.transaction, 500);
    assert_int_equal(other.transaction, 501);
    /* The identifier can be read after the end, too. */
    answer(MBM_FRAMING_TCP);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 10));
    assert_int_equal(mbm_client_wireTransaction(&request), first);
}

TEST(reserved_units_and_sub_functions_are_sent_as_they_are)
{
    static const uint8_t sent[] = {255, 8, 0, 0x15, 0xAB, 0xCD}, reply[] = {255, 8, 0, 0x15, 1, 2};
    const uint16_t data = 0xABCD;

    begin(MBM_FRAMING_RTU);
    request.unit = 255;
    request.data = &data;
    IS(MBM_PENDING, mbm_client_diagnostics(&client, &request, 0x15, 1));
    memory_port_send(&m, &client);
    assert_int_equal(m.sent_count, sizeof sent + 2);
    assert_memory_equal(m.sent, sent, sizeof sent);
    memory_port_rtu(&m, reply, sizeof reply);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(words[0], 0x0102);
}

TEST(an_ascii_frame_buffer_below_17_bytes_is_refused)
{
    const mbm_port port = memory_port_of(&m);

    memset(&client, 0, sizeof client);
    IS(MBM_INVALID_ARGUMENT, mbm_client_beginAscii(&client, &port, frame, 16));
    IS(MBM_NOT_INITIALISED, mbm_client_poll(&client));
    OK(mbm_client_beginAscii(&client, &port, frame, 17));
}
