/**
 * @file mbm.h
 * @brief A Modbus stack for firmware.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit.
 *
 * Every function: pointers are NULL or valid; NULL is answered with
 * MBM_INVALID_ARGUMENT and an object that was never begun with
 * MBM_NOT_INITIALISED, never with a crash. Objects are the caller's storage,
 * zero before first use, with no heap and no globals behind them. Nothing is
 * re-entrant on one object, and nothing may be called from an interrupt unless
 * its comment says so; any number of objects may be used side by side, each
 * from one thread. "V1.1b3" is the Modbus application protocol, "serial line
 * guide V1.02" the guide for RTU and ASCII.
 */

#ifndef MBM_H
#define MBM_H

#include <stdint.h>

/** Version of this header and of the archive it belongs to. */
#define MBM_VERSION "0.1.0"

/** Bytes of a frame buffer for any request and reply of so many words. */
#define MBM_FRAME_BYTES(words) (2u * (words) + 13u)

/**
 * Most registers that one request reads (V1.1b3, 6.3 and 6.4).
 */
#define MBM_MAX_READ_REGISTERS 125

/**
 * Most registers that one request writes (V1.1b3, 6.12).
 */
#define MBM_MAX_WRITE_REGISTERS 123

/**
 * Most registers that a read/write request writes (V1.1b3, 6.17).
 */
#define MBM_MAX_READ_WRITE_REGISTERS 121

/**
 * Most coils or discrete inputs that one request reads (V1.1b3, 6.1 and 6.2).
 */
#define MBM_MAX_READ_BITS 2000

/**
 * Most coils that one request writes (V1.1b3, 6.11).
 */
#define MBM_MAX_WRITE_BITS 1968

/**
 * Most bytes of an RTU frame (serial line guide V1.02, 2.5.1).
 */
#define MBM_MAX_FRAME 256

/**
 * The call succeeded.
 */
#define MBM_OK 0

/**
 * Exception of the device: it does not know the function.
 */
#define MBM_ILLEGAL_FUNCTION 1

/**
 * Exception of the device: it has no such address. Also, with nothing sent,
 * for a range that passes address 65535.
 */
#define MBM_ILLEGAL_DATA_ADDRESS 2

/**
 * Exception of the device: it refuses the quantity or value. Also, with
 * nothing sent, for a quantity that the standard forbids, and for writes of
 * more than the transmit buffer holds.
 */
#define MBM_ILLEGAL_DATA_VALUE 3

/**
 * Exception of the device: it failed while it carried the request out.
 */
#define MBM_SLAVE_DEVICE_FAILURE 4

/**
 * Exception of the device: accepted, but it takes long.
 */
#define MBM_ACKNOWLEDGE 5

/**
 * Exception of the device: busy, ask again later.
 */
#define MBM_SLAVE_DEVICE_BUSY 6

/**
 * Exception of the device: a file's memory is inconsistent.
 */
#define MBM_MEMORY_PARITY_ERROR 8

/**
 * Exception of a gateway: no path to the device.
 */
#define MBM_GATEWAY_PATH_UNAVAILABLE 10

/**
 * Exception of a gateway: the device behind it did not answer.
 */
#define MBM_GATEWAY_TARGET_FAILED_TO_RESPOND 11

/**
 * Within the response timeout only frames of other units arrived.
 */
#define MBM_INVALID_SLAVE_ID 224

/**
 * Within the response timeout the unit answered, but to another function.
 */
#define MBM_INVALID_FUNCTION 225

/**
 * No complete reply within the response timeout.
 */
#define MBM_RESPONSE_TIMED_OUT 226

/**
 * The reply arrived damaged: its CRC is wrong.
 */
#define MBM_INVALID_CRC 227

/**
 * A NULL pointer, a port without read, write or micros, a buffer of no use.
 */
#define MBM_INVALID_ARGUMENT 228

/**
 * The unit answered the function with a right CRC, but not this request:
 * wrong byte count, wrong echo, or an exception code of 0 or from 0x80.
 */
