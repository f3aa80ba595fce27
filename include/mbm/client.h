/**
 * @file mbm/client.h
 * @brief The client: many requests, every framing, never waits.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_CLIENT_H
#define MBM_CLIENT_H

#include "packets.h"

#ifdef __cplusplus
extern "C" {
#endif

struct mbm_line;

/* ==== Client: many requests, every framing, never waits ============================= */

/** The maximum number of requests that are pending in one client. */
#define MBM_CLIENT_DEPTH 16
/** `retryLimit` of mbm_clientRequest and mbm_clientUnit: no repetitions. */
#define MBM_NO_RETRIES 255u
/** mbm_client_setBackoff: the client repeats a request at once. */
#define MBM_BACKOFF_NONE 0u
/** mbm_client_setBackoff: the client waits `delayMs` before each repetition. */
#define MBM_BACKOFF_FIXED 1u
/** mbm_client_setBackoff: the client waits `delayMs` before the first repetition, twice that
 *  before the second, three times that before the third, but at most `maxDelayMs`. */
#define MBM_BACKOFF_LINEAR 2u
/** mbm_client_setBackoff: the client waits `delayMs` before the first repetition, twice that
 *  before the second, four times that before the third, but at most `maxDelayMs`. */
#define MBM_BACKOFF_EXPONENTIAL 3u
/** mbm_client_setAccept: a response of another unit than that of its request is accepted. */
#define MBM_ACCEPT_UNIT 1u
/** mbm_client_setAccept: a response with another transaction identifier than that of its
 *  request is accepted. */
#define MBM_ACCEPT_TRANSACTION 2u

/**
 * A client of one serial line or one TCP stream. It queues up to 16 requests.
 * mbm_client_poll sends and receives; no function ever waits.
 *
 * You own the storage. Initialise it with MBM_INIT. Call one of the mbm_client_begin
 * functions first. Use an object from one thread only, and never from an interrupt. Several
 * objects are independent of each other.
 *
 * The `done` function of a request may call every function on the client that calls it,
 * except mbm_client_poll, which then returns MBM_BUSY. A hook of the port, and the `random`
 * function of mbm_client_setJitter, must not use the client: each function returns MBM_BUSY
 * and changes nothing, and a getter returns its value for an object that was never begun.
 */
typedef struct mbm_client {
    void *pointers[63]; /**< Private. */
    uint32_t words[22]; /**< Private. */
} mbm_client;

/**
 * A request to a device, and its result. You own the storage. Initialise it with MBM_INIT,
 * then set the fields that you need. You may use it for any number of requests.
 *
 * Do not use or change it, or the memory that it points to, from the call that queues it until
 * it has ended. It has ended when `done` is called, or when `status` is no longer MBM_PENDING.
 *
 * If a function transfers registers, `data` and `reply` are words in the machine's byte
 * order. If it transfers coils or bytes, they are bytes as on the wire; the first coil is
 * the lowest bit.
 */
typedef struct mbm_clientRequest {
    /** Optional: mbm_client_poll calls it when the request has ended, but not after
     *  mbm_client_cancel or a begin function gave the request up. It may queue requests, also
     *  this one, and cancel others. */
    void (*done)(void *context, struct mbm_clientRequest *request);
    /** Your pointer, passed to `done`; may be NULL. */
    void *context;
    /** The data that functions that write send. */
    const void *data;
    /** Receives the data that functions that read return; NULL if you want the status only. */
    void *reply;
    /** The number of bytes that `reply` can hold. */
    uint16_t replyBytes;
    /** A number of your choice, which the client does not change. In TCP frames no two
     *  pending requests may have the same one, except 0. It is not the transaction identifier
     *  on the wire: mbm_client_wireTransaction returns that. */
    uint16_t transaction;
    /** The unit identifier of the device. On a serial line 1 to 247; 0 is broadcast; the
     *  client also sends to 248 to 255, which the standard reserves. In TCP frames 0 to 255:
     *  there unit 0 is a unit and answers. A client refuses a greater number
     *  (MBM_INVALID_ARGUMENT). */
    uint16_t unit;
    /** MBM_PENDING from the call that queues the request until it ends; then its result. */
    uint8_t status;
    /** The exception code of the response as received; 0 if the response was no exception. */
    uint8_t exception;
    /** The response timeout of this request in milliseconds, 1 to 1000000 (16 minutes); 0: that
     *  of the unit (mbm_clientUnit) or of the client (mbm_client_setResponseTimeout). A client
     *  refuses a greater number (MBM_INVALID_ARGUMENT). */
    uint32_t timeoutMs;
    /** The number of bytes received into `reply`. */
    uint8_t length;
    /** How often the client repeats this request at most, 1 to 254; MBM_NO_RETRIES: never; 0:
     *  as often as the unit or mbm_client_setRetries says. With 1 to 254, a client refuses the
     *  request (MBM_INVALID_ARGUMENT) if none of mbm_client_setRetries,
     *  mbm_client_setBusyRetries and mbm_client_setUnits was called on it: only they link the
     *  code for repetitions. */
    uint8_t retryLimit;
    uint8_t bytes[6]; /**< Private. */
    uint32_t words[7]; /**< Private. */
} mbm_clientRequest;

