/**
 * @file ModbusSniffer.h
 * @brief Prints the frames of a serial line, for Arduino sketches.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap.
 *
 *     ModbusSniffer sniffer;
 *
 *     void setup() {
 *       Serial.begin(115200);
 *       Serial1.begin(19200); // the receiver of the bus; the sniffer never sends
 *       sniffer.printTo(Serial);
 *       sniffer.begin(Serial1, 19200);
 *     }
 *     void loop() { sniffer.poll(); }
 *
 * prints lines like
 *
 *     120 ms unit 17 request 03 read holding registers 107..109
 *     129 ms unit 17 reply 03 read holding registers 107..109: 555 0 100 (9 ms)
 *
 * A macro that may be defined before this file is included, the same in every file
 * of a program:
 * - MODBUSSNIFFER_BUFFER_BYTES  bytes of its buffer, 32 to 32767; 256, which hold any RTU
 *   frame. 513 hold any ASCII frame. A longer frame is reported as noise.
 */

#ifndef MODBUSSNIFFER_H
#define MODBUSSNIFFER_H

#include <Arduino.h>
#include <stdint.h>

#include "ModbusCallback.h"
#include "ModbusDriverPin.h"
#include "ModbusMasterBoards.h"
#include "ModbusSnifferText.h"
#include "mbm/sniffer.h"

/** @cond the macro is explained at the head of the file */
#if !defined(MODBUSSNIFFER_BUFFER_BYTES)
#define MODBUSSNIFFER_BUFFER_BYTES MBM_MAX_FRAME
#endif
/** @endcond */

/**
 * Receives the bytes of a line, finds the frames, and pairs requests with replies. On AVR it
 * needs about 700 bytes of RAM in addition to its buffer, and about 40 KB of flash: a Mega has
 * them, an Uno does not.
 *
 * Call poll in loop, more often than the Stream's buffer fills: 64 bytes take 33 ms at 19200
 * baud. Printing takes time too: open the port that prints at a higher rate than the line has.
 */
class ModbusSniffer {
public:
    /** Uses neither clock nor port. */
    ModbusSniffer() : stream(), out(), sniffer() {}
    ModbusSniffer(const ModbusSniffer &) = delete;
    ModbusSniffer &operator=(const ModbusSniffer &) = delete;

    /**
     * Receives RTU frames from a Stream that is already open. May be called again: it drops
     * received bytes and sets all settings to their defaults.
     *
     * @param line  must outlive its use here; nothing is written to it
     * @param baud  bits per second, for the silence between frames; 0: unknown, 4 ms
     * @return MBM_OK
     */
    uint8_t begin(Stream &line, uint32_t baud = 0)
    {
        const uint8_t status = beginAs(line, MBM_FRAMING_RTU);
        if (status == MBM_OK && baud != 0)
            mbm_sniffer_setBaudRate(&sniffer, baud);
        return status;
    }
    /** As begin, for ASCII frames. */
    uint8_t beginAscii(Stream &line)
    {
        return beginAs(line, MBM_FRAMING_ASCII);
    }

    /**
     * Keeps the transceiver receiving, by a pin that its DE and /RE are joined to: makes the pin
     * an output with the level for receiving.
     *
     * @param pin    the number that digitalWrite takes; on AVR at most 127
     * @param level  the level with which the transceiver would send
     */
    static void setDriverPin(ModbusDriverPin::Pin pin, uint8_t level = 1)
    {
        ModbusDriverPin::begin(ModbusDriverPin::of(pin, level != 0));
    }

    /** Prints each event as a line; see modbusPrintEvent. */
    void printTo(Print &print) { out = &print; }
    /** Prints nothing from now on. */
    void printNothing() { out = nullptr; }

    /**
     * Sets a callback for each event: a function, or a lambda whose captures have at most
     * MODBUS_CAPTURE_BYTES; nullptr for none. The event is valid during the call.
     */
    template <typename Function> void onEvent(const Function &function) { callback.set(function); }
    /** @copydoc onEvent */
    void onEvent(void (*function)(const mbm_event &)) { callback.set(function); }

    /** Milliseconds after which a request counts as one without a reply, 1 to 65535; 1000 at first. */
    uint8_t setResponseTimeout(uint32_t ms)
    {
        return mbm_sniffer_setResponseTimeout(&sniffer, ms);
    }
    /** Milliseconds that the rest of a frame may take, 1 to 65535; see mbm_sniffer_setFrameTimeout. */
    uint8_t setFrameTimeout(uint32_t ms) { return mbm_sniffer_setFrameTimeout(&sniffer, ms); }

    /**
     * Reads the bytes that have arrived, prints new events and calls the callback for each. It
     * does nothing before begin.
     */
    void poll()
    {
        if (stream == nullptr)
            return;
        uint8_t bytes[16];
        for (;;) {
            uint8_t taken = 0, fed = 0;
            for (int byte; taken < sizeof bytes && (byte = stream->read()) >= 0; taken++)
                bytes[taken] = static_cast<uint8_t>(byte);
            const uint32_t now = micros() & 0xFFFFFFFFu;
            do {
                fed = static_cast<uint8_t>(
                    fed + mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, bytes + fed,
                                           static_cast<uint8_t>(taken - fed), now));
                report(now);
            } while (fed < taken);
            if (taken < sizeof bytes)
                return;
        }
    }

private:
    static_assert(MODBUSSNIFFER_BUFFER_BYTES >= 32 && MODBUSSNIFFER_BUFFER_BYTES <= 32767,
                  "MODBUSSNIFFER_BUFFER_BYTES is 32 to 32767");

    Stream *stream;
    Print *out;
    ModbusCallback<const mbm_event> callback;
    mbm_sniffer sniffer;
    uint8_t buffer[MODBUSSNIFFER_BUFFER_BYTES];

    uint8_t beginAs(Stream &line, uint8_t framing)
    {
        const uint8_t status =
            mbm_sniffer_begin(&sniffer, framing, buffer, MODBUSSNIFFER_BUFFER_BYTES);
        if (status == MBM_OK)
            stream = &line;
        return status;
    }

    void report(uint32_t now)
    {
        mbm_event event;
        while (mbm_sniffer_next(&sniffer, now, &event)) {
            if (out != nullptr)
                modbusPrintEvent(*out, event);
            callback(event);
        }
    }
};

#endif
