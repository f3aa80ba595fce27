/**
 * @file ModbusMaster.h
 * @brief A Modbus RTU master for Arduino sketches, over mbm.h.
 *
 * Licence: MIT OR Apache-2.0. Header-only, C++11, no heap.
 *
 * Sketches written for the ModbusMaster library, 0.9 to 2.0.1, compile and run
 * unchanged. Addresses are those on the wire, from 0. Unlike that library, the class
 * finds a reply after noise and frames of other units, checks that it belongs to the
 * request, and keeps a silence of t3.5 before each request.
 *
 * The macros for the size of the buffers and for the ports are in ModbusMasterOptions.h.
 */

#ifndef MODBUSMASTER_H
#define MODBUSMASTER_H
/** The include guard of the original library, which some sketches test. */
#define ModbusMaster_h

#include <Arduino.h>
#include <stdint.h>
#include <string.h>

#include "ModbusTransmission.h"
#include "ModbusMasterBoards.h"
#include "ModbusMasterConstants.h"
#include "ModbusMasterFrame.h"
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
 * objects. An idle callback may call every member of its own object, but requests
 * return ku8MBBusy. From preTransmission and postTransmission every call on the same
 * object returns ku8MBBusy and changes nothing, except those that read, set or clear words.
 */
class ModbusMaster : public ModbusMasterStatics<void>,
                     public ModbusMasterValues<ModbusMaster>,
                     public ModbusTransmissionHooks<ModbusMaster> {
public:
    /** For slave 1, with begin(baud) opening Serial. Uses neither clock nor port. */
    ModbusMaster() : state() { setBuffers(); }

    /** As ModbusMaster(), for `slave` (1 to 247; 0 is broadcast). */
    ModbusMaster(uint8_t slave) : ModbusMaster() { setSlaveID(slave); }

    /**
     * As ModbusMaster(slave), with begin(baud) opening Serial1 to Serial3 for
     * `port` 1 to 3; Serial for others, and for a UART that the board lacks.
     */
    // Always inline, so that a constant port number links only that UART.
    MODBUSMASTER_INLINE ModbusMaster(uint8_t port, uint8_t slave) : ModbusMaster(slave)
    {
        state.port = port;
        Ports::use(port);
    }

    /**
     * A copy has its own buffers, with the same words, settings, callbacks
     * and Stream. Its queue of send is empty. A request under way belongs to the
     * original only. Copy between requests only, or the RS-485 driver may stay on.
     * If you copy within preTransmission or postTransmission, the copy returns ku8MBBusy
     * for every call.
     */
    ModbusMaster(const ModbusMaster &other) : state(other.state) { adoptCopy(); }

    /**
     * Copies as the constructor does, and cancels this object's request under way.
     * Within preTransmission and postTransmission of either object it changes nothing.
     */
    ModbusMaster &operator=(const ModbusMaster &other)
    {
        if (this != &other && mbm_master_status(&other.state.master) != MBM_BUSY &&
            mbm_master_cancel(&state.master) != MBM_BUSY) {
            state = other.state;
            adoptCopy();
        }
        return *this;
    }

#if defined(MODBUSMASTER_SHARE_FRAME)
    /** Ends a request under way. Call cancel before, or the RS-485 driver may stay on. */
    ~ModbusMaster()
    {
        Turn::end(state.master);
    }
#endif

    /**
     * Sends later requests to a slave, over a Stream that is already open. It takes little
     * time, so a sketch may call it before each request. It keeps callbacks, settings and
     * words, empties the queue of send, and cancels a request under way.
     *
     * @param slave   1 to 247; 248 to 255 are sent as they are, 0 is broadcast
     * @param stream  must outlive its use here; its read() returns -1 if no byte has
     *                arrived, as Arduino specifies. Its write() returns how many bytes
     *                it accepted. If it returns 0 for the first byte and sets no write
     *                error, the object treats it as a Stream that accepts every byte and
     *                always returns 0
     */
    void begin(uint8_t slave, Stream &stream)
    {
        if (attach(slave) == MBM_OK)
            state.stream = &stream;
    }

#if defined(MODBUSMASTER_SERIAL0)
    /**
     * Opens the port of the constructor (8N1), and sends later requests to its slave there.
     * The response timeout is 2000 ms here too. It was 200 ms in version 0.9: call
     * setResponseTimeout(200) for that.
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

    /** Sets a callback that is called again and again while a function waits for a reply; nullptr for none. */
    void idle(void (*callback)()) { state.onIdle.set(callback); }
    /** As idle(callback), with `context` as its argument. */
    void idle(void (*callback)(void *), void *context) { state.onIdle.set(callback, context); }

    /** A word of the last successful read; 0xFFFF past the end of the buffer. */
    uint16_t getResponseBuffer(uint8_t index) const
    {
        return index < responseWords ? state.response[index] : 0xFFFF;
    }
    /** Sets the response words to 0; receive continues at the same word. */
    void clearResponseBuffer() { memset(state.response, 0, sizeof state.response); }
    /** Sets a word to write: ku8MBSuccess, or 0x02 past the end of the buffer. */
    uint8_t setTransmitBuffer(uint8_t index, uint16_t value)
    {
        if (index >= transmitWords)
            return ku8MBIllegalDataAddress;
        state.transmit[index] = value;
        return ku8MBSuccess;
    }
    /** Sets the words to write to 0; the queue of send stays. */
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
     * Reads 1 to 125 holding registers, which receive then returns one by one.
     *
     * @return how many words receive will return; 0 if the request failed (status
     *         returns the reason), or if it is still under way in non-blocking mode
     */
    uint8_t requestFrom(uint16_t address, uint16_t quantity)
    {
        return readHoldingRegisters(address, quantity) == ku8MBSuccess ? available() : 0;
    }
    /** How many words of the last successful read receive has not returned yet. */
    uint8_t available() const { return mbm_master_available(&state.master); }
    /** The next word of the last successful read; 0xFFFF when none is left. */
    uint16_t receive() { return mbm_master_receive(&state.master); }

    /**
     * Function 01: reads 1 to 2000 coils, 16 to a response word, lowest bit first.
     *
     * This and the nine other functions wait for the reply, unless setBlocking(false)
     * was called. All empty the queue of send. Response words change only on success.
     * The words to write stay, except for functions 06 and 16.
     *
     * @return ku8MBSuccess, the device's exception code (0x01 to 0x7F), or the
     *         reason why there is no reply (0xE0 and up)
     */
    uint8_t readCoils(uint16_t address, uint16_t quantity)
    {
        return request(wordsOf(quantity), mbm_master_readCoils, address, quantity);
    }
    /** Function 02: as readCoils, of 1 to 2000 discrete inputs. */
    uint8_t readDiscreteInputs(uint16_t address, uint16_t quantity)
    {
        return request(wordsOf(quantity), mbm_master_readDiscreteInputs, address, quantity);
    }
    /** Function 03: reads 1 to 125 holding registers; see readCoils. */
    uint8_t readHoldingRegisters(uint16_t address, uint16_t quantity)
    {
        return request(quantity, mbm_master_readHoldingRegisters, address, quantity);
    }
    /** Function 04: reads 1 to 125 input registers; see readCoils. */
    template <typename Quantity> uint8_t readInputRegisters(uint16_t address, Quantity quantity)
    {
        const uint16_t words = static_cast<uint16_t>(quantity);
        return request(words, mbm_master_readInputRegisters, address, words);
    }
    /** As above, with the parameter types of ModbusMaster 2.0.1, for pointers to members. */
    uint8_t readInputRegisters(uint16_t address, uint8_t quantity)
    {
        return request(quantity, mbm_master_readInputRegisters, address, uint16_t{quantity});
    }
    /** Function 05: switches a coil; every `on` other than 0 means on. See readCoils. */
    uint8_t writeSingleCoil(uint16_t address, uint8_t on)
    {
        return request(1, mbm_master_writeSingleCoil, address, on);
    }
    /** Function 06: stores the value in word 0 and writes it. See readCoils. */
    uint8_t writeSingleRegister(uint16_t address, uint16_t value)
    {
        return request(1, mbm_master_writeSingleRegister, address, value);
    }
    /** Function 0F: writes coils from word 0 on, lowest bit first. See readCoils. */
    uint8_t writeMultipleCoils(uint16_t address, uint16_t quantity)
    {
        return request(wordsOf(quantity), mbm_master_writeMultipleCoils, address, quantity);
    }
    /** Function 0F: writes the queued bits to the last write address. */
    uint8_t writeMultipleCoils() { return request(transmitWords, mbm_master_writeQueuedCoils); }
    /** Function 10: writes 1 to 123 registers from word 0 on. See readCoils. */
    uint8_t writeMultipleRegisters(uint16_t address, uint16_t quantity)
    {
        return request(quantity, mbm_master_writeMultipleRegisters, address, quantity);
    }
    /** Function 10: writes the queued complete words to the last write address. */
    uint8_t writeMultipleRegisters()
    {
        return request(transmitWords, mbm_master_writeQueuedRegisters);
    }
    /** Function 16: (register & andMask) | (orMask & ~andMask); stores the masks in words 0 and 1. */
    uint8_t maskWriteRegister(uint16_t address, uint16_t andMask, uint16_t orMask)
    {
        return request(2, mbm_master_maskWriteRegister, address, andMask, orMask);
    }
    /** Function 17: writes 1 to 121 registers from word 0 on, then reads 1 to 125. */
    uint8_t readWriteMultipleRegisters(uint16_t readAddress, uint16_t readQuantity,
                                       uint16_t writeAddress, uint16_t writeQuantity)
    {
        const uint16_t words = readQuantity > writeQuantity ? readQuantity : writeQuantity;
        return request(words, mbm_master_readWriteMultipleRegisters, readAddress, readQuantity,
                       writeAddress, writeQuantity);
    }
    /** Function 17: writes the queued words to the last write address, then reads. */
    uint8_t readWriteMultipleRegisters(uint16_t readAddress, uint16_t readQuantity)
    {
        return request(mostWords, mbm_master_readWriteQueuedRegisters, readAddress, readQuantity);
    }

    /** Milliseconds from the end of a request to the end of its reply, 0 to 1000000; 2000 at
        first. A longer time changes nothing. */
    void setResponseTimeout(uint32_t ms) { mbm_master_setResponseTimeout(&state.master, ms); }
    /** What setResponseTimeout has set. */
    uint32_t getResponseTimeout() const { return mbm_master_getResponseTimeout(&state.master); }
    /** The unit of later requests: 1 to 247; 248 to 255 are sent as they are, 0 broadcasts. */
    void setSlaveID(uint8_t slave) { mbm_master_setSlaveID(&state.master, slave); }
    /** The unit of later requests. */
    uint8_t getSlaveID() const { return mbm_master_getSlaveID(&state.master); }
    /** Bits per second, from which t3.5 follows; 0: unknown, a silence of 4 ms. The Stream stays as it is. */
    void setBaudRate(uint32_t baud) { mbm_master_setBaudRate(&state.master, baud); }
    /** Microseconds of silence before a request, instead of t3.5. */
    void setGap(uint32_t us) { mbm_master_setGap(&state.master, us); }
    /** The silence in effect: of setGap, or t3.5 of setBaudRate. */
    uint32_t getGap() const { return mbm_master_getGap(&state.master); }
    /** Milliseconds from a broadcast to the next request; 100 at first. */
    void setTurnaroundDelay(uint32_t ms) { mbm_master_setTurnaroundDelay(&state.master, ms); }
    /** What setTurnaroundDelay has set. */
    uint16_t getTurnaroundDelay() const { return mbm_master_getTurnaroundDelay(&state.master); }
    /** Milliseconds after a failed request before the next one is sent; 100 at first. */
    void setQuietTime(uint32_t ms) { mbm_master_setQuietTime(&state.master, ms); }
    /** What setQuietTime has set. */
    uint16_t getQuietTime() const { return mbm_master_getQuietTime(&state.master); }
    /** How often a request is repeated if its reply is missing, damaged or malformed; 0 at first. */
    void setRetries(uint8_t retries) { mbm_master_setRetries(&state.master, retries); }
    /** What setRetries has set. */
    uint8_t getRetries() const { return mbm_master_getRetries(&state.master); }
    /** Discards the local echo, if the receiver receives what the driver sends; off at first. */
    void setEchoDiscard(bool on) { mbm_master_setEchoDiscard(&state.master, on); }
    /** What setEchoDiscard has set. */
    bool getEchoDiscard() const { return mbm_master_getEchoDiscard(&state.master) != 0; }
    /**
     * Accepts replies that deviate from the standard if no correct one arrives in time:
     * another echoed address or value, another number of registers. A read of more words
     * than the response buffer holds fills the buffer. Unit 0 may be read. Off at first.
     */
    void setLenient(bool on)
    {
        // The reply may be longer than the one asked for.
        if (on)
            Frame::keep();
        mbm_master_setLenient(&state.master, on);
    }
    /** What setLenient has set. */
    bool getLenient() const { return mbm_master_getLenient(&state.master) != 0; }
    /** Character times that the driver stays on after flush, for cores whose flush returns early; 0 at first. */
    void setPostFlushHold(uint8_t characters)
    {
        mbm_master_setPostFlushHold(&state.master, characters);
    }
    /** What setPostFlushHold has set. */
    uint8_t getPostFlushHold() const { return mbm_master_getPostFlushHold(&state.master); }
    /** false: the functions return ku8MBPending at once, and poll completes the request. */
    void setBlocking(bool on)
    {
        // The request outlives the function that makes it.
        if (!on)
            Frame::keep();
        mbm_master_setBlocking(&state.master, on);
    }
    /** What setBlocking has set; true at first. */
    bool getBlocking() const { return mbm_master_getBlocking(&state.master) != 0; }
    /** Counts into `counters`; set them to 0 before. nullptr stops counting. Copies share them. */
    void setCounters(mbm_counters *counters) { mbm_master_setCounters(&state.master, counters); }

    /** Continues a non-blocking request: ku8MBPending until it has ended, then its status. */
    uint8_t poll() { return mbm_master_poll(&state.master); }
    /** Cancels a non-blocking request and switches the driver off. */
    void cancel() { mbm_master_cancel(&state.master); }
    /** The status of the last request; ku8MBPending while it is under way. */
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
        frameOfWords = MBM_FRAME_BYTES(mostWords),
        frameBytes = frameOfWords < 255 ? +frameOfWords : 255
    };

    typedef ModbusMasterFrame<frameBytes> Frame;
    typedef ModbusMasterPorts<void> Ports;
    typedef ModbusMasterTurn<void> Turn;

    friend class ModbusMasterValues<ModbusMaster>;
    friend class ModbusTransmissionHooks<ModbusMaster>;

    struct State {
        // The members that the hooks use come first: AVR reaches 63 bytes with one instruction.
        Stream *stream;
        Stream *counting; // the last Stream whose write returned another number than 0
        ModbusTransmissionHook onIdle;
        ModbusTransmissionHook onPre;
        ModbusTransmissionHook onPost;
        bool sent; // the request is on the wire, so a reply is waited for
        uint8_t port;
        mbm_master master;
        uint16_t response[responseWords];
        uint16_t transmit[transmitWords];
#if !defined(MODBUSMASTER_SHARE_FRAME)
        uint8_t frame[frameBytes];
#endif
    };

    State state;

    static State &stateOf(void *context) { return *static_cast<State *>(context); }

    ModbusTransmissionHook &preHookOf() { return state.onPre; }
    ModbusTransmissionHook &postHookOf() { return state.onPost; }

    void setBuffers()
    {
        mbm_master_setWords(&state.master, state.response, responseWords, state.transmit,
                            transmitWords);
#if !defined(MODBUSMASTER_SHARE_FRAME)
        mbm_master_setFrame(&state.master, state.frame, frameBytes);
#endif
    }

    // Uses the clock and the driver, not the Stream.
    uint8_t attach(uint8_t slave)
    {
        static const mbm_port hooks = {nullptr,   readHook, writeHook, clockHook,
                                       flushHook, preHook,  postHook,  idleHook};
        return mbm_master_beginRtuWith(&state.master, slave, &hooks, &state);
    }

    // After a copy: sets this object's buffers and context, and cancels the copied request.
    void adoptCopy()
    {
        cancel();
        setBuffers();
        if (state.stream != nullptr)
            attach(getSlaveID());
    }

    // Every request calls this. Returns false while another object has a request under way
    // and objects have no frame buffers.
    bool mayRequest()
    {
        if (!Turn::take(state.master))
            return false;
        state.sent = false;
        return true;
    }

    // How many words hold `bits` bits, or one more.
    static uint16_t wordsOf(uint16_t bits) { return (bits / 16u + 1u) & 0xFFFFu; }

    // Makes a request that reads or writes at most `words` words, by calling `function`.
