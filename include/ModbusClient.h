/**
 * @file ModbusClient.h
 * @brief Modbus clients for Arduino sketches that never wait: RTU, ASCII and TCP.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap. Addresses are those on the wire,
 * from 0. Functions that a sketch does not call take no flash.
 *
 *     ModbusSerialClient client;
 *     ModbusRequestOf<2> volts(17); // unit 17, two words
 *
 *     void setup() {
 *       Serial.begin(19200);
 *       client.begin(Serial, 19200);
 *       volts.onDone([](ModbusRequest &reply) {
 *         if (reply.status() == MBM_OK)
 *           analogWrite(9, reply.getFloat(0));
 *       });
 *     }
 *     void loop() {
 *       if (!volts.pending())
 *         client.readHoldingRegisters(volts, 107, 2);
 *       client.poll();
 *     }
 *
 * Macros that may be defined before this file is included, the same in every file
 * of a program:
 * - MODBUSCLIENT_FRAME_BYTES  bytes of the frame buffer of a ModbusSerialClient, 17 to
 *   513; on AVR 141, which hold 64 registers in RTU, else 256, which hold any RTU frame.
 *   ASCII takes twice as many and 1.
 * - MODBUSCLIENT_TCP_BYTES  bytes of each of the two buffers of a ModbusTcpClient, 17 to
 *   32767; on AVR 141, which hold 64 registers, else 260, which hold any frame.
 * - MODBUS_CAPTURE_BYTES  in ModbusCallback.h: how much a lambda may capture.
 */

#ifndef MODBUSCLIENT_H
#define MODBUSCLIENT_H

#include <Arduino.h>
#include <Client.h>
#include <stddef.h>
#include <stdint.h>

#include "ModbusClientCalls.h"
#include "ModbusTransmission.h"
#include "ModbusMasterBoards.h"
#include "ModbusStatusText.h"
#include "ModbusUsb.h"
#include "mbm/client.h"

/** @cond the macros are explained at the head of the file */
#if !defined(MODBUSCLIENT_FRAME_BYTES)
#if defined(__AVR__)
#define MODBUSCLIENT_FRAME_BYTES MBM_FRAME_BYTES(64)
#else
#define MODBUSCLIENT_FRAME_BYTES MBM_MAX_FRAME
#endif
#endif
#if !defined(MODBUSCLIENT_TCP_BYTES)
#if defined(__AVR__)
#define MODBUSCLIENT_TCP_BYTES MBM_FRAME_BYTES(64)
#else
#define MODBUSCLIENT_TCP_BYTES MBM_MAX_TCP_FRAME
#endif
#endif
/** @endcond */

/**
 * A client of one serial line, in RTU or ASCII frames. One request at a time is in flight.
 * poll waits in one case: at the end of a request, until the Stream's flush returns.
 */
