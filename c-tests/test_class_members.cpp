/* Each member of ModbusMaster: the bytes that it sends and the values that it returns. */
#include "wire.h"

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