/**
 * Reads the objects that identify a device (function 2B/0E, V1.1b3, 6.21), with as many
 * requests as the device needs. You own the storage. Initialise it with MBM_INIT, set `unit`,
 * `reply` and `replyBytes` of `request`, and `object`, and pass it to
 * mbm_identification_read. You may use it for any number of devices.
 *
 * From that call until `request.status` is no longer MBM_PENDING, do not change it or the
 * memory that it points to. To give it up, pass `request` to mbm_client_cancel.
 */
typedef struct mbm_identification {
    /** The request for one part of the objects. Set its `unit`. Its `reply` receives one
     *  reply after the other, as mbm_client_readDeviceIdentification says: 250 bytes hold
     *  any, `replyBytes` is their number. On a TCP client you may set `transaction`.
     *  mbm_identification_read sets `done`, `context` and `data`.
     *
     *  Its `status` is that of the identification: MBM_PENDING while objects are missing;
     *  MBM_OK when `object` was called for all; MBM_NO_PROGRESS if the device repeats itself;
     *  MBM_MALFORMED_REPLY also for a reply whose objects are not whole, and for one with
     *  another object than the one that was requested alone; otherwise as for
     *  mbm_client_readCoils. Objects that were handed out before a failure are sound. */
    mbm_clientRequest request;
    /** Optional: mbm_client_poll calls it for each object. `object` and its data are valid
     *  during the call. It may call what `done` of a request may call: it may queue
     *  requests, and cancel, also this one, which ends the calls. */
    void (*object)(void *context, const mbm_object *object);
    /** Optional: mbm_client_poll calls it when the identification has ended, as it calls
     *  `done` of a request. It may read the next identification with the same storage. */
    void (*done)(void *context, struct mbm_identification *identification);
    /** Your pointer, passed to both; may be NULL. */
    void *context;
    mbm_client *client; /**< Private. */
    /** How many objects `object` was called for, or would have been. */
    uint16_t count;
    /** The conformity level in the last reply, by the standard 01 to 03 or 81 to 83 (hex). It
     *  is not checked: some devices send a wrong one, and reading does not depend on it. */
    uint8_t conformity;
    uint8_t handingOut; /**< Private. */
    uint16_t stream[2]; /**< Private. */
} mbm_identification;

/**
 * Your hooks that close a link and open it again, for mbm_link_begin and
 * mbm_client_reconnect.
 */
typedef struct mbm_linkHooks {
    /** Your pointer, passed to all hooks; may be NULL. */
    void *context;
    /** Optional: closes the link, if it is open. */
    void (*disconnect)(void *context);
    /** Optional for mbm_client_reconnect: opens the link without waiting. Returns MBM_OK if the
     *  link is open, MBM_PENDING if the connection is still being made and the port accepts no
     *  bytes yet, or another status. */
    uint8_t (*connect)(void *context);
    /** For mbm_link_begin only; optional if `connect` never returns MBM_PENDING. Returns MBM_OK
     *  if the link is open, MBM_PENDING while the connection is still being made, or another
     *  status. */
    uint8_t (*status)(void *context);
} mbm_linkHooks;

/**
 * The record of one unit, an item of the array for mbm_client_setUnits. You may read and
 * zero the counters at any time, but not from an interrupt; each wraps at 2^32.
 */
typedef struct mbm_clientUnit {
    /** Requests that ended, without retries. */
    uint32_t requests;
    /** Requests that the unit answered, also with an exception. */
    uint32_t replies;
    /** Requests that the unit answered with an exception. */
    uint32_t exceptions;
    /** Repetitions of requests. */
    uint32_t retries;
    /** Set by you: the minimum time from the end of a request to the next request to this
     *  unit, in microseconds; a value above 2^31 (36 minutes) means 2^31. */
    uint32_t delayUs;
    uint32_t lastUs; /**< Private. */
    /** Set by you: the response timeout of this unit in milliseconds, 1 to 1000000 (16
     *  minutes); 0: that of mbm_client_setResponseTimeout. mbm_client_setUnits refuses a
     *  greater number. If you set it later, it means 1000000. */
    uint32_t timeoutMs;
    /** Set by you: the unit identifier, 0 to 255. mbm_client_setUnits refuses a greater number.
     *  If you set it later, the record is of no unit. */
    uint16_t unit;
    /** The status of the last request that ended; MBM_OK if none has ended. */
    uint8_t status;
    uint8_t cooling_down; /**< Private. */
    /** Set by you: how often the client repeats a request to this unit at most, 1 to 254;
     *  MBM_NO_RETRIES: never; 0: as often as mbm_client_setRetries says. */
    uint8_t retryLimit;
} mbm_clientUnit;

/**
 * Begins a client of a serial line with RTU frames (serial line guide V1.02, 2.5.1).
 *
 * This and the other mbm_client_begin functions may be called again at any time, also with
 * another framing. Then the client gives up all pending requests as mbm_client_cancel does:
 * their status is MBM_CANCELLED and `done` is not called. All settings return to their
 * defaults. A call that is refused changes nothing.
 *
 * @param port        the port, which is copied; read, write and micros must not be NULL
 * @param frame       the buffer of one frame, valid for as long as the client is used
 * @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_client_beginRtu(mbm_client *client, const mbm_port *port, uint8_t *frame,
                            uint16_t frameBytes);

/**
 * Begins a client of a serial line with ASCII frames (serial line guide V1.02, 2.5.2). It
 * keeps no gap between frames. If no character arrives for one second, the client discards
 * an incomplete frame.
 *
 * @param frameBytes  bytes of `frame`, at least 17; 513 hold any frame
 * @return as mbm_client_beginRtu
 */
