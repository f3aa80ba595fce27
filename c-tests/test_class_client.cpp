/* ModbusSerialClient on a simulated board: what its documentation promises, and the functions that
 * are not in test_class_exchanges.cpp. */
#include "client_checks.h"

#include <math.h>

fixture each_test = {reset_board, nullptr};

#define CLIENT_TEST(name) TEST_OF(ModbusSerialClient, client, begin(Serial, 19200), name)

TEST(a_reply_ends_in_the_words_of_its_request)
{
    ModbusSerialClient client;
    ModbusRequestOf<3> request(17);
    OK(request.status());
    IS(MBM_NOT_INITIALISED, client.readHoldingRegisters(request, 107, 3));
    IS(MBM_NOT_INITIALISED, client.poll());
    OK(client.begin(Serial, 19200));
    OK(client.poll());
    expect_exchange(client, client.readHoldingRegisters(request, 107, 3), {17, 3, 0, 107, 0, 3},
                    {17, 3, 6, 2, 43, 0, 0, 0, 100});
    OK(request.status());
    assert_int_equal(request.length(), 6);
    assert_int_equal(request[0], 555);
    assert_int_equal(request[1], 0);
    assert_int_equal(request[2], 100);
    assert_int_equal(request.getUnitID(), 17);
    assert_int_equal(request.wireTransaction(), 0);
}

CLIENT_TEST(an_exception_leaves_the_words)
{
    ModbusRequestOf<1> request(17);
    request[0] = 0x5555;
    expect_exchange(client, client.readInputRegisters(request, 8, 1), {17, 4, 0, 8, 0, 1},
                    {17, 0x84, 2});
    IS(MBM_ILLEGAL_DATA_ADDRESS, request.status());
    assert_int_equal(request.getExceptionCode(), 2);
    assert_int_equal(request[0], 0x5555);
}

static unsigned calls;

static void count_call(ModbusRequest &request)
{
    calls++;
    OK(request.status());
}

CLIENT_TEST(a_function_or_a_lambda_is_called_when_a_request_has_ended)
{
    ModbusRequestOf<1> request(17);
    uint16_t seen = 0;
    unsigned times = 0;
    calls = 0;
    request.onDone(count_call);
    expect_exchange(client, client.readHoldingRegisters(request, 0, 1), {17, 3, 0, 0, 0, 1},
                    {17, 3, 2, 0, 7});
    assert_int_equal(calls, 1);
    request.onDone([&seen, &times](ModbusRequest &reply) {
        seen = reply[0];
        times++;
    });
    expect_exchange(client, client.readHoldingRegisters(request, 0, 1), {17, 3, 0, 0, 0, 1},
                    {17, 3, 2, 0, 9});
    assert_int_equal(seen, 9);
    assert_int_equal(times, 1);
    request.onDone(nullptr);
    expect_exchange(client, client.readHoldingRegisters(request, 0, 1), {17, 3, 0, 0, 0, 1},
                    {17, 3, 2, 0, 11});
    assert_int_equal(seen, 9);
    assert_int_equal(calls, 1);
    assert_int_equal(request[0], 11);
}

CLIENT_TEST(a_callback_may_replace_itself_and_send_a_request)
{
    ModbusRequestOf<1> request(17);
    unsigned order = 0, times = 0;
    request.onDone([&](ModbusRequest &first) {
        first.onDone([&order, &times](ModbusRequest &) { order = order * 10 + 2, times++; });
        order = order * 10 + 1; // the captures of this callback still exist
        times++;
        IS(MBM_PENDING, client.readHoldingRegisters(first, 1, 1));
        IS(MBM_BUSY, client.poll());
        IS(MBM_BUSY, client.wait(first));
        IS(MBM_BUSY, client.begin(Serial));
    });
    Serial.reply(adu({17, 3, 2, 0, 1}));
    Serial.reply(adu({17, 3, 2, 0, 2}));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
    run_until_idle(client);
    assert_int_equal(order, 12);
    assert_int_equal(times, 2);
    assert_int_equal(request[0], 2);
    assert_int_equal(Serial.sent.size(), 2);
}

