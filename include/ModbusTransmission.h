/**
 * @file ModbusTransmission.h
 * @brief The callbacks of a sketch around a transmission, and the port of a class.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h, ModbusServer.h and ModbusClient.h.
 */

#ifndef MODBUSTRANSMISSION_H
#define MODBUSTRANSMISSION_H

#include <stdint.h>

#include "mbm/base.h"

/** @cond for the classes that have callbacks */
/** A function of the sketch, with or without an argument; none if it is zeroed. */
struct ModbusTransmissionHook {
    void (*function)(void *);
    void *context;

    void set(void (*callback)(void *), void *argument)
    {
        function = callback;
        context = argument;
    }
    void set(void (*callback)())
    {
        set(callback != nullptr ? withoutContext : nullptr, reinterpret_cast<void *>(callback));
    }
    void call() const
    {
        if (function != nullptr)
            function(context);
    }

private:
    static void withoutContext(void *callback) { reinterpret_cast<void (*)()>(callback)(); }
};

/** Returns a port. The functions that are nullptr are never called. */
inline mbm_port modbusPort(void *context, int16_t (*read)(void *, uint8_t *, uint16_t),
                           int16_t (*write)(void *, const uint8_t *, uint16_t),
                           uint32_t (*micros)(void *), uint8_t (*flush)(void *) = nullptr,
                           void (*preTransmission)(void *) = nullptr,
                           void (*postTransmission)(void *) = nullptr)
{
    mbm_port port;
    port.context = context;
    port.read = read;
    port.write = write;
    port.micros = micros;
    port.flush = flush;
    port.preTransmission = preTransmission;
    port.postTransmission = postTransmission;
    port.idle = nullptr;
    return port;
}
/** @endcond */

/**
 * The callbacks around each transmission, for a line with an RS-485 driver. `Owner` is the
 * class that has them.
 */
template <typename Owner> class ModbusTransmissionHooks {
public:
    /** Sets a callback before each transmission (RS-485 driver on); nullptr for none. */
    void preTransmission(void (*callback)()) { owner().preHookOf().set(callback); }
    /** As preTransmission(callback), with `context` as its argument. */
    void preTransmission(void (*callback)(void *), void *context)
    {
        owner().preHookOf().set(callback, context);
    }

    /** Sets a callback after the last bit of each transmission (RS-485 driver off); nullptr for none. */
    void postTransmission(void (*callback)()) { owner().postHookOf().set(callback); }
    /** As postTransmission(callback), with `context` as its argument. */
    void postTransmission(void (*callback)(void *), void *context)
    {
        owner().postHookOf().set(callback, context);
    }

private:
    Owner &owner() { return *static_cast<Owner *>(this); }
};

#endif
