/* ModbusServer: silences, the driver, echoes and damaged frames. */
#include "server_checks.h"

fixture each_test = {reset_board, nullptr};

TEST(a_response_begins_after_the_silence)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    Bytes request = adu({17, 3, 0, 0, 0, 1});
    uint32_t last = board().now + 100 + 573 * static_cast<uint32_t>(request.size() - 1);
    Serial.arrive(request, board().now + 100, 573);
    run_loop(server);
    assert_int_equal(Serial.sent.size(), 1);
    assert_in_range(Serial.startedAt - last, t35, t35 + 6 * board().tick);
    Serial.sent.clear();
    server.setSilence(9000);
    last = board().now;
    receive(server, request);
    assert_in_range(Serial.startedAt - last, 9000, 9000 + 6 * board().tick);
    server.setBaudRate(0); // unknown baud rate: 4 ms
    last = board().now;
    receive(server, request);
    assert_in_range(Serial.startedAt - last, 4000, 4000 + 6 * board().tick);
}

TEST(a_request_may_pause_for_t15)
{
    const uint32_t t15 = t35 * 3 / 7;
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    Bytes request = adu({17, 6, 0, 0, 0, 1});
    Bytes front(request.begin(), request.begin() + 4), rest(request.begin() + 4, request.end());
    Serial.inject(front);
    Serial.arrive(rest, board().now + t15, 573);
    run_loop(server);
    assert_sent(Serial, {17, 6, 0, 0, 0, 1});
}

TEST(a_request_that_the_serial_driver_hands_over_in_blocks_is_answered)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    Bytes request = adu({17, 6, 0, 0, 0, 1});
    for (size_t cut = 1; cut < request.size(); cut++) {
        Bytes front(request.begin(), request.begin() + static_cast<std::ptrdiff_t>(cut)),
            rest(request.begin() + static_cast<std::ptrdiff_t>(cut), request.end());
        registers[0] = 0;
        Serial.sent.clear();
        Serial.inject(front);
        run_loop(server);
        assert_int_equal(Serial.sent.size(), 0);
        Serial.inject(rest);
        run_loop(server);
        assert_sent(Serial, {17, 6, 0, 0, 0, 1});
        for (int i = 0; i < 4; i++) // longer than an echo may take
            run_loop(server);
    }
    // 130 bytes as the FIFO of an ESP32 hands them over at 19200 baud: after 120 characters.
    std::initializer_list<int> head = {17, 16, 0, 0, 0, 60, 120};
    Bytes longer;
    for (int byte : head)
        longer.push_back(static_cast<uint8_t>(byte));
    longer.resize(127);
    longer = sealed(longer);
    Serial.sent.clear();
    Serial.inject(Bytes(longer.begin(), longer.begin() + 120));
    run_loop(server);
    Serial.arrive(Bytes(longer.begin() + 120, longer.end()), board().now + 10 * 573, 0);
    run_loop(server);
    assert_sent(Serial, {17, 0x90, 2});
}

/* A serial port as that of an ESP32. */
struct FifoSerial : HardwareSerial {
    uint8_t threshold = 120;
    void setRxFIFOFull(uint8_t bytes) { threshold = bytes; }
};

TEST(a_serial_port_with_a_fifo_hands_over_each_byte)
{
    ModbusServer server;
    ModbusUnit units[1] = {{17}};
    FifoSerial one, other, refused;
    OK(server.begin(17, one, 19200));
    assert_int_equal(one.threshold, 1);
    OK(server.begin(units, other));
    assert_int_equal(other.threshold, 1);
    IS(MBM_INVALID_ARGUMENT, server.begin(256, refused));
    assert_int_equal(refused.threshold, 120);
    // Known only as a Stream, it keeps its threshold.
    OK(server.begin(17, static_cast<Stream &>(refused)));
    assert_int_equal(refused.threshold, 120);
}

