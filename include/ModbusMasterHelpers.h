/**
 * @file ModbusMasterHelpers.h
 * @brief The functions of ModbusMaster 2.0.1 that are not members of its class.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h, util/crc16.h and util/word.h.
 * Arduino.h has lowByte, highByte and word.
 */

#ifndef MODBUSMASTER_HELPERS_H
#define MODBUSMASTER_HELPERS_H

#include <Arduino.h>
#include <stdint.h>

/**
 * The CRC of a Modbus RTU frame with one more byte (serial line guide 6.2.2). Start
 * with 0xFFFF. The low byte of the result is sent first.
 */
inline uint16_t crc16_update(uint16_t crc, uint8_t value)
{
    unsigned remainder = crc;
    remainder ^= value;
    for (uint8_t bit = 0; bit < 8; bit++)
        remainder = (remainder & 1u) != 0 ? remainder >> 1 ^ 0xA001u : remainder >> 1;
    return remainder & 0xFFFFu;
}

// Templates, so that they do not clash with functions of these names in a core.
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
// A macro, so that it does not clash with a type of this name, as FatFs has.
#if !defined(LONG)
/** The 32-bit value of two words. */
#define LONG(hi, lo) \
    (static_cast<uint32_t>(static_cast<uint16_t>(hi)) << 16 | static_cast<uint16_t>(lo))
#endif

#endif