CLIENT_TEST(requests_are_sent_in_their_order)
{
    ModbusRequestOf<1> first(1), second(2), third(3);
    for (int unit = 1; unit <= 3; unit++)
        Serial.reply(adu({unit, 3, 2, 0, unit * 11}));
    client.readHoldingRegisters(first, 5, 1);
    client.readHoldingRegisters(second, 5, 1);
    client.readHoldingRegisters(third, 5, 1);
    assert_int_equal(client.pending(), 3);
    run_until_idle(client);
    assert_int_equal(first[0], 11);
    assert_int_equal(second[0], 22);
    assert_int_equal(third[0], 33);
    assert_int_equal(Serial.sent.size(), 3);
}

CLIENT_TEST(a_pending_request_is_refused_and_unchanged)
{
    ModbusRequestOf<1> request(17);
    IS(MBM_PENDING, client.readHoldingRegisters(request, 5, 1));
    IS(MBM_BUSY, client.readInputRegisters(request, 6, 1));
    IS(MBM_BUSY, client.writeMultipleRegisters(request, 6, 2));
    IS(MBM_BUSY, request.setUnitID(4));
    IS(MBM_BUSY, client.begin(Serial));
    assert_true(request.pending());
    Serial.reply(adu({17, 3, 2, 0, 1}));
    run_until_idle(client);
    assert_sent(Serial, {17, 3, 0, 5, 0, 1});
    OK(request.status());
    OK(request.setUnitID(4));
    expect_exchange(client, client.readHoldingRegisters(request, 5, 1), {4, 3, 0, 5, 0, 1},
                    {4, 3, 2, 0, 2});
}

CLIENT_TEST(a_request_refuses_a_unit_and_a_timeout_that_are_too_large)
{
    ModbusRequestOf<1> request(17), beyond(300);
    assert_int_equal(beyond.getUnitID(), 300);
    IS(MBM_INVALID_ARGUMENT, client.readHoldingRegisters(beyond, 5, 1));
    IS(MBM_INVALID_ARGUMENT, beyond.status());
    IS(MBM_INVALID_ARGUMENT, request.setUnitID(300));
    assert_int_equal(request.getUnitID(), 17);
    OK(request.setUnitID(255));
    OK(request.setResponseTimeout(100000));
    IS(MBM_INVALID_ARGUMENT, request.setResponseTimeout(1000001));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 5, 1));
    const unsigned long before = millis();
    while (client.poll() == MBM_PENDING)
        assert_true(millis() - before < 200000);
    IS(MBM_RESPONSE_TIMED_OUT, request.status());
    assert_in_range(millis() - before, 100000, 100300);
    assert_int_equal(client.pending(), 0);
}

CLIENT_TEST(a_request_that_needs_more_words_than_it_has_is_refused)
{
    ModbusRequestOf<2> request(17);
    ModbusRequest bare(17);
    const uint8_t small = MBM_BUFFER_TOO_SMALL;
    assert_int_equal(client.readHoldingRegisters(request, 0, 3), small);
    assert_int_equal(client.readCoils(request, 0, 33), small);
    assert_int_equal(client.writeMultipleRegisters(request, 0, 3), small);
    assert_int_equal(client.writeMultipleCoils(request, 0, 33), small);
    assert_int_equal(client.readWriteMultipleRegisters(request, 0, 1, 0, 3), small);
    assert_int_equal(client.diagnostics(request, 0, 3), small);
    assert_int_equal(client.writeFileRecord(request, 4, 1, 3), small);
    const mbm_rule rule = {MBM_RULE_FIXED, 2, 0};
    assert_int_equal(client.custom(request, 0x41, 5, rule), small);
    assert_int_equal(request.status(), small);
    assert_int_equal(client.writeMultipleRegisters(bare, 0, 1), small);
    assert_int_equal(client.writeMultipleRegisters(bare, 0, 65535), small);
    assert_int_equal(client.pending(), 0);
    // A request that fits into its words is sent.
    request.setBit(31, true);
    expect_exchange(client, client.writeMultipleCoils(request, 0, 32),
                    {17, 15, 0, 0, 0, 32, 4, 0, 0, 0, 0x80}, {17, 15, 0, 0, 0, 32});
    expect_exchange(client, client.writeSingleRegister(bare, 3, 0x1234), {17, 6, 0, 3, 0x12, 0x34},
                    {17, 6, 0, 3, 0x12, 0x34});
}

