/**
 * @file mbm/packets.h
 * @brief Packets: requests and responses, built and parsed by hand.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_PACKETS_H
#define MBM_PACKETS_H

#include "functions.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Packets: requests and responses, built and parsed by hand ===================== */

/** A request: a client sends it. */
#define MBM_PACKET_REQUEST 0u
/** A response: a server sends it if the request succeeds. */
#define MBM_PACKET_RESPONSE 1u
/** An exception: a server sends it if the request fails (V1.1b3, clause 7). */
#define MBM_PACKET_EXCEPTION 2u
/** The longest PDU, function code and data, in bytes (V1.1b3, 4.1). */
#define MBM_MAX_PDU 253
/** The length is exactly `bytes`. */
#define MBM_LENGTH_EXACT 0u
/** The length is at least `bytes`. Call the function again once you have that many bytes. */
#define MBM_LENGTH_AT_LEAST 1u
/** Silence on the line ends the frame; in ASCII the end character does. `bytes` is 0. */
#define MBM_LENGTH_SILENCE 2u
/** The length is not known, because the function is not declared: see mbm_function. In
 *  RTU over TCP also for a function whose frames silence ends, because a stream has no
 *  silence. `bytes` is 0. */
#define MBM_LENGTH_UNKNOWN 3u

/** An object of a device identification. */
typedef struct mbm_object {
    /** The value, usually text, without a NUL. */
    const uint8_t *data;
    /** Length of the value in bytes. */
    uint8_t length;
    /** The object id: 0 vendor name, 1 product code, 2 revision and so on (V1.1b3, 6.21). */
    uint8_t id;
} mbm_object;

/**
 * A request, response or exception of any function. Each function uses the fields in this
 * table (function codes in hex). Parsing sets them and zeroes all others; building reads
 * them and ignores all others.
 *
 * function | request | response
 * ---------|---------|---------
 * 01, 02, 03, 04 | address, quantity | data
 * 05, 06 | address, value | address, value
 * 07 | | exceptionStatus
 * 08 | subFunction, data | subFunction, data
 * 0B | | commStatus, eventCount
 * 0C | | commStatus, eventCount, messageCount, data
 * 0F, 10 | address, quantity, data | address, quantity
 * 11 | | byteCount, data
 * 14, 15 | data | data
 * 16 | address, andMask, orMask | address, andMask, orMask
 * 17 | address, quantity, writeAddress, writeQuantity, data | data
 * 18 | address | data
 * 2B | meiType, data | meiType, data
 * 2B, MEI type 0E | meiType, readDeviceIdCode, objectId | see below
 * your own | data | data
 *
 * The data of 0C are the events, the latest first; those of 14 and 15 are records. A response
 * of 2B with MEI type 0E has meiType, readDeviceIdCode, conformity, moreFollows,
 * nextObjectId, objectCount and data (objects).
 *
 * An exception has exceptionCode, and the function code of the request. Register data are
 * as on the wire, the high byte of each register first. Bits begin with the lowest bit of
 * the first byte. To read records or objects, use mbm_packet_nextRecord and
 * mbm_packet_nextObject; to write them, mbm_packet_addRecord and mbm_packet_addObject.
 */
