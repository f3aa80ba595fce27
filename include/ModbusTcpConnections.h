/**
 * @file ModbusTcpConnections.h
 * @brief Accepts, polls and closes the connections of a TCP server or gateway.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusTcpServer.h and ModbusTcpGateway.h, whose
 * heads explain the macros.
 */

#ifndef MODBUSTCPCONNECTIONS_H
#define MODBUSTCPCONNECTIONS_H

#include <Arduino.h>
#include <stddef.h>
#include <stdint.h>

#include "ModbusTransmission.h"
#include "mbm/base.h"

/** @cond the macros are explained in ModbusTcpServer.h */
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
 * Up to `Connections` connections of a `Listener`, each with a `Content`. `Derived` serves them:
 * `opened` begins with the port of a connection, `serve` continues, `closed` ends.
 */
template <typename Derived, typename Listener, uint8_t Connections, typename Content>
class ModbusTcpConnections {
public:
    ModbusTcpConnections(const ModbusTcpConnections &) = delete;
    ModbusTcpConnections &operator=(const ModbusTcpConnections &) = delete;

    /** How many clients are connected, 0 to `Connections`. */
    uint8_t connections() const
    {
        uint8_t taken = 0;
        for (const Place &place : places)
            taken = static_cast<uint8_t>(taken + place.taken);
        return taken;
    }

protected:
    /** @cond for ModbusTcpServer and ModbusTcpGateway */
    ModbusTcpConnections() : polling(), source(), places() {}

    // True within poll: hooks then get MBM_BUSY from poll and begin.
    bool polling;

    // Closes all connections, and accepts those of another listener from now on.
    void listen(Listener &server)
    {
        for (uint8_t i = 0; i < Connections; i++)
            if (places[i].taken)
                close(i);
        source = &server;
    }

    // Continues each connection, and accepts a new one.
    uint8_t pollAll()
    {
        if (source == nullptr)
            return MBM_NOT_INITIALISED;
        if (polling)
            return MBM_BUSY;
        polling = true;
        for (uint8_t i = 0; i < Connections; i++) {
            if (!places[i].taken)
                continue;
            if (!derived().serve(i, places[i].content))
                close(i);
        }
        acceptNext(0);
        polling = false;
        return MBM_OK;
    }

    // Marks the connection `index` as not idle.
    void markUsed(uint8_t index) { places[index].used = clock(); }
    /** @endcond */

private:
    static_assert(Connections >= 1 && Connections <= 16, "a server keeps 1 to 16 connections");

    // accept returns each connection once. If a library lacks it, available returns each
    // connection once, or any connection that has bytes to read.
    template <typename Server> static auto next(Server &server, int) -> decltype(server.accept())
    {
        return server.accept();
    }
    template <typename Server>
    static auto next(Server &server, long) -> decltype(server.available())
    {
        return server.available();
    }

    // Declares the class of a connection. Never called.
    static Listener &someListener();
    typedef decltype(next(someListener(), 0)) Link;

    struct Place {
        Link link;
        uint32_t used; // milliseconds: when the last bytes were received
        bool taken;
        Content content;
    };

    Listener *source;
    Place places[Connections];

    Derived &derived() { return *static_cast<Derived *>(this); }
    static uint32_t clock() { return millis() & 0xFFFFFFFFu; }

    void close(uint8_t index)
    {
        Place &place = places[index];
        place.link.stop();
        place.link = Link();
        place.taken = false;
        derived().closed(index);
    }

    template <typename Server>
    static auto isKnown(Server &server, Place &, Link &, int) -> decltype(server.accept(), false)
    {
        return false;
    }
    template <typename Server> static bool isKnown(Server &, Place &place, Link &link, long)
    {
        return place.taken && place.link.operator==(link);
    }

    void acceptNext(int order)
    {
        Link link = next(*source, order);
        if (!link)
            return;
        const uint32_t now = clock();
        uint8_t chosen = 0;
        for (uint8_t i = 0; i < Connections; i++) {
            const Place &place = places[i], &best = places[chosen];
            if (isKnown(*source, places[i], link, order))
                return;
            if (best.taken && (!place.taken || now - place.used > now - best.used))
                chosen = i;
        }
        if (places[chosen].taken && now - places[chosen].used < MODBUSSERVER_IDLE_MS) {
            link.stop();
            return;
        }
        if (places[chosen].taken)
            close(chosen);
        open(chosen, link, now);
    }

    void open(uint8_t index, const Link &link, uint32_t now)
    {
        Place &place = places[index];
        const mbm_port port = modbusPort(&place, readHook, writeHook, clockHook);
        place.link = link;
        place.used = now;
        place.taken = derived().opened(index, port, place.content);
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
