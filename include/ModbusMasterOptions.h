/**
 * @file ModbusMasterOptions.h
 * @brief The macros of ModbusMaster that a sketch may define, and their defaults.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 *
 * Macros that may be defined before ModbusMaster.h is included, the same in
 * every file of a program:
 * - MODBUSMASTER_RESPONSE_WORDS  words that a read fills, 1 to 125; 64 on AVR,
 *   else 125. A longer read returns ku8MBBufferTooSmall.
 * - MODBUSMASTER_TRANSMIT_WORDS  words that a write sends, 2 to 123; 64 on AVR,
 *   else 123. A longer write returns ku8MBIllegalDataValue.
 * - MODBUSMASTER_SHARE_LINE  one line for all objects, with one set of settings, and no frame
 *   buffer: while a function waits, the frame is on its stack. It is defined on AVR boards of
 *   at most 2.5 KB of RAM. A request while another object's request is pending returns
 *   ku8MBBusy. Only four settings belong to one object: the response timeout, setLenient,
 *   setBlocking and setWordOrder. Do not define it if several threads use objects.
 * - MODBUSMASTER_OWN_LINES  a line and a frame buffer in each object on those boards too, so that
 *   several objects may have a pending request at the same time, and have their own settings.
 * - MODBUSMASTER_SERIAL0 to MODBUSMASTER_SERIAL3  the UARTs that begin(baud) opens, if
 *   the core does not say which UARTs the board has.
 * - MODBUSMASTER_YIELD()  is called while a function waits; yield() if the core has it.
 * - __MODBUSMASTER_DEBUG__  1: pin __MODBUSMASTER_DEBUG_PIN_A__ (4) is high while a byte
 *   is read, pin __MODBUSMASTER_DEBUG_PIN_B__ (5) while an idle callback runs. The sketch
 *   makes them outputs.
 */

#ifndef MODBUSMASTER_OPTIONS_H
#define MODBUSMASTER_OPTIONS_H

/** @cond explained above */
#if !defined(MODBUSMASTER_RESPONSE_WORDS)
#if defined(__AVR__)
#define MODBUSMASTER_RESPONSE_WORDS 64
#else
#define MODBUSMASTER_RESPONSE_WORDS 125
#endif
#endif

#if !defined(MODBUSMASTER_TRANSMIT_WORDS)
#if defined(__AVR__)
#define MODBUSMASTER_TRANSMIT_WORDS 64
#else
#define MODBUSMASTER_TRANSMIT_WORDS 123
#endif
#endif

// The Uno has 2 KB of RAM, the Leonardo 2.5.
#if defined(RAMEND) && RAMEND < 0x0B00 && !defined(MODBUSMASTER_OWN_LINES)
#undef MODBUSMASTER_SHARE_LINE
#define MODBUSMASTER_SHARE_LINE
#endif

// With NO_GLOBAL_* the core defines no ports; the sketch defines them.
#if !defined(MODBUSMASTER_SERIAL0) && !defined(NO_GLOBAL_INSTANCES) && !defined(NO_GLOBAL_SERIAL)
#define MODBUSMASTER_SERIAL0 Serial
#endif
#if !defined(MODBUSMASTER_SERIAL1) && (defined(HAVE_HWSERIAL1) || defined(UBRR1H))
#define MODBUSMASTER_SERIAL1 Serial1
#endif
#if !defined(MODBUSMASTER_SERIAL2) && (defined(HAVE_HWSERIAL2) || defined(UBRR2H))
#define MODBUSMASTER_SERIAL2 Serial2
#endif
#if !defined(MODBUSMASTER_SERIAL3) && (defined(HAVE_HWSERIAL3) || defined(UBRR3H))
#define MODBUSMASTER_SERIAL3 Serial3
#endif

#if !defined(MODBUSMASTER_YIELD)
#if defined(ESP8266) || defined(ESP32) || (defined(ARDUINO) && ARDUINO >= 10600)
#define MODBUSMASTER_YIELD() yield()
#else
#define MODBUSMASTER_YIELD() static_cast<void>(0)
#endif
#endif

#if !defined(__MODBUSMASTER_DEBUG__)
#define __MODBUSMASTER_DEBUG__ (0)
#endif
#if !defined(__MODBUSMASTER_DEBUG_PIN_A__)
#define __MODBUSMASTER_DEBUG_PIN_A__ 4
#endif
#if !defined(__MODBUSMASTER_DEBUG_PIN_B__)
#define __MODBUSMASTER_DEBUG_PIN_B__ 5
#endif
#if __MODBUSMASTER_DEBUG__
#define MODBUSMASTER_DEBUG(pin, level) digitalWrite(__MODBUSMASTER_DEBUG_PIN_##pin##__, level)
#else
#define MODBUSMASTER_DEBUG(pin, level) static_cast<void>(0)
#endif
/** @endcond */

#endif
