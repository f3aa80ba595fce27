/* The client against mbm's server, in each framing: every function that both have, and the
 * differences between the framings. */
#include "await.h"
#include "client.h"
#include "served.h"
#include "test.h"

#include <unistd.h>

static asker a;
static served s;

static void ends(uint8_t status, mbm_clientRequest *request, uint8_t queued)
{
    IS(MBM_PENDING, queued);
    assert_int_equal(asker_wait(&a, request), status);
}

static void assert_reply(const mbm_clientRequest *request, const void *bytes, size_t length)
{
    assert_int_equal(request->length, length);
    assert_memory_equal(request->reply, bytes, length);
}

static void begin(int framing)
{
    served_prepare(&s);
    switch (framing) {
    case MBM_FRAMING_RTU:
        served_on_line(&s, framing);
        asker_begin_rtu(&a, s.line.theirs);
        break;
    case MBM_FRAMING_ASCII:
        served_on_line(&s, framing);
        asker_begin_ascii(&a, s.line.theirs);
        break;
    case MBM_FRAMING_TCP:
        served_on_tcp(&s, framing);
        asker_begin_tcp(&a, (uint16_t)s.port);
        break;
    default:
        served_on_tcp(&s, framing);
        asker_begin_rtu_over_tcp(&a, (uint16_t)s.port);
        break;
    }
}

static void end(void)
{
    if (a.service[0])
        mbm_tcp_close(&a.tcp);
    else
        mbm_tty_detach(&a.tty);
    served_stop(&s);
}

static void reads_and_writes(void)
{
    static const uint16_t values[] = {0x1234, 0xFEDC, 7};
    static const uint8_t coils[] = {0xCD, 0x01};
    mbm_client *c = &a.client;
    uint16_t words[125];
    uint8_t bits[250];
    mbm_clientRequest r = asker_request(SERVED_UNIT, bits, sizeof bits, NULL);

    ends(MBM_OK, &r, mbm_client_readCoils(c, &r, SERVED_BASE, 2000));
    assert_reply(&r, s.bits, 250);
    ends(MBM_OK, &r, mbm_client_readDiscreteInputs(c, &r, SERVED_BASE, 2000));
    assert_reply(&r, s.input_bits, 250);
    r = asker_request(SERVED_UNIT, words, sizeof words, NULL);
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(c, &r, SERVED_BASE, 125));
    assert_reply(&r, s.words, 250);
    ends(MBM_OK, &r, mbm_client_readInputRegisters(c, &r, SERVED_BASE + 100, 125));
    assert_reply(&r, s.input_words + 100, 250);
    ends(MBM_OK, &r, mbm_client_writeSingleCoil(c, &r, SERVED_BASE, 1));
    ends(MBM_OK, &r, mbm_client_writeSingleRegister(c, &r, SERVED_BASE + 3, 0xA55A));
    assert_int_equal(s.bits[0] & 1, 1);
    assert_int_equal(s.words[3], 0xA55A);
    r.data = coils;
    ends(MBM_OK, &r, mbm_client_writeMultipleCoils(c, &r, SERVED_BASE + 8, 9));
    assert_int_equal(s.bits[1], 0xCD);
    assert_int_equal(s.bits[2] & 1, 1);
    r.data = values;
    ends(MBM_OK, &r, mbm_client_writeMultipleRegisters(c, &r, SERVED_BASE + 10, 3));
    assert_memory_equal(s.words + 10, values, 6);
    ends(MBM_OK, &r, mbm_client_maskWriteRegister(c, &r, SERVED_BASE + 3, 0xFF00, 0x0025));
    assert_int_equal(s.words[3], 0xA525);
    ends(MBM_OK, &r,
         mbm_client_readWriteMultipleRegisters(c, &r, SERVED_BASE + 9, 4, SERVED_BASE + 10, 2));
    assert_reply(&r, s.words + 9, 8);
    ends(MBM_ILLEGAL_DATA_ADDRESS, &r, mbm_client_readHoldingRegisters(c, &r, 0, 1));
}