CLIENT_TEST(a_request_has_its_own_timeout_and_retries)
{
    ModbusRequestOf<1> request(17), other(17);
    client.setResponseTimeout(50);
    OK(request.setRetryLimit(1));
    IS(MBM_INVALID_ARGUMENT, client.readHoldingRegisters(request, 0, 1));
    client.setRetries(2);
    OK(request.setResponseTimeout(1500));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
    IS(MBM_BUSY, request.setRetryLimit(0));
    IS(MBM_BUSY, request.setResponseTimeout(0));
    unsigned long before = millis();
    run_until_idle(client);
    assert_int_equal(Serial.sent.size(), 2);
    assert_in_range(millis() - before, 3000, 3300);
    OK(request.setResponseTimeout(0));
    OK(request.setRetryLimit(MBM_NO_RETRIES));
    Serial.sent.clear();
    IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
    before = millis();
    run_until_idle(client);
    assert_int_equal(Serial.sent.size(), 1);
    assert_in_range(millis() - before, 50, 200); // with the quiet time before
    Serial.sent.clear();

    OK(client.setBusyRetries(3, 20));
    Serial.reply(adu({17, 0x83, 6}));
    Serial.reply(adu({17, 3, 2, 0, 5}));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
    run_until_idle(client);
    OK(request.status());
    assert_int_equal(Serial.sent.size(), 2);
    Serial.sent.clear();
}

CLIENT_TEST(a_request_is_repeated_as_often_as_set)
{
    ModbusRequestOf<1> request(17);
    client.setResponseTimeout(50);
    client.setRetries(2);
    OK(client.setBackoff(MBM_BACKOFF_FIXED, 20, 20));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
    run_until_idle(client);
    assert_int_equal(Serial.sent.size(), 3);
    IS(MBM_RESPONSE_TIMED_OUT, request.status());
    Serial.sent.clear();
    Serial.reply(raw({17, 3, 2, 0, 1, 0, 0})); // a wrong CRC
    Serial.reply(adu({17, 3, 2, 0, 5}));
    OK(client.wait((client.readHoldingRegisters(request, 0, 1), request)));
    assert_int_equal(Serial.sent.size(), 2);
    assert_int_equal(request[0], 5);
}

CLIENT_TEST(poll_returns_before_the_reply_comes)
{
    ModbusRequestOf<1> request(17);
    client.setResponseTimeout(300);
    client.readHoldingRegisters(request, 0, 1);
    unsigned polls = 0;
    while (request.pending()) {
        uint32_t before = board().now;
        client.poll();
        polls++;
        // Only flush waits, for the eight bytes of the request.
        assert_true(board().now - before < 8 * Serial.character + 50 * board().tick);
    }
    assert_true(polls > 1000);
}

TEST(wait_returns_how_a_request_ended)
{
    ModbusSerialClient client, other;
    ModbusRequestOf<1> request(17), foreign(17);
    client.begin(Serial, 19200);
    other.begin(Serial1, 19200);
    Serial.reply(adu({17, 3, 2, 0, 5}));
    client.readHoldingRegisters(request, 0, 1);
    unsigned yields = board().yields;
    OK(client.wait(request));
    assert_true(board().yields > yields);
    OK(client.wait(request)); // returns at once
    client.readHoldingRegisters(request, 0, 0);
    IS(MBM_ILLEGAL_DATA_VALUE, client.wait(request));
    other.readHoldingRegisters(foreign, 0, 1);
    IS(MBM_NOT_PENDING, client.wait(foreign));
    OK(other.cancel(foreign));
    IS(MBM_CANCELLED, foreign.status());
    IS(MBM_NOT_PENDING, other.cancel(foreign));
}

