/* Each member of ModbusMaster: the bytes that it sends and the values that it returns. */
#include "wire.h"

#include <math.h>
#include <type_traits>

fixture each_test = {reset_board, nullptr};

static ModbusMaster global_node;
static ModbusMaster global_array[2] = {4, 5};
static const unsigned clock_reads_before_main = board().clockReads;

TEST(constructors_touch_neither_clock_nor_port)
{
    assert_int_equal(clock_reads_before_main, 0);
    ModbusMaster one, two(2), three(1, 3);
    assert_int_equal(board().clockReads, 0);
    for (unsigned i = 0; i < 4; i++)
        assert_int_equal(shimSerial(i).baud, 0);
}

TEST(the_default_is_slave_1_on_the_first_port_at_19200)
{
    ModbusMaster node;
    node.begin();
    assert_int_equal(Serial.baud, 19200);
    Serial.reply(adu({1, 3, 2, 0x12, 0x34}));
    assert_int_equal(node.readHoldingRegisters(0x102, 1), 0);
    assert_sent(Serial, {1, 3, 1, 2, 0, 1});
    assert_int_equal(node.getResponseBuffer(0), 0x1234);
}

TEST(the_constructor_chooses_the_slave)
{
    ModbusMaster node(17);
    node.begin(9600);
    assert_int_equal(Serial.baud, 9600);
    Serial.reply(adu({17, 6, 0, 1, 0, 2}));
    assert_int_equal(node.writeSingleRegister(1, 2), 0);
    assert_sent(Serial, {17, 6, 0, 1, 0, 2});
}

TEST(the_constructor_chooses_the_port_and_past_3_means_0)
{
    for (uint8_t port = 0; port < 6; port++) {
        reset_board();
        unsigned expected = port > 3 ? 0 : port;
        ModbusMaster node(port, 9);
        node.begin(38400);
        for (unsigned i = 0; i < 4; i++)
            assert_int_equal(shimSerial(i).baud, i == expected ? 38400 : 0);
        shimSerial(expected).reply(adu({9, 5, 0, 1, 0xFF, 0}));
        assert_int_equal(node.writeSingleCoil(1, 1), 0);
        assert_sent(shimSerial(expected), {9, 5, 0, 1, 0xFF, 0});
    }
}

TEST(begin_takes_a_rate_beyond_16_bits)
{
    global_node.begin(115200);
    assert_int_equal(Serial.baud, 115200);
}

TEST(begin_with_a_stream_opens_nothing_and_may_be_repeated)
{
    ModbusMaster node;
    node.setTransmitBuffer(0, 0xABCD);
    for (uint8_t slave = 1; slave < 40; slave++) {
        node.begin(slave, Serial1);
        node.beginTransmission(3);
        node.send(0x0102);
        node.begin(slave, Serial);
        assert_int_equal(node.writeMultipleRegisters(), 3);
        Serial.reply(adu({slave, 16, 0, 3, 0, 1}));
        assert_int_equal(node.writeMultipleRegisters(3, 1), 0);
        assert_sent(Serial, {slave, 16, 0, 3, 0, 1, 2, 1, 2});
    }
    assert_int_equal(Serial.baud, 0);
}

TEST(words_may_be_queued_before_begin)
{
    ModbusMaster node;
    assert_int_equal(node.setTransmitBuffer(1, 0x0304), 0);
    node.begin(1, Serial);
    Serial.reply(adu({1, 16, 0, 0, 0, 2}));
    assert_int_equal(node.writeMultipleRegisters(0, 2), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 2, 4, 0, 0, 3, 4});
}

