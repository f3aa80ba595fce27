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
#include "ModbusMasterHelpers.h"
#include "ModbusMasterLine.h"
#include "ModbusMasterOptions.h"
#include "ModbusMasterPorts.h"
#include "ModbusMasterUart.h"
#include "ModbusMasterValues.h"
#include "ModbusStatusText.h"
#include "ModbusUsb.h"
#include "mbm/master.h"

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
    ModbusMaster() : state()
    {
        attach(1);
        beginLine();
    }

    /** As ModbusMaster(), for `slave` (1 to 247; 0 is broadcast). */
    ModbusMaster(uint8_t slave) : ModbusMaster() { setSlaveID(slave); }

    /**
     * As ModbusMaster(slave), with begin(baud) opening Serial1 to Serial3 for
     * `port` 1 to 3; Serial for others, and for a UART that the board lacks.
     */
    // Always inline, so that a constant port number links only that UART.
    MODBUSMASTER_INLINE ModbusMaster(uint8_t port, uint8_t slave) : ModbusMaster(slave)
    {
        state.port = port <= 3 ? port & 3u : 0u;
        Ports::use(port);
    }

    /**
     * A copy has its own buffers, with the same words, settings, callbacks and Stream. Its
     * queue of send is empty. A pending request belongs to the original only. Copy between
     * requests only, or the RS-485 driver may stay on. If you copy within preTransmission or
     * postTransmission, the copy returns ku8MBBusy for every call.
     */
    ModbusMaster(const ModbusMaster &other) : state(other.state) { adoptCopy(); }

    /**
     * Copies as the constructor does, and cancels this object's pending request.
     * Within preTransmission and postTransmission of either object it changes nothing.
     */
    ModbusMaster &operator=(const ModbusMaster &other)
    {
        if (this != &other && mbm_node_status(&other.state.node) != MBM_BUSY &&
            mbm_node_cancel(&state.node) != MBM_BUSY) {
            state = other.state;
            adoptCopy();
        }
        return *this;
    }

#if defined(MODBUSMASTER_SHARE_LINE)
    /** Cancels a pending request. */
    ~ModbusMaster() { Line::giveUp(state.node); }
#endif

    /**
     * Sends later requests to a slave, over a Stream that is already open. It takes little
     * time, so a sketch may call it before each request. It keeps callbacks, settings and
     * words, empties the queue of send, and cancels a pending request.
     *
     * @param slave   1 to 247; 248 to 255 are sent as they are, 0 is broadcast
     * @param stream  must outlive its use here; its read() returns -1 if no byte has
     *                arrived, as Arduino specifies. Its write() returns how many bytes
     *                it accepted. If it returns 0 for the first byte and sets no write
     *                error, the object treats it as a Stream that accepts every byte and
     *                always returns 0
     */
    void begin(uint8_t slave, Stream &stream) { use(slave, stream, false); }

#if defined(MODBUSMASTER_UART)
    /**
     * As begin(slave, stream), for a UART of an AVR. The silence before each request is t3.5 of
     * the rate that the UART has at that time, unless you have called setBaudRate, setGap or
     * begin(baud) for this object, or for one that shares its line.
     */
    void begin(uint8_t slave, MODBUSMASTER_UART &uart) { use(slave, uart, true); }
#endif

#if !defined(MODBUSMASTER_SHARE_LINE)
    /**
     * As begin(slave, stream), for a port whose class has baudRate(), as those of the ESP8266 and
     * the ESP32. The silence before a request is t3.5 of that rate then, as if you had called
     * setBaudRate, unless you have called setBaudRate, setGap or begin(baud) for this
     * object. Open the port first; call begin again after you have changed its rate. The rate of a
     * port over USB means nothing, and is left out of account.
     */
    template <typename Port, typename = typename ModbusPort<Port>::Wire,
              typename = decltype(static_cast<Port *>(nullptr)->baudRate())>
    void begin(uint8_t slave, Port &port)
    {
        begin(slave, static_cast<Stream &>(port));
        state.own.takeRate(port);
    }
