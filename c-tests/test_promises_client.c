/* Each function of the client and of its link is held to its comment in mbm.h: results, limits,
 * defaults, NULL. */
#include "every_call.h"
#include "refused.h"
#include "crc.h"
#include "hooked_port.h"
#include "mbm.h"
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
    memset(&r, 0, sizeof r);
    memset(&identification, 0, sizeof identification);
    wire.step = 100;
    port = hooked_port_of(&wire);
    r.unit = 17;
    r.data = data;
    r.reply = reply;
    r.replyBytes = sizeof reply;
    OK(mbm_client_beginRtu(&c, &port, frame, sizeof frame));
}

fixture each_test = {setup, NULL};

/* --- requests --- */

/* A request of every function, with an address and a quantity where it has them. */
typedef uint8_t (*call)(mbm_client *client, mbm_clientRequest *request, uint16_t address,
                        uint16_t quantity);

#define CALL(name, ...)                                                                            \
    static uint8_t call_##name(mbm_client *client, mbm_clientRequest *request, uint16_t address,   \
                               uint16_t quantity)                                                  \
    {                                                                                              \
        return mbm_client_##name(client, request, __VA_ARGS__);                                    \
    }
#define CALL_OF_NOTHING(name)                                                                      \
    static uint8_t call_##name(mbm_client *client, mbm_clientRequest *request, uint16_t address,   \
                               uint16_t quantity)                                                  \
    {                                                                                              \
        return mbm_client_##name(client, request);                                                 \
    }

CALL(readCoils, address, quantity)
CALL(readDiscreteInputs, address, quantity)
CALL(readHoldingRegisters, address, quantity)
CALL(readInputRegisters, address, quantity)
CALL(writeSingleCoil, address, 1)
CALL(writeSingleRegister, address, quantity)
CALL_OF_NOTHING(readExceptionStatus)
CALL_OF_NOTHING(getCommEventCounter)
CALL_OF_NOTHING(getCommEventLog)
CALL_OF_NOTHING(reportServerId)
CALL(writeMultipleCoils, address, quantity)
CALL(writeMultipleRegisters, address, quantity)
CALL(maskWriteRegister, address, 1, 1)
CALL(readFifoQueue, address)

static uint8_t read_of_both(mbm_client *client, mbm_clientRequest *request, uint16_t address,
                            uint16_t quantity)
{
    return mbm_client_readWriteMultipleRegisters(client, request, address, quantity, 0, 1);
}

static uint8_t write_of_both(mbm_client *client, mbm_clientRequest *request, uint16_t address,
                             uint16_t quantity)
{
    return mbm_client_readWriteMultipleRegisters(client, request, 0, 1, address, quantity);
}

/* `most` is 0 if the function has no quantity. */
static const struct {
    call call;
    uint16_t most;
    uint8_t is_broadcast;
} calls[] = {
    {call_readCoils, 2000, 0},
    {call_readDiscreteInputs, 2000, 0},
    {call_readHoldingRegisters, 125, 0},
    {call_readInputRegisters, 125, 0},
    {call_writeSingleCoil, 0, 1},
    {call_writeSingleRegister, 0, 1},
    {call_readExceptionStatus, 0, 0},
    {call_getCommEventCounter, 0, 0},
    {call_getCommEventLog, 0, 0},
    {call_reportServerId, 0, 0},
    {call_writeMultipleCoils, 1968, 1},
    {call_writeMultipleRegisters, 123, 1},
    {call_maskWriteRegister, 0, 1},
    {call_readFifoQueue, 0, 0},
    {read_of_both, 125, 0},
    {write_of_both, 121, 0},
};

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
            IS(rows[nth].status, calls[i].call(&c, &r, rows[nth].address, rows[nth].quantity));
            IS(rows[nth].status, r.status);
            assert_int_equal(r.exception, 0);
            assert_int_equal(mbm_client_pending(&c), rows[nth].status == MBM_PENDING);
        }
    }
}

