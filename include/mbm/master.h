/**
 * @file mbm/master.h
 * @brief The master: RTU, one request at a time.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_MASTER_H
#define MBM_MASTER_H

#include "base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Master: RTU, one request at a time, blocking or not =========================== */

/**
 * A node: a device on a line, as the master sees it, with the words of its requests and
 * replies.
 *
 * You own the storage. Initialise it with MBM_INIT (`mbm_node meter = MBM_INIT;`) and call
 * mbm_node_begin before all else. Nodes of different lines are independent of each other. One
 * node of a line may have a pending request; a request of another one returns MBM_BUSY
 * meanwhile. A non-blocking request that was not sent yet, because its unit may still answer
 * one that was cancelled, gives way to another node's: its status becomes MBM_CANCELLED. Use a
 * line and its nodes from one thread only, and never from an interrupt. mbm_port says which
 * functions the hooks of the port may call.
 *
 * A call that is refused changes nothing. Exceptions are the functions that make a request,
 * as mbm_node_readCoils describes.
 */
typedef struct mbm_node {
    void *pointers[5]; /**< Private. */
    uint32_t words[4]; /**< Private. */
} mbm_node;

/**
 * A serial line with RTU frames: a port, a frame buffer, settings, and the pending request.
 * The nodes on the line use it, one request at a time: see mbm_node.
 *
 * You own the storage. Initialise it with MBM_INIT (`mbm_line line = MBM_INIT;`). Use a line
 * and its nodes from one thread only, and never from an interrupt. Several lines are
 * independent of each other. mbm_port says which functions the hooks of the port may call.
 *
 * A call that is refused changes nothing.
 */
typedef struct mbm_line {
    void *pointers[25]; /**< Private. */
    uint32_t words[14]; /**< Private. */
} mbm_line;

/**
 * The callbacks of a line, for mbm_node_idle, mbm_node_preTransmission and
 * mbm_node_postTransmission. A program that sets the members of its mbm_port needs no such object.
 *
 * You provide the storage. Initialise it with MBM_INIT. Call mbm_nodeCallbacks_begin, then begin
 * the line with mbm_nodeCallbacks_port instead of your port. The object must not move while its
 * port is in use.
 */
typedef struct mbm_nodeCallbacks {
    void *pointers[13]; /**< Private. */
} mbm_nodeCallbacks;

/**
 * Begins a line with RTU frames on a port.
 *
 * It may be called again, for another port or frame buffer, whenever no request is pending;
 * this is cheap. Settings stay. It does not open the port: that must be open already. The first
 * request waits for no gap, unless bytes arrive or mbm_line_used was called.
 *
 * @param port        the port. It is not copied: it must stay valid and unchanged for as long as
 *                    the object is used. read, write and micros must not be NULL
 * @param frame       as for mbm_line_setFrame; also NULL, if you call that function later
 * @param frameBytes  as for mbm_line_setFrame; 0 if `frame` is NULL
 * @return a status; MBM_BUSY while a request is pending
 */
uint8_t mbm_line_beginRtu(mbm_line *line, const mbm_port *port, uint8_t *frame,
                          uint16_t frameBytes);

/**
 * Begins a node: a unit on a line, with your words for its requests and replies.
 *
 * It may be called again, for another unit, line or words, whenever the node has no pending
 * request; this is cheap. Settings and the content of the words stay. The node discards what
 * mbm_node_send queued. The line may be begun before or afterwards.
 *
 * The words must not overlap, and must stay valid for as long as the object is used. Any number
 * of nodes may share words. Keep a node until its request has ended.
 *
 * @param line           the line, which must stay valid for as long as the object is used
 * @param unit           the unit identifier, 1 to 247; 0 is broadcast (serial line guide V1.02,
 *                       2.2). Requests to 248 to 255, which the standard reserves, are sent too
 * @param response       the words that reads fill; NULL only if `responseWords` is 0
 * @param responseWords  0 to 255; 125 hold any reply
 * @param transmit       the words that writes send; NULL only if `transmitWords` is 0
 * @param transmitWords  0 to 255; 123 hold any request
 * @return a status; MBM_BUSY while a request of the node is pending
 */
