/**
 * @file ModbusValues.h
 * @brief Floats, integers, texts and bits in an array of words.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusClient.h. Members that a sketch does not
 * call take no flash.
 */

#ifndef MODBUSVALUES_H
#define MODBUSVALUES_H

#include <stddef.h>
#include <stdint.h>

#include "ModbusNumbers.h"
#include "mbm/values.h"

/**
 * An array of words, and the values in it. `index` counts words from 0: a float at
 * index 2 is in words 2 and 3.
 *
 * There are two ways to read each value. With a variable after the index, the result is
 * true, or false with the variable unchanged if the value extends past the words.
 * Without a variable, the result is the value: 0 or NAN past the words.
 *
 * The members that set a value return MBM_OK, or MBM_ILLEGAL_DATA_ADDRESS with nothing set
 * if the value extends past the words.
 */
class ModbusValues : public ModbusWordOrder, public ModbusNumbers<ModbusValues> {
public:
    ModbusValues(const ModbusValues &) = delete;
    ModbusValues &operator=(const ModbusValues &) = delete;

    /** The order of values for calls without an order; orderABCD at first. */
    void setWordOrder(WordOrder order) { view.order = order; }
    /** How many words there are. */
    uint16_t size() const { return view.count; }
    /** The word `index`, which is below size(). */
    uint16_t &operator[](uint16_t index) { return words[index]; }
    /** @copydoc operator[] */
    const uint16_t &operator[](uint16_t index) const { return words[index]; }