CLIENT_TEST(the_driver_is_on_while_a_request_leaves)
{
    ModbusRequestOf<1> request(17);
    client.preTransmission([] { board().logEvent("on"); });
    client.postTransmission([](void *what) { board().logEvent(static_cast<const char *>(what)); },
                            const_cast<char *>("off"));
    client.readHoldingRegisters(request, 0, 1);
    Serial.reply(adu({17, 3, 2, 0, 5}));
    board().log.clear();
    run_until_idle(client);
    assert_string_equal(board().log.c_str(), "on write flush off read ");
}

static ModbusSerialClient *called_client;
static ModbusRequest *other_request;

CLIENT_TEST(a_driver_callback_can_call_nothing)
{
    ModbusRequestOf<1> request(17), another(18);
    called_client = &client;
    other_request = &another;
    client.preTransmission([] {
        IS(MBM_BUSY, called_client->begin(Serial));
        IS(MBM_BUSY, called_client->poll());
        IS(MBM_BUSY, called_client->readCoils(*other_request, 0, 1));
    });
    expect_exchange(client, client.readHoldingRegisters(request, 0, 1), {17, 3, 0, 0, 0, 1},
                    {17, 3, 2, 0, 5});
    OK(another.status());
}

TEST(the_settings_of_the_line_reach_the_client)
{
    static uint32_t released;
    ModbusSerialClient client;
    ModbusRequestOf<1> request(17);
    client.begin(Serial, 9600);
    OK(client.setGap(30000));
    OK(client.setQuietTime(200));
    OK(client.setPostFlushHold(2));
    client.setResponseTimeout(50);
    client.postTransmission([] { released = board().now; });
    expect_exchange(client, client.readHoldingRegisters(request, 0, 1), {17, 3, 0, 0, 0, 1},
                    {17, 3, 2, 0, 5});
    assert_in_range(released - Serial.sentAt, 2 * 1146, 2 * 1146 + 200);
    uint32_t before = board().now;
    client.readHoldingRegisters(request, 0, 1);
    run_until_idle(client);
    IS(MBM_RESPONSE_TIMED_OUT, request.status());
    assert_in_range(Serial.sentAt - before, 20000, 50000); // the gap, from the reply on
    before = board().now;
    client.readHoldingRegisters(request, 0, 1);
    run_until_idle(client);
    assert_in_range(Serial.sentAt - before, 200000, 220000); // the quiet time
    Serial.sent.clear();
    OK(client.begin(Serial, 9600));
    OK(client.setEchoDiscard(true));
    client.setResponseTimeout(50);
    expect_exchange(client, client.writeSingleRegister(request, 1, 2), {17, 6, 0, 1, 0, 2},
                    {17, 6, 0, 1, 0, 2});
    IS(MBM_RESPONSE_TIMED_OUT, request.status()); // that was the echo
}

CLIENT_TEST(begin_resets_the_settings_of_a_client)
{
    ModbusRequestOf<1> request(17);
    client.setRetries(3);
    client.setResponseTimeout(20);
    OK(client.begin(Serial1, 19200));
    client.setResponseTimeout(20);
    client.readHoldingRegisters(request, 0, 1);
    run_until_idle(client);
    assert_int_equal(Serial.sent.size(), 0);
    assert_int_equal(Serial1.sent.size(), 1); // no retry
}

TEST(ascii_frames_go_both_ways)
{
    ModbusSerialClient client;
    ModbusRequestOf<1> request(17);
    OK(client.beginAscii(Serial));
    const char reply[] = ":110302022BBD\r\n", expected[] = ":1103006B000180\r\n";
    Serial.reply(Bytes(reply, reply + sizeof reply - 1));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 107, 1));
    run_until_idle(client);
    assert_int_equal(Serial.sent.size(), 1);
    assert_bytes(Serial.sent[0], Bytes(expected, expected + sizeof expected - 1));
    OK(request.status());
    assert_int_equal(request[0], 555);
    OK(client.setDelimiter('!'));
}

