/* A board with one UART and little RAM. The buffers are as on AVR, and the frame of a function
 * that waits lies on its stack. */
#define SHIM_UARTS 1
#define MODBUSMASTER_RESPONSE_WORDS 64
#define MODBUSMASTER_TRANSMIT_WORDS 64
#define RAMEND 0x08FF /* as on an Uno */
#include "wire.h"

fixture each_test = {reset_board, nullptr};

TEST(a_uart_that_the_board_lacks_falls_back_to_the_first)
{
    for (uint8_t port = 0; port < 5; port++) {
        reset_board();
        ModbusMaster node(port, 3);
        node.begin(57600);
        assert_int_equal(Serial.baud, 57600);
        Serial.reply(adu({3, 6, 0, 1, 0, 2}));
        assert_int_equal(node.writeSingleRegister(1, 2), 0);
        assert_sent(Serial, {3, 6, 0, 1, 0, 2});
    }
}

TEST_ROW(objects_are_small,
         assert_in_range(sizeof(ModbusMaster), 2 * 128, 2 * 128 + sizeof(mbm_node) + 80))

TEST(objects_may_share_the_frame_buffer)
{
    ModbusMaster first, second;
    first.begin(1, Serial);
    second.begin(2, Serial);
    for (int i = 0; i < 3; i++) {
        Serial.reply(adu({1, 3, 4, 0, 7, 0, i}));
        assert_int_equal(first.readHoldingRegisters(0, 2), 0);
        Serial.reply(adu({2, 3, 2, 0x55, 0x55}));
        assert_int_equal(second.readHoldingRegisters(0, 1), 0);
        assert_int_equal(first.getResponseBuffer(0), 7);
        assert_int_equal(first.getResponseBuffer(1), i);
        assert_int_equal(second.getResponseBuffer(0), 0x5555);
    }
}

/* Returns a reply with `count` registers, whose values are 1, 2 and so on. */
static Bytes registers_of_unit_1(int count)
{
    Bytes reply = raw({1, 3, 2 * count});
    for (int i = 1; i <= count; i++) {
        reply.push_back(0);
        reply.push_back(static_cast<uint8_t>(i));
    }
    return sealed(reply);
}

TEST(the_buffer_ends_after_64_words)
{
    ModbusMaster node;
    assert_int_equal(node.getResponseBuffer(63), 0);
    assert_int_equal(node.getResponseBuffer(64), 0xFFFF);
    assert_int_equal(node.setTransmitBuffer(63, 0), 0);
    assert_int_equal(node.setTransmitBuffer(64, 0), 2);
}

MASTER_TEST(transfers_of_64_registers_fit)
{
    Bytes reply = raw({1, 3, 128});
    for (int i = 0; i < 128; i++)
        reply.push_back(static_cast<uint8_t>(i));
    Serial.reply(sealed(reply));
    assert_int_equal(node.readHoldingRegisters(0, 64), 0);
    assert_int_equal(node.getResponseBuffer(63), 126 << 8 | 127);
    Serial.reply(adu({1, 16, 0, 0, 0, 64}));
    assert_int_equal(node.writeMultipleRegisters(0, 64), 0);
    reply[1] = 0x17;
    Serial.reply(sealed(reply));
    assert_int_equal(node.readWriteMultipleRegisters(0, 64, 0, 64), 0);
}

/* With the least frame that each function has. */
MASTER_TEST(a_late_reply_fits_beside_the_right_one)
{
    node.setResponseTimeout(300);
    for (int words : {1, 2, 20, 64}) {
        Bytes late = raw({1, 3, 2 * words}), right = late;
        late.resize(3 + 2 * static_cast<size_t>(words), 0x11);
        right.resize(late.size(), 0x22);
        Serial.reply({});
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(words)),
                         ModbusMaster::ku8MBResponseTimedOut);
        Serial.reply(joined(sealed(late), sealed(right)));
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(words)), 0);
        assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(words - 1)), 0x2222);
        Serial.reply(sealed(right));
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(words)), 0);
    }
}

/* The first reply after a timeout is held. A frame of another unit follows it, which is as long as
 * a reply, or short if two replies do not fit into the longest frame. */
MASTER_TEST(a_held_reply_stays_beside_a_frame_of_another_unit)
{
    node.setResponseTimeout(300);
    for (int words : {1, 2, 20, 33, 34, 60, 64}) {
        Bytes right = raw({1, 3, 2 * words});
        right.resize(3 + 2 * static_cast<size_t>(words), 0x22);
        Bytes foreign = right;
        foreign[0] = 2;
        if (words > 33)
            foreign = raw({2, 6, 0, 1, 0, 2});
        Serial.reply({});
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(words)),
                         ModbusMaster::ku8MBResponseTimedOut);
        Serial.reply({});
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(words)),
                         ModbusMaster::ku8MBResponseTimedOut);
        Serial.reply(joined(sealed(right), sealed(foreign)));
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(words)), 0);
        assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(words - 1)), 0x2222);
        board().now += 1000000;
    }
}

