/* The response timeout and the retries of one request and of one unit, and repetitions while
 * a device is busy: in every framing over a port in memory, and with many requests in flight
 * against a TCP peer whose replies and exceptions libmodbus makes. */
#include "every_call.h"
#include "refused.h"
#include "client.h"
#include "memory_port.h"
#include "tcp_peer.h"
#include "test.h"

enum { UNIT = 7, MS = 1000, STEPS = 1000 };
/* Timeouts in milliseconds. */
enum { CLIENTS = 300, UNITS = 700, OWN = 1100 };
enum { ACKNOWLEDGE = 5, SERVER_DEVICE_BUSY = 6 };

static memory_port m;
static mbm_client client;
static mbm_clientRequest request;
static mbm_clientUnit units[2];
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[4];

static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                   MBM_FRAMING_RTU_OVER_TCP};

static void begin(int framing)
{
    const mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(units, 0, sizeof units);
    OK(CLIENT_BEGIN(&client, framing, &port, frame, outgoing));
    if (framing == MBM_FRAMING_TCP)
        OK(mbm_client_setInFlight(&client, MBM_CLIENT_DEPTH));
    OK(mbm_client_setResponseTimeout(&client, CLIENTS));
    OK(mbm_client_setQuietTime(&client, 0));
    units[0].unit = UNIT + 1;
    units[1].unit = UNIT;
    request.unit = UNIT;
    request.data = words;
    request.reply = words;
    request.replyBytes = sizeof words;
}

/* Queues a read and polls until it is sent. */
static void send_read(void)
{
    m.sent_count = 0;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    memory_port_send(&m, &client);
}

/* The milliseconds after which a request that was sent ends without a reply. */
static uint32_t time_of_read(void)
{
    send_read();
    uint32_t sent = m.now;
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, STEPS));
    return (m.now - sent) / MS;
}

FRAMING_TEST(the_timeout_of_a_request_overrides_that_of_the_unit_and_of_the_client)
{
    begin(framing);
    assert_int_equal(time_of_read(), CLIENTS);
    request.timeoutMs = OWN;
    assert_int_equal(time_of_read(), OWN);
    request.timeoutMs = 10;
    assert_int_equal(time_of_read(), 10);
    request.timeoutMs = UINT16_MAX;
    assert_int_equal(time_of_read(), UINT16_MAX);

    units[1].timeoutMs = UNITS;
    OK(mbm_client_setUnits(&client, units, 2));
    assert_int_equal(time_of_read(), UINT16_MAX);
    request.timeoutMs = 0;
    assert_int_equal(time_of_read(), UNITS);
    request.unit = UNIT + 1;
    assert_int_equal(time_of_read(), CLIENTS);
    request.unit = UNIT;
    assert_int_equal(time_of_read(), UNITS);
    request.unit = UNIT + 2; /* It has no record. */
    assert_int_equal(time_of_read(), CLIENTS);
    request.unit = UNIT;
    units[1].timeoutMs = 0;
    assert_int_equal(time_of_read(), CLIENTS);
    units[1].timeoutMs = UNITS;
    assert_int_equal(time_of_read(), UNITS);
    OK(mbm_client_setUnits(&client, NULL, 0));
    assert_int_equal(time_of_read(), CLIENTS);
}

FRAMING_TEST(a_unit_and_a_timeout_that_are_too_large_are_refused)
{
    begin(framing);
    request.unit = 300; /* not 44 */
    INVALID(client, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    IS(MBM_INVALID_ARGUMENT, request.status);
    request.unit = 256; /* not a broadcast */
    INVALID(client, mbm_client_writeSingleCoil(&client, &request, 0, 1));
    request.unit = UINT16_MAX;
    INVALID(client, mbm_client_readExceptionStatus(&client, &request));
    request.unit = 255;
    assert_int_equal(time_of_read(), CLIENTS);

    request.timeoutMs = 1000001;
    INVALID(client, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    IS(MBM_INVALID_ARGUMENT, request.status);
    request.timeoutMs = UINT32_MAX;
    INVALID(client, mbm_client_maskWriteRegister(&client, &request, 0, 0, 0));
    request.timeoutMs = 100000; /* not 34464 */
    assert_int_equal(time_of_read(), 100000);
    request.timeoutMs = 1000000;
    assert_int_equal(time_of_read(), 1000000);
    assert_int_equal(mbm_client_pending(&client), 0);
}

FRAMING_TEST(a_record_with_a_unit_or_a_timeout_that_is_too_large_is_refused)
{
    begin(framing);
    units[1].timeoutMs = UNITS;
    OK(mbm_client_setUnits(&client, units, 2));
    units[0].unit = 300;
    INVALID(client, mbm_client_setUnits(&client, units, 1));
    units[0].unit = UNIT + 1;
    units[0].timeoutMs = 1000001;
    INVALID(client, mbm_client_setUnits(&client, units, 1));
    assert_int_equal(time_of_read(), UNITS); /* as before the refused calls */
    units[0].timeoutMs = 1000000;
    OK(mbm_client_setUnits(&client, units, 2));

    /* Changed later, which no call can refuse. */
    request.unit = 44;
    units[1].unit = 300;
    assert_int_equal(time_of_read(), CLIENTS);
    request.unit = UNIT;
    units[1].unit = UNIT;
    units[1].timeoutMs = 100000;
    assert_int_equal(time_of_read(), 100000);
    units[1].timeoutMs = UINT32_MAX;
    assert_int_equal(time_of_read(), 1000000);
}

/* How often a read is sent that gets no reply. */
static unsigned sendings(void)
{
    send_read();
    size_t one = m.sent_count;
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, STEPS));
    assert_int_equal(m.sent_count % one, 0);
    return (unsigned)(m.sent_count / one);
}

