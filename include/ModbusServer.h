/**
 * @file ModbusServer.h
 * @brief A Modbus RTU or ASCII server for Arduino sketches, over mbm.h.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap. Addresses are those
 * on the wire, from 0. What a sketch does not call takes no flash.
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
 * A macro that may be defined before this file is included, alike in every file
 * of a program:
 * - MODBUSSERVER_FRAME_BYTES  bytes of the frame buffer, 32 to 256; on AVR 141,
 *   which hold 64 registers each way, else 256. Longer requests are not heard,
 *   longer responses become exception 04.
 */

#ifndef MODBUSSERVER_H
#define MODBUSSERVER_H

#include <Arduino.h>
#include <stddef.h>
#include <stdint.h>

#include "ModbusMasterBoards.h"
#include "ModbusServerTables.h"
#include "ModbusStatusText.h"
#include "mbm.h"

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
 * What answers to one unit id: the tables and functions that it serves. A
 * ModbusServer is one itself; only several units on one line take objects of
 * this class.
 *
 * Each member that serves something returns MBM_OK, or MBM_BUFFER_TOO_SMALL for
 * more than MBM_MAX_SERVICES (16) of them, and may be called before begin or after
 * it. What is served is not copied: it must outlive the unit. Several units may
 * serve the same object; MBM_BUSY for a table that is served as another kind.
 */
class ModbusUnit {
public:
    /** Unit 1 to 247. */
    ModbusUnit(uint8_t id = 1) : unit() { unit.id = id; }
    ModbusUnit(const ModbusUnit &) = delete;
    ModbusUnit &operator=(const ModbusUnit &) = delete;

    /** Serves coils: functions 01, 05 and 0F. */
    uint8_t coils(ModbusBits &bits) { return mbm_unit_serveCoils(&unit, bits.use()); }
    /** Serves discrete inputs: function 02. */
    uint8_t discreteInputs(ModbusBits &bits)
    {
        return mbm_unit_serveDiscreteInputs(&unit, bits.use());
    }
    /** Serves holding registers: functions 03, 06 and 10. */
    uint8_t holdingRegisters(ModbusRegisters &registers)
    {
        return mbm_unit_serveHoldingRegisters(&unit, registers.use());
    }
    /** Serves functions 16 and 17 too, of registers that holdingRegisters took. */
    uint8_t maskAndReadWrite(ModbusRegisters &registers)
    {
        return mbm_registerTable_serveMaskAndReadWrite(registers.use());
    }
    /** Serves input registers: function 04. */
    uint8_t inputRegisters(ModbusRegisters &registers)
    {
        return mbm_unit_serveInputRegisters(&unit, registers.use());
    }

    /** Serves a function of yours. */
    uint8_t function(ModbusFunction &function)
    {
        return mbm_unit_serveCustom(&unit, function.use());
    }

    /** Serves cells that functions of yours hold; see mbm_unit_serveCallbacks. */
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
    uint8_t serve(mbm_identification &identification)
    {
        return mbm_unit_serveIdentification(&unit, &identification);
    }

    /** Answers function `code` (1 to 127) with exception 01, whatever serves it. */
    uint8_t switchOff(mbm_functionMask &switches, uint8_t code)
    {
        return mbm_unit_switchFunction(&unit, &switches, code, 0);
    }
    /** Serves a function again that switchOff took away. */
    uint8_t switchOn(mbm_functionMask &switches, uint8_t code)
    {
        return mbm_unit_switchFunction(&unit, &switches, code, 1);
    }

    /** Sets the unit id, 1 to 247. */
    void setUnitID(uint8_t id) { unit.id = id; }
    /** The unit id. */
    uint8_t getUnitID() const { return unit.id; }

private:
    friend class ModbusServer;
    template <typename Listener, uint8_t Connections> friend class ModbusTcpServer;

    mbm_unit unit;
};