CLIENT_TEST(a_broadcast_ends_without_a_response)
{
    ModbusRequestOf<1> all(0);
    client.setTurnaroundDelay(30);
    IS(MBM_BROADCAST_NOT_ALLOWED, client.readCoils(all, 0, 1));
    IS(MBM_PENDING, client.writeSingleCoil(all, 1, true));
    run_until_idle(client);
    assert_in_range(board().now - Serial.sentAt, 30000, 31000);
    assert_sent(Serial, {0, 5, 0, 1, 0xFF, 0});
    OK(all.status());
}

CLIENT_TEST(a_seventeenth_request_finds_the_queue_full)
{
    uint16_t words[17] = {};
    ModbusRequest requests[17] = {
        {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1},
        {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1},
        {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1}, {1, words, 1}};
    for (unsigned i = 0; i < 16; i++)
        IS(MBM_PENDING, client.readCoils(requests[i], 0, 1));
    IS(MBM_QUEUE_FULL, client.readCoils(requests[16], 0, 1));
    IS(MBM_QUEUE_FULL, requests[16].status());
    for (unsigned i = 0; i < 16; i++)
        OK(client.cancel(requests[i]));
    assert_int_equal(client.pending(), 0);
}

TEST(a_units_record_counts_its_requests_and_delays_the_next)
{
    ModbusSerialClient client;
    ModbusRequestOf<1> first(1), second(1);
    mbm_counters counters = {};
    mbm_clientUnit units[1] = {};
    units[0].unit = 1;
    units[0].delayUs = 50000;
    client.begin(Serial, 19200);
    OK(client.setUnits(units));
    OK(client.setCounters(&counters));
    Serial.reply(adu({1, 3, 2, 0, 1}));
    Serial.reply(adu({1, 0x83, 2}));
    uint32_t begun = board().now;
    client.readHoldingRegisters(first, 0, 1);
    client.readHoldingRegisters(second, 0, 1);
    run_until_idle(client);
    assert_true(Serial.startedAt - begun > 50000);
    assert_int_equal(units[0].requests, 2);
    assert_int_equal(units[0].replies, 2);
    assert_int_equal(units[0].exceptions, 1);
    IS(MBM_ILLEGAL_DATA_ADDRESS, units[0].status);
    assert_int_equal(counters.requests, 2);
    assert_int_equal(counters.exceptions, 1);
}

TEST(a_stream_that_returns_0_for_what_it_sends_works)
{
    ModbusSerialClient client;
    ModbusRequestOf<1> request(17);
    ZeroWriteSerial port;
    client.begin(port, 19200);
    port.reply(adu({17, 3, 2, 0, 5}));
    client.readHoldingRegisters(request, 0, 1);
    run_until_idle(client);
    assert_sent(port, {17, 3, 0, 0, 0, 1});
    OK(request.status());
}

CLIENT_TEST(a_sketch_may_sleep_until_the_next_poll_is_due)
{
    ModbusRequestOf<1> request(17);
    client.setResponseTimeout(500);
    assert_int_equal(client.pollDelay(), 0xFFFFFFFF);
    client.readHoldingRegisters(request, 0, 1);
    while (Serial.sent.empty())
        client.poll();
    client.poll();
    assert_in_range(client.pollDelay(), 490000, 500000);
}

/* --- the request and the reply of each function, and the values in a request's words. The frames
 * are the examples of the standard where it has one --- */

static void words_of(ModbusRequest &request, std::initializer_list<uint16_t> values)
{
    uint16_t index = 0;
    for (uint16_t value : values)
        request[index++] = value;
}

CLIENT_TEST(a_queue_is_read)
{
    ModbusRequestOf<6> request(17);
    expect_exchange(client, client.readFifoQueue(request, 0x04DE), {17, 24, 4, 0xDE},
                    {17, 24, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84});
    assert_int_equal(request.length(), 4);
    assert_int_equal(request[0], 0x01B8);
    assert_int_equal(request[1], 0x1284);
}