uint8_t mbm_node_begin(mbm_node *node, mbm_line *line, uint8_t unit, uint16_t *response,
                       uint16_t responseWords, uint16_t *transmit, uint16_t transmitWords);

/**
 * Puts callbacks before a port. At first there are none.
 *
 * It may be called again, for another port, whenever no request is pending. The callbacks stay.
 *
 * @param port  the port. It is not copied: it must stay valid and unchanged for as long as the
 *              object is used. It must not be the port of these callbacks. Its hooks read, write
 *              and micros are required
 */
uint8_t mbm_nodeCallbacks_begin(mbm_nodeCallbacks *callbacks, const mbm_port *port);

/**
 * Sets the write address and empties the queue of mbm_node_send. The transmit words do not
 * change.
 *
 * @param address  the address to which the functions with Queued in their name write, 0 to 65535
 */
uint8_t mbm_node_beginTransmission(mbm_node *node, uint16_t address);

/**
 * Sets the buffer of one frame. The line uses it only while a request is pending. So in
 * blocking mode it may lie on the stack of a function that sets it and makes the request.
 *
 * A frame buffer of MBM_FRAME_BYTES(words) bytes suffices for every request and reply with
 * that number of words. MBM_FRAME_BYTES(2 * words) bytes also hold a late reply beside the
 * right one. If a request or a reply does not fit, the function that makes the request returns
 * a status. Data are never cut off.
 *
 * @param frame       the buffer. Its content is not used between requests
 * @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
 * @return a status; MBM_BUSY while a request is pending
 */
uint8_t mbm_line_setFrame(mbm_line *line, uint8_t *frame, uint16_t frameBytes);

/**
 * Gives up the pending request, whichever node has made it, and switches the driver off. The
 * status of that node becomes MBM_CANCELLED when you poll it. Call it if the node is lost.
 * If no request is pending, it does nothing.
 */
uint8_t mbm_line_cancel(mbm_line *line);

/**
 * Sets the baud rate from which the master computes the gap before a request (t3.5, serial
 * line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure the
 * serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
 *
 * @param baud  bits per second; 0 (the default): unknown
 */
uint8_t mbm_line_setBaudRate(mbm_line *line, uint32_t baud);

/**
 * Sets the silence before a request, instead of t3.5. Use 0 if no device on the line needs
 * the gap, and more than t3.5 for devices that need longer before they can receive again.
 * A later call of mbm_line_setBaudRate sets it back to t3.5.
 *
 * @param gapUs  microseconds from the last byte received or sent; a value above 2^31 (36
 *               minutes) means 2^31
 */
uint8_t mbm_line_setGap(mbm_line *line, uint32_t gapUs);

/**
 * Sets the turnaround delay: how long the master waits after a broadcast, which no device
 * answers (serial line guide V1.02, 2.4.1).
 *
 * @param delayMs  milliseconds, 0 to 65535; the default is 100
 */
uint8_t mbm_line_setTurnaroundDelay(mbm_line *line, uint32_t delayMs);

/**
 * Sets the quiet time. It prevents that the master accepts a late reply as the reply to a
 * later request. In RTU the two cannot be distinguished if unit, function and length are the
 * same, or if the late reply is an exception to the same function.
 *
 * After a request without a right reply, the master waits for the quiet time before it sends
 * the next request, and discards bytes that arrive meanwhile. It counts how many replies each
 * unit owes; a frame of the unit takes one away. After a timeout it holds the next reply of
 * that unit until no byte has arrived for the response timeout; after MBM_INVALID_CRC for the
 * quiet time, because the damaged reply is not late. A second reply replaces the held one,
 * because a device answers in order. If the second reply is damaged, the request fails. The
 * last reply that the unit owes is not held. After a request that was cancelled, the next one
 * to that unit is sent when the unit owes none, at the latest two response timeouts and the
 * quiet time after the cancelled one was sent; meanwhile other nodes can use the line.
 *
 * So a device that answers in order never gives the data of another request if a late reply
 * comes at most one response timeout after its request has timed out, whatever its usual
 * latency; and it is heard again in bounded time. A request ends at the latest three response
 * timeouts after it was sent. A wrong reading remains possible if the device takes longer than
 * the response timeout for two requests in a row, or loses the reply after a late one.
 *
 * With a quiet time of 0 the master waits and holds nothing: a reply that is later than the
 * response timeout may be taken for the reply to the next request, and so may all that
 * follow.
 *
 * @param quietMs  milliseconds, 0 to 65535; the default is 100
 */