uint8_t mbm_client_beginAscii(mbm_client *client, const mbm_port *port, uint8_t *frame,
                              uint16_t frameBytes);

/**
 * Begins a client that sends RTU frames through a TCP stream, for converters that pass
 * bytes from TCP to a serial line unchanged. It keeps no gap and does not broadcast.
 *
 * @return as mbm_client_beginRtu
 */
uint8_t mbm_client_beginRtuOverTcp(mbm_client *client, const mbm_port *port, uint8_t *frame,
                                   uint16_t frameBytes);

/**
 * Begins a client of a TCP stream with frames that have the MBAP header (messaging on
 * TCP/IP guide V1.0b, 3.1.3). One request is in flight at a time, unless mbm_client_setInFlight
 * allows more. The client matches responses to requests by the transaction identifier, in any
 * order.
 *
 * @param incoming       the buffer of received bytes, valid for as long as the client is used
 * @param incomingBytes  bytes of `incoming`, at least 9; 260 hold any frame. A larger buffer takes
 *                       more responses from one read
 * @param outgoing       the buffer of bytes to send, valid for as long as the client is used
 * @param outgoingBytes  bytes of `outgoing`, at least 12; 260 hold any frame. A larger buffer
 *                       collects more requests for one write
 * @return as mbm_client_beginRtu
 */
uint8_t mbm_client_beginTcp(mbm_client *client, const mbm_port *port, uint8_t *incoming,
                            uint16_t incomingBytes, uint8_t *outgoing, uint16_t outgoingBytes);

/**
 * Sets the character that ends ASCII frames after CR, instead of LF, in both
 * directions. Use it for devices that were set to another character by function 08 with
 * sub-function 03 (V1.1b3, 6.8.1). A device still ends its response to that request with
 * the old character: call this function when the request has ended, for example in its
 * `done`.
 *
 * @param client     the object, begun with mbm_client_beginAscii
 * @param character  1 to 127, except CR, the colon and hexadecimal digits
 * @return a status; MBM_BUSY while a request is in flight
 */
uint8_t mbm_client_setDelimiter(mbm_client *client, uint8_t character);

/**
 * Sets how many requests may be in flight at once on TCP. More are faster, if the server accepts
 * them (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 1 to 16). Many take
 * one at a time: they drop a request that arrives before they have answered the last one, or
 * in one segment with another. The queue always holds 16.
 *
 * @param most  1 (the default) to 16. On a serial line and in RTU over TCP only 1 is accepted, as
 *              with mbm_client_setMessageWait and MBM_ACCEPT_TRANSACTION
 */
uint8_t mbm_client_setInFlight(mbm_client *client, uint8_t most);

/**
 * Begins to read the objects of a device.
 *
 * `done` of a request, and `object` and `done` of another identification, may call it.
 *
 * @param identification  the storage, with unit, reply buffer and callbacks set
 * @param client          the client that sends the requests; it must stay valid until the
 *                        identification has ended
 * @param code            MBM_DEVICE_ID_BASIC, MBM_DEVICE_ID_REGULAR or MBM_DEVICE_ID_EXTENDED:
 *                        all objects of the category; a device that has fewer sends those that
 *                        it has. MBM_DEVICE_ID_INDIVIDUAL: one
 * @param object          the id of the first object, 0 for all, or of the only one. A device
 *                        that does not have the first object begins with its first one
 * @return MBM_PENDING if the first request is queued. Otherwise nothing has changed: MBM_BUSY
 *         if the identification is pending, and from within its `object`;
 *         MBM_ILLEGAL_DATA_VALUE for another `code`; MBM_INVALID_ARGUMENT if `request.reply` is
 *         NULL; or another status of mbm_client_readCoils
 */
uint8_t mbm_identification_read(mbm_identification *identification, mbm_client *client,
                                uint8_t code, uint8_t object);

/**
 * Closes the link and opens it again. The client discards an incomplete response. Requests
 * in flight end with MBM_LINK_LOST at the next calls of mbm_client_poll. Requests
 * that were not sent yet are sent over the new link.
 *
 * @param link  your hooks, used during this call only; NULL if you have opened the link again
 *              already
 * @return what `connect` returns, or MBM_OK without `connect`; MBM_BUSY while the client is
 *         suspended
 */
uint8_t mbm_client_reconnect(mbm_client *client, const mbm_linkHooks *link);

/**
 * Returns whether the link works, as far as the client knows.
 *
 * If `connect` of mbm_client_reconnect returned MBM_PENDING, this function returns 0 until
 * a reply arrives. Do not reconnect again while the connection is still being made. The
 * port knows whether it is: for example, call mbm_tcp_isConnected.
 *
 * @return 0 after a request ended with MBM_LINK_LOST, until a reply or an exception arrives or
 *         mbm_client_reconnect returns MBM_OK; otherwise 1, also before the first request. With a
 *         link: 0 from each loss of it until it is open again
 */
uint8_t mbm_client_isConnected(const mbm_client *client);

