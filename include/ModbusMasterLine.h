/**
 * @file ModbusMasterLine.h
 * @brief The line that ModbusMaster objects use.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_LINE_H
#define MODBUSMASTER_LINE_H

#include <Arduino.h>
#include <stdint.h>

#include "ModbusMasterOptions.h"
#include "mbm/master.h"

/** @cond private to ModbusMaster */
// What the hooks of the port need. `User` is the object whose request is pending.
template <typename User> struct ModbusMasterWire {
    mbm_line line;
    User *user;
    Stream *counting; // the last Stream whose write returned another number than 0
    bool sent;     // the request is on the wire, so a reply is waited for
    bool keepsGap; // the sketch has set the silence before a request
};

#if defined(MODBUSMASTER_SHARE_LINE)
// One line for all objects. While a function waits for its reply, the frame lies on the stack of
// that function, and has only the bytes that the request needs. A request that outlives its
// function, or whose reply may be longer, needs the buffer of `Bytes` bytes. A sketch that never
// calls keep contains neither that buffer nor the code to give a request up. It is
// a template, because in C++11 only a template's static members can be defined in a header.
template <typename User, uint8_t Bytes> class ModbusMasterLine {
public:
    static ModbusMasterWire<User> wire;

    // The data of a request that may outlive the function that makes the request.
    struct Kept {
        uint8_t (*cancel)(mbm_node *);
        uint8_t frame[Bytes];
    };

    // Makes all later requests use the buffer.
    static void keep()
    {
        static Kept all = {mbm_node_cancel, {}};
        kept = &all;
    }

    // Gives up the request of a node.
    static void giveUp(mbm_node &node)
    {
        if (kept != nullptr)
            kept->cancel(&node);
    }

    // nullptr before keep.
    static Kept *kept;

    // How many bytes the frame of a read of `words` words needs: those of its reply, beside another
    // that is held without its CRC, and one, since a full buffer makes space. If that is too much,
    // a frame of 9 bytes fits beside a held reply.
    static uint8_t bytesOfRead(uint16_t words)
    {
        return words <= (Bytes - 9u) / 4u ? static_cast<uint8_t>(4u * words + 9u)
                                          : bytesOfWrite(words);
    }

    // The same for a write, whose replies are short.
    static uint8_t bytesOfWrite(uint16_t words)
    {
        return words <= (Bytes - MBM_FRAME_BYTES(0)) / 2u
                   ? static_cast<uint8_t>(MBM_FRAME_BYTES(words))
                   : Bytes;
    }

    // The line knows when it was used.
    static void used() {}
};

template <typename User, uint8_t Bytes>
ModbusMasterWire<User> ModbusMasterLine<User, Bytes>::wire = {};
template <typename User, uint8_t Bytes>
typename ModbusMasterLine<User, Bytes>::Kept *ModbusMasterLine<User, Bytes>::kept = nullptr;

#else
// When any object used a line last. All objects may share a line, so the silence before a
// request counts from that time.
template <typename Unused> class ModbusMasterUse {
public:
    // A line was used just now.
    static void note() { time = micros() & 0xFFFFFFFFu; }

    // Tells the line of an object when another object used a line last.
    static void tell(mbm_line &line)
    {
        if (last != &line) {
            last = &line;
            mbm_line_usedAt(&line, time);
        }
    }

private:
    // The pointer is only compared. Two threads, each with its own line, may race for it;
    // at worst one of them waits for a silence that was not needed.
    static const mbm_line *last;
    static uint32_t time;
};

template <typename Unused> const mbm_line *ModbusMasterUse<Unused>::last = nullptr;
template <typename Unused> uint32_t ModbusMasterUse<Unused>::time = 0;

// A line for each object, with its port and its frame buffer.
template <typename User, uint8_t Bytes> class ModbusMasterLine {
public:
    ModbusMasterWire<User> wire;
    mbm_port port;
    uint8_t frame[Bytes];
    bool isRateKept;
    // mbm_line_setBaudRate once the rate of a port is known, else nullptr. A program with ports
    // whose rate is not known does not contain that function.
    uint8_t (*forget)(mbm_line *, uint32_t);

    static uint8_t bytesOfRead(uint16_t) { return Bytes; }
    static uint8_t bytesOfWrite(uint16_t) { return Bytes; }
    static void keep() {}
    static void giveUp(mbm_node &node) { mbm_node_cancel(&node); }
    static void used() { ModbusMasterUse<void>::note(); }

    // The sketch has set the gap, so no port changes it.
    void keepRate()
    {
        isRateKept = true;
        forget = nullptr;
    }

    // Takes over the bit rate that the open port reports; 0 if it is closed.
    template <typename Port> void takeRate(Port &serial)
    {
        if (!isRateKept && mbm_line_setBaudRate(&wire.line, uint32_t(serial.baudRate())) == MBM_OK)
            forget = mbm_line_setBaudRate;
    }

    // Forgets the rate of the port before.
    void forgetRate()
    {
        if (forget != nullptr)
            forget(&wire.line, 0);
        forget = nullptr;
    }
};
#endif
/** @endcond */

#endif
