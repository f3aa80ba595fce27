/**
 * @file mbm/base.h
 * @brief What every other part needs: version, statuses, your port, limits.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_BASE_H
#define MBM_BASE_H

#include <stddef.h>
#include <stdint.h>

/**
 * Initialises any object, struct or array of mbm with zeros, for example
 * `mbm_client client = MBM_INIT;` or `mbm_clientRequest requests[16] = MBM_INIT;`.
 *
 * A designated initialiser, `{.unit = 17}`, and calloc set all other fields to zero too. A
 * static object is zero without an initialiser. A local object is not: a begin function may
 * take the bytes that were in that memory before for an object that was begun.
 */
#ifdef __cplusplus
#define MBM_INIT {}
#else
#define MBM_INIT {0}
#endif

/** Version of this header, "MAJOR.MINOR.PATCH". mbm_version returns that of the archive. */
#define MBM_VERSION MBM_VERSION_OF(MBM_VERSION_MAJOR, MBM_VERSION_MINOR, MBM_VERSION_PATCH)
/** Private: expands the numbers. */
#define MBM_VERSION_OF(major, minor, patch) MBM_VERSION_TEXT(major, minor, patch)
/** Private: makes a text of the numbers. */
#define MBM_VERSION_TEXT(major, minor, patch) #major "." #minor "." #patch

/** Bytes of a frame buffer that suffices for every request and reply with `words` words. */
#define MBM_FRAME_BYTES(words) (2u * (words) + 13u)