#define MBM_MALFORMED_REPLY 229

/**
 * The port's read or write reported that the link is lost.
 */
#define MBM_LINK_LOST 230

/**
 * The object has a request under way; nothing was changed.
 */
#define MBM_BUSY 231

/**
 * A function that reads cannot be broadcast; nothing was sent.
 */
#define MBM_BROADCAST_NOT_ALLOWED 232

/**
 * The frame buffer cannot hold the request (nothing was sent), or frame or
 * response buffer cannot hold the reply (the response words are unchanged).
 */
#define MBM_BUFFER_TOO_SMALL 233

/**
 * The object was never begun, or has no buffers.
 */
#define MBM_NOT_INITIALISED 234

/**
 * The request is under way: call mbm_master_poll again.
 */
#define MBM_PENDING 235

/**
 * For as long as the response timeout the line never fell silent, or the
 * port took no bytes.
 */
#define MBM_LINE_BUSY 236

/**
 * The request was given up by mbm_master_cancel or mbm_master_begin.
 */
#define MBM_CANCELLED 237

/**
 * A frame that is not whole yet: more bytes are to come.
 */
#define MBM_INCOMPLETE_FRAME 238

/**
 * No frame of this framing begins like that, or has such a length.
 */
#define MBM_MALFORMED_FRAME 239

/**
 * A Modbus RTU master: one line, one request at a time.
 *
 * Storage is yours and must be zero before first use, which a static object
 * is (`static mbm_master node;`). Settings and words want mbm_master_begin or
 * mbm_master_setBuffers before them, requests want both. Not re-entrant: use
 * one object from one thread and never from an interrupt; several objects are
 * independent of each other.
 */
typedef struct mbm_master {
    /**
     * Not for you.
     */
    void *pointers[20];
    /**
     * Not for you.
     */
    uint32_t words[20];
} mbm_master;

/**
 * What the firmware supplies: a byte stream, a clock, and optional hooks.
 *
 * Copied by mbm_master_begin; only `context` must stay valid. Hooks that are
 * NULL are not called; `read`, `write` and `micros` must be there. No hook
 * may call a function on the object that called it, except that `idle` may:
 * it is told MBM_BUSY, and getters work.
 */
typedef struct mbm_port {
    /**
     * Handed to every hook. Yours, may be NULL.
     */
    void *context;
    /**
     * Takes up to `capacity` received bytes without waiting. Returns how
     * many, 0 if none has arrived yet, negative if the link is lost.
     */
    int16_t (*read)(void *context, uint8_t *bytes, uint16_t capacity);
    /**
     * Accepts up to `length` bytes to send without waiting for the wire.
     * Returns how many, 0 if none just now, negative if the link is lost.
     */
    int16_t (*write)(void *context, const uint8_t *bytes, uint16_t length);
    /**
     * A clock in microseconds that wraps at 2^32. A platform with a
     * millisecond tick returns `tick * 1000`.
     */
    uint32_t (*micros)(void *context);
    /**
     * Optional: 1 once the last bit has left, 0 while bits are to come. It
     * may wait for the last bit instead and return 1.
     */
    uint8_t (*flush)(void *context);
    /**
     * Optional: called before the first byte of a request (RS-485 driver on).
     */
    void (*preTransmission)(void *context);
    /**
     * Optional: called after the last bit of a request (RS-485 driver off).
     */
    void (*postTransmission)(void *context);
    /**
     * Optional: called again and again while a blocking call waits, never
     * between preTransmission and postTransmission. It may take its time, and
     * ask mbm_master_pollDelay how much of it there is.
     */
    void (*idle)(void *context);
} mbm_port;

/**
 * What happened on the line, since the caller zeroed it. Each wraps at 2^32.
 */