typedef struct mbm_packet {
    /** The data, without the byte count before them. Parsing sets a pointer into the
     *  parsed bytes. To build a packet, point it to bytes of yours. May be NULL if
     *  dataLength is 0. */
    const uint8_t *data;
    /** Length of `data` in bytes. */
    uint16_t dataLength;
    /** The transaction identifier of a TCP frame; 0 in other framings. */
    uint16_t transaction;
    /** The first coil, input or register, counted from 0; for function 17 the first that
     *  is read. */
    uint16_t address;
    /** How many coils, inputs or registers; for function 17 how many are read. */
    uint16_t quantity;
    /** 17: the first register that is written. */
    uint16_t writeAddress;
    /** 17: how many registers are written. */
    uint16_t writeQuantity;
    /** 05: 0 is off, any other value is on; parsing sets 1 for on. 06: the value of the
     *  register. */
    uint16_t value;
    /** 16: the bits that keep their value. */
    uint16_t andMask;
    /** 16: the new values of the other bits. */
    uint16_t orMask;
    /** 08: the sub-function, one of MBM_DIAGNOSTICS_... */
    uint16_t subFunction;
    /** 0B, 0C: FFFF (hex) while the device carries out a command, else 0. */
    uint16_t commStatus;
    /** 0B, 0C: the count of successful messages. */
    uint16_t eventCount;
    /** 0C: the count of messages. */
    uint16_t messageCount;
    /** The unit id that the request addresses, or that replies, 0 to 255. Only frames have it.
     *  mbm_frame_build, mbm_frame_exception and mbm_frame_replyLength refuse a greater number
     *  (MBM_INVALID_ARGUMENT). */
    uint16_t unit;
    /** MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE or MBM_PACKET_EXCEPTION. */
    uint8_t kind;
    /** The function code, 1 to 127; of an exception the one of the request. */
    uint8_t function;
    /** Exception: the code, 1 to 127. The numbers are those of MBM_ILLEGAL_FUNCTION and
     *  the statuses after it. */
    uint8_t exceptionCode;
    /** 07: the eight outputs, one bit each. */
    uint8_t exceptionStatus;
    /** 11: the byte count, at most dataLength. Some devices count only the id and send
     *  more bytes after it. */
    uint8_t byteCount;
    /** 2B: MBM_MEI_READ_DEVICE_IDENTIFICATION or another MEI type. */
    uint8_t meiType;
    /** 2B/0E: one of MBM_DEVICE_ID_... */
    uint8_t readDeviceIdCode;
    /** 2B/0E: the first object to read, or the only one. */
    uint8_t objectId;
    /** 2B/0E: the conformity level, by the standard 01 to 03 or 81 to 83 (hex); not
     *  checked. */
    uint8_t conformity;
    /** 2B/0E: 1 if the client has to send another request for the rest, else 0. */
    uint8_t moreFollows;
    /** 2B/0E: the object to request next. By the standard 0 if none follows; not checked. */
    uint8_t nextObjectId;
    /** 2B/0E: how many objects `data` contains. */
    uint8_t objectCount;
} mbm_packet;

/** The length of a PDU or frame, as far as it is known. */
typedef struct mbm_length {
    /** The length in bytes from the first byte on; `kind` says how to read it. */
    uint16_t bytes;
    /** MBM_LENGTH_EXACT, MBM_LENGTH_AT_LEAST, MBM_LENGTH_SILENCE or MBM_LENGTH_UNKNOWN. */
    uint8_t kind;
} mbm_length;

/** Registers of a file: one group of function 14 or 15 (hex), in a request or a response. */
typedef struct mbm_record {
    /** The registers, the high byte of each first; 2 * length bytes. A request of
     *  function 14 reads registers and has no data: NULL after parsing, ignored for
     *  building. */
    const uint8_t *data;
    /** The file number, 1 to 65535; 0 in a response of function 14, which does not
     *  contain it. */
    uint16_t file;
    /** The first record, 0 to 9999; 0 in a response of function 14. */
    uint16_t record;
    /** How many registers. */
    uint16_t length;
} mbm_record;

/**
 * Writes the frame of a packet: a request, a response or an exception. It never builds a
 * malformed frame.
 *
 * Any thread or interrupt may call it. On a Cortex-M it takes 600 bytes of stack.
 *
 * @param packet    the packet, with its unit, and for TCP its transaction
 * @param frame     receives the frame; it must not overlap the packet's data
 * @param capacity  bytes of `frame`; MBM_MAX_FRAME suffice for RTU, MBM_MAX_TCP_FRAME for TCP,
 *                  MBM_MAX_PDU for MBM_FRAMING_NONE, MBM_MAX_ASCII_FRAME for all
 * @param length    receives the frame's length in bytes; 0 if the status is not MBM_OK
 * @return a status; MBM_BUFFER_TOO_SMALL; otherwise the status that mbm_frame_parse would return
 *         for such a frame
 */
uint8_t mbm_frame_build(const mbm_framing *framing, const mbm_packet *packet, uint8_t *frame,
                        uint16_t capacity, uint16_t *length);

