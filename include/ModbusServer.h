/**
 * @file ModbusServer.h
 * @brief A Modbus RTU or ASCII server for Arduino sketches, over mbm.h.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap. Addresses are those
 * on the wire, from 0. Members that a sketch does not call take no flash.
 *
 *     ModbusRegisterArray<2> readings;
 *     ModbusServer server;
 *
 *     void setup() {
 *       Serial.begin(19200);
 *       server.inputRegisters(readings);
 *       server.begin(17, Serial, 19200);
 *     }
 *     void loop() {
 *       readings[0] = analogRead(A0);
 *       server.poll();
 *     }
 *
 * A macro that may be defined before this file is included, the same in every file
 * of a program:
 * - MODBUSSERVER_FRAME_BYTES  bytes of the frame buffer, 32 to 256; on AVR 141,
 *   which hold 64 registers each way, else 256. Longer requests are ignored,
 *   longer responses become exception 04.
 */

#ifndef MODBUSSERVER_H
#define MODBUSSERVER_H

#include <Arduino.h>
#include <stddef.h>
#include <stdint.h>

#include "ModbusTransmission.h"
#include "ModbusMasterBoards.h"
#include "ModbusServerTables.h"
#include "ModbusStatusText.h"
#include "ModbusUsb.h"
#include "mbm/server.h"

/** @cond the macro is explained at the head of the file */
#if !defined(MODBUSSERVER_FRAME_BYTES)
#if defined(__AVR__)
#define MODBUSSERVER_FRAME_BYTES MBM_FRAME_BYTES(64)
#else
#define MODBUSSERVER_FRAME_BYTES MBM_MAX_FRAME
#endif
#endif
/** @endcond */

/**
 * A unit: the tables and functions that are served under one unit id. A
 * ModbusServer is a unit itself. Use objects of this class only if one line has
 * several units.
 *
 * A member that serves an object returns MBM_OK; MBM_BUFFER_TOO_SMALL if the unit
 * serves MBM_MAX_SERVICES (16) already; MBM_BUSY if a table is served as another kind.
 * A unit may serve several tables of one kind: the first one that has all cells of a
 * request answers it.
 * It may be called before begin or after it. Objects are not copied: they must outlive
 * the unit. Several units may serve the same object.
 */
class ModbusUnit {
public:
    /** Unit 1 to 247. begin refuses a unit above 255. */
    ModbusUnit(uint16_t id = 1) : unit() { unit.id = id; }
    ModbusUnit(const ModbusUnit &) = delete;
    ModbusUnit &operator=(const ModbusUnit &) = delete;

    /** Serves coils: functions 01, 05 and 0F. */
    uint8_t coils(ModbusBits &bits) { return mbm_unit_serveCoils(&unit, bits.record()); }
    /** Serves discrete inputs: function 02. */
    uint8_t discreteInputs(ModbusBits &bits)
    {
        return mbm_unit_serveDiscreteInputs(&unit, bits.record());
    }
    /** Serves holding registers: functions 03, 06 and 10. */
    uint8_t holdingRegisters(ModbusRegisters &registers)
    {
        return mbm_unit_serveHoldingRegisters(&unit, registers.record());
    }
    /** Serves functions 16 and 17 too. Call holdingRegisters with the same registers before. */
    static uint8_t maskAndReadWrite(ModbusRegisters &registers)
    {
        return mbm_registerTable_serveMaskAndReadWrite(registers.record());
    }
    /** Serves input registers: function 04. */
    uint8_t inputRegisters(ModbusRegisters &registers)
    {
        return mbm_unit_serveInputRegisters(&unit, registers.record());
    }

    /** Serves a function of yours. */
    uint8_t function(ModbusFunction &function)
    {
        return mbm_unit_serveCustom(&unit, function.record());
    }

