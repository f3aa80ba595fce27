/**
 * @file ModbusNumbers.h
 * @brief The orders of words, and how a class reads and writes values in words.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMasterValues.h and ModbusValues.h.
 */

#ifndef MODBUSNUMBERS_H
#define MODBUSNUMBERS_H

#include <math.h>
#include <stdint.h>

#include "mbm/values.h"

/** The orders of the words of a value. */
class ModbusWordOrder {
public:
    /** How a device lays 0xAABBCCDD out, byte by byte, in two registers. */
    enum WordOrder : uint8_t {
        orderDefault = MBM_ORDER_DEFAULT, /**< as setWordOrder says */
        orderABCD = MBM_ORDER_ABCD,       /**< high word first: most devices */
        orderCDAB = MBM_ORDER_CDAB,       /**< low word first, as ModbusMaster::send does */
        orderBADC = MBM_ORDER_BADC,       /**< high word first, low byte first */
        orderDCBA = MBM_ORDER_DCBA        /**< low word first, low byte first */
    };
};

/**
 * Reads and writes values in the words of a `Words`. Its members `toRead(space, words)` and
 * `toWrite(space, words)` return MBM_OK and set `words`. They may describe the words in
 * `space`.
 */
template <typename Words> class ModbusNumbers {
protected:
    /** @cond for the classes that have words */
    // `Stored` is the type of the getter: Value itself, or the unsigned type of its size.
    template <typename Stored, typename Value>
    bool get(uint8_t (*getter)(const mbm_registers *, uint16_t, uint8_t, Stored *),
             uint16_t index, Value &value, uint8_t order) const
    {
        static_assert(sizeof(Stored) == sizeof(Value), "the getter is for another size");
        mbm_registers space;
        const mbm_registers *words;
        return static_cast<const Words *>(this)->toRead(space, words) == MBM_OK &&
               getter(words, index, order, reinterpret_cast<Stored *>(&value)) == MBM_OK;
    }
    // Returns the value, or `none` if it extends past the words.
    template <typename Stored, typename Value>
    Value valueOf(uint8_t (*getter)(const mbm_registers *, uint16_t, uint8_t, Stored *),
                  uint16_t index, uint8_t order, Value none) const
    {
        get(getter, index, none, order);
        return none;
    }

    static double notANumber()
    {
        const float value = NAN; // NAN is a float or a double
        return static_cast<double>(value);
    }

    // For setters that take the number itself.
    template <typename Value>
    uint8_t set(uint8_t (*setter)(const mbm_registers *, uint16_t, uint8_t, Value), uint16_t index,
                uint8_t order, Value value)
    {
        mbm_registers space;
        const mbm_registers *words;
        const uint8_t status = static_cast<Words *>(this)->toWrite(space, words);
        return status == MBM_OK ? setter(words, index, order, value) : status;
    }
    // For setters that take a pointer to the number.
    template <typename Value>
    uint8_t set(uint8_t (*setter)(const mbm_registers *, uint16_t, uint8_t, const Value *),
                uint16_t index, uint8_t order, const Value &value)
    {
        mbm_registers space;
        const mbm_registers *words;
        const uint8_t status = static_cast<Words *>(this)->toWrite(space, words);
        return status == MBM_OK ? setter(words, index, order, &value) : status;
    }
    /** @endcond */
};

#endif