#endif

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
        mbm_node_beginTransmission(&state.node, address);
    }

    /**
     * Queues a value: types of up to 16 bits and int as one word, wider ones as two, the low
     * word first. (int is one word everywhere, so that send(5) means the same on every board;
     * only the low 16 bits of a wider int are sent.)
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
    uint8_t sendBit(bool on) { return mbm_node_sendBit(&state.node, on); }

    /**
     * Reads 1 to 125 holding registers, which receive then returns one by one.
     *
     * @return how many words receive will return; 0 if the request failed (status
     *         returns the reason), or if it is still pending in non-blocking mode
     */
    uint8_t requestFrom(uint16_t address, uint16_t quantity)
    {
        return readHoldingRegisters(address, quantity) == ku8MBSuccess ? available() : 0;
    }
    /** How many words of the last successful read receive has not returned yet. */
    uint8_t available() const { return mbm_node_available(&state.node); }
    /** The next word of the last successful read; 0xFFFF when none is left. */
    uint16_t receive() { return mbm_node_receive(&state.node); }

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
        return request(Line::bytesOfRead(wordsOf(quantity)), mbm_node_readCoils, address,
                       quantity);
    }
    /** Function 02: as readCoils, of 1 to 2000 discrete inputs. */
    uint8_t readDiscreteInputs(uint16_t address, uint16_t quantity)
    {
        return request(Line::bytesOfRead(wordsOf(quantity)), mbm_node_readDiscreteInputs, address,
                       quantity);
    }
    /** Function 03: reads 1 to 125 holding registers; see readCoils. */
    uint8_t readHoldingRegisters(uint16_t address, uint16_t quantity)
    {
        return request(Line::bytesOfRead(quantity), mbm_node_readHoldingRegisters, address,
                       quantity);
    }
    /** Function 04: reads 1 to 125 input registers; see readCoils. */
    template <typename Quantity> uint8_t readInputRegisters(uint16_t address, Quantity quantity)
    {
        const uint16_t words = static_cast<uint16_t>(quantity);
        return request(Line::bytesOfRead(words), mbm_node_readInputRegisters, address, words);
    }
    /** As above, with the parameter types of ModbusMaster 2.0.1, for pointers to members. */
    uint8_t readInputRegisters(uint16_t address, uint8_t quantity)
    {
        return request(Line::bytesOfRead(quantity), mbm_node_readInputRegisters, address,
                       uint16_t{quantity});
    }
    /** Function 05: switches a coil; every `on` other than 0 means on. See readCoils. */
    uint8_t writeSingleCoil(uint16_t address, uint8_t on)
    {
        return request(Line::bytesOfWrite(1), mbm_node_writeSingleCoil, address, on);
    }
    /** Function 06: stores the value in word 0 and writes it. See readCoils. */
    uint8_t writeSingleRegister(uint16_t address, uint16_t value)
    {
        return request(Line::bytesOfWrite(1), mbm_node_writeSingleRegister, address, value);
    }
    /** Function 0F: writes coils from word 0 on, lowest bit first. See readCoils. */
    uint8_t writeMultipleCoils(uint16_t address, uint16_t quantity)
    {
        return request(Line::bytesOfWrite(wordsOf(quantity)), mbm_node_writeMultipleCoils, address,
                       quantity);
    }
    /** Function 0F: writes the queued bits to the last write address. */
    uint8_t writeMultipleCoils()
    {
        return request(Line::bytesOfWrite(transmitWords), mbm_node_writeQueuedCoils);
    }
    /** Function 10: writes 1 to 123 registers from word 0 on. See readCoils. */
    uint8_t writeMultipleRegisters(uint16_t address, uint16_t quantity)
    {
        return request(Line::bytesOfWrite(quantity), mbm_node_writeMultipleRegisters, address,
                       quantity);
    }
    /** Function 10: writes the queued complete words to the last write address. */
    uint8_t writeMultipleRegisters()
    {
        return request(Line::bytesOfWrite(transmitWords), mbm_node_writeQueuedRegisters);
    }
    /** Function 16: (register & andMask) | (orMask & ~andMask); stores the masks in words 0 and 1. */
    uint8_t maskWriteRegister(uint16_t address, uint16_t andMask, uint16_t orMask)
    {
        return request(Line::bytesOfWrite(2), mbm_node_maskWriteRegister, address, andMask,
                       orMask);
    }
    /** Function 17: writes 1 to 121 registers from word 0 on, then reads 1 to 125. */
    uint8_t readWriteMultipleRegisters(uint16_t readAddress, uint16_t readQuantity,
                                       uint16_t writeAddress, uint16_t writeQuantity)
    {
        return request(bytesOf(readQuantity, writeQuantity), mbm_node_readWriteMultipleRegisters,
                       readAddress, readQuantity, writeAddress, writeQuantity);
    }
    /** Function 17: writes the queued words to the last write address, then reads. */
    uint8_t readWriteMultipleRegisters(uint16_t readAddress, uint16_t readQuantity)
    {
        return request(bytesOf(readQuantity, transmitWords), mbm_node_readWriteQueuedRegisters,
                       readAddress, readQuantity);
    }

    /** Milliseconds from the end of a request to the end of its reply, 0 to 1000000; 2000 at
        first. A longer time changes nothing. */
    void setResponseTimeout(uint32_t ms) { mbm_node_setResponseTimeout(&state.node, ms); }
    /** The unit of later requests: 1 to 247; 248 to 255 are sent as they are, 0 broadcasts. */
    void setSlaveID(uint8_t slave) { mbm_node_setSlaveID(&state.node, slave); }
    /** The unit of later requests. */
    uint8_t getSlaveID() const { return mbm_node_getSlaveID(&state.node); }
    // They are static only where objects share a line.
    // NOLINTBEGIN(readability-convert-member-functions-to-static)
    /** Bits per second, from which t3.5 follows; 0: a silence of 4 ms. The Stream stays as it is. */
    void setBaudRate(uint32_t baud)
    {
        if (mbm_line_setBaudRate(line(), baud) == MBM_OK)
            state.keepRate();
    }
    /** Microseconds of silence before a request, instead of t3.5. */
    void setGap(uint32_t us)
    {
        if (mbm_line_setGap(line(), us) == MBM_OK)
            state.keepRate();
    }
    /** Milliseconds from a broadcast to the next request; 100 at first. */
    void setTurnaroundDelay(uint32_t ms) { mbm_line_setTurnaroundDelay(line(), ms); }
    /** Milliseconds after a failed request before the next one is sent; 100 at first. */
    void setQuietTime(uint32_t ms) { mbm_line_setQuietTime(line(), ms); }
    /** How often a request is repeated if its reply is missing, damaged or malformed; 0 at first. */
    void setRetries(uint8_t retries) { mbm_line_setRetries(line(), retries); }
    /**
     * Discards the local echo, if the receiver receives the bytes that the driver sends; off at
     * first.
     */
    void setEchoDiscard(bool on) { mbm_line_setEchoDiscard(line(), on); }
    /**
     * Accepts replies that deviate from the standard if no correct one arrives in time:
     * another echoed address or value, another number of registers. A read of more words
     * than the response buffer holds fills the buffer. Unit 0 may be read. It is off at first.
     */
    void setLenient(bool on)
    {
        // The reply may be longer than the one asked for.
        if (on)
            Line::keep();
        mbm_node_setLenient(&state.node, on);
    }
    /** Character times that the driver stays on after flush, for cores whose flush returns early; 0 at first. */
    void setPostFlushHold(uint8_t characters)
    {
        mbm_line_setPostFlushHold(line(), characters);
    }
    /** false: the functions return ku8MBPending at once, and poll completes the request. */
    void setBlocking(bool on)
    {
        // The request outlives the function that makes it.
        if (!on)
            Line::keep();
        mbm_node_setBlocking(&state.node, on);
    }
    /** Counts into `counters`; set them to 0 before. nullptr stops counting. Copies share them. */
    void setCounters(mbm_counters *counters) { mbm_line_setCounters(line(), counters); }
    // NOLINTEND(readability-convert-member-functions-to-static)

    /** Continues a non-blocking request: ku8MBPending until it has ended, then its status. */
    uint8_t poll() { return mbm_node_poll(&state.node); }
    /** Cancels a non-blocking request and switches the driver off. */
    void cancel() { mbm_node_cancel(&state.node); }
    /** The status of the last request; ku8MBPending while it is pending. */
    uint8_t status() const { return mbm_node_status(&state.node); }
    /** The raw exception code of the last reply; 0 if it was no exception. */
    uint8_t getExceptionCode() const { return mbm_node_getExceptionCode(&state.node); }

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

    struct State;

    typedef ModbusMasterLine<State, frameBytes> Line;
    typedef ModbusMasterPorts<void> Ports;
    typedef ModbusMasterWire<State> Wire;

    friend class ModbusMasterValues<ModbusMaster>;
    friend class ModbusTransmissionHooks<ModbusMaster>;

    struct State {
        // The members that the hooks use come first: AVR reaches 63 bytes with one instruction.
        Stream *stream;
        ModbusTransmissionHook onIdle;
        ModbusTransmissionHook onPre;
        ModbusTransmissionHook onPost;
        uint8_t port : 2;
        uint8_t order : 5; // of values: see setWordOrder
        bool isUart : 1;   // the stream is a UART whose registers tell its rate
        mbm_node node;
        uint16_t response[responseWords];
        uint16_t transmit[transmitWords];
#if defined(MODBUSMASTER_SHARE_LINE)
        // Several ports may share the line, so the rate of one object's port says nothing about
        // the line's.
        static void keepRate() { Line::wire.keepsGap = true; }
        static void forgetRate() {}
        static bool keepsGap() { return Line::wire.keepsGap; }
        static mbm_line *line() { return &Line::wire.line; }
#else
        Line own;

        void keepRate() { own.keepRate(); }
        void forgetRate() { own.forgetRate(); }
        bool keepsGap() const { return own.isRateKept || own.forget != nullptr; }
        mbm_line *line() { return &own.wire.line; }
#endif

        // Tells the line the silence before a request over this object's stream.
        void tellGap()
        {
#if defined(MODBUSMASTER_UART)
            typedef ModbusMasterUart<MODBUSMASTER_UART> Uart;
            if (keepsGap())
                return;
            uint16_t time = Uart::unknown;
            if (isUart)
                time = Uart::silenceOf(*static_cast<const MODBUSMASTER_UART *>(stream));
            mbm_line_setGap(line(), static_cast<uint32_t>(time) << 2);
#endif
        }
    };

    State state;

    ModbusTransmissionHook &preHookOf() { return state.onPre; }
    ModbusTransmissionHook &postHookOf() { return state.onPost; }

    void use(uint8_t slave, Stream &stream, bool isUart)
    {
        Line::giveUp(state.node);
        if (attach(slave) == MBM_OK) {
            state.stream = &stream;
            state.isUart = isUart;
            state.forgetRate();
        }
    }

    uint8_t attach(uint8_t slave)
    {
        return mbm_node_begin(&state.node, line(), slave, state.response, responseWords,
                              state.transmit, transmitWords);
    }

    // How many words hold `bits` bits, or one more.
    static uint16_t wordsOf(uint16_t bits) { return (bits / 16u + 1u) & 0xFFFFu; }

    // The bytes of a frame that reads and writes words.
    static uint8_t bytesOf(uint16_t read, uint16_t written)
    {
        const uint8_t one = Line::bytesOfRead(read), other = Line::bytesOfWrite(written);
        return one > other ? one : other;
    }

