/* Each function of the client and of its link is held to its comment in mbm.h: results, limits,
 * defaults, NULL. */
#include "every_call.h"
#include "exchanges.h"
#include "refused.h"
#include "crc.h"
#include "hooked_port.h"
#include "test.h"

static hooked_port wire;
static mbm_port port;
static mbm_client c, never;
static mbm_clientRequest r;
static mbm_identification identification;
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint8_t reply[256];
static const uint16_t data[128];

static void setup(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&c, 0, sizeof c);
    memset(&never, 0, sizeof never);
    memset(&identification, 0, sizeof identification);
    wire.step = 100;
    port = hooked_port_of(&wire);
    r = (mbm_clientRequest){.unit = 17, .data = data, .reply = reply, .replyBytes = sizeof reply};
    OK(mbm_client_beginRtu(&c, &port, frame, sizeof frame));
}

fixture each_test = {setup, NULL};

/* --- requests --- */

/* What 17 writes. */
enum { WRITE_OF_BOTH = 0x117 };

/* Every function with an address, a quantity or a list of both. `most` is the largest quantity, 0
 * if the function has none. */
static const struct {
    uint16_t function, most;
    uint8_t is_broadcast;
} calls[] = {{0x01, 2000, 0}, {0x02, 2000, 0}, {0x03, 125, 0}, {0x04, 125, 0},
             {0x05, 0, 1},    {0x06, 0, 1},    {0x07, 0, 0},   {0x0B, 0, 0},
             {0x0C, 0, 0},    {0x0F, 1968, 1}, {0x10, 123, 1}, {0x11, 0, 0},
             {0x16, 0, 1},    {0x17, 125, 0},  {0x18, 0, 0},   {WRITE_OF_BOTH, 121, 0}};

static uint8_t call(unsigned function, mbm_client *client, mbm_clientRequest *request,
                    uint16_t address, uint16_t quantity)
{
    exchange e = {.function = (uint8_t)function, .with = {address, quantity, 0, 1}};

    switch (function) {
    case 0x07: return mbm_client_readExceptionStatus(client, request);
    case 0x0B: return mbm_client_getCommEventCounter(client, request);
    case 0x0C: return mbm_client_getCommEventLog(client, request);
    case 0x11: return mbm_client_reportServerId(client, request);
    case 0x18: return mbm_client_readFifoQueue(client, request, address);
    case WRITE_OF_BOTH: e = (exchange){.function = 0x17, .with = {0, 1, address, quantity}}; break;
    default: break;
    }
#define CLIENT(name, ...) mbm_client_##name(client, request, __VA_ARGS__)
    EXCHANGE_CALL(&e, CLIENT);
}

TEST(a_quantity_and_an_address_have_the_limits_of_the_header)
{
    for (unsigned i = 0; i < COUNT(calls); i++) {
        uint16_t most = calls[i].most;
        const struct {
            uint16_t address, quantity;
            uint8_t status;
        } rows[] = {{0, 1, MBM_PENDING},
                    {65535, 1, MBM_PENDING},
                    {0, most, MBM_PENDING},
                    {(uint16_t)(65536 - most), most, MBM_PENDING},
                    {0, 0, MBM_ILLEGAL_DATA_VALUE},
                    {0, (uint16_t)(most + 1), MBM_ILLEGAL_DATA_VALUE},
                    {0, 65535, MBM_ILLEGAL_DATA_VALUE},
                    {65535, 2, MBM_ILLEGAL_DATA_ADDRESS},
                    {(uint16_t)(65537 - most), most, MBM_ILLEGAL_DATA_ADDRESS}};

        for (unsigned nth = 0; nth < (most != 0 ? COUNT(rows) : 2u); nth++) {
            setup();
            r.exception = 7;
            IS(rows[nth].status,
               call(calls[i].function, &c, &r, rows[nth].address, rows[nth].quantity));
            IS(rows[nth].status, r.status);
            assert_int_equal(r.exception, 0);
            assert_int_equal(mbm_client_pending(&c), rows[nth].status == MBM_PENDING);
        }
    }
}