CLIENT_TEST(the_functions_of_a_serial_line_are_sent)
{
    ModbusRequestOf<8> request(17);
    expect_exchange(client, client.readExceptionStatus(request), {17, 7}, {17, 7, 0x6D});
    assert_int_equal(request.getByte(0), 0x6D);
    words_of(request, {0xA537});
    expect_exchange(client, client.diagnostics(request, 0), {17, 8, 0, 0, 0xA5, 0x37},
                    {17, 8, 0, 0, 0xA5, 0x37});
    OK(request.status());
    words_of(request, {0});
    expect_exchange(client, client.diagnostics(request, MBM_DIAGNOSTICS_BUS_MESSAGE_COUNT),
                    {17, 8, 0, 11, 0, 0}, {17, 8, 0, 11, 0, 99});
    assert_int_equal(request[0], 99);
    expect_exchange(client, client.getCommEventCounter(request), {17, 11},
                    {17, 11, 0xFF, 0xFF, 1, 8});
    assert_int_equal(request[1], 0x0108);
    expect_exchange(client, client.getCommEventLog(request), {17, 12},
                    {17, 12, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0});
    assert_int_equal(request.length(), 8);
    assert_int_equal(request.getByte(3), 8);
    assert_int_equal(request.getByte(6), 0x20);
    expect_exchange(client, client.reportServerId(request), {17, 17}, {17, 17, 3, 'm', 'b', 0xFF});
    assert_int_equal(request.length(), 3);
    assert_int_equal(request.getByte(1), 'b');
}

CLIENT_TEST(files_are_read_and_written)
{
    ModbusRequestOf<8> request(17);
    expect_exchange(client, client.readFileRecord(request, 4, 1, 2),
                    {17, 20, 7, 6, 0, 4, 0, 1, 0, 2}, {17, 20, 6, 5, 6, 0x0D, 0xFE, 0, 0x20});
    assert_int_equal(request[0], 0x0DFE);
    assert_int_equal(request[1], 0x20);
    words_of(request, {0x06AF, 0x04BE, 0x100D});
    expect_exchange(client, client.writeFileRecord(request, 4, 7, 3),
                    {17, 21, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D},
                    {17, 21, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D});
    OK(request.status());
    static const uint8_t groups[] = {14, 6, 0, 4, 0, 1, 0, 1, 6, 0, 3, 0, 9, 0, 1};
    expect_exchange(client, client.forward(request, 20, groups, sizeof groups),
                    {17, 20, 14, 6, 0, 4, 0, 1, 0, 1, 6, 0, 3, 0, 9, 0, 1},
                    {17, 20, 8, 3, 6, 0x0D, 0xFE, 3, 6, 0x33, 0xCD});
    assert_int_equal(request.getByte(3), 0x0D);
    assert_int_equal(request.getByte(8), 0xCD);
    static const uint8_t record[] = {9, 6, 0, 4, 0, 7, 0, 1, 0xAB, 0xCD};
    expect_exchange(client, client.forward(request, 21, record, sizeof record),
                    {17, 21, 9, 6, 0, 4, 0, 7, 0, 1, 0xAB, 0xCD},
                    {17, 21, 9, 6, 0, 4, 0, 7, 0, 1, 0xAB, 0xCD});
    OK(request.status());
}

CLIENT_TEST(a_device_identifies_itself)
{
    ModbusRequestOf<16> request(17);
    expect_exchange(client, client.readDeviceIdentification(request, MBM_DEVICE_ID_BASIC),
                    {17, 43, 14, 1, 0}, {17, 43, 14, 1, 1, 0, 0, 1, 0, 3, 'm', 'b', 'm'});
    OK(request.status());
    assert_int_equal(request.getByte(3), 1);
    assert_int_equal(request.getByte(5), 3);
    assert_int_equal(request.getByte(6), 'm');
    static const uint8_t canopen[] = {MBM_MEI_CANOPEN, 0x60};
    expect_exchange(client, client.forward(request, 43, canopen, sizeof canopen),
                    {17, 43, 13, 0x60}, {17, 43, 13, 0x60, 1, 2});
    OK(request.status());
    assert_int_equal(request.length(), 4);
}

