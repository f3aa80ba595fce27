/* ModbusServer on a simulated board: silences, the driver, echoes and damaged frames, and what its
 * documentation promises. */
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

/* --- what its documentation promises --- */

TEST(registers_and_bits_of_arrays_are_served)
{
    uint16_t words[] = {0x1111, 0x2222, 0x3333};
    uint8_t bytes[] = {0x05, 0x80};
    ModbusRegisters holding(words, 100), some(words, 2, 7);
    ModbusBits coils(bytes), inputs(bytes, 3, 20);
    ModbusServer server;
    OK(server.holdingRegisters(holding));
    OK(server.inputRegisters(some));
    OK(server.coils(coils));
    OK(server.discreteInputs(inputs));
    OK(server.begin(17, Serial, 19200));
    expect_response(server, {17, 3, 0, 100, 0, 3}, {17, 3, 6, 0x11, 0x11, 0x22, 0x22, 0x33, 0x33});
    expect_response(server, {17, 3, 0, 99, 0, 1}, {17, 0x83, 2});
    expect_response(server, {17, 3, 0, 101, 0, 3}, {17, 0x83, 2});
    expect_response(server, {17, 4, 0, 8, 0, 1}, {17, 4, 2, 0x22, 0x22});
    expect_response(server, {17, 4, 0, 8, 0, 2}, {17, 0x84, 2});
    expect_response(server, {17, 1, 0, 0, 0, 16}, {17, 1, 2, 0x05, 0x80});
    expect_response(server, {17, 2, 0, 20, 0, 3}, {17, 2, 1, 5});
    expect_response(server, {17, 2, 0, 20, 0, 4}, {17, 0x82, 2});
    assert_int_equal(holding.size(), 3);
    assert_int_equal(holding.address(), 100);
    assert_int_equal(coils.size(), 16);
    assert_int_equal(inputs.size(), 3);
}

TEST(writes_reach_the_arrays)
{
    ModbusRegisterArray<4> registers(10);
    ModbusBitArray<9> coils;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.coils(coils);
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 6, 0, 11, 0xBE, 0xEF}, {17, 6, 0, 11, 0xBE, 0xEF});
    assert_int_equal(registers[1], 0xBEEF);
    expect_response(server, {17, 16, 0, 12, 0, 2, 4, 1, 2, 3, 4}, {17, 16, 0, 12, 0, 2});
    assert_int_equal(registers[2], 0x0102);
    assert_int_equal(registers[3], 0x0304);
    expect_response(server, {17, 16, 0, 13, 0, 2, 4, 9, 9, 9, 9}, {17, 0x90, 2});
    assert_int_equal(registers[3], 0x0304); // unchanged: a refused write writes no register
    expect_response(server, {17, 5, 0, 8, 0xFF, 0}, {17, 5, 0, 8, 0xFF, 0});
    assert_true(coils[8]);
    expect_response(server, {17, 15, 0, 1, 0, 3, 1, 5}, {17, 15, 0, 1, 0, 3});
    assert_true(coils[1] && !coils[2] && coils[3]);
    expect_response(server, {17, 5, 0, 8, 0x12, 0}, {17, 0x85, 3});
    expect_response(server, {17, 5, 0, 9, 0, 0}, {17, 0x85, 2});
}

TEST(a_sketch_sets_what_a_client_reads)
{
    ModbusRegisterArray<2> readings;
    ModbusBitArray<10> inputs;
    ModbusServer server;
    server.inputRegisters(readings);
    server.discreteInputs(inputs);
    server.begin(1, Serial, 19200);
    expect_response(server, {1, 4, 0, 0, 0, 2}, {1, 4, 4, 0, 0, 0, 0});
    readings[1] = 513;
    inputs.set(9, true);
    inputs.set(1, true);
    inputs.set(2, true);
    inputs.set(1, false);
    expect_response(server, {1, 4, 0, 0, 0, 2}, {1, 4, 4, 0, 0, 2, 1});
    expect_response(server, {1, 2, 0, 0, 0, 10}, {1, 2, 2, 4, 2});
    const ModbusRegisters &same = readings;
    assert_int_equal(same[1], 513);
}

