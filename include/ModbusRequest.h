/**
 * @file ModbusRequest.h
 * @brief A request of a ModbusClient, with its words and what comes of it.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusClient.h.
 */

#ifndef MODBUSREQUEST_H
#define MODBUSREQUEST_H

#include <stddef.h>
#include <stdint.h>

#include "ModbusCallback.h"
#include "ModbusValues.h"
#include "mbm.h"

/**
 * A request to one unit. Its words are what a function that writes sends, and what a
 * function that reads fills; ModbusValues reads and sets values in them. It may be used
 * again and again.
 *
 * While it is pending it must not be destroyed, and its words must be left alone:
 * make requests global or static. ModbusRequestOf has words of its own.
 */
class ModbusRequest : public ModbusValues {
public:
    /** For `unit`, without words: for what only writes a value. */
    ModbusRequest(uint8_t unit) : ModbusRequest(unit, nullptr, 0) {}
    /** For `unit`, with the words of an array, which must outlive it. */
    template <size_t N>
    ModbusRequest(uint8_t unit, uint16_t (&array)[N]) : ModbusRequest(unit, array, N)
    {
        static_assert(N <= 32767, "a request has at most 32767 words");
    }
    /** For `unit`, with `quantity` (0 to 32767) words, which must outlive it. */
    ModbusRequest(uint8_t unit, uint16_t *array, uint16_t quantity)
        : ModbusValues(array, quantity), request(), callback()
    {
        request.context = this;
        request.reply = array;
        request.replyBytes = static_cast<uint16_t>(2ul * quantity);
        request.unit = unit;
    }

    /**
     * Sets whom later calls are for: on a serial line 1 to 247, 0 broadcasts; on TCP 1
     * to 255. MBM_OK; MBM_BUSY, with nothing changed, while the request is pending.
     */
    uint8_t setUnitID(uint8_t unit)
    {
        if (pending())
            return MBM_BUSY;
        request.unit = unit;
        return MBM_OK;
    }
    /** Whom it is for. */
    uint8_t getUnitID() const { return request.unit; }

    /**
     * How it ended: MBM_OK, the device's exception code (0x01 to 0x7F), or why there is
     * no reply (0xE0 and up). MBM_PENDING until then, MBM_OK before the first call.
     */
    uint8_t status() const { return request.status; }
    /** Whether it waits or is under way. */
    bool pending() const { return request.status == MBM_PENDING; }
    /** The raw exception code of the reply; 0 if it was no exception. */
    uint8_t getExceptionCode() const { return request.exception; }
    /** How many bytes the reply filled, two a word. */
    uint8_t length() const { return request.length; }
    /** The transaction identifier of the frame sent last; 0 in RTU and ASCII. */
    uint16_t wireTransaction() const { return mbm_client_wireTransaction(&request); }

    /**
     * Sets what is called when it has ended: a function, or a lambda with captures that
     * MODBUS_CAPTURE_BYTES hold; nullptr for none. It is called from poll or wait of
     * the client, may make requests, this one too, and is not called for a request
     * that cancel gave up.
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

/** A request with words of its own, all 0 at first. */
template <uint16_t Words> class ModbusRequestOf : public ModbusRequest {
public:
    static_assert(Words >= 1 && Words <= 126, "a request transfers 1 to 126 words");

    /** For `unit`. */
    ModbusRequestOf(uint8_t unit) : ModbusRequest(unit, storage, Words), storage() {}

private:
    uint16_t storage[Words];
};

#endif