TEST(a_request_is_refused_before_it_is_queued)
{
    for (unsigned i = 0; i < COUNT(calls); i++) {
        const uint16_t function = calls[i].function;

        setup();
        IS(MBM_INVALID_ARGUMENT, call(function, NULL, &r, 0, 1));
        IS(MBM_INVALID_ARGUMENT, call(function, &c, NULL, 0, 1));
        REFUSED(MBM_NOT_INITIALISED, never, call(function, &never, &r, 0, 1));
        r.unit = 0;
        IS(calls[i].is_broadcast ? MBM_PENDING : MBM_BROADCAST_NOT_ALLOWED,
           call(function, &c, &r, 0, 1));
        (void)mbm_client_cancel(&c, &r);
        r.unit = 17;
        IS(MBM_PENDING, call(function, &c, &r, 0, 1));
        /* It is pending, and may not be used again. */
        REFUSED(MBM_BUSY, r, call(function, &c, &r, 0, 1));
        OK(mbm_client_cancel(&c, &r));
        IS(MBM_CANCELLED, r.status);
        REFUSED(MBM_NOT_PENDING, r, mbm_client_cancel(&c, &r));
        /* No repetitions without their code. */
        r.retryLimit = 1;
        IS(MBM_INVALID_ARGUMENT, call(function, &c, &r, 0, 1));
        assert_int_equal(mbm_client_pending(&c), 0);
    }
}

TEST(a_queue_holds_sixteen_requests)
{
    static mbm_clientRequest many[MBM_CLIENT_DEPTH + 1];

    memset(many, 0, sizeof many);
    OK(mbm_client_beginTcp(&c, &port, frame, 260, outgoing, sizeof outgoing));
    for (unsigned i = 0; i <= MBM_CLIENT_DEPTH; i++) {
        many[i].unit = 1;
        many[i].transaction = (uint16_t)(i == 1 ? 100 : 100 + i);
        if (i == 1) {
            many[i].transaction = 100;
            IS(MBM_DUPLICATE_TRANSACTION, mbm_client_readHoldingRegisters(&c, &many[i], 0, 1));
            many[i].transaction = 0;
        }
        IS(i < MBM_CLIENT_DEPTH ? MBM_PENDING : MBM_QUEUE_FULL,
           mbm_client_readHoldingRegisters(&c, &many[i], 0, 1));
    }
    assert_int_equal(mbm_client_pending(&c), MBM_CLIENT_DEPTH);
    OK(mbm_client_beginTcp(&c, &port, frame, 260, outgoing, sizeof outgoing));
    assert_int_equal(mbm_client_pending(&c), 0);
    for (unsigned i = 0; i < MBM_CLIENT_DEPTH; i++)
        IS(MBM_CANCELLED, many[i].status);
}