/**
 * Suspends the client, so that a line can use its port. The client's requests wait until
 * mbm_client_resume. Until then the line uses the client's storage, and the client remembers
 * the line: keep both.
 *
 * @param client  the object. If `line` is not NULL, it must use RTU or RTU over TCP
 * @param line    a line, which then uses the client's port; NULL if you use the wire in another
 *                way
 * @return a status; MBM_BUSY if a request is in flight or the client is suspended already
 */
uint8_t mbm_client_suspend(mbm_client *client, struct mbm_line *line);

/**
 * Resumes the client. The line then has no port: requests of its nodes return
 * MBM_NOT_INITIALISED. A line that was begun on another port meanwhile keeps that port.
 *
 * @param line  the line that was passed to mbm_client_suspend; NULL if none was
 * @return a status; MBM_BUSY while a request of the line is pending; MBM_INVALID_ARGUMENT if the
 *         client was not suspended, and for any other line
 */
uint8_t mbm_client_resume(mbm_client *client, struct mbm_line *line);

/**
 * Sends and receives for all requests, without waiting, and calls `done` of those that have
 * ended, of at most 17 in one call. It also takes care of the client's link, if
 * mbm_link_begin gave it one.
 *
 * Call it as often as you like. mbm_client_pollDelay returns when the next call is due.
 *
 * @return MBM_PENDING while requests are pending; MBM_OK if none is; MBM_BUSY also from within
 *         `done`, and while the client is suspended
 */
uint8_t mbm_client_poll(mbm_client *client);

/**
 * Returns how long mbm_client_poll will have nothing to do unless a byte arrives. A program
 * may sleep, or wait for a byte in select, for that time, but no longer: while a frame leaves on a
 * serial line, the driver would go off late. The client reads bytes only while
 * a request is pending, or if it has a link (mbm_link_begin). With a link the delay also ends
 * when the link is to be opened again, and is at most one second while the client is idle.
 *
 * @return microseconds; 0 means poll now, also from within a hook of the port; 0xFFFFFFFF means
 *         that no request is pending. While a TCP port accepts no bytes to send it is 1000: to
 *         poll sooner, also wait until the port accepts bytes, as mbm_tcp_wait does
 */
uint32_t mbm_client_pollDelay(mbm_client *client);

/**
 * Returns how many requests are pending: queued or in flight.
 *
 * @return 0 to 16
 */
uint8_t mbm_client_pending(const mbm_client *client);

/**
 * Cancels a request. Its status becomes MBM_CANCELLED, `done` is not called, and you may use
 * the request again at once. The device may have received the request, and may still send
 * a reply. So on a serial line the next request to its unit is sent when that reply has come,
 * at the latest two response timeouts and the quiet time after the cancelled one was sent.
 * Requests to other units are sent meanwhile.
 *
 * @param request  a request that was queued on this client
 * @return a status; MBM_NOT_PENDING for a request that has ended already or was never queued here
 */
uint8_t mbm_client_cancel(mbm_client *client, mbm_clientRequest *request);

/**
 * Returns the transaction identifier on the wire: that of the TCP frame in which the client
 * sent the request last. The client chooses a new one for each frame, also for a retry.
 *
 * @param request  a request, pending or ended
 * @return the identifier; 0 in other framings, for a request that was never sent, and for NULL.
 *         0 may also be the identifier of a frame
 */
uint16_t mbm_client_wireTransaction(const mbm_clientRequest *request);

/**
 * Sets how often the client repeats a request whose response is missing, damaged or
 * malformed, or that the port did not accept. It does not repeat a request that was
 * answered with an exception (but see mbm_client_setBusyRetries), one that a lost link
 * interrupted, or one whose response is too long for a buffer. `retryLimit` of a request or
 * of a unit replaces this number.
 *
 * @param retries  0 to 255; the default is 0
 */
uint8_t mbm_client_setRetries(mbm_client *client, uint8_t retries);

/**
 * Makes the client repeat a request that a busy device refuses (V1.1b3, 7): any request that
 * the device answers with exception 06 (SERVER DEVICE BUSY), and a request that only reads
 * that it answers with exception 05 (ACKNOWLEDGE). Without this setting both are the result of
 * the request, as every exception is.
 *
 * After exception 06 the device has not carried out the request, so the client repeats any
 * request. After exception 05 the device is carrying out the request, so a repetition would
 * let it do the work again: the client repeats only functions 01 to 04, 07, 0B, 0C, 11, 14
 * and 18, and 2B with MEI type 0E. A request that writes ends with the status 5; ask the
 * device in your own way when the work is done.
 *
 * These repetitions are counted apart from those of mbm_client_setRetries. Meanwhile the
 * client sends other requests, also to this unit.
 *
 * @param retries  the most repetitions of one request for this reason, 0 (the default) to 255; the
 *                 request then ends with the status 5 or 6
 * @param waitMs   the wait before each repetition in milliseconds, 0 to 65535
 */
uint8_t mbm_client_setBusyRetries(mbm_client *client, uint8_t retries, uint32_t waitMs);

/**
 * Sets how long a request waits before the client repeats it. Meanwhile the client sends
 * other requests.
 *
 * @param backoff     MBM_BACKOFF_NONE (the default) to MBM_BACKOFF_EXPONENTIAL
 * @param delayMs     the wait before the first repetition, in milliseconds, 0 to 1000000
 * @param maxDelayMs  the longest wait, in milliseconds, 0 to 1000000
 */