    /** An integer: a word, 0 to 65535; only the bytes of its order matter. */
    bool getUInt16(uint16_t index, uint16_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint16, index, value, order);
    }
    /** @copydoc getUInt16 */
    uint16_t getUInt16(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint16, index, order, uint16_t{0});
    }
    /** An integer: a word, -32768 to 32767. */
    bool getInt16(uint16_t index, int16_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint16, index, value, order);
    }
    /** @copydoc getInt16 */
    int16_t getInt16(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint16, index, order, int16_t{0});
    }
    /** An integer: two words, 0 to 4294967295. */
    bool getUInt32(uint16_t index, uint32_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint32, index, value, order);
    }
    /** @copydoc getUInt32 */
    uint32_t getUInt32(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint32, index, order, uint32_t{0});
    }
    /** An integer: two words, two's complement. */
    bool getInt32(uint16_t index, int32_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint32, index, value, order);
    }
    /** @copydoc getInt32 */
    int32_t getInt32(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint32, index, order, int32_t{0});
    }
    /** An integer: four words, without a sign. */
    bool getUInt64(uint16_t index, uint64_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint64, index, value, order);
    }
    /** @copydoc getUInt64 */
    uint64_t getUInt64(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint64, index, order, uint64_t{0});
    }
    /** An integer: four words, two's complement. */
    bool getInt64(uint16_t index, int64_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint64, index, value, order);
    }
    /** @copydoc getInt64 */
    int64_t getInt64(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint64, index, order, int64_t{0});
    }
    /** A float: two words, IEEE 754. */
    bool getFloat(uint16_t index, float &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getFloat, index, value, order);
    }
    /** @copydoc getFloat */
    float getFloat(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getFloat, index, order, NAN);
    }
    /** A double: four words, IEEE 754; rounded where a double has 32 bits, as on AVR. */
    bool getDouble(uint16_t index, double &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getDouble, index, value, order);
    }
    /** @copydoc getDouble */
    double getDouble(uint16_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getDouble, index, order, notANumber());
    }
    /**
     * A text, up to its first NUL or the end of its field.
     *
     * @param index   the word in which it begins
     * @param length  bytes of its field, two a word
     * @param text    gets the text and a NUL
     * @param bytes   bytes of `text`: length + 1 are always enough
     * @param order   with orderBADC or orderDCBA the low byte of a word comes first
     * @return false with `text` unchanged if the words end before the field does, or
     *         `text` is too small
     */
    bool getString(uint16_t index, uint16_t length, char *text, uint16_t bytes,
                   WordOrder order = orderDefault) const
    {
        return mbm_registers_getString(&view, index, length, order, text, bytes) == MBM_OK;
    }

    /** Sets an integer: a word, 0 to 65535; only the bytes of its order matter. */
    uint8_t setUInt16(uint16_t index, uint16_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint16, index, order, value);
    }
    /** Sets an integer: a word, -32768 to 32767. */
    uint8_t setInt16(uint16_t index, int16_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint16, index, order, static_cast<uint16_t>(value));
    }
    /** Sets an integer: two words, 0 to 4294967295. */
    uint8_t setUInt32(uint16_t index, uint32_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint32, index, order, value);
    }
    /** Sets an integer: two words, two's complement. */
    uint8_t setInt32(uint16_t index, int32_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint32, index, order, static_cast<uint32_t>(value));
    }
    /** Sets an integer: four words, without a sign. */
    uint8_t setUInt64(uint16_t index, uint64_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint64, index, order, value);
    }
    /** Sets an integer: four words, two's complement. */
    uint8_t setInt64(uint16_t index, int64_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint64, index, order, static_cast<uint64_t>(value));
    }
    /** Sets a float: two words, IEEE 754. */
    uint8_t setFloat(uint16_t index, float value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setFloat, index, order, value);
    }
    /** Sets a double: four words, IEEE 754; rounded where a double has 32 bits, as on AVR. */
    uint8_t setDouble(uint16_t index, double value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setDouble, index, order, value);
    }
    /**
     * Sets a text, padded with NULs to the end of its field.
     *
     * @param index   the word in which it begins
     * @param length  bytes of its field, two a word
     * @param text    ends with a NUL, which the field need not hold
     * @param order   with orderBADC or orderDCBA the low byte of a word comes first
     * @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS if the words end
     *         before the field does, MBM_BUFFER_TOO_SMALL if the field ends before the
     *         text does
     */
    uint8_t setString(uint16_t index, uint16_t length, const char *text,
                      WordOrder order = orderDefault)
    {
        return mbm_registers_setString(&view, index, length, order, text);
    }

    /**
     * A coil or discrete input that was read, or is to be written: `bit` 0 is the
     * first one. false past the end of the words.
     */
    bool getBit(uint16_t bit) const { return (getByte(bit / 8) >> bit % 8 & 1) != 0; }
    /** Sets a coil to write: MBM_OK, or MBM_ILLEGAL_DATA_ADDRESS past the end of the words. */
    uint8_t setBit(uint16_t bit, bool on)
    {
        const uint8_t old = getByte(bit / 8), mask = static_cast<uint8_t>(1u << bit % 8);
        return setByte(bit / 8, static_cast<uint8_t>(on ? old | mask : old & ~mask));
    }
    /**
     * A byte as on the wire, for functions that transfer bytes: coils, server id, device
     * identification, functions of yours. 0 past the end of the words.
     */
    uint8_t getByte(uint16_t index) const
    {
        return index / 2 < view.count ? reinterpret_cast<const uint8_t *>(words)[index] : 0;
    }
    /** Sets a byte: MBM_OK, or MBM_ILLEGAL_DATA_ADDRESS past the end of the words. */
    uint8_t setByte(uint16_t index, uint8_t value)
    {
        if (index / 2 >= view.count)
            return MBM_ILLEGAL_DATA_ADDRESS;
        reinterpret_cast<uint8_t *>(words)[index] = value;
        return MBM_OK;
    }

protected:
    /** @cond for the classes that have words */
    ModbusValues(uint16_t *array, uint16_t count) : view(), words(array)
    {
        view.data = array;
        view.count = count;
        view.kind = MBM_REGISTERS_INTO_WORDS;
        view.order = MBM_ORDER_ABCD;
    }

    mbm_registers view;
    uint16_t *words;
    /** @endcond */

private:
    friend class ModbusNumbers<ModbusValues>;

    uint8_t toRead(mbm_registers &, const mbm_registers *&described) const
    {
        described = &view;
        return MBM_OK;
    }
    uint8_t toWrite(mbm_registers &space, const mbm_registers *&described)
    {
        return toRead(space, described);
    }
};

#endif