#if defined(MODBUSMASTER_SHARE_FRAME)
    // Not inline: the memory of the frame is free when it returns.
    template <typename... Parameters>
    __attribute__((noinline)) uint8_t
    request(uint16_t words, uint8_t (*function)(mbm_master *, Parameters...),
            Parameters... arguments)
    {
        uint8_t *frame = Frame::kept;
        uint8_t bytes = frameBytes;
        if (frame == nullptr) {
            bytes = Frame::bytesOf(words);
            frame = static_cast<uint8_t *>(__builtin_alloca(bytes));
        }
        if (!mayRequest() || mbm_master_setFrame(&state.master, frame, bytes) != MBM_OK)
            return ku8MBBusy;
        return function(&state.master, arguments...);
    }
#else
    template <typename... Parameters>
    uint8_t request(uint16_t, uint8_t (*function)(mbm_master *, Parameters...),
                    Parameters... arguments)
    {
        return mayRequest() ? function(&state.master, arguments...) : ku8MBBusy;
    }
#endif

    uint8_t sendWord(uint16_t word) { return mbm_master_send(&state.master, word); }
    uint8_t sendWords(uint32_t words) { return mbm_master_send32(&state.master, words); }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Stream &stream = *stateOf(context).stream;
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
        State &state = stateOf(context);