uint8_t mbm_client_setBackoff(mbm_client *client, uint8_t backoff, uint32_t delayMs,
                              uint32_t maxDelayMs);

/**
 * Shortens each wait before a repetition by a random part, so that several clients do not
 * repeat their requests at the same time.
 *
 * @param percent  0 (the default) to 100: the largest part of the wait by which the client
 *                 shortens it
 * @param random   returns a new random number at each call, for example that of rand(). It may
 *                 have 32 bits, 15 bits, or random bits in its upper half only. A function that it
 *                 calls on the client returns MBM_BUSY. NULL only if `percent` is 0
 * @param context  your pointer, passed to `random`; may be NULL
 */
uint8_t mbm_client_setJitter(mbm_client *client, uint8_t percent, uint32_t (*random)(void *context),
                             void *context);

/**
 * Returns the reply of a request that has ended as a packet, whose fields have names:
 * commStatus and eventCount of function 0B, moreFollows of 2B/0E and so on. mbm_packet lists
 * the fields of each function. The packet is the one that mbm_frame_parse makes of the
 * reply's frame. Read file records with mbm_packet_nextRecord, objects of a device
 * identification with mbm_packet_nextObject.
 *
 * Three differences from the frame: the unused bits of the last byte of functions 01 and 02
 * are 0. The byteCount of function 11 is dataLength, because the client does not keep the
 * count of a device that counts only a part of the data. The frame of mbm_client_forward has
 * both as the device sent them. The response to function 15 repeats the request, and is made
 * of the request's `data`: they must not have changed since.
 *
 * It reads `request` and what its `reply` and `data` point to, and changes none of them.
 * `done` of the request may call it. Any thread or interrupt may call it for a request that
 * has ended.
 *
 * @param request   a request that has ended
 * @param pdu       receives the PDU of the reply, to which the packet's data point; it must not
 *                  overlap `reply` and `data` of the request
 * @param capacity  bytes of `pdu`; MBM_MAX_PDU hold any reply
 * @param packet    receives the packet, with the unit of the request, and in TCP frames the
 *                  transaction identifier of the reply; it changes only for MBM_OK
 * @return MBM_OK, also for an exception, whose kind is MBM_PACKET_EXCEPTION; MBM_PENDING if the
 *         request has not ended; the request's status if it ended without a reply, or was not
 *         queued; MBM_BUFFER_TOO_SMALL if the reply's data did not fit into `reply`, if `reply`
 *         is NULL, or if `capacity` is too small; MBM_MALFORMED_REPLY if the data are not those
 *         of a reply of the function, although the client accepted them: it does not look into
 *         an event log or a device identification; MBM_INVALID_ARGUMENT for overlapping memory,
 *         a request that was never queued, one that no device answers: a broadcast, or
 *         sub-function 04 of 08, and a write to unit 0 in TCP frames
 */
uint8_t mbm_client_reply(const mbm_clientRequest *request, uint8_t *pdu, uint16_t capacity,
                         mbm_packet *packet);

/**
 * Function 01: reads coils into the bytes of `reply`, eight in each byte. The first coil is
 * the lowest bit; the last byte is padded with zeros (V1.1b3, 6.1).
 *
 * This and the other functions that make a request queue the request and return. The
 * request has ended when its `status` is no longer MBM_PENDING. Then `status` is MBM_OK, an
 * exception of the device (0x01 to 0x7F), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
 * MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST,
 * MBM_LINE_BUSY, MBM_CONNECT_TIMED_OUT, MBM_BUFFER_TOO_SMALL or MBM_CANCELLED. `reply` changes
 * only if it is MBM_OK.
 *
 * @param address   the first coil, 0 to 65535, as on the wire
 * @param quantity  the number of coils, 1 to 2000
 * @return MBM_PENDING if the request is queued. Otherwise nothing was queued, and the
 *         request's `status` is the same: MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS
 *         for a request that no device could accept, MBM_BROADCAST_NOT_ALLOWED,
 *         MBM_QUEUE_FULL, MBM_DUPLICATE_TRANSACTION, MBM_BUFFER_TOO_SMALL if `reply` cannot
 *         hold the data, MBM_INVALID_ARGUMENT if `data` is NULL. With the request unchanged:
 *         MBM_BUSY also if the request is pending already
 */
uint8_t mbm_client_readCoils(mbm_client *client, mbm_clientRequest *request, uint16_t address,
                             uint16_t quantity);