#if defined(MODBUSMASTER_SHARE_LINE)
    static mbm_line *line() { return &Line::wire.line; }
    static Wire &wireOf(void *) { return Line::wire; }

    // Uses the clock and the driver, not the Stream. The hooks find the object in the wire.
    static void beginLine()
    {
        static const mbm_port hooks = {nullptr,   readHook, writeHook, clockHook,
                                       flushHook, preHook,  postHook,  idleHook};
        mbm_line_beginRtu(line(), &hooks, nullptr, 0);
    }

    // After a copy: a pending request stays that of the original.
    void adoptCopy()
    {
        Line::giveUp(state.node);
        attach(getSlaveID());
    }

    // Makes the line work for an object.
    static void takeLine(State &user)
    {
        Line::wire.user = &user;
        user.tellGap();
    }

    // Makes a request whose frame has `bytes` bytes, by calling `function`.
    // Not inline: the memory of the frame is free when it returns.
    template <typename... Parameters>
    __attribute__((noinline)) uint8_t request(uint8_t bytes,
                                              uint8_t (*function)(mbm_node *, Parameters...),
                                              Parameters... arguments)
    {
        uint8_t *frame;
        if (Line::kept != nullptr) {
            frame = Line::kept->frame;
            bytes = frameBytes;
        } else {
            frame = static_cast<uint8_t *>(__builtin_alloca(bytes));
        }
        if (state.stream == nullptr)
            return ku8MBNotInitialised;
        // The kept frame may be in use by a request that only waits for its unit and gives way.
        if (mbm_line_setFrame(line(), frame, bytes) != MBM_OK && Line::kept == nullptr)
            return ku8MBBusy;
        State *const user = Line::wire.user;
        const bool sent = Line::wire.sent;
        takeLine(state);
        Line::wire.sent = false;
        const uint8_t result = function(&state.node, arguments...);
        if (result == ku8MBBusy) {
            takeLine(*user);
            Line::wire.sent = sent;
        }
        return result;
    }
