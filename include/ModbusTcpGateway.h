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
 * ModbusTcpServer.h. Each connection takes about 970 bytes on AVR, 1080 elsewhere: four need a
 * board with 8 KB of RAM or more.
 */

#ifndef MODBUSTCPGATEWAY_H
#define MODBUSTCPGATEWAY_H

#include <stddef.h>
#include <stdint.h>

#include "ModbusClient.h"
#include "ModbusTcpConnections.h"
#include "mbm.h"

/**
 * Forwards requests of up to `Connections` TCP clients to the devices of one line, and
 * returns the replies. It forwards any function. Each client has one request under way.
 *
 * Without a reply of a device, the gateway answers with an exception (V1.1b3, 7): 0A for a
 * unit that the line does not have, or if the line accepts no bytes or its queue is full; 0B if
 * the device does not reply, or its reply is damaged or does not answer the request; 02 and
 * 03 for a request that the standard does not allow.
 *
 * Clients should wait longer than the line's response timeout. The sketch may send
 * its own requests on the line. Use an object from one thread.
 */
template <typename Listener, uint8_t Connections = MODBUSSERVER_CONNECTIONS>
class ModbusTcpGateway
    : public ModbusTcpConnections<ModbusTcpGateway<Listener, Connections>, Listener, Connections,
                                  2 * MBM_MAX_TCP_FRAME> {
public:
    /** Uses neither clock nor network. */
    ModbusTcpGateway() : line(), lowest(), highest(), passages() {}

    /**
     * Forwards the requests of a listener's clients from now on. Closes all connections.
     *
     * @param listener  must outlive its use here; the sketch calls its begin, before or after
     * @param devices   the line, begun by the sketch; must outlive its use here
     * @param first     the lowest unit id of the line, 1 to 247
     * @param last      the highest
     * @return MBM_OK; MBM_BUSY, with nothing changed, from within a callback;
     *         MBM_INVALID_ARGUMENT for unit ids out of range
     */
    uint8_t begin(Listener &listener, ModbusClient &devices, uint8_t first = 1,
                  uint8_t last = 247)
    {
        if (this->polling)
            return MBM_BUSY;
        if (first == 0 || first > last || last > 247)
            return MBM_INVALID_ARGUMENT;
        this->listen(listener);
        line = &devices;
        lowest = first;
        highest = last;
        return MBM_OK;
    }

    /**
     * Continues all connections and polls the line, without waiting.
     *
     * @return MBM_OK; MBM_NOT_INITIALISED before begin; MBM_BUSY from within a callback
     */
    uint8_t poll()
    {
        if (line != nullptr && !this->polling)
            line->poll();
        return this->pollAll();
    }

private:
    template <typename, typename, uint8_t, uint16_t> friend class ModbusTcpConnections;

    enum : uint16_t {
        noPath = MBM_REPLY_EXCEPTION | MBM_GATEWAY_PATH_UNAVAILABLE,
        noReply = MBM_REPLY_EXCEPTION | MBM_GATEWAY_TARGET_FAILED_TO_RESPOND
    };

    // The request of one connection to a device. `unit` answers for every unit id.
    struct Passage {
        ModbusTcpGateway *gateway;
        bool sent;
        mbm_unit unit;
        mbm_custom every;
        ModbusRequestOf<126> request;

        Passage() : gateway(), sent(), unit(), every(), request(1) {}
    };

    ModbusClient *line;
    uint8_t lowest;
    uint8_t highest;
    Passage passages[Connections];

    mbm_unit *unitsOf(uint8_t index, uint8_t &)
    {
        Passage &passage = passages[index];
        passage.gateway = this;
        passage.unit = mbm_unit();
        passage.every = mbm_custom();
        passage.every.serve = serveHook;
        passage.every.context = &passage;
        mbm_unit_serveCustom(&passage.unit, &passage.every);
        return &passage.unit;
    }
    // Cancels the request of a client whose connection was closed.
    void closed(uint8_t index)
    {
        if (passages[index].sent)
            line->cancel(passages[index].request);
        passages[index].sent = false;
    }

    static uint16_t serveHook(void *context, const mbm_request *request, uint8_t *response,
                              uint16_t capacity)
    {
        Passage &passage = *static_cast<Passage *>(context);
        return passage.gateway->pass(passage, *request, response, capacity);
    }

    // The first call sends the request to the device; later ones wait for its end.
    uint16_t pass(Passage &passage, const mbm_request &request, uint8_t *response,
                  uint16_t capacity)
    {
        if (passage.sent) {
            this->markUsed(static_cast<uint8_t>(&passage - passages));
            if (passage.request.pending())
                return MBM_REPLY_PENDING;
            passage.sent = false;
            return outcome(passage.request, request, response, capacity);
        }
        if (request.unit < lowest || request.unit > highest)
            return noPath;
        passage.request.setUnitID(request.unit);
        const uint8_t status =
            line->forward(passage.request, request.function, request.data, request.length);
        switch (status) {
        case MBM_PENDING: passage.sent = true; return MBM_REPLY_PENDING;
        case MBM_ILLEGAL_FUNCTION:
        case MBM_ILLEGAL_DATA_ADDRESS:
        case MBM_ILLEGAL_DATA_VALUE: return exception(status);
        case MBM_BUFFER_TOO_SMALL: return exception(MBM_SLAVE_DEVICE_FAILURE);
        default: return noPath;
        }
    }

    static uint16_t exception(uint8_t code)
    {
        return static_cast<uint16_t>(MBM_REPLY_EXCEPTION | code);
    }

    static uint16_t outcome(const ModbusRequest &reply, const mbm_request &request,
                            uint8_t *response, uint16_t capacity)
    {
        if (reply.getExceptionCode() != 0)
            return exception(reply.getExceptionCode());
        switch (reply.status()) {
        case MBM_OK: break;
        case MBM_LINK_LOST:
        case MBM_LINE_BUSY: return noPath;
        default: return noReply;
        }
        // Force Listen Only Mode is not answered (V1.1b3, 6.8.1).
        if (request.function == MBM_FC_DIAGNOSTICS && request.length >= 2 &&
            request.data[0] == 0 && request.data[1] == MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY)
            return MBM_REPLY_NONE;
        if (reply.length() > capacity)
            return exception(MBM_SLAVE_DEVICE_FAILURE);
        for (uint16_t i = 0; i < reply.length(); i++)
            response[i] = reply.getByte(i);
        return reply.length();
    }
};

#endif