uint8_t mbm_line_setQuietTime(mbm_line *line, uint32_t quietMs);

/**
 * Sets how often the master repeats a request whose reply is missing, damaged or malformed.
 * It does not repeat a request that was answered with an exception.
 *
 * @param retries  0 to 255; the default is 0
 */
uint8_t mbm_line_setRetries(mbm_line *line, uint8_t retries);

/**
 * Switches echo discarding on or off. Switch it on if the receiver also receives the bytes
 * that the driver sends: then the master discards the copy of each request that arrives before
 * the reply.
 *
 * @param on  0 (the default) or 1
 */
uint8_t mbm_line_setEchoDiscard(mbm_line *line, uint8_t on);

/**
 * Sets how long the driver stays on after the port's flush, for platforms whose flush
 * returns before the last bit was sent.
 *
 * @param characters  the time in characters at the baud rate of mbm_line_setBaudRate (without
 *                    one, at 9600); the default is 0
 */
uint8_t mbm_line_setPostFlushHold(mbm_line *line, uint8_t characters);

/**
 * Sets your storage for counters, in which the master counts from now on. You may read and
 * zero the counters at any time, but not from an interrupt.
 *
 * @param counters  your counters, initialised with MBM_INIT; NULL stops counting
 */
uint8_t mbm_line_setCounters(mbm_line *line, mbm_counters *counters);

/**
 * Reports when another user of the wire, for example another object, used it last.
 * The gap before the next request counts from that time. A time before the last use that
 * the object knows changes nothing.
 *
 * @param timeUs  the time in microseconds on the clock of the object's port, at most 2^31
 *                microseconds (36 minutes) ago
 */
uint8_t mbm_line_usedAt(mbm_line *line, uint32_t timeUs);

/**
 * Reports that another user of the wire has just used it: as mbm_line_usedAt with the
 * present time.
 */
uint8_t mbm_line_used(mbm_line *line);

/**
 * Sends and receives for a non-blocking request, without waiting.
 *
 * Call it as often as you like. If your port does not buffer received bytes, call it at
 * least once in the time of a character.
 *
 * @return MBM_PENDING until the request has ended. Then, at every call, the status of the request.
 *         MBM_OK if there was no request yet
 */
uint8_t mbm_node_poll(mbm_node *node);

/**
 * Returns how long mbm_node_poll will have nothing to do unless a byte arrives. A program
 * or the hook `idle` may sleep for that time. A waiting time that has just started counts
 * from this call, so sleeping makes no timeout longer. Do not sleep longer: while a frame leaves,
 * the driver would go off late.
 *
 * @return microseconds; 0 means poll now, also from within a hook of the port except `idle`;
 *         0xFFFFFFFF means that the node has no pending request
 */
uint32_t mbm_node_pollDelay(mbm_node *node);

/**
 * Gives up the pending request and switches the driver off. The status of the request
 * becomes MBM_CANCELLED. If the node has no pending request, it does nothing. If the request
 * was sent, its reply may still come, so the next request to that unit is sent later: see
 * mbm_line_setQuietTime.
 */
uint8_t mbm_node_cancel(mbm_node *node);

/**
 * Returns the status of the last request.
 *
 * @return the status: MBM_PENDING while the request is pending, MBM_OK if there was no request
 */
uint8_t mbm_node_status(const mbm_node *node);