    /** Serves registers or bits through functions of yours; see mbm_unit_serveCallbacks. */
    uint8_t serve(mbm_dataCallbacks &cells, uint8_t table)
    {
        return mbm_unit_serveCallbacks(&unit, &cells, table);
    }
    /** Serves the exception status: function 07. */
    uint8_t serve(mbm_exceptionStatus &status)
    {
        return mbm_unit_serveExceptionStatus(&unit, &status);
    }
    /** Serves diagnostics: functions 08, 0B and 0C. */
    uint8_t serve(mbm_diagnostics &diagnostics)
    {
        return mbm_unit_serveDiagnostics(&unit, &diagnostics);
    }
    /** Serves the server id: function 11. */
    uint8_t serve(mbm_serverId &id) { return mbm_unit_serveServerId(&unit, &id); }
    /** Serves files: functions 14 and 15. */
    uint8_t serve(mbm_files &files) { return mbm_unit_serveFiles(&unit, &files); }
    /** Serves FIFO queues: function 18. */
    uint8_t serve(mbm_fifos &fifos) { return mbm_unit_serveFifos(&unit, &fifos); }
    /** Serves the device identification: function 2B/0E. */
    uint8_t serve(mbm_serverIdentification &identification)
    {
        return mbm_unit_serveIdentification(&unit, &identification);
    }

    /** Answers function `code` (1 to 127) with exception 01, even if it is served. */
    uint8_t switchOff(mbm_functionMask &switches, uint8_t code)
    {
        return mbm_unit_switchFunction(&unit, &switches, code, 0);
    }
    /** Serves function `code` again after switchOff. */
    uint8_t switchOn(mbm_functionMask &switches, uint8_t code)
    {
        return mbm_unit_switchFunction(&unit, &switches, code, 1);
    }

    /** Sets the unit id, 1 to 247. */
    void setUnitID(uint16_t id) { unit.id = id; }
    /** The unit id. */
    uint16_t getUnitID() const { return unit.id; }

private:
    friend class ModbusServer;
    template <typename Listener, uint8_t Connections> friend class ModbusTcpServer;

    // Sets the unit id and returns the one before.
    uint16_t setID(uint16_t id)
    {
        const uint16_t before = unit.id;
        unit.id = id;
        return before;
    }
    // Sets the unit id back if begin was refused.
    uint8_t keepID(uint16_t before, uint8_t status)
    {
        if (status != MBM_OK)
            unit.id = before;
        return status;
    }

    mbm_unit unit;
};

/**
 * A Modbus server on one serial line, as one unit or as several.
 *
 * Call poll in loop, and keep loop short: a response begins with the first poll
 * after t3.5 of silence, and a Stream that buffers 64 bytes loses bytes if poll
 * does not read it in time. Use an object from one thread, never from an interrupt.
 */
class ModbusServer : public ModbusUnit, public ModbusTransmissionHooks<ModbusServer> {
public:
    /** Uses neither clock nor port. */
    ModbusServer() : state() {}

    /**
     * Answers as unit `id` over a Stream that is already open. May be called again: a request
     * that it has not answered is dropped; the unit keeps its tables and functions. If the
     * Stream has setRxFIFOFull, as on an ESP32, the receiver hands over each byte at once from
     * then on. If its class is known to be a serial port over USB, this is beginUsb.
     *
     * @param id      1 to 247
     * @param stream  must outlive its use here
     * @param baud    bits per second, for t3.5; 0: unknown, 4 ms
     * @return MBM_OK; or with nothing changed MBM_BUSY from within a hook or function of
     *         this server, MBM_INVALID_ARGUMENT for a unit id above 255
     */
    template <typename Port> uint8_t begin(uint16_t id, Port &stream, uint32_t baud = 0)
    {
        const uint16_t before = setID(id);
        return keepID(before,
                      beginOver(typename ModbusPort<Port>::Kind(), *this, 1, stream, baud));
    }

    /** As begin, for all units of an array, which answer instead of this one. */
    template <size_t N, typename Port>
    uint8_t begin(ModbusUnit (&units)[N], Port &stream, uint32_t baud = 0)
    {
        static_assert(N <= 247, "a line has 247 units");
        return beginOver(typename ModbusPort<Port>::Kind(), units[0], N, stream, baud);
    }