typedef struct mbm_counters {
    /**
     * Requests sent, retries included.
     */
    uint32_t requests;
    /**
     * Replies that answered a request, exceptions included.
     */
    uint32_t replies;
    /**
     * Replies that were exceptions.
     */
    uint32_t exceptions;
    /**
     * Requests whose reply arrived damaged.
     */
    uint32_t badCrc;
    /**
     * Requests that were not answered in time.
     */
    uint32_t timeouts;
    /**
     * Frames with a right CRC of other units, or that answered no request of
     * ours, while a reply was waited for.
     */
    uint32_t foreignFrames;
    /**
     * Replies that were found behind bytes that were no frame.
     */
    uint32_t resynchronisations;
    /**
     * Bytes sent.
     */
    uint32_t bytesSent;
    /**
     * Bytes received, foreign ones and noise included.
     */
    uint32_t bytesReceived;
} mbm_counters;

/**
 * A receive ring between an interrupt handler and the main loop.
 *
 * One side puts bytes in with mbm_ring_put or mbm_ring_write: an interrupt
 * handler, a DMA callback or a thread. One side takes them out with
 * mbm_ring_read: the main loop, as the `read` hook of a port. Each may
 * interrupt the other at any point; neither may be two at once. No interrupt
 * is ever disabled.
 */
typedef struct mbm_ring {
    /**
     * Not for you.
     */
    uint8_t *bytes;
    /**
     * Not for you.
     */
    uint16_t size;
    /**
     * Not for you.
     */
    uint16_t positions[3];
} mbm_ring;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Begins to talk to a slave over a port.
 *
 * May be called again at any time, which is cheap: to talk to another slave,
 * or over another port. Settings, buffers and the words in them stay; what
 * was queued by send is dropped, and a request under way is given up. Opens
 * nothing: the port is open already.
 *
 * @param master  the object; zeroed before the first call
 * @param slave   unit id, 1 to 247; 248 to 255 are sent as they are, 0 is
 *                broadcast (serial line guide V1.02, 2.2)
 * @param port    copied; read, write and micros must be there
 * @return MBM_OK, or MBM_INVALID_ARGUMENT for a NULL pointer or a missing hook
 */
uint8_t mbm_master_begin(struct mbm_master *master,
                         uint8_t slave,
                         const struct mbm_port *port);

/**
 * Lends the buffers that requests and replies need, before or after begin.
 *
 * They must not overlap, and stay valid for as long as the object is used.
 * MBM_FRAME_BYTES(words) bytes of frame serve any request and reply of so
 * many words. What does not fit into a smaller buffer is answered with a
 * status, never cut short.
 *
 * @param master         the object; zeroed before the first call
 * @param response       words that reads fill; NULL only with 0 words
 * @param responseWords  0 to 255; 125 hold any reply
 * @param transmit       words that writes send; NULL only with 0 words
 * @param transmitWords  0 to 255; 123 hold any request
 * @param frame          bytes of one frame; keeps nothing between requests
 * @param frameBytes     at least 8; 256 hold any frame
 * @return MBM_OK, MBM_INVALID_ARGUMENT, or MBM_BUSY while a request is under way
 */
uint8_t mbm_master_setBuffers(struct mbm_master *master,
                              uint16_t *response,
                              uint16_t responseWords,
                              uint16_t *transmit,
                              uint16_t transmitWords,
                              uint8_t *frame,
                              uint16_t frameBytes);

/**
 * Moves a non-blocking request on, without waiting.
 *
 * Call it as often as you like, at least once per character time of the line
 * if nothing else buffers its bytes.
 *
 * @param master  the object
 * @return MBM_PENDING until the request has ended, then its status, again at
 *         every call; MBM_OK if there was no request yet
 */
uint8_t mbm_master_poll(struct mbm_master *master);

/**
 * How long mbm_master_poll will find nothing to do unless a byte arrives, so
 * that a program or an idle hook may sleep until then.
 *
 * @param master  the object
 * @return microseconds; 0 means poll now, 0xFFFFFFFF that there is no request
 */
uint32_t mbm_master_pollDelay(const struct mbm_master *master);