/**
 * A Modbus server on one serial line, as one unit or as several.
 *
 * Call poll in loop, and keep loop short: a response begins with the first poll
 * after the line has been silent for t3.5, and a Stream that buffers 64 bytes
 * has lost some if it is not asked for that long. Use an object from one
 * thread, never from an interrupt.
 */
class ModbusServer : public ModbusUnit {
public:
    /** Touches neither clock nor port. */
    ModbusServer() : state() {}

    /**
     * Answers as unit `id` over a Stream that is open already. May be called
     * again; what was under way is dropped, what is served stays.
     *
     * @param id      1 to 247
     * @param stream  must outlive its use here
     * @param baud    bits per second, for t3.5; 0: untold, 4 ms
     * @return MBM_OK; MBM_BUSY, with nothing changed, from within a hook or function
     *         of this server
     */
    uint8_t begin(uint8_t id, Stream &stream, uint32_t baud = 0)
    {
        return named(id, beginRtu(*this, 1, stream, baud));
    }

    /** As begin, for all units of an array, which answer in place of this one. */
    template <size_t N> uint8_t begin(ModbusUnit (&units)[N], Stream &stream, uint32_t baud = 0)
    {
        static_assert(N <= 247, "a line has 247 units");
        return beginRtu(units[0], N, stream, baud);
    }

    /** As begin, with ASCII in place of RTU; a frame needs twice the bytes and 1. */
    uint8_t beginAscii(uint8_t id, Stream &stream)
    {
        return named(id, listen(mbm_server_beginAscii, *this, 1, stream));
    }

    /** As beginAscii, for all units of an array. */
    template <size_t N> uint8_t beginAscii(ModbusUnit (&units)[N], Stream &stream)
    {
        static_assert(N <= 247, "a line has 247 units");
        return listen(mbm_server_beginAscii, units[0], N, stream);
    }

    /**
     * Moves the server on: takes bytes in, carries a request out once it is
     * whole, sends the response. While a response leaves, the Stream is waited
     * for: until it has taken and flushed all bytes.
     *
     * @return MBM_OK; MBM_NOT_INITIALISED before begin; MBM_BUSY from within a hook
     *         or function of this server
     */
    uint8_t poll() { return mbm_server_poll(&state.server); }

    /**
     * How long poll will find nothing to do unless a byte arrives: microseconds,
     * 0 for now, 0xFFFFFFFF until a byte arrives; 1000 while a function of yours is
     * not done.
     */
    uint32_t pollDelay() const { return mbm_server_pollDelay(&state.server); }

    /** Called before a response is written (RS-485 driver on); nullptr for none. */
    void preTransmission(void (*callback)()) { set(state.onPre, callback); }
    /** As preTransmission(callback), which is handed `context`. */
    void preTransmission(void (*callback)(void *), void *context)
    {
        set(state.onPre, callback, context);
    }

    /** Called once a response has left (RS-485 driver off); nullptr for none. */
    void postTransmission(void (*callback)()) { set(state.onPost, callback); }
    /** As postTransmission(callback), which is handed `context`. */
    void postTransmission(void (*callback)(void *), void *context)
    {
        set(state.onPost, callback, context);
    }

    /**
     * Tells bits per second, for t3.5; 0: untold, 4 ms. Sets nothing on the Stream.
     * Without effect before begin and after beginAscii, where t3.5 ends no frame.
     */
    void setBaudRate(uint32_t baud)
    {
        if (!state.rtu)
            return;
        setSilence(baud == 0 ? 4000 : baud > 19200 ? 1750 : 38500000 / baud + 1);
    }
    /**
     * Microseconds of silence before a response, in place of t3.5; of RTU, after
     * begin. After half of it, which is more than the t1.5 that a frame may pause
     * (serial line guide V1.02, 2.5.1.1), a request is carried out, so that
     * the response is ready in time.
     */
    void setSilence(uint32_t us)
    {
        if (mbm_server_setSilence(&state.server, us / 2) != MBM_BUSY)
            state.silence = us;
    }

