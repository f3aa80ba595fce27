/**
 * @file ModbusMasterUart.h
 * @brief The silence before a request on a UART of an AVR.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_UART_H
#define MODBUSMASTER_UART_H

#include <Arduino.h>
#include <stdint.h>

/** @cond private to ModbusMaster */
// Cores for AVRs with these registers have the class HardwareSerial, whose objects point to them.
#if defined(__AVR__) && defined(HardwareSerial_h) &&                                               \
    (defined(UBRRH) || defined(UBRR0H) || defined(UBRR1H))
#define MODBUSMASTER_UART HardwareSerial

// Only derived classes reach the members of a port that point to its registers. There is no object
// of this class. Times are in steps of 4 microseconds, those of the core's clock.
template <typename Port> class ModbusMasterUart : Port {
public:
    // The silence while the rate is not known: that of a line without a baud rate.
    static const uint16_t unknown = 4000 / 4;

    // t3.5 at the rate that the UART has now, at least 1750 us.
    static uint16_t silenceOf(const Port &port)
    {
        return silence(static_cast<const ModbusMasterUart *>(nullptr), port);
    }

private:
    static const uint16_t least = (1750 + 3) / 4;
    // 3.5 characters of 11 bits, and half a bit, since a UART has received a byte in the middle of
    // its stop bit. A bit lasts 8 cycles for each unit of the divider.
    static const uint32_t cycles = 8UL * 39;
    static const uint16_t perDivider = (cycles * 1000 / 4 + F_CPU / 1000 - 1) / (F_CPU / 1000);
    static const uint16_t mostDivider = 0xFFFF / perDivider;
    static const uint8_t doublesSpeed = 1 << 1; // the bit U2X of every UART

    template <typename Uart>
    static auto silence(const Uart *, const Port &port)
        -> decltype(static_cast<uint16_t>(*(port.*(&Uart::_ubrrh)) + *(port.*(&Uart::_ubrrl)) +
                                          *(port.*(&Uart::_ucsra))))
    {
        const uint8_t high = *(port.*(&Uart::_ubrrh)), low = *(port.*(&Uart::_ubrrl));
        uint16_t divider = static_cast<uint16_t>(high << 8 | low) + 1u;
        if ((*(port.*(&Uart::_ucsra)) & doublesSpeed) == 0)
            divider *= 2;
        if (mostDivider < 2 * 4096 && divider > mostDivider)
            divider = mostDivider;
        const uint16_t time = divider * perDivider;
        return time > least ? time : +least;
    }
    // The core keeps its registers elsewhere.
    static uint16_t silence(const void *, const Port &) { return unknown; }
};
#endif
/** @endcond */

#endif