TEST(settings_may_be_made_before_begin)
{
    ModbusMaster node(3);
    node.setResponseTimeout(30);
    node.begin(19200);
    assert_int_equal(node.readCoils(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    assert_in_range(board().now - Serial.sentAt, 30000, 30500);
}

TEST(a_request_before_begin_returns_a_status)
{
    ModbusMaster node;
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBNotInitialised);
}

TEST(response_words_past_the_end_are_ffff)
{
    ModbusMaster node;
    assert_int_equal(node.getResponseBuffer(124), 0);
    assert_int_equal(node.getResponseBuffer(125), 0xFFFF);
    assert_int_equal(node.getResponseBuffer(255), 0xFFFF);
}

TEST(transmit_words_past_the_end_are_refused_with_02)
{
    ModbusMaster node;
    assert_int_equal(node.setTransmitBuffer(122, 1), 0);
    assert_int_equal(node.setTransmitBuffer(123, 1), 2);
    assert_int_equal(node.setTransmitBuffer(255, 1), 2);
}

MASTER_TEST(set_transmit_buffer_does_not_move_the_queue)
{
    node.beginTransmission(0);
    node.setTransmitBuffer(5, 5);
    node.send(0x0708);
    Serial.reply(adu({1, 16, 0, 0, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 1, 2, 7, 8});
}

MASTER_TEST(clearing_the_words_keeps_the_indices)
{
    Serial.reply(adu({1, 3, 4, 0, 1, 0, 2}));
    assert_int_equal(node.readHoldingRegisters(0, 2), 0);
    assert_int_equal(node.receive(), 1);
    node.clearResponseBuffer();
    assert_int_equal(node.available(), 1);
    assert_int_equal(node.receive(), 0);
    Serial.sent.clear();

    node.beginTransmission(0);
    node.send(0x1111);
    node.clearTransmitBuffer();
    node.send(0x2222);
    Serial.reply(adu({1, 16, 0, 0, 0, 2}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 2, 4, 0, 0, 0x22, 0x22});
}

MASTER_TEST(begin_transmission_sets_the_address_and_keeps_the_words)
{
    node.beginTransmission(1);
    node.send(0xAAAA);
    node.send(0xBBBB);
    node.beginTransmission(0x203);
    node.send(0xCCCC);
    Serial.reply(adu({1, 16, 2, 3, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 2, 3, 0, 1, 2, 0xCC, 0xCC});
    Serial.reply(adu({1, 16, 0, 1, 0, 2}));
    assert_int_equal(node.writeMultipleRegisters(1, 2), 0);
    assert_sent(Serial, {1, 16, 0, 1, 0, 2, 4, 0xCC, 0xCC, 0xBB, 0xBB});
}

template <typename Value> static void assert_queues(Value value, std::initializer_list<int> bytes)
{
    ModbusMaster node;
    int words = static_cast<int>(bytes.size()) / 2;
    Bytes request = raw({1, 16, 0, 0, 0, words, words * 2});
    node.begin(1, Serial);
    node.beginTransmission(0);
    assert_int_equal(node.send(value), 0);
    Serial.reply(adu({1, 16, 0, 0, 0, words}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_bytes(Serial.sent.at(0), sealed(joined(request, raw(bytes))));
    Serial.sent.clear();
}

enum Colour { red = 0x0605 };

TEST(send_takes_every_integer_type)
{
    assert_queues(uint8_t(0xFE), {0, 0xFE});
    assert_queues(uint16_t(0xFEDC), {0xFE, 0xDC});
    assert_queues(uint32_t(0xFEDCBA98), {0xBA, 0x98, 0xFE, 0xDC});
    assert_queues(5, {0, 5});
    assert_queues(-2, {0xFF, 0xFE});
    assert_queues('A', {0, 'A'});
    assert_queues(true, {0, 1});
    assert_queues(int8_t(-1), {0xFF, 0xFF});
    assert_queues(int16_t(-3), {0xFF, 0xFD});
    assert_queues(red, {6, 5});
    assert_queues(0x12345678L, {0x56, 0x78, 0x12, 0x34});
    assert_queues(0x12345678UL, {0x56, 0x78, 0x12, 0x34});
    assert_queues(-1L, {0xFF, 0xFF, 0xFF, 0xFF});
}

MASTER_TEST(words_past_the_end_are_dropped)
{
    node.beginTransmission(0);
    for (int i = 0; i < 123; i++)
        assert_int_equal(node.send(i), 0);
    assert_int_equal(node.send(7), ModbusMaster::ku8MBBufferTooSmall);
    assert_int_equal(node.sendBit(true), ModbusMaster::ku8MBBufferTooSmall);
    Serial.reply(adu({1, 16, 0, 0, 0, 123}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_int_equal(Serial.sent.at(0).size(), 7 + 246 + 2);
    assert_int_equal(Serial.sent.at(0).at(252), 122);
}

MASTER_TEST(bits_are_queued_lowest_first_and_count_complete_words)
{
    node.beginTransmission(4);
    for (int i = 0; i < 18; i++)
        node.sendBit(i == 0 || i == 9 || i == 17);
    Serial.reply(adu({1, 15, 0, 4, 0, 18}));
    assert_int_equal(node.writeMultipleCoils(), 0);
    assert_sent(Serial, {1, 15, 0, 4, 0, 18, 3, 0x01, 0x02, 0x02});

    node.beginTransmission(4);
    for (int i = 0; i < 18; i++)
        node.sendBit(true);
    Serial.reply(adu({1, 16, 0, 4, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 4, 0, 1, 2, 0xFF, 0xFF});
}

MASTER_TEST(request_from_reads_words_for_receive)
{
    Serial.reply(adu({1, 3, 4, 0, 8, 0, 9}));
    assert_int_equal(node.requestFrom(0x10, 2), 2);
    assert_sent(Serial, {1, 3, 0, 0x10, 0, 2});
    assert_int_equal(node.available(), 2);
    assert_int_equal(node.receive(), 8);
    assert_int_equal(node.receive(), 9);
    assert_int_equal(node.available(), 0);
    assert_int_equal(node.receive(), 0xFFFF);
    Serial.reply(adu({1, 0x83, 2}));
    assert_int_equal(node.requestFrom(0x10, 2), 0);
    assert_int_equal(node.status(), 2);
}

MASTER_TEST(reading_and_writing_at_once_has_two_forms)
{
    node.setTransmitBuffer(0, 0x00FF);
    Serial.reply(adu({1, 0x17, 2, 0, 0xFE}));
    assert_int_equal(node.readWriteMultipleRegisters(3, 1, 14, 1), 0);
    assert_sent(Serial, {1, 0x17, 0, 3, 0, 1, 0, 14, 0, 1, 2, 0, 0xFF});
    node.beginTransmission(20);
    node.send(1);
    node.send(2);
    Serial.reply(adu({1, 0x17, 2, 0, 0xFE}));
    assert_int_equal(node.readWriteMultipleRegisters(3, 1), 0);
    assert_sent(Serial, {1, 0x17, 0, 3, 0, 1, 0, 20, 0, 2, 4, 0, 1, 0, 2});
    assert_int_equal(node.getResponseBuffer(0), 0xFE);
}

MASTER_TEST(write_single_register_overwrites_word_0)
{
    Serial.reply(adu({1, 6, 0, 1, 0x99, 0x88}));
    assert_int_equal(node.writeSingleRegister(1, 0x9988), 0);
    Serial.sent.clear();
    Serial.reply(adu({1, 16, 0, 1, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(1, 1), 0);
    assert_sent(Serial, {1, 16, 0, 1, 0, 1, 2, 0x99, 0x88});
}

static uint8_t by_reference(const uint8_t &constant)
{
    return constant;
}

TEST(constants_serve_as_values_labels_and_references)
{
    ModbusMaster node;
    assert_int_equal(node.ku8MBSuccess, 0);
    assert_int_equal(by_reference(ModbusMaster::ku8MBSuccess), 0x00);
    assert_int_equal(by_reference(ModbusMaster::ku8MBIllegalFunction), 0x01);
    assert_int_equal(by_reference(ModbusMaster::ku8MBIllegalDataAddress), 0x02);
    assert_int_equal(by_reference(ModbusMaster::ku8MBIllegalDataValue), 0x03);
    assert_int_equal(by_reference(ModbusMaster::ku8MBSlaveDeviceFailure), 0x04);
    assert_int_equal(by_reference(ModbusMaster::ku8MBInvalidSlaveID), 0xE0);
    assert_int_equal(by_reference(ModbusMaster::ku8MBInvalidFunction), 0xE1);
    assert_int_equal(by_reference(node.ku8MBResponseTimedOut), 0xE2);
    assert_int_equal(by_reference(node.ku8MBInvalidCRC), 0xE3);
    switch (node.status()) {
    case ModbusMaster::ku8MBSuccess: break;
    case ModbusMaster::ku8MBPending:
    default: fail();
    }
}

typedef long LONG; // FatFs defines such a name

TEST(every_status_has_the_same_text_as_in_c)
{
    for (unsigned status = 0; status < 256; status++) {
        const uint8_t number = static_cast<uint8_t>(status);
        const __FlashStringHelper *text = modbusStatusText(number);

        assert_string_equal(reinterpret_cast<const char *>(text), mbm_status_text(number));
        text = modbusStatusText(number, 0);
        assert_string_equal(reinterpret_cast<const char *>(text), mbm_status_textOf(number, 0));
        text = modbusStatusText(number, number);
        assert_string_equal(reinterpret_cast<const char *>(text),
                            mbm_status_textOf(number, number));
    }
}

TEST(helpers_split_and_join_words)
{
    LONG untouched = 1;
    assert_int_equal(untouched, 1);
    assert_int_equal(lowWord(0x12345678), 0x5678);
    assert_int_equal(highWord(0x12345678), 0x1234);
    assert_int_equal(lowWord(-1), 0xFFFF);
    assert_int_equal(LONG(0xFEDC, 0xBA98), 0xFEDCBA98);
}

TEST(arrays_hold_independent_objects)
{
    for (ModbusMaster &node : global_array)
        node.begin();
    Serial.reply(adu({4, 3, 2, 0, 44}));
    Serial.reply(adu({5, 3, 2, 0, 55}));
    assert_int_equal(global_array[0].readHoldingRegisters(0, 1), 0);
    assert_int_equal(global_array[1].readHoldingRegisters(0, 1), 0);
    assert_int_equal(global_array[0].getResponseBuffer(0), 44);
    assert_int_equal(global_array[1].getResponseBuffer(0), 55);
}

/* --- floats, wide integers, texts and bits, compared with constants --- */

static_assert(std::is_empty<ModbusMasterValues<ModbusMaster>>::value, "no byte more an object");

/* Lets the node read words with these bytes. */
static void read(ModbusMaster &node, std::initializer_list<int> bytes)
{
    int count = static_cast<int>(bytes.size());

    node.begin(1, Serial);
    Serial.reply(sealed(joined(raw({1, 4, count}), raw(bytes))));
    assert_int_equal(node.readInputRegisters(0, static_cast<uint16_t>(count / 2)), 0);
    Serial.sent.clear();
}

/* Asserts that the transmit words begin with these bytes. */
static void assert_writes(ModbusMaster &node, std::initializer_list<int> bytes)
{
    int count = static_cast<int>(bytes.size());

    node.begin(1, Serial);
    Serial.reply(adu({1, 16, 0, 0, 0, count / 2}));
    assert_int_equal(node.writeMultipleRegisters(0, static_cast<uint16_t>(count / 2)), 0);
    assert_bytes(Serial.sent.at(0),
                 sealed(joined(raw({1, 16, 0, 0, 0, count / 2, count}), raw(bytes))));
    Serial.sent.clear();
}

static const ModbusMaster::WordOrder orders[] = {ModbusMaster::orderABCD, ModbusMaster::orderCDAB,
                                                 ModbusMaster::orderBADC, ModbusMaster::orderDCBA};

TEST(a_float_is_read_high_word_first)
{
    ModbusMaster node;
    read(node, {0, 7, 0x43, 0x66, 0x80, 0x00});
    assert_true(node.getResponseFloat(1) == 230.5f);
    float value = 0;
    assert_true(node.getResponseFloat(1, value));
    assert_true(value == 230.5f);
}

TEST(the_order_is_set_for_all_calls_or_named_by_one)
{
    ModbusMaster node;
    read(node, {0xAE, 0x41, 0x56, 0x52, 0x56, 0x52, 0xAE, 0x41, 0x41, 0xAE, 0x52, 0x56, 0x52, 0x56,
                0x41, 0xAE});
    for (uint8_t i = 0; i < 4; i++) {
        uint8_t index = static_cast<uint8_t>(2 * i);
        assert_int_equal(node.getResponseUInt32(index, orders[i]), 2923517522u);
        assert_int_equal(node.getResponseInt32(index, orders[i]), -1371449774);
    }
    for (uint8_t i = 0; i < 4; i++) {
        node.setWordOrder(orders[i]);
        assert_int_equal(node.getResponseUInt32(static_cast<uint8_t>(2 * i)), 2923517522u);
        assert_int_equal(node.getResponseUInt32(0, ModbusMaster::orderABCD), 2923517522u);
    }
    ModbusMaster copy(node);
    assert_int_equal(copy.getResponseUInt32(6), 2923517522u);
}

TEST(each_type_is_read)
{
    ModbusMaster node;
    read(node, {0x40, 0x09, 0x21, 0xFB, 0x54, 0x44, 0x2D, 0x18, 0xFF, 0xFE});
    assert_true(fabs(node.getResponseDouble(0) - 3.141592653589793) < 1e-15);
    assert_true(node.getResponseUInt64(0) == 0x400921FB54442D18u);
    assert_true(node.getResponseInt64(1) == 0x21FB54442D18FFFE);
    assert_int_equal(node.getResponseUInt16(4), 0xFFFE);
    assert_int_equal(node.getResponseInt16(4), -2);
    assert_int_equal(node.getResponseInt16(4, ModbusMaster::orderDCBA), -257);
    double wide;
    uint64_t whole;
    int64_t negative;
    uint16_t word;
    int16_t number;
    int32_t two;
    assert_true(node.getResponseDouble(0, wide) && wide > 3.1415);
    assert_true(node.getResponseUInt64(0, whole) && whole == 0x400921FB54442D18u);
    assert_true(node.getResponseInt64(0, negative) && negative == 0x400921FB54442D18);
    assert_true(node.getResponseUInt16(4, word) && word == 0xFFFE);
    assert_true(node.getResponseInt16(4, number, ModbusMaster::orderABCD) && number == -2);
    assert_true(node.getResponseInt32(3, two) && two == 0x2D18FFFE);
}

TEST(a_value_past_the_end_is_an_error_and_not_invented)
{
    ModbusMaster node; // its response buffer has 125 words
    float value = 7;
    uint64_t whole = 7;
    bool on = true;
    assert_true(node.getResponseFloat(123, value));
    assert_true(value == 0);
    value = 7;
    assert_false(node.getResponseFloat(124, value));
    assert_false(node.getResponseFloat(255, value));
    assert_true(value == 7);
    assert_true(isnan(node.getResponseFloat(124)));
    assert_true(isnan(node.getResponseDouble(122)));
    assert_true(node.getResponseDouble(121) == 0);
    assert_false(node.getResponseUInt64(122, whole));
    assert_true(whole == 7);
    assert_int_equal(node.getResponseUInt32(124), 0);
    assert_int_equal(node.getResponseInt16(125), 0);
    assert_false(node.getResponseBit(2000, on));
    assert_true(on);
    assert_false(node.getResponseBit(65535));
}

TEST(each_type_is_written)
{
    ModbusMaster node;
    assert_int_equal(node.setTransmitFloat(0, 230.5f), 0);
    assert_int_equal(node.setTransmitFloat(2, -2.0f, ModbusMaster::orderCDAB), 0);
    assert_int_equal(node.setTransmitUInt32(4, 2923517522u, ModbusMaster::orderBADC), 0);
    assert_int_equal(node.setTransmitInt32(6, -1371449774, ModbusMaster::orderDCBA), 0);
    assert_int_equal(node.setTransmitUInt16(8, 0x1234), 0);
    assert_int_equal(node.setTransmitInt16(9, -2), 0);
    assert_writes(node, {0x43, 0x66, 0x80, 0,    0,    0,    0xC0, 0,    0x41, 0xAE,
                         0x52, 0x56, 0x52, 0x56, 0x41, 0xAE, 0x12, 0x34, 0xFF, 0xFE});
    node.setWordOrder(ModbusMaster::orderCDAB);
    assert_int_equal(node.setTransmitDouble(0, 1.0), 0);
    assert_int_equal(node.setTransmitUInt64(4, 0x0102030405060708u), 0);
    assert_int_equal(node.setTransmitInt64(8, -2, ModbusMaster::orderABCD), 0);
    assert_writes(node, {0, 0, 0, 0, 0,    0,    0x3F, 0xF0, 7,    8,    5,    6,
                         3, 4, 1, 2, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE});
}

TEST(values_past_the_transmit_words_are_refused_with_02)
{
    ModbusMaster node; // its transmit buffer has 123 words
    assert_int_equal(node.setTransmitFloat(121, 1), 0);
    assert_int_equal(node.setTransmitFloat(122, 1), ModbusMaster::ku8MBIllegalDataAddress);
    assert_int_equal(node.setTransmitDouble(120, 1), 2);
    assert_int_equal(node.setTransmitUInt64(255, 1), 2);
    assert_int_equal(node.setTransmitBit(1968, true), 2);
    assert_int_equal(node.setTransmitString(122, 3, "A"), 2);
    assert_int_equal(node.setTransmitString(0, 3, "ABCD"), ModbusMaster::ku8MBBufferTooSmall);
}

TEST(texts_are_read_and_written)
{
    ModbusMaster node;
    char text[9] = "old";
    read(node, {'M', 'E', 'T', 'E', 'R', 0, 'X', 'Y'});
    assert_false(node.getResponseString(0, 8, text, 5));
    assert_false(node.getResponseString(122, 8, text, sizeof text));
    assert_string_equal(text, "old");
    assert_true(node.getResponseString(0, 8, text, sizeof text));
    assert_string_equal(text, "METER");
    assert_true(node.getResponseString(0, 4, text, sizeof text, ModbusMaster::orderBADC));
    assert_string_equal(text, "EMET");
    assert_int_equal(node.setTransmitString(0, 6, "AB3"), 0);
    assert_writes(node, {'A', 'B', '3', 0, 0, 0});
}

MASTER_TEST(coils_are_read_and_written_one_by_one)
{
    Serial.reply(adu({1, 1, 3, 0xCD, 0x6B, 0x05}));
    assert_int_equal(node.readCoils(19, 19), 0);
    Serial.sent.clear();
    const bool on[] = {1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1, 0};
    for (uint16_t i = 0; i < 20; i++) {
        bool found = !on[i];
        assert_int_equal(node.getResponseBit(i), on[i]);
        assert_true(node.getResponseBit(i, found) && found == on[i]);
        assert_int_equal(node.setTransmitBit(i, on[i]), 0);
    }
    Serial.reply(adu({1, 15, 0, 19, 0, 19}));
    assert_int_equal(node.writeMultipleCoils(19, 19), 0);
    assert_sent(Serial, {1, 15, 0, 19, 0, 19, 3, 0xCD, 0x6B, 0x05});
}
