/* Parts of ModbusMaster 2.0.1 that sketches use besides the members of its class: its other
 * headers, their functions, its guard, its debug pins, and Streams whose write returns 0. */
#define __MODBUSMASTER_DEBUG__ 1
#include "util/crc16.h"
#include "util/word.h"
#include "wire.h"

fixture each_test = {reset_board, nullptr};

#if !defined(ModbusMaster_h)
#error "the original's guard is not defined"
#endif
#if defined(_UTIL_CRC16_H_) || defined(_UTIL_WORD_H_)
#error "the guard of avr-libc's <util/crc16.h> is taken"
#endif

TEST(crc16_update_computes_the_crc_of_a_frame)
{
    const Bytes frame = adu({0x01, 0x42, 0x80, 0x11, 0xFF});
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i + 2 < frame.size(); i++)
        crc = crc16_update(crc, frame[i]);
    assert_int_equal(lowByte(crc), frame[frame.size() - 2]);
    assert_int_equal(highByte(crc), frame[frame.size() - 1]);
    /* "123456789", the check value of CRC-16/MODBUS */
    crc = 0xFFFF;
    for (int digit = '1'; digit <= '9'; digit++)
        crc = crc16_update(crc, static_cast<uint8_t>(digit));
    assert_int_equal(crc, 0x4B37);
}

TEST(the_helpers_split_and_join_words)
{
    assert_int_equal(lowWord(0x12345678), 0x5678);
    assert_int_equal(highWord(0x12345678), 0x1234);
    assert_int_equal(LONG(0x1234, 0x5678), 0x12345678);
}