static void files_and_queues(void)
{
    static const uint16_t values[] = {0x1234, 0x5678};
    static const uint8_t groups[] = {14, 6, 0, 4, 0, 7, 0, 2, 6, 0, 4, 0, 1, 0, 1};
    static const uint8_t records[] = {10, 5, 6, 0x12, 0x34, 0x56, 0x78, 3, 6, 0xBE, 0xEF};
    static const uint8_t written[] = {9, 6, 0, 4, 0, 1, 0, 1, 0xBE, 0xEF};
    mbm_client *c = &a.client;
    uint8_t bytes[250];
    uint16_t words[125];
    mbm_clientRequest r = asker_request(SERVED_UNIT, words, sizeof words, values);

    ends(MBM_OK, &r, mbm_client_writeFileRecord(c, &r, 4, 7, 2));
    assert_memory_equal(s.records + 7, values, 4);
    ends(MBM_OK, &r, mbm_client_readFileRecord(c, &r, 4, 0, 20));
    assert_reply(&r, s.records, 40);
    ends(MBM_OK, &r, mbm_client_readFifoQueue(c, &r, 0x04DE));
    assert_reply(&r, s.queue, 4);
    r = asker_request(SERVED_UNIT, bytes, sizeof bytes, NULL);
    /* Several groups at once, as on the wire. */
    ends(MBM_OK, &r, mbm_client_forward(c, &r, 0x15, written, sizeof written));
    ends(MBM_OK, &r, mbm_client_forward(c, &r, 0x14, groups, sizeof groups));
    assert_reply(&r, records, sizeof records);
    /* The same by name: the groups without their byte count, and the words without it. */
    r.data = written + 1;
    ends(MBM_OK, &r, mbm_client_writeFileRecords(c, &r, sizeof written - 1));
    assert_int_equal(r.length, 0);
    r.data = groups + 1;
    ends(MBM_OK, &r, mbm_client_readFileRecords(c, &r, sizeof groups - 1));
    assert_reply(&r, records + 1, sizeof records - 1);
    r.data = "\6\0\4\0\x13\0\2\6\0\4\0\1\0\1";
    ends(MBM_ILLEGAL_DATA_ADDRESS, &r, mbm_client_readFileRecords(c, &r, 14));
    ends(MBM_ILLEGAL_DATA_ADDRESS, &r, mbm_client_readFileRecord(c, &r, 4, 19, 2));
    ends(MBM_ILLEGAL_DATA_ADDRESS, &r, mbm_client_readFifoQueue(c, &r, 0x04DF));
}

static void identities_and_diagnostics(void)
{
    static const uint16_t query[] = {0xA537, 0x0102};
    static const uint8_t own[] = "own data";
    static const mbm_rule eight = {.kind = MBM_RULE_FIXED, .bytes = 9};
    mbm_client *c = &a.client;
    uint8_t bytes[250];
    uint16_t words[4];
    mbm_clientRequest r = asker_request(SERVED_UNIT, bytes, sizeof bytes, NULL);

    ends(MBM_OK, &r, mbm_client_readExceptionStatus(c, &r));
    assert_reply(&r, "\x6D", 1);
    ends(MBM_OK, &r, mbm_client_reportServerId(c, &r));
    assert_reply(&r, "mbm\xFFtest", 8);
    ends(MBM_OK, &r, mbm_client_getCommEventLog(c, &r));
    assert_true(r.length >= 6);
    ends(MBM_OK, &r, mbm_client_readDeviceIdentification(c, &r, 1, 0));
    assert_reply(&r, "\x83\x00\x00\x03\x00\x05Maker\x01\x05Thing\x02\x04V1.0", 24);
    ends(MBM_ILLEGAL_DATA_ADDRESS, &r, mbm_client_readDeviceIdentification(c, &r, 4, 0x44));
    ends(MBM_OK, &r, mbm_client_forward(c, &r, 0x2B, (const uint8_t *)"\x0E\x04\x80", 3));
    assert_reply(&r, "\x0E\x04\x83\x00\x00\x01\x80\x03own", 11);
    r.data = "\x04\x80";
    ends(MBM_OK, &r,
         mbm_client_encapsulatedInterfaceTransport(c, &r, MBM_MEI_READ_DEVICE_IDENTIFICATION, 2));
    assert_reply(&r, "\x04\x83\x00\x00\x01\x80\x03own", 10);
    ends(MBM_ILLEGAL_FUNCTION, &r,
         mbm_client_encapsulatedInterfaceTransport(c, &r, MBM_MEI_CANOPEN, 2));
    r.data = own;
    ends(MBM_OK, &r, mbm_client_custom(c, &r, SERVED_ECHO, 8, &eight));
    assert_reply(&r, own, 8);
    ends(MBM_ILLEGAL_FUNCTION, &r, mbm_client_custom(c, &r, 0x42, 8, &eight));
    r = asker_request(SERVED_UNIT, words, sizeof words, query);
    ends(MBM_OK, &r, mbm_client_diagnostics(c, &r, MBM_DIAGNOSTICS_RETURN_QUERY_DATA, 2));
    assert_reply(&r, query, 4);
    ends(MBM_OK, &r, mbm_client_getCommEventCounter(c, &r));
    assert_int_equal(r.length, 4);
    assert_int_equal(words[0], 0);
    assert_true(words[1] > 0);
    r.unit = SERVED_UNIT + 1;
    ends(MBM_OK, &r, mbm_client_writeSingleRegister(c, &r, 3, 0x0102));
    assert_int_equal(s.other_words[3], 0x0102);
}

static void every_function(int framing)
{
    begin(framing);
    reads_and_writes();
    files_and_queues();
    identities_and_diagnostics();
    assert_int_equal(a.counters.timeouts + a.counters.badCrc + a.counters.foreignFrames, 0);
    end();
}