/**
 * Gives up the request under way, with the driver switched off; its status
 * becomes MBM_CANCELLED. Without a request it does nothing.
 *
 * @param master  the object
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_cancel(struct mbm_master *master);

/**
 * The status of the last request.
 *
 * @param master  the object
 * @return MBM_PENDING while it is under way, MBM_OK if there was none
 */
uint8_t mbm_master_status(const struct mbm_master *master);

/**
 * The raw exception code of the last reply, also where it is none that the
 * standard allows (V1.1b3, 7).
 *
 * @param master  the object
 * @return the code; 0 if the last request ended without an exception frame
 */
uint8_t mbm_master_getExceptionCode(const struct mbm_master *master);

/**
 * Function 01: reads coils into the response words, 16 to a word, lowest bit
 * first, the last word padded with zeros (V1.1b3, 6.1).
 *
 * This and the nine other functions behave alike. In blocking mode they return
 * when the request has ended, in non-blocking mode at once with MBM_PENDING, and
 * mbm_master_poll ends it. Whatever the outcome, they empty the queue of send
 * and set receive back to the first word. Response words change only on
 * success, transmit words never. What no device could accept (a quantity that
 * the standard forbids, addresses beyond 65535) is answered with the exception
 * that a device would send, and nothing is sent.
 *
 * @param master    the object
 * @param address   first coil, 0 to 65535, as on the wire
 * @param quantity  1 to 2000
 * @return MBM_OK, or an exception of the device (0x01 to 0x7F), or
 *         MBM_PENDING (non-blocking), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
 *         MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION,
 *         MBM_LINK_LOST, MBM_LINE_BUSY, MBM_BUFFER_TOO_SMALL,
 *         MBM_BROADCAST_NOT_ALLOWED, MBM_BUSY, MBM_CANCELLED,
 *         MBM_NOT_INITIALISED, MBM_INVALID_ARGUMENT
 */
uint8_t mbm_master_readCoils(struct mbm_master *master,
                             uint16_t address,
                             uint16_t quantity);

