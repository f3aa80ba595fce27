/* ModbusMaster's floats, wide integers, texts and bits, compared with constants. */
#include "wire.h"

#include <math.h>
#include <type_traits>

fixture each_test = {reset_board, nullptr};

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
