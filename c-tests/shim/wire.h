/* What the tests of the sketch classes share: frames, checks of sent bytes, the setup. */
#ifndef WIRE_H
#define WIRE_H

#include "ModbusMaster.h"

extern "C" {
#include "crc.h"
#include "test.h"
}

#include <initializer_list>

typedef HardwareSerial::Bytes Bytes;

inline Bytes raw(std::initializer_list<int> values)
{
    Bytes bytes;
    for (int value : values)
        bytes.push_back(static_cast<uint8_t>(value));
    return bytes;
}

/* Appends the CRC to the bytes. */
inline Bytes sealed(Bytes bytes)
{
    size_t length = bytes.size();
    bytes.resize(length + 2);
    seal(bytes.data(), length);
    return bytes;
}

/* Returns a frame: these bytes and their CRC. */
inline Bytes adu(std::initializer_list<int> values)
{
    return sealed(raw(values));
}

inline Bytes joined(Bytes first, const Bytes &second)
{
    first.insert(first.end(), second.begin(), second.end());
    return first;
}

inline void assert_bytes(const Bytes &actual, const Bytes &expected)
{
    assert_int_equal(actual.size(), expected.size());
    assert_memory_equal(actual.data(), expected.data(), expected.size());
}

/* Expects that one frame was sent since the last call: these values and their CRC. */
inline void assert_sent(HardwareSerial &port, std::initializer_list<int> values)
{
    assert_int_equal(port.sent.size(), 1);
    assert_bytes(port.sent[0], adu(values));
    port.sent.clear();
}

/* A UART whose write returns 0 for a byte that it sends, like some variants of SoftwareSerial. */
class ZeroWriteSerial : public HardwareSerial {
public:
    size_t write(uint8_t value) override
    {
        HardwareSerial::write(value);
        return 0;
    }
    size_t write(const uint8_t *bytes, size_t length) override
    {
        return length > 0 ? write(bytes[0]) : 0;
    }
};

/* Sets the board to its state after a reset. */
inline void reset_board()
{
    board() = Board();
    pins() = Pins();
    for (unsigned i = 0; i < 4; i++)
        shimSerial(i).reset();
}

/* A test of an object, as `ModbusMaster node`, after a call of it, as `begin(1, Serial)`. */
#define TEST_OF(type, object, call, name)                                                          \
    static void with_##name(type &object);                                                         \
    TEST(name)                                                                                     \
    {                                                                                              \
        type object;                                                                               \
        object.call;                                                                               \
        with_##name(object);                                                                       \
    }                                                                                              \
    static void with_##name(type &object)
#define MASTER_TEST(name) TEST_OF(ModbusMaster, node, begin(1, Serial), name)

#endif