TEST(a_request_is_refused_before_it_is_queued)
{
    for (unsigned i = 0; i < COUNT(calls); i++) {
        setup();
        IS(MBM_INVALID_ARGUMENT, calls[i].call(NULL, &r, 0, 1));
        IS(MBM_INVALID_ARGUMENT, calls[i].call(&c, NULL, 0, 1));
        REFUSED(MBM_NOT_INITIALISED, never, calls[i].call(&never, &r, 0, 1));
        r.unit = 0;
        IS(calls[i].is_broadcast ? MBM_PENDING : MBM_BROADCAST_NOT_ALLOWED,
           calls[i].call(&c, &r, 0, 1));
        (void)mbm_client_cancel(&c, &r);
        r.unit = 17;
        IS(MBM_PENDING, calls[i].call(&c, &r, 0, 1));
        /* It is pending, and may not be used again. */
        REFUSED(MBM_BUSY, r, calls[i].call(&c, &r, 0, 1));
        OK(mbm_client_cancel(&c, &r));
        IS(MBM_CANCELLED, r.status);
        REFUSED(MBM_NOT_PENDING, r, mbm_client_cancel(&c, &r));
        /* No repetitions without their code. */
        r.retryLimit = 1;
        IS(MBM_INVALID_ARGUMENT, calls[i].call(&c, &r, 0, 1));
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

/* Asserts whether a request is within its limits, and gives it up. */
#define WITHIN(is, what)                                                                           \
    do {                                                                                           \
        assert_int_equal((what) == MBM_PENDING, is);                                               \
        (void)mbm_client_cancel(&c, &r);                                                           \
    } while (0)

TEST(functions_with_bodies_check_them)
{
    static const uint8_t bytes[256];
    static const mbm_rule silence = {.kind = MBM_RULE_SILENCE};
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;

#define ANSWERS(status, what)                                                                      \
    do {                                                                                           \
        IS(status, what);                                                                          \
        (void)mbm_client_cancel(&c, &r);                                                           \
    } while (0)
    r.data = bytes;
    WITHIN(0, mbm_client_custom(&c, &r, 0, 1, &silence));
    WITHIN(1, mbm_client_custom(&c, &r, 1, 1, &silence));
    WITHIN(1, mbm_client_custom(&c, &r, 127, 0, &silence));
    WITHIN(0, mbm_client_custom(&c, &r, 128, 1, &silence));
    WITHIN(1, mbm_client_custom(&c, &r, 0x41, 252, &silence));
    WITHIN(0, mbm_client_custom(&c, &r, 0x41, 253, &silence));
    WITHIN(0, mbm_client_custom(&c, &r, 0x41, 1, NULL));
    WITHIN(0, mbm_client_custom(&never, &r, 0x41, 1, &silence));
    WITHIN(1, mbm_client_diagnostics(&c, &r, 0, 1));
    WITHIN(1, mbm_client_diagnostics(&c, &r, 0, 125));
    WITHIN(0, mbm_client_diagnostics(&c, &r, 0, 0));
    WITHIN(0, mbm_client_diagnostics(&c, &r, 0, 126));
    WITHIN(1, mbm_client_diagnostics(&c, &r, 10, 1));
    WITHIN(0, mbm_client_diagnostics(&c, &r, 10, 2));
    for (uint8_t code = 0; code < 6; code++)
        WITHIN(code >= MBM_DEVICE_ID_BASIC && code <= MBM_DEVICE_ID_INDIVIDUAL,
               mbm_client_readDeviceIdentification(&c, &r, code, 255));
    WITHIN(1, mbm_client_readFileRecord(&c, &r, 1, 0, 1));
    WITHIN(1, mbm_client_readFileRecord(&c, &r, 65535, 9879, 121));
    WITHIN(0, mbm_client_readFileRecord(&c, &r, 0, 0, 1));
    WITHIN(0, mbm_client_readFileRecord(&c, &r, 1, 10000, 1));
    WITHIN(0, mbm_client_readFileRecord(&c, &r, 1, 0, 0));
    WITHIN(0, mbm_client_readFileRecord(&c, &r, 1, 0, 122));
    WITHIN(1, mbm_client_writeFileRecord(&c, &r, 1, 0, 122));
    WITHIN(0, mbm_client_writeFileRecord(&c, &r, 1, 0, 123));
    WITHIN(0, mbm_client_writeFileRecord(&c, &r, 1, 0, 0));
    WITHIN(0, mbm_client_writeFileRecord(&c, &r, 0, 0, 1));
    WITHIN(1, mbm_client_readFileRecords(&c, &r, 7));
    WITHIN(1, mbm_client_readFileRecords(&c, &r, 245));
    WITHIN(0, mbm_client_readFileRecords(&c, &r, 0));
    WITHIN(0, mbm_client_readFileRecords(&c, &r, 8));
    WITHIN(0, mbm_client_readFileRecords(&c, &r, 252));
    WITHIN(0, mbm_client_readFileRecords(&c, &r, 256 + 7));
    WITHIN(1, mbm_client_writeFileRecords(&c, &r, 9));
    WITHIN(1, mbm_client_writeFileRecords(&c, &r, 251));
    WITHIN(0, mbm_client_writeFileRecords(&c, &r, 8));
    WITHIN(0, mbm_client_writeFileRecords(&c, &r, 252));
    WITHIN(0, mbm_client_writeFileRecords(&c, &r, 256 + 9));
    WITHIN(1, mbm_client_encapsulatedInterfaceTransport(&c, &r, MBM_MEI_CANOPEN, 0));
    WITHIN(1, mbm_client_encapsulatedInterfaceTransport(&c, &r, 255, 251));
    WITHIN(0, mbm_client_encapsulatedInterfaceTransport(&c, &r, MBM_MEI_CANOPEN, 252));
    WITHIN(0, mbm_client_encapsulatedInterfaceTransport(&c, &r, MBM_MEI_CANOPEN, 256));
    r.data = NULL;
    ANSWERS(MBM_INVALID_ARGUMENT, mbm_client_readFileRecords(&c, &r, 7));
    ANSWERS(MBM_INVALID_ARGUMENT, mbm_client_writeFileRecords(&c, &r, 9));
    ANSWERS(MBM_INVALID_ARGUMENT,
            mbm_client_encapsulatedInterfaceTransport(&c, &r, MBM_MEI_CANOPEN, 1));
    ANSWERS(MBM_PENDING, mbm_client_encapsulatedInterfaceTransport(&c, &r, MBM_MEI_CANOPEN, 0));
    r.data = bytes;
    r.unit = 0;
    ANSWERS(MBM_BROADCAST_NOT_ALLOWED, mbm_client_readFileRecords(&c, &r, 7));
    ANSWERS(MBM_PENDING, mbm_client_writeFileRecords(&c, &r, 9));
    ANSWERS(MBM_BROADCAST_NOT_ALLOWED,
            mbm_client_encapsulatedInterfaceTransport(&c, &r, MBM_MEI_CANOPEN, 1));
    r.unit = 17;
    ANSWERS(MBM_ILLEGAL_FUNCTION, mbm_client_forward(&c, &r, 0, bytes, 1));
    ANSWERS(MBM_ILLEGAL_FUNCTION, mbm_client_forward(&c, &r, 128, bytes, 1));
    ANSWERS(MBM_INVALID_ARGUMENT, mbm_client_forward(&c, &r, 0x41, NULL, 1));
    ANSWERS(MBM_PENDING, mbm_client_forward(&c, &r, 0x41, NULL, 0));
    ANSWERS(MBM_PENDING, mbm_client_forward(&c, &r, 0x41, bytes, 252));
    ANSWERS(MBM_ILLEGAL_DATA_VALUE, mbm_client_forward(&c, &r, 0x41, bytes, 253));
    ANSWERS(MBM_INVALID_ARGUMENT, mbm_client_forward(NULL, &r, 0x41, bytes, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(NULL, pdu, sizeof pdu, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&r, NULL, sizeof pdu, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&r, pdu, sizeof pdu, NULL));
    assert_int_equal(mbm_client_wireTransaction(NULL), 0);
    assert_int_equal(mbm_client_wireTransaction(&r), 0);
    identification.request = r;
    IS(MBM_INVALID_ARGUMENT, mbm_identification_read(NULL, &c, 1, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_identification_read(&identification, NULL, 1, 0));
    REFUSED(MBM_ILLEGAL_DATA_VALUE, identification,
            mbm_identification_read(&identification, &c, 5, 0));
    REFUSED(MBM_ILLEGAL_DATA_VALUE, identification,
            mbm_identification_read(&identification, &c, 0, 0));
    REFUSED(MBM_NOT_INITIALISED, identification,
            mbm_identification_read(&identification, &never, 1, 0));
    identification.request.reply = NULL;
    REFUSED(MBM_INVALID_ARGUMENT, identification,
            mbm_identification_read(&identification, &c, 1, 0));
}

/* --- begin --- */

static uint8_t begin(unsigned framing, mbm_client *client, const mbm_port *on, uint8_t *bytes,
                     uint16_t size)
{
    return client_begin(client, framing, on, bytes, size, outgoing, 12);
}

TEST(a_begin_is_refused_without_a_change)
{
    static const uint16_t least[] = {8, 17, 9, 8};
    mbm_port lacking;

    for (unsigned i = 0; i < COUNT(least); i++) {
        setup();
        OK(begin(i, &c, &port, frame, least[i]));
        IS(MBM_INVALID_ARGUMENT, begin(i, NULL, &port, frame, 300));
        REFUSED(MBM_INVALID_ARGUMENT, c, begin(i, &c, NULL, frame, 300));
        REFUSED(MBM_INVALID_ARGUMENT, c, begin(i, &c, &port, NULL, 300));
        REFUSED(MBM_INVALID_ARGUMENT, c, begin(i, &c, &port, frame, least[i] - 1));
        lacking = port;
        lacking.read = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, c, begin(i, &c, &lacking, frame, 300));
        lacking = port;
        lacking.write = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, c, begin(i, &c, &lacking, frame, 300));
        lacking = port;
        lacking.micros = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, c, begin(i, &c, &lacking, frame, 300));
        OK(mbm_client_suspend(&c, NULL));
        REFUSED(MBM_BUSY, c, begin(i, &c, &port, frame, 300));
        IS(MBM_BUSY, mbm_client_poll(&c));
        IS(MBM_BUSY, mbm_client_reconnect(&c, NULL));
        IS(MBM_BUSY, mbm_client_suspend(&c, NULL));
        OK(mbm_client_resume(&c, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_client_resume(&c, NULL));
    }
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_beginTcp(&c, &port, frame, 9, NULL, 12));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_beginTcp(&c, &port, frame, 9, outgoing, 11));
}