/**
 * Function 02: reads discrete inputs into the response words, 16 to a word,
 * lowest bit first, the last word padded with zeros (V1.1b3, 6.2).
 *
 * @param master    the object
 * @param address   first input, 0 to 65535, as on the wire
 * @param quantity  1 to 2000
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_readDiscreteInputs(struct mbm_master *master,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 03: reads holding registers into the response words (V1.1b3, 6.3).
 *
 * @param master    the object
 * @param address   first register, 0 to 65535, as on the wire
 * @param quantity  1 to 125
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_readHoldingRegisters(struct mbm_master *master,
                                        uint16_t address,
                                        uint16_t quantity);

/**
 * Function 04: reads input registers into the response words (V1.1b3, 6.4).
 *
 * @param master    the object
 * @param address   first register, 0 to 65535, as on the wire
 * @param quantity  1 to 125
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_readInputRegisters(struct mbm_master *master,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 05: switches one coil (V1.1b3, 6.5). Unit 0 broadcasts.
 *
 * @param master   the object
 * @param address  the coil, 0 to 65535; becomes the write address
 * @param state    0 is off, anything else is on
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_writeSingleCoil(struct mbm_master *master,
                                   uint16_t address,
                                   uint8_t state);

/**
 * Function 06: writes one register (V1.1b3, 6.6). Unit 0 broadcasts.
 *
 * @param master   the object
 * @param address  the register, 0 to 65535; becomes the write address
 * @param value    its value; also becomes transmit word 0
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_writeSingleRegister(struct mbm_master *master,
                                       uint16_t address,
                                       uint16_t value);

/**
 * Function 0F: writes coils from the transmit words, from word 0 on, lowest bit
 * first (V1.1b3, 6.11). Unit 0 broadcasts.
 *
 * @param master    the object
 * @param address   first coil, 0 to 65535; becomes the write address
 * @param quantity  1 to 1968, and no more than the transmit words hold
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_writeMultipleCoils(struct mbm_master *master,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 0F: writes the queued bits to the last write address
 * (beginTransmission, sendBit, then this).
 *
 * @param master  the object
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_writeQueuedCoils(struct mbm_master *master);

/**
 * Function 10: writes registers from the transmit words, from word 0 on
 * (V1.1b3, 6.12). Unit 0 broadcasts.
 *
 * @param master    the object
 * @param address   first register, 0 to 65535; becomes the write address
 * @param quantity  1 to 123, and no more than the transmit words
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_writeMultipleRegisters(struct mbm_master *master,
                                          uint16_t address,
                                          uint16_t quantity);

/**
 * Function 10: writes the queued complete words to the last write address
 * (beginTransmission, send, then this).
 *
 * @param master  the object
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_writeQueuedRegisters(struct mbm_master *master);

/**
 * Function 16: the device sets a register to
 * (register AND andMask) OR (orMask AND NOT andMask) (V1.1b3, 6.16).
 * Unit 0 broadcasts.
 *
 * @param master   the object
 * @param address  the register, 0 to 65535; becomes the write address
 * @param andMask  keeps bits; also becomes transmit word 0
 * @param orMask   sets bits where andMask is 0; also becomes transmit word 1
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_maskWriteRegister(struct mbm_master *master,
                                     uint16_t address,
                                     uint16_t andMask,
                                     uint16_t orMask);

/**
 * Function 17: the device writes registers from the transmit words first, then
 * reads others into the response words, in one request (V1.1b3, 6.17).
 *
 * @param master         the object
 * @param readAddress    first register to read, 0 to 65535
 * @param readQuantity   1 to 125
 * @param writeAddress   first register to write, 0 to 65535; becomes the write
 *                       address
 * @param writeQuantity  1 to 121, and no more than the transmit words
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_readWriteMultipleRegisters(struct mbm_master *master,
                                              uint16_t readAddress,
                                              uint16_t readQuantity,
                                              uint16_t writeAddress,
                                              uint16_t writeQuantity);

/**
 * Function 17: writes the queued complete words to the last write address, then
 * reads.
 *
 * @param master        the object
 * @param readAddress   first register to read, 0 to 65535
 * @param readQuantity  1 to 125
 * @return a status; see mbm_master_readCoils
 */
uint8_t mbm_master_readWriteQueuedRegisters(struct mbm_master *master,
                                            uint16_t readAddress,
                                            uint16_t readQuantity);

/**
 * Reads holding registers for mbm_master_receive to give, one after the other.
 *
 * @param master    the object
 * @param address   first register, 0 to 65535
 * @param quantity  1 to 125
 * @return how many words mbm_master_receive will give; 0 if the request failed
 *         (mbm_master_status says how) or, non-blocking, is under way
 */
uint8_t mbm_master_requestFrom(struct mbm_master *master,
                               uint16_t address,
                               uint16_t quantity);

/**
 * Sets the unit that later requests go to.
 *
 * @param master  the object
 * @param slave   1 to 247; 248 to 255 are sent as they are, 0 is broadcast
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setSlaveID(struct mbm_master *master, uint8_t slave);

/**
 * The unit that requests go to.
 *
 * @param master  the object
 * @return the unit id, 1 until somebody says otherwise; 0 for an object that is
 *         not ready for settings
 */
uint8_t mbm_master_getSlaveID(const struct mbm_master *master);

