/**
 * @file ModbusTcpServer.h
 * @brief A Modbus TCP server for Arduino sketches, over an Ethernet or WiFi library.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap. Register tables and
 * functions as with ModbusServer; several servers may serve the same tables.
 *
 *     EthernetServer ethernet(502);
 *     ModbusRegisterArray<2> readings;
 *     ModbusTcpServer<EthernetServer> server;
 *
 *     void setup() {
 *       Ethernet.begin(mac);
 *       ethernet.begin();
 *       server.inputRegisters(readings);
 *       server.begin(1, ethernet);
 *     }
 *     void loop() {
 *       readings[0] = analogRead(A0);
 *       server.poll();
 *     }
 *
 * Macros that may be defined before this file is included, the same in every file
 * of a program:
 * - MODBUSSERVER_CONNECTIONS  the connections of a server without that template
 *   argument, 1 to 16; 4, on AVR boards of at most 2.5 KB of RAM 2. Each
 *   takes a frame buffer of 260 bytes and about 80 more on AVR, 105 elsewhere.
 * - MODBUSSERVER_IDLE_MS  milliseconds without a request after which a connection may be
 *   closed for another client; 60000.
 */

#ifndef MODBUSTCPSERVER_H
#define MODBUSTCPSERVER_H

#include <stddef.h>
#include <stdint.h>

#include "ModbusServer.h"
#include "ModbusTcpConnections.h"
#include "mbm/server.h"

/** The server of one connection. Used by ModbusTcpServer. */
struct ModbusTcpServed {
    /** @cond for ModbusTcpServer */
    mbm_server server;
    uint8_t frame[MBM_MAX_TCP_FRAME];
    /** @endcond */
};

/**
 * A Modbus TCP server with up to `Connections` clients at once, as one unit or several.
 *
 * `Listener` is the library's server class: EthernetServer, WiFiServer or another with
 * accept() or available(). If all connections are taken, the server closes the one that
 * has been idle longest, if it has been idle for MODBUSSERVER_IDLE_MS, and accepts the new
 * one; else it closes the new one. Requests for unit 0 and 255 are for the first unit.
 *
 * Call poll in loop. Use an object from one thread, never from an interrupt.
 */
template <typename Listener, uint8_t Connections = MODBUSSERVER_CONNECTIONS>
class ModbusTcpServer
    : public ModbusUnit,
      public ModbusTcpConnections<ModbusTcpServer<Listener, Connections>, Listener, Connections,
                                  ModbusTcpServed> {
public:
    /** Uses neither clock nor network. */
    ModbusTcpServer() : first(), count() {}

    /**
     * Answers the clients of a listener as unit `id`. The sketch calls the listener's begin,
     * before or after. The unit keeps its tables and functions. Closes all connections.
     *
     * @param id        1 to 247; requests for 0 and 255 are for this unit too
     * @param listener  must outlive its use here
     * @return MBM_OK; or with nothing changed MBM_BUSY from within a hook or function of
     *         this server, MBM_INVALID_ARGUMENT for a unit id above 255
     */
    uint8_t begin(uint16_t id, Listener &listener)
    {
        const uint16_t before = setID(id);
        return keepID(before, serve(*this, 1, listener));
    }
    /** As begin, for all units of an array, which answer instead of this one. */
    template <size_t N> uint8_t begin(ModbusUnit (&units)[N], Listener &listener)
    {
        static_assert(N <= 247, "a server has 247 units");
        return serve(units[0], N, listener);
    }

    /**
     * Accepts a new connection. For each connection it receives bytes, executes a complete
     * request and sends the response. Closes a connection that the client has closed, or whose
     * bytes are not Modbus TCP.
     *
     * @return MBM_OK; MBM_NOT_INITIALISED before begin; MBM_BUSY from within a hook or
     *         function of this server
     */
    uint8_t poll() { return this->pollAll(); }

private:
    template <typename, typename, uint8_t, typename> friend class ModbusTcpConnections;

    ModbusUnit *first;
    uint8_t count;

    uint8_t serve(ModbusUnit &units, uint8_t quantity, Listener &listener)
    {
        if (this->polling)
            return MBM_BUSY;
        for (uint8_t i = 0; i < quantity; i++)
            if ((&units)[i].unit.id > 255)
                return MBM_INVALID_ARGUMENT;
        first = &units;
        count = quantity;
        this->listen(listener);
        return MBM_OK;
    }

    bool opened(uint8_t, const mbm_port &port, ModbusTcpServed &place)
    {
        place.server = mbm_server();
        return mbm_server_beginTcp(&place.server, &port, &first->unit, count, place.frame,
                                   MBM_MAX_TCP_FRAME) == MBM_OK;
    }
    bool serve(uint8_t, ModbusTcpServed &place)
    {
        const uint8_t status = mbm_server_poll(&place.server);
        return status != MBM_LINK_LOST && status != MBM_MALFORMED_FRAME;
    }
    void closed(uint8_t) {}
};

#endif