/* Makes a request and gives it up. */
#define ANSWERS(status, request, ...)                                                              \
    do {                                                                                           \
        IS(status, mbm_client_##request(&c, &r, __VA_ARGS__));                                     \
        (void)mbm_client_cancel(&c, &r);                                                           \
    } while (0)

TEST(functions_with_bodies_check_them)
{
    static const uint8_t bytes[256];
    static const mbm_rule silence = {.kind = MBM_RULE_SILENCE};
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;

    r.data = bytes;
#define WITHIN(...) ANSWERS(MBM_PENDING, __VA_ARGS__)
#define VALUE(...) ANSWERS(MBM_ILLEGAL_DATA_VALUE, __VA_ARGS__)
    ANSWERS(MBM_ILLEGAL_FUNCTION, custom, 0, 1, &silence);
    WITHIN(custom, 1, 1, &silence);
    WITHIN(custom, 127, 0, &silence);
    ANSWERS(MBM_ILLEGAL_FUNCTION, custom, 128, 1, &silence);
    WITHIN(custom, 0x41, 252, &silence);
    VALUE(custom, 0x41, 253, &silence);
    ANSWERS(MBM_INVALID_ARGUMENT, custom, 0x41, 1, NULL);
    IS(MBM_NOT_INITIALISED, mbm_client_custom(&never, &r, 0x41, 1, &silence));
    WITHIN(diagnostics, 0, 1);
    WITHIN(diagnostics, 0, 125);
    VALUE(diagnostics, 0, 0);
    VALUE(diagnostics, 0, 126);
    WITHIN(diagnostics, 10, 1);
    VALUE(diagnostics, 10, 2);
    for (uint8_t code = 0; code < 6; code++)
        ANSWERS(code >= MBM_DEVICE_ID_BASIC && code <= MBM_DEVICE_ID_INDIVIDUAL
                    ? MBM_PENDING
                    : MBM_ILLEGAL_DATA_VALUE,
                readDeviceIdentification, code, 255);
    WITHIN(readFileRecord, 1, 0, 1);
    WITHIN(readFileRecord, 65535, 9879, 121);
    ANSWERS(MBM_ILLEGAL_DATA_ADDRESS, readFileRecord, 0, 0, 1);
    ANSWERS(MBM_ILLEGAL_DATA_ADDRESS, readFileRecord, 1, 10000, 1);
    VALUE(readFileRecord, 1, 0, 0);
    VALUE(readFileRecord, 1, 0, 122);
    WITHIN(writeFileRecord, 1, 0, 122);
    VALUE(writeFileRecord, 1, 0, 123);
    VALUE(writeFileRecord, 1, 0, 0);
    ANSWERS(MBM_ILLEGAL_DATA_ADDRESS, writeFileRecord, 0, 0, 1);
    WITHIN(readFileRecords, 7);
    WITHIN(readFileRecords, 245);
    VALUE(readFileRecords, 0);
    VALUE(readFileRecords, 8);
    VALUE(readFileRecords, 252);
    VALUE(readFileRecords, 256 + 7);
    WITHIN(writeFileRecords, 9);
    WITHIN(writeFileRecords, 251);
    VALUE(writeFileRecords, 8);
    VALUE(writeFileRecords, 252);
    VALUE(writeFileRecords, 256 + 9);
    WITHIN(encapsulatedInterfaceTransport, MBM_MEI_CANOPEN, 0);
    WITHIN(encapsulatedInterfaceTransport, 255, 251);
    VALUE(encapsulatedInterfaceTransport, MBM_MEI_CANOPEN, 252);
    VALUE(encapsulatedInterfaceTransport, MBM_MEI_CANOPEN, 256);
    r.data = NULL;
    ANSWERS(MBM_INVALID_ARGUMENT, readFileRecords, 7);
    ANSWERS(MBM_INVALID_ARGUMENT, writeFileRecords, 9);
    ANSWERS(MBM_INVALID_ARGUMENT, encapsulatedInterfaceTransport, MBM_MEI_CANOPEN, 1);
    WITHIN(encapsulatedInterfaceTransport, MBM_MEI_CANOPEN, 0);
    r.data = bytes;
    r.unit = 0;
    ANSWERS(MBM_BROADCAST_NOT_ALLOWED, readFileRecords, 7);
    WITHIN(writeFileRecords, 9);
    ANSWERS(MBM_BROADCAST_NOT_ALLOWED, encapsulatedInterfaceTransport, MBM_MEI_CANOPEN, 1);
    r.unit = 17;
    ANSWERS(MBM_ILLEGAL_FUNCTION, forward, 0, bytes, 1);
    ANSWERS(MBM_ILLEGAL_FUNCTION, forward, 128, bytes, 1);
    ANSWERS(MBM_INVALID_ARGUMENT, forward, 0x41, NULL, 1);
    WITHIN(forward, 0x41, NULL, 0);
    WITHIN(forward, 0x41, bytes, 252);
    VALUE(forward, 0x41, bytes, 253);
    IS(MBM_INVALID_ARGUMENT, mbm_client_forward(NULL, &r, 0x41, bytes, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(NULL, pdu, sizeof pdu, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&r, NULL, sizeof pdu, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&r, pdu, sizeof pdu, NULL));
    assert_int_equal(mbm_client_wireTransaction(NULL), 0);
    assert_int_equal(mbm_client_wireTransaction(&r), 0);
    identification.request = r;
    IS(MBM_INVALID_ARGUMENT, mbm_identification_read(NULL, &c, 1, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_identification_read(&identification, NULL, 1, 0));
#define IDENTIFIES(status, client, code)                                                           \
    REFUSED(status, identification, mbm_identification_read(&identification, client, code, 0))
    IDENTIFIES(MBM_ILLEGAL_DATA_VALUE, &c, 5);
    IDENTIFIES(MBM_ILLEGAL_DATA_VALUE, &c, 0);
    IDENTIFIES(MBM_NOT_INITIALISED, &never, 1);
    identification.request.reply = NULL;
    IDENTIFIES(MBM_INVALID_ARGUMENT, &c, 1);
}

/* --- begin --- */

TEST(a_begin_is_refused_without_a_change)
{
    static const uint16_t least[] = {8, 17, 9, 8};

    for (unsigned i = 0; i < COUNT(least); i++) {
#define BEGIN(client, port, frame, bytes) client_begin(client, i, port, frame, bytes, outgoing, 12)
        setup();
        OK(BEGIN(&c, &port, frame, least[i]));
        IS(MBM_INVALID_ARGUMENT, BEGIN(NULL, &port, frame, 300));
        INVALID(c, BEGIN(&c, NULL, frame, 300));
        INVALID(c, BEGIN(&c, &port, NULL, 300));
        INVALID(c, BEGIN(&c, &port, frame, least[i] - 1));
        for (int hook = HOOK_READ; hook <= HOOK_MICROS; hook++) {
            const mbm_port lacking = hooked_port_without(&wire, hook);

            INVALID(c, BEGIN(&c, &lacking, frame, 300));
        }
        OK(mbm_client_suspend(&c, NULL));
        REFUSED(MBM_BUSY, c, BEGIN(&c, &port, frame, 300));
        IS(MBM_BUSY, mbm_client_poll(&c));
        IS(MBM_BUSY, mbm_client_reconnect(&c, NULL));
        IS(MBM_BUSY, mbm_client_suspend(&c, NULL));
        OK(mbm_client_resume(&c, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_client_resume(&c, NULL));
    }
    INVALID(c, mbm_client_beginTcp(&c, &port, frame, 9, NULL, 12));
    INVALID(c, mbm_client_beginTcp(&c, &port, frame, 9, outgoing, 11));
}

/* --- settings --- */

/* The limits of settings that a client and a link have. */
#define RANGES_OF_TRIES(object, type)                                                              \
    do {                                                                                           \
        INVALID(object, mbm_##type##_setBackoff(&(object), 4, 1, 1));                              \
        INVALID(object, mbm_##type##_setBackoff(&(object), 1, 1000001, 1));                        \
        INVALID(object, mbm_##type##_setBackoff(&(object), 1, 1, 1000001));                        \
        OK(mbm_##type##_setJitter(&(object), 100, random_number, NULL));                           \
        INVALID(object, mbm_##type##_setJitter(&(object), 101, random_number, NULL));              \
        INVALID(object, mbm_##type##_setJitter(&(object), 1, NULL, NULL));                         \
    } while (0)

static uint32_t random_number(void *context)
{
    return 4;
}

/* The silence that is left before a request, if a byte arrives just now. */
static uint32_t gap(void)
{
    wire.step = 0;
    hooked_port_arrive(&wire, "x", 1);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&c, &r, 0, 1));
    IS(MBM_PENDING, mbm_client_poll(&c));
    uint32_t delay = mbm_client_pollDelay(&c);
    assert_int_equal(wire.length, 0);
    OK(mbm_client_cancel(&c, &r));
    return delay;
}

TEST(the_gap_is_that_of_the_header)
{
    static const uint32_t rates[][2] = {{19200, 2006}, {9600, 4011}, {115200, 1750}, {0, 4000}};

    assert_int_equal(gap(), 4000);
    for (unsigned i = 0; i < COUNT(rates); i++) {
        OK(mbm_client_setBaudRate(&c, rates[i][0]));
        assert_int_equal(gap(), rates[i][1]);
    }
    OK(mbm_client_setGap(&c, 5));
    assert_int_equal(gap(), 5);
    OK(mbm_client_beginRtu(&c, &port, frame, sizeof frame));
    assert_int_equal(gap(), 4000);
}

/* Polls until the request has ended, and lets the time of pollDelay pass. */
static uint8_t run(void)
{
    wire.step = 0;
    while (mbm_client_poll(&c) == MBM_PENDING)
        wire.now += mbm_client_pollDelay(&c) + 1;
    return r.status;
}

/* How many times a request is sent that nothing answers, and how long all of it takes. */
static unsigned frames(uint32_t *us)
{
    uint32_t begin = wire.now;

    wire.called[HOOK_WRITE] = 0;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&c, &r, 0, 1));
    IS(MBM_RESPONSE_TIMED_OUT, run());
    *us = wire.now - begin;
    return wire.called[HOOK_WRITE];
}

TEST(a_begin_restores_the_defaults_of_the_header)
{
    uint32_t us;

    for (unsigned again = 0; again < 2; again++) {
        assert_int_equal(frames(&us), 1); /* no retries */
        assert_in_range(us, 2000000, 2004100);
        assert_int_equal(frames(&us), 1);
        assert_in_range(us, 2100000, 2104100); /* after the quiet time */
        OK(mbm_client_setQuietTime(&c, 0));
        r.unit = 0;
        us = wire.now;
        IS(MBM_PENDING, mbm_client_writeSingleRegister(&c, &r, 0, 1));
        OK(run());
        assert_in_range(wire.now - us, 100000, 104100); /* gap and turnaround delay */
        r.unit = 17;
        OK(mbm_client_setResponseTimeout(&c, 1));
        OK(mbm_client_setRetries(&c, 255));
        assert_int_equal(frames(&us), 256);
        OK(mbm_client_beginRtu(&c, &port, frame, sizeof frame));
    }
}

TEST(settings_have_the_ranges_of_the_header)
{
    static mbm_clientUnit units[2];

    RANGE(c, 1000000, mbm_client_setResponseTimeout);
    RANGE(c, 65535, mbm_client_setTurnaroundDelay);
    RANGE(c, 65535, mbm_client_setQuietTime);
    RANGE(c, 65535, mbm_client_setMessageWait);
    INVALID(c, mbm_client_setAccept(&c, 4));
    OK(mbm_client_setLenient(&c, 0));
    OK(mbm_client_setBusyRetries(&c, 255, 65535));
    INVALID(c, mbm_client_setBusyRetries(&c, 1, 65536));
    OK(mbm_client_setBackoff(&c, MBM_BACKOFF_EXPONENTIAL, 1000000, 1000000));
    RANGES_OF_TRIES(c, client);
    OK(mbm_client_setJitter(&c, 0, NULL, NULL));
    OK(mbm_client_setGap(&c, 0xFFFFFFFF));
    OK(mbm_client_setBaudRate(&c, 19200));
    OK(mbm_client_setRetries(&c, 255));
    OK(mbm_client_setEchoDiscard(&c, 1));
    OK(mbm_client_setPostFlushHold(&c, 255));
    OK(mbm_client_setUnits(&c, units, 2));
    OK(mbm_client_setUnits(&c, NULL, 2));
    OK(mbm_client_setUnits(&c, NULL, 0));
    OK(mbm_client_setCounters(&c, NULL));
    for (unsigned i = 0; i < 256; i++)
        REFUSED(i == 1 ? MBM_OK : MBM_INVALID_ARGUMENT, c, mbm_client_setInFlight(&c, (uint8_t)i));
    INVALID(c, mbm_client_setDelimiter(&c, '\n'));
    OK(mbm_client_beginTcp(&c, &port, frame, 260, outgoing, sizeof outgoing));
    RANGE(c, 16, mbm_client_setInFlight);
    INVALID(c, mbm_client_setInFlight(&c, 0));
    OK(mbm_client_beginAscii(&c, &port, frame, 513));
    for (unsigned i = 0; i < 256; i++) {
        int is_digit = (i >= '0' && i <= '9') || (i >= 'A' && i <= 'F') || (i >= 'a' && i <= 'f');

        IS(i == 0 || i > 127 || i == '\r' || i == ':' || is_digit ? MBM_INVALID_ARGUMENT : MBM_OK,
           mbm_client_setDelimiter(&c, (uint8_t)i));
    }
}

TEST(the_response_timeout_of_a_unit_can_be_read)
{
    static mbm_clientUnit units[2];

    memset(units, 0, sizeof units);
    units[0].unit = 5;
    units[0].timeoutMs = 70;
    units[1].unit = 6;
    assert_int_equal(mbm_client_getResponseTimeout(&c, 5), 2000);
    OK(mbm_client_setResponseTimeout(&c, 300));
    OK(mbm_client_setUnits(&c, units, 2));
    assert_int_equal(mbm_client_getResponseTimeout(&c, 5), 70);
    assert_int_equal(mbm_client_getResponseTimeout(&c, 6), 300);
    assert_int_equal(mbm_client_getResponseTimeout(&c, 7), 300);
    units[0].timeoutMs = 2000000;
    assert_int_equal(mbm_client_getResponseTimeout(&c, 5), 1000000);
    OK(mbm_client_setUnits(&c, NULL, 0));
    assert_int_equal(mbm_client_getResponseTimeout(&c, 5), 300);
    assert_int_equal(mbm_client_getResponseTimeout(&never, 5), 0);
    assert_int_equal(mbm_client_getResponseTimeout(NULL, 5), 0);
}

TEST(a_client_that_was_never_begun_has_no_settings)
{
    mbm_client *const clients[] = {NULL, &never};

    for (unsigned i = 0; i < COUNT(clients); i++) {
        mbm_client *n = clients[i];
        uint8_t status = n == NULL ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        every_client_setting_returns(status, n);
        every_client_request_returns(status, n, &r);
        IS(status, mbm_client_setDelimiter(n, '\n'));
        IS(status, mbm_client_poll(n));
        IS(status, mbm_client_cancel(n, &r));
        IS(status, mbm_client_reconnect(n, NULL));
        IS(status, mbm_client_suspend(n, NULL));
        IS(status, mbm_client_resume(n, NULL));
        assert_int_equal(mbm_client_pending(n), 0);
        assert_int_equal(mbm_client_pollDelay(n), 0xFFFFFFFF);
    }
    assert_int_equal(mbm_client_isConnected(&c), 1);
    assert_int_equal(mbm_client_pollDelay(&c), 0xFFFFFFFF);
    OK(mbm_client_poll(&c));
}

/* --- links --- */

static uint8_t connect_at_once(void *context)
{
    return MBM_OK;
}

TEST(a_link_has_the_limits_of_the_header)
{
    static mbm_link link, other, none;
    mbm_linkHooks hooks = {.connect = connect_at_once};
    mbm_link *const links[] = {NULL, &none};

    memset(&link, 0, sizeof link);
    memset(&other, 0, sizeof other);
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(NULL, &c, &hooks));
    INVALID(link, mbm_link_begin(&link, NULL, &hooks));
    INVALID(link, mbm_link_begin(&link, &c, NULL));
    REFUSED(MBM_NOT_INITIALISED, link, mbm_link_begin(&link, &never, &hooks));
    hooks.connect = NULL;
    INVALID(link, mbm_link_begin(&link, &c, &hooks));
    hooks.connect = connect_at_once;
    OK(mbm_link_begin(&link, &c, &hooks));
    REFUSED(MBM_BUSY, other, mbm_link_begin(&other, &c, &hooks));
    assert_int_equal(mbm_link_state(&link), 0);
    OK(mbm_link_setConnectTimeout(&link, 0));
    RANGE(link, 1000000, mbm_link_setConnectTimeout);
    OK(mbm_link_setDelayAfterConnect(&link, 0));
    RANGE(link, 65535, mbm_link_setDelayAfterConnect);
    INVALID(link, mbm_link_setClose(&link, 4));
    OK(mbm_link_setReplaceAfter(&link, 0));
    RANGE(link, 100, mbm_link_setReplaceAfter);
    OK(mbm_link_setBackoff(&link, MBM_BACKOFF_NONE, 1000000, 1000000));
    RANGES_OF_TRIES(link, link);
    OK(mbm_link_setRequestsWait(&link, 1));
    OK(mbm_link_setCallback(&link, NULL, NULL));
    OK(mbm_link_setCounters(&link, NULL));
    (void)mbm_client_poll(&c);
    assert_int_equal(mbm_link_state(&link), MBM_LINK_IS_UP);
    OK(mbm_link_reconnect(&link));
    OK(mbm_link_end(&link));
    for (unsigned i = 0; i < COUNT(links); i++) {
        mbm_link *n = links[i];
        uint8_t status = n == NULL ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        IS(status, mbm_link_setConnectTimeout(n, 1));
        IS(status, mbm_link_setBackoff(n, 1, 1, 1));
        IS(status, mbm_link_setJitter(n, 0, NULL, NULL));
        IS(status, mbm_link_setRequestsWait(n, 1));
        IS(status, mbm_link_setCallback(n, NULL, NULL));
        IS(status, mbm_link_setCounters(n, NULL));
        IS(status, mbm_link_reconnect(n));
        IS(status, mbm_link_end(n));
        assert_int_equal(mbm_link_state(n), 0);
    }
}