static uint16_t written_address, written_quantity, written_count;

TEST(one_hook_refuses_a_write_and_another_is_called_after_it)
{
    ModbusRegisterArray<4> registers(10);
    ModbusServer server;
    written_count = 0;
    ModbusHooks hooks;
    hooks.beforeWrite([](const mbm_access &access) -> uint8_t {
        assert_int_equal(access.address, 11);
        assert_int_equal(access.quantity, 1);
        return access.data[0] > 0x10 ? 4 : 0;
    });
    hooks.afterWrite([](const mbm_access &access) {
        written_address = access.address;
        written_quantity = access.quantity;
        written_count++;
    });
    registers.setHooks(hooks);
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 6, 0, 11, 0x11, 0}, {17, 0x86, 4});
    assert_int_equal(registers[1], 0);
    assert_int_equal(written_count, 0);
    expect_response(server, {17, 6, 0, 11, 0x10, 0}, {17, 6, 0, 11, 0x10, 0});
    assert_int_equal(registers[1], 0x1000);
    assert_int_equal(written_count, 1);
    assert_int_equal(written_address, 11);
    assert_int_equal(written_quantity, 1);
    hooks.beforeWrite(nullptr);
    expect_response(server, {17, 6, 0, 10, 0x11, 0}, {17, 6, 0, 10, 0x11, 0});
    assert_int_equal(written_count, 2);
    hooks.afterWrite(nullptr);
    expect_response(server, {17, 6, 0, 10, 0x12, 0}, {17, 6, 0, 10, 0x12, 0});
    assert_int_equal(written_count, 2);
    hooks.beforeRead([](const mbm_access &access) -> uint8_t {
        assert_int_equal(access.unit, 17);
        assert_int_equal(access.function, 3);
        return access.quantity == 2 ? 6 : 0;
    });
    expect_response(server, {17, 3, 0, 10, 0, 2}, {17, 0x83, 6});
    expect_response(server, {17, 3, 0, 10, 0, 1}, {17, 3, 2, 0x12, 0});
    registers.removeHooks();
    expect_response(server, {17, 3, 0, 12, 0, 2}, {17, 3, 4, 0, 0, 0, 0});
}

TEST(absent_registers_and_bits_are_refused)
{
    static const uint8_t valid[] = {0x05};
    ModbusRegisterArray<3> registers;
    ModbusServer server;
    registers.setValid(valid);
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 3, 0, 2, 0, 1}, {17, 3, 2, 0, 0});
    expect_response(server, {17, 3, 0, 0, 0, 3}, {17, 0x83, 2});
}

TEST(mask_write_and_read_write_are_served_after_maskAndReadWrite)
{
    ModbusRegisterArray<4> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    registers[0] = 0x0012;
    expect_response(server, {17, 22, 0, 0, 0, 0xF2, 0, 0x25}, {17, 0x96, 1});
    OK(server.maskAndReadWrite(registers));
    expect_response(server, {17, 22, 0, 0, 0, 0xF2, 0, 0x25}, {17, 22, 0, 0, 0, 0xF2, 0, 0x25});
    assert_int_equal(registers[0], 0x0017);
    expect_response(server, {17, 23, 0, 0, 0, 2, 0, 1, 0, 1, 2, 7, 8}, {17, 23, 4, 0, 0x17, 7, 8});
}

TEST(a_unit_without_tables_sends_no_response)
{
    ModbusServer server;
    server.begin(17, Serial, 19200);
    expect_no_response(server, adu({17, 3, 0, 0, 0, 1}));
}