    /** Drops the response itself where the receiver hears the driver; of RTU, after begin. */
    void setEchoDiscard(bool on) { mbm_server_setEchoDiscard(&state.server, on); }

private:
    static_assert(MODBUSSERVER_FRAME_BYTES >= 32 && MODBUSSERVER_FRAME_BYTES <= 256,
                  "MODBUSSERVER_FRAME_BYTES is 32 to 256");
    static_assert(sizeof(ModbusUnit) == sizeof(mbm_unit), "an array of one is one of the other");

    enum : uint8_t { shortWait = 100 }; // microseconds

    struct Callback {
        void (*function)(void *);
        void *context;
    };

    // The hooks' context: what they use comes first, as in ModbusMaster.
    struct State {
        Stream *stream;
        Callback onPre;
        Callback onPost;
        uint32_t heard; // when the last byte was seen
        uint32_t silence;
        bool ready; // a response waits for the silence to end
        bool rtu;
        mbm_server server;
        uint8_t frame[MODBUSSERVER_FRAME_BYTES];
    };

    State state;

    static State &of(void *context) { return *static_cast<State *>(context); }

    uint8_t listen(uint8_t (*how)(mbm_server *, const mbm_port *, mbm_unit *, uint8_t, uint8_t *,
                                  uint16_t),
                   ModbusUnit &first, uint8_t count, Stream &stream)
    {
        mbm_port port;
        port.context = &state;
        port.read = readHook;
        port.write = writeHook;
        port.micros = clockHook;
        port.flush = flushHook;
        port.preTransmission = preHook;
        port.postTransmission = postHook;
        port.idle = nullptr;
        uint8_t status = how(&state.server, &port, &first.unit, count, state.frame,
                             MODBUSSERVER_FRAME_BYTES);
        if (status == MBM_OK) {
            state.stream = &stream;
            state.silence = 0;
            state.ready = false;
            state.rtu = false;
        }
        return status;
    }
    uint8_t beginRtu(ModbusUnit &first, uint8_t count, Stream &stream, uint32_t baud)
    {
        uint8_t status = listen(mbm_server_beginRtu, first, count, stream);
        if (status == MBM_OK) {
            state.rtu = true;
            setBaudRate(baud);
        }
        return status;
    }
    uint8_t named(uint8_t id, uint8_t status)
    {
        if (status == MBM_OK)
            setUnitID(id);
        return status;
    }

    static void plain(void *callback) { reinterpret_cast<void (*)()>(callback)(); }

    static void set(Callback &callback, void (*function)(void *), void *context)
    {
        callback.function = function;
        callback.context = context;
    }
    static void set(Callback &callback, void (*function)())
    {
        set(callback, function != nullptr ? plain : nullptr, reinterpret_cast<void *>(function));
    }
    static void call(const Callback &callback)
    {
        if (callback.function != nullptr)
            callback.function(callback.context);
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Stream &stream = *of(context).stream;
        uint16_t room = capacity;
        for (; room > 0 && stream.available() > 0; room--)
            *bytes++ = static_cast<uint8_t>(stream.read());
        if (room != capacity)
            of(context).heard = clockHook(context);
        return static_cast<int16_t>(capacity - room);
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        State &state = of(context);
        if (state.ready) {
            // The last of it is waited for here: loop may take longer.
            if (clockHook(context) - state.heard + shortWait < state.silence)
                return 0;
            while (clockHook(context) - state.heard < state.silence) {
            }
            state.ready = false;
            call(state.onPre);
        }
        // One by one, whatever it returns: some Streams return 0 for a byte that they send.
        for (uint16_t i = 0; i < length; i++)
            state.stream->write(bytes[i]);
        return static_cast<int16_t>(length);
    }
    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
    static uint8_t flushHook(void *context)
    {
        of(context).stream->flush();
        return 1;
    }
    // The driver stays off until the silence has passed.
    static void preHook(void *context) { of(context).ready = true; }
    static void postHook(void *context) { call(of(context).onPost); }
};

#endif