TEST(the_time_that_an_adapter_takes_can_be_set)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    Bytes request = adu({17, 6, 0, 0, 0, 1});
    Bytes front(request.begin(), request.begin() + 4), rest(request.begin() + 4, request.end());
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    for (int i = 0; i < 2; i++) {
        Serial.inject(front);
        for (int wait = 0; wait < 5; wait++)
            run_loop(server);
        Serial.inject(rest);
        run_loop(server);
        assert_int_equal(Serial.sent.size(), i);
        Serial.sent.clear();
        OK(server.setReceiveLatency(120));
    }
}

TEST(a_sketch_whose_receiver_gets_what_it_sends_answers_once)
{
    ModbusRegisterArray<2> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    server.postTransmission([] { Serial.inject(Serial.sent.back()); });
    expect_response(server, {17, 6, 0, 1, 0, 7}, {17, 6, 0, 1, 0, 7});
    expect_response(server, {17, 3, 0, 1, 0, 1}, {17, 3, 2, 0, 7});
    expect_response(server, {17, 3, 0, 9, 0, 1}, {17, 0x83, 2});
    for (int i = 0; i < 4; i++)
        run_loop(server);
    assert_int_equal(Serial.sent.size(), 0);
}

TEST(a_stream_that_returns_0_for_what_it_sends_works)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    ZeroWriteSerial port;
    server.holdingRegisters(registers);
    server.begin(17, port, 19200);
    port.inject(adu({17, 3, 0, 0, 0, 1}));
    run_loop(server);
    assert_sent(port, {17, 3, 2, 0, 0});
}

TEST(the_driver_is_off_until_the_silence_has_passed)
{
    static uint32_t on;
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.inputRegisters(registers);
    server.begin(17, Serial, 19200);
    server.preTransmission([] { on = board().now; });
    uint32_t requested_at = board().now;
    expect_response(server, {17, 3, 0, 0, 0, 1}, {17, 0x83, 1});
    assert_in_range(on - requested_at, t35, t35 + 6 * board().tick);
}

TEST(a_sketch_may_sleep_for_the_time_of_pollDelay)
{
    ModbusServer server;
    server.begin(17, Serial, 19200);
    server.poll();
    assert_int_equal(server.pollDelay(), 0xFFFFFFFF);
    Serial.inject(raw({17}));
    server.poll();
    // The server executes a request during the silence before its response.
    assert_in_range(server.pollDelay(), t35 / 2 - 6 * board().tick, t35 / 2);
}

TEST(the_driver_is_on_while_a_response_leaves)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    server.preTransmission([] { board().logEvent("pre"); });
    server.postTransmission([] { board().logEvent("post"); });
    receive(server, adu({17, 3, 0, 0, 0, 1}));
    assert_string_equal(board().log.c_str(), "read pre write flush post ");
    board().log.clear();
    Serial.sent.clear();
    expect_no_response(server, adu({18, 3, 0, 0, 0, 1}));
    assert_string_equal(board().log.c_str(), "read ");
    server.preTransmission(nullptr);
    server.postTransmission(nullptr);
    board().log.clear();
    receive(server, adu({17, 3, 0, 0, 0, 1}));
    assert_string_equal(board().log.c_str(), "read write flush ");
}

static void counts(void *context)
{
    ++*static_cast<int *>(context);
}

TEST(callbacks_get_their_context)
{
    int on = 0, off = 0;
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.inputRegisters(registers);
    server.begin(17, Serial, 19200);
    server.preTransmission(counts, &on);
    server.postTransmission(counts, &off);
    expect_response(server, {17, 3, 0, 0, 0, 1}, {17, 0x83, 1});
    expect_response(server, {17, 3, 0, 0, 0, 1}, {17, 0x83, 1});
    assert_int_equal(on, 2);
    assert_int_equal(off, 2);
}