/**
 * Function 02: reads discrete inputs into the bytes of `reply`, as mbm_client_readCoils
 * does (V1.1b3, 6.2).
 *
 * @param address   the first input, 0 to 65535, as on the wire
 * @param quantity  the number of inputs, 1 to 2000
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readDiscreteInputs(mbm_client *client, mbm_clientRequest *request,
                                      uint16_t address, uint16_t quantity);

/**
 * Function 03: reads holding registers into the words of `reply` (V1.1b3, 6.3).
 *
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readHoldingRegisters(mbm_client *client, mbm_clientRequest *request,
                                        uint16_t address, uint16_t quantity);

/**
 * Function 04: reads input registers into the words of `reply` (V1.1b3, 6.4).
 *
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readInputRegisters(mbm_client *client, mbm_clientRequest *request,
                                      uint16_t address, uint16_t quantity);

/**
 * Function 05: switches one coil on or off (V1.1b3, 6.5).
 *
 * @param address  the coil, 0 to 65535, as on the wire
 * @param on       0 is off, any other value is on
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeSingleCoil(mbm_client *client, mbm_clientRequest *request, uint16_t address,
                                   uint8_t on);

/**
 * Function 06: writes one holding register (V1.1b3, 6.6).
 *
 * @param address  the register, 0 to 65535, as on the wire
 * @param value    its new value
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeSingleRegister(mbm_client *client, mbm_clientRequest *request,
                                       uint16_t address, uint16_t value);

/**
 * Function 0F: writes coils from the bytes of `data`, eight in each byte. The first coil is
 * the lowest bit (V1.1b3, 6.11).
 *
 * @param address   the first coil, 0 to 65535, as on the wire
 * @param quantity  the number of coils, 1 to 1968
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeMultipleCoils(mbm_client *client, mbm_clientRequest *request,
                                      uint16_t address, uint16_t quantity);

/**
 * Function 10: writes the words of `data` to holding registers (V1.1b3, 6.12).
 *
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 123
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeMultipleRegisters(mbm_client *client, mbm_clientRequest *request,
                                          uint16_t address, uint16_t quantity);

/**
 * Function 16: sets a holding register to (register & andMask) | (orMask & ~andMask)
 * (V1.1b3, 6.16).
 *
 * @param address  the register, 0 to 65535, as on the wire
 * @param andMask  1 for each bit of the register to keep
 * @param orMask   the new value of the bits that are not kept
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_maskWriteRegister(mbm_client *client, mbm_clientRequest *request,
                                     uint16_t address, uint16_t andMask, uint16_t orMask);

/**
 * Function 17: the device writes the words of `data` to holding registers first. Then it
 * reads holding registers, which arrive in the words of `reply` (V1.1b3, 6.17).
 *
 * @param readAddress    the first register to read, 0 to 65535
 * @param readQuantity   the number of registers to read, 1 to 125
 * @param writeAddress   the first register to write, 0 to 65535
 * @param writeQuantity  the number of registers to write, 1 to 121
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readWriteMultipleRegisters(mbm_client *client, mbm_clientRequest *request,
                                              uint16_t readAddress, uint16_t readQuantity,
                                              uint16_t writeAddress, uint16_t writeQuantity);

/**
 * Function 07: reads the eight exception status outputs into one byte of `reply` (V1.1b3,
 * 6.7).
 *
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readExceptionStatus(mbm_client *client, mbm_clientRequest *request);

/**
 * Function 08: sends the words of `data`, and reads the same number of words into `reply`
 * (V1.1b3, 6.8). No device responds to sub-function 04, Force Listen Only Mode.
 *
 * @param subFunction  0 (Return Query Data) to 0x14. The client also sends the others, which
 *                     the standard reserves, and expects a response of one word; for a
 *                     response of another length use mbm_client_custom
 * @param words        the number of words of `data`: 1; for sub-function 0, 1 to 125
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_diagnostics(mbm_client *client, mbm_clientRequest *request, uint16_t subFunction,
                               uint16_t words);

/**
 * Function 0B: reads the status word and the event count into two words of `reply` (V1.1b3,
 * 6.9).
 *
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_getCommEventCounter(mbm_client *client, mbm_clientRequest *request);

/**
 * Function 0C: reads status, event count and message count, and then up to 64 events, into
 * the bytes of `reply`. The first three have two bytes each, the high byte first. An event
 * is one byte; the latest event is first (V1.1b3, 6.10).
 *
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_getCommEventLog(mbm_client *client, mbm_clientRequest *request);

/**
 * Function 11: reads the server id, whose format is specific to the device (V1.1b3, 6.13).
 * `reply` receives all bytes after the byte count. Some devices count only the id and send
 * more bytes: `reply` receives those too. In RTU frames silence ends such a reply. The
 * client does not wait for silence if the byte count is right.
 *
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_reportServerId(mbm_client *client, mbm_clientRequest *request);

/**
 * Function 14: reads consecutive records of one file into the words of `reply` (V1.1b3,
 * 6.14).
 *
 * @param file      the file number, 1 to 65535
 * @param record    the first record, 0 to 9999
 * @param quantity  the number of records, 1 to 121
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readFileRecord(mbm_client *client, mbm_clientRequest *request, uint16_t file,
                                  uint16_t record, uint16_t quantity);

/**
 * Function 15: writes the words of `data` to consecutive records of one file (V1.1b3,
 * 6.15).
 *
 * @param file      the file number, 1 to 65535
 * @param record    the first record, 0 to 9999
 * @param quantity  the number of records, 1 to 122
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeFileRecord(mbm_client *client, mbm_clientRequest *request, uint16_t file,
                                   uint16_t record, uint16_t quantity);

/**
 * Function 14 with several groups: reads records of several files, or of several ranges.
 * `data` contains the groups as on the wire, seven bytes each, as mbm_packet_addRecord
 * builds them. `reply` receives the sub-responses as on the wire: of each group its length
 * after this byte, the reference type 6, and the words, the high byte first (V1.1b3, 6.14).
 *
 * @param bytes  the number of bytes of `data`, 7 to 245, a multiple of 7
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readFileRecords(mbm_client *client, mbm_clientRequest *request, uint16_t bytes);

/**
 * Function 15 with several groups: writes records of several files, or of several ranges.
 * `data` contains the groups as on the wire, as mbm_packet_addRecord builds them (V1.1b3,
 * 6.15).
 *
 * @param bytes  the number of bytes of `data`, 9 to 251
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeFileRecords(mbm_client *client, mbm_clientRequest *request, uint16_t bytes);

/**
 * Function 18: reads up to 31 registers of a FIFO queue into the words of `reply` (V1.1b3,
 * 6.18).
 *
 * @param address  the FIFO pointer address of the queue, 0 to 65535
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readFifoQueue(mbm_client *client, mbm_clientRequest *request, uint16_t address);

/**
 * Function 2B/0E: reads objects that identify the device (V1.1b3, 6.21). `reply` receives,
 * as on the wire: the conformity level, more follows (0 or FF), the next object id, the
 * number of objects, and of each object its id, length and value.
 *
 * @param code    the read device id code, MBM_DEVICE_ID_BASIC to MBM_DEVICE_ID_INDIVIDUAL
 * @param object  the id of the first object to read
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readDeviceIdentification(mbm_client *client, mbm_clientRequest *request,
                                            uint8_t code, uint8_t object);

/**
 * Function 2B with any MEI type: sends the bytes of `data` after the MEI type, and reads the
 * bytes after the MEI type of the response into `reply` (V1.1b3, 6.19). On RTU, silence ends
 * the response.
 *
 * @param meiType  the MEI type, for example MBM_MEI_CANOPEN, 0 to 255
 * @param bytes    the number of bytes of `data`, 0 to 251
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_encapsulatedInterfaceTransport(mbm_client *client, mbm_clientRequest *request,
                                                  uint8_t meiType, uint16_t bytes);

/**
 * Any function code: sends the bytes of `data` after the function code, and reads the bytes
 * after the function code of the response into `reply`. There may be none: `length` is 0 then.
 * The length rule holds for every function code, also for one of the standard.
 *
 * @param function  the function code, 1 to 127
 * @param bytes     the number of bytes of `data`, 0 to 252
 * @param response  the length rule of the response; used during this call only
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_custom(mbm_client *client, mbm_clientRequest *request, uint8_t function,
                          uint16_t bytes, const mbm_rule *response);

/**
 * Forwards a request that arrived from another client: sends `function` and the bytes of
 * `body`, and reads into `reply` all bytes after the function code of the response, as on
 * the wire. Use it for a gateway: the functions of mbm_unit_serveCustom receive the same
 * `body` and return the same `reply`.
 *
 * The client accepts a response only if it matches the request, as for the other functions:
 * its length, byte count, echoed address, value, quantity and records must be right. The response
 * to a function code that the standard does not define may have no data. On RTU, silence ends it,
 * and the response to sub-functions of 08 from 0x15 on. If you know the length of the response, use
 * mbm_client_custom.
 *
 * No device responds to 08 with sub-function 04: the request ends with MBM_OK and `length` 0
 * after the turnaround delay.
 *
 * @param request   the request; if it is queued, its `data` then points into `body`
 * @param function  the function code, 1 to 127
 * @param body      the bytes after the function code; do not change them until the request has
 *                  ended; may be NULL if `bytes` is 0. For 14 and 15 it may be the records
 *                  alone, as mbm_packet_addRecord builds them: the client sends their byte
 *                  count before them
 * @param bytes     the number of bytes of `body`, 0 to 252
 * @return a status; see mbm_client_readCoils. Also those with which a server answers such a
 *         request: MBM_ILLEGAL_DATA_VALUE if the length or a count in `body` is wrong,
 *         MBM_ILLEGAL_FUNCTION if the function code is 0 or above 127
 */
