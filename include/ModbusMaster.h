/**
 * @file ModbusMaster.h
 * @brief A Modbus RTU master for Arduino sketches, over mbm.h.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap.
 *
 * Sketches written for the ModbusMaster library, 0.9 to 2.0.1, compile and run
 * unchanged. Addresses are those on the wire, from 0. What differs for the
 * better: a reply is found behind noise and foreign frames, checked against
 * its request, and a silence of t3.5 is kept before each request.
 *
 * The macros that size the buffers and choose ports are in ModbusMasterOptions.h.
 */

#ifndef MODBUSMASTER_H
#define MODBUSMASTER_H
/** The original's guard, which sketches look at. */
#define ModbusMaster_h

#include <Arduino.h>
#include <stdint.h>
#include <string.h>

#include "ModbusMasterBoards.h"
#include "ModbusMasterConstants.h"
#include "ModbusMasterHelpers.h"
#include "ModbusMasterOptions.h"
#include "ModbusMasterPorts.h"
#include "ModbusMasterTurn.h"
#include "ModbusMasterValues.h"
#include "ModbusStatusText.h"
#include "mbm.h"

/**
 * A Modbus RTU master: one line, one request at a time.
 *
 * Any number of objects may share a Stream, one request after the other. Use
 * an object from one thread, never from an interrupt. Callbacks may call other
 * objects. On its own object an idle callback may call everything; requests are
 * answered with ku8MBBusy. In preTransmission and postTransmission everything is
 * answered with ku8MBBusy, and changes nothing; but words may be read, set and cleared.
 */
class ModbusMaster : public ModbusMasterStatics<void>, public ModbusMasterValues<ModbusMaster> {
public:
    /** Slave 1; begin(baud) opens Serial. Touches neither clock nor port. */
    ModbusMaster() : state() { lendBuffers(); }

    /** As ModbusMaster(), for `slave` (1 to 247; 0 is broadcast). */
    ModbusMaster(uint8_t slave) : ModbusMaster() { setSlaveID(slave); }

    /**
     * As ModbusMaster(slave), with begin(baud) opening Serial1 to Serial3 for
     * `port` 1 to 3; Serial for others, and for a UART that the board lacks.
     */
    // Inline always, so that a constant port names one UART.
    MODBUSMASTER_INLINE ModbusMaster(uint8_t port, uint8_t slave) : ModbusMaster(slave)
    {
        state.port = port & 0x7Fu;
        Ports::use(port);
    }

    /**
     * A copy has buffers of its own, with the same words, settings, callbacks
     * and Stream. Its queue of send is empty, and a request under way stays
     * with the original; copy between requests, for the driver's sake. A copy made
     * within preTransmission or postTransmission answers everything with ku8MBBusy.
     */
    ModbusMaster(const ModbusMaster &other) : state(other.state) { settle(); }

    /**
     * As the copy; a request of this object that is under way is given up. Within
     * preTransmission and postTransmission of either object it changes nothing.
     */
    ModbusMaster &operator=(const ModbusMaster &other)
    {
        if (this != &other && mbm_master_status(&other.state.master) != MBM_BUSY &&
            mbm_master_cancel(&state.master) != MBM_BUSY) {
            state = other.state;
            settle();
        }
        return *this;
    }

#if defined(MODBUSMASTER_SHARE_FRAME)
    /** A request under way is forgotten; cancel it before, for the driver's sake. */
    ~ModbusMaster()
    {
        Turn::end(state.master);
    }
#endif

    /**
     * Talks to a slave over a Stream that is open already. Cheap, and may be
     * called again and again. Callbacks, settings and words stay; what send
     * queued is dropped, a request under way is given up.
     *
     * @param slave   1 to 247; 248 to 255 are sent as they are, 0 is broadcast
     * @param stream  must outlive its use here; its read() returns -1 where nothing has
     *                arrived, as Arduino says. Its write() returns the bytes that it
     *                took. If it returns 0 for the first byte, without a write error,
     *                it is taken for a Stream that takes all bytes and counts none
     */
    void begin(uint8_t slave, Stream &stream)
    {
        if (attach(slave) == MBM_OK && state.stream != &stream) {
            state.stream = &stream;
            state.counts = false;
        }
    }

#if defined(MODBUSMASTER_SERIAL0)
    /**
     * Opens the port of the constructor (8N1) and talks to its slave over it.
     * The response timeout is 2000 ms here too; version 0.9 gave up after 200,
     * for which call setResponseTimeout(200).
     *
     * @param baud  bits per second
     */
    void begin(uint32_t baud = 19200)
    {
        setBaudRate(baud);
        Stream *stream = Ports::open(state.port, baud);
        if (stream == nullptr) {
            MODBUSMASTER_SERIAL0.begin(baud);
            stream = &MODBUSMASTER_SERIAL0;
        }
        begin(getSlaveID(), *stream);
    }
#endif