class ModbusSerialClient : public ModbusClient,
                           public ModbusTransmissionHooks<ModbusSerialClient> {
public:
    /** Uses neither clock nor port. */
    ModbusSerialClient() : stream(), onPre(), onPost() {}

    /**
     * Speaks RTU over a Stream that is already open. May be called again while no request
     * is pending; that sets all settings to their defaults.
     *
     * @param line  must outlive its use here
     * @param baud  bits per second, for the silence of t3.5; 0: unknown, 4 ms
     * @return MBM_OK; MBM_BUSY, with nothing changed, while a request is pending and from
     *         within a callback
     */
    uint8_t begin(Stream &line, uint32_t baud = 0)
    {
        const uint8_t status = attach(mbm_client_beginRtu, line);
        if (status == MBM_OK && baud != 0)
            setBaudRate(baud);
        return status;
    }
    /**
     * As begin, for a serial port over USB whose class the library does not know. Over USB bytes
     * come in packets, and silence means nothing: the client keeps no gap, and does not broadcast.
     */
    uint8_t beginUsb(Stream &line) { return attach(mbm_client_beginRtuOverTcp, line); }
    /** begin for a port whose class is known to be a serial port over USB: as beginUsb. */
    template <typename Port>
    auto begin(Port &line, uint32_t = 0) -> typename ModbusPort<Port>::Usb
    {
        return beginUsb(line);
    }
    /** As begin, with ASCII instead of RTU. */
    uint8_t beginAscii(Stream &line) { return attach(mbm_client_beginAscii, line); }

    /** Bits per second, from which t3.5 follows; 0: unknown, a silence of 4 ms. The Stream stays as it is. */
    uint8_t setBaudRate(uint32_t baud) { return mbm_client_setBaudRate(&client, baud); }
    /** Microseconds of silence before a request, instead of t3.5. */
    uint8_t setGap(uint32_t us) { return mbm_client_setGap(&client, us); }
    /** Milliseconds from a broadcast to the next request; 100 at first. */
    uint8_t setTurnaroundDelay(uint32_t ms) { return mbm_client_setTurnaroundDelay(&client, ms); }
    /** Milliseconds after a failed request before the next one is sent; 100 at first. */
    uint8_t setQuietTime(uint32_t ms) { return mbm_client_setQuietTime(&client, ms); }
    /**
     * Discards the local echo, if the receiver receives the bytes that the driver sends; off at
     * first.
     */
    uint8_t setEchoDiscard(bool on) { return mbm_client_setEchoDiscard(&client, on); }
    /** Character times that the driver stays on after flush, for cores whose flush returns early; 0 at first. */
    uint8_t setPostFlushHold(uint8_t characters)
    {
        return mbm_client_setPostFlushHold(&client, characters);
    }
    /** The character that ends ASCII frames after CR, 1 to 127; LF at first. */
    uint8_t setDelimiter(uint8_t character) { return mbm_client_setDelimiter(&client, character); }

private:
    static_assert(MODBUSCLIENT_FRAME_BYTES >= 17 && MODBUSCLIENT_FRAME_BYTES <= 513,
                  "MODBUSCLIENT_FRAME_BYTES is 17 to 513");

    friend class ModbusTransmissionHooks<ModbusSerialClient>;

    Stream *stream;
    ModbusTransmissionHook onPre;
    ModbusTransmissionHook onPost;
    uint8_t frame[MODBUSCLIENT_FRAME_BYTES];

    ModbusTransmissionHook &preHookOf() { return onPre; }
    ModbusTransmissionHook &postHookOf() { return onPost; }

    static ModbusSerialClient &clientOf(void *context)
    {
        return *static_cast<ModbusSerialClient *>(context);
    }

    uint8_t attach(uint8_t (*beginFraming)(mbm_client *, const mbm_port *, uint8_t *, uint16_t),
                   Stream &line)
    {
        uint8_t status = reset();
        if (status != MBM_OK)
            return status;
        const mbm_port port = modbusPort(this, readHook, writeHook, clockHook, flushHook, preHook,
                                         postHook);
        stream = &line;
        return beginFraming(&client, &port, frame, MODBUSCLIENT_FRAME_BYTES);
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Stream &line = *clientOf(context).stream;
        uint16_t taken = 0;
        for (int byte; taken < capacity && (byte = line.read()) >= 0; taken++)
            bytes[taken] = static_cast<uint8_t>(byte);
        return static_cast<int16_t>(taken);
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        // Byte by byte, and the result is ignored: some Streams return 0 for a byte that they send.
        Stream &line = *clientOf(context).stream;
        for (uint16_t i = 0; i < length; i++)
            line.write(bytes[i]);
        return static_cast<int16_t>(length);
    }
    static uint8_t flushHook(void *context)
    {
        clientOf(context).stream->flush();
        return 1;
    }
    static void preHook(void *context) { clientOf(context).onPre.call(); }
    static void postHook(void *context) { clientOf(context).onPost.call(); }
};

