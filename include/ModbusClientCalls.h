/**
 * @file ModbusClientCalls.h
 * @brief The requests and settings that the clients of every framing share.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusClient.h.
 */

#ifndef MODBUSCLIENTCALLS_H
#define MODBUSCLIENTCALLS_H

#include <Arduino.h>
#include <stddef.h>
#include <stdint.h>

#include "ModbusMasterOptions.h"
#include "ModbusRequest.h"
#include "mbm/client.h"

/**
 * Queues requests to units, up to 16 at once. ModbusSerialClient and ModbusTcpClient add
 * the line.
 *
 * All members except wait return at once. Call poll in loop. Use an object from one
 * thread, never from an interrupt.
 *
 * Each of the functions queues a request and returns MBM_PENDING, or the reason why
 * nothing was queued: MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS if no device could
 * accept the request, MBM_BUFFER_TOO_SMALL if the request's words or the frame are too few,
 * MBM_BROADCAST_NOT_ALLOWED, MBM_QUEUE_FULL, MBM_NOT_INITIALISED, MBM_INVALID_ARGUMENT; or
 * MBM_BUSY, with the request unchanged, if it is pending or if preTransmission or
 * postTransmission makes the call. Addresses are those on the wire, from 0.
 */
class ModbusClient {
    template <typename, uint8_t, uint16_t> friend class ModbusTcpGateway;

public:
    ModbusClient(const ModbusClient &) = delete;
    ModbusClient &operator=(const ModbusClient &) = delete;

    /**
     * Continues all requests, without waiting, and calls the callbacks of those that have
     * ended.
     *
     * @return MBM_PENDING while requests are pending, MBM_OK if there are none;
     *         MBM_BUSY from within a callback; MBM_NOT_INITIALISED before begin
     */
    uint8_t poll() { return mbm_client_poll(&client); }
    /**
     * Waits until a request has ended, and continues the others meanwhile; for sketches
     * that have nothing else to do. Calls yield().
     *
     * @return the status of the request when it has ended, or of its refusal.
     *         At once MBM_BUSY from within a callback, and MBM_NOT_PENDING for a request of
     *         another client
     */
    uint8_t wait(const ModbusRequest &request)
    {
        while (request.pending()) {
            const uint8_t status = poll();
            if (status != MBM_PENDING && request.pending())
                return status == MBM_OK ? MBM_NOT_PENDING : status;
            MODBUSMASTER_YIELD();
        }
        return request.status();
    }
    /**
     * How many microseconds poll has nothing to do unless a byte arrives: 0 for now,
     * 0xFFFFFFFF without a request, 1000 while a TCP connection takes no bytes.
     */
    uint32_t pollDelay() { return mbm_client_pollDelay(&client); }
    /** How many requests are pending, 0 to 16. */
    uint8_t pending() const { return mbm_client_pending(&client); }
    /**
     * Cancels a request: its status becomes MBM_CANCELLED and its callback is not called.
     * The device may have received it. Returns MBM_OK, or MBM_NOT_PENDING if it has ended.
     */
    uint8_t cancel(ModbusRequest &request)
    {
        return mbm_client_cancel(&client, &request.request);
    }