uint8_t mbm_client_forward(mbm_client *client, mbm_clientRequest *request, uint8_t function,
                           const uint8_t *body, uint16_t bytes);

/**
 * Sets the response timeout. On a serial line and in RTU over TCP, the time starts when the
 * request has been sent. In TCP frames it starts when mbm_client_poll puts the request into
 * the outgoing buffer, also if the port accepts it later. `timeoutMs` of a request or of a
 * unit replaces this time.
 *
 * @param timeoutMs  milliseconds, 0 to 1000000 (16 minutes); the default is 2000
 */
uint8_t mbm_client_setResponseTimeout(mbm_client *client, uint32_t timeoutMs);

/**
 * Sets the baud rate from which the client computes the gap before an RTU request (t3.5,
 * serial line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure
 * the serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
 *
 * @param baud  bits per second; 0 (the default): unknown
 */
uint8_t mbm_client_setBaudRate(mbm_client *client, uint32_t baud);

/**
 * Sets the silence before a request, instead of t3.5. A later call of
 * mbm_client_setBaudRate sets it back to t3.5. It has no effect on TCP.
 *
 * @param gapUs  microseconds from the last byte received or sent; a value above 2^31 (36
 *               minutes) means 2^31
 */
uint8_t mbm_client_setGap(mbm_client *client, uint32_t gapUs);

/**
 * Sets the turnaround delay: how long the client waits after a request that no device
 * answers. These requests are a broadcast (serial line guide V1.02, 2.4.1), and 08 with
 * sub-function 04.
 *
 * @param delayMs  milliseconds, 0 to 65535; the default is 100
 */