#if !defined(__AVR__)
        if (state.counting == state.stream)
            return static_cast<int16_t>(state.stream->write(bytes, length));
#endif
        // Byte by byte: if the write of a block returns 0, it took one byte or all. A
        // request of this class has 4 to 255 bytes; an 8-bit counter saves flash on AVR.
        uint8_t left = static_cast<uint8_t>(length);
        do {
            Stream &stream = *state.stream;
            if (stream.write(*bytes) != 0)
                state.counting = &stream;
            else if (state.counting == &stream || stream.getWriteError() != 0)
                break;
            bytes++;
        } while (--left != 0);
        return static_cast<uint8_t>(length - left);
    }
    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
    static uint8_t flushHook(void *context)
    {
        stateOf(context).stream->flush();
        return 1;
    }
    static void preHook(void *context) { stateOf(context).onPre.call(); }
    static void postHook(void *context)
    {
        stateOf(context).sent = true;
        Turn::used();
        stateOf(context).onPost.call();
    }
    static void idleHook(void *context, mbm_master *)
    {
        State &state = stateOf(context);
        if (state.sent) {
            MODBUSMASTER_DEBUG(B, true);
            state.onIdle.call();
            MODBUSMASTER_DEBUG(B, false);
            state.sent = true; // a refused request of the callback has cleared it
        }
        MODBUSMASTER_YIELD();
    }
};

#endif