FRAMING_TEST(the_retries_of_a_request_override_those_of_the_unit_and_of_the_client)
{
    begin(framing);
    assert_int_equal(sendings(), 1);
    OK(mbm_client_setRetries(&client, 2));
    assert_int_equal(sendings(), 3);
    request.retryLimit = 4;
    assert_int_equal(sendings(), 5);
    request.retryLimit = 1;
    assert_int_equal(sendings(), 2);
    request.retryLimit = MBM_NO_RETRIES;
    assert_int_equal(sendings(), 1);

    units[1].retryLimit = 3;
    OK(mbm_client_setUnits(&client, units, 2));
    assert_int_equal(sendings(), 1);
    request.retryLimit = 4;
    assert_int_equal(sendings(), 5);
    request.retryLimit = 0;
    assert_int_equal(sendings(), 4);
    assert_int_equal(units[1].retries, 4 + 3);
    request.unit = UNIT + 1;
    assert_int_equal(sendings(), 3);
    request.unit = UNIT;
    units[1].retryLimit = MBM_NO_RETRIES;
    assert_int_equal(sendings(), 1);
    request.retryLimit = 1;
    assert_int_equal(sendings(), 2);
    OK(mbm_client_setUnits(&client, NULL, 0));
    request.retryLimit = 0;
    assert_int_equal(sendings(), 3);
    OK(mbm_client_setRetries(&client, 0));
    request.retryLimit = 5;
    assert_int_equal(sendings(), 6);
}

FRAMING_TEST(a_client_that_repeats_nothing_refuses_a_request_with_retries)
{
    begin(framing);
    request.retryLimit = 1;
    IS(MBM_INVALID_ARGUMENT, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    IS(MBM_INVALID_ARGUMENT, request.status);
    assert_int_equal(mbm_client_pending(&client), 0);
    request.retryLimit = MBM_NO_RETRIES;
    assert_int_equal(sendings(), 1);
    request.retryLimit = 1;
    switch (framing % 3) {
    case 0: OK(mbm_client_setRetries(&client, 0)); break;
    case 1: OK(mbm_client_setUnits(&client, units, 2)); break;
    default: OK(mbm_client_setBusyRetries(&client, 0, 0)); break;
    }
    assert_int_equal(sendings(), 2);
}

/* Delivers the exception to the request that was sent last. */
static void refuse(int framing, uint8_t function, uint8_t code)
{
    const uint8_t rtu[] = {UNIT, (uint8_t)(function | 0x80), code};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 3, UNIT, (uint8_t)(function | 0x80), code};

    if (framing == MBM_FRAMING_ASCII) {
        const uint8_t lrc = (uint8_t) - (rtu[0] + rtu[1] + rtu[2]);
        char text[20];

        (void)snprintf(text, sizeof text, ":%02X%02X%02X%02X\r\n", rtu[0], rtu[1], rtu[2], lrc);
        memory_port_bytes(&m, (const uint8_t *)text, strlen(text));
    } else if (framing == MBM_FRAMING_TCP) {
        memcpy(tcp, m.sent, 2);
        memory_port_bytes(&m, tcp, sizeof tcp);
    } else {
        memory_port_rtu(&m, rtu, sizeof rtu);
    }
}

/* Sends a request of the function until it ends, and answers each time with the exception
 * `code`. Returns how often it was sent. The time between two is at least `wait` ms. */
static unsigned refusals(int framing, uint8_t function, uint8_t code, uint32_t wait)
{
    unsigned count = 0;
    uint32_t refused = 0;

    IS(MBM_PENDING, function == 3 ? mbm_client_readHoldingRegisters(&client, &request, 0, 1)
                                  : mbm_client_writeSingleRegister(&client, &request, 0, 1));
    do {
        m.sent_count = 0;
        memory_port_send(&m, &client);
        if (count > 0)
            assert_in_range(m.now - refused, wait * MS, wait * MS + 10 * MS);
        count++;
        refuse(framing, function, code);
        (void)mbm_client_poll(&client);
        refused = m.now;
    } while (request.status == MBM_PENDING);
    IS(code, request.status);
    assert_int_equal(request.exception, code);
    return count;
}