/**
 * A client of one TCP connection of an Ethernet or WiFi library. Up to 16 requests are pending
 * at once. The device at the other end of the connection is unit 255; requests to other units
 * pass through a gateway.
 */
class ModbusTcpClient : public ModbusClient {
public:
    /** Uses neither clock nor network. */
    ModbusTcpClient() : link() {}

    /**
     * Speaks Modbus TCP over an EthernetClient, WiFiClient or other Client. May be called
     * again while no request is pending; that sets all settings to their defaults.
     *
     * @param connection  must outlive its use here; connected before, or by connect
     * @return MBM_OK; MBM_BUSY, with nothing changed, while a request is pending and from
     *         within a callback
     */
    uint8_t begin(Client &connection)
    {
        const uint8_t status = reset();
        if (status != MBM_OK)
            return status;
        const mbm_port port = portOf(connection);
        return mbm_client_beginTcp(&client, &port, incoming, MODBUSCLIENT_TCP_BYTES, outgoing,
                                   MODBUSCLIENT_TCP_BYTES);
    }
    /** As begin, with RTU frames, for converters that pass bytes on. */
    uint8_t beginRtuOverTcp(Client &connection)
    {
        const uint8_t status = reset();
        if (status != MBM_OK)
            return status;
        const mbm_port port = portOf(connection);
        return mbm_client_beginRtuOverTcp(&client, &port, incoming, MODBUSCLIENT_TCP_BYTES);
    }

    /**
     * Closes the connection, if it is open, and connects to a device with the Client's own
     * connect, which may wait as long as its library does. Requests that were in flight end
     * with MBM_LINK_LOST at the next poll; those that had not been sent go over the new
     * connection.
     *
     * @param host  an argument of the Client's connect: an IPAddress or a name
     * @param port  502 for most devices
     * @return MBM_OK; MBM_LINK_LOST if the Client did not connect; MBM_NOT_INITIALISED
     *         before begin; MBM_BUSY from within a hook
     */
    template <typename Host> uint8_t connect(const Host &host, uint16_t port = 502)
    {
        if (link == nullptr)
            return MBM_NOT_INITIALISED;
        link->stop();
        const bool connected = link->connect(host, port) > 0;
        const uint8_t status = mbm_client_reconnect(&client, nullptr);
        return status == MBM_OK && !connected ? +MBM_LINK_LOST : status;
    }
    /** The result of the Client's connected(); false before begin. */
    bool isConnected() { return link != nullptr && link->connected(); }
    /** Closes the connection; requests that are pending end with MBM_LINK_LOST at the next polls. */
    void stop()
    {
        if (link != nullptr)
            link->stop();
    }

    /** How many requests are in flight at once, 1 (the default) to 16. More are faster, but many
     *  devices take one at a time. */
    uint8_t setInFlight(uint8_t most) { return mbm_client_setInFlight(&client, most); }

private:
    static_assert(MODBUSCLIENT_TCP_BYTES >= 17 && MODBUSCLIENT_TCP_BYTES <= 32767,
                  "MODBUSCLIENT_TCP_BYTES is 17 to 32767");

    Client *link;
    uint8_t incoming[MODBUSCLIENT_TCP_BYTES];
    uint8_t outgoing[MODBUSCLIENT_TCP_BYTES];

    mbm_port portOf(Client &connection)
    {
        link = &connection;
        return modbusPort(link, readHook, writeHook, clockHook);
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Client &connection = *static_cast<Client *>(context);
        const int waiting = connection.available();
        if (waiting <= 0)
            return connection.connected() ? 0 : -1;
        const size_t most = static_cast<size_t>(waiting);
        const int taken = connection.read(bytes, most < capacity ? most : capacity);
        return taken > 0 ? static_cast<int16_t>(taken) : 0;
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        Client &connection = *static_cast<Client *>(context);
        if (!connection.connected())
            return -1;
        return static_cast<int16_t>(connection.write(bytes, length));
    }
};

#endif
