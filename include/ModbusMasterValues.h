/**
 * @file ModbusMasterValues.h
 * @brief Floats, wide integers, texts and single bits in the words of ModbusMaster.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h. A sketch that calls
 * none of these members is not larger.
 */

#ifndef MODBUSMASTER_VALUES_H
#define MODBUSMASTER_VALUES_H

#include <stdint.h>

#include "ModbusNumbers.h"
#include "mbm/values.h"

/**
 * The words of a ModbusMaster as values. `index` counts words from 0, as with
 * getResponseBuffer and setTransmitBuffer: a float at index 2 is in words 2 and 3.
 *
 * There are two ways to read each value. With a variable after the index, the result
 * is true, or false with the variable unchanged if the value extends past the buffer.
 * Without a variable, the result is the value: 0 or NAN past the buffer. Both read the
 * words of the last successful read, so check its status first.
 *
 * The members that set a value return ku8MBSuccess, or 0x02 with nothing set if the
 * value extends past the buffer.
 */
template <typename Master>
class ModbusMasterValues : public ModbusWordOrder,
                           public ModbusNumbers<ModbusMasterValues<Master>> {
public:
    /** The order of values for calls without an order; orderABCD at first. */
    void setWordOrder(WordOrder order)
    {
        static_cast<Master *>(this)->state.order = order <= 31 ? order & 31u : 31u;
    }

    /** An integer in the response: a word, 0 to 65535; only the bytes of its order matter. */
    bool getResponseUInt16(uint8_t index, uint16_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint16, index, value, order);
    }
    /** As above; 0 past the end of the buffer. */
    uint16_t getResponseUInt16(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint16, index, order, uint16_t{0});
    }

    /** An integer in the response: a word, -32768 to 32767. */
    bool getResponseInt16(uint8_t index, int16_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint16, index, value, order);
    }
    /** As above; 0 past the end of the buffer. */
    int16_t getResponseInt16(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint16, index, order, int16_t{0});
    }

    /** An integer in the response: two words, 0 to 4294967295. */
    bool getResponseUInt32(uint8_t index, uint32_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint32, index, value, order);
    }
    /** As above; 0 past the end of the buffer. */
    uint32_t getResponseUInt32(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint32, index, order, uint32_t{0});
    }

    /** An integer in the response: two words, two's complement. */
    bool getResponseInt32(uint8_t index, int32_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint32, index, value, order);
    }
    /** As above; 0 past the end of the buffer. */
    int32_t getResponseInt32(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint32, index, order, int32_t{0});
    }

    /** An integer in the response: four words, without a sign. */
    bool getResponseUInt64(uint8_t index, uint64_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint64, index, value, order);
    }
    /** As above; 0 past the end of the buffer. */
    uint64_t getResponseUInt64(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint64, index, order, uint64_t{0});
    }

    /** An integer in the response: four words, two's complement. */
    bool getResponseInt64(uint8_t index, int64_t &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getUint64, index, value, order);
    }
    /** As above; 0 past the end of the buffer. */
    int64_t getResponseInt64(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getUint64, index, order, int64_t{0});
    }

    /** A float in the response: two words, IEEE 754. */
    bool getResponseFloat(uint8_t index, float &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getFloat, index, value, order);
    }
    /** As above; NAN past the end of the buffer. */
    float getResponseFloat(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getFloat, index, order, NAN);
    }

    /** A double in the response: four words, IEEE 754; rounded where a double has 32 bits, as on AVR. */
    bool getResponseDouble(uint8_t index, double &value, WordOrder order = orderDefault) const
    {
        return get(mbm_registers_getDouble, index, value, order);
    }
    /** As above; NAN past the end of the buffer. */
    double getResponseDouble(uint8_t index, WordOrder order = orderDefault) const
    {
        return valueOf(mbm_registers_getDouble, index, order, notANumber());
    }

    /**
     * A text in the response, up to its first NUL or the end of its field.
     *
     * @param index   the word in which it begins
     * @param length  bytes of its field, two a word
     * @param text    gets the text and a NUL
     * @param size    bytes of `text`: length + 1 are always enough
     * @param order   with orderBADC or orderDCBA the low byte of a word comes first
     * @return false with `text` unchanged if the buffer ends before the field
     *         does, or `text` is too small
     */
    bool getResponseString(uint8_t index, uint8_t length, char *text, uint16_t size,
                           WordOrder order = orderDefault) const
    {
        mbm_registers space;
        const mbm_registers *words;
        return toRead(space, words) == MBM_OK &&
               mbm_registers_getString(words, index, length, order, text, size) == MBM_OK;
    }

    /** Whether a coil or input of the response is on: `bit` 0 is the first one read. */
    bool getResponseBit(uint16_t bit, bool &on) const
    {
        mbm_registers space;
        const mbm_registers *words;
        uint8_t value;
        bool found = toRead(space, words) == MBM_OK &&
                     mbm_registers_getBit(words, bit / 16, bit % 16, &value) == MBM_OK;
        if (found)
            on = value != 0;
        return found;
    }
    /** As above; false past the end of the buffer. */
    bool getResponseBit(uint16_t bit) const
    {
        bool on = false;
        getResponseBit(bit, on);
        return on;
    }

    /** Sets an integer to write: a word, 0 to 65535; only the bytes of its order matter. */
    uint8_t setTransmitUInt16(uint8_t index, uint16_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint16, index, order, value);
    }

    /** Sets an integer to write: a word, -32768 to 32767. */
    uint8_t setTransmitInt16(uint8_t index, int16_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint16, index, order, static_cast<uint16_t>(value));
    }

    /** Sets an integer to write: two words, 0 to 4294967295. */
    uint8_t setTransmitUInt32(uint8_t index, uint32_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint32, index, order, value);
    }

    /** Sets an integer to write: two words, two's complement. */
    uint8_t setTransmitInt32(uint8_t index, int32_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint32, index, order, static_cast<uint32_t>(value));
    }

    /** Sets an integer to write: four words, without a sign. */
    uint8_t setTransmitUInt64(uint8_t index, uint64_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint64, index, order, value);
    }

    /** Sets an integer to write: four words, two's complement. */
    uint8_t setTransmitInt64(uint8_t index, int64_t value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setUint64, index, order, static_cast<uint64_t>(value));
    }

    /** Sets a float to write: two words, IEEE 754. */
    uint8_t setTransmitFloat(uint8_t index, float value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setFloat, index, order, value);
    }

    /** Sets a double to write: four words, IEEE 754; rounded where a double has 32 bits, as on AVR. */
    uint8_t setTransmitDouble(uint8_t index, double value, WordOrder order = orderDefault)
    {
        return set(mbm_registers_setDouble, index, order, value);
    }

    /**
     * Sets a text to write, padded with NULs to the end of its field.
     *
     * @param index   the word in which it begins
     * @param length  bytes of its field, two a word
     * @param text    ends with a NUL, which the field need not hold
     * @param order   with orderBADC or orderDCBA the low byte of a word comes first
     * @return ku8MBSuccess, or with nothing set 0x02 if the buffer ends before the
     *         field does, ku8MBBufferTooSmall if the field ends before the text does
     */
    uint8_t setTransmitString(uint8_t index, uint8_t length, const char *text,
                              WordOrder order = orderDefault)
    {
        mbm_registers space;
        const mbm_registers *words;
        const uint8_t status = toWrite(space, words);
        return status == MBM_OK ? mbm_registers_setString(words, index, length, order, text)
                                : status;
    }

    /** Sets a coil to write: `bit` 0 is the first one written. */
    uint8_t setTransmitBit(uint16_t bit, bool on)
    {
        mbm_registers space;
        const mbm_registers *words;
        const uint8_t status = toWrite(space, words);
        return status == MBM_OK ? mbm_registers_setBit(words, bit / 16, bit % 16, on) : status;
    }

private:
    typedef ModbusNumbers<ModbusMasterValues> Numbers;
    friend Numbers;
    using Numbers::get;
    using Numbers::notANumber;
    using Numbers::set;
    using Numbers::valueOf;

    uint8_t toRead(mbm_registers &space, const mbm_registers *&words) const
    {
        const Master &master = *static_cast<const Master *>(this);
        space = {master.state.response, 0, Master::responseWords, MBM_REGISTERS_OF_WORDS,
                 master.state.order};
        words = &space;
        return MBM_OK;
    }
    uint8_t toWrite(mbm_registers &space, const mbm_registers *&words)
    {
        Master &master = *static_cast<Master *>(this);
        space = {master.state.transmit, 0, Master::transmitWords, MBM_REGISTERS_INTO_WORDS,
                 master.state.order};
        words = &space;
        return MBM_OK;
    }
};

#endif
