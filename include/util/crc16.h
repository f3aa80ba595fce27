/**
 * @file crc16.h
 * @brief crc16_update, for sketches that include util/crc16.h for it.
 *
 * Licence: MIT OR Apache-2.0. avr-libc has a header of this name. If it is present,
 * this header includes it too; so the guard here is not avr-libc's _UTIL_CRC16_H_.
 */

#ifndef MODBUSMASTER_UTIL_CRC16_H
#define MODBUSMASTER_UTIL_CRC16_H

// Prevents the warning of pedantic compilers about include_next.
#if defined(__GNUC__)
#pragma GCC system_header
#endif

#if defined(__AVR__)
#include_next <util/crc16.h>
#elif defined(__has_include_next)
#if __has_include_next(<util/crc16.h>)
#include_next <util/crc16.h>
#endif
#endif

// A C file of another library needs avr-libc's header only.
#if defined(__cplusplus)
#include "../ModbusMasterHelpers.h"
#endif

#endif