TEST(user_defined_and_forwarded_functions_are_sent)
{
    static const uint8_t body[] = {0, 107, 0, 1};
    const mbm_rule two = {MBM_RULE_FIXED, 3, 0};
    ModbusSerialClient client;
    ModbusRequestOf<4> request(17);
    client.begin(Serial, 19200);
    request.setByte(0, 0xAA);
    expect_exchange(client, client.custom(request, 0x41, 1, two), {17, 0x41, 0xAA},
                    {17, 0x41, 0x12, 0x34});
    assert_int_equal(request.getByte(1), 0x34);
    expect_exchange(client, client.forward(request, 3, body, sizeof body), {17, 3, 0, 107, 0, 1},
                    {17, 3, 2, 2, 43});
    assert_int_equal(request.length(), 3);
    assert_int_equal(request.getByte(0), 2);
    assert_int_equal(request.getByte(2), 43);
    // The next request sends its own words again.
    words_of(request, {0x1234});
    expect_exchange(client, client.writeMultipleRegisters(request, 1, 1),
                    {17, 16, 0, 1, 0, 1, 2, 0x12, 0x34}, {17, 16, 0, 1, 0, 1});
}

TEST(values_of_each_type_and_order_are_in_the_words)
{
    uint16_t words[4] = {0x4365, 0x1234, 0, 0};
    ModbusRequest request(1, words);
    char text[9];
    float value = 0;
    assert_int_equal(request.size(), 4);
    assert_int_equal(request.getUInt16(0), 0x4365);
    assert_int_equal(request.getUInt16(0, ModbusRequest::orderBADC), 0x6543);
    assert_int_equal(request.getUInt32(0), 0x43651234);
    assert_int_equal(request.getUInt32(0, ModbusRequest::orderCDAB), 0x12344365);
    request.setWordOrder(ModbusRequest::orderDCBA);
    assert_int_equal(request.getUInt32(0), 0x34126543);
    request.setWordOrder(ModbusRequest::orderABCD);
    OK(request.setFloat(2, 230.5f));
    assert_int_equal(words[2], 0x4366);
    assert_int_equal(words[3], 0x8000);
    assert_true(request.getFloat(2, value));
    assert_true(value == 230.5f);
    OK(request.setInt16(0, -2));
    assert_int_equal(request.getInt16(0), -2);
    OK(request.setInt32(1, -70000));
    assert_int_equal(request.getInt32(1), -70000);
    OK(request.setUInt64(0, 0x0102030405060708u));
    assert_int_equal(words[0], 0x0102);
    assert_true(request.getUInt64(0) == 0x0102030405060708u);
    OK(request.setInt64(0, -5));
    assert_true(request.getInt64(0) == -5);
    OK(request.setDouble(0, -1.25));
    assert_true(request.getDouble(0) == -1.25);
    OK(request.setString(0, 8, "mbm", ModbusRequest::orderABCD));
    assert_int_equal(words[0], 'm' * 256 + 'b');
    assert_true(request.getString(0, 8, text, sizeof text));
    assert_string_equal(text, "mbm");
    OK(request.setUInt16(3, 7));
    OK(request.setUInt32(2, 7));
}

TEST(values_past_the_end_are_refused)
{
    ModbusRequestOf<2> request(1);
    ModbusRequest bare(1);
    uint32_t unchanged = 77;
    char text[9] = "as it is";
    IS(MBM_ILLEGAL_DATA_ADDRESS, request.setFloat(1, 1.0f));
    assert_int_equal(request[1], 0);
    assert_false(request.getUInt32(1, unchanged));
    assert_int_equal(unchanged, 77);
    assert_int_equal(request.getUInt32(1), 0);
    assert_true(isnan(request.getFloat(1)));
    assert_true(isnan(request.getDouble(0)));
    assert_false(request.getString(0, 5, text, sizeof text));
    assert_int_equal(text[0], 'a');
    OK(request.setBit(31, true));
    IS(MBM_ILLEGAL_DATA_ADDRESS, request.setBit(32, true));
    assert_false(request.getBit(32));
    IS(MBM_ILLEGAL_DATA_ADDRESS, request.setByte(4, 1));
    assert_int_equal(request.getByte(4), 0);
    assert_int_equal(bare.size(), 0);
    assert_int_equal(bare.getByte(0), 0);
    assert_int_equal(bare.getUInt16(0), 0);
    assert_int_not_equal(bare.setUInt16(0, 1), MBM_OK);
}