/**
 * Parses a frame into a packet. The packet's data point into the frame.
 *
 * If it returns an exception code for a request, mbm_frame_exception writes the exception
 * that answers the request.
 *
 * Any thread or interrupt may call it.
 *
 * @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
 * @param frame        the frame, from its first byte to its last. An ASCII frame is decoded in
 *                     place, which overwrites it; other frames do not change
 * @param frameLength  the number of bytes of `frame`
 * @param packet       receives the packet. If the frame is valid but its PDU is not, it receives
 *                     only kind, unit, transaction and function. If the frame is not valid, it
 *                     receives only the kind. For MBM_INVALID_ARGUMENT it does not change
 * @return MBM_OK, also for an exception. If the frame is not valid: MBM_INCOMPLETE_FRAME,
 *         MBM_MALFORMED_FRAME, or MBM_INVALID_CRC, also for a wrong LRC. If its request is not
 *         valid, the exception that answers it: MBM_ILLEGAL_FUNCTION, MBM_ILLEGAL_DATA_ADDRESS or
 *         MBM_ILLEGAL_DATA_VALUE. If its response is not valid: MBM_MALFORMED_REPLY, or
 *         MBM_INVALID_FUNCTION for a function code that the standard does not define and `framing`
 *         does not declare
 */
uint8_t mbm_frame_parse(const mbm_framing *framing, uint8_t kind, uint8_t *frame,
                        uint16_t frameLength, mbm_packet *packet);

/**
 * As mbm_frame_parse, but does not check the CRC of an RTU frame: for bytes that another layer has
 * checked, or a log that does not keep the CRC. The two bytes of the CRC must be there, with any
 * value. Other framings are parsed as by mbm_frame_parse.
 *
 * Any thread or interrupt may call it.
 *
 * @return as mbm_frame_parse. MBM_INVALID_CRC is returned only for the LRC of an ASCII frame
 */
uint8_t mbm_frame_parseWithoutCrc(const mbm_framing *framing, uint8_t kind, uint8_t *frame,
                                  uint16_t frameLength, mbm_packet *packet);

/**
 * Takes the exception out of a frame, without the code for other responses.
 *
 * Any thread or interrupt may call it.
 *
 * @param frame        the frame, from its first byte to its last. An ASCII frame is decoded in
 *                     place, which overwrites it
 * @param frameLength  the number of bytes of `frame`
 * @param packet       receives the exception: its kind is MBM_PACKET_EXCEPTION, `function` is the
 *                     function code of the request, without the bit 0x80. It does not change
 *                     unless the status is MBM_OK
 * @return a status; MBM_INVALID_FUNCTION if the frame is valid but no exception;
 *         MBM_INCOMPLETE_FRAME, MBM_MALFORMED_FRAME or MBM_INVALID_CRC if it is not valid;
 *         MBM_MALFORMED_REPLY for an exception of another length, or with a code that is not 1 to
 *         127; MBM_INVALID_ARGUMENT also for MBM_FRAMING_NONE
 */
uint8_t mbm_frame_asException(const mbm_framing *framing, uint8_t *frame, uint16_t frameLength,
                              mbm_packet *packet);

/**
 * Writes the frame of the exception that answers a request. Pass the status of
 * mbm_frame_parse if that refused the request, or an exception code of your choice if your
 * device refuses it.
 *
 * Any thread or interrupt may call it.
 *
 * @param request   the request, as mbm_frame_parse filled it in
 * @param code      the exception code, 1 to 127, for example MBM_ILLEGAL_FUNCTION
 * @param frame     receives the frame; it may be the buffer of the request's frame
 * @param capacity  bytes of `frame`; 11 always suffice
 * @param length    receives the frame's length in bytes; 0 if the status is not MBM_OK
 * @return a status; MBM_BROADCAST_NOT_ALLOWED for unit 0 on a serial line, which no device
 *         answers; MBM_ILLEGAL_FUNCTION for a function code from 0x80 on, which no exception can
 *         contain; MBM_BUFFER_TOO_SMALL; MBM_INVALID_ARGUMENT also for MBM_FRAMING_NONE
 */
uint8_t mbm_frame_exception(const mbm_framing *framing, const mbm_packet *request, uint8_t code,
                            uint8_t *frame, uint16_t capacity, uint16_t *length);