TEST(members_have_the_originals_types)
{
    typedef uint8_t (ModbusMaster::*Read)(uint16_t, uint16_t);
    uint8_t (ModbusMaster::*original)(uint16_t, uint8_t) = &ModbusMaster::readInputRegisters;
    const Read reads[] = {&ModbusMaster::readCoils, &ModbusMaster::readDiscreteInputs,
                          &ModbusMaster::readHoldingRegisters, &ModbusMaster::readInputRegisters};
    const uint8_t one = 1;
    ModbusMaster node;
    node.begin(1, Serial);
    node.setResponseTimeout(1);
    for (Read read : reads)
        assert_int_equal((node.*read)(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    Serial.sent.clear();
    node.setResponseTimeout(100);
    Serial.reply(adu({1, 4, 2, 0, 7}));
    assert_int_equal((node.*original)(0x102, one), 0);
    assert_sent(Serial, {1, 4, 1, 2, 0, 1});
    Serial.reply(adu({1, 4, 2, 0, 7}));
    assert_int_equal(node.readInputRegisters(0x102, one), 0);
    assert_sent(Serial, {1, 4, 1, 2, 0, 1});
    assert_int_equal(node.readInputRegisters(0, 258), ModbusMaster::ku8MBIllegalDataValue);
}

/* Found in sketches: a class that hides begin and getSlaveID, and a function that takes the object
 * by value and has its constants as labels. */
class Meter : public ModbusMaster {
public:
    Meter() : slave(0) {}
    void begin(uint8_t which, Stream &stream)
    {
        slave = which;
        ModbusMaster::begin(which, stream);
    }
    uint8_t getSlaveID() const { return slave; }

private:
    uint8_t slave;
};

// NOLINTNEXTLINE(performance-unnecessary-value-param): found sketches pass a copy
static const char *said(ModbusMaster node, uint8_t result)
{
    switch (result) {
    case node.ku8MBSuccess: return "success";
    case node.ku8MBResponseTimedOut: return "late";
    default: return "failure";
    }
}

TEST(a_class_of_a_sketch_derives_from_the_class)
{
    Meter meters[2];
    meters[0].begin(4, Serial);
    meters[1].begin(9, Serial);
    meters[0].setResponseTimeout(1);
    assert_string_equal(said(meters[0], meters[0].readInputRegisters(0, 1)), "late");
    assert_sent(Serial, {4, 4, 0, 0, 0, 1});
    assert_int_equal(meters[1].getSlaveID(), 9);
    Serial.reply(adu({9, 4, 2, 0, 7}));
    assert_string_equal(said(meters[1], meters[1].readInputRegisters(0, 1)), "success");
    assert_int_equal(meters[1].getResponseBuffer(0), 7);
}

TEST(the_debug_pins_show_reads_and_idle_calls)
{
    static unsigned idles;
    ModbusMaster node;
    idles = 0;
    pins() = Pins();
    node.begin(1, Serial);
    node.idle([] { idles++; });
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_true(pins().rises[__MODBUSMASTER_DEBUG_PIN_A__] >= 7);
    assert_int_equal(pins().rises[__MODBUSMASTER_DEBUG_PIN_B__], idles & 0xFF);
    assert_true(idles > 0);
}

/* Accepts every byte and returns 0. */
class Uncounted : public Stream {
public:
    Bytes sent;
    int available() override { return Serial.available(); }
    int read() override { return Serial.read(); }
    int peek() override { return Serial.peek(); }
    size_t write(uint8_t value) override
    {
        sent.push_back(value);
        return 0;
    }
    void flush() override { Serial.flush(); }
};

TEST(a_stream_that_returns_no_count_sends_each_request_once)
{
    Uncounted stream;
    ModbusMaster node;
    node.begin(1, stream);
    for (int i = 0; i < 3; i++) {
        node.begin(1, stream);
        Serial.reply(adu({1, 3, 2, 0, i}));
        assert_int_equal(node.readHoldingRegisters(0, 1), 0);
        assert_int_equal(node.getResponseBuffer(0), i);
        assert_bytes(stream.sent, adu({1, 3, 0, 0, 0, 1}));
        stream.sent.clear();
    }
}

TEST(a_stream_that_returns_no_count_sends_the_longest_request)
{
    const uint16_t words = 121; /* the longest request of function 17: 255 bytes */
    Bytes request = raw({1, 0x17, 0, 0, 0, 1, 0, 0, 0, words, 2 * words});
    Uncounted stream;
    ModbusMaster node;
    node.begin(1, stream);
    for (uint16_t i = 0; i < words; i++) {
        node.setTransmitBuffer(static_cast<uint8_t>(i), i);
        request.push_back(0);
        request.push_back(static_cast<uint8_t>(i));
    }
    Serial.reply(adu({1, 0x17, 2, 0, 7}));
    assert_int_equal(node.readWriteMultipleRegisters(0, 1, 0, words), 0);
    assert_bytes(stream.sent, sealed(request));
    assert_int_equal(stream.sent.size(), 255);
}

/* Accepts three bytes, then no byte for some time. Sets no write error. */
class Full : public Uncounted {
public:
    int space = 3;
    size_t write(uint8_t value) override
    {
        if (space-- <= 0) {
            space = space < -5 ? 3 : space;
            return 0;
        }
        sent.push_back(value);
        return 1;
    }
};

TEST(a_full_buffer_is_distinguished_from_a_stream_that_returns_no_count)
{
    Full stream;
    Uncounted other;
    ModbusMaster node;
    for (int i = 0; i < 3; i++) {
        node.begin(1, stream); /* the object remembers that this Stream returns counts */
        stream.sent.clear();
        Serial.reply(adu({1, 3, 2, 0, i}));
        assert_int_equal(node.readHoldingRegisters(0, 1), 0);
        assert_bytes(stream.sent, adu({1, 3, 0, 0, 0, 1}));
        stream.space = 0; /* from the second request on the Stream accepts no first byte either */
    }
    node.begin(1, other);
    Serial.reply(adu({1, 3, 2, 0, 9}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_bytes(other.sent, adu({1, 3, 0, 0, 0, 1}));
}

/* Sets its write error, like Arduino's USB port without a host and SoftwareSerial at a baud rate
 * that it does not support. */
class Refusing : public Uncounted {
public:
    size_t write(uint8_t) override
    {
        setWriteError();
        return 0;
    }
};

TEST(a_write_error_means_that_no_byte_was_accepted)
{
    Refusing stream;
    ModbusMaster node;
    node.begin(1, stream);
    node.setResponseTimeout(100);
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBLineBusy);
}
