/**
 * @file ModbusRequest.h
 * @brief A request of a ModbusClient: its unit, words, status and callback.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusClient.h.
 */

#ifndef MODBUSREQUEST_H
#define MODBUSREQUEST_H

#include <stddef.h>
#include <stdint.h>

#include "ModbusCallback.h"
#include "ModbusValues.h"
#include "mbm/client.h"

/**
 * A request to one unit. A write sends its words, and a read fills them. The members of
 * ModbusValues read and set values in the words. Use a request as often as you like.
 *
 * While it is pending, do not destroy it and do not change its words: make requests
 * global or static. ModbusRequestOf has its own words.
 */
class ModbusRequest : public ModbusValues {
public:
    /**
     * For `unit`, without words: for functions 05, 06 and 16. Every call of a request for a
     * unit above 255 is refused with MBM_INVALID_ARGUMENT.
     */
    ModbusRequest(uint16_t unit) : ModbusRequest(unit, nullptr, 0) {}
    /** For `unit`, with the words of an array, which must outlive it. */
    template <size_t N>
    ModbusRequest(uint16_t unit, uint16_t (&array)[N]) : ModbusRequest(unit, array, N)
    {
        static_assert(N <= 32767, "a request has at most 32767 words");
    }
    /** For `unit`, with `quantity` (0 to 32767) words, which must outlive it. */
    ModbusRequest(uint16_t unit, uint16_t *array, uint16_t quantity)
        : ModbusValues(array, quantity), request()
    {
        request.context = this;
        request.reply = array;
        request.replyBytes = static_cast<uint16_t>(2ul * quantity);
        request.unit = unit;
    }

    /**
     * Sets the unit of later calls: on a serial line 1 to 247, 0 broadcasts; on TCP 1
     * to 255. Returns MBM_OK; MBM_INVALID_ARGUMENT above 255; MBM_BUSY while the request is
     * pending. A call that is refused changes nothing.
     */
    uint8_t setUnitID(uint16_t unit)
    {
        if (unit > 255)
            return MBM_INVALID_ARGUMENT;
        if (pending())
            return MBM_BUSY;
        request.unit = unit;
        return MBM_OK;
    }
    /** The unit of later calls. */
    uint16_t getUnitID() const { return request.unit; }

    /**
     * Sets the response timeout of later calls in milliseconds, instead of the client's; 0
     * (at first): the client's. Returns MBM_OK; MBM_BUSY, with nothing changed, while the
     * request is pending; MBM_INVALID_ARGUMENT above 1000000.
     */
    uint8_t setResponseTimeout(uint32_t ms)
    {
        if (ms > 1000000)
            return MBM_INVALID_ARGUMENT;
        if (pending())
            return MBM_BUSY;
        request.timeoutMs = ms;
        return MBM_OK;
    }
    /**
     * Sets how often the client repeats later calls at most, 1 to 254, instead of its own
     * number; MBM_NO_RETRIES: never; 0 (at first): the client's. Call setRetries of the client
     * once before, also with 0: without it a call with a number returns MBM_INVALID_ARGUMENT.
     * Returns MBM_OK; MBM_BUSY, with nothing changed, while the request is pending.
     */
    uint8_t setRetryLimit(uint8_t limit)
    {
        if (pending())
            return MBM_BUSY;
        request.retryLimit = limit;
        return MBM_OK;
    }

    /**
     * MBM_OK, the device's exception code (0x01 to 0x7F), or the reason why there is
     * no reply (0xE0 and up). MBM_PENDING until it has ended, MBM_OK before the first call.
     */
    uint8_t status() const { return request.status; }
    /** Whether it waits in the queue or is in flight. */
    bool pending() const { return request.status == MBM_PENDING; }
    /** The raw exception code of the reply; 0 if it was no exception. */
    uint8_t getExceptionCode() const { return request.exception; }
    /** How many bytes the reply filled; a word has two. */
    uint8_t length() const { return request.length; }
    /** The transaction identifier of the frame sent last; 0 in RTU and ASCII. */
    uint16_t wireTransaction() const { return mbm_client_wireTransaction(&request); }

    /**
     * Sets the callback that runs when the request has ended: a function, or a lambda
     * whose captures have at most MODBUS_CAPTURE_BYTES; nullptr for none. poll or wait of
     * the client calls it. It may queue requests, also this one. It is not called for a
     * request that cancel ended.
     */
    template <typename Function> void onDone(const Function &function)
    {
        callback.set(function);
        request.done = callback.isSet() ? doneHook : nullptr;
    }
    /** @copydoc onDone */
    void onDone(void (*function)(ModbusRequest &))
    {
        callback.set(function);
        request.done = callback.isSet() ? doneHook : nullptr;
    }

private:
    friend class ModbusClient;

    mbm_clientRequest request;
    ModbusCallback<ModbusRequest> callback;

    static void doneHook(void *context, mbm_clientRequest *)
    {
        ModbusRequest &ended = *static_cast<ModbusRequest *>(context);
        ended.callback(ended);
    }
};

/** A request with its own words, all 0 at first. */
template <uint16_t Words> class ModbusRequestOf : public ModbusRequest {
public:
    static_assert(Words >= 1 && Words <= 126, "a request transfers 1 to 126 words");

    /** For `unit`. */
    ModbusRequestOf(uint16_t unit) : ModbusRequest(unit, storage, Words), storage() {}

private:
    uint16_t storage[Words];
};

#endif