    /**
     * As begin, for a serial port over USB whose class the library does not know. Over USB bytes
     * come in packets, and silence means nothing: a frame ends where its bytes say so, and the
     * response follows at once. There are no other devices and no broadcasts: units 0 and 255 are
     * this unit too. Damaged bytes are dropped after half a second of silence.
     */
    uint8_t beginUsb(uint16_t id, Stream &stream)
    {
        const uint16_t before = setID(id);
        return keepID(before, listen(mbm_server_beginRtuOverTcp, *this, 1, stream));
    }

    /** As beginUsb, for all units of an array. */
    template <size_t N> uint8_t beginUsb(ModbusUnit (&units)[N], Stream &stream)
    {
        static_assert(N <= 247, "a line has 247 units");
        return listen(mbm_server_beginRtuOverTcp, units[0], N, stream);
    }

    /** As begin, with ASCII instead of RTU; a frame takes twice as many bytes and 1. */
    uint8_t beginAscii(uint16_t id, Stream &stream)
    {
        const uint16_t before = setID(id);
        return keepID(before, listen(mbm_server_beginAscii, *this, 1, stream));
    }

    /** As beginAscii, for all units of an array. */
    template <size_t N> uint8_t beginAscii(ModbusUnit (&units)[N], Stream &stream)
    {
        static_assert(N <= 247, "a line has 247 units");
        return listen(mbm_server_beginAscii, units[0], N, stream);
    }

    /**
     * Receives bytes, executes a complete request and sends the response. It waits
     * in one case: until the Stream has taken and flushed the bytes of a response.
     *
     * @return MBM_OK; MBM_NOT_INITIALISED before begin; MBM_BUSY from within a hook
     *         or function of this server
     */
    uint8_t poll() { return mbm_server_poll(&state.server); }

    /**
     * How many microseconds poll has nothing to do unless bytes arrive: 0 for now,
     * 0xFFFFFFFF until bytes arrive, 1000 while a function of yours is pending. After
     * begin it is 0 until poll has read the Stream.
     */
    uint32_t pollDelay() const { return mbm_server_pollDelay(&state.server); }

    /**
     * Bits per second, from which t3.5 follows; 0: unknown, 4 ms. The Stream stays as it
     * is. It has no effect before begin, and after beginAscii, because ASCII has no t3.5.
     */
    void setBaudRate(uint32_t baud)
    {
        if (mbm_server_setBaudRate(&state.server, baud) != MBM_OK)
            return;
        setSilence(baud == 0 ? 4000 : baud > 19200 ? 1750 : 38500000 / baud + 1);
    }
    /**
     * Microseconds of silence before a response, instead of t3.5 (RTU only; call it
     * after begin). The server executes a request after half of that time, so that the
     * response is ready in time. Half of t3.5 is more than t1.5, the longest pause inside
     * a frame (serial line guide V1.02, 2.5.1.1).
     */
    void setSilence(uint32_t us)
    {
        if (mbm_server_setSilence(&state.server, us / 2) != MBM_BUSY)
            state.silenceUs = us;
    }

    /**
     * How long the UART or an adapter may hold received bytes back, in milliseconds; 50 after
     * begin. See mbm_server_setReceiveLatency.
     */
    uint8_t setReceiveLatency(uint16_t ms)
    {
        return mbm_server_setReceiveLatency(&state.server, ms);
    }

    /**
     * Says whether the receiver receives the bytes that the driver sends (RTU only; call it
     * after begin). Without this call the server finds out. See mbm_server_setEchoDiscard.
     */
    void setEchoDiscard(bool on) { mbm_server_setEchoDiscard(&state.server, on); }

private:
    static_assert(MODBUSSERVER_FRAME_BYTES >= 32 && MODBUSSERVER_FRAME_BYTES <= 256,
                  "MODBUSSERVER_FRAME_BYTES is 32 to 256");
    static_assert(sizeof(ModbusUnit) == sizeof(mbm_unit),
                  "an array of ModbusUnit is an array of mbm_unit");