    /** Called again and again while a reply is waited for; nullptr for none. */
    void idle(void (*callback)()) { set(state.onIdle, callback); }
    /** As idle(callback), which is handed `context`. */
    void idle(void (*callback)(void *), void *context) { set(state.onIdle, callback, context); }

    /** Called before a request is written (RS-485 driver on); nullptr for none. */
    void preTransmission(void (*callback)()) { set(state.onPre, callback); }
    /** As preTransmission(callback), which is handed `context`. */
    void preTransmission(void (*callback)(void *), void *context)
    {
        set(state.onPre, callback, context);
    }

    /** Called once a request has left (RS-485 driver off); nullptr for none. */
    void postTransmission(void (*callback)()) { set(state.onPost, callback); }
    /** As postTransmission(callback), which is handed `context`. */
    void postTransmission(void (*callback)(void *), void *context)
    {
        set(state.onPost, callback, context);
    }

    /** A word of the last successful read; 0xFFFF past the end of the buffer. */
    uint16_t getResponseBuffer(uint8_t index) const
    {
        return index < responseWords ? state.response[index] : 0xFFFF;
    }
    /** Zeroes the response words; receive goes on where it was. */
    void clearResponseBuffer() { memset(state.response, 0, sizeof state.response); }
    /** Sets a word to write: ku8MBSuccess, or 0x02 past the end of the buffer. */
    uint8_t setTransmitBuffer(uint8_t index, uint16_t value)
    {
        if (index >= transmitWords)
            return ku8MBIllegalDataAddress;
        state.transmit[index] = value;
        return ku8MBSuccess;
    }
    /** Zeroes the words to write; the queue of send stays. */
    void clearTransmitBuffer() { memset(state.transmit, 0, sizeof state.transmit); }

    /** Sets the address of later writes without one; empties the queue of send. */
    void beginTransmission(uint16_t address)
    {
        mbm_master_beginTransmission(&state.master, address);
    }

    /**
     * Queues a value: types of up to 16 bits and int as one word, wider ones as
     * two, the low word first. (int is one word everywhere, so that send(5) means
     * the same on every board; of a wider int the low 16 bits are sent.)
     *
     * @return ku8MBSuccess, or ku8MBBufferTooSmall if a word did not fit
     */
    uint8_t send(int value) { return sendWord(static_cast<uint16_t>(value)); }
    /** @copydoc send(int) */
    uint8_t send(unsigned char value) { return sendWord(value); }
    /** @copydoc send(int) */
    uint8_t send(unsigned short value) { return sendWord(value); }
    /** @copydoc send(int) */
    uint8_t send(unsigned int value)
    {
        return sizeof value > 2 ? sendWords(value) : sendWord(value & 0xFFFFu);
    }
    /** @copydoc send(int) */
    uint8_t send(unsigned long value) { return sendWords(value & 0xFFFFFFFFu); }
    /** @copydoc send(int) */
    uint8_t send(long value) { return sendWords(static_cast<uint32_t>(value)); }

    /** Queues a bit, lowest of a word first; returns as send does. */
    uint8_t sendBit(bool on) { return mbm_master_sendBit(&state.master, on); }

    /**
     * Reads 1 to 125 holding registers for receive to give.
     *
     * @return how many words receive will give; 0 if the request failed (status
     *         says how) or, non-blocking, is under way
     */
    uint8_t requestFrom(uint16_t address, uint16_t quantity)
    {
        return mayRequest() ? mbm_master_requestFrom(&state.master, address, quantity) : 0;
    }
    /** How many words of the last successful read receive has yet to give. */
    uint8_t available() const { return mbm_master_available(&state.master); }
    /** The next word of the last successful read; 0xFFFF when none is left. */
    uint16_t receive() { return mbm_master_receive(&state.master); }