    /** Function 01: reads 1 to 2000 coils, for getBit of the request; 16 a word. */
    uint8_t readCoils(ModbusRequest &request, uint16_t address, uint16_t quantity)
    {
        return mbm_client_readCoils(&client, withWords(request), address, quantity);
    }
    /** Function 02: reads 1 to 2000 discrete inputs, for getBit of the request; 16 a word. */
    uint8_t readDiscreteInputs(ModbusRequest &request, uint16_t address, uint16_t quantity)
    {
        return mbm_client_readDiscreteInputs(&client, withWords(request), address, quantity);
    }
    /** Function 03: reads 1 to 125 holding registers. */
    uint8_t readHoldingRegisters(ModbusRequest &request, uint16_t address, uint16_t quantity)
    {
        return mbm_client_readHoldingRegisters(&client, withWords(request), address, quantity);
    }
    /** Function 04: reads 1 to 125 input registers. */
    uint8_t readInputRegisters(ModbusRequest &request, uint16_t address, uint16_t quantity)
    {
        return mbm_client_readInputRegisters(&client, withWords(request), address, quantity);
    }
    /** Function 05: switches a coil. */
    uint8_t writeSingleCoil(ModbusRequest &request, uint16_t address, bool on)
    {
        return mbm_client_writeSingleCoil(&client, withWords(request), address, on);
    }
    /** Function 06: writes a value to a holding register; the request's words stay. */
    uint8_t writeSingleRegister(ModbusRequest &request, uint16_t address, uint16_t value)
    {
        return mbm_client_writeSingleRegister(&client, withWords(request), address, value);
    }
    /** Function 0F: writes 1 to 1968 coils, which you set with setBit of the request. */
    uint8_t writeMultipleCoils(ModbusRequest &request, uint16_t address, uint16_t quantity)
    {
        return holds(request, 16, quantity)
                   ? mbm_client_writeMultipleCoils(&client, withWords(request), address, quantity)
                   : refuse(request);
    }
    /** Function 10: writes 1 to 123 registers from the request's words. */
    uint8_t writeMultipleRegisters(ModbusRequest &request, uint16_t address, uint16_t quantity)
    {
        return holds(request, 1, quantity)
                   ? mbm_client_writeMultipleRegisters(&client, withWords(request), address, quantity)
                   : refuse(request);
    }
    /** Function 16: (register & andMask) | (orMask & ~andMask). */
    uint8_t maskWriteRegister(ModbusRequest &request, uint16_t address, uint16_t andMask,
                              uint16_t orMask)
    {
        return mbm_client_maskWriteRegister(&client, withWords(request), address, andMask, orMask);
    }
    /** Function 17: writes 1 to 121 of the request's words, then reads 1 to 125 into them. */
    uint8_t readWriteMultipleRegisters(ModbusRequest &request, uint16_t readAddress,
                                       uint16_t readQuantity, uint16_t writeAddress,
                                       uint16_t writeQuantity)
    {
        return holds(request, 1, writeQuantity)
                   ? mbm_client_readWriteMultipleRegisters(&client, withWords(request), readAddress,
                                                           readQuantity, writeAddress,
                                                           writeQuantity)
                   : refuse(request);
    }
    /** Function 07: reads eight outputs, byte 0 of the request. */
    uint8_t readExceptionStatus(ModbusRequest &request)
    {
        return mbm_client_readExceptionStatus(&client, withWords(request));
    }
    /** Function 08: sends the request's words and reads as many; 1, or 1 to 125 with sub-function 0. */
    uint8_t diagnostics(ModbusRequest &request, uint16_t subFunction, uint16_t quantity = 1)
    {
        return holds(request, 1, quantity)
                   ? mbm_client_diagnostics(&client, withWords(request), subFunction, quantity)
                   : refuse(request);
    }
    /** Function 0B: reads the status word and the event count, words 0 and 1. */
    uint8_t getCommEventCounter(ModbusRequest &request)
    {
        return mbm_client_getCommEventCounter(&client, withWords(request));
    }
    /** Function 0C: reads bytes: status, event count and message count, high byte first; events. */
    uint8_t getCommEventLog(ModbusRequest &request)
    {
        return mbm_client_getCommEventLog(&client, withWords(request));
    }
    /** Function 11: reads bytes whose meaning the device defines; length() is their number. */
    uint8_t reportServerId(ModbusRequest &request)
    {
        return mbm_client_reportServerId(&client, withWords(request));
    }
    /** Function 14: reads 1 to 121 records in a row (0 to 9999) of a file (1 to 65535). */
    uint8_t readFileRecord(ModbusRequest &request, uint16_t file, uint16_t record,
                           uint16_t quantity)
    {
        return mbm_client_readFileRecord(&client, withWords(request), file, record, quantity);
    }
    /** Function 15: writes 1 to 122 records in a row of a file from the request's words. */
    uint8_t writeFileRecord(ModbusRequest &request, uint16_t file, uint16_t record,
                            uint16_t quantity)
    {
        return holds(request, 1, quantity)
                   ? mbm_client_writeFileRecord(&client, withWords(request), file, record, quantity)
                   : refuse(request);
    }
    /** Function 18: reads up to 31 registers of a queue; length() / 2 says how many. */
    uint8_t readFifoQueue(ModbusRequest &request, uint16_t address)
    {
        return mbm_client_readFifoQueue(&client, withWords(request), address);
    }
    /**
     * Function 2B/0E: reads bytes: conformity level, more follows, next object, how many
     * objects, and of each its id, length and value. `code` is one of MBM_DEVICE_ID_,
     * `object` the one to begin with.
     */
    uint8_t readDeviceIdentification(ModbusRequest &request, uint8_t code, uint8_t object = 0)
    {
        return mbm_client_readDeviceIdentification(&client, withWords(request), code, object);
    }
    /** A function of yours, 1 to 127: sends 0 to 252 bytes; `response` says how long a reply is. */
    uint8_t custom(ModbusRequest &request, uint8_t function, uint16_t bytes,
                   const mbm_rule &response)
    {
        return holds(request, 2, bytes)
                   ? mbm_client_custom(&client, withWords(request), function, bytes, &response)
                   : refuse(request);
    }
    /**
     * A request of any function as another client sent it, for gateways: `body` is the 0 to 252
     * bytes after the function code, which must stay until the request has ended. For 14 and 15
     * it may lack the byte count. The request's words get the bytes that follow the function
     * code of the reply, in the order of the wire.
     */
    uint8_t forward(ModbusRequest &request, uint8_t function, const uint8_t *body, uint16_t bytes)
    {
        return mbm_client_forward(&client, withWords(request), function, body, bytes);
    }