TEST_ROW(every_function_in_rtu, every_function(MBM_FRAMING_RTU))
TEST_ROW(every_function_in_ascii, every_function(MBM_FRAMING_ASCII))
TEST_ROW(every_function_in_tcp, every_function(MBM_FRAMING_TCP))
TEST_ROW(every_function_in_rtu_over_tcp, every_function(MBM_FRAMING_RTU_OVER_TCP))

TEST(a_broadcast_reaches_every_unit_in_ascii_and_is_refused_in_rtu_over_tcp)
{
    mbm_clientRequest r = asker_request(0, NULL, 0, NULL);

    begin(MBM_FRAMING_ASCII);
    ends(MBM_OK, &r, mbm_client_writeSingleRegister(&a.client, &r, SERVED_BASE, 0x5A5A));
    AWAIT(s.words[0] == 0x5A5A);
    end();
    begin(MBM_FRAMING_RTU_OVER_TCP);
    IS(MBM_BROADCAST_NOT_ALLOWED, mbm_client_writeSingleRegister(&a.client, &r, SERVED_BASE, 1));
    end();
}

static uint8_t set_in_done;

static void change(void *context, mbm_clientRequest *request)
{
    if (request->status == MBM_OK)
        set_in_done = mbm_client_setDelimiter((mbm_client *)context, '!');
}

TEST(the_ascii_delimiter_follows_the_devices)
{
    static const uint16_t wanted[] = {'!' << 8};
    uint16_t words[2];
    mbm_clientRequest r = asker_request(SERVED_UNIT, words, sizeof words, wanted);

    begin(MBM_FRAMING_ASCII);
    r.done = change;
    r.context = &a.client;
    set_in_done = MBM_PENDING;
    ends(MBM_OK, &r,
         mbm_client_diagnostics(&a.client, &r, MBM_DIAGNOSTICS_CHANGE_ASCII_INPUT_DELIMITER, 1));
    OK(set_in_done);
    r = asker_request(SERVED_UNIT, words, sizeof words, NULL);
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(&a.client, &r, SERVED_BASE, 2));
    assert_reply(&r, s.words, 4);
    /* A client with another delimiter does not accept the response of a device that still
     * uses LF. */
    OK(mbm_client_setDelimiter(&a.client, '\n'));
    OK(mbm_client_setResponseTimeout(&a.client, 50));
    ends(MBM_RESPONSE_TIMED_OUT, &r,
         mbm_client_readHoldingRegisters(&a.client, &r, SERVED_BASE, 2));
    end();
}

TEST(a_delimiter_is_refused_while_a_request_is_pending)
{
    uint16_t words[2];
    mbm_clientRequest r = asker_request(SERVED_UNIT, words, sizeof words, NULL);

    begin(MBM_FRAMING_ASCII);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &r, SERVED_BASE, 2));
    (void)mbm_client_poll(&a.client);
    IS(MBM_BUSY, mbm_client_setDelimiter(&a.client, '!'));
    OK(asker_wait(&a, &r));
    end();
}

/* Queues 16 requests. Returns how many of them were in flight at once. */
static uint32_t most_in_flight(void)
{
    mbm_clientRequest requests[MBM_CLIENT_DEPTH];
    uint16_t words[MBM_CLIENT_DEPTH];
    uint32_t most = 0;

    for (unsigned i = 0; i < MBM_CLIENT_DEPTH; i++) {
        requests[i] = asker_request(SERVED_UNIT, &words[i], sizeof words[i], NULL);
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &requests[i],
                                                        (uint16_t)(SERVED_BASE + i), 1));
    }
    while (mbm_client_poll(&a.client) == MBM_PENDING) {
        if (a.counters.requests - a.counters.replies > most)
            most = a.counters.requests - a.counters.replies;
        asker_rest(&a);
    }
    for (unsigned i = 0; i < MBM_CLIENT_DEPTH; i++) {
        OK(requests[i].status);
        assert_int_equal(words[i], s.words[i]);
    }
    return most;
}

/* Devices that take one request at a time lose the others. */
TEST(one_request_is_in_flight_over_tcp_unless_the_program_allows_more)
{
    begin(MBM_FRAMING_TCP);
    assert_int_equal(most_in_flight(), 1);
    OK(mbm_client_setInFlight(&a.client, MBM_CLIENT_DEPTH));
    assert_int_equal(most_in_flight(), MBM_CLIENT_DEPTH);
    OK(mbm_client_setInFlight(&a.client, 1));
    assert_int_equal(most_in_flight(), 1);
    end();
}

TEST(requests_in_flight_over_tcp_are_1_to_16)
{
    static mbm_client fresh;

    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(NULL, 1));
    IS(MBM_NOT_INITIALISED, mbm_client_setInFlight(&fresh, 1));
    begin(MBM_FRAMING_RTU);
    OK(mbm_client_setInFlight(&a.client, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(&a.client, 2));
    end();
    begin(MBM_FRAMING_TCP);
    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(&a.client, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(&a.client, MBM_CLIENT_DEPTH + 1));
    OK(mbm_client_setInFlight(&a.client, MBM_CLIENT_DEPTH));
    end();
}