    enum : uint8_t { shortWait = 100 }; // microseconds

    friend class ModbusTransmissionHooks<ModbusServer>;

    // The hooks' context. The members that they use come first, as in ModbusMaster.
    struct State {
        Stream *stream;
        ModbusTransmissionHook onPre;
        ModbusTransmissionHook onPost;
        uint32_t receivedAtUs; // when the last byte was read
        uint32_t silenceUs;
        bool ready; // a response waits for the silence to end
        mbm_server server;
        uint8_t frame[MODBUSSERVER_FRAME_BYTES];
    };

    State state;

    static State &stateOf(void *context) { return *static_cast<State *>(context); }

    ModbusTransmissionHook &preHookOf() { return state.onPre; }
    ModbusTransmissionHook &postHookOf() { return state.onPost; }

    uint8_t listen(uint8_t (*beginFraming)(mbm_server *, const mbm_port *, mbm_unit *, uint8_t,
                                           uint8_t *, uint16_t),
                   ModbusUnit &first, uint8_t count, Stream &stream)
    {
        const mbm_port port =
            modbusPort(&state, readHook, writeHook, clockHook, flushHook, preHook, postHook);
        uint8_t status = beginFraming(&state.server, &port, &first.unit, count, state.frame,
                                      MODBUSSERVER_FRAME_BYTES);
        if (status == MBM_OK) {
            state.stream = &stream;
            state.silenceUs = 0;
            state.ready = false;
        }
        return status;
    }
    uint8_t beginRtu(ModbusUnit &first, uint8_t count, Stream &stream, uint32_t baud)
    {
        uint8_t status = listen(mbm_server_beginRtu, first, count, stream);
        if (status == MBM_OK)
            setBaudRate(baud);
        return status;
    }

    template <typename Port>
    uint8_t beginOver(ModbusOverWire, ModbusUnit &first, uint8_t count, Port &stream, uint32_t baud)
    {
        return receiveAtOnce(stream, beginRtu(first, count, stream, baud));
    }
    template <typename Port>
    uint8_t beginOver(ModbusOverUsb, ModbusUnit &first, uint8_t count, Port &stream, uint32_t)
    {
        return listen(mbm_server_beginRtuOverTcp, first, count, stream);
    }

    // A Stream with setRxFIFOFull, and any other.
    template <typename Port>
    static auto setThreshold(Port &port, int) -> decltype(port.setRxFIFOFull(1), void())
    {
        port.setRxFIFOFull(1);
    }
    template <typename Port> static void setThreshold(Port &, long) {}
    template <typename Port> static uint8_t receiveAtOnce(Port &port, uint8_t status)
    {
        if (status == MBM_OK)
            setThreshold(port, 0);
        return status;
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Stream &stream = *stateOf(context).stream;
        uint16_t left = capacity;
        for (; left > 0 && stream.available() > 0; left--)
            *bytes++ = static_cast<uint8_t>(stream.read());
        if (left != capacity)
            stateOf(context).receivedAtUs = clockHook(context);
        return static_cast<int16_t>(capacity - left);
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        State &state = stateOf(context);
        if (state.ready) {
            // Waits here for the last 100 us of the silence, because loop may take longer.
            if (clockHook(context) - state.receivedAtUs + shortWait < state.silenceUs)
                return 0;
            while (clockHook(context) - state.receivedAtUs < state.silenceUs) {
            }
            state.ready = false;
            state.onPre.call();
        }
        // Byte by byte, and the result is ignored: some Streams return 0 for a byte that they send.
        for (uint16_t i = 0; i < length; i++)
            state.stream->write(bytes[i]);
        return static_cast<int16_t>(length);
    }
    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
    static uint8_t flushHook(void *context)
    {
        stateOf(context).stream->flush();
        return 1;
    }
    // The driver stays off until the silence has passed.
    static void preHook(void *context) { stateOf(context).ready = true; }
    static void postHook(void *context) { stateOf(context).onPost.call(); }
};

#endif