/**
 * Returns the exception code of the last reply as received, also a code that the standard
 * does not allow (V1.1b3, 7).
 *
 * @return the code; 0 if the last request ended without an exception
 */
uint8_t mbm_node_getExceptionCode(const mbm_node *node);

/**
 * Returns the port that calls the callbacks and passes everything on to the port behind them. Pass
 * it to mbm_line_beginRtu.
 *
 * @return the port, which is valid for as long as the object is used; NULL if it was never begun:
 *         mbm_line_beginRtu refuses that
 */
const mbm_port *mbm_nodeCallbacks_port(const mbm_nodeCallbacks *callbacks);

/**
 * Sets the callback that a blocking function calls again and again while it waits for a reply, or
 * for the turnaround delay of a broadcast. It takes the place of the port's hook `idle`
 * meanwhile. It may call every function, but one that starts a request returns MBM_BUSY.
 *
 * The callbacks are those of the line: all its nodes share them. To get an argument in a callback,
 * set the members of your mbm_port instead.
 *
 * @param callback  the callback; NULL for none
 * @return a status; MBM_NOT_INITIALISED also if the line was not begun with
 *         mbm_nodeCallbacks_port
 */
uint8_t mbm_node_idle(mbm_node *node, void (*callback)(void));

/**
 * Sets the callback that is called before the first byte of a frame is sent, for example to switch
 * an RS-485 driver on. It is called after the port's own hook. See mbm_node_idle.
 *
 * @param callback  the callback, which obeys the rules of mbm_port; NULL for none
 * @return a status; see mbm_node_idle
 */
uint8_t mbm_node_preTransmission(mbm_node *node, void (*callback)(void));

/**
 * Sets the callback that is called after the last bit of a frame was sent, for example to switch
 * an RS-485 driver off. It is called before the port's own hook. See mbm_node_idle.
 *
 * @param callback  the callback, which obeys the rules of mbm_port; NULL for none
 * @return a status; see mbm_node_idle
 */
uint8_t mbm_node_postTransmission(mbm_node *node, void (*callback)(void));

/**
 * Function 01: reads coils into the response words, 16 in each word. The first coil is the
 * lowest bit; the last word is padded with zeros (V1.1b3, 6.1).
 *
 * All functions that make a request behave as follows. In blocking mode they return when
 * the request has ended. In non-blocking mode they return MBM_PENDING at once, and you call
 * mbm_node_poll until the request has ended.
 *
 * They empty the queue of mbm_node_send, and mbm_node_receive starts again at the first
 * word, unless they return MBM_BUSY, MBM_NOT_INITIALISED or MBM_INVALID_ARGUMENT. The
 * response words change only on success. The transmit words do not change, except that 06
 * and 16 store their arguments there.
 *
 * The master does not send a request that no device could accept, with a quantity that the
 * standard forbids or addresses beyond 65535. The status is then the exception with which a
 * device would answer.
 *
 * @param address   the first coil, 0 to 65535, as on the wire
 * @param quantity  the number of coils, 1 to 2000
 * @return a status; MBM_PENDING in non-blocking mode; an exception of the device (0x01 to
 *         0x7F); MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC, MBM_MALFORMED_REPLY,
 *         MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST, MBM_LINE_BUSY,
 *         MBM_BUFFER_TOO_SMALL, MBM_BROADCAST_NOT_ALLOWED or MBM_CANCELLED; MBM_BUSY while a
 *         request is pending on the line; MBM_NOT_INITIALISED if the line has no port or no
 *         frame buffer
 */
