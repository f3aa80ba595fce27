/**
 * @file crc16.h
 * @brief crc16_update, for sketches that include util/crc16.h for it.
 *
 * Licence: MIT OR Apache-2.0. avr-libc has a header of this name; where there is one,
 * this header includes it too. Its guard is _UTIL_CRC16_H_, which is not taken here.
 */

#ifndef MODBUSMASTER_UTIL_CRC16_H
#define MODBUSMASTER_UTIL_CRC16_H

#if defined(__AVR__)
#include_next <util/crc16.h>
#elif defined(__has_include_next)
#if __has_include_next(<util/crc16.h>)
#include_next <util/crc16.h>
#endif
#endif

#include "../ModbusMasterHelpers.h"

#endif
