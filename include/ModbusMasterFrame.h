/**
 * @file ModbusMasterFrame.h
 * @brief Where the frame of a request lies.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_FRAME_H
#define MODBUSMASTER_FRAME_H

#include <Arduino.h>
#include <stdint.h>

#include "ModbusMasterOptions.h"
#include "mbm.h"

#if defined(MODBUSMASTER_SHARE_FRAME)
/**
 * Objects without a frame buffer of their own. While a function waits for its reply, the frame
 * lies on the stack of that function, and has only the bytes that the request needs. A
 * request that outlives its function, or whose reply may be longer, needs the buffer of
 * `Bytes` bytes that all objects share. A sketch that never calls keep does not contain that
 * buffer. It is a template, because in C++11 only a template's static members can be defined
 * in a header.
 */
template <uint8_t Bytes> class ModbusMasterFrame {
public:
    /** Has all later requests use the shared buffer. */
    static void keep()
    {
        static uint8_t buffer[Bytes];
        kept = buffer;
    }
    /** The shared buffer; nullptr before keep. */
    static uint8_t *kept;

    /**
     * How many bytes the frame of a request needs: those of the request, or of its reply beside
     * a late reply of the same length.
     *
     * @param words  how many words the request writes or reads, whichever are more
     */
    static uint8_t bytesOf(uint16_t words)
    {
        return words < (Bytes - MBM_FRAME_BYTES(0)) / 4u
                   ? static_cast<uint8_t>(MBM_FRAME_BYTES(2u * words))
                   : Bytes;
    }
};

/** @cond the definition of the static member */
template <uint8_t Bytes> uint8_t *ModbusMasterFrame<Bytes>::kept = nullptr;
/** @endcond */

#else
/** Each object has a frame buffer of its own. */
template <uint8_t Bytes> class ModbusMasterFrame {
public:
    /** Nothing to do: the buffer stays as long as the object. */
    static void keep() {}
};
#endif

#endif