/* --- settings --- */

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
    assert_int_equal(gap(), 4000);
    OK(mbm_client_setBaudRate(&c, 19200));
    assert_int_equal(gap(), 2006);
    OK(mbm_client_setBaudRate(&c, 9600));
    assert_int_equal(gap(), 4011);
    OK(mbm_client_setBaudRate(&c, 115200));
    assert_int_equal(gap(), 1750);
    OK(mbm_client_setBaudRate(&c, 0));
    assert_int_equal(gap(), 4000);
    OK(mbm_client_setGap(&c, 5));
    assert_int_equal(gap(), 5);
    OK(mbm_client_beginRtu(&c, &port, frame, sizeof frame));
    assert_int_equal(gap(), 4000);
}

/* How many times a request is sent that nothing answers, and how long all of it takes. */
static unsigned frames(uint32_t *us)
{
    uint32_t begin = wire.now;

    wire.step = 0;
    wire.called[HOOK_WRITE] = 0;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&c, &r, 0, 1));
    while (mbm_client_poll(&c) == MBM_PENDING)
        wire.now += mbm_client_pollDelay(&c) + 1;
    IS(MBM_RESPONSE_TIMED_OUT, r.status);
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
        while (mbm_client_poll(&c) == MBM_PENDING)
            wire.now += mbm_client_pollDelay(&c) + 1;
        OK(r.status);
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

    OK(mbm_client_setResponseTimeout(&c, 1000000));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setResponseTimeout(&c, 1000001));
    OK(mbm_client_setTurnaroundDelay(&c, 65535));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setTurnaroundDelay(&c, 65536));
    OK(mbm_client_setQuietTime(&c, 65535));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setQuietTime(&c, 65536));
    OK(mbm_client_setMessageWait(&c, 65535));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setMessageWait(&c, 65536));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setAccept(&c, 4));
    OK(mbm_client_setLenient(&c, 0));
    OK(mbm_client_setBusyRetries(&c, 255, 65535));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setBusyRetries(&c, 1, 65536));
    OK(mbm_client_setBackoff(&c, MBM_BACKOFF_EXPONENTIAL, 1000000, 1000000));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setBackoff(&c, 4, 1, 1));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setBackoff(&c, 1, 1000001, 1));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setBackoff(&c, 1, 1, 1000001));
    OK(mbm_client_setJitter(&c, 100, random_number, NULL));
    OK(mbm_client_setJitter(&c, 0, NULL, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setJitter(&c, 101, random_number, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setJitter(&c, 1, NULL, NULL));
    OK(mbm_client_setGap(&c, 0xFFFFFFFF));
    OK(mbm_client_setBaudRate(&c, 19200));
    OK(mbm_client_setRetries(&c, 255));
    OK(mbm_client_setEchoDiscard(&c, 1));
    OK(mbm_client_setPostFlushHold(&c, 255));
    OK(mbm_client_setUnits(&c, units, 2));
    OK(mbm_client_setUnits(&c, NULL, 2));
    OK(mbm_client_setUnits(&c, NULL, 0));
    OK(mbm_client_setCounters(&c, NULL));
    for (unsigned i = 0; i < 256; i++) {
        if (i == 1)
            OK(mbm_client_setInFlight(&c, 1));
        else
            REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setInFlight(&c, (uint8_t)i));
    }
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setDelimiter(&c, '\n'));
    OK(mbm_client_beginTcp(&c, &port, frame, 260, outgoing, sizeof outgoing));
    OK(mbm_client_setInFlight(&c, 16));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setInFlight(&c, 17));
    REFUSED(MBM_INVALID_ARGUMENT, c, mbm_client_setInFlight(&c, 0));
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
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_begin(&link, NULL, &hooks));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_begin(&link, &c, NULL));
    REFUSED(MBM_NOT_INITIALISED, link, mbm_link_begin(&link, &never, &hooks));
    hooks.connect = NULL;
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_begin(&link, &c, &hooks));
    hooks.connect = connect_at_once;
    OK(mbm_link_begin(&link, &c, &hooks));
    REFUSED(MBM_BUSY, other, mbm_link_begin(&other, &c, &hooks));
    assert_int_equal(mbm_link_state(&link), 0);
    OK(mbm_link_setConnectTimeout(&link, 0));
    OK(mbm_link_setConnectTimeout(&link, 1000000));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setConnectTimeout(&link, 1000001));
    OK(mbm_link_setDelayAfterConnect(&link, 0));
    OK(mbm_link_setDelayAfterConnect(&link, 65535));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setDelayAfterConnect(&link, 65536));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setClose(&link, 4));
    OK(mbm_link_setReplaceAfter(&link, 0));
    OK(mbm_link_setReplaceAfter(&link, 100));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setReplaceAfter(&link, 101));
    OK(mbm_link_setBackoff(&link, MBM_BACKOFF_NONE, 1000000, 1000000));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setBackoff(&link, 4, 1, 1));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setBackoff(&link, 1, 1000001, 1));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setBackoff(&link, 1, 1, 1000001));
    OK(mbm_link_setJitter(&link, 100, random_number, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setJitter(&link, 101, random_number, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, link, mbm_link_setJitter(&link, 1, NULL, NULL));
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