FRAMING_TEST(a_busy_device_gets_its_request_again_after_the_wait)
{
    enum { WAIT = 250 };

    begin(framing);
    assert_int_equal(refusals(framing, 3, SERVER_DEVICE_BUSY, 0), 1);
    OK(mbm_client_setRetries(&client, 9));
    assert_int_equal(refusals(framing, 3, SERVER_DEVICE_BUSY, 0), 1);
    OK(mbm_client_setBusyRetries(&client, 3, WAIT));
    assert_int_equal(refusals(framing, 3, SERVER_DEVICE_BUSY, WAIT), 4);
    assert_int_equal(refusals(framing, 6, SERVER_DEVICE_BUSY, WAIT), 4);
    assert_int_equal(refusals(framing, 3, ACKNOWLEDGE, WAIT), 4);
    /* The device carries the write out, so it must not be sent again. */
    assert_int_equal(refusals(framing, 6, ACKNOWLEDGE, WAIT), 1);
    assert_int_equal(refusals(framing, 3, MBM_SERVER_DEVICE_FAILURE, WAIT), 1);
    /* The setting stays if that of other repetitions changes. */
    OK(mbm_client_setRetries(&client, 0));
    assert_int_equal(refusals(framing, 3, SERVER_DEVICE_BUSY, WAIT), 4);
    OK(mbm_client_setBusyRetries(&client, 0, WAIT));
    assert_int_equal(refusals(framing, 3, SERVER_DEVICE_BUSY, WAIT), 1);
}

FRAMING_TEST(refusals_and_lost_replies_are_counted_apart)
{
    begin(framing);
    OK(mbm_client_setUnits(&client, units, 2));
    OK(mbm_client_setRetries(&client, 1));
    OK(mbm_client_setBusyRetries(&client, 2, 20));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    for (unsigned k = 0; k < 4; k++) {
        m.sent_count = 0;
        memory_port_send(&m, &client);
        if (k < 2)
            refuse(framing, 3, SERVER_DEVICE_BUSY);
    }
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, STEPS));
    assert_int_equal(units[1].retries, 3);
    assert_int_equal(units[1].requests, 1);
}

static asker a;
static held_clock by_clock;
static tcp_peer *peer;

static void begin_peer(void)
{
    peer = tcp_peer_new();
    held_clock_start(&by_clock);
    tcp_peer_clock(peer, &by_clock);
    asker_begin_tcp_by(&a, tcp_peer_start(peer, 0), &by_clock);
    OK(mbm_client_setInFlight(&a.client, MBM_CLIENT_DEPTH));
    OK(mbm_client_setResponseTimeout(&a.client, 150));
}

static void end_peer(void)
{
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(peer);
}

TEST_WITH(requests_in_flight_at_once_have_their_own_timeouts_and_retries, begin_peer, end_peer)
{
    static mbm_clientRequest requests[8];
    static uint16_t replies[8][2];

    OK(mbm_client_setRetries(&a.client, 0));
    OK(mbm_client_setBusyRetries(&a.client, 1, 5));
    for (unsigned i = 0; i < 8; i++) {
        requests[i] = asker_request(7, replies[i], sizeof replies[i], NULL);
        tcp_peer_fault(peer, i + 1, FAULT_DELAY, 400);
    }
    /* Requests 0 to 3 have the client's timeout, which is too short. The reply to request 3
     * comes when it is sent the second time. */
    requests[3].retryLimit = 1;
    requests[4].timeoutMs = requests[5].timeoutMs = requests[6].timeoutMs = 2000;
    requests[7].timeoutMs = 20;
    tcp_peer_fault(peer, 6, FAULT_EXCEPTION, SERVER_DEVICE_BUSY);
    tcp_peer_fault(peer, 7, FAULT_EXCEPTION, ACKNOWLEDGE);
    for (unsigned i = 0; i < 8; i++)
        IS(MBM_PENDING,
           mbm_client_readHoldingRegisters(&a.client, &requests[i], (uint16_t)(10 * i), 2));
    asker_wait_all(&a);
    for (unsigned i = 0; i < 8; i++)
        IS(i < 3 || i == 7 ? MBM_RESPONSE_TIMED_OUT : MBM_OK, requests[i].status);
    for (unsigned i = 3; i < 7; i++)
        assert_int_equal(replies[i][1], tcp_peer_word(10 * i + 1));
    assert_int_equal(tcp_peer_count(peer).requests, 8 + 3);
}
