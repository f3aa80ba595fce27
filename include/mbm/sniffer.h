/**
 * @file mbm/sniffer.h
 * @brief The sniffer: decodes the traffic between other devices.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_SNIFFER_H
#define MBM_SNIFFER_H

#include "packets.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Sniffer: decodes the traffic between other devices ============================ */

/** The bytes come from a line that carries both directions. */
#define MBM_DIRECTION_BOTH 0u
/** The bytes come from a line or stream on which only the client sends. */
#define MBM_DIRECTION_CLIENT 1u
/** The bytes come from a line or stream on which only servers send. */
#define MBM_DIRECTION_SERVER 2u
/** The smallest buffer of a sniffer, in bytes. */
#define MBM_MIN_SNIFFER_BUFFER 32
/** The most functions of your declaration that a sniffer accepts. */
#define MBM_MAX_SNIFFER_FUNCTIONS 19
/** A request. */
#define MBM_EVENT_REQUEST 0u
/** The reply to a request. */
#define MBM_EVENT_REPLY 1u
/** An exception that answers a request. */
#define MBM_EVENT_EXCEPTION 2u
/** A reply or exception without a matching request: it is late, or its request was not
 *  received, or it does not match the request. */
#define MBM_EVENT_UNPAIRED 3u
/** A request without a reply: none came before the timeout, or on a serial line before
 *  the next request. */
#define MBM_EVENT_TIMEOUT 4u
/** Bytes that look like a frame, but the CRC or LRC is wrong, or bytes are missing. */
#define MBM_EVENT_BAD_CRC 5u
/** Bytes that are no frame. */
#define MBM_EVENT_NOISE 6u

/**
 * A sniffer: finds the frames on a bus that others use, and pairs requests with replies.
 * It never sends and has no port: you pass it the bytes that you receive.
 *
 * You provide the storage. Initialise it with MBM_INIT. Call mbm_sniffer_begin first. Not
 * re-entrant: use one object from one thread, and never from an interrupt; pass bytes from an
 * interrupt through an mbm_ring.
 */
typedef struct mbm_sniffer {
    void *pointers[1]; /**< Private. */
    uint32_t words[171]; /**< Private. */
} mbm_sniffer;

/**
 * One event on the bus.
 *
 * Its pointers point into the buffer of the sniffer, and are valid until the next call
 * with that sniffer.
 */
typedef struct mbm_event {
    /** The bytes of the frame; for MBM_EVENT_NOISE all bytes of the noise. An ASCII frame is
     *  decoded: unit id, PDU, LRC. */
    const uint8_t *frame;
    /** The PDU within the frame; NULL without a PDU. */
    const uint8_t *pdu;
    /** The fields of the PDU, as mbm_frame_parse sets them. If the PDU is malformed, and
     *  for MBM_EVENT_TIMEOUT, MBM_EVENT_BAD_CRC and MBM_EVENT_NOISE, only kind, unit,
     *  transaction and function are set. */
    mbm_packet packet;
    /** When the last byte arrived, in microseconds; for MBM_EVENT_TIMEOUT when the
     *  timeout ended. */
    uint32_t timeUs;
    /** Time from the last byte of the request to the last byte of its reply, or to the
     *  timeout, in microseconds; 0 for other events. */
    uint32_t responseTimeUs;
    /** Length of `frame` in bytes. */
    uint16_t frameLength;
    /** Length of `pdu` in bytes. */
    uint16_t pduLength;
    /** How many bytes of the line or stream this event covers, at most 65535. */
    uint16_t length;
    /** The first coil, input or register of the request; for function 17 (hex) the first
     *  that is read. Also set for a reply, which does not contain it. */
    uint16_t address;
    /** The quantity of the request; for function 17 (hex) the quantity that is read. */
    uint16_t quantity;
    /** One of MBM_EVENT_... */
    uint8_t kind;
    /** MBM_OK; for a request that a server must refuse, the exception; for an exception, its
     *  code; MBM_MALFORMED_REPLY if a reply does not match its request; MBM_RESPONSE_TIMED_OUT;
     *  MBM_INVALID_CRC; MBM_BUFFER_TOO_SMALL for noise that may be a frame longer than the
     *  buffer. */
    uint8_t status;
    /** The unit that the request addresses, or that replies; for MBM_EVENT_BAD_CRC the
     *  byte at that position. */
    uint8_t unit;
    /** The function code; for an exception that of the request; for MBM_EVENT_BAD_CRC
     *  the byte at that position. */
    uint8_t function;
    /** The first bytes of the request's PDU: for replies, exceptions and timeouts, and
     *  for MBM_EVENT_UNPAIRED if the reply is late and its request is still known. */
    uint8_t requestHead[9];
    /** How many bytes of requestHead are set; 0 if the request is not known. */
    uint8_t requestHeadLength;
} mbm_event;

/**
 * Begins a sniffer for the frames on a serial line, or in a TCP stream.
 *
 * You may call it again at any time. The sniffer then discards received bytes and
 * unanswered requests without an event, and its settings return to their defaults.
 *
 * @param framing  MBM_FRAMING_RTU or MBM_FRAMING_ASCII for a serial line, MBM_FRAMING_TCP or
 *                 MBM_FRAMING_RTU_OVER_TCP for a stream
 * @param buffer   holds received bytes until the sniffer has reported them; must stay valid for as
 *                 long as the sniffer is used
 * @param size     size of `buffer` in bytes, at least MBM_MIN_SNIFFER_BUFFER. MBM_MAX_FRAME,
 *                 MBM_MAX_ASCII_FRAME or MBM_MAX_TCP_FRAME holds every frame; with separate
 *                 directions use twice as much. A longer frame becomes an event of kind
 *                 MBM_EVENT_NOISE
 * @return a status; MBM_BUFFER_TOO_SMALL for a size that is too small; MBM_INVALID_ARGUMENT for
 *         another framing
 */
