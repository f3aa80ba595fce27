/**
 * @file word.h
 * @brief lowWord and highWord, for sketches that include util/word.h for them.
 *
 * Licence: MIT OR Apache-2.0.
 */

#ifndef MODBUSMASTER_UTIL_WORD_H
#define MODBUSMASTER_UTIL_WORD_H

#if defined(__cplusplus)
#include "../ModbusMasterHelpers.h"
#endif

#endif