/**
 * Computes the length of a frame from its first bytes.
 *
 * A response to function 11 may be longer than its byte count says, because some devices
 * count only the id. In RTU frames the length is MBM_LENGTH_AT_LEAST until the bytes of the
 * CRC have arrived at the position that the byte count gives. Then it is MBM_LENGTH_EXACT
 * if that CRC is right. If it is wrong, it is MBM_LENGTH_SILENCE, or MBM_LENGTH_UNKNOWN in
 * RTU over TCP. A PDU without a frame (MBM_FRAMING_NONE) has no CRC: its length is the one
 * that the byte count gives, and mbm_frame_parse accepts a longer PDU too.
 *
 * Any thread or interrupt may call it. On a Cortex-M it takes 500 bytes of stack.
 *
 * @param kind      MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
 * @param bytes     the frame's first bytes; more may follow
 * @param have      the number of bytes; may be 0
 * @param expected  receives the length; MBM_LENGTH_UNKNOWN and 0 if the status is not MBM_OK
 * @return a status; MBM_MALFORMED_FRAME if no frame starts with these bytes, or if no frame may be
 *         as long as they say
 */
uint8_t mbm_frame_expectedLength(const mbm_framing *framing, uint8_t kind, const uint8_t *bytes,
                                 uint16_t have, mbm_length *expected);

/**
 * Computes the length of the response frame to a request. If the device refuses the
 * request, it sends an exception instead: 5 bytes in RTU, 9 in TCP, 11 characters in
 * ASCII, 2 for MBM_FRAMING_NONE.
 *
 * Any thread or interrupt may call it. On a Cortex-M it takes 700 bytes of stack.
 *
 * @param request   the request, as for mbm_frame_build
 * @param expected  receives the length. It is MBM_LENGTH_EXACT and 0 for a request that no device
 *                  answers: a broadcast, or 08 with sub-function 04. It is MBM_LENGTH_UNKNOWN and
 *                  0 if the status is not MBM_OK
 * @return a status; MBM_INVALID_ARGUMENT if the packet is not a request; otherwise the status for
 *         which mbm_frame_build refuses the request
 */
uint8_t mbm_frame_replyLength(const mbm_framing *framing, const mbm_packet *request,
                              mbm_length *expected);

/**
 * Decides whether bytes look like the start of a Modbus TCP frame, a request or a
 * response, and computes the frame's length. It needs 8 bytes. The length in the MBAP
 * header must be one that a request or a response of the function may have, as far as the
 * bytes show.
 *
 * Any thread or interrupt may call it.
 *
 * @param bytes         the first bytes
 * @param have          the number of bytes
 * @param allowUnknown  0: the function code must be one that the standard defines or leaves to
 *                      users; any other value: every function code but 0 will do
 * @param expected      receives the length of the frame in bytes; 0 if the status is not MBM_OK
 * @return a status; MBM_INCOMPLETE_FRAME if more bytes are needed to decide;
 *         MBM_MALFORMED_FRAME if the bytes are not a Modbus TCP frame
 */
uint8_t mbm_frame_looksLikeTcp(const uint8_t *bytes, uint16_t have, uint8_t allowUnknown,
                               uint16_t *expected);

/**
 * Computes the CRC-16 of an RTU frame (serial line guide V1.02, 6.2.2). A frame carries
 * its low byte first.
 *
 * Any thread or interrupt may call it.
 *
 * @param bytes   unit and PDU
 * @param length  the number of bytes
 * @return the CRC; 0xFFFF if `bytes` is NULL or `length` is 0
 */
uint16_t mbm_frame_crc16(const uint8_t *bytes, uint16_t length);

/**
 * Computes the LRC of an ASCII frame (serial line guide V1.02, 6.2.1).
 *
 * Any thread or interrupt may call it.
 *
 * @param bytes   unit and PDU as bytes, not as characters
 * @param length  the number of bytes
 * @return the LRC; 0 if `bytes` is NULL or `length` is 0
 */
uint8_t mbm_frame_lrc(const uint8_t *bytes, uint16_t length);