    /**
     * Function 01: reads 1 to 2000 coils, 16 to a response word, lowest bit first.
     *
     * This and the nine other functions wait for the reply, unless setBlocking
     * said otherwise. All empty the queue of send; response words change only
     * on success, and the words to write never.
     *
     * @return ku8MBSuccess, the device's exception code (0x01 to 0x7F), or why
     *         there is no reply (0xE0 and up)
     */
    uint8_t readCoils(uint16_t address, uint16_t quantity)
    {
        return request(mbm_master_readCoils, address, quantity);
    }
    /** Function 02: as readCoils, of 1 to 2000 discrete inputs. */
    uint8_t readDiscreteInputs(uint16_t address, uint16_t quantity)
    {
        return request(mbm_master_readDiscreteInputs, address, quantity);
    }
    /** Function 03: reads 1 to 125 holding registers; see readCoils. */
    uint8_t readHoldingRegisters(uint16_t address, uint16_t quantity)
    {
        return request(mbm_master_readHoldingRegisters, address, quantity);
    }
    /** Function 04: reads 1 to 125 input registers; see readCoils. */
    template <typename Quantity> uint8_t readInputRegisters(uint16_t address, Quantity quantity)
    {
        return request(mbm_master_readInputRegisters, address, static_cast<uint16_t>(quantity));
    }
    /** As above, with the original's type: a pointer to it is a pointer to this member. */
    uint8_t readInputRegisters(uint16_t address, uint8_t quantity)
    {
        return request(mbm_master_readInputRegisters, address, uint16_t{quantity});
    }
    /** Function 05: switches a coil; any `on` but 0 is on. See readCoils. */
    uint8_t writeSingleCoil(uint16_t address, uint8_t on)
    {
        return request(mbm_master_writeSingleCoil, address, on);
    }
    /** Function 06: writes a register, by way of word 0. See readCoils. */
    uint8_t writeSingleRegister(uint16_t address, uint16_t value)
    {
        return request(mbm_master_writeSingleRegister, address, value);
    }
    /** Function 0F: writes coils from word 0 on, lowest bit first. See readCoils. */
    uint8_t writeMultipleCoils(uint16_t address, uint16_t quantity)
    {
        return request(mbm_master_writeMultipleCoils, address, quantity);
    }
    /** Function 0F: writes the queued bits to the last write address. */
    uint8_t writeMultipleCoils() { return request(mbm_master_writeQueuedCoils); }
    /** Function 10: writes 1 to 123 registers from word 0 on. See readCoils. */
    uint8_t writeMultipleRegisters(uint16_t address, uint16_t quantity)
    {
        return request(mbm_master_writeMultipleRegisters, address, quantity);
    }
    /** Function 10: writes the queued complete words to the last write address. */
    uint8_t writeMultipleRegisters() { return request(mbm_master_writeQueuedRegisters); }
    /** Function 16: (register & andMask) | (orMask & ~andMask), by way of words 0 and 1. */
    uint8_t maskWriteRegister(uint16_t address, uint16_t andMask, uint16_t orMask)
    {
        return request(mbm_master_maskWriteRegister, address, andMask, orMask);
    }
    /** Function 17: writes 1 to 121 registers from word 0 on, then reads 1 to 125. */
    uint8_t readWriteMultipleRegisters(uint16_t readAddress, uint16_t readQuantity,
                                       uint16_t writeAddress, uint16_t writeQuantity)
    {
        return request(mbm_master_readWriteMultipleRegisters, readAddress, readQuantity,
                       writeAddress, writeQuantity);
    }
    /** Function 17: writes the queued words to the last write address, then reads. */
    uint8_t readWriteMultipleRegisters(uint16_t readAddress, uint16_t readQuantity)
    {
        return request(mbm_master_readWriteQueuedRegisters, readAddress, readQuantity);
    }

