/**
 * @file ModbusMasterPorts.h
 * @brief The UARTs that ModbusMaster::begin(baud) opens.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_PORTS_H
#define MODBUSMASTER_PORTS_H

#include <Arduino.h>
#include <stdint.h>

#include "ModbusMasterOptions.h"

/** @cond a function that is always inlined */
#define MODBUSMASTER_INLINE __attribute__((always_inline)) inline
/** @endcond */

/**
 * Opens UARTs 1 to 3. A UART that a program refers to takes RAM for its buffers, 157 bytes
 * on a Mega. So the constructor with a port number refers to the UART of that number only,
 * and begin(baud) to none of the three. It is a template, because in C++11 only a
 * template's static members can be defined in a header.
 */
template <typename Unused> class ModbusMasterPorts {
public:
    /** Lets open(port, baud) open UART `port`, if the board has it. */
    MODBUSMASTER_INLINE static void use(uint8_t port)
    {
#if defined(MODBUSMASTER_SERIAL1)
        if (port == 1)
            openers[0] = open1;
#endif
#if defined(MODBUSMASTER_SERIAL2)
        if (port == 2)
            openers[1] = open2;
#endif
#if defined(MODBUSMASTER_SERIAL3)
        if (port == 3)
            openers[2] = open3;
#endif
        static_cast<void>(port);
    }

    /** Opens UART `port` and returns it; nullptr if use(port) was not called. */
    static Stream *open(uint8_t port, uint32_t baud)
    {
        if (port < 1 || port > 3 || openers[port - 1] == nullptr)
            return nullptr;
        return openers[port - 1](baud);
    }

private:
    typedef Stream *(*Opener)(uint32_t baud);
    static Opener openers[3];

    template <typename Port> static Stream *opened(Port &port, uint32_t baud)
    {
        port.begin(baud);
        return &port;
    }
#if defined(MODBUSMASTER_SERIAL1)
    static Stream *open1(uint32_t baud) { return opened(MODBUSMASTER_SERIAL1, baud); }
#endif
#if defined(MODBUSMASTER_SERIAL2)
    static Stream *open2(uint32_t baud) { return opened(MODBUSMASTER_SERIAL2, baud); }
#endif
#if defined(MODBUSMASTER_SERIAL3)
    static Stream *open3(uint32_t baud) { return opened(MODBUSMASTER_SERIAL3, baud); }
#endif
};

/** @cond the definition of the static member */
template <typename Unused>
typename ModbusMasterPorts<Unused>::Opener ModbusMasterPorts<Unused>::openers[3] = {};
/** @endcond */

#endif