/**
 * Sets how long a reply may take, from the last bit of the request to the last
 * byte of the reply.
 *
 * @param master        the object
 * @param milliseconds  0 to 65535; 2000 at first
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setResponseTimeout(struct mbm_master *master, uint16_t milliseconds);

/**
 * Tells the baud rate of the line, from which the gap before a request (t3.5,
 * serial line guide V1.02, 2.5.1.1) and the length of a character follow. It
 * sets nothing on the line. Untold, the gap is 4 ms, which is safe from 9600 up.
 *
 * @param master  the object
 * @param baud    bits per second; 0 goes back to untold
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setBaudRate(struct mbm_master *master, uint32_t baud);

/**
 * Sets the silence before a request, in place of t3.5: 0 where nothing but the
 * master's own traffic needs it, more for devices that are slow to listen again.
 * A later mbm_master_setBaudRate sets it back to t3.5.
 *
 * @param master        the object
 * @param microseconds  counted from the last byte seen or sent
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setGap(struct mbm_master *master, uint32_t microseconds);

/**
 * Sets how long a broadcast takes, since nobody answers it (serial line guide
 * V1.02, 2.4.1).
 *
 * @param master        the object
 * @param milliseconds  0 to 65535; 100 at first
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setTurnaroundDelay(struct mbm_master *master, uint16_t milliseconds);

/**
 * Sets how long the line is left alone after a request that got no right
 * reply, so that a late one is not taken for the next. What arrives meanwhile
 * is dropped.
 *
 * RTU cannot tell a late reply of the same unit, function and length, nor a
 * late exception to the same function, from the one that is waited for; this
 * time is what makes that rare. A slave that may answer after the response
 * timeout plus this time needs a longer timeout.
 *
 * @param master        the object
 * @param milliseconds  0 to 65535; 100 at first
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setQuietTime(struct mbm_master *master, uint16_t milliseconds);

/**
 * Sets how often a request is repeated whose reply is missing, damaged or
 * malformed. Exceptions are replies and are not repeated.
 *
 * @param master   the object
 * @param retries  0 to 255; 0 at first
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setRetries(struct mbm_master *master, uint8_t retries);

/**
 * Tells that the receiver hears what the driver sends, so each request comes back
 * before its reply and is to be dropped.
 *
 * @param master  the object
 * @param on      0 (at first) or 1
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setEchoDiscard(struct mbm_master *master, uint8_t on);

/**
 * Holds the driver on after the port's flush, for platforms whose flush returns
 * before the last bit has left.
 *
 * @param master      the object
 * @param characters  times one character of the told baud rate (9600 if untold);
 *                    0 at first
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setPostFlushHold(struct mbm_master *master, uint8_t characters);

/**
 * Chooses between functions that return when the request has ended (at first) and
 * functions that return MBM_PENDING at once, for mbm_master_poll to end them.
 *
 * @param master  the object
 * @param on      1 blocking, 0 non-blocking; holds from the next request on
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setBlocking(struct mbm_master *master, uint8_t on);

/**
 * Counts into storage of yours from now on. Read and zero it as you like, but not
 * from an interrupt.
 *
 * @param master    the object
 * @param counters  zeroed by you; NULL stops counting
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setCounters(struct mbm_master *master, struct mbm_counters *counters);

/**
 * Says that somebody else has just used the line, another object for example:
 * the gap before the next request counts from now.
 *
 * @param master  the object
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_lineUsed(struct mbm_master *master);

/**
 * A word of the last successful read.
 *
 * @param master  the object
 * @param index   0 to 255
 * @return the word; 0xFFFF past the end of the response buffer
 */
uint16_t mbm_master_getResponseBuffer(const struct mbm_master *master, uint8_t index);

