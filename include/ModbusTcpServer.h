/**
 * @file ModbusTcpServer.h
 * @brief A Modbus TCP server for Arduino sketches, over an Ethernet or WiFi library.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap. What it serves is set as
 * with ModbusServer; several servers may serve the same tables.
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
 * Macros that may be defined before this file is included, alike in every file of a
 * program:
 * - MODBUSSERVER_CONNECTIONS  how many connections a server keeps where its template
 *   argument does not say so, 1 to 16; 4, on AVR boards of at most 2.5 KB of RAM 2. Each
 *   takes a frame buffer of 260 bytes and about 75 more on AVR, 110 elsewhere.
 * - MODBUSSERVER_IDLE_MS  milliseconds without a request after which a connection may be
 *   closed for another client; 60000.
 */

#ifndef MODBUSTCPSERVER_H
#define MODBUSTCPSERVER_H

#include <Arduino.h>
#include <stddef.h>
#include <stdint.h>

#include "ModbusServer.h"
#include "mbm.h"

/** @cond the macros are explained at the head of the file */
#if !defined(MODBUSSERVER_CONNECTIONS)
#if defined(RAMEND) && RAMEND < 0x0B00
#define MODBUSSERVER_CONNECTIONS 2
#else
#define MODBUSSERVER_CONNECTIONS 4
#endif
#endif
#if !defined(MODBUSSERVER_IDLE_MS)
#define MODBUSSERVER_IDLE_MS 60000
#endif
/** @endcond */

/**
 * A Modbus TCP server with up to `Connections` clients at once, as one unit or several.
 *
 * `Listener` is the library's server class: EthernetServer, WiFiServer or another with
 * accept() or available(). Where every place is taken, a new client gets that of the
 * connection that has been idle for longest, if for MODBUSSERVER_IDLE_MS at least; else
 * its connection is closed. Requests for unit 0 and 255 are for the first unit.
 *
 * Call poll in loop. Use an object from one thread, never from an interrupt.
 */
template <typename Listener, uint8_t Connections = MODBUSSERVER_CONNECTIONS>
class ModbusTcpServer : public ModbusUnit {
public:
    /** Touches neither clock nor network. */
    ModbusTcpServer() : listener(), first(), count(), places() {}

    /**
     * Answers as unit `id` (1 to 247) to the clients of a listener, whose begin the sketch
     * has called or will. What is served stays. Closes the connections that there are.
     *
     * @param id      the unit; where clients ask for 0 or 255, it is meant too
     * @param server  must outlive its use here
     * @return MBM_OK; MBM_BUSY, with nothing changed, from within a hook or function of
     *         this server
     */
    uint8_t begin(uint8_t id, Listener &server)
    {
        const uint8_t status = listen(*this, 1, server);
        if (status == MBM_OK)
            setUnitID(id);
        return status;
    }
    /** As begin, for all units of an array, which answer in place of this one. */
    template <size_t N> uint8_t begin(ModbusUnit (&units)[N], Listener &server)
    {
        static_assert(N <= 247, "a server has 247 units");
        return listen(units[0], N, server);
    }

    /**
     * Takes new connections, and moves each on: takes bytes in, carries a request out
     * once it is whole, sends the response. Closes a connection that the client has
     * closed, or that does not carry Modbus.
     *
     * @return MBM_OK; MBM_NOT_INITIALISED before begin; MBM_BUSY from within a hook or
     *         function of this server
     */
    uint8_t poll()
    {
        if (listener == nullptr)
            return MBM_NOT_INITIALISED;
        if (polling)
            return MBM_BUSY;
        polling = true;
        for (Place &place : places) {
            if (!place.taken)
                continue;
            const uint8_t status = mbm_server_poll(&place.server);
            if (status == MBM_LINK_LOST || status == MBM_MALFORMED_FRAME)
                close(place);
        }
        take(0);
        polling = false;
        return MBM_OK;
    }

    /** How many connections there are, 0 to `Connections`. */
    uint8_t connections() const
    {
        uint8_t taken = 0;
        for (const Place &place : places)
            taken = static_cast<uint8_t>(taken + place.taken);
        return taken;
    }

private:
    static_assert(Connections >= 1 && Connections <= 16, "a server keeps 1 to 16 connections");

    // The class of a connection. Never called.
    static Listener &someListener();
    typedef decltype(someListener().available()) Link;

    struct Place {
        Link link;
        uint32_t used; // milliseconds: when the last bytes were taken
        bool taken;
        mbm_server server;
        uint8_t frame[MBM_MAX_TCP_FRAME];
    };

    Listener *listener;
    ModbusUnit *first;
    uint8_t count;
    bool polling = false;
    Place places[Connections];

    uint8_t listen(ModbusUnit &units, uint8_t quantity, Listener &server)
    {
        if (polling)
            return MBM_BUSY;
        for (Place &place : places)
            if (place.taken)
                close(place);
        first = &units;
        count = quantity;
        listener = &server;
        return MBM_OK;
    }

    static uint32_t clock() { return millis() & 0xFFFFFFFFu; }

    static void close(Place &place)
    {
        place.link.stop();
        place.link = Link();
        place.taken = false;
    }

    // accept hands each connection over once. Where a library lacks it, available does
    // so, or hands over any connection from which bytes wait.
    template <typename Server> static auto next(Server &server, int) -> decltype(server.accept())
    {
        return server.accept();
    }
    template <typename Server>
    static auto next(Server &server, long) -> decltype(server.available())
    {
        return server.available();
    }
    template <typename Server>
    static auto known(Server &server, Place &, Link &, int) -> decltype(server.accept(), false)
    {
        return false;
    }
    template <typename Server> static bool known(Server &, Place &place, Link &link, long)
    {
        return place.taken && place.link.operator==(link);
    }

    void take(int order)
    {
        Link link = next(*listener, order);
        if (!link)
            return;
        const uint32_t now = clock();
        Place *chosen = nullptr;
        for (Place &place : places) {
            if (known(*listener, place, link, order))
                return;
            if (chosen == nullptr || (chosen->taken && !place.taken) ||
                (chosen->taken == place.taken && now - place.used > now - chosen->used))
                chosen = &place;
        }
        if (chosen->taken && now - chosen->used < MODBUSSERVER_IDLE_MS) {
            link.stop();
            return;
        }
        if (chosen->taken)
            close(*chosen);
        open(*chosen, link, now);
    }

    void open(Place &place, const Link &link, uint32_t now)
    {
        mbm_port port;
        port.context = &place;
        port.read = readHook;
        port.write = writeHook;
        port.micros = clockHook;
        port.flush = nullptr;
        port.preTransmission = nullptr;
        port.postTransmission = nullptr;
        port.idle = nullptr;
        place.server = mbm_server();
        place.taken = mbm_server_beginTcp(&place.server, &port, &first->unit, count, place.frame,
                                          MBM_MAX_TCP_FRAME) == MBM_OK;
        place.link = link;
        place.used = now;
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Place &place = *static_cast<Place *>(context);
        const int waiting = place.link.available();
        if (waiting <= 0)
            return place.link.connected() ? 0 : -1;
        const size_t most = static_cast<size_t>(waiting);
        const int taken = place.link.read(bytes, most < capacity ? most : capacity);
        if (taken <= 0)
            return 0;
        place.used = clock();
        return static_cast<int16_t>(taken);
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        Link &link = static_cast<Place *>(context)->link;
        if (!link.connected())
            return -1;
        return static_cast<int16_t>(link.write(bytes, length));
    }
    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
};

#endif
