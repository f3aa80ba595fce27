/**
 * @file ModbusDriverPin.h
 * @brief The pins of an RS-485 transceiver, for the classes with a serial line.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusTransmission.h and ModbusSniffer.h.
 */

#ifndef MODBUSDRIVERPIN_H
#define MODBUSDRIVERPIN_H

#include <Arduino.h>
#include <stdint.h>

/** @cond private to the classes */
// A pin or two, and their levels while the transceiver sends, in the context of a callback: so an
// object has no memory for them.
struct ModbusDriverPin {
    // STM32duino has pins above 255, for example 0xC0 and alternatives of it.
#if defined(ARDUINO_ARCH_STM32)
    typedef uint16_t Pin;
#else
    typedef uint8_t Pin;
#endif
    // Half of a context, which is a pointer: two bytes on AVR.
#if defined(__AVR__)
    typedef uint8_t Half;
#else
    typedef uint16_t Half;
#endif
    enum : uint8_t { bits = 8 * sizeof(Half) };

    static uintptr_t of(Pin pin, bool isHigh)
    {
        return static_cast<uintptr_t>(static_cast<Half>(pin << 1 | (isHigh ? 1 : 0)));
    }
    static void *contextOf(uintptr_t first, uintptr_t second = 0)
    {
        return reinterpret_cast<void *>(second << bits | first);
    }

    static Pin number(uintptr_t pins) { return static_cast<Pin>(static_cast<Half>(pins) >> 1); }

    // Sets a pin as for sending or as for receiving.
    static void set(uintptr_t pins, bool isSending)
    {
        digitalWrite(number(pins), ((pins & 1) != 0) == isSending ? HIGH : LOW);
    }
    // Makes a pin an output that receives. The level comes first where the core allows that, so
    // that the driver does not go on for a moment.
    static void begin(uintptr_t pins)
    {
        set(pins, false);
        pinMode(number(pins), OUTPUT);
        set(pins, false);
    }

    static void send(void *context) { set(reinterpret_cast<uintptr_t>(context), true); }
    static void receive(void *context) { set(reinterpret_cast<uintptr_t>(context), false); }
    // The receiver goes off first and on last.
    static void sendTwo(void *context)
    {
        set(reinterpret_cast<uintptr_t>(context) >> bits, true);
        send(context);
    }
    static void receiveTwo(void *context)
    {
        receive(context);
        set(reinterpret_cast<uintptr_t>(context) >> bits, false);
    }
};
/** @endcond */

#endif
