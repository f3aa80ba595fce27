/**
 * @file ModbusTransmission.h
 * @brief The callbacks of a sketch around a transmission, and the port of a class.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h, ModbusServer.h and ModbusClient.h.
 */

#ifndef MODBUSTRANSMISSION_H
#define MODBUSTRANSMISSION_H

#include <stdint.h>

#include "ModbusDriverPin.h"
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
 * The driver's pin, or callbacks around each transmission, for a line with an RS-485 driver.
 * `Owner` is the class that has them.
 */
template <typename Owner> class ModbusTransmissionHooks {
public:
    /**
     * Lets the object switch the driver of an RS-485 transceiver, at a pin that DE and /RE are
     * joined to. Makes the pin an output, and switches the driver off. Call it in setup, before
     * or after begin. It takes the place of the callbacks below.
     *
     * @param pin    the number that digitalWrite takes; on AVR at most 127
     * @param level  HIGH or LOW: the level with which the transceiver sends
     */
    void setDriverPin(ModbusDriverPin::Pin pin, uint8_t level = 1)
    {
        const uintptr_t driver = ModbusDriverPin::of(pin, level != 0);
        ModbusDriverPin::begin(driver);
        preTransmission(ModbusDriverPin::send, ModbusDriverPin::contextOf(driver));
        postTransmission(ModbusDriverPin::receive, ModbusDriverPin::contextOf(driver));
    }
    /**
     * As setDriverPin, for DE and /RE at two pins: the receiver is off while the object sends.
     *
     * @param driver         the pin at DE
     * @param receiver       the pin at /RE
     * @param driverLevel    the level with which the transceiver sends
     * @param receiverLevel  the level with which it receives
     */
    void setDriverPins(ModbusDriverPin::Pin driver, ModbusDriverPin::Pin receiver,
                       uint8_t driverLevel = 1, uint8_t receiverLevel = 0)
    {
        const uintptr_t driving = ModbusDriverPin::of(driver, driverLevel != 0),
                        receiving = ModbusDriverPin::of(receiver, receiverLevel == 0);
        ModbusDriverPin::begin(driving);
        ModbusDriverPin::begin(receiving);
        preTransmission(ModbusDriverPin::sendTwo, ModbusDriverPin::contextOf(driving, receiving));
        postTransmission(ModbusDriverPin::receiveTwo, ModbusDriverPin::contextOf(driving, receiving));
    }

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
