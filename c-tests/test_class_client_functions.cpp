/* ModbusSerialClient: the request and the reply of every function that is not in
 * test_class_exchanges.cpp, and the values in a request's words. The frames are the examples of the
 * standard where it has one. */
#include "client_checks.h"

#include <math.h>

fixture each_test = {reset_board, nullptr};

#define CLIENT_TEST(name) TEST_OF(ModbusSerialClient, client, begin(Serial, 19200), name)

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