    /** Milliseconds from the end of a request to the end of its reply; 2000 at first. */
    void setResponseTimeout(uint16_t ms) { mbm_master_setResponseTimeout(&state.master, ms); }
    /** The unit of later requests: 1 to 247; 248 to 255 as they are, 0 broadcasts. */
    void setSlaveID(uint8_t slave) { mbm_master_setSlaveID(&state.master, slave); }
    /** The unit of later requests. */
    uint8_t getSlaveID() const { return mbm_master_getSlaveID(&state.master); }
    /** Tells bits per second, for t3.5; 0: untold, 4 ms. Sets nothing on the Stream. */
    void setBaudRate(uint32_t baud) { mbm_master_setBaudRate(&state.master, baud); }
    /** Microseconds of silence before a request, in place of t3.5. */
    void setGap(uint32_t us) { mbm_master_setGap(&state.master, us); }
    /** Milliseconds that a broadcast takes; 100 at first. */
    void setTurnaroundDelay(uint16_t ms) { mbm_master_setTurnaroundDelay(&state.master, ms); }
    /** Milliseconds that the line is left alone after a timeout; 100 at first. */
    void setQuietTime(uint16_t ms) { mbm_master_setQuietTime(&state.master, ms); }
    /** How often a request without a proper reply is repeated; 0 at first. */
    void setRetries(uint8_t retries) { mbm_master_setRetries(&state.master, retries); }
    /** Drops the request itself where the receiver hears the driver; off at first. */
    void setEchoDiscard(bool on) { mbm_master_setEchoDiscard(&state.master, on); }
    /**
     * Accepts replies that deviate from the standard, if no right one comes in time:
     * another echoed address or value, another number of registers. Fills the response
     * buffer from reads of more words than it holds, and reads from unit 0; off at first.
     */
    void setLenient(bool on) { mbm_master_setLenient(&state.master, on); }
    /** Character times that the driver stays on where flush returns early; 0 at first. */
    void setPostFlushHold(uint8_t characters)
    {
        mbm_master_setPostFlushHold(&state.master, characters);
    }
    /** false: the functions return ku8MBPending at once, and poll ends them. */
    void setBlocking(bool on) { mbm_master_setBlocking(&state.master, on); }
    /** Counts into `counters`, which you zeroed; nullptr stops. Copies share them. */
    void setCounters(mbm_counters *counters) { mbm_master_setCounters(&state.master, counters); }

    /** Moves a non-blocking request on: ku8MBPending until it has ended, then how. */
    uint8_t poll() { return mbm_master_poll(&state.master); }
    /** Gives a non-blocking request up, with the driver off. */
    void cancel() { mbm_master_cancel(&state.master); }
    /** How the last request ended; ku8MBPending while it is under way. */
    uint8_t status() const { return mbm_master_status(&state.master); }
    /** The raw exception code of the last reply; 0 if it was no exception. */
    uint8_t getExceptionCode() const { return mbm_master_getExceptionCode(&state.master); }

private:
    static_assert(MODBUSMASTER_RESPONSE_WORDS >= 1 && MODBUSMASTER_RESPONSE_WORDS <= 125,
                  "MODBUSMASTER_RESPONSE_WORDS is 1 to 125");
    static_assert(MODBUSMASTER_TRANSMIT_WORDS >= 2 && MODBUSMASTER_TRANSMIT_WORDS <= 123,
                  "MODBUSMASTER_TRANSMIT_WORDS is 2 to 123");

    enum : uint16_t {
        responseWords = MODBUSMASTER_RESPONSE_WORDS,
        transmitWords = MODBUSMASTER_TRANSMIT_WORDS,
        mostWords = responseWords > transmitWords ? +responseWords : +transmitWords,
        frameNeed = MBM_FRAME_BYTES(mostWords),
        frameBytes = frameNeed < MBM_MAX_FRAME ? +frameNeed : MBM_MAX_FRAME
    };

    typedef ModbusMasterPorts<void> Ports;
    typedef ModbusMasterTurn<void> Turn;

    struct Callback {
        void (*function)(void *);
        void *context;
    };

    friend class ModbusMasterValues<ModbusMaster>;