MASTER_TEST(noise_longer_than_the_frame_is_skipped)
{
    for (int byte : {0x00, 0x01, 0x03, 0xFF}) {
        Bytes noise(300, static_cast<uint8_t>(byte));
        Serial.reply(joined(noise, adu({1, 3, 2, 0, byte})));
        assert_int_equal(node.readHoldingRegisters(0, 1), 0);
        assert_int_equal(node.getResponseBuffer(0), byte);
        Serial.reply(joined(noise, adu({1, 5, 0, 3, 0xFF, 0})));
        assert_int_equal(node.writeSingleCoil(3, 1), 0);
    }
}

MASTER_TEST(every_function_has_a_frame_that_suffices)
{
    Serial.reply(adu({1, 1, 3, 1, 2, 3}));
    assert_int_equal(node.readCoils(0, 17), 0);
    Serial.reply(adu({1, 2, 1, 1}));
    assert_int_equal(node.readDiscreteInputs(0, 8), 0);
    Serial.reply(adu({1, 4, 2, 1, 2}));
    assert_int_equal(node.readInputRegisters(0, 1), 0);
    Serial.reply(adu({1, 5, 0, 1, 0, 0}));
    assert_int_equal(node.writeSingleCoil(1, 0), 0);
    Serial.reply(adu({1, 6, 0, 1, 0, 2}));
    assert_int_equal(node.writeSingleRegister(1, 2), 0);
    Serial.reply(adu({1, 15, 0, 0, 4, 0}));
    assert_int_equal(node.writeMultipleCoils(0, 1024), 0);
    Serial.reply(adu({1, 16, 0, 0, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(0, 1), 0);
    Serial.reply(adu({1, 22, 0, 1, 0, 2, 0, 3}));
    assert_int_equal(node.maskWriteRegister(1, 2, 3), 0);
    Serial.reply(adu({1, 23, 2, 0, 1}));
    assert_int_equal(node.readWriteMultipleRegisters(0, 1, 0, 64), 0);
    node.beginTransmission(0);
    for (int i = 0; i < 64; i++)
        assert_int_equal(node.send(i), 0);
    Serial.reply(adu({1, 16, 0, 0, 0, 64}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    node.beginTransmission(0);
    assert_int_equal(node.sendBit(true), 0);
    Serial.reply(adu({1, 15, 0, 0, 0, 1}));
    assert_int_equal(node.writeMultipleCoils(), 0);
    node.beginTransmission(0);
    assert_int_equal(node.send(7), 0);
    Serial.reply(adu({1, 23, 2, 0, 1}));
    assert_int_equal(node.readWriteMultipleRegisters(0, 1), 0);
    Serial.reply(adu({1, 3, 2, 0, 9}));
    assert_int_equal(node.requestFrom(0, 1), 1);
    assert_int_equal(node.receive(), 9);
}

MASTER_TEST(reads_of_65_registers_are_sent)
{
    node.setResponseTimeout(300);
    for (int quantity : {65, 66, 125}) {
        Serial.reply(adu({1, 0x83, 2}));
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(quantity)), 2);
        assert_sent(Serial, {1, 3, 0, 0, 0, quantity});

        Bytes reply = raw({1, 3, quantity * 2});
        reply.resize(3 + static_cast<size_t>(quantity) * 2, 0xEE);
        Serial.reply(sealed(reply));
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(quantity)),
                         ModbusMaster::ku8MBBufferTooSmall);
        assert_int_equal(node.getResponseBuffer(0), 0);
        Serial.sent.clear();
    }
}

MASTER_TEST(writes_of_more_than_the_buffer_send_nothing)
{
    assert_int_equal(node.writeMultipleRegisters(0, 65), 3);
    assert_int_equal(node.writeMultipleCoils(0, 64 * 16 + 1), 3);
    assert_int_equal(node.readWriteMultipleRegisters(0, 1, 0, 65), 3);
    assert_int_equal(Serial.sent.size(), 0);
}

/* Until here the frame lies on the stack. The next test keeps it for all later ones. */

