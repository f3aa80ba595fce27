/**
 * @file ModbusTcpGateway.h
 * @brief A gateway for Arduino sketches: from Modbus TCP clients to a serial line.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap.
 *
 *     WiFiServer wifi(502);
 *     ModbusSerialClient line;
 *     ModbusTcpGateway<WiFiServer> gateway;
 *
 *     void setup() {
 *       WiFi.begin(name, password);
 *       wifi.begin();
 *       Serial.begin(19200);
 *       line.begin(Serial, 19200);
 *       line.setResponseTimeout(500);
 *       gateway.begin(wifi, line);
 *     }
 *     void loop() { gateway.poll(); }
 *
 * The macros MODBUSSERVER_CONNECTIONS and MODBUSSERVER_IDLE_MS are explained in
 * ModbusTcpServer.h. Each connection takes about 60 bytes, each request 330 on AVR, 340
 * elsewhere.
 */

#ifndef MODBUSTCPGATEWAY_H
#define MODBUSTCPGATEWAY_H

#include <stddef.h>
#include <stdint.h>

#include "ModbusClient.h"
#include "ModbusTcpConnections.h"
#include "mbm/gateway.h"

/** The state of one connection beside its mbm_gateway: none. */
struct ModbusTcpPassed {};

/**
 * Forwards requests of up to `Connections` TCP clients to the devices of one line, and
 * returns the replies. It forwards any function. It is an mbm_gateway with one line.
 *
 * A client that sends several requests without waiting for the replies has more than one
 * pending if `Requests` is greater than `Connections`. When the line is free, the clients
 * take turns.
 *
 * Without a reply of a device, the gateway answers with an exception (V1.1b3, 7): 0A for a
 * unit that the line does not have, or if the line accepts no bytes or its queue is full; 0B if
 * the device does not reply, or its reply is damaged or does not answer the request; 01, 02
 * and 03 for a request that the standard does not allow.
 *
 * Clients should wait longer than the line's response timeout. The sketch may send
 * its own requests on the line. Use an object from one thread.
 */
template <typename Listener, uint8_t Connections = MODBUSSERVER_CONNECTIONS,
          uint16_t Requests = Connections>
class ModbusTcpGateway
    : public ModbusTcpConnections<ModbusTcpGateway<Listener, Connections, Requests>, Listener,
                                  Connections, ModbusTcpPassed> {
public:
    /** Uses neither clock nor network. */
    ModbusTcpGateway() : gateway(), sides(), side(), places_(), requests() {}

    /**
     * Forwards the requests of a listener's clients from now on. Closes all connections.
     *
     * @param listener  must outlive its use here; the sketch calls its begin, before or after
     * @param devices   the line, begun by the sketch before; must outlive its use here
     * @param first     the lowest unit id of the line, 1 to 247
     * @param last      the highest
     * @return MBM_OK; or with nothing changed MBM_BUSY from within a callback,
     *         MBM_INVALID_ARGUMENT for unit ids out of range, MBM_NOT_INITIALISED for a line
     *         that was not begun
     */
    uint8_t begin(Listener &listener, ModbusClient &devices, uint16_t first = 1,
                  uint16_t last = 247)
    {
        if (this->polling)
            return MBM_BUSY;
        if (first == 0 || first > last || last > 247)
            return MBM_INVALID_ARGUMENT;
        // The gateway still uses the other side, until it has begun with this one.
        Side &next = sides[!side];
        next.line = mbm_gatewayLine();
        next.line.client = &devices.client;
        next.route.first = first;
        next.route.last = last;
        mbm_gatewayConfig config;
        config.routes = &next.route;
        config.lines = &next.line;
        config.connections = places_;
        config.requests = requests;
        config.requestCount = Requests;
        config.routeCount = 1;
        config.lineCount = 1;
        config.connectionCount = Connections;
        const uint8_t status = mbm_gateway_begin(&gateway, &config);
        if (status != MBM_OK)
            return status;
        side = !side;
        this->listen(listener);
        return MBM_OK;
    }

    /**
     * Continues all connections and polls the line, without waiting.
     *
     * @return MBM_OK; MBM_NOT_INITIALISED before begin; MBM_BUSY from within a callback
     */
    uint8_t poll()
    {
        const uint8_t status = mbm_gateway_poll(&gateway);
        return status == MBM_OK ? this->pollAll() : status;
    }

private:
    template <typename, typename, uint8_t, typename> friend class ModbusTcpConnections;

    static_assert(Requests >= Connections, "a gateway keeps a request for each connection");

    // The serial side: one line and its units.
    struct Side {
        mbm_gatewayLine line;
        mbm_gatewayRoute route;
    };

    mbm_gateway gateway;
    Side sides[2];
    bool side; // the one in use
    mbm_gatewayConnection places_[Connections];
    mbm_gatewayRequest requests[Requests];

    bool opened(uint8_t index, const mbm_port &port, ModbusTcpPassed &)
    {
        return mbm_gateway_open(&gateway, index, &port) == MBM_OK;
    }
    // A client whose device has not answered yet is not idle.
    bool serve(uint8_t index, ModbusTcpPassed &)
    {
        if (mbm_gateway_pending(&gateway, index) != 0)
            this->markUsed(index);
        return mbm_gateway_status(&gateway, index) == MBM_OK;
    }
    // Cancels the requests of a client whose connection was closed.
    void closed(uint8_t index) { mbm_gateway_close(&gateway, index); }
};

#endif