TEST(an_echo_of_the_response_is_dropped_if_set_so)
{
    ModbusRegisterArray<2> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    server.setEchoDiscard(true);
    // The response of function 06 has the same bytes as its request.
    server.preTransmission([] { Serial.inject(adu({17, 6, 0, 1, 0, 7})); });
    expect_response(server, {17, 6, 0, 1, 0, 7}, {17, 6, 0, 1, 0, 7});
    server.preTransmission(nullptr);
    expect_response(server, {17, 3, 0, 1, 0, 1}, {17, 3, 2, 0, 7});
}

TEST(a_response_written_in_pieces_is_one_frame)
{
    ModbusRegisterArray<2> registers;
    ModbusServer server;
    Serial.writeSpace = 2;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    server.preTransmission([] { board().logEvent("pre"); });
    server.postTransmission([] { board().logEvent("post"); });
    expect_response(server, {17, 3, 0, 0, 0, 2}, {17, 3, 4, 0, 0, 0, 0});
    assert_string_equal(board().log.c_str(), "read pre write flush post ");
}

TEST(damaged_frames_and_those_of_other_units_get_no_response)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    Bytes damaged = adu({17, 6, 0, 0, 0, 9});
    damaged[5] ^= 1;
    expect_no_response(server, damaged);
    expect_no_response(server, adu({18, 6, 0, 0, 0, 9}));
    expect_no_response(server, adu({18, 3, 2, 0, 9}));
    expect_no_response(server, raw({17, 6, 0}));
    assert_int_equal(registers[0], 0);
    expect_response(server, {17, 6, 0, 0, 0, 9}, {17, 6, 0, 0, 0, 9});
}

TEST(ascii_is_served)
{
    ModbusRegisterArray<1> registers;
    ModbusUnit units[1] = {{17}};
    ModbusServer server;
    static const char request[] = ":110300000001EB\r\n", response[] = ":1103020000EA\r\n";
    Bytes frame(request, request + sizeof request - 1);
    Bytes answer(response, response + sizeof response - 1);
    server.holdingRegisters(registers);
    units[0].holdingRegisters(registers);
    OK(server.beginAscii(17, Serial));
    receive(server, frame);
    assert_int_equal(Serial.sent.size(), 1);
    assert_bytes(Serial.sent[0], answer);
    Serial.sent.clear();
    OK(server.beginAscii(units, Serial));
    receive(server, frame);
    assert_int_equal(Serial.sent.size(), 1);
    assert_bytes(Serial.sent[0], answer);
}

TEST(a_baud_rate_does_not_change_the_timeout_of_ascii)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    static const char request[] = ":110300000001EB\r\n";
    Bytes frame(request, request + sizeof request - 1);
    server.holdingRegisters(registers);
    OK(server.beginAscii(17, Serial));
    server.setBaudRate(19200);
    Serial.arrive(frame, board().now + 100, 3000);
    for (int i = 0; i < 4; i++)
        run_loop(server);
    assert_int_equal(Serial.sent.size(), 1);
    Serial.sent.clear();
    server.begin(17, Serial, 19200);
    server.beginAscii(17, Serial);
    server.setBaudRate(19200);
    Serial.arrive(frame, board().now + 100, 3000);
    for (int i = 0; i < 4; i++)
        run_loop(server);
    assert_int_equal(Serial.sent.size(), 1);
}

TEST(begin_may_be_called_again)
{
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    IS(MBM_NOT_INITIALISED, server.poll());
    assert_int_equal(server.pollDelay(), 0xFFFFFFFF);
    server.begin(17, Serial1, 19200);
    server.holdingRegisters(registers);
    Serial1.inject(raw({18, 3}));
    server.poll();
    server.begin(18, Serial, 19200);
    expect_response(server, {18, 3, 0, 0, 0, 1}, {18, 3, 2, 0, 0});
    expect_no_response(server, adu({17, 3, 0, 0, 0, 1}));
    assert_int_equal(Serial1.sent.size(), 0);
}