TEST(each_of_several_units_serves_its_own_tables)
{
    ModbusUnit units[2] = {{5}, {6}};
    ModbusRegisterArray<1> left, right;
    ModbusServer server;
    units[0].holdingRegisters(left);
    units[1].holdingRegisters(right);
    OK(server.begin(units, Serial, 19200));
    expect_response(server, {5, 6, 0, 0, 0, 5}, {5, 6, 0, 0, 0, 5});
    expect_response(server, {6, 6, 0, 0, 0, 6}, {6, 6, 0, 0, 0, 6});
    assert_int_equal(left[0], 5);
    assert_int_equal(right[0], 6);
    expect_no_response(server, adu({1, 6, 0, 0, 0, 7}));
    expect_no_response(server, adu({0, 6, 0, 0, 0, 8}));
    assert_int_equal(left[0], 8);
    assert_int_equal(right[0], 8);
    units[1].setUnitID(9);
    assert_int_equal(units[1].getUnitID(), 9);
    expect_response(server, {9, 3, 0, 0, 0, 1}, {9, 3, 2, 0, 8});
    expect_no_response(server, adu({6, 3, 0, 0, 0, 1}));
}

TEST(a_unit_id_above_255_is_refused)
{
    ModbusServer server;
    ModbusRegisterArray<2> holding;
    ModbusUnit units[2];
    units[1].setUnitID(300);
    server.holdingRegisters(holding);
    OK(server.begin(7, Serial, 19200));
    IS(MBM_INVALID_ARGUMENT, server.begin(263, Serial, 19200));
    IS(MBM_INVALID_ARGUMENT, server.beginAscii(256, Serial));
    IS(MBM_INVALID_ARGUMENT, server.begin(units, Serial, 19200));
    assert_int_equal(server.getUnitID(), 7);
    expect_response(server, {7, 3, 0, 0, 0, 1}, {7, 3, 2, 0, 0});
}

static uint16_t adds(const mbm_request &request, uint8_t *response, uint16_t capacity)
{
    if (request.length != 2 || capacity < 1)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    if (request.data[0] == 0xFF)
        return MBM_REPLY_NONE;
    response[0] = static_cast<uint8_t>(request.data[0] + request.data[1]);
    return 1;
}

TEST(a_function_of_the_sketch_is_served)
{
    ModbusFunction sum(65, adds), none(66, nullptr);
    ModbusServer server;
    OK(server.function(sum));
    IS(MBM_INVALID_ARGUMENT, server.function(none));
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 65, 3, 4}, {17, 65, 7});
    expect_response(server, {17, 65, 3}, {17, 65 | 0x80, 3});
    expect_no_response(server, adu({17, 65, 0xFF, 1}));
    expect_response(server, {17, 66, 3, 4}, {17, 66 | 0x80, 1});
}

TEST(a_function_can_be_switched_off_and_on)
{
    mbm_functionMask switches = {};
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    OK(server.switchOff(switches, 6));
    expect_response(server, {17, 6, 0, 0, 0, 9}, {17, 0x86, 1});
    expect_response(server, {17, 3, 0, 0, 0, 1}, {17, 3, 2, 0, 0});
    OK(server.switchOn(switches, 6));
    expect_response(server, {17, 6, 0, 0, 0, 9}, {17, 6, 0, 0, 0, 9});
}

static uint16_t address_itself(void *, uint16_t address)
{
    return address;
}

