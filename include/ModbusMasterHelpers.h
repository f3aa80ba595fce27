/**
 * @file ModbusMasterHelpers.h
 * @brief The functions that sketches use beside the class ModbusMaster.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h, util/crc16.h and util/word.h.
 * Arduino.h has lowByte, highByte and word.
 */

#ifndef MODBUSMASTER_HELPERS_H
#define MODBUSMASTER_HELPERS_H

#include <Arduino.h>
#include <stdint.h>

/**
 * The CRC of a Modbus RTU frame with one more byte (serial line guide 6.2.2). Starts with
 * 0xFFFF; of the result the low byte is sent first.
 */
inline uint16_t crc16_update(uint16_t crc, uint8_t value)
{
    unsigned rest = crc;
    rest ^= value;
    for (uint8_t bit = 0; bit < 8; bit++)
        rest = (rest & 1u) != 0 ? rest >> 1 ^ 0xA001u : rest >> 1;
    return rest & 0xFFFFu;
}

// Templates, so that a core's own functions of these names do not clash.
#if !defined(lowWord)
/** The low 16 bits of a 32-bit value. */
template <typename Value> constexpr uint16_t lowWord(Value value)
{
    return static_cast<uint16_t>(static_cast<uint32_t>(value) & 0xFFFFu);
}
#endif
#if !defined(highWord)
/** The high 16 bits of a 32-bit value. */
template <typename Value> constexpr uint16_t highWord(Value value)
{
    return static_cast<uint16_t>(static_cast<uint32_t>(value) >> 16);
}
#endif
// A macro, so that a type of this name (FatFs has one) does not clash.
#if !defined(LONG)
/** The 32-bit value of two words. */
#define LONG(hi, lo) \
    (static_cast<uint32_t>(static_cast<uint16_t>(hi)) << 16 | static_cast<uint16_t>(lo))
#endif

#endif