/**
 * Reads the records of function 14 or 15 (hex) one by one:
 * `for (cursor = 0; mbm_packet_nextRecord(&packet, &cursor, &record);)`
 *
 * Any thread or interrupt may call it.
 *
 * @param packet  a request or response of function 14 or 15, parsed or to be built
 * @param cursor  the position in the data; a variable of yours, 0 for the first record
 * @param record  receives the record; its data pointer points into the data of the packet
 * @return 1 if there is a record. 0, with `cursor` and `record` unchanged, if there are no more
 *         records, and for NULL
 */
uint8_t mbm_packet_nextRecord(const mbm_packet *packet, uint16_t *cursor, mbm_record *record);

/**
 * Reads the objects of a device identification one by one, as mbm_packet_nextRecord
 * reads records.
 *
 * Any thread or interrupt may call it.
 *
 * @param packet  a response of function 2B/0E (hex), parsed or to be built
 * @param cursor  the position in the data; a variable of yours, 0 for the first object
 * @param object  receives the object; its data pointer points into the data of the packet
 * @return 1 if there is an object. 0, with `cursor` and `object` unchanged, if there are no
 *         more objects, and for NULL
 */
uint8_t mbm_packet_nextObject(const mbm_packet *packet, uint16_t *cursor, mbm_object *object);

/**
 * Adds a record to the data of a packet of function 14 or 15 (hex) that you are going to
 * build. Set the kind and the function of the packet first, and dataLength to 0. mbm_client_forward
 * takes the data of a request as its `body`.
 *
 * @param packet    gets the record; unchanged if the call fails
 * @param storage   receives the data of the packet; use the same storage for all its records
 * @param capacity  size of `storage` in bytes; 251 are always enough
 * @param record    the record; its data must not overlap `storage`
 * @return a status; MBM_BUFFER_TOO_SMALL; MBM_ILLEGAL_FUNCTION if the function is not 14 or 15;
 *         MBM_ILLEGAL_DATA_ADDRESS or MBM_ILLEGAL_DATA_VALUE for an invalid record;
 *         MBM_INVALID_ARGUMENT for an exception packet, record data that overlap `storage`, or
 *         packet data that are not in `storage`
 */
uint8_t mbm_packet_addRecord(mbm_packet *packet, uint8_t *storage, uint16_t capacity,
                             const mbm_record *record);

/**
 * Adds an object to the data of a response of function 2B/0E (hex) that you are going to
 * build. Set the kind, the function and the meiType of the packet first, and dataLength
 * and objectCount to 0.
 *
 * @param packet    gets the object; unchanged if the call fails
 * @param storage   receives the data of the packet; use the same storage for all its objects
 * @param capacity  size of `storage` in bytes; 246 are always enough
 * @param object    the object; its data must not overlap `storage`
 * @return a status; MBM_BUFFER_TOO_SMALL: if `storage` has 246 bytes, the object belongs into
 *         the next response, so set moreFollows and nextObjectId; MBM_ILLEGAL_FUNCTION if the
 *         packet is no such response; MBM_INVALID_ARGUMENT for object data that overlap
 *         `storage`, or packet data that are not in `storage`
 */
uint8_t mbm_packet_addObject(mbm_packet *packet, uint8_t *storage, uint16_t capacity,
                             const mbm_object *object);

/**
 * Describes a frame in one line of words, for example
 * "unit 17  request    03 read holding registers  107..109", or
 * "bad CRC, 8 bytes" if the frame is damaged.
 *
 * Any thread or interrupt may call it. On a Cortex-M it takes 976 bytes of stack.
 *
 * @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
 * @param frame        the frame, from its first byte to its last
 * @param frameLength  the number of bytes of `frame`
 * @param text         receives the line. A zero byte always ends it
 * @param size         bytes of `text`; 200 suffice for most frames, 2295 for all
 * @return a status; MBM_BUFFER_TOO_SMALL if `text` received only the start of the line;
 *         MBM_INVALID_ARGUMENT for MBM_FRAMING_NONE
 */
uint8_t mbm_frame_text(const mbm_framing *framing, uint8_t kind, const uint8_t *frame,
                       uint16_t frameLength, char *text, uint16_t size);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_PACKETS_H */