TEST(the_other_functions_are_served_from_their_records)
{
    static const uint8_t name[] = {'m', 'b', 'm'};
    static uint16_t records[] = {1, 2};
    static const uint16_t queued[] = {8, 9};
    mbm_exceptionStatus status = {};
    mbm_diagnostics diagnostics = {};
    mbm_serverId id = {};
    mbm_file file = {records, 2, 4};
    mbm_files files = {};
    mbm_fifo fifo = {queued, 30, 2};
    mbm_fifos fifos = {};
    mbm_object object = {};
    mbm_serverIdentification identification = {};
    mbm_dataCallbacks cells = {};
    ModbusServer server;
    status.outputs = 0x6D;
    id.id = name;
    id.idLength = 3;
    id.running = 1;
    files.files = &file;
    files.count = 1;
    fifos.fifos = &fifo;
    fifos.count = 1;
    object.data = name;
    object.length = 3;
    identification.objects = &object;
    identification.count = 1;
    cells.get = address_itself;
    OK(server.serve(status));
    OK(server.serve(diagnostics));
    OK(server.serve(id));
    OK(server.serve(files));
    OK(server.serve(fifos));
    OK(server.serve(identification));
    OK(server.serve(cells, 4));
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 7}, {17, 7, 0x6D});
    expect_response(server, {17, 8, 0, 0, 0xA5, 0x37}, {17, 8, 0, 0, 0xA5, 0x37});
    expect_response(server, {17, 17}, {17, 17, 4, 'm', 'b', 'm', 0xFF});
    expect_response(server, {17, 20, 7, 6, 0, 4, 0, 1, 0, 1}, {17, 20, 4, 3, 6, 0, 2});
    expect_response(server, {17, 24, 0, 30}, {17, 24, 0, 6, 0, 2, 0, 8, 0, 9});
    expect_response(server, {17, 43, 14, 4, 0},
                    {17, 43, 14, 4, 0x81, 0, 0, 1, 0, 3, 'm', 'b', 'm'});
    expect_response(server, {17, 4, 0x12, 0x34, 0, 1}, {17, 4, 2, 0x12, 0x34});
}

/* The two ends of a wire. Each is a Stream. */
class Loop : public Stream {
public:
    Loop *far = nullptr;
    std::deque<uint8_t> arrived;

    int available() override { return static_cast<int>(arrived.size()); }
    int read() override
    {
        if (arrived.empty())
            return -1;
        uint8_t value = arrived.front();
        arrived.pop_front();
        return value;
    }
    int peek() override { return arrived.front(); }
    size_t write(uint8_t value) override
    {
        far->arrived.push_back(value);
        return 1;
    }
};

TEST(master_and_server_understand_each_other)
{
    static ModbusServer server;
    ModbusRegisterArray<125> registers, inputs;
    ModbusBitArray<2000> coils;
    ModbusMaster node;
    Loop left, right;
    left.far = &right;
    right.far = &left;
    server.holdingRegisters(registers);
    server.maskAndReadWrite(registers);
    server.inputRegisters(inputs);
    server.coils(coils);
    server.begin(17, right, 19200);
    node.begin(17, left);
    node.setBaudRate(19200);
    node.idle([] { server.poll(); });
    for (uint16_t i = 0; i < 125; i++)
        inputs[i] = static_cast<uint16_t>(i * 517);
    assert_int_equal(node.readInputRegisters(0, 125), 0);
    for (uint8_t i = 0; i < 125; i++)
        assert_int_equal(node.getResponseBuffer(i), i * 517);
    assert_int_equal(node.writeSingleRegister(3, 0xBEEF), 0);
    assert_int_equal(registers[3], 0xBEEF);
    assert_int_equal(node.maskWriteRegister(3, 0xFF00, 0x0055), 0);
    assert_int_equal(registers[3], 0xBE55);
    node.beginTransmission(50);
    node.send(uint32_t(0x11223344));
    assert_int_equal(node.readWriteMultipleRegisters(3, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 0xBE55);
    assert_int_equal(registers[51], 0x1122);
    node.setTransmitBuffer(0, 0xA5C3);
    assert_int_equal(node.writeMultipleCoils(1990, 10), 0);
    assert_int_equal(node.readCoils(1984, 16), 0);
    assert_int_equal(node.getResponseBuffer(0), (0xA5C3 & 0x3FF) << 6 & 0xFFFF);
    assert_int_equal(node.writeSingleCoil(2000, 1), ModbusMaster::ku8MBIllegalDataAddress);
    assert_int_equal(node.readDiscreteInputs(0, 1), ModbusMaster::ku8MBIllegalFunction);
}