MASTER_TEST(a_lenient_read_of_65_to_125_registers_delivers_64)
{
    for (int quantity : {64, 65, 66, 100, 125}) {
        node.clearResponseBuffer();
        node.setLenient(true);
        Serial.reply(registers_of_unit_1(quantity));
        assert_int_equal(node.readHoldingRegisters(0, static_cast<uint16_t>(quantity)), 0);
        assert_int_equal(node.available(), 64);
        for (int i = 0; i < 64; i++)
            assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(i)), i + 1);
    }
    node.setLenient(false);
    Serial.reply(registers_of_unit_1(65));
    assert_int_equal(node.readHoldingRegisters(0, 65), ModbusMaster::ku8MBBufferTooSmall);
}

TEST(a_lenient_object_leaves_others_that_share_its_frame_unchanged)
{
    ModbusMaster lenient, strict;
    lenient.begin(1, Serial);
    strict.begin(2, Serial);
    lenient.setLenient(true);
    lenient.setResponseTimeout(50);
    for (int i = 0; i < 3; i++) {
        Serial.reply(adu({1, 3, 4, 0, 7, 0, i}));
        assert_int_equal(lenient.readHoldingRegisters(0, 1), 0);
        assert_int_equal(lenient.getResponseBuffer(1), i);
        Serial.reply(adu({2, 3, 2, 0x55, 0x55}));
        assert_int_equal(strict.readHoldingRegisters(0, 1), 0);
        assert_int_equal(strict.getResponseBuffer(0), 0x5555);
    }
}

TEST(a_request_is_refused_while_another_object_uses_the_frame)
{
    ModbusMaster first, second;
    first.begin(1, Serial);
    second.begin(2, Serial);
    first.setBlocking(false);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(first.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    assert_int_equal(second.readHoldingRegisters(0, 1), ModbusMaster::ku8MBBusy);
    assert_int_equal(second.requestFrom(0, 1), 0);
    assert_int_equal(second.status(), 0);
    while (first.poll() == ModbusMaster::ku8MBPending)
        board().now += 100;
    assert_int_equal(first.status(), 0);
    assert_int_equal(first.getResponseBuffer(0), 7);
    Serial.reply(adu({2, 3, 2, 0, 8}));
    assert_int_equal(second.readHoldingRegisters(0, 1), 0);
    assert_int_equal(second.getResponseBuffer(0), 8);
}

static ModbusMaster *other;
static uint8_t answers[3];

TEST(a_request_from_a_callback_of_another_object_is_refused)
{
    ModbusMaster first, second;
    first.begin(1, Serial);
    second.begin(2, Serial);
    other = &second;
    first.preTransmission([] { answers[0] = other->readHoldingRegisters(0, 1); });
    first.postTransmission([] { answers[1] = other->readHoldingRegisters(0, 1); });
    first.idle([] { answers[2] = other->readHoldingRegisters(0, 1); });
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(first.readHoldingRegisters(0, 1), 0);
    assert_int_equal(first.getResponseBuffer(0), 7);
    for (uint8_t answer : answers)
        assert_int_equal(answer, ModbusMaster::ku8MBBusy);
}

TEST(a_destroyed_object_frees_the_shared_frame)
{
    ModbusMaster second;
    second.begin(2, Serial);
    {
        ModbusMaster first;
        first.begin(1, Serial);
        first.setBlocking(false);
        assert_int_equal(first.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    }
    Serial.reply(adu({2, 3, 2, 0, 8}));
    assert_int_equal(second.readHoldingRegisters(0, 1), 0);
}

/* Overwrites the stack that other functions have used. */
static void use_the_stack()
{
    volatile uint8_t bytes[2048];
    for (volatile uint8_t &byte : bytes)
        byte = 0x5A;
}

MASTER_TEST(a_request_that_outlives_its_function_keeps_its_frame)
{
    Serial.reply(adu({1, 3, 2, 0, 6}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    node.setBlocking(false);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    do {
        use_the_stack();
        board().now += 100;
    } while (node.poll() == ModbusMaster::ku8MBPending);
    assert_int_equal(node.status(), 0);
    assert_int_equal(node.getResponseBuffer(0), 7);
    Serial.sent.clear();
    node.setBlocking(true);
    use_the_stack();
    node.cancel();
    Serial.reply(adu({1, 3, 2, 0, 8}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_sent(Serial, {1, 3, 0, 0, 0, 1});
}

static ModbusMaster *own;

MASTER_TEST(an_idle_callback_may_cancel_and_make_another_request)
{
    own = &node;
    node.idle([] {
        own->idle(nullptr);
        own->cancel();
        use_the_stack();
        answers[0] = own->readHoldingRegisters(0, 2);
    });
    Serial.reply({});
    Serial.reply(adu({1, 3, 4, 0, 7, 0, 8}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(answers[0], 0);
    assert_int_equal(node.getResponseBuffer(1), 8);
}