uint8_t mbm_node_readCoils(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 02: reads discrete inputs into the response words, 16 in each word. The first
 * input is the lowest bit; the last word is padded with zeros (V1.1b3, 6.2).
 *
 * @param address   the first input, 0 to 65535, as on the wire
 * @param quantity  the number of inputs, 1 to 2000
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readDiscreteInputs(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 03: reads holding registers into the response words (V1.1b3, 6.3).
 *
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readHoldingRegisters(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 04: reads input registers into the response words (V1.1b3, 6.4).
 *
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readInputRegisters(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 05: switches one coil on or off (V1.1b3, 6.5). With unit 0 it is a broadcast.
 *
 * @param address  the coil, 0 to 65535; becomes the write address
 * @param state    0 is off, any other value is on
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeSingleCoil(mbm_node *node, uint16_t address, uint8_t state);

/**
 * Function 06: writes one register (V1.1b3, 6.6). With unit 0 it is a broadcast.
 *
 * @param address  the register, 0 to 65535; becomes the write address
 * @param value    its value; also becomes transmit word 0
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeSingleRegister(mbm_node *node, uint16_t address, uint16_t value);

/**
 * Function 0F: writes coils from the transmit words, starting at word 0. The first coil is
 * the lowest bit (V1.1b3, 6.11). With unit 0 it is a broadcast.
 *
 * @param address   the first coil, 0 to 65535; becomes the write address
 * @param quantity  the number of coils, 1 to 1968, and not more than the transmit words hold
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeMultipleCoils(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 0F: writes the queued bits to coils, starting at the last write address. Call
 * mbm_node_beginTransmission and mbm_node_sendBit before.
 *
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeQueuedCoils(mbm_node *node);

/**
 * Function 10: writes registers from the transmit words, starting at word 0 (V1.1b3, 6.12).
 * With unit 0 it is a broadcast.
 *
 * @param address   the first register, 0 to 65535; becomes the write address
 * @param quantity  the number of registers, 1 to 123, and not more than the transmit words
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeMultipleRegisters(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 10: writes the queued complete words to registers, starting at the last write
 * address. Call mbm_node_beginTransmission and mbm_node_send before.
 *
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeQueuedRegisters(mbm_node *node);

/**
 * Function 16: the device sets a register to
 * (register AND andMask) OR (orMask AND NOT andMask) (V1.1b3, 6.16).
 * With unit 0 it is a broadcast.
 *
 * @param address  the register, 0 to 65535; becomes the write address
 * @param andMask  1 for each bit of the register to keep; also becomes transmit word 0
 * @param orMask   the new value of the bits that are not kept; also becomes transmit word 1
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_maskWriteRegister(mbm_node *node, uint16_t address, uint16_t andMask,
                                   uint16_t orMask);

/**
 * Function 17: the device writes the transmit words to registers first. Then it reads
 * registers, which arrive in the response words. Both in one request (V1.1b3, 6.17).
 *
 * @param readAddress    the first register to read, 0 to 65535
 * @param readQuantity   the number of registers to read, 1 to 125
 * @param writeAddress   the first register to write, 0 to 65535; becomes the write address
 * @param writeQuantity  the number of registers to write, 1 to 121, and not more than the
 *                       transmit words
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readWriteMultipleRegisters(mbm_node *node, uint16_t readAddress,
                                            uint16_t readQuantity, uint16_t writeAddress,
                                            uint16_t writeQuantity);

/**
 * Function 17: as mbm_node_readWriteMultipleRegisters, but writes the queued complete
 * words, starting at the last write address.
 *
 * @param readAddress   the first register to read, 0 to 65535
 * @param readQuantity  the number of registers to read, 1 to 125
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readWriteQueuedRegisters(mbm_node *node, uint16_t readAddress,
                                          uint16_t readQuantity);

/**
 * Reads holding registers into the response words. mbm_node_receive then returns them one after
 * the other.
 *
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return the number of words that mbm_node_receive will return; 0 if the request failed, as
 *         mbm_node_status says, if another request is pending, and in non-blocking mode
 */
uint8_t mbm_node_requestFrom(mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Sets the unit to which the master sends later requests.
 *
 * @param unit  the unit identifier, 1 to 247; 0 is broadcast. The master also sends to 248 to
 *              255, which the standard reserves
 */
uint8_t mbm_node_setSlaveID(mbm_node *node, uint8_t unit);

/**
 * Returns the unit to which the master sends requests.
 *
 * @return the unit identifier, 1 by default; 0 for an object that was never begun
 */
uint8_t mbm_node_getSlaveID(const mbm_node *node);

/**
 * Sets the response timeout: the maximum time from the last bit of the request to the last
 * byte of the reply.
 *
 * @param timeoutMs  milliseconds, 0 to 1000000 (16 minutes); the default is 2000
 */
uint8_t mbm_node_setResponseTimeout(mbm_node *node, uint32_t timeoutMs);

/**
 * Switches between blocking and non-blocking mode. In blocking mode, the default, a function
 * that makes a request returns when the request has ended. In non-blocking mode it returns
 * MBM_PENDING at once, and you call mbm_node_poll until the request has ended.
 *
 * @param on  1 blocking, 0 non-blocking; it applies from the next request on
 */
uint8_t mbm_node_setBlocking(mbm_node *node, uint8_t on);

/**
 * Accepts replies of devices that deviate from the standard. It has these effects:
 * - The master accepts a reply with the right unit, function and CRC although it repeats
 *   another address, value or quantity, or carries more or fewer data than were requested.
 *   It accepts such a reply at the end of the response timeout, if no right reply has
 *   arrived. mbm_node_available returns the number of words that arrived.
 * - A read of more words than the response words hold succeeds and fills all of them.
 *   (If the reply is longer than the frame buffer, no noise may have arrived before it.)
 * - The master also sends requests that read to unit 0, and accepts a reply from unit 0.
 *
 * Set a short response timeout (mbm_node_setResponseTimeout) if the device deviates in
 * every reply.
 *
 * @param on  0 (the default) or 1
 * @return a status; MBM_BUSY while a request is pending
 */
uint8_t mbm_node_setLenient(mbm_node *node, uint8_t on);

/**
 * Returns a response word: one that the last successful read stored, or an older one after it.
 *
 * @param index  0 to 255
 * @return the word; 0xFFFF if `index` is past the last response word
 */
uint16_t mbm_node_getResponseBuffer(const mbm_node *node, uint8_t index);

/** Sets every response word to 0. The position of mbm_node_receive does not change. */
uint8_t mbm_node_clearResponseBuffer(mbm_node *node);

/**
 * Sets a transmit word, for the functions that write. The queue of mbm_node_send does not
 * change.
 *
 * @param index  0 to the number of transmit words minus 1
 * @param value  the word
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if `index` is past the last transmit word
 */
uint8_t mbm_node_setTransmitBuffer(mbm_node *node, uint8_t index, uint16_t value);

/** Sets every transmit word to 0. The queue of mbm_node_send keeps its length. */
uint8_t mbm_node_clearTransmitBuffer(mbm_node *node);

/**
 * Queues a word after the words queued before. If the last word holds queued bits, the new
 * word goes into the next one.
 *
 * @param word  the word
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full
 */
uint8_t mbm_node_send(mbm_node *node, uint16_t word);

/**
 * Queues a byte as a word whose high byte is 0; see mbm_node_send.
 *
 * @param byte  0 to 255
 * @return a status; see mbm_node_send
 */
uint8_t mbm_node_send8(mbm_node *node, uint8_t byte);

/**
 * Queues the two words of a number of 32 bits, the low word first; see mbm_node_send.
 *
 * @param value  the number, 0 to 4294967295
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if two words do not fit
 */
uint8_t mbm_node_send32(mbm_node *node, uint32_t value);

/**
 * Queues a bit after the bits queued before, starting at the lowest bit of a word.
 *
 * @param on  0 is off, any other value is on
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full
 */
uint8_t mbm_node_sendBit(mbm_node *node, uint8_t on);

/**
 * Returns how many words of the last successful read mbm_node_receive has not returned yet.
 *
 * @return 0 to 125
 */
uint8_t mbm_node_available(const mbm_node *node);

/**
 * Returns the next word of the last successful read.
 *
 * @return the word; 0xFFFF if no word is left
 */
uint16_t mbm_node_receive(mbm_node *node);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_MASTER_H */