uint8_t mbm_client_setTurnaroundDelay(mbm_client *client, uint32_t delayMs);

/**
 * Sets the quiet time of a serial line. It prevents that the client accepts a late reply as
 * the reply to a later request: see mbm_line_setQuietTime. It has no effect in TCP frames,
 * whose transaction identifier shows to which request a reply belongs.
 *
 * The client does not hold the reply to mbm_client_diagnostics with sub-function 0, which
 * repeats data of your choice. If no other request has the same data, no late reply can be
 * taken for it, and after its reply the next replies of that unit are not held either.
 *
 * @param quietMs  milliseconds, 0 to 65535; the default is 100; 0 holds no reply
 */
uint8_t mbm_client_setQuietTime(mbm_client *client, uint32_t quietMs);

/**
 * Switches echo discarding on or off. Switch it on if the receiver also receives the bytes
 * that the driver sends: then the client discards the copy of each request that arrives before
 * the reply. It has no effect on TCP.
 *
 * @param on  0 (the default) or 1
 */
uint8_t mbm_client_setEchoDiscard(mbm_client *client, uint8_t on);

/**
 * Sets how long the driver stays on after the port's flush, for platforms whose flush
 * returns before the last bit was sent. It has no effect on TCP.
 *
 * @param characters  the time in characters at the baud rate of mbm_client_setBaudRate
 *                    (without one, at 9600); the default is 0
 */
uint8_t mbm_client_setPostFlushHold(mbm_client *client, uint8_t characters);

/**
 * Sets your storage for counters, in which the client counts from now on. You may read and
 * zero the counters at any time, but not from an interrupt. In TCP frames, foreignFrames
 * counts frames whose transaction identifier and unit match no pending request, and
 * resynchronisations counts sequences of bytes that were not a frame.
 *
 * @param counters  your counters, initialised with MBM_INIT; NULL stops counting
 */
uint8_t mbm_client_setCounters(mbm_client *client, mbm_counters *counters);

/**
 * Sets which responses in TCP frames the client accepts although their header is not that of
 * the request: some devices answer with unit 0, 1 or 255 whatever unit was asked, some with
 * transaction identifier 0 or a count of their own. All else of the response must be right.
 *
 * With MBM_ACCEPT_TRANSACTION nothing tells a late response from the right one. So only one
 * request may be in flight, and after a request without an answer the client sends no other
 * one until the late response has come, or two response timeouts and the quiet time
 * (mbm_client_setQuietTime) after that request. Over a new connection the next one is sent at
 * once: mbm_link_setClose with MBM_LINK_CLOSE_AFTER_FAILURE makes one, after which no late
 * response comes, however late it is.
 *
 * @param accept  MBM_ACCEPT_UNIT, MBM_ACCEPT_TRANSACTION, both or 0 (the default)
 * @return a status; MBM_INVALID_ARGUMENT also for a client without TCP frames, and for
 *         MBM_ACCEPT_TRANSACTION if mbm_client_setInFlight allows more than one request
 */
uint8_t mbm_client_setAccept(mbm_client *client, uint8_t accept);

/**
 * Sets whether the client accepts responses that deviate from the standard: to a read with
 * more data than requested, of which the first count, and to a write with another address,
 * value or quantity than requested. (Some meters send four bytes for one register.) The frame
 * buffer must hold the response. A response with less data than requested stays
 * MBM_MALFORMED_REPLY.
 *
 * On an RTU line such a reply ends the request once the line is silent, so that a right one
 * after it wins.
 *
 * @param on  0 (the default) or 1
 * @return a status; MBM_INVALID_ARGUMENT for 1 on a line with ASCII frames
 */
uint8_t mbm_client_setLenient(mbm_client *client, uint8_t on);

/**
 * Sets the least time from the end of a request to the next one, for devices that need a
 * pause. On a serial line and in RTU over TCP this is the gap, unless t3.5 is longer: a later
 * call of mbm_client_setBaudRate or mbm_client_setGap replaces it. In TCP frames only one
 * request may be in flight.
 *
 * @param waitMs  milliseconds, 0 (the default) to 65535
 * @return a status; MBM_INVALID_ARGUMENT also if mbm_client_setInFlight allows more than one
 *         request
 */
uint8_t mbm_client_setMessageWait(mbm_client *client, uint32_t waitMs);

/**
 * Sets the records of units. In a record the client counts the requests to its unit. The
 * record's `delayUs` sets the minimum time between two requests to the unit; its `timeoutMs`
 * and `retryLimit` replace those of the client. You may change these three at any time.
 *
 * @param units  your array of records, initialised with MBM_INIT except for the fields that you
 *               set; NULL for none
 * @param count  the number of records, 0 to 255
 * @return a status; MBM_INVALID_ARGUMENT for a record with a `unit` above 255 or a `timeoutMs`
 *         above 1000000
 */
uint8_t mbm_client_setUnits(mbm_client *client, mbm_clientUnit *units, uint8_t count);

/**
 * Returns the response timeout of a request to a unit that has none of its own: that of its record
 * (mbm_client_setUnits) or of the client (mbm_client_setResponseTimeout).
 *
 * @param unit  the unit identifier
 * @return milliseconds; 0 if the client was not begun, and from within a hook of its port
 */
uint32_t mbm_client_getResponseTimeout(const mbm_client *client, uint8_t unit);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_CLIENT_H */