    struct State {
        // What the hooks use comes first, within AVR's short displacements.
        Stream *stream;
        Callback onIdle;
        Callback onPre;
        Callback onPost;
        bool sent; // the request is on the wire, so a reply is waited for
        uint8_t port : 7;
        bool counts : 1; // the Stream's write has returned a count
        mbm_master master;
        uint16_t response[responseWords];
        uint16_t transmit[transmitWords];
#if !defined(MODBUSMASTER_SHARE_FRAME)
        uint8_t frame[frameBytes];
#endif
    };

    State state;

    static State &of(void *context) { return *static_cast<State *>(context); }

    void lendBuffers()
    {
#if defined(MODBUSMASTER_SHARE_FRAME)
        static uint8_t frame[frameBytes];
#else
        uint8_t *frame = state.frame;
#endif
        mbm_master_setBuffers(&state.master, state.response, responseWords, state.transmit,
                              transmitWords, frame, frameBytes);
    }

    // Touches the clock and the driver, not the Stream.
    uint8_t attach(uint8_t slave)
    {
        static const mbm_port hooks = {nullptr,   readHook, writeHook, clockHook,
                                       flushHook, preHook,  postHook,  idleHook};
        return mbm_master_beginRtuWith(&state.master, slave, &hooks, &state);
    }

    // After a copy: our own buffers and our own context, no request under way.
    void settle()
    {
        cancel();
        lendBuffers();
        if (state.stream != nullptr)
            attach(getSlaveID());
    }

    // Every request passes here. False while another object has a request under way in
    // the frame that all share.
    bool mayRequest()
    {
        if (!Turn::take(state.master))
            return false;
        state.sent = false;
        return true;
    }

    template <typename... Parameters>
    uint8_t request(uint8_t (*function)(mbm_master *, Parameters...), Parameters... arguments)
    {
        return mayRequest() ? function(&state.master, arguments...) : ku8MBBusy;
    }

    uint8_t sendWord(uint16_t word) { return mbm_master_send(&state.master, word); }
    uint8_t sendWords(uint32_t words) { return mbm_master_send32(&state.master, words); }

    static void plain(void *callback) { reinterpret_cast<void (*)()>(callback)(); }

    static void set(Callback &callback, void (*function)(void *), void *context)
    {
        callback.function = function;
        callback.context = context;
    }
    static void set(Callback &callback, void (*function)())
    {
        set(callback, function != nullptr ? plain : nullptr, reinterpret_cast<void *>(function));
    }
    static void call(const Callback &callback)
    {
        if (callback.function != nullptr)
            callback.function(callback.context);
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Stream &stream = *of(context).stream;
        const uint8_t *const first = bytes, *const end = bytes + capacity;
        while (bytes != end) {
            MODBUSMASTER_DEBUG(A, true);
            const int byte = stream.read();
            MODBUSMASTER_DEBUG(A, false);
            if (byte < 0)
                break;
            *bytes++ = static_cast<uint8_t>(byte);
        }
        if (bytes != first)
            Turn::used();
        return static_cast<int16_t>(static_cast<uint16_t>(bytes - first));
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        State &state = of(context);
        Stream &stream = *state.stream;
#if !defined(__AVR__)
        if (state.counts)
            return static_cast<int16_t>(stream.write(bytes, length));
#endif
        // Byte by byte: of a block, a Stream that returns 0 took one byte or all.
        int16_t taken = 0;
        for (; taken != static_cast<int16_t>(length); taken++) {
            if (stream.write(*bytes++) != 0)
                state.counts = true;
            else if (state.counts || stream.getWriteError() != 0)
                break;
        }
        return taken;
    }
    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
    static uint8_t flushHook(void *context)
    {
        of(context).stream->flush();
        return 1;
    }
    static void preHook(void *context) { call(of(context).onPre); }
    static void postHook(void *context)
    {
        of(context).sent = true;
        Turn::used();
        call(of(context).onPost);
    }
    static void idleHook(void *context, mbm_master *)
    {
        State &state = of(context);
        if (state.sent) {
            MODBUSMASTER_DEBUG(B, true);
            call(state.onIdle);
            MODBUSMASTER_DEBUG(B, false);
            state.sent = true; // a request that the callback tried was refused
        }
        MODBUSMASTER_YIELD();
    }
};

#endif