/**
 * Zeroes the response words; receive goes on where it was.
 *
 * @param master  the object
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_clearResponseBuffer(struct mbm_master *master);

/**
 * Sets a word for the functions that write. Does not move the queue of send.
 *
 * @param master  the object
 * @param index   0 to the transmit buffer's words - 1
 * @param value   the word
 * @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS past the end of the buffer,
 *         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_setTransmitBuffer(struct mbm_master *master,
                                     uint8_t index,
                                     uint16_t value);

/**
 * Zeroes the transmit words; the queue of send stays.
 *
 * @param master  the object
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_clearTransmitBuffer(struct mbm_master *master);

/**
 * Sets the write address and empties the queue of send; the words stay.
 *
 * @param master   the object
 * @param address  0 to 65535, for the functions ending in Queued
 * @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_beginTransmission(struct mbm_master *master, uint16_t address);

/**
 * Queues a word behind those queued. Bits queued before keep their word.
 *
 * @param master  the object
 * @param word    the word
 * @return MBM_OK, MBM_BUFFER_TOO_SMALL with nothing queued past the end of the
 *         transmit buffer, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_send(struct mbm_master *master, uint16_t word);

/**
 * Queues a byte as one word.
 *
 * @param master  the object
 * @param byte    the low byte of the word; the high byte is 0
 * @return MBM_OK, MBM_BUFFER_TOO_SMALL with nothing queued past the end of the
 *         transmit buffer, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_send8(struct mbm_master *master, uint8_t byte);

/**
 * Queues two words, the low one first; the low one alone if only that fits.
 *
 * @param master  the object
 * @param value   both words
 * @return MBM_OK, MBM_BUFFER_TOO_SMALL if a word did not fit,
 *         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_send32(struct mbm_master *master, uint32_t value);

/**
 * Queues a bit behind those queued, lowest bit of a word first.
 *
 * @param master  the object
 * @param on      0 is off, anything else is on
 * @return MBM_OK, MBM_BUFFER_TOO_SMALL with nothing queued past the end of the
 *         transmit buffer, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
 */
uint8_t mbm_master_sendBit(struct mbm_master *master, uint8_t on);

/**
 * How many words of the last successful read mbm_master_receive has yet to give.
 *
 * @param master  the object
 * @return 0 to 125
 */
uint8_t mbm_master_available(const struct mbm_master *master);

/**
 * The next word of the last successful read.
 *
 * @param master  the object
 * @return the word; 0xFFFF when none is left
 */
uint16_t mbm_master_receive(struct mbm_master *master);

/**
 * Makes a ring of your bytes, empty. Neither side may use it meanwhile.
 *
 * @param ring   the object
 * @param bytes  storage, yours, valid for as long as the ring is used
 * @param size   2 to 65535, on an AVR 2 to 256; the ring holds one byte less
 * @return MBM_OK or MBM_INVALID_ARGUMENT
 */
uint8_t mbm_ring_begin(struct mbm_ring *ring, uint8_t *bytes, uint16_t size);

/**
 * Puts a byte in. An interrupt may call it.
 *
 * @param ring  the object
 * @param byte  the byte received
 * @return 1, or 0 if there was no room: the byte counts as lost
 */
uint8_t mbm_ring_put(struct mbm_ring *ring, uint8_t byte);

/**
 * Puts bytes in, in order. An interrupt may call it.
 *
 * @param ring    the object
 * @param bytes   the bytes received; NULL only with length 0
 * @param length  how many
 * @return how many found room; the others count as lost
 */
uint16_t mbm_ring_write(struct mbm_ring *ring, const uint8_t *bytes, uint16_t length);

/**
 * Takes bytes out, in order, without waiting.
 *
 * @param ring      the object
 * @param bytes     where they go; NULL only with capacity 0
 * @param capacity  at most so many
 * @return how many there were
 */
uint16_t mbm_ring_read(struct mbm_ring *ring, uint8_t *bytes, uint16_t capacity);

/**
 * How many bytes there are to take out, for the side that takes.
 *
 * @param ring  the object
 * @return bytes; 0 also if the ring was never begun
 */
uint16_t mbm_ring_available(const struct mbm_ring *ring);

/**
 * Forgets what there is to take out, for the side that takes.
 *
 * @param ring  the object
 */
void mbm_ring_clear(struct mbm_ring *ring);

/**
 * How many bytes found no room since begin; either side may ask.
 *
 * @param ring  the object
 * @return bytes; wraps at 65536, on an AVR at 256
 */
uint16_t mbm_ring_lost(const struct mbm_ring *ring);

/**
 * Explains a status in a few words of English.
 *
 * Any thread or interrupt may call it.
 *
 * @param status  any number
 * @return a constant string, never NULL
 */
const char *mbm_statusText(uint8_t status);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MBM_H */