#else
    mbm_line *line() { return &state.own.wire.line; }
    static Wire &wireOf(void *context) { return *static_cast<Wire *>(context); }

    void beginLine()
    {
        Wire &wire = state.own.wire;
        wire.user = &state;
        state.own.port = modbusPort(&wire, readHook, writeHook, clockHook, flushHook, preHook,
                                    postHook);
        state.own.port.idle = idleHook;
        mbm_line_beginRtu(&wire.line, &state.own.port, state.own.frame, frameBytes);
    }

    // After a copy: a pending request stays that of the original.
    void adoptCopy()
    {
        cancel();
        mbm_line_cancel(line());
        attach(getSlaveID());
        beginLine();
    }

    // Makes a request by calling `function`.
    template <typename... Parameters>
    uint8_t request(uint8_t, uint8_t (*function)(mbm_node *, Parameters...),
                    Parameters... arguments)
    {
        if (state.stream == nullptr)
            return ku8MBNotInitialised;
        ModbusMasterUse<void>::tell(*line());
        state.tellGap();
        state.own.wire.sent = false;
        return function(&state.node, arguments...);
    }
#endif

    uint8_t sendWord(uint16_t word) { return mbm_node_send(&state.node, word); }
    // Both, the low one first; only the low one if only one fits.
    uint8_t sendWords(uint32_t words)
    {
        const uint8_t low = sendWord(words & 0xFFFFu);
        return low == MBM_OK ? sendWord(static_cast<uint16_t>(words >> 16)) : low;
    }

    static int16_t readHook(void *context, uint8_t *bytes, uint16_t capacity)
    {
        Stream &stream = *wireOf(context).user->stream;
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
            Line::used();
        return static_cast<int16_t>(static_cast<uint16_t>(bytes - first));
    }
    static int16_t writeHook(void *context, const uint8_t *bytes, uint16_t length)
    {
        Wire &wire = wireOf(context);
#if !defined(__AVR__)
        if (wire.counting == wire.user->stream)
            return static_cast<int16_t>(wire.counting->write(bytes, length));
#endif
        // Byte by byte: if the write of a block returns 0, it took one byte or all. A
        // request of this class has 4 to 255 bytes; an 8-bit counter saves flash on AVR.
        uint8_t left = static_cast<uint8_t>(length);
        do {
            Stream &stream = *wire.user->stream;
            if (stream.write(*bytes) != 0)
                wire.counting = &stream;
            else if (wire.counting == &stream || stream.getWriteError() != 0)
                break;
            bytes++;
        } while (--left != 0);
        return static_cast<uint8_t>(length - left);
    }
    static uint32_t clockHook(void *) { return micros() & 0xFFFFFFFFu; }
    static uint8_t flushHook(void *context)
    {
        wireOf(context).user->stream->flush();
        return 1;
    }
    static void preHook(void *context) { wireOf(context).user->onPre.call(); }
    static void postHook(void *context)
    {
        Wire &wire = wireOf(context);
        wire.sent = true;
        Line::used();
        wire.user->onPost.call();
    }
    static void idleHook(void *context, mbm_node *)
    {
        Wire &wire = wireOf(context);
        if (wire.sent) {
            MODBUSMASTER_DEBUG(B, true);
            wire.user->onIdle.call();
            MODBUSMASTER_DEBUG(B, false);
            wire.sent = true; // a refused request of the callback has cleared it
        }
        MODBUSMASTER_YIELD();
    }
};

#endif