    /** Milliseconds that a reply may take, 0 to 1000000; 2000 at first. */
    uint8_t setResponseTimeout(uint32_t ms) { return mbm_client_setResponseTimeout(&client, ms); }
    /** How often a request is repeated if its reply is missing, damaged or malformed, 0 to 255; 0 at first. */
    uint8_t setRetries(uint8_t retries) { return mbm_client_setRetries(&client, retries); }
    /**
     * How often a request that a busy device refuses is repeated, after `waitMs` milliseconds
     * each time, 0 to 255: any request that it answers with exception 06, and one that only
     * reads that it answers with exception 05. See mbm_client_setBusyRetries.
     */
    uint8_t setBusyRetries(uint8_t retries, uint32_t waitMs)
    {
        return mbm_client_setBusyRetries(&client, retries, waitMs);
    }
    /**
     * On Modbus TCP, the replies that are accepted with another unit or transaction identifier:
     * MBM_ACCEPT_UNIT, MBM_ACCEPT_TRANSACTION, both or 0 (at first). See mbm_client_setAccept.
     */
    uint8_t setAccept(uint8_t accept) { return mbm_client_setAccept(&client, accept); }
    /** Accepts replies that deviate from the standard; off at first. See mbm_client_setLenient. */
    uint8_t setLenient(bool on) { return mbm_client_setLenient(&client, on); }
    /** The least time from the end of a request to the next one, 0 to 65535 ms; 0 at first. */
    uint8_t setMessageWait(uint32_t waitMs) { return mbm_client_setMessageWait(&client, waitMs); }
    /**
     * Milliseconds before a repetition: MBM_BACKOFF_NONE (at first), _FIXED, _LINEAR or
     * _EXPONENTIAL, the first wait and the longest. Other requests are sent meanwhile.
     */
    uint8_t setBackoff(uint8_t backoff, uint32_t ms, uint32_t mostMs)
    {
        return mbm_client_setBackoff(&client, backoff, ms, mostMs);
    }
    /** The part of each such wait that `random` may take off, 0 to 100 percent; see mbm_client_setJitter. */
    uint8_t setJitter(uint8_t percent, uint32_t (*random)(void *context), void *context = nullptr)
    {
        return mbm_client_setJitter(&client, percent, random, context);
    }
    /** Counts into `counters`; set them to 0 before. nullptr stops counting. */
    uint8_t setCounters(mbm_counters *counters)
    {
        return mbm_client_setCounters(&client, counters);
    }
    /**
     * Keeps a record of each unit of an array, which must outlive its use: counts, the
     * last status, and a pause between two requests. Set `unit` and `delayUs` of each before.
     */
    template <size_t N> uint8_t setUnits(mbm_clientUnit (&units)[N])
    {
        static_assert(N <= 255, "a client keeps at most 255 records");
        return mbm_client_setUnits(&client, units, N);
    }

protected:
    /** @cond for ModbusSerialClient and ModbusTcpClient */
    ModbusClient() : client() {}

    mbm_client client;

    // Resets the client before it begins again, so that all settings are defaults. Refuses
    // with MBM_BUSY while a request is pending, and within hooks and callbacks, where poll
    // returns MBM_BUSY. (mbm_client_beginRtu and the others would cancel the requests.)
    uint8_t reset()
    {
        if (pending() != 0)
            return MBM_BUSY;
        const uint8_t status = poll();
        if (status == MBM_OK)
            client = mbm_client();
        return status == MBM_BUSY ? status : MBM_OK;
    }

    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
    /** @endcond */

private:
    // Whether the request's words hold `quantity` items; a word holds `perWord` of them.
    static bool holds(const ModbusRequest &request, uint8_t perWord, uint16_t quantity)
    {
        return quantity / perWord + (quantity % perWord != 0) <= request.size();
    }
    // Sets the data back to the request's words: forward may have set other bytes.
    static mbm_clientRequest *withWords(ModbusRequest &request)
    {
        if (!request.pending())
            request.request.data = request.words;
        return &request.request;
    }
    static uint8_t refuse(ModbusRequest &request)
    {
        if (request.pending())
            return MBM_BUSY;
        request.request.status = MBM_BUFFER_TOO_SMALL;
        return MBM_BUFFER_TOO_SMALL;
    }
};

#endif