uint8_t mbm_sniffer_begin(mbm_sniffer *sniffer, uint8_t framing, uint8_t *buffer, uint16_t size);

/**
 * Declares functions that the standard does not define, in place of those declared
 * before. The sniffer does not know the length of an undeclared function: silence then
 * ends an RTU frame.
 *
 * @param functions  an array that is copied; may be NULL if `count` is 0
 * @param count      how many functions, at most MBM_MAX_SNIFFER_FUNCTIONS
 */
uint8_t mbm_sniffer_setFunctions(mbm_sniffer *sniffer, const mbm_function *functions,
                                 uint8_t count);

/**
 * Sets the character that ends an ASCII frame after CR, LF at first; as
 * mbm_client_setDelimiter. It has no effect in other framings.
 *
 * @param character  1 to 127, except CR, the colon and hexadecimal digits
 */
uint8_t mbm_sniffer_setDelimiter(mbm_sniffer *sniffer, uint8_t character);

/**
 * Sets the baud rate of a serial line. From it the sniffer computes the silence between
 * RTU frames, and the arrival time of each byte if you feed several at once. Without it
 * the silence is 4 ms, and all bytes of one feed count as received at the same time.
 *
 * @param baud  bits per second; 0, the default, if the rate is unknown
 */
uint8_t mbm_sniffer_setBaudRate(mbm_sniffer *sniffer, uint32_t baud);

/**
 * Sets how long the sniffer waits for the reply to a request before it reports
 * MBM_EVENT_TIMEOUT; 1000 ms at first. On a serial line the next request ends the wait
 * too. A timeout longer than the one of the client also pairs late replies with their
 * requests. For ten times the timeout, a reply to a request that has timed out is
 * reported as MBM_EVENT_UNPAIRED with the start of that request (requestHead).
 *
 * @param timeoutMs  1 to 65535 ms
 */
uint8_t mbm_sniffer_setResponseTimeout(mbm_sniffer *sniffer, uint32_t timeoutMs);

/**
 * Sets how long the sniffer waits for the rest of an incomplete frame. Choose it longer
 * than the error of your time stamps. At first it is 1000 ms in ASCII and TCP. In RTU and
 * RTU over TCP it is 50 ms, which suits a USB adapter, and the time of 130 characters, which
 * suits a UART that hands over 120 at a time: 199 ms at 9600 baud and while the rate is
 * unknown.
 *
 * @param timeoutMs  1 to 65535 ms
 */
uint8_t mbm_sniffer_setFrameTimeout(mbm_sniffer *sniffer, uint32_t timeoutMs);

/**
 * Passes received bytes to the sniffer. Then call mbm_sniffer_next until it returns 0.
 * If the sniffer did not accept all bytes, feed the rest now with the same time; no byte
 * is lost.
 *
 * @param direction  MBM_DIRECTION_BOTH; MBM_DIRECTION_CLIENT or MBM_DIRECTION_SERVER if you
 *                   receive the directions separately. Do not mix MBM_DIRECTION_BOTH with the
 *                   other two: on a change the sniffer discards the bytes that it has not reported
 *                   yet
 * @param bytes      the received bytes; NULL only if `length` is 0
 * @param length     how many bytes
 * @param nowUs      arrival time of the last of the bytes, in microseconds; may wrap
 * @return how many bytes the sniffer accepted; 0 also for a sniffer that was never begun, or for
 *         an invalid argument
 */
uint16_t mbm_sniffer_feed(mbm_sniffer *sniffer, uint8_t direction, const uint8_t *bytes,
                          uint16_t length, uint32_t nowUs);

/**
 * Returns the next event on the bus, in order of time. Call it after each feed until it
 * returns 0. Call it also while no bytes arrive, at least every half hour: silence ends
 * frames, and requests time out.
 *
 * On a Cortex-M it takes 750 bytes of stack.
 *
 * @param nowUs  the time now, in microseconds; may wrap
 * @param event  receives the event; the data that it points to are valid until the next call with
 *               this sniffer
 * @return 1 if there is an event. 0, with `event` unchanged, if there is none yet, for NULL, and
 *         for a sniffer that was never begun
 */
uint8_t mbm_sniffer_next(mbm_sniffer *sniffer, uint32_t nowUs, mbm_event *event);

/**
 * Writes an event as one line of text, for example
 * "unit 17  reply      03 read holding registers  107..109: 555 0 100".
 *
 * Any thread may call it while the event is valid.
 * On a Cortex-M it takes 590 bytes of stack.
 *
 * @param event  an event that mbm_sniffer_next returned
 * @param text   receives the line; always ends with a NUL
 * @param size   size of `text` in bytes; 200 are enough for most events, 2400 for all
 * @return a status; MBM_BUFFER_TOO_SMALL if the line was cut
 */
uint8_t mbm_event_text(const mbm_event *event, char *text, uint16_t size);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_SNIFFER_H */