#ifdef __cplusplus
extern "C" {
#endif

struct mbm_node;

/* ==== Version: of this header and of the archive ==================================== */

/** Version of this header: a new major version may break programs. */
#define MBM_VERSION_MAJOR 0
/** Version of this header: before 1.0 a new minor version may break programs. */
#define MBM_VERSION_MINOR 2
/** Version of this header: a new patch version breaks nothing. */
#define MBM_VERSION_PATCH 0

/**
 * Returns the version of the archive. The text equals MBM_VERSION, the version of the
 * header, if header and archive belong together.
 *
 * Any thread or interrupt may call it.
 *
 * @return a constant string, the three numbers with dots between them, never NULL
 */
const char *mbm_version(void);

/* ==== Statuses: the codes that functions return ===================================== */

/** The call succeeded. */
#define MBM_OK 0u
/** Exception of the device: it does not support the function. */
#define MBM_ILLEGAL_FUNCTION 1u
/** Exception of the device: it has no such address. This library also returns it, and sends
 *  nothing, for a range that passes address 65535. */
#define MBM_ILLEGAL_DATA_ADDRESS 2u
/** Exception of the device: it refuses the quantity or value. This library also returns it,
 *  and sends nothing, for a quantity that the standard forbids, and for a write of more than
 *  the transmit buffer holds. */
#define MBM_ILLEGAL_DATA_VALUE 3u
/** Exception of the device: it failed while it executed the request. */
#define MBM_SERVER_DEVICE_FAILURE 4u
/** Exception of the device: it accepted the request and needs a long time for it. */
#define MBM_ACKNOWLEDGE 5u
/** Exception of the device: it is busy. Send the request again later. */
#define MBM_SERVER_DEVICE_BUSY 6u
/** Exception of the device: the memory of a file failed its consistency check. */
#define MBM_MEMORY_PARITY_ERROR 8u
/** Exception of a gateway: it has no path to the device. */
#define MBM_GATEWAY_PATH_UNAVAILABLE 10u
/** Exception of a gateway: it received no response from the device. */
#define MBM_GATEWAY_TARGET_FAILED_TO_RESPOND 11u
/** Only frames of other units arrived within the response timeout. */
#define MBM_INVALID_SLAVE_ID 224u
/** The unit sent a reply to another function, and no other reply arrived within the
 *  response timeout. */
#define MBM_INVALID_FUNCTION 225u
/** No complete reply arrived within the response timeout. */
#define MBM_RESPONSE_TIMED_OUT 226u
/** The CRC of the reply, or in ASCII its LRC, is wrong. */
#define MBM_INVALID_CRC 227u
/** The function cannot accept an argument: NULL, a number out of range, a port without
 *  read, write or micros, a buffer that is too short, or an object of another framing or
 *  kind. The comment of the function says which. The call changed nothing. */
#define MBM_INVALID_ARGUMENT 228u
/** The unit sent a reply of this function with a right CRC, but the reply does not match the
 *  request: a wrong byte count, a wrong echo, or an exception code of 0 or from 0x80. */
#define MBM_MALFORMED_REPLY 229u
/** The port's read or write reported that the link is lost. */
#define MBM_LINK_LOST 230u
/** The object is in use: it has a pending request, or the call came from a hook that the
 *  object called, or the object is a record that serves in another way. The call changed
 *  nothing. */
#define MBM_BUSY 231u
/** A request that reads cannot be broadcast. Nothing was sent. */
#define MBM_BROADCAST_NOT_ALLOWED 232u
/** One of these: the frame buffer cannot hold the request, and nothing was sent; the frame
 *  buffer or the response buffer cannot hold the reply, and the response words are
 *  unchanged; a unit cannot take another record. */
#define MBM_BUFFER_TOO_SMALL 233u
/** The object was never begun, or has no buffers. */
#define MBM_NOT_INITIALISED 234u
/** The request is pending: call mbm_node_poll again. */
#define MBM_PENDING 235u
/** The line was not silent, or the port accepted no bytes, for as long as the response
 *  timeout. */
#define MBM_LINE_BUSY 236u
/** A cancel function or a begin function gave the request up. */
#define MBM_CANCELLED 237u
/** The frame is not complete: more bytes must follow. */
#define MBM_INCOMPLETE_FRAME 238u
/** No frame of this framing starts with these bytes, or has this length. */
#define MBM_MALFORMED_FRAME 239u
/** The client has 16 requests already. Nothing was queued. */
#define MBM_QUEUE_FULL 240u
/** Another pending request of the client has this transaction number. Nothing was queued. */
#define MBM_DUPLICATE_TRANSACTION 241u
/** The request has ended already, or was never queued on this client. */
#define MBM_NOT_PENDING 242u
/** The device says that more objects of its identification follow, but it sends none, names
 *  an object that is not after those that it has sent, or then sends one before the one that
 *  it named. Reading on might never end. */
#define MBM_NO_PROGRESS 244u
/** A value is out of the range of the type in which the program reads it. */
#define MBM_OUT_OF_RANGE 246u
/** The connection was not made in time: that of a link within its connect timeout. For a
 *  request on Modbus TCP without a link: the port accepted no byte within the response timeout. */
#define MBM_CONNECT_TIMED_OUT 247u
/** The device answered with the number that means "not available", or with a float that is not a
 *  number: there is no value. See mbm_planConversion. */
#define MBM_NOT_AVAILABLE 248u
/** The registers hold no value of the type in which the program reads them: a BCD digit above 9, a
 *  date that does not exist. */
#define MBM_MALFORMED_VALUE 249u

/**
 * Explains a status in a few words of English. For 1 to 3 these are the words of the device's
 * exception; mbm_status_textOf has its own text for a request that was refused before it was sent.
 *
 * On an AVR, constants are in RAM, and a program that calls this function has about 1100
 * bytes of RAM less. There, show the number; or in a sketch call modbusStatusText of
 * ModbusStatusText.h, which keeps its words in flash.
 *
 * Any thread or interrupt may call it.
 *
 * @param status  any number
 * @return a constant string, never NULL
 */
const char *mbm_status_text(uint8_t status);

/**
 * Explains how a request ended: as mbm_status_text, but for a request that a master or a client
 * refused itself, the text says so, and that nothing was sent.
 *
 * Any thread or interrupt may call it. As for mbm_status_text, the texts take RAM on an AVR: a
 * sketch calls modbusStatusText with both numbers.
 *
 * @param status         the status of the request
 * @param exceptionCode  `exception` of the mbm_clientRequest, or what mbm_node_getExceptionCode
 *                       returns: 0 if the device sent no exception
 * @return a constant string, never NULL
 */
const char *mbm_status_textOf(uint8_t status, uint8_t exceptionCode);

/* ==== Port: your line: read, write, clock, driver; counters ========================= */

/**
 * The functions that your firmware supplies: a byte stream, a clock, and optional hooks.
 *
 * A line keeps a pointer to its port. The port must stay valid and unchanged for as long
 * as the line is used; it may be a constant. A client and a server copy their port.
 * `read`, `write` and `micros` must not be NULL. The other hooks may be NULL: then they are
 * not called.
 *
 * A hook must not use the object that calls it. If it calls a function on that object, the
 * function returns MBM_BUSY and changes nothing; a getter returns its value for an object that
 * was never begun. For a line this rule covers the line itself and the node whose request is
 * pending; the words and the settings of that node may be used. The hook `idle` is the
 * exception: it may call every function, but one that starts a request returns MBM_BUSY.
 */
typedef struct mbm_port {
    /** Your pointer, passed to every hook; may be NULL. */
    void *context;
    /** Copies up to `capacity` received bytes to `bytes`, without waiting. Returns the
     *  number of bytes, 0 if none has arrived, a negative number if the link is lost. */
    int16_t (*read)(void *context, uint8_t *bytes, uint16_t capacity);
    /** Accepts up to `length` bytes to send, without waiting until they are sent. Returns
     *  the number of bytes accepted, 0 if it can accept none now, a negative number if the
     *  link is lost. */
    int16_t (*write)(void *context, const uint8_t *bytes, uint16_t length);
    /** Returns the time in microseconds; it wraps at 2^32. A platform with a
     *  millisecond tick returns `tick * 1000`. */
    uint32_t (*micros)(void *context);
    /** Optional: returns 1 if the last bit was sent, 0 if bits remain to be sent. It may
     *  also wait until the last bit was sent, and return 1. Without it, a line and a client
     *  that know the baud rate wait for a reply longer by the time of the request's characters,
     *  since bytes may remain to be sent after `write` has taken them. */
    uint8_t (*flush)(void *context);
    /** Optional: called before the first byte of a frame is sent (RS-485 driver on). */
    void (*preTransmission)(void *context);
    /** Optional: called after the last bit of a frame was sent (RS-485 driver off). */
    void (*postTransmission)(void *context);
    /** Optional: called repeatedly while a blocking function of `node` waits, but never
     *  between preTransmission and postTransmission. It may sleep until a byte arrives, at
     *  most for the time that mbm_node_pollDelay(node) returns. */
    void (*idle)(void *context, struct mbm_node *node);
} mbm_port;

/** Counters of the events on the line since you zeroed them. Each wraps at 2^32. */
typedef struct mbm_counters {
    /** Requests sent, including retries. */
    uint32_t requests;
    /** Replies that matched a request, including exceptions. */
    uint32_t replies;
    /** Replies that were exceptions. */
    uint32_t exceptions;
    /** Requests whose reply arrived with a wrong CRC. */
    uint32_t badCrc;
    /** Requests without a reply within the response timeout. */
    uint32_t timeouts;
    /** Frames with a right CRC that arrived during the wait for a reply, from another unit
     *  or not matching the request. */
    uint32_t foreignFrames;
    /** Replies that were found after bytes that were not a frame. */
    uint32_t resynchronisations;
    /** Bytes sent. */
    uint32_t bytesSent;
    /** Bytes received, including those of foreign frames and noise. */
    uint32_t bytesReceived;
} mbm_counters;

/* ==== Limits: the most that a frame and a request carry ============================= */

/** The maximum number of registers that one request reads (V1.1b3, 6.3 and 6.4). */
#define MBM_MAX_READ_REGISTERS 125
/** The maximum number of registers that one request writes (V1.1b3, 6.12). */
#define MBM_MAX_WRITE_REGISTERS 123
/** The maximum number of registers that one read/write request writes (V1.1b3, 6.17). */
#define MBM_MAX_READ_WRITE_REGISTERS 121
/** The maximum number of coils or discrete inputs that one request reads (V1.1b3, 6.1 and
 *  6.2). */
#define MBM_MAX_READ_BITS 2000
/** The maximum number of coils that one request writes (V1.1b3, 6.11). */
#define MBM_MAX_WRITE_BITS 1968
/** The maximum length of an RTU frame, in bytes (serial line guide V1.02, 2.5.1). */
#define MBM_MAX_FRAME 256

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_BASE_H */
