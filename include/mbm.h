/**
 * @file mbm.h
 * @brief A Modbus stack for firmware.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit.
 *
 * Rules of every function:
 * - A function that succeeds returns MBM_OK, unless its comment says otherwise. Every function
 *   returns MBM_INVALID_ARGUMENT for NULL, a number out of the range in its comment, an
 *   incomplete port, a buffer that is too short and an object of another framing;
 *   MBM_NOT_INITIALISED for an object that was never begun; MBM_BUSY if a hook calls it on the
 *   object that calls the hook (see mbm_port). A comment names only the statuses besides these.
 * - A call that is refused changes nothing, unless the comment says otherwise.
 * - A pointer is NULL or valid. For NULL a function never crashes. Data that a function only
 *   reads may be NULL if their length is 0.
 * - Objects are your storage. Initialise each object and each struct with MBM_INIT where you
 *   declare it. The library uses no heap and no global variables.
 * - No function is re-entrant on one object. Call no function from an interrupt unless its
 *   comment allows it. You may use any number of objects side by side, each from one thread.
 * - You may call a begin function again at any time, but not from a hook of the object. The
 *   object then gives up what was pending; requests get the status MBM_CANCELLED. Only a line
 *   and a node refuse it with MBM_BUSY while a request is under way.
 *
 * A unit id and a time that you pass have a wider type than they need, so that a number that is
 * too large is refused and not narrowed. Other numbers, such as retries, the length of an array,
 * addresses and quantities, have the type that they need, which costs less flash: C reduces a
 * larger one modulo 256 or 65536 before the library sees it. So it does with `unit` of the
 * mbm_node functions. -Wconversion shows where.
 *
 * "V1.1b3" is the Modbus application protocol specification, "serial line guide V1.02" the
 * guide for RTU and ASCII.
 *
 * Contents:
 *    1 Version                 of this header and of the archive
 *    2 Statuses                the codes that functions return
 *    3 Port                    your line: read, write, clock, driver; counters
 *    4 Functions and framings  codes, limits, length rules; RTU, ASCII, TCP
 *    5 Master                  RTU, one request at a time, blocking or not
 *    6 Client                  many requests, every framing, never waits
 *    7 Plan                    a table of values that a client reads again and again
 *    8 Link                    keeps a client's link open
 *    9 Server                  answers requests on a line or connection
 *   10 Units                   the data that servers serve: tables, callbacks, files
 *   11 Gateway                 from Modbus TCP to the lines of clients
 *   12 Values                  registers and bits as numbers, in words or bytes
 *   13 Packets                 requests and responses, built and parsed by hand
 *   14 Sniffer                 decodes the traffic between other devices
 *   15 Trace                   calls your hook for each frame sent and received
 *   16 Ring                    bytes from an interrupt to the main loop
 */

#ifndef MBM_H
#define MBM_H

#include <stddef.h>
#include <stdint.h>

/**
 * Initialises any object, struct or array of this header with zeros, for example
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

#if defined(__AVR__) && __SIZEOF_DOUBLE__ != 4
/* The archive has a double of 32 bits: what calls these must not link. */
#define mbm_registers_getDouble mbm_registers_getDouble_wants_mdouble_32
#define mbm_registers_setDouble mbm_registers_setDouble_wants_mdouble_32
#define mbm_plan_getNumber mbm_plan_getNumber_wants_mdouble_32
#endif

#ifdef __cplusplus
extern "C" {
#endif

struct mbm_node;
struct mbm_object;
struct mbm_packet;
struct mbm_unit;
struct mbm_registers;

/* ==== 1. Version ==================================================================== */

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

/* ==== 2. Statuses =================================================================== */

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
#define MBM_SLAVE_DEVICE_FAILURE 4u
/** Exception of the device: it accepted the request and needs a long time for it. */
#define MBM_ACKNOWLEDGE 5u
/** Exception of the device: it is busy. Send the request again later. */
#define MBM_SLAVE_DEVICE_BUSY 6u
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
/** The object is in use: it has a request under way, or the call came from a hook that the
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
/** The request is under way: call mbm_node_poll again. */
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
/** Two fields of a plan share an address of one unit and table. */
#define MBM_FIELDS_OVERLAP 243u
/** The device says that more objects of its identification follow, but it sends none, names
 *  an object that is not after those that it has sent, or then sends one before the one that
 *  it named. Reading on might never end. */
#define MBM_NO_PROGRESS 244u
/** A value is out of the range of the type in which the program reads it. */
#define MBM_OUT_OF_RANGE 246u
/** The connection was not made in time. Of a link: within its connect timeout. Of a request on
 *  Modbus TCP without a link: the port accepted no byte within the response timeout. */
#define MBM_CONNECT_TIMED_OUT 247u

/**
 * Explains a status in a few words of English. For 1 to 3 these are the words of the device's
 * exception; mbm_status_textOf tells a request that was refused before it was sent apart.
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

/* ==== 3. Port ======================================================================= */

/**
 * What your firmware supplies: a byte stream, a clock, and optional hooks.
 *
 * A line keeps a pointer to its port. The port must stay valid and unchanged for as long
 * as the line is used; it may be a constant. A client and a server copy their port.
 * `read`, `write` and `micros` must not be NULL. The other hooks may be NULL: then they are
 * not called.
 *
 * A hook must not use the object that calls it. If it calls a function on that object, the
 * function returns MBM_BUSY and changes nothing; a getter returns what it returns for an
 * object that was never begun. So it is with a line, and with the request of a node that is
 * under way; the words and the settings of a node may be used. The hook `idle` is the exception:
 * it may call every function, but one that starts a request returns MBM_BUSY.
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

/**
 * Counters of what happened on the line since you zeroed them. Each wraps at 2^32.
 */
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

/* ==== 4. Functions and framings ===================================================== */

/** RTU: serial line, binary, with a CRC-16 (serial line guide V1.02, 2.5.1). */
#define MBM_FRAMING_RTU 0u
/** ASCII: serial line, hexadecimal characters, with an LRC (serial line guide V1.02, 2.5.2). */
#define MBM_FRAMING_ASCII 1u
/** TCP: the PDU follows the MBAP header (messaging on TCP/IP guide V1.0b, 3.1.3). */
#define MBM_FRAMING_TCP 2u
/** RTU frames in a TCP stream. */
#define MBM_FRAMING_RTU_OVER_TCP 3u
/** No frame: the PDU alone, for the mbm_frame functions. */
#define MBM_FRAMING_NONE 4u
/** The maximum length of a TCP frame, in bytes. */
#define MBM_MAX_TCP_FRAME 260
/** The maximum length of an ASCII frame, in characters. */
#define MBM_MAX_ASCII_FRAME 513
/** Read Coils (V1.1b3, 6.1). */
#define MBM_FC_READ_COILS 1u
/** Read Discrete Inputs (V1.1b3, 6.2). */
#define MBM_FC_READ_DISCRETE_INPUTS 2u
/** Read Holding Registers (V1.1b3, 6.3). */
#define MBM_FC_READ_HOLDING_REGISTERS 3u
/** Read Input Registers (V1.1b3, 6.4). */
#define MBM_FC_READ_INPUT_REGISTERS 4u
/** Write Single Coil (V1.1b3, 6.5). */
#define MBM_FC_WRITE_SINGLE_COIL 5u
/** Write Single Register (V1.1b3, 6.6). */
#define MBM_FC_WRITE_SINGLE_REGISTER 6u
/** Read Exception Status (V1.1b3, 6.7). */
#define MBM_FC_READ_EXCEPTION_STATUS 7u
/** Diagnostics (V1.1b3, 6.8). */
#define MBM_FC_DIAGNOSTICS 8u
/** Get Comm Event Counter (V1.1b3, 6.9). */
#define MBM_FC_GET_COMM_EVENT_COUNTER 11u
/** Get Comm Event Log (V1.1b3, 6.10). */
#define MBM_FC_GET_COMM_EVENT_LOG 12u
/** Write Multiple Coils (V1.1b3, 6.11). */
#define MBM_FC_WRITE_MULTIPLE_COILS 15u
/** Write Multiple Registers (V1.1b3, 6.12). */
#define MBM_FC_WRITE_MULTIPLE_REGISTERS 16u
/** Report Server ID (V1.1b3, 6.13). */
#define MBM_FC_REPORT_SERVER_ID 17u
/** Read File Record (V1.1b3, 6.14). */
#define MBM_FC_READ_FILE_RECORD 20u
/** Write File Record (V1.1b3, 6.15). */
#define MBM_FC_WRITE_FILE_RECORD 21u
/** Mask Write Register (V1.1b3, 6.16). */
#define MBM_FC_MASK_WRITE_REGISTER 22u
/** Read/Write Multiple Registers (V1.1b3, 6.17). */
#define MBM_FC_READ_WRITE_MULTIPLE_REGISTERS 23u
/** Read FIFO Queue (V1.1b3, 6.18). */
#define MBM_FC_READ_FIFO_QUEUE 24u
/** Encapsulated Interface Transport (V1.1b3, 6.19). */
#define MBM_FC_ENCAPSULATED_INTERFACE 43u
/** Sub-function of 08: the device returns the data, of any number of words (V1.1b3, 6.8.1). */
#define MBM_DIAGNOSTICS_RETURN_QUERY_DATA 0u
/** Sub-function of 08: restarts the communications port. The data FF 00 also clear the
 *  event log. */
#define MBM_DIAGNOSTICS_RESTART_COMMUNICATIONS 1u
/** Sub-function of 08: the device returns its diagnostic register. */
#define MBM_DIAGNOSTICS_RETURN_DIAGNOSTIC_REGISTER 2u
/** Sub-function of 08: sets the character that ends ASCII frames after CR. The first byte
 *  of the data is the character. */
#define MBM_DIAGNOSTICS_CHANGE_ASCII_INPUT_DELIMITER 3u
/** Sub-function of 08: the device listens only. It sends no reply. */
#define MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY 4u
/** Sub-function of 08: clears the counters and the diagnostic register. */
#define MBM_DIAGNOSTICS_CLEAR_COUNTERS 10u
/** Sub-function of 08: the number of messages that the device detected on the bus. */
#define MBM_DIAGNOSTICS_BUS_MESSAGE_COUNT 11u
/** Sub-function of 08: the number of messages with a wrong CRC. */
#define MBM_DIAGNOSTICS_BUS_COMMUNICATION_ERROR_COUNT 12u
/** Sub-function of 08: the number of exceptions that the device sent. */
#define MBM_DIAGNOSTICS_BUS_EXCEPTION_ERROR_COUNT 13u
/** Sub-function of 08: the number of messages addressed to this device. */
#define MBM_DIAGNOSTICS_SERVER_MESSAGE_COUNT 14u
/** Sub-function of 08: the number of messages to which the device sent no reply. */
#define MBM_DIAGNOSTICS_SERVER_NO_RESPONSE_COUNT 15u
/** Sub-function of 08: the number of messages to which the device replied with a NAK. */
#define MBM_DIAGNOSTICS_SERVER_NAK_COUNT 16u
/** Sub-function of 08: the number of messages to which the device replied that it is busy. */
#define MBM_DIAGNOSTICS_SERVER_BUSY_COUNT 17u
/** Sub-function of 08: the number of messages that character overruns destroyed. */
#define MBM_DIAGNOSTICS_BUS_CHARACTER_OVERRUN_COUNT 18u
/** Sub-function of 08: clears the counter of character overruns. */
#define MBM_DIAGNOSTICS_CLEAR_OVERRUN_COUNTER 20u
/** MEI type of 2B: CANopen General Reference (V1.1b3, 6.20). */
#define MBM_MEI_CANOPEN 13u
/** MEI type of 2B: Read Device Identification (V1.1b3, 6.21). */
#define MBM_MEI_READ_DEVICE_IDENTIFICATION 14u
/** Read device id code: the basic objects, 00 to 02. */
#define MBM_DEVICE_ID_BASIC 1u
/** Read device id code: the regular objects, 00 to 7F. */
#define MBM_DEVICE_ID_REGULAR 2u
/** Read device id code: all objects, 00 to FF. */
#define MBM_DEVICE_ID_EXTENDED 3u
/** Read device id code: one object. */
#define MBM_DEVICE_ID_INDIVIDUAL 4u
/** Length rule: the PDU is as long as its frame. On an RTU line silence ends the frame. */
#define MBM_RULE_SILENCE 0u
/** Length rule: the PDU always has the same number of bytes. */
#define MBM_RULE_FIXED 1u
/** Length rule: a byte of the PDU gives the number of bytes that follow it. */
#define MBM_RULE_COUNTED 2u
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

/**
 * The length rule for the PDUs of a function of your own. A length includes the function
 * code. As MBM_INIT, it is MBM_RULE_SILENCE.
 */
typedef struct mbm_rule {
    /** MBM_RULE_SILENCE, MBM_RULE_FIXED or MBM_RULE_COUNTED. */
    uint8_t kind;
    /** MBM_RULE_FIXED: bytes of the PDU, 1 to 253. MBM_RULE_COUNTED: the position of the
     *  counting byte, 1 to 252 bytes after the function code. */
    uint8_t bytes;
    /** MBM_RULE_COUNTED: the number of bytes that follow the counted bytes. */
    uint8_t more;
} mbm_rule;

/**
 * Declares a function of your own. The standard leaves the codes 65 to 72 and 100 to 110
 * to users: without a declaration their PDUs have any length. Another code that the
 * standard does not define works only with a declaration. A code that the
 * standard defines keeps its meaning, also if you declare it.
 */
typedef struct mbm_function {
    /** The function code, 1 to 127. */
    uint8_t code;
    /** The length of its requests. */
    struct mbm_rule request;
    /** The length of its responses. */
    struct mbm_rule response;
} mbm_function;

/**
 * Describes frames: their framing, and the functions of your own in them. As MBM_INIT, it
 * means RTU with the functions of the standard only.
 */
typedef struct mbm_framing {
    /** The declarations of your own functions; may be NULL if `functionCount` is 0. */
    const struct mbm_function *functions;
    /** The number of declarations in `functions`. */
    uint8_t functionCount;
    /** MBM_FRAMING_RTU, _ASCII, _TCP, _RTU_OVER_TCP or _NONE. */
    uint8_t kind;
    /** ASCII only: the last character of a frame; 0 means line feed (V1.1b3, 6.8.1,
     *  sub-function 03). */
    uint8_t delimiter;
} mbm_framing;

/* ==== 5. Master ===================================================================== */

/**
 * A node: a device on a line, as the master sees it, with the words of its requests and
 * replies.
 *
 * You own the storage. Initialise it with MBM_INIT (`mbm_node meter = MBM_INIT;`) and call
 * mbm_node_begin before all else. Nodes of different lines are independent of each other. Of
 * the nodes of one line, one may have a request under way; a request of another one returns
 * MBM_BUSY meanwhile. Use a line and its nodes from one thread only, and never from an
 * interrupt. mbm_port says which functions the hooks of the port may call.
 *
 * A call that is refused changes nothing. Exceptions are the functions that make a request,
 * as mbm_node_readCoils describes.
 */
typedef struct mbm_node {
    /** Private. */
    void *pointers[5];
    /** Private. */
    uint32_t words[4];
} mbm_node;

/**
 * A serial line with RTU frames: a port, a frame buffer, settings, and the request under way.
 * The nodes on the line use it, one request at a time: see mbm_node.
 *
 * You own the storage. Initialise it with MBM_INIT (`mbm_line line = MBM_INIT;`). Use a line
 * and its nodes from one thread only, and never from an interrupt. Several lines are
 * independent of each other. mbm_port says which functions the hooks of the port may call.
 *
 * A call that is refused changes nothing.
 */
typedef struct mbm_line {
    /** Private. */
    void *pointers[13];
    /** Private. */
    uint32_t words[20];
} mbm_line;

/**
 * Begins a line with RTU frames on a port.
 *
 * It may be called again, for another port or frame buffer, whenever no request is under way;
 * this is cheap. Settings stay. It does not open the port: that must be open already. The first
 * request waits for no gap, unless bytes arrive or mbm_line_used was called.
 *
 * @param line        the object; initialised with MBM_INIT before the first call
 * @param port        the port. It is not copied: it must stay valid and unchanged for as long
 *                    as the object is used. read, write and micros must not be NULL
 * @param frame       as for mbm_line_setFrame; also NULL, if you call that function later
 * @param frameBytes  as for mbm_line_setFrame; 0 if `frame` is NULL
 * @return a status; MBM_BUSY while a request is under way
 */
uint8_t mbm_line_beginRtu(struct mbm_line *line,
                          const struct mbm_port *port,
                          uint8_t *frame,
                          uint16_t frameBytes);

/**
 * Begins a node: a unit on a line, with your words for its requests and replies.
 *
 * It may be called again, for another unit, line or words, whenever the node has no request
 * under way; this is cheap. Settings and the content of the words stay. The node discards what
 * mbm_node_send queued. The line may be begun before or afterwards.
 *
 * The words must not overlap, and must stay valid for as long as the object is used. Any number
 * of nodes may share words. Keep a node until its request has ended.
 *
 * @param node           the object; initialised with MBM_INIT before the first call
 * @param line           the line, which must stay valid for as long as the object is used
 * @param unit           the unit identifier, 1 to 247; 0 is broadcast (serial line guide V1.02,
 *                       2.2). Requests to 248 to 255, which the standard reserves, are sent too
 * @param response       the words that reads fill; NULL only if `responseWords` is 0
 * @param responseWords  0 to 255; 125 hold any reply
 * @param transmit       the words that writes send; NULL only if `transmitWords` is 0
 * @param transmitWords  0 to 255; 123 hold any request
 * @return a status; MBM_BUSY while a request of the node is under way
 */
uint8_t mbm_node_begin(struct mbm_node *node,
                       struct mbm_line *line,
                       uint8_t unit,
                       uint16_t *response,
                       uint16_t responseWords,
                       uint16_t *transmit,
                       uint16_t transmitWords);

/**
 * Sets the write address and empties the queue of mbm_node_send. The transmit words do not
 * change.
 *
 * @param node     the object
 * @param address  the address to which the functions with Queued in their name write, 0 to
 *                 65535
 * @return a status
 */
uint8_t mbm_node_beginTransmission(struct mbm_node *node, uint16_t address);

/**
 * Sets the buffer of one frame. The line uses it only while a request is under way. So in
 * blocking mode it may lie on the stack of a function that sets it and makes the request.
 *
 * A frame buffer of MBM_FRAME_BYTES(words) bytes suffices for every request and reply with
 * that number of words. MBM_FRAME_BYTES(2 * words) bytes also hold a late reply beside the
 * right one. If a request or a reply does not fit, the function that makes the request returns
 * a status. Data are never cut off.
 *
 * @param line        the object; initialised with MBM_INIT before the first call
 * @param frame       the buffer. Its content is not used between requests
 * @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
 * @return a status; MBM_BUSY while a request is under way
 */
uint8_t mbm_line_setFrame(struct mbm_line *line, uint8_t *frame, uint16_t frameBytes);

/**
 * Gives up the request under way, whichever node has made it, and switches the driver off. The
 * status of that node becomes MBM_CANCELLED when you poll it. Call it if the node is lost.
 * If no request is under way, it does nothing.
 *
 * @param line  the object
 * @return a status
 */
uint8_t mbm_line_cancel(struct mbm_line *line);

/**
 * Sets the baud rate from which the master computes the gap before a request (t3.5, serial
 * line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure the
 * serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
 *
 * @param line  the object
 * @param baud  bits per second; 0 (the default): unknown
 * @return a status
 */
uint8_t mbm_line_setBaudRate(struct mbm_line *line, uint32_t baud);

/**
 * Sets the silence before a request, instead of t3.5. Use 0 if no device on the line needs
 * the gap, and more than t3.5 for devices that need longer before they can receive again.
 * A later call of mbm_line_setBaudRate sets it back to t3.5.
 *
 * @param line   the object
 * @param gapUs  microseconds from the last byte received or sent; a value above 2^31 (36
 *               minutes) means 2^31
 * @return a status
 */
uint8_t mbm_line_setGap(struct mbm_line *line, uint32_t gapUs);

/**
 * Sets the turnaround delay: how long the master waits after a broadcast, which no device
 * answers (serial line guide V1.02, 2.4.1).
 *
 * @param line     the object
 * @param delayMs  milliseconds, 0 to 65535; the default is 100
 * @return a status
 */
uint8_t mbm_line_setTurnaroundDelay(struct mbm_line *line, uint32_t delayMs);

/**
 * Sets the quiet time. It prevents that the master accepts a late reply as the reply to a
 * later request. In RTU the two cannot be distinguished if unit, function and length are the
 * same, or if the late reply is an exception to the same function.
 *
 * After a request without a right reply, the master does two things. It waits for the quiet
 * time before it sends the next request, and discards bytes that arrive meanwhile. Then it
 * holds the next reply of that unit, until no byte has arrived for the response timeout; after
 * MBM_INVALID_CRC for the quiet time, because the damaged reply is not late. A second reply
 * replaces the held one, because a device answers in order. If the second reply is damaged,
 * the request fails. A right reply that arrives before a request is sent shows that replies
 * are late; the next reply is then held for the response timeout.
 *
 * So a device that answers in order and within the response timeout never gives the data of
 * another request, whatever its usual latency and however late one of its replies was. The
 * request after a timeout ends one response timeout after the last reply that arrives, and at
 * the latest three response timeouts after it was sent; all others take no longer. A wrong
 * reading remains possible if the device takes longer than the response timeout for two
 * requests in a row.
 *
 * With a quiet time of 0 the master waits and holds nothing: a reply that is later than the
 * response timeout may be taken for the reply to the next request, and so may all that
 * follow.
 *
 * @param line     the object
 * @param quietMs  milliseconds, 0 to 65535; the default is 100
 * @return a status
 */
uint8_t mbm_line_setQuietTime(struct mbm_line *line, uint32_t quietMs);

/**
 * Sets how often the master repeats a request whose reply is missing, damaged or malformed.
 * It does not repeat a request that was answered with an exception.
 *
 * @param line     the object
 * @param retries  0 to 255; the default is 0
 * @return a status
 */
uint8_t mbm_line_setRetries(struct mbm_line *line, uint8_t retries);

/**
 * Switches echo discarding on or off. Switch it on if the receiver also receives what the
 * driver sends: then the master discards the copy of each request that arrives before the
 * reply.
 *
 * @param line  the object
 * @param on    0 (the default) or 1
 * @return a status
 */
uint8_t mbm_line_setEchoDiscard(struct mbm_line *line, uint8_t on);

/**
 * Sets how long the driver stays on after the port's flush, for platforms whose flush
 * returns before the last bit was sent.
 *
 * @param line        the object
 * @param characters  the time in characters at the baud rate of mbm_line_setBaudRate (without
 *                    one, at 9600); the default is 0
 * @return a status
 */
uint8_t mbm_line_setPostFlushHold(struct mbm_line *line, uint8_t characters);

/**
 * Sets your storage for counters, in which the master counts from now on. You may read and
 * zero the counters at any time, but not from an interrupt.
 *
 * @param line      the object
 * @param counters  your counters, initialised with MBM_INIT; NULL stops counting
 * @return a status
 */
uint8_t mbm_line_setCounters(struct mbm_line *line, struct mbm_counters *counters);

/**
 * Reports when another user of the wire, for example another object, used it last.
 * The gap before the next request counts from that time. A time before the last use that
 * the object knows changes nothing.
 *
 * @param line    the object
 * @param timeUs  the time in microseconds on the clock of the object's port, at most 2^31
 *                microseconds (36 minutes) ago
 * @return a status
 */
uint8_t mbm_line_usedAt(struct mbm_line *line, uint32_t timeUs);

/**
 * Reports that another user of the wire has just used it: as mbm_line_usedAt with the
 * present time.
 *
 * @param line  the object
 * @return a status
 */
uint8_t mbm_line_used(struct mbm_line *line);

/**
 * Sends and receives for a non-blocking request, without waiting.
 *
 * Call it as often as you like. If your port does not buffer received bytes, call it at
 * least once in the time of a character.
 *
 * @param node  the object
 * @return MBM_PENDING until the request has ended. Then, at every call, the status of the
 *         request. MBM_OK if there was no request yet
 */
uint8_t mbm_node_poll(struct mbm_node *node);

/**
 * Returns how long mbm_node_poll will have nothing to do unless a byte arrives. A program
 * or the hook `idle` may sleep for that time. A waiting time that has just started counts
 * from this call, so sleeping makes no timeout longer.
 *
 * @param node  the object
 * @return microseconds; 0 means poll now, also from within a hook of the port except `idle`;
 *         0xFFFFFFFF means that the node has no request under way
 */
uint32_t mbm_node_pollDelay(struct mbm_node *node);

/**
 * Gives up the request under way and switches the driver off. The status of the request
 * becomes MBM_CANCELLED. If the node has no request under way, it does nothing.
 *
 * @param node  the object
 * @return a status
 */
uint8_t mbm_node_cancel(struct mbm_node *node);

/**
 * Returns the status of the last request.
 *
 * @param node  the object
 * @return the status: MBM_PENDING while the request is under way, MBM_OK if there was no
 *         request
 */
uint8_t mbm_node_status(const struct mbm_node *node);

/**
 * Returns the exception code of the last reply as received, also a code that the standard
 * does not allow (V1.1b3, 7).
 *
 * @param node  the object
 * @return the code; 0 if the last request ended without an exception
 */
uint8_t mbm_node_getExceptionCode(const struct mbm_node *node);

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
 * @param node      the object
 * @param address   the first coil, 0 to 65535, as on the wire
 * @param quantity  the number of coils, 1 to 2000
 * @return a status; MBM_PENDING in non-blocking mode; an exception of the device (0x01 to
 *         0x7F); MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC, MBM_MALFORMED_REPLY,
 *         MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST, MBM_LINE_BUSY,
 *         MBM_BUFFER_TOO_SMALL, MBM_BROADCAST_NOT_ALLOWED or MBM_CANCELLED; MBM_BUSY while a
 *         request is under way on the line; MBM_NOT_INITIALISED if the line has no port or no
 *         frame buffer
 */
uint8_t mbm_node_readCoils(struct mbm_node *node, uint16_t address, uint16_t quantity);

/**
 * Function 02: reads discrete inputs into the response words, 16 in each word. The first
 * input is the lowest bit; the last word is padded with zeros (V1.1b3, 6.2).
 *
 * @param node      the object
 * @param address   the first input, 0 to 65535, as on the wire
 * @param quantity  the number of inputs, 1 to 2000
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readDiscreteInputs(struct mbm_node *node,
                                    uint16_t address,
                                    uint16_t quantity);

/**
 * Function 03: reads holding registers into the response words (V1.1b3, 6.3).
 *
 * @param node      the object
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readHoldingRegisters(struct mbm_node *node,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 04: reads input registers into the response words (V1.1b3, 6.4).
 *
 * @param node      the object
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readInputRegisters(struct mbm_node *node,
                                    uint16_t address,
                                    uint16_t quantity);

/**
 * Function 05: switches one coil on or off (V1.1b3, 6.5). With unit 0 it is a broadcast.
 *
 * @param node     the object
 * @param address  the coil, 0 to 65535; becomes the write address
 * @param state    0 is off, any other value is on
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeSingleCoil(struct mbm_node *node, uint16_t address, uint8_t state);

/**
 * Function 06: writes one register (V1.1b3, 6.6). With unit 0 it is a broadcast.
 *
 * @param node     the object
 * @param address  the register, 0 to 65535; becomes the write address
 * @param value    its value; also becomes transmit word 0
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeSingleRegister(struct mbm_node *node,
                                     uint16_t address,
                                     uint16_t value);

/**
 * Function 0F: writes coils from the transmit words, starting at word 0. The first coil is
 * the lowest bit (V1.1b3, 6.11). With unit 0 it is a broadcast.
 *
 * @param node      the object
 * @param address   the first coil, 0 to 65535; becomes the write address
 * @param quantity  the number of coils, 1 to 1968, and not more than the transmit words hold
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeMultipleCoils(struct mbm_node *node,
                                    uint16_t address,
                                    uint16_t quantity);

/**
 * Function 0F: writes the queued bits to coils, starting at the last write address. Call
 * mbm_node_beginTransmission and mbm_node_sendBit before.
 *
 * @param node  the object
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeQueuedCoils(struct mbm_node *node);

/**
 * Function 10: writes registers from the transmit words, starting at word 0 (V1.1b3, 6.12).
 * With unit 0 it is a broadcast.
 *
 * @param node      the object
 * @param address   the first register, 0 to 65535; becomes the write address
 * @param quantity  the number of registers, 1 to 123, and not more than the transmit words
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeMultipleRegisters(struct mbm_node *node,
                                        uint16_t address,
                                        uint16_t quantity);

/**
 * Function 10: writes the queued complete words to registers, starting at the last write
 * address. Call mbm_node_beginTransmission and mbm_node_send before.
 *
 * @param node  the object
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_writeQueuedRegisters(struct mbm_node *node);

/**
 * Function 16: the device sets a register to
 * (register AND andMask) OR (orMask AND NOT andMask) (V1.1b3, 6.16).
 * With unit 0 it is a broadcast.
 *
 * @param node     the object
 * @param address  the register, 0 to 65535; becomes the write address
 * @param andMask  1 for each bit of the register to keep; also becomes transmit word 0
 * @param orMask   the new value of the bits that are not kept; also becomes transmit word 1
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_maskWriteRegister(struct mbm_node *node,
                                   uint16_t address,
                                   uint16_t andMask,
                                   uint16_t orMask);

/**
 * Function 17: the device writes the transmit words to registers first. Then it reads
 * registers, which arrive in the response words. Both in one request (V1.1b3, 6.17).
 *
 * @param node           the object
 * @param readAddress    the first register to read, 0 to 65535
 * @param readQuantity   the number of registers to read, 1 to 125
 * @param writeAddress   the first register to write, 0 to 65535; becomes the write address
 * @param writeQuantity  the number of registers to write, 1 to 121, and not more than the
 *                       transmit words
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readWriteMultipleRegisters(struct mbm_node *node,
                                            uint16_t readAddress,
                                            uint16_t readQuantity,
                                            uint16_t writeAddress,
                                            uint16_t writeQuantity);

/**
 * Function 17: as mbm_node_readWriteMultipleRegisters, but writes the queued complete
 * words, starting at the last write address.
 *
 * @param node          the object
 * @param readAddress   the first register to read, 0 to 65535
 * @param readQuantity  the number of registers to read, 1 to 125
 * @return a status; see mbm_node_readCoils
 */
uint8_t mbm_node_readWriteQueuedRegisters(struct mbm_node *node,
                                          uint16_t readAddress,
                                          uint16_t readQuantity);

/**
 * Sets the unit to which the master sends later requests.
 *
 * @param node   the object
 * @param slave  the unit identifier, 1 to 247; 0 is broadcast. The master also sends to 248 to
 *               255, which the standard reserves
 * @return a status
 */
uint8_t mbm_node_setSlaveID(struct mbm_node *node, uint8_t slave);

/**
 * Returns the unit to which the master sends requests.
 *
 * @param node  the object
 * @return the unit identifier, 1 by default; 0 for an object that was never begun
 */
uint8_t mbm_node_getSlaveID(const struct mbm_node *node);

/**
 * Sets the response timeout: the maximum time from the last bit of the request to the last
 * byte of the reply.
 *
 * @param node       the object
 * @param timeoutMs  milliseconds, 0 to 1000000 (16 minutes); the default is 2000
 * @return a status
 */
uint8_t mbm_node_setResponseTimeout(struct mbm_node *node, uint32_t timeoutMs);

/**
 * Switches between blocking and non-blocking mode. In blocking mode, the default, a function
 * that makes a request returns when the request has ended. In non-blocking mode it returns
 * MBM_PENDING at once, and you call mbm_node_poll until the request has ended.
 *
 * @param node  the object
 * @param on    1 blocking, 0 non-blocking; it applies from the next request on
 * @return a status
 */
uint8_t mbm_node_setBlocking(struct mbm_node *node, uint8_t on);

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
 * @param node  the object
 * @param on    0 (the default) or 1
 * @return a status; MBM_BUSY while a request is under way
 */
uint8_t mbm_node_setLenient(struct mbm_node *node, uint8_t on);

/**
 * Queues a word after the words queued before. If the last word holds queued bits, the new
 * word goes into the next one.
 *
 * @param node  the object
 * @param word  the word
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full
 */
uint8_t mbm_node_send(struct mbm_node *node, uint16_t word);

/**
 * Queues a bit after the bits queued before, starting at the lowest bit of a word.
 *
 * @param node  the object
 * @param on    0 is off, any other value is on
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full
 */
uint8_t mbm_node_sendBit(struct mbm_node *node, uint8_t on);

/**
 * Returns how many words of the last successful read mbm_node_receive has not returned yet.
 *
 * @param node  the object
 * @return 0 to 125
 */
uint8_t mbm_node_available(const struct mbm_node *node);

/**
 * Returns the next word of the last successful read.
 *
 * @param node  the object
 * @return the word; 0xFFFF if no word is left
 */
uint16_t mbm_node_receive(struct mbm_node *node);

/* ==== 6. Client ===================================================================== */

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
 * and changes nothing, and a getter returns what it returns for an object that was never
 * begun.
 */
typedef struct mbm_client {
    /** Private. */
    void *pointers[50];
    /** Private. */
    uint32_t words[28];
} mbm_client;

/**
 * A request to a device, and its result. You own the storage. Initialise it with MBM_INIT,
 * then set the fields that you need. You may use it for any number of requests.
 *
 * From the call that queues it until it has ended, do not use or change it, nor what it
 * points to. It has ended when `done` is called, or when `status` is no longer MBM_PENDING.
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
     *  client also sends to 248 to 255, which the standard reserves. On TCP 1 to 255. A client
     *  refuses a greater number (MBM_INVALID_ARGUMENT). */
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
    /** Private. */
    uint8_t bytes[6];
    /** Private. */
    uint32_t words[7];
} mbm_clientRequest;

/**
 * Reads the objects that identify a device (function 2B/0E, V1.1b3, 6.21), with as many
 * requests as the device needs. You own the storage. Initialise it with MBM_INIT, set `unit`,
 * `reply` and `replyBytes` of `request`, and `object`, and pass it to
 * mbm_identification_read. You may use it for any number of devices.
 *
 * From that call until `request.status` is no longer MBM_PENDING, do not change it, nor what
 * it points to. To give it up, pass `request` to mbm_client_cancel.
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
     *  another object than the one that was requested alone; otherwise as of
     *  mbm_client_readCoils. Objects that were handed out before a failure are sound. */
    struct mbm_clientRequest request;
    /** Optional: mbm_client_poll calls it for each object. `object` and its data are valid
     *  during the call. It may call what `done` of a request may call: it may queue
     *  requests, and cancel, also this one, which ends the calls. */
    void (*object)(void *context, const struct mbm_object *object);
    /** Optional: mbm_client_poll calls it when the identification has ended, as it calls
     *  `done` of a request. It may read the next identification with the same storage. */
    void (*done)(void *context, struct mbm_identification *identification);
    /** Your pointer, passed to both; may be NULL. */
    void *context;
    /** Private. */
    struct mbm_client *client;
    /** How many objects `object` was called for, or would have been. */
    uint16_t count;
    /** The conformity level in the last reply, by the standard 01 to 03 or 81 to 83 (hex). It
     *  is not checked: some devices send a wrong one, and reading does not depend on it. */
    uint8_t conformity;
    /** Private. */
    uint8_t handingOut;
    /** Private. */
    uint16_t stream[2];
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
    /** Private. */
    uint32_t last;
    /** Set by you: the response timeout of this unit in milliseconds, 1 to 1000000 (16
     *  minutes); 0: that of mbm_client_setResponseTimeout. mbm_client_setUnits refuses a
     *  greater number. If you set it later, it means 1000000. */
    uint32_t timeoutMs;
    /** Set by you: the unit identifier, 0 to 255. mbm_client_setUnits refuses a greater number.
     *  If you set it later, the record is of no unit. */
    uint16_t unit;
    /** The status of the last request that ended; MBM_OK if none has ended. */
    uint8_t status;
    /** Private. */
    uint8_t cooling_down;
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
 * @param client      the object; initialised with MBM_INIT before the first call
 * @param port        the port, which is copied; read, write and micros must not be NULL
 * @param frame       the buffer of one frame, valid for as long as the client is used
 * @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_client_beginRtu(struct mbm_client *client,
                            const struct mbm_port *port,
                            uint8_t *frame,
                            uint16_t frameBytes);

/**
 * Begins a client of a serial line with ASCII frames (serial line guide V1.02, 2.5.2). It
 * keeps no gap between frames. If no character arrives for one second, the client discards
 * an incomplete frame.
 *
 * @param client      the object; initialised with MBM_INIT before the first call
 * @param port        the port, which is copied; read, write and micros must not be NULL
 * @param frame       the buffer of one frame, valid for as long as the client is used
 * @param frameBytes  bytes of `frame`, at least 17; 513 hold any frame
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_client_beginAscii(struct mbm_client *client,
                              const struct mbm_port *port,
                              uint8_t *frame,
                              uint16_t frameBytes);

/**
 * Begins a client that sends RTU frames through a TCP stream, for converters that pass
 * bytes from TCP to a serial line unchanged. It keeps no gap and does not broadcast.
 *
 * @param client      the object; initialised with MBM_INIT before the first call
 * @param port        the port, which is copied; read, write and micros must not be NULL
 * @param frame       the buffer of one frame, valid for as long as the client is used
 * @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_client_beginRtuOverTcp(struct mbm_client *client,
                                   const struct mbm_port *port,
                                   uint8_t *frame,
                                   uint16_t frameBytes);

/**
 * Begins a client of a TCP stream with frames that have the MBAP header (messaging on
 * TCP/IP guide V1.0b, 3.1.3). All 16 requests may be under way at once. The client matches
 * responses to requests by the transaction identifier, in any order.
 *
 * @param client         the object; initialised with MBM_INIT before the first call
 * @param port           the port, which is copied; read, write and micros must not be NULL
 * @param incoming       the buffer of received bytes, valid for as long as the client is used
 * @param incomingBytes  bytes of `incoming`, at least 9; 260 hold any frame. A larger buffer
 *                       takes more responses from one read
 * @param outgoing       the buffer of bytes to send, valid for as long as the client is used
 * @param outgoingBytes  bytes of `outgoing`, at least 12; 260 hold any frame. A larger buffer
 *                       collects more requests for one write
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_client_beginTcp(struct mbm_client *client,
                            const struct mbm_port *port,
                            uint8_t *incoming,
                            uint16_t incomingBytes,
                            uint8_t *outgoing,
                            uint16_t outgoingBytes);

/**
 * Sets the character that ends ASCII frames after CR, instead of LF, in both
 * directions. Use it for devices that were set to another character by function 08 with
 * sub-function 03 (V1.1b3, 6.8.1). A device still ends its response to that request with
 * the old character: call this function when the request has ended, for example in its
 * `done`.
 *
 * @param client     the object, begun with mbm_client_beginAscii
 * @param character  1 to 127, except CR, the colon and hexadecimal digits
 * @return a status; MBM_BUSY while a request is under way
 */
uint8_t mbm_client_setDelimiter(struct mbm_client *client, uint8_t character);

/**
 * Sets how many requests may be under way at once on TCP. Use it for servers that accept
 * fewer at a time (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 1
 * to 16): some drop a request that arrives in one segment with another. The queue always
 * holds 16.
 *
 * @param client  the object
 * @param most    1 to 16; the default is 16. On a serial line and in RTU over TCP only 1 is
 *                accepted
 * @return a status
 */
uint8_t mbm_client_setInFlight(struct mbm_client *client, uint8_t most);

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
uint8_t mbm_identification_read(struct mbm_identification *identification,
                                struct mbm_client *client,
                                uint8_t code,
                                uint8_t object);

/**
 * Closes the link and opens it again. The client discards an incomplete response. Requests
 * that were under way end with MBM_LINK_LOST at the next calls of mbm_client_poll. Requests
 * that were not sent yet are sent over the new link.
 *
 * @param client  the object
 * @param link    your hooks, used during this call only; NULL if you have opened the link again
 *                already
 * @return what `connect` returns, or MBM_OK without `connect`; MBM_BUSY while the client is
 *         suspended
 */
uint8_t mbm_client_reconnect(struct mbm_client *client, const struct mbm_linkHooks *link);

/**
 * Returns whether the link works, as far as the client knows.
 *
 * If `connect` of mbm_client_reconnect returned MBM_PENDING, this function returns 0 until
 * a reply arrives. Do not reconnect again while the connection is still being made. The
 * port knows whether it is: for example, call mbm_tcp_isConnected.
 *
 * @param client  the object
 * @return 0 after a request ended with MBM_LINK_LOST, until a reply or an exception arrives or
 *         mbm_client_reconnect returns MBM_OK; otherwise 1, also before the first request. With
 *         a link: 0 from each loss of it until it is open again
 */
uint8_t mbm_client_isConnected(const struct mbm_client *client);

/**
 * Suspends the client, so that a line can use its port. The client's requests wait until
 * mbm_client_resume. Until then the line uses the client's storage, and the client remembers
 * the line: keep both.
 *
 * @param client  the object. If `line` is not NULL, it must use RTU or RTU over TCP
 * @param line    a line, which then uses the client's port; NULL if you use the wire in another
 *                way
 * @return a status; MBM_BUSY if a request is under way or the client is suspended already
 */
uint8_t mbm_client_suspend(struct mbm_client *client, struct mbm_line *line);

/**
 * Resumes the client. The line then has no port: requests of its nodes return
 * MBM_NOT_INITIALISED. A line that was begun on another port meanwhile keeps that port.
 *
 * @param client  the object
 * @param line    the line that was passed to mbm_client_suspend; NULL if none was
 * @return a status; MBM_BUSY while a request is under way on the line; MBM_INVALID_ARGUMENT if
 *         the client was not suspended, and for any other line
 */
uint8_t mbm_client_resume(struct mbm_client *client, struct mbm_line *line);

/**
 * Sends and receives for all requests, without waiting, and calls `done` of those that have
 * ended, of at most 17 in one call. It also takes care of the client's link, if
 * mbm_link_begin gave it one.
 *
 * Call it as often as you like. mbm_client_pollDelay returns when the next call is due.
 *
 * @param client  the object
 * @return MBM_PENDING while requests are pending; MBM_OK if none is; MBM_BUSY also from within
 *         `done`, and while the client is suspended
 */
uint8_t mbm_client_poll(struct mbm_client *client);

/**
 * Returns how long mbm_client_poll will have nothing to do unless a byte arrives. A program
 * may sleep, or wait for a byte in select, for that time. The client reads bytes only while
 * a request is pending, or if it has a link (mbm_link_begin). With a link the delay also ends
 * when the link is to be opened again, and is at most one second while the client is idle.
 *
 * @param client  the object
 * @return microseconds; 0 means poll now, also from within a hook of the port; 0xFFFFFFFF means
 *         that no request is pending. While a TCP port accepts no bytes to send it is 1000: to
 *         poll sooner, also wait until the port accepts bytes, as mbm_tcp_wait does
 */
uint32_t mbm_client_pollDelay(struct mbm_client *client);

/**
 * Returns how many requests are pending: queued or under way.
 *
 * @param client  the object
 * @return 0 to 16
 */
uint8_t mbm_client_pending(const struct mbm_client *client);

/**
 * Cancels a request. Its status becomes MBM_CANCELLED, `done` is not called, and you may use
 * the request again at once. The device may have received the request, and may still send
 * a reply.
 *
 * @param client   the object
 * @param request  a request that was queued on this client
 * @return a status; MBM_NOT_PENDING for a request that has ended already or was never queued
 *         here
 */
uint8_t mbm_client_cancel(struct mbm_client *client, struct mbm_clientRequest *request);

/**
 * Returns the transaction identifier on the wire: that of the TCP frame in which the client
 * sent the request last. The client chooses a new one for each frame, also for a retry.
 *
 * @param request  a request, pending or ended
 * @return the identifier; 0 in other framings, for a request that was never sent, and for NULL.
 *         0 may also be the identifier of a frame
 */
uint16_t mbm_client_wireTransaction(const struct mbm_clientRequest *request);

/**
 * Sets how often the client repeats a request whose response is missing, damaged or
 * malformed, or that the port did not accept. It does not repeat a request that was
 * answered with an exception (but see mbm_client_setBusyRetries), one that a lost link
 * interrupted, or one whose response is too long for a buffer. `retryLimit` of a request or
 * of a unit replaces this number.
 *
 * @param client   the object
 * @param retries  0 to 255; the default is 0
 * @return a status
 */
uint8_t mbm_client_setRetries(struct mbm_client *client, uint8_t retries);

/**
 * Sets that the client repeats a request that a busy device refuses: one that the device
 * answers with exception 06 (SERVER DEVICE BUSY), and one that only reads and that the device
 * answers with exception 05 (ACKNOWLEDGE) (V1.1b3, 7). Without this setting both are the
 * result of the request, as every exception is.
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
 * @param client   the object
 * @param retries  the most repetitions of one request for this reason, 0 (the default) to 255;
 *                 the request then ends with the status 5 or 6
 * @param waitMs   the wait before each repetition in milliseconds, 0 to 65535
 * @return a status
 */
uint8_t mbm_client_setBusyRetries(struct mbm_client *client,
                                  uint8_t retries,
                                  uint32_t waitMs);

/**
 * Sets how long a request waits before the client repeats it. Meanwhile the client sends
 * other requests.
 *
 * @param client      the object
 * @param backoff     MBM_BACKOFF_NONE (the default) to MBM_BACKOFF_EXPONENTIAL
 * @param delayMs     the wait before the first repetition, in milliseconds, 0 to 1000000
 * @param maxDelayMs  the longest wait, in milliseconds, 0 to 1000000
 * @return a status
 */
uint8_t mbm_client_setBackoff(struct mbm_client *client,
                              uint8_t backoff,
                              uint32_t delayMs,
                              uint32_t maxDelayMs);

/**
 * Shortens each wait before a repetition by a random part, so that several clients do not
 * repeat their requests at the same time.
 *
 * @param client   the object
 * @param percent  0 (the default) to 100: the largest part of the wait by which the client
 *                 shortens it
 * @param random   returns a new random number at each call, for example that of rand(). It may
 *                 have 32 bits, 15 bits, or random bits in its upper half only. A function that
 *                 it calls on the client returns MBM_BUSY. NULL only if `percent` is 0
 * @param context  your pointer, passed to `random`; may be NULL
 * @return a status
 */
uint8_t mbm_client_setJitter(struct mbm_client *client,
                             uint8_t percent,
                             uint32_t (*random)(void *context),
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
 *         a request that was never queued, and one that no device answers: a broadcast, or
 *         sub-function 04 of 08
 */
uint8_t mbm_client_reply(const struct mbm_clientRequest *request,
                         uint8_t *pdu,
                         uint16_t capacity,
                         struct mbm_packet *packet);

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
 * @param client    the object
 * @param request   the request
 * @param address   the first coil, 0 to 65535, as on the wire
 * @param quantity  the number of coils, 1 to 2000
 * @return MBM_PENDING if the request is queued. Otherwise nothing was queued, and the request's
 *         `status` is the same: MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS for a
 *         request that no device could accept, MBM_BROADCAST_NOT_ALLOWED, MBM_QUEUE_FULL,
 *         MBM_DUPLICATE_TRANSACTION, MBM_BUFFER_TOO_SMALL if `reply` cannot hold the data,
 *         MBM_INVALID_ARGUMENT if `data` is NULL. With the request unchanged: MBM_BUSY also if
 *         the request is pending already
 */
uint8_t mbm_client_readCoils(struct mbm_client *client,
                             struct mbm_clientRequest *request,
                             uint16_t address,
                             uint16_t quantity);

/**
 * Function 02: reads discrete inputs into the bytes of `reply`, as mbm_client_readCoils
 * does (V1.1b3, 6.2).
 *
 * @param client    the object
 * @param request   the request
 * @param address   the first input, 0 to 65535, as on the wire
 * @param quantity  the number of inputs, 1 to 2000
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readDiscreteInputs(struct mbm_client *client,
                                      struct mbm_clientRequest *request,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 03: reads holding registers into the words of `reply` (V1.1b3, 6.3).
 *
 * @param client    the object
 * @param request   the request
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readHoldingRegisters(struct mbm_client *client,
                                        struct mbm_clientRequest *request,
                                        uint16_t address,
                                        uint16_t quantity);

/**
 * Function 04: reads input registers into the words of `reply` (V1.1b3, 6.4).
 *
 * @param client    the object
 * @param request   the request
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 125
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readInputRegisters(struct mbm_client *client,
                                      struct mbm_clientRequest *request,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 05: switches one coil on or off (V1.1b3, 6.5).
 *
 * @param client   the object
 * @param request  the request
 * @param address  the coil, 0 to 65535, as on the wire
 * @param on       0 is off, any other value is on
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeSingleCoil(struct mbm_client *client,
                                   struct mbm_clientRequest *request,
                                   uint16_t address,
                                   uint8_t on);

/**
 * Function 06: writes one holding register (V1.1b3, 6.6).
 *
 * @param client   the object
 * @param request  the request
 * @param address  the register, 0 to 65535, as on the wire
 * @param value    its new value
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeSingleRegister(struct mbm_client *client,
                                       struct mbm_clientRequest *request,
                                       uint16_t address,
                                       uint16_t value);

/**
 * Function 0F: writes coils from the bytes of `data`, eight in each byte. The first coil is
 * the lowest bit (V1.1b3, 6.11).
 *
 * @param client    the object
 * @param request   the request
 * @param address   the first coil, 0 to 65535, as on the wire
 * @param quantity  the number of coils, 1 to 1968
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeMultipleCoils(struct mbm_client *client,
                                      struct mbm_clientRequest *request,
                                      uint16_t address,
                                      uint16_t quantity);

/**
 * Function 10: writes the words of `data` to holding registers (V1.1b3, 6.12).
 *
 * @param client    the object
 * @param request   the request
 * @param address   the first register, 0 to 65535, as on the wire
 * @param quantity  the number of registers, 1 to 123
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeMultipleRegisters(struct mbm_client *client,
                                          struct mbm_clientRequest *request,
                                          uint16_t address,
                                          uint16_t quantity);

/**
 * Function 16: sets a holding register to (register & andMask) | (orMask & ~andMask)
 * (V1.1b3, 6.16).
 *
 * @param client   the object
 * @param request  the request
 * @param address  the register, 0 to 65535, as on the wire
 * @param andMask  1 for each bit of the register to keep
 * @param orMask   the new value of the bits that are not kept
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_maskWriteRegister(struct mbm_client *client,
                                     struct mbm_clientRequest *request,
                                     uint16_t address,
                                     uint16_t andMask,
                                     uint16_t orMask);

/**
 * Function 17: the device writes the words of `data` to holding registers first. Then it
 * reads holding registers, which arrive in the words of `reply` (V1.1b3, 6.17).
 *
 * @param client         the object
 * @param request        the request
 * @param readAddress    the first register to read, 0 to 65535
 * @param readQuantity   the number of registers to read, 1 to 125
 * @param writeAddress   the first register to write, 0 to 65535
 * @param writeQuantity  the number of registers to write, 1 to 121
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readWriteMultipleRegisters(struct mbm_client *client,
                                              struct mbm_clientRequest *request,
                                              uint16_t readAddress,
                                              uint16_t readQuantity,
                                              uint16_t writeAddress,
                                              uint16_t writeQuantity);

/**
 * Function 07: reads the eight exception status outputs into one byte of `reply` (V1.1b3,
 * 6.7).
 *
 * @param client   the object
 * @param request  the request
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readExceptionStatus(struct mbm_client *client,
                                       struct mbm_clientRequest *request);

/**
 * Function 08: sends the words of `data`, and reads the same number of words into `reply`
 * (V1.1b3, 6.8). No device responds to sub-function 04, Force Listen Only Mode.
 *
 * @param client       the object
 * @param request      the request
 * @param subFunction  0 (Return Query Data) to 0x14. The client also sends the others, which
 *                     the standard reserves, and expects a response of one word; for a response
 *                     of another length use mbm_client_custom
 * @param words        the number of words of `data`: 1; for sub-function 0, 1 to 125
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_diagnostics(struct mbm_client *client,
                               struct mbm_clientRequest *request,
                               uint16_t subFunction,
                               uint16_t words);

/**
 * Function 0B: reads the status word and the event count into two words of `reply` (V1.1b3,
 * 6.9).
 *
 * @param client   the object
 * @param request  the request
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_getCommEventCounter(struct mbm_client *client,
                                       struct mbm_clientRequest *request);

/**
 * Function 0C: reads status, event count and message count, and then up to 64 events, into
 * the bytes of `reply`. The first three have two bytes each, the high byte first. An event
 * is one byte; the latest event is first (V1.1b3, 6.10).
 *
 * @param client   the object
 * @param request  the request
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_getCommEventLog(struct mbm_client *client,
                                   struct mbm_clientRequest *request);

/**
 * Function 11: reads the server id, whose format is specific to the device (V1.1b3, 6.13).
 * `reply` receives all bytes after the byte count. Some devices count only the id and send
 * more bytes: `reply` receives those too. In RTU frames silence ends such a reply. The
 * client does not wait for silence if the byte count is right.
 *
 * @param client   the object
 * @param request  the request
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_reportServerId(struct mbm_client *client,
                                  struct mbm_clientRequest *request);

/**
 * Function 14: reads consecutive records of one file into the words of `reply` (V1.1b3,
 * 6.14).
 *
 * @param client    the object
 * @param request   the request
 * @param file      the file number, 1 to 65535
 * @param record    the first record, 0 to 9999
 * @param quantity  the number of records, 1 to 121
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readFileRecord(struct mbm_client *client,
                                  struct mbm_clientRequest *request,
                                  uint16_t file,
                                  uint16_t record,
                                  uint16_t quantity);

/**
 * Function 15: writes the words of `data` to consecutive records of one file (V1.1b3,
 * 6.15).
 *
 * @param client    the object
 * @param request   the request
 * @param file      the file number, 1 to 65535
 * @param record    the first record, 0 to 9999
 * @param quantity  the number of records, 1 to 122
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_writeFileRecord(struct mbm_client *client,
                                   struct mbm_clientRequest *request,
                                   uint16_t file,
                                   uint16_t record,
                                   uint16_t quantity);

/**
 * Function 18: reads up to 31 registers of a FIFO queue into the words of `reply` (V1.1b3,
 * 6.18).
 *
 * @param client   the object
 * @param request  the request
 * @param address  the FIFO pointer address of the queue, 0 to 65535
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readFifoQueue(struct mbm_client *client,
                                 struct mbm_clientRequest *request,
                                 uint16_t address);

/**
 * Function 2B/0E: reads objects that identify the device (V1.1b3, 6.21). `reply` receives,
 * as on the wire: the conformity level, more follows (0 or FF), the next object id, the
 * number of objects, and of each object its id, length and value.
 *
 * @param client   the object
 * @param request  the request
 * @param code     the read device id code, MBM_DEVICE_ID_BASIC to MBM_DEVICE_ID_INDIVIDUAL
 * @param object   the id of the first object to read
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_readDeviceIdentification(struct mbm_client *client,
                                            struct mbm_clientRequest *request,
                                            uint8_t code,
                                            uint8_t object);

/**
 * Any function code: sends the bytes of `data` after the function code, and reads the bytes
 * after the function code of the response into `reply`.
 *
 * @param client    the object
 * @param request   the request
 * @param function  the function code, 1 to 127
 * @param bytes     the number of bytes of `data`, 0 to 252
 * @param response  the length rule of the response; used during this call only
 * @return a status; see mbm_client_readCoils
 */
uint8_t mbm_client_custom(struct mbm_client *client,
                          struct mbm_clientRequest *request,
                          uint8_t function,
                          uint16_t bytes,
                          const struct mbm_rule *response);

/**
 * Forwards a request that arrived from another client: sends `function` and the bytes of
 * `body`, and reads into `reply` all bytes after the function code of the response, as on
 * the wire. Use it for a gateway: the functions of mbm_unit_serveCustom receive the same
 * `body` and return the same `reply`.
 *
 * The client accepts a response only if it matches the request, as for the other functions:
 * its length, byte count, echoed address, value, quantity and records must be right. On RTU,
 * silence ends the response to a function code that the standard does not define, and to
 * sub-functions of 08 from 0x15 on. If you know the length of the response, use
 * mbm_client_custom.
 *
 * No device responds to 08 with sub-function 04: the request ends with MBM_OK and `length` 0
 * after the turnaround delay.
 *
 * @param client    the object
 * @param request   the request; if it is queued, its `data` then points into `body`
 * @param function  the function code, 1 to 127
 * @param body      the bytes after the function code; do not change them until the request has
 *                  ended; may be NULL if `bytes` is 0
 * @param bytes     the number of bytes of `body`, 0 to 252
 * @return a status; see mbm_client_readCoils. Also those with which a server answers such a
 *         request: MBM_ILLEGAL_DATA_VALUE if the length or a count in `body` is wrong,
 *         MBM_ILLEGAL_FUNCTION if the function code is 0 or above 127
 */
uint8_t mbm_client_forward(struct mbm_client *client,
                           struct mbm_clientRequest *request,
                           uint8_t function,
                           const uint8_t *body,
                           uint16_t bytes);

/**
 * Sets the response timeout. On a serial line and in RTU over TCP, the time starts when the
 * request has been sent. In TCP frames it starts when mbm_client_poll puts the request into
 * the outgoing buffer, also if the port accepts it later. `timeoutMs` of a request or of a unit
 * replaces this time.
 *
 * @param client     the object
 * @param timeoutMs  milliseconds, 0 to 1000000 (16 minutes); the default is 2000
 * @return a status
 */
uint8_t mbm_client_setResponseTimeout(struct mbm_client *client, uint32_t timeoutMs);

/**
 * Sets the baud rate from which the client computes the gap before an RTU request (t3.5,
 * serial line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure
 * the serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
 *
 * @param client  the object
 * @param baud    bits per second; 0 (the default): unknown
 * @return a status
 */
uint8_t mbm_client_setBaudRate(struct mbm_client *client, uint32_t baud);

/**
 * Sets the silence before a request, instead of t3.5. A later call of
 * mbm_client_setBaudRate sets it back to t3.5. It has no effect on TCP.
 *
 * @param client  the object
 * @param gapUs   microseconds from the last byte received or sent; a value above 2^31 (36
 *                minutes) means 2^31
 * @return a status
 */
uint8_t mbm_client_setGap(struct mbm_client *client, uint32_t gapUs);

/**
 * Sets the turnaround delay: how long the client waits after a request that no device
 * answers. These requests are a broadcast (serial line guide V1.02, 2.4.1), and 08 with
 * sub-function 04.
 *
 * @param client   the object
 * @param delayMs  milliseconds, 0 to 65535; the default is 100
 * @return a status
 */
uint8_t mbm_client_setTurnaroundDelay(struct mbm_client *client, uint32_t delayMs);

/**
 * Sets the quiet time of a serial line. It prevents that the client accepts a late reply as
 * the reply to a later request: see mbm_line_setQuietTime. It has no effect in TCP frames,
 * whose transaction identifier shows to which request a reply belongs.
 *
 * The client does not hold the reply to mbm_client_diagnostics with sub-function 0, which
 * repeats data of your choice. If no other request has the same data, no late reply can be
 * taken for it, and after its reply the next replies of that unit are not held either.
 *
 * @param client   the object
 * @param quietMs  milliseconds, 0 to 65535; the default is 100; 0 holds no reply
 * @return a status
 */
uint8_t mbm_client_setQuietTime(struct mbm_client *client, uint32_t quietMs);

/**
 * Switches echo discarding on or off. Switch it on if the receiver also receives what the
 * driver sends: then the client discards the copy of each request that arrives before the
 * reply. It has no effect on TCP.
 *
 * @param client  the object
 * @param on      0 (the default) or 1
 * @return a status
 */
uint8_t mbm_client_setEchoDiscard(struct mbm_client *client, uint8_t on);

/**
 * Sets how long the driver stays on after the port's flush, for platforms whose flush
 * returns before the last bit was sent. It has no effect on TCP.
 *
 * @param client      the object
 * @param characters  the time in characters at the baud rate of mbm_client_setBaudRate (without
 *                    one, at 9600); the default is 0
 * @return a status
 */
uint8_t mbm_client_setPostFlushHold(struct mbm_client *client, uint8_t characters);

/**
 * Sets your storage for counters, in which the client counts from now on. You may read and
 * zero the counters at any time, but not from an interrupt. In TCP frames, foreignFrames
 * counts frames whose transaction identifier and unit match no pending request, and
 * resynchronisations counts sequences of bytes that were not a frame.
 *
 * @param client    the object
 * @param counters  your counters, initialised with MBM_INIT; NULL stops counting
 * @return a status
 */
uint8_t mbm_client_setCounters(struct mbm_client *client, struct mbm_counters *counters);

/**
 * Sets the records of units. In a record the client counts the requests to its unit. The
 * record's `delayUs` sets the minimum time between two requests to the unit; its `timeoutMs`
 * and `retryLimit` replace those of the client. You may change these three at any time.
 *
 * @param client  the object
 * @param units   your array of records, initialised with MBM_INIT except for the fields that
 *                you set; NULL for none
 * @param count   the number of records, 0 to 255
 * @return a status; MBM_INVALID_ARGUMENT for a record with a `unit` above 255 or a `timeoutMs`
 *         above 1000000
 */
uint8_t mbm_client_setUnits(struct mbm_client *client,
                            struct mbm_clientUnit *units,
                            uint8_t count);

/* ==== 7. Plan ======================================================================= */

/** A table of the data model (V1.1b3, 4.3): coils. The number of each table is that of the
 *  function that reads it. */
#define MBM_TABLE_COILS 1u
/** The discrete inputs. */
#define MBM_TABLE_DISCRETE_INPUTS 2u
/** The holding registers. */
#define MBM_TABLE_HOLDING_REGISTERS 3u
/** The input registers. */
#define MBM_TABLE_INPUT_REGISTERS 4u
/** The type of a value: a coil or a discrete input, 0 or 1. */
#define MBM_TYPE_BIT 1u
/** One register, 0 to 65535. */
#define MBM_TYPE_UINT16 2u
/** One register, -32768 to 32767. */
#define MBM_TYPE_INT16 3u
/** Two registers. */
#define MBM_TYPE_UINT32 4u
/** Two registers, two's complement. */
#define MBM_TYPE_INT32 5u
/** Four registers. */
#define MBM_TYPE_UINT64 6u
/** Four registers, two's complement. */
#define MBM_TYPE_INT64 7u
/** Two registers, an IEEE 754 binary32. */
#define MBM_TYPE_FLOAT 8u
/** Four registers, an IEEE 754 binary64. */
#define MBM_TYPE_DOUBLE 9u
/** A text, two characters a register, which ends at its first NUL or with its field. */
#define MBM_TYPE_TEXT 10u
/** The longest interval of a field in milliseconds: a day. */
#define MBM_PLAN_LONGEST_INTERVAL 86400000
/** The most fields of one plan. */
#define MBM_PLAN_MAX_FIELDS 16383

/**
 * A plan: a table of fields that a client reads from units again and again.
 *
 * You own the storage. Initialise it with MBM_INIT. Call mbm_plan_begin first. Use it from
 * the thread that uses its client, and never from an interrupt. It stays where it is until
 * mbm_plan_end.
 */
typedef struct mbm_plan {
    /** Private. */
    void *pointers[3];
    /** Private. */
    uint32_t words[4];
} mbm_plan;

/**
 * A field of a plan: a value, or several of one type in a row, that a program wants from a
 * unit again and again. A table of them may be constant.
 */
typedef struct mbm_planField {
    /** The unit, 1 to 255. mbm_plan_begin refuses a greater number. */
    uint16_t unit;
    /** One of MBM_TABLE_... */
    uint8_t table;
    /** One of MBM_TYPE_...: MBM_TYPE_BIT for coils and discrete inputs, another for registers. */
    uint8_t type;
    /** One of MBM_ORDER_...; MBM_ORDER_DEFAULT is MBM_ORDER_ABCD. */
    uint8_t order;
    /** The first bit or register, 0 to 65535, as on the wire. */
    uint16_t address;
    /** The number of values; of a text the number of characters. 0 means 1. */
    uint16_t count;
    /** The time from one read to the next in milliseconds, 1 to MBM_PLAN_LONGEST_INTERVAL. */
    uint32_t intervalMs;
    /** mbm_plan_getNumber, mbm_plan_getInteger and mbm_plan_getInt32 multiply by this; 0 means 1.
     *  It is 0 for a text. */
    int32_t multiplier;
    /** They divide by this after that; 0 means 1. Not negative; 0 for a text. */
    int32_t divisor;
} mbm_planField;

/**
 * Storage of a plan, one for each field.
 */
typedef struct mbm_planPosition {
    /** Private. */
    uint32_t words[2];
} mbm_planPosition;

/**
 * Storage of a plan, one for each read.
 */
typedef struct mbm_planRead {
    /** Private. */
    uint32_t words[8];
} mbm_planRead;

/**
 * How much one read of a unit may request, if not as much as the plan's other reads.
 */
typedef struct mbm_planUnitLimits {
    /** Bits, 1 to 2000; 0 means as `bitsPerRead` of the plan. */
    uint16_t bitsPerRead;
    /** Registers, 1 to 125; 0 means as `registersPerRead` of the plan. */
    uint16_t registersPerRead;
    /** The unit, 1 to 255. mbm_plan_begin refuses a greater number. */
    uint16_t unit;
} mbm_planUnitLimits;

/**
 * Addresses that no read of a plan may touch.
 */
typedef struct mbm_planExcludedRange {
    /** The first address. */
    uint16_t first;
    /** The last address, not less than `first`. */
    uint16_t last;
    /** The unit, 1 to 255; 0 for every unit. mbm_plan_begin refuses a greater number. */
    uint16_t unit;
    /** One of MBM_TABLE_... */
    uint8_t table;
} mbm_planExcludedRange;

/**
 * What a plan is made of. It may be constant. It stays valid and as it is, with everything
 * that it points to, for as long as the plan is used.
 */
typedef struct mbm_planSetup {
    /** The fields, in any order. */
    const struct mbm_planField *fields;
    /** Storage: as many as fields. */
    struct mbm_planPosition *positions;
    /** Storage: as many as reads; there are never more reads than fields. */
    struct mbm_planRead *reads;
    /** Storage: the registers of all reads and the bits of all reads, 16 to a word. */
    uint16_t *data;
    /** Storage: the requests with which the plan reads, initialised with MBM_INIT; they are the
     *  plan's alone. With one it sends one read after the other; more are for Modbus TCP, where
     *  several may be under way at once. */
    struct mbm_clientRequest *requests;
    /** Units with limits of their own; NULL for none. */
    const struct mbm_planUnitLimits *units;
    /** Addresses that no read may touch; NULL for none. */
    const struct mbm_planExcludedRange *excluded;
    /** Optional: called by mbm_plan_poll for each field of a read that has ended, and for each
     *  field of a unit that the plan takes for silent. It may call every function on the plan
     *  and on the client. */
    void (*update)(void *context, struct mbm_plan *plan, uint16_t field);
    /** Handed to `update`. Yours, may be NULL. */
    void *context;
    /** How long the plan leaves a unit alone after a first request without an answer, in
     *  milliseconds; each further one doubles it. 0 means 1000. */
    uint32_t backoffMs;
    /** The longest such time in milliseconds; 0 means 60000. */
    uint32_t longestBackoffMs;
    /** How many fields, 1 to MBM_PLAN_MAX_FIELDS. */
    uint16_t fieldCount;
    /** How many reads there is storage for. */
    uint16_t readCount;
    /** How many words there are in `data`. */
    uint16_t dataWords;
    /** The most bits that one read requests, 1 to 2000; 0 means 2000. */
    uint16_t bitsPerRead;
    /** The most bits between two fields that one read may cover as well. */
    uint16_t bitGap;
    /** The most registers that one read requests, 1 to 125; 0 means 125. */
    uint16_t registersPerRead;
    /** The most registers between two fields that one read may cover as well. */
    uint16_t registerGap;
    /** How many requests, 1 to 16. */
    uint8_t requestCount;
    /** How many units with limits of their own. */
    uint8_t unitCount;
    /** How many excluded ranges. */
    uint8_t excludedCount;
} mbm_planSetup;

/**
 * A read of a plan: one request that it repeats.
 */
typedef struct mbm_planReadInfo {
    /** The time from one read to the next, in milliseconds. */
    uint32_t intervalMs;
    /** The first bit or register, as on the wire. */
    uint16_t address;
    /** How many bits or registers. */
    uint16_t quantity;
    /** The unit. */
    uint8_t unit;
    /** One of MBM_TABLE_... */
    uint8_t table;
    /** How it ended last; MBM_PENDING before it has ended once. */
    uint8_t status;
} mbm_planReadInfo;

/**
 * Groups the fields of a table into reads. mbm_plan_poll sends them from then on.
 *
 * Fields with the same unit, table and interval are read together. Of all ways to cover them
 * within the limits, the plan takes one with the fewest reads, and of these one with the fewest
 * bits or registers. All reads are due at once; the rounds after the first are spread, so that
 * reads of one interval follow each other at equal distances.
 *
 * You may call it again at any time, also from `update`, but not from a hook of the client's
 * port. The plan then first ends, as by mbm_plan_end, unless the call is refused for NULL, a
 * count out of range, a unit above 255 of limits or of an excluded range, or a client that was
 * never begun.
 *
 * @param plan    the object; initialised with MBM_INIT before the first call
 * @param client  the client that sends the reads, begun; the program may use it too, and other
 *                plans
 * @param setup   table, limits and storage; it stays valid and as it is until the plan ends
 * @param field   gets the index of the field that is wrong, 0xFFFF if it is none; may be NULL
 * @return MBM_OK. The status of a field: MBM_INVALID_ARGUMENT for an unknown table, type or
 *         order, a type that the table does not have, a unit above 255, an interval out of
 *         range, a negative divisor or a scale of a text; MBM_BROADCAST_NOT_ALLOWED for unit 0;
 *         MBM_ILLEGAL_DATA_ADDRESS if it goes beyond address 65535 or into an excluded range;
 *         MBM_ILLEGAL_DATA_VALUE if it is longer than a read may be; MBM_FIELDS_OVERLAP for the
 *         later of two that share an address; MBM_BUFFER_TOO_SMALL for the first without
 *         storage for its read or its data. After such a status the plan has ended, and
 *         `positions` and `reads` may be changed. MBM_INVALID_ARGUMENT also for a unit above
 *         255 of limits or of an excluded range
 */
uint8_t mbm_plan_begin(struct mbm_plan *plan,
                       struct mbm_client *client,
                       const struct mbm_planSetup *setup,
                       uint16_t *field);

/**
 * Ends a plan: gives its requests up and lets go of its storage.
 *
 * @param plan  the object
 * @return a status
 */
uint8_t mbm_plan_end(struct mbm_plan *plan);

/**
 * Takes the replies that have arrived, calls `update` for the fields of each read that has
 * ended, and queues the reads that are due, as far as there are requests for them. It does not
 * poll the client: call mbm_client_poll after it.
 *
 * @param plan  the object
 * @return a status
 */
uint8_t mbm_plan_poll(struct mbm_plan *plan);

/**
 * How long mbm_plan_poll has nothing to do, so that a program may sleep until then or until
 * mbm_client_pollDelay is over, whichever comes first.
 *
 * @param plan  the object
 * @return microseconds; 0 means poll now, and is returned within a hook of the client's port;
 *         0xFFFFFFFF if there is nothing to do before a request of the client has ended, and
 *         for an object that was never begun
 */
uint32_t mbm_plan_pollDelay(struct mbm_plan *plan);

/**
 * How the last read of a field ended, and how old its value is. The functions that get a value
 * return the last one that was read, also after a read has failed: this says whether it is
 * still worth something.
 *
 * @param plan   the object
 * @param field  the index of the field
 * @param ageMs  gets the milliseconds since the value arrived, 2147483647 (24 days) at most;
 *               0xFFFFFFFF if none ever did; may be NULL
 * @return MBM_PENDING before the first read has ended, then as it ended: MBM_OK, an exception
 *         of the device, or a failure such as MBM_RESPONSE_TIMED_OUT
 */
uint8_t mbm_plan_getStatus(struct mbm_plan *plan, uint16_t field, uint32_t *ageMs);

/**
 * A value as an integer: multiplied and divided as its field says, rounded to the nearest,
 * halves away from 0.
 *
 * @param plan   the object
 * @param field  the index of the field, of a bit or an integer
 * @param index  which of its values, 0 for the first
 * @param value  gets the number
 * @return a status; MBM_OUT_OF_RANGE if it is not in the range of `value`; MBM_INVALID_ARGUMENT
 *         for a float or a text; if no value has arrived yet the status that mbm_plan_getStatus
 *         returns
 */
uint8_t mbm_plan_getInteger(const struct mbm_plan *plan,
                            uint16_t field,
                            uint16_t index,
                            int64_t *value);

/**
 * As mbm_plan_getInteger, but with 32 bits throughout: less code on a microcontroller.
 *
 * @param plan   the object
 * @param field  the index of the field, of a bit or of an integer of 16 or 32 bits
 * @param index  which of its values, 0 for the first
 * @param value  gets the number
 * @return as mbm_plan_getInteger; MBM_OUT_OF_RANGE also if the value, multiplied, plus half of
 *         the divisor is not less than 2^32; MBM_INVALID_ARGUMENT also for an integer of 64
 *         bits
 */
uint8_t mbm_plan_getInt32(const struct mbm_plan *plan,
                          uint16_t field,
                          uint16_t index,
                          int32_t *value);

/**
 * A bit, an integer or a float as a double: multiplied and divided as its field says, and
 * rounded once, to the nearest. On AVR, where C's double has 32 bits, it is rounded to these after
 * that.
 *
 * @param plan   the object
 * @param field  the index of the field
 * @param index  which of its values, 0 for the first
 * @param value  gets the number; a float that is infinite or not a number stays so
 * @return as mbm_plan_getInteger; MBM_INVALID_ARGUMENT only for a text
 */
uint8_t mbm_plan_getNumber(const struct mbm_plan *plan,
                           uint16_t field,
                           uint16_t index,
                           double *value);

/**
 * A value of type MBM_TYPE_FLOAT, whose bits are copied, or MBM_TYPE_DOUBLE, which is rounded
 * to the nearest; without the scale of its field.
 *
 * @param plan   the object
 * @param field  the index of the field
 * @param index  which of its values, 0 for the first
 * @param value  gets the number
 * @return as mbm_plan_getInteger; MBM_INVALID_ARGUMENT for other types
 */
uint8_t mbm_plan_getFloat(const struct mbm_plan *plan,
                          uint16_t field,
                          uint16_t index,
                          float *value);

/**
 * A text, which ends at its first NUL or with its field. In an order with the low byte first,
 * the first of two characters is a register's low byte.
 *
 * @param plan      the object
 * @param field     the index of the field, of type MBM_TYPE_TEXT
 * @param text      gets the text and a NUL
 * @param capacity  bytes of `text`; the field's count and one are always enough
 * @return as mbm_plan_getInteger; MBM_BUFFER_TOO_SMALL if the text does not fit
 */
uint8_t mbm_plan_getText(const struct mbm_plan *plan,
                         uint16_t field,
                         char *text,
                         uint16_t capacity);

/**
 * The registers of a field as they were read, for mbm_registers_get... functions, in the order
 * of the field. It copies nothing: the next reply changes what it sees.
 *
 * @param plan       the object
 * @param field      the index of the field, of registers
 * @param registers  the view to fill in
 * @return as mbm_plan_getInteger
 */
uint8_t mbm_plan_getRegisters(const struct mbm_plan *plan,
                              uint16_t field,
                              struct mbm_registers *registers);

/**
 * Makes the read of a field due at once, for a value that is wanted now. A unit that does not
 * answer is left alone all the same.
 *
 * @param plan   the object
 * @param field  the index of the field
 * @return a status
 */
uint8_t mbm_plan_refresh(struct mbm_plan *plan, uint16_t field);

/**
 * The reads that the plan has made of the fields: one request each.
 *
 * @param plan   the object
 * @param index  0 for the first read
 * @param read   gets the read
 * @return a status; MBM_INVALID_ARGUMENT behind the last read
 */
uint8_t mbm_plan_getRead(const struct mbm_plan *plan,
                         uint16_t index,
                         struct mbm_planReadInfo *read);

/* ==== 8. Link ======================================================================= */

/** mbm_link_state: there is no link. The client opens it when the wait is over. */
#define MBM_LINK_IS_DOWN 1u
/** mbm_link_state: the connection is being made. */
#define MBM_LINK_IS_CONNECTING 2u
/** mbm_link_state: the link is open. */
#define MBM_LINK_IS_UP 3u
/** An event of a link: it is open now. The status is MBM_OK. */
#define MBM_LINK_EVENT_CONNECTED 0u
/** An event of a link: it was open and is lost. The status is MBM_LINK_LOST. */
#define MBM_LINK_EVENT_LOST 1u
/** An event of a link: an attempt to open it failed. The status is what `connect` or `status` of
 *  mbm_linkHooks returned; MBM_CONNECT_TIMED_OUT if the connection took too long. */
#define MBM_LINK_EVENT_FAILED 2u

/**
 * A link that opens itself again when it was lost. It belongs to one client:
 * mbm_client_poll polls both.
 *
 * You own the storage. Initialise it with MBM_INIT. It must stay where it is until
 * mbm_link_end or until the client was begun again.
 */
typedef struct mbm_link {
    /** Private. */
    void *pointers[32];
    /** Private. */
    uint32_t words[21];
} mbm_link;

/**
 * What has happened to a link. You may read and zero the counters at any time, but not from
 * an interrupt; each wraps at 2^32.
 */
typedef struct mbm_linkCounters {
    /** Calls of `connect` of mbm_linkHooks. */
    uint32_t attempts;
    /** Attempts that failed. */
    uint32_t failed;
    /** How often the link was opened, or found open by mbm_link_begin. */
    uint32_t connected;
    /** How often an open link was lost. */
    uint32_t lost;
} mbm_linkCounters;

/**
 * Gives a client a link, which mbm_client_poll keeps open from then on:
 * - It notices the loss of the link also while the client has no request. For that, an idle
 *   client reads the port in each poll and drops what it reads: late replies, noise, frames
 *   of others. If something else reads the line, call mbm_client_suspend first.
 * - It opens the link again, after a wait that grows with each attempt that fails.
 * - When the link is lost, requests under way end with MBM_LINK_LOST, because the device may
 *   have carried them out. The others end too, or wait: see mbm_link_setRequestsWait.
 * - Requests that are under way when the link begins go on if `status` finds the link open, and
 *   end with MBM_LINK_LOST if not. No byte of an ended request is sent over a new link.
 *
 * mbm_client_pollDelay returns when the next poll is due, for an idle client at most one
 * second. A wait for bytes that also ends when the link is lost, as mbm_tcp_wait and
 * mbm_tty_wait, finds the loss at once.
 *
 * In the first poll the link calls `status` to find out whether the link is open already, and
 * `connect` if not. After a loss or a failed attempt it calls `disconnect`, once.
 *
 * Client and link must stay where they are, and must not be copied. A program does not also
 * call mbm_client_reconnect.
 *
 * All settings of the link return to their defaults. The call may be repeated at any time,
 * also with another client. A begin function of the client ends the link.
 *
 * @param link    the object; initialised with MBM_INIT before the first call
 * @param client  the client, begun; it must not have another link
 * @param hooks   how the link is opened and closed; copied. `connect` must not be NULL. The
 *                hooks must not use the client or the link: each function returns MBM_BUSY
 * @return a status; MBM_NOT_INITIALISED if the client was not begun; MBM_BUSY also while the
 *         client is suspended, and if it has another link
 */
uint8_t mbm_link_begin(struct mbm_link *link,
                       struct mbm_client *client,
                       const struct mbm_linkHooks *hooks);

/**
 * Ends a link. The client and its requests stay; the link itself stays open or closed as it
 * is. If its callback has just reported a loss, open it anew before the client sends again: half
 * a frame may have been sent. The storage is free, and begins anew with mbm_link_begin.
 *
 * @param link  the object; the client's storage must still be valid
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_link_end(struct mbm_link *link);

/**
 * Closes the link and opens it again, at the next poll of the client and without a wait. Call
 * it when you know better than the link: the network is back, the address has changed. Requests
 * that are under way end with MBM_LINK_LOST; queued ones wait for this attempt.
 *
 * @param link  the object
 * @return a status
 */
uint8_t mbm_link_reconnect(struct mbm_link *link);

/**
 * Sets the wait before an attempt to open the link. The first attempt after a loss waits for
 * `delayMs`; each attempt that fails lets the wait grow. It starts anew when the link was open
 * for as long as the last wait.
 *
 * @param link        the object
 * @param backoff     MBM_BACKOFF_NONE to MBM_BACKOFF_EXPONENTIAL (the default), as of
 *                    mbm_client_setBackoff
 * @param delayMs     the first wait in milliseconds, 0 to 65535; the default is 500
 * @param maxDelayMs  the longest wait in milliseconds, 0 to 65535; the default is 30000
 * @return a status
 */
uint8_t mbm_link_setBackoff(struct mbm_link *link,
                            uint8_t backoff,
                            uint32_t delayMs,
                            uint32_t maxDelayMs);

/**
 * Shortens each wait before an attempt by a random part, so that many clients that lost their
 * server together do not connect at the same time.
 *
 * @param link     the object
 * @param percent  0 (the default) to 100: the largest part of the wait that is taken off
 * @param random   as of mbm_client_setJitter; must not use the client or the link. NULL only if
 *                 `percent` is 0
 * @param context  your pointer, passed to `random`; may be NULL
 * @return a status
 */
uint8_t mbm_link_setJitter(struct mbm_link *link,
                           uint8_t percent,
                           uint32_t (*random)(void *context),
                           void *context);

/**
 * Sets how long a connection may take to be made. Then the attempt has failed, with
 * MBM_CONNECT_TIMED_OUT.
 *
 * @param link       the object
 * @param timeoutMs  milliseconds, 1 to 1000000 (16 minutes); 0: as long as `status` returns
 *                   MBM_PENDING. The default is 10000
 * @return a status
 */
uint8_t mbm_link_setConnectTimeout(struct mbm_link *link, uint32_t timeoutMs);

/**
 * Sets whether requests wait for the link. By default they do not: while the link is down,
 * every request ends at the next poll: with MBM_CONNECT_TIMED_OUT if the last attempt took longer
 * than the connect timeout, else with MBM_LINK_LOST. (A program whose `done` queues the
 * request again at once then polls without a pause: let it wait.) If requests wait, they stay
 * in the queue until the link is open again or until you cancel them; their response timeout
 * begins when they are sent. While a connection is being made, requests always wait.
 *
 * @param link  the object
 * @param on    0 (the default) or 1
 * @return a status
 */
uint8_t mbm_link_setRequestsWait(struct mbm_link *link, uint8_t on);

/**
 * Sets the function that mbm_client_poll calls when the link was opened or lost, or when an
 * attempt has failed.
 *
 * @param link      the object
 * @param callback  gets an MBM_LINK_EVENT_ constant and a status. It may do what `done` of a
 *                  request may, and call every function on the link; NULL for none
 * @param context   your pointer, passed to `callback`; may be NULL
 * @return a status
 */
uint8_t mbm_link_setCallback(struct mbm_link *link,
                             void (*callback)(void *context, uint8_t event, uint8_t status),
                             void *context);

/**
 * Sets your storage for counters, in which the link counts from now on.
 *
 * @param link      the object
 * @param counters  your counters, initialised with MBM_INIT; NULL stops counting
 * @return a status
 */
uint8_t mbm_link_setCounters(struct mbm_link *link, struct mbm_linkCounters *counters);

/**
 * Returns what a link is doing.
 *
 * @param link  the object
 * @return MBM_LINK_IS_DOWN, MBM_LINK_IS_CONNECTING or MBM_LINK_IS_UP; 0 before the first poll,
 *         and for an object that was never begun
 */
uint8_t mbm_link_state(const struct mbm_link *link);

/* ==== 9. Server ===================================================================== */

/**
 * A Modbus server on one serial line or one connection.
 *
 * You provide the storage. Initialise it with MBM_INIT. A server serves units. Several
 * servers may share units: for example, a server on a serial line and four servers on TCP
 * connections are five servers with the same units. Use a server and its units from one
 * thread, and never from an interrupt. Use all servers that share units from the same thread.
 *
 * mbm_server_poll calls your hooks and your functions. If they call a function on the
 * server that is being polled, it returns MBM_BUSY and changes nothing; call it after
 * mbm_server_poll has returned. They may call functions on other servers, and the
 * mbm_unit_serve functions on any unit.
 */
typedef struct mbm_server {
    /** Private. */
    void *pointers[14];
    /** Private. */
    uint32_t words[8];
} mbm_server;

/**
 * Begins a server for RTU on a serial line. The baud rate is unknown at first, so 4 ms
 * of silence end a frame: see mbm_server_setBaudRate.
 *
 * You may call it again at any time, but not from within a hook of the server. The
 * server then drops the request or response in progress; if it was sending, it calls
 * postTransmission of the previous port to switch the driver off. A call that fails
 * changes nothing. The function does not open the port. The units and the buffer must
 * stay valid, at the same address, for as long as the server is used. Several servers
 * may share units. The buffer holds no data between requests.
 *
 * @param server  the object; initialised with MBM_INIT before the first call
 * @param port    is copied; its hooks read, write and micros are required
 * @param units   the units to serve: one unit, or an array of units
 * @param count   how many units
 * @param frame   buffer for one frame, a request or a response
 * @param bytes   size of `frame` in bytes, at least 16. MBM_MAX_FRAME holds every frame. The
 *                server ignores a longer request, and answers exception 04 in place of a longer
 *                response
 * @return a status; MBM_INVALID_ARGUMENT for a unit with an id above 255
 */
uint8_t mbm_server_beginRtu(struct mbm_server *server,
                            const struct mbm_port *port,
                            struct mbm_unit *units,
                            uint8_t count,
                            uint8_t *frame,
                            uint16_t bytes);

/**
 * Begins a server for ASCII on a serial line (serial line guide V1.02, 2.5.2). The
 * server drops a frame if the next character takes longer than one second.
 *
 * @param server  see mbm_server_beginRtu
 * @param port    see mbm_server_beginRtu
 * @param units   see mbm_server_beginRtu
 * @param count   see mbm_server_beginRtu
 * @param frame   see mbm_server_beginRtu
 * @param bytes   size of `frame` in bytes, at least 32; MBM_MAX_ASCII_FRAME holds every frame
 * @return a status; see mbm_server_beginRtu
 */
uint8_t mbm_server_beginAscii(struct mbm_server *server,
                              const struct mbm_port *port,
                              struct mbm_unit *units,
                              uint8_t count,
                              uint8_t *frame,
                              uint16_t bytes);

/**
 * Begins a server on an accepted TCP connection. If several requests are in the stream,
 * the server answers them in order.
 *
 * @param server  see mbm_server_beginRtu; one for each connection
 * @param port    see mbm_server_beginRtu; its hooks read and write the connection and give the
 *                time
 * @param units   see mbm_server_beginRtu; the unit ids 0 and 255 address the first unit
 * @param count   see mbm_server_beginRtu
 * @param frame   see mbm_server_beginRtu; one for each connection
 * @param bytes   size of `frame` in bytes, at least MBM_MAX_TCP_FRAME
 * @return a status; see mbm_server_beginRtu
 */
uint8_t mbm_server_beginTcp(struct mbm_server *server,
                            const struct mbm_port *port,
                            struct mbm_unit *units,
                            uint8_t count,
                            uint8_t *frame,
                            uint16_t bytes);

/**
 * Begins a server for a stream of RTU frames without timing: a TCP connection that
 * carries RTU, or a serial adapter that delivers bytes in blocks. The server finds the
 * end of a frame from its bytes. After a damaged frame, half a second of silence ends
 * the damaged bytes.
 *
 * @param server  see mbm_server_beginRtu; one for each connection
 * @param port    see mbm_server_beginRtu
 * @param units   see mbm_server_beginRtu; the unit ids 0 and 255 address the first unit
 * @param count   see mbm_server_beginRtu
 * @param frame   see mbm_server_beginRtu; one for each connection
 * @param bytes   size of `frame` in bytes, at least 16; MBM_MAX_FRAME holds every frame
 * @return a status; see mbm_server_beginRtu
 */
uint8_t mbm_server_beginRtuOverTcp(struct mbm_server *server,
                                   const struct mbm_port *port,
                                   struct mbm_unit *units,
                                   uint8_t count,
                                   uint8_t *frame,
                                   uint16_t bytes);

/**
 * Polls the server, without waiting: receives bytes, carries out a complete request, and
 * sends the response.
 *
 * Call it often: at least once per character time of the line if nothing else buffers
 * received bytes. On a serial line the response starts with the first call after the
 * line has been silent for t3.5.
 *
 * @param server  the object
 * @return a status; MBM_LINK_LOST if the port reported that the connection is lost: close it;
 *         MBM_MALFORMED_FRAME if the bytes received over TCP are not Modbus: close the
 *         connection
 */
uint8_t mbm_server_poll(struct mbm_server *server);

/**
 * Returns how long the program may sleep before the next mbm_server_poll, unless bytes
 * arrive earlier.
 *
 * @param server  the object
 * @return microseconds. 0: poll now; a call from within a hook of this server returns 0 too.
 *         0xFFFFFFFF: sleep until the port has bytes to read; also for NULL and for a server
 *         that was never begun. 1000: a function of yours has returned MBM_REPLY_PENDING, or a
 *         connection does not accept the response yet; the server receives no bytes meanwhile,
 *         so do not wait for one, but poll earlier if you know that the function or the
 *         connection is ready. Afterwards, and after a begin function, it is 0 until
 *         mbm_server_poll has read the port, so bytes that arrived meanwhile need not end a
 *         sleep
 */
uint32_t mbm_server_pollDelay(const struct mbm_server *server);

/**
 * Sets the silence that ends a frame. In RTU it is t3.5, in ASCII the longest time
 * between two characters, in RTU over TCP the silence after a damaged frame. It has no
 * effect in TCP. The begin functions restore the default.
 *
 * @param server     the object
 * @param silenceUs  microseconds since the last received byte; a value above 2^31 (36 minutes)
 *                   counts as 2^31
 * @return a status
 */
uint8_t mbm_server_setSilence(struct mbm_server *server, uint32_t silenceUs);

/**
 * Sets the baud rate from which an RTU server computes t3.5 (serial line guide V1.02,
 * 2.5.1.1). It does not change the rate of the line. Other framings do not use t3.5: see
 * mbm_server_setSilence.
 *
 * @param server  the object
 * @param baud    bits per second; 0 if the rate is unknown, as after mbm_server_beginRtu
 * @return a status; MBM_INVALID_ARGUMENT for other framings
 */
uint8_t mbm_server_setBaudRate(struct mbm_server *server, uint32_t baud);

/**
 * Sets whether the server discards its own echo: on an RTU line whose receiver also
 * receives what the driver sends, the server then drops as many bytes after each
 * response as it has sent. mbm_server_beginRtu switches it off.
 *
 * @param server  the object
 * @param on      0 for off, the default; anything else for on
 * @return a status; MBM_INVALID_ARGUMENT for other framings
 */
uint8_t mbm_server_setEchoDiscard(struct mbm_server *server, uint8_t on);

/* ==== 10. Units ===================================================================== */

/** A function of yours returns this, or-ed with the exception code (1 to 127), to answer
 *  with an exception. */
#define MBM_REPLY_EXCEPTION 256u
/** A function of yours returns this to send no response. */
#define MBM_REPLY_NONE 512u
/** A function of yours returns this if it has not finished. The next poll calls it again
 *  with the same request. The server receives nothing meanwhile. */
#define MBM_REPLY_PENDING 768u
/** A function of yours returns this to decline the request: the next record of the unit that
 *  serves the function code answers, or exception 01 if there is none. */
#define MBM_REPLY_DECLINED 1024u
/** The most records that one unit can serve. Each is one struct that you pass to a
 *  mbm_unit_serve function. */
#define MBM_MAX_SERVICES 16

/**
 * The head of each record that a mbm_unit_serve function takes. Private.
 */
typedef struct mbm_service {
    /** Serves a request if its function belongs to this record. NULL in a zeroed record,
     *  which serves nothing. */
    size_t (*serve)(struct mbm_service *service, uint8_t *pdu, const void *info);
    /** The kind of the record within its family, from 1 on; 0 in a zeroed record. */
    uint8_t kind;
} mbm_service;

/**
 * The counters, the event log and the listen only mode of a unit. Initialise the struct with
 * MBM_INIT and pass it to mbm_unit_serveDiagnostics. The counters wrap at 65536; you may read
 * them at any time. The sub-functions below are those of function 08 (V1.1b3, 6.8), in hex.
 */
typedef struct mbm_diagnostics {
    /** Private. */
    struct mbm_service service;
    /** Optional: called when the client restarts the communications (sub-function 01).
     *  `clearLog` is 1 if the client cleared the event log too, else 0. */
    void (*restart)(void *context, uint8_t clearLog);
    /** Passed to `restart`. Any value; may be NULL. */
    void *context;
    /** The value that sub-function 02 returns. You set it. */
    uint16_t diagnosticRegister;
    /** Sub-function 0B: frames with a right CRC, for any unit. */
    uint16_t busMessages;
    /** Sub-function 0C: damaged frames. */
    uint16_t busCommunicationErrors;
    /** Sub-function 0D: exceptions, including those that broadcasts caused. */
    uint16_t exceptionErrors;
    /** Sub-function 0E: requests for this unit, and broadcasts. */
    uint16_t serverMessages;
    /** Sub-function 0F: requests without a response. */
    uint16_t noResponses;
    /** Sub-function 10: exceptions with code 07. */
    uint16_t naks;
    /** Sub-function 11: exceptions with code 06. */
    uint16_t busy;
    /** Sub-function 12: frames that were too long for the buffer. */
    uint16_t characterOverruns;
    /** The event count that function 0B returns: requests that were carried out. */
    uint16_t events;
    /** 1 in listen only mode, else 0. */
    uint8_t listenOnly;
    /** Private. */
    uint8_t hidden[67];
} mbm_diagnostics;

/**
 * A unit that servers answer for. Initialise it with MBM_INIT, set `id`, and call the
 * mbm_unit_serve functions, for example mbm_unit_serveCoils, for what it serves.
 *
 * Each mbm_unit_serve function takes a record: a struct of yours, which must stay valid
 * for as long as the unit is used. A unit has places for MBM_MAX_SERVICES records; one
 * more returns MBM_BUFFER_TOO_SMALL. You may pass a record again, also after you have
 * zeroed and refilled it; it keeps its place. A zeroed record serves nothing until you
 * pass it again. Any number of units may share one record.
 *
 * A unit may have several tables of one kind, for example holding registers 0 to 9 and
 * 40000 to 40099; the same holds for callbacks, files and FIFO queues. The unit asks them
 * in the order in which they were registered. The first one that has all cells of a request
 * answers it. If none has all of them, the unit answers with exception 02, also where
 * several have them together.
 */
typedef struct mbm_unit {
    /** Private: the records in the order in which the unit calls them. NULL follows the
     *  last one. */
    struct mbm_service *services[MBM_MAX_SERVICES];
    /** Private: NULL in a unit without diagnostics. */
    size_t (*monitor)(struct mbm_unit *unit,
                      const void *info,
                      uint8_t addressing,
                      uint8_t *pdu);
    /** Private. */
    struct mbm_diagnostics *diagnostics;
    /** The unit id, 1 to 247 (serial line guide V1.02, 2.2). The ids 248 to 255, which
     *  the standard reserves, are accepted. 0 answers to every id. A unit without any
     *  record does not answer. A begin function of a server refuses a greater id
     *  (MBM_INVALID_ARGUMENT). If you set one later, no request has it. */
    uint16_t id;
} mbm_unit;

/**
 * A request that reads or writes cells of yours, as your hooks get it. A cell is a register,
 * a coil, a discrete input or a record of a file.
 */
typedef struct mbm_access {
    /** The new values, in the hooks of a write: registers and records with the high byte
     *  first, bits with the lowest bit of the first byte first. NULL in beforeRead. Valid
     *  until the hook returns. */
    const uint8_t *data;
    /** The line or connection that the request came from: the `context` of the port of the
     *  server that received it, or the `connection` of mbm_unit_respond. */
    void *connection;
    /** The address of the first cell; of a file, the number of the first record. */
    uint16_t address;
    /** How many cells, 1 to 2000. */
    uint16_t quantity;
    /** The number of the file; 0 for tables and callbacks. */
    uint16_t file;
    /** The unit id in the request. 0 on a serial line is a broadcast. */
    uint8_t unit;
    /** The function code of the request. */
    uint8_t function;
} mbm_access;

/**
 * Functions of yours that the server calls around a read or a write of cells. Each is
 * optional. Pass the struct to mbm_registerTable_setHooks, mbm_bitTable_setHooks,
 * mbm_dataCallbacks_setHooks or mbm_files_setHooks. It may be a constant, and any number
 * of records may share it.
 *
 * The server calls the hooks only for a request that is right and whose cells all exist.
 * Functions 16 and 17 (hex) read and write: for them the server calls beforeRead,
 * beforeWrite and afterWrite in this order. A request of function 14 or 15 (hex) has one or
 * more groups of records, and the server calls each hook once for each group. It calls
 * beforeWrite for all groups before it writes any of them.
 *
 * A hook may change cells. It may call any function of this library but those on the
 * server that calls it, which return MBM_BUSY. If it changes its record, or sets other
 * hooks for it, that counts from the next request on.
 */
typedef struct mbm_accessHooks {
    /** Your pointer, passed to each hook; may be NULL. */
    void *context;
    /** Called before cells are read. It may refresh them. Returns 0 to allow the read, or an
     *  exception code to refuse the whole request; a number above 127 becomes exception 04. */
    uint8_t (*beforeRead)(void *context, const struct mbm_access *access);
    /** Called before cells are written. Returns as beforeRead. */
    uint8_t (*beforeWrite)(void *context, const struct mbm_access *access);
    /** Called after cells were written. */
    void (*afterWrite)(void *context, const struct mbm_access *access);
} mbm_accessHooks;

/**
 * The hooks of a record. Private.
 */
typedef struct mbm_recordHooks {
    /** The hooks. */
    const struct mbm_accessHooks *hooks;
    /** Calls the hooks. NULL if there are none. A program in which no record has hooks does
     *  not contain the function. */
    void (*call)(void);
} mbm_recordHooks;

/**
 * Cells that your functions get and set one by one, in place of an array. A cell is a
 * register, a coil or a discrete input. Initialise the struct with MBM_INIT, set the fields
 * that you need, and pass it to mbm_unit_serveCallbacks.
 */
typedef struct mbm_dataCallbacks {
    /** Private. */
    struct mbm_service service;
    /** Passed to each function. Any value; may be NULL. */
    void *context;
    /** Optional; NULL if every address exists. Otherwise returns 1 if this address
     *  exists, else 0. A request for an address that does not exist is answered with
     *  exception 02. */
    uint8_t (*isValid)(void *context, uint16_t address);
    /** Required. Returns the value of an existing cell; of a bit, 0 for off and any other
     *  value for on. */
    uint16_t (*get)(void *context, uint16_t address);
    /** Sets an existing cell; a bit to 0 or 1. Coils and holding registers without it are
     *  read-only: the unit answers functions that write them with exception 01, unless a
     *  later record serves these functions. */
    void (*set)(void *context, uint16_t address, uint16_t value);
    /** Private: see mbm_dataCallbacks_setHooks. */
    struct mbm_recordHooks hooks;
} mbm_dataCallbacks;

/**
 * A request for a function of yours.
 */
typedef struct mbm_request {
    /** The data of the request: the bytes after the function code. */
    const uint8_t *data;
    /** The line or connection that the request came from: the `context` of the port of the
     *  server that received it, or the `connection` of mbm_unit_respond. */
    void *connection;
    /** Length of `data` in bytes, 0 to 252. */
    uint16_t length;
    /** The unit id in the request. 0 on a serial line is a broadcast: the server then
     *  sends no response. */
    uint8_t unit;
    /** The function code. */
    uint8_t function;
} mbm_request;

/**
 * A function of yours. Initialise the struct with MBM_INIT, set the fields that you need, and
 * pass it to mbm_unit_serveCustom.
 *
 * A unit asks its records in the order in which they were registered. So a function that is
 * registered before the record that serves the same code is asked first. It answers the
 * request itself, for example with an exception, or it returns MBM_REPLY_DECLINED: then the
 * record after it answers. A function that is registered after tables with its code is asked
 * for the cells that they lack; a function with code 0 is not.
 */
typedef struct mbm_custom {
    /** Private. */
    struct mbm_service service;
    /** Carries out a request and writes the data of the response, without the function
     *  code, to `response`. `capacity` is the space in bytes that the frame buffer has
     *  after the request; the server sends at most 252 bytes. Returns the number of bytes
     *  written, or MBM_REPLY_EXCEPTION | code, or MBM_REPLY_NONE, MBM_REPLY_PENDING or
     *  MBM_REPLY_DECLINED. */
    uint16_t (*serve)(void *context,
                      const struct mbm_request *request,
                      uint8_t *response,
                      uint16_t capacity);
    /** Passed to `serve`. Any value; may be NULL. */
    void *context;
    /** The function code, 1 to 127. 0 means every function that no earlier record of the
     *  unit serves. The standard reserves 65 to 72 and 100 to 110 for users (V1.1b3, 5). */
    uint8_t code;
    /** The length of the request PDUs, which a server of RTU over TCP needs. If it is
     *  zeroed, a request is complete when its CRC is right. */
    struct mbm_rule length;
} mbm_custom;

/**
 * The functions that a unit answers with exception 01, even if it could serve them: see
 * mbm_unit_switchFunction.
 */
typedef struct mbm_functionMask {
    /** Private. */
    struct mbm_service service;
    /** Private. */
    uint8_t off[16];
} mbm_functionMask;

/**
 * One file: an array of records. A record is one register.
 */
typedef struct mbm_file {
    /** The records, starting with record 0. */
    uint16_t *records;
    /** How many records the file has, at most 10000. */
    uint16_t size;
    /** The file number, 1 to 65535. */
    uint16_t number;
} mbm_file;

/**
 * Files of yours. Initialise the struct with MBM_INIT, set the fields that you need, and pass
 * it to mbm_unit_serveFiles.
 */
typedef struct mbm_files {
    /** Private. */
    struct mbm_service service;
    /** The files: an array of `count` elements. */
    const struct mbm_file *files;
    /** How many files. */
    uint16_t count;
    /** Private: see mbm_files_setHooks. */
    struct mbm_recordHooks hooks;
} mbm_files;

/**
 * One FIFO queue of registers.
 */
typedef struct mbm_fifo {
    /** The registers, the oldest first. */
    const uint16_t *words;
    /** The address of the queue (the FIFO pointer address). */
    uint16_t address;
    /** How many registers the queue holds now. If there are more than 31, the server
     *  answers with exception 03 (V1.1b3, 6.18). */
    uint16_t count;
} mbm_fifo;

/**
 * FIFO queues of yours. Initialise the struct with MBM_INIT, set `fifos` and `count`, and
 * pass it to mbm_unit_serveFifos.
 */
typedef struct mbm_fifos {
    /** Private. */
    struct mbm_service service;
    /** The queues: an array of `count` elements. A read leaves the registers in the
     *  queue. */
    const struct mbm_fifo *fifos;
    /** How many queues. */
    uint16_t count;
} mbm_fifos;

/**
 * The eight exception status outputs of function 07. Initialise the struct with MBM_INIT and
 * pass it to mbm_unit_serveExceptionStatus.
 */
typedef struct mbm_exceptionStatus {
    /** Private. */
    struct mbm_service service;
    /** The outputs, one bit each. You may change them at any time. */
    uint8_t outputs;
} mbm_exceptionStatus;

/**
 * The response of function 11 (hex), Report Server ID. Initialise the struct with MBM_INIT,
 * set the fields that you need, and pass it to mbm_unit_serveServerId. The id, the run
 * indicator (1 byte) and the additional data together have at most 251 bytes, fewer if the
 * frame buffer holds less than a whole frame. If they are longer, the server answers with
 * exception 04.
 */
typedef struct mbm_serverId {
    /** Private. */
    struct mbm_service service;
    /** The server id; NULL only if idLength is 0. */
    const uint8_t *id;
    /** The data after the run indicator; NULL only if additionalLength is 0. */
    const uint8_t *additional;
    /** Length of `id` in bytes. */
    uint8_t idLength;
    /** Length of `additional` in bytes. */
    uint8_t additionalLength;
    /** The run indicator: 0 is sent as 00, any other value as FF (hex). */
    uint8_t running;
} mbm_serverId;

/**
 * A device identification. Initialise the struct with MBM_INIT, set `objects` and `count`,
 * and pass it to mbm_unit_serveIdentification.
 */
typedef struct mbm_serverIdentification {
    /** Private. */
    struct mbm_service service;
    /** The objects, in any order. Every device has the ids 0 (vendor name), 1 (product
     *  code) and 2 (revision). Optional are 3 (vendor URL), 4 (product name), 5 (model
     *  name) and 6 (application name), and from 0x80 on your own. An object has at most
     *  244 bytes. */
    const struct mbm_object *objects;
    /** How many objects. */
    uint16_t count;
} mbm_serverIdentification;

/**
 * Holding registers or input registers in an array of yours. Initialise the struct with
 * MBM_INIT, set the fields that you need, and pass it to mbm_unit_serveHoldingRegisters or
 * mbm_unit_serveInputRegisters. You may change the registers at any time, and the fields too,
 * except from within a hook of this table: the server finishes a request with the `words`
 * that the table had when the request came. To serve the struct as another kind of table,
 * zero it first.
 */
typedef struct mbm_registerTable {
    /** Private. */
    struct mbm_service service;
    /** The registers: `size` words. */
    uint16_t *words;
    /** Optional; NULL if every register exists. Otherwise a bitmap with one bit for each
     *  register, the lowest bit of the first byte first. A request for a register whose
     *  bit is 0 is answered with exception 02. */
    const uint8_t *valid;
    /** Private: see mbm_registerTable_setHooks. */
    struct mbm_recordHooks hooks;
    /** The address of the first register. */
    uint16_t base;
    /** How many registers there are. */
    uint16_t size;
} mbm_registerTable;

/**
 * Coils or discrete inputs in an array of yours, eight bits in a byte, the lowest bit
 * first. Use it as mbm_registerTable, with mbm_unit_serveCoils or
 * mbm_unit_serveDiscreteInputs.
 */
typedef struct mbm_bitTable {
    /** Private. */
    struct mbm_service service;
    /** The bits: `size` bits, in (size + 7) / 8 bytes. */
    uint8_t *bits;
    /** As in mbm_registerTable. */
    const uint8_t *valid;
    /** Private: see mbm_bitTable_setHooks. */
    struct mbm_recordHooks hooks;
    /** The address of the first bit. */
    uint16_t base;
    /** How many bits there are. */
    uint16_t size;
} mbm_bitTable;

/**
 * Serves cells that your functions get and set.
 *
 * @param unit   the unit
 * @param cells  must stay valid for as long as the unit is used
 * @param table  the table, named by the function that reads it: 1 coils (functions 01, 05, 0F),
 *               2 discrete inputs (02), 3 holding registers (03, 06, 10, 16, 17), 4 input
 *               registers (04); functions in hex
 * @return a status; see mbm_unit_serveCoils. MBM_INVALID_ARGUMENT for a NULL `get`
 */
uint8_t mbm_unit_serveCallbacks(struct mbm_unit *unit,
                                struct mbm_dataCallbacks *cells,
                                uint8_t table);

/**
 * Sets the functions that are called around a read or a write of cells, or removes them.
 *
 * @param cells  the cells, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the cells are served; NULL for no hooks
 * @return a status
 */
uint8_t mbm_dataCallbacks_setHooks(struct mbm_dataCallbacks *cells,
                                   const struct mbm_accessHooks *hooks);

/**
 * Serves a function of yours, in every framing.
 *
 * @param unit    the unit
 * @param custom  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveFiles. MBM_INVALID_ARGUMENT for a NULL `serve`, a code
 *         above 127 or an invalid `length`
 */
uint8_t mbm_unit_serveCustom(struct mbm_unit *unit, struct mbm_custom *custom);

/**
 * Switches a function of a unit off or on. The unit answers a function that is off with
 * exception 01, even if a record serves it.
 *
 * @param unit  the unit
 * @param mask  must stay valid for as long as the unit is used; initialised with MBM_INIT.
 *              Units that share a mask have the same functions off
 * @param code  the function code, 1 to 127
 * @param on    0 switches the function off, anything else switches it on
 * @return a status; see mbm_unit_serveFiles
 */
uint8_t mbm_unit_switchFunction(struct mbm_unit *unit,
                                struct mbm_functionMask *mask,
                                uint8_t code,
                                uint8_t on);

/**
 * Serves diagnostics: functions 08, 0B and 0C (hex). Function 08 has the sub-functions
 * of the standard, 00 to 04, 0A to 12 and 14 (hex); it answers others with exception 01
 * (illegal function). After this call the unit counts the frames on its lines and logs
 * events, and a client can force it into listen only mode.
 *
 * @param unit         the unit
 * @param diagnostics  must stay valid for as long as the unit is used. Use one struct for each
 *                     unit: a shared one counts for all units that share it
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveDiagnostics(struct mbm_unit *unit,
                                  struct mbm_diagnostics *diagnostics);

/**
 * Serves files: functions 14 and 15 (hex), Read File Record and Write File Record. A
 * request is carried out completely or not at all. Serving a request takes 250 bytes of
 * stack.
 *
 * @param unit   the unit
 * @param files  must stay valid for as long as the unit is used
 * @return a status; MBM_BUFFER_TOO_SMALL if the unit has MBM_MAX_SERVICES records already
 */
uint8_t mbm_unit_serveFiles(struct mbm_unit *unit, struct mbm_files *files);

/**
 * Sets the functions that are called around a read or a write of records, or removes them.
 * In mbm_access, `file` is the number of the file and `address` the first record.
 *
 * @param files  the files, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the files are served; NULL for no hooks
 * @return a status
 */
uint8_t mbm_files_setHooks(struct mbm_files *files, const struct mbm_accessHooks *hooks);

/**
 * Serves FIFO queues: function 18 (hex), Read FIFO Queue.
 *
 * @param unit   the unit
 * @param fifos  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveFiles
 */
uint8_t mbm_unit_serveFifos(struct mbm_unit *unit, struct mbm_fifos *fifos);

/**
 * Serves function 07, Read Exception Status.
 *
 * @param unit    the unit
 * @param status  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveExceptionStatus(struct mbm_unit *unit,
                                      struct mbm_exceptionStatus *status);

/**
 * Serves function 11 (hex), Report Server ID.
 *
 * @param unit  the unit
 * @param id    must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveServerId(struct mbm_unit *unit, struct mbm_serverId *id);

/**
 * Serves function 2B/0E (hex), Read Device Identification: streams of objects, and
 * single objects. If the objects do not fit into one response, the client reads the rest
 * with further requests. The server computes the conformity level from the objects that
 * exist.
 *
 * @param unit            the unit
 * @param identification  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveIdentification(struct mbm_unit *unit,
                                     struct mbm_serverIdentification *identification);

/**
 * Answers one request without a server: reads a request frame from a buffer and writes
 * the response frame over it.
 *
 * @param units       the units to serve: one unit, or an array of units
 * @param count       how many units
 * @param connection  your pointer, which hooks and functions of yours get as the connection
 *                    that the request came from; may be NULL
 * @param framing     the framing. Its `functions` are not used: units know their own functions
 * @param frame       holds the complete request; receives the response
 * @param length      length of the request in bytes
 * @param capacity    size of `frame` in bytes. 256 hold every response in RTU, 513 in ASCII,
 *                    260 in TCP. A longer response becomes exception 04
 * @param response    receives the length of the response in bytes; 0 without a response: after
 *                    a damaged frame, a request for another unit, a broadcast, and with any
 *                    status but MBM_OK
 * @return a status; MBM_PENDING if a function of yours returned MBM_REPLY_PENDING: write the
 *         request into `frame` again before the next call; MBM_INVALID_ARGUMENT for a unit with
 *         an id above 255
 */
uint8_t mbm_unit_respond(struct mbm_unit *units,
                         uint8_t count,
                         void *connection,
                         const struct mbm_framing *framing,
                         uint8_t *frame,
                         uint16_t length,
                         uint16_t capacity,
                         uint16_t *response);

/**
 * Sets the functions that are called around a read or a write of registers, or removes them.
 *
 * @param table  the table, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the table is served; NULL for no hooks
 * @return a status
 */
uint8_t mbm_registerTable_setHooks(struct mbm_registerTable *table,
                                   const struct mbm_accessHooks *hooks);

/**
 * Sets the functions that are called around a read or a write of bits, or removes them.
 *
 * @param table  the table, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the table is served; NULL for no hooks
 * @return a status
 */
uint8_t mbm_bitTable_setHooks(struct mbm_bitTable *table,
                              const struct mbm_accessHooks *hooks);

/**
 * Serves coils: functions 01, 05 and 0F (hex).
 *
 * @param unit   the unit
 * @param table  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY for a table that is served as another
 *         kind
 */
uint8_t mbm_unit_serveCoils(struct mbm_unit *unit, struct mbm_bitTable *table);

/**
 * Serves discrete inputs: function 02.
 *
 * @param unit   the unit
 * @param table  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveCoils
 */
uint8_t mbm_unit_serveDiscreteInputs(struct mbm_unit *unit, struct mbm_bitTable *table);

/**
 * Serves holding registers: functions 03, 06 and 10 (hex). For functions 16 and 17 too,
 * call mbm_registerTable_serveMaskAndReadWrite afterwards.
 *
 * @param unit   the unit
 * @param table  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveCoils
 */
uint8_t mbm_unit_serveHoldingRegisters(struct mbm_unit *unit,
                                       struct mbm_registerTable *table);

/**
 * Serves input registers: function 04.
 *
 * @param unit   the unit
 * @param table  must stay valid for as long as the unit is used
 * @return a status; see mbm_unit_serveCoils
 */
uint8_t mbm_unit_serveInputRegisters(struct mbm_unit *unit,
                                     struct mbm_registerTable *table);

/**
 * Adds functions 16 and 17 (hex), Mask Write Register and Read/Write Multiple Registers,
 * to a table of holding registers, on every unit that serves the table. It is a function
 * of its own so that firmware without these two is smaller. Call it again after you have
 * zeroed the table.
 *
 * @param table  holding registers that mbm_unit_serveHoldingRegisters accepted
 * @return a status; MBM_INVALID_ARGUMENT for any other table
 */
uint8_t mbm_registerTable_serveMaskAndReadWrite(struct mbm_registerTable *table);

/* ==== 11. Gateway =================================================================== */

/** The `line` of a route for broadcasts: to all lines, one after the other. */
#define MBM_GATEWAY_ALL_LINES 255u
/** The `line` of a route to the gateway's own units: see mbm_gateway_serveUnits. */
#define MBM_GATEWAY_LOCAL 254u

/**
 * A gateway: takes requests from Modbus TCP connections, passes each to the line of its unit,
 * and sends the reply back. mbm_gateway_poll does all of it; no function ever waits.
 *
 * You provide the storage. Initialise it with MBM_INIT. Call mbm_gateway_begin first. Use a
 * gateway, its lines' clients and its own units from one thread, and never from an interrupt.
 *
 * mbm_gateway_poll calls the hooks of the connections' ports and of the lines' ports,
 * `isReady` of the lines, and the functions of the gateway's own units. If one of them calls a
 * function on the gateway, the function returns MBM_BUSY and changes nothing; a getter returns
 * what it returns for an object that was never begun. The same holds for the `done` function
 * of a request of your own that mbm_gateway_poll ends.
 */
typedef struct mbm_gateway {
    /** Private. */
    void *pointers[13];
    /** Private. */
    uint32_t words[2];
} mbm_gateway;

/**
 * Leads requests for a range of unit ids on TCP to a line. A table of routes may be constant.
 * The first route that has the unit id counts. Examples:
 *
 * - {1, 31, 0, 0}: the units 1 to 31, on line 0 with the same ids
 * - {101, 131, 1, 1}: the units 101 to 131, which have the ids 1 to 31 on line 1
 * - {255, 255, 0, 5}: a client that addresses the gateway itself reaches unit 5 on line 0
 *   (messaging on TCP/IP guide V1.0b, 4.4.1.2). The same with 0 instead of 255
 * - {0, 0, 0, 0}: unit 0 is a broadcast on line 0 (serial line guide V1.02, 2.1)
 * - {0, 0, MBM_GATEWAY_ALL_LINES, 0}: unit 0 is a broadcast on each line
 */
typedef struct mbm_gatewayRoute {
    /** The first unit id on TCP, 0 to 255. mbm_gateway_begin refuses a greater number. */
    uint16_t first;
    /** The last unit id on TCP, up to 255. */
    uint16_t last;
    /** The index of the line, MBM_GATEWAY_ALL_LINES or MBM_GATEWAY_LOCAL. */
    uint8_t line;
    /** The id on the line of the unit that is `first` on TCP; the units after it follow, up to
     *  255. 0: the ids on the line are those on TCP. A request whose unit id on the line is 0
     *  is a broadcast. */
    uint16_t unit;
} mbm_gatewayRoute;

/**
 * A line of a gateway. Initialise it with MBM_INIT, then set the fields that you need.
 */
typedef struct mbm_gatewayLine {
    /** The client of the line, in any framing. Begin it before the gateway, with a frame
     *  buffer that holds every frame. Its settings hold: response timeout, retries, quiet
     *  time. You may send requests of your own with it. Do not replace it by another client
     *  while the gateway has open connections. */
    struct mbm_client *client;
    /** Your pointer, passed to `isReady`; may be NULL. */
    void *context;
    /** Optional: called before each request to the line. Returns 1 if the line can take it, 0
     *  if the gateway shall answer with exception 0A, for example because a terminal is not
     *  open. It may call every function on the client except mbm_client_poll, and no function
     *  on the gateway (MBM_BUSY). */
    uint8_t (*isReady)(void *context);
    /** The most requests that the gateway queues in the client at a time, 1 to 16; 0 means 1.
     *  With 1, the clients on TCP take turns with every request. A line that is a TCP
     *  connection can have more under way. */
    uint8_t inFlight;
    /** Private. */
    uint8_t last;
} mbm_gatewayLine;

/**
 * A place for a TCP connection.
 */
typedef struct mbm_gatewayConnection {
    /** Private. */
    struct mbm_port port;
    /** Private. */
    uint32_t words[3];
} mbm_gatewayConnection;

/**
 * A place for a request, which then holds its response. It has about 340 bytes on a 32-bit
 * machine.
 */
typedef struct mbm_gatewayRequest {
    /** Private. */
    struct mbm_clientRequest request;
    /** Private. */
    uint32_t words[5];
    /** Private. */
    uint8_t frame[MBM_MAX_TCP_FRAME];
} mbm_gatewayRequest;

/**
 * What a gateway consists of. The gateway copies this struct, but not what it points to.
 */
typedef struct mbm_gatewayConfig {
    /** The map of units. It may be in flash. */
    const struct mbm_gatewayRoute *routes;
    /** The lines; may be NULL if `lineCount` is 0. */
    struct mbm_gatewayLine *lines;
    /** The places for connections. The index in this array is the connection's number. */
    struct mbm_gatewayConnection *connections;
    /** The places for requests. Each connection always has one. Connections that send several
     *  requests without waiting for the replies share the others. */
    struct mbm_gatewayRequest *requests;
    /** The number of `requests`, at least `connectionCount` and below 65535. */
    uint16_t requestCount;
    /** The number of `routes`, at least 1. */
    uint8_t routeCount;
    /** The number of `lines`, 0 to 253. */
    uint8_t lineCount;
    /** The number of `connections`, at least 1. */
    uint8_t connectionCount;
} mbm_gatewayConfig;

/**
 * Begins a gateway without connections.
 *
 * You may call it again at any time, also with another config. The gateway then gives up all
 * connections and their requests; it cancels those that a line has, and its settings return
 * to their defaults. A call that is refused changes nothing.
 *
 * @param gateway  the object; initialised with MBM_INIT before the first call
 * @param config   what the gateway consists of. What it points to must stay valid, and must be
 *                 used by one gateway only, for as long as the gateway is used; lines,
 *                 connections and requests are initialised with MBM_INIT
 * @return a status; MBM_INVALID_ARGUMENT for fewer requests than connections, a route to a line
 *         that does not exist or to a unit id above 255, and a line without client;
 *         MBM_NOT_INITIALISED if the client of a line was not begun; MBM_BUSY also from within
 *         a hook of a client of its lines
 */
uint8_t mbm_gateway_begin(struct mbm_gateway *gateway,
                          const struct mbm_gatewayConfig *config);

/**
 * Gives the gateway an accepted TCP connection. mbm_gateway_poll then reads its requests and
 * writes their responses. The gateway never opens or closes the socket itself.
 *
 * @param gateway     the object
 * @param connection  the number of a free place, below `connectionCount`
 * @param port        the connection; is copied. Its hooks read, write and micros are required.
 *                    The clocks of all connections count the same time
 * @return a status; MBM_BUSY if the place has an open connection
 */
uint8_t mbm_gateway_open(struct mbm_gateway *gateway,
                         uint8_t connection,
                         const struct mbm_port *port);

/**
 * Gives up a connection and its requests. A request that a line has is cancelled: the device
 * may have received it, and the gateway discards its reply. The place is free then.
 *
 * @param gateway     the object
 * @param connection  the number of the place; nothing happens if it is free already
 * @return a status; MBM_BUSY also from within a hook of a port of its lines
 */
uint8_t mbm_gateway_close(struct mbm_gateway *gateway, uint8_t connection);

/**
 * Returns how a connection is. Call it after mbm_gateway_poll for each connection: if the
 * connection is lost, close its socket, and call mbm_gateway_close or mbm_gateway_open.
 *
 * @param gateway     the object
 * @param connection  the number of the place
 * @return MBM_OK while the connection is open; MBM_LINK_LOST if its port reported that the
 *         connection is lost; MBM_MALFORMED_FRAME if it sent bytes that are not Modbus TCP;
 *         MBM_NOT_INITIALISED for a free place
 */
uint8_t mbm_gateway_status(const struct mbm_gateway *gateway, uint8_t connection);

/**
 * Returns how many requests of a connection are under way: complete, but not answered yet.
 * The connection is not idle while it has one.
 *
 * @param gateway     the object
 * @param connection  the number of the place
 * @return the number of requests; 0 for a free place and for a number out of range
 */
uint16_t mbm_gateway_pending(const struct mbm_gateway *gateway, uint8_t connection);

/**
 * Returns whether the next mbm_gateway_poll reads bytes from a connection. If not, the
 * connection has as many requests under way as it may have, and its next requests wait in its
 * socket: do not wait for bytes of it.
 *
 * @param gateway     the object
 * @param connection  the number of the place
 * @return 1 or 0
 */
uint8_t mbm_gateway_isReading(const struct mbm_gateway *gateway, uint8_t connection);

/**
 * Polls the clients of all lines, receives requests, passes them on, and sends responses.
 * Never waits.
 *
 * Call it often. You need not poll the clients of the lines; you may.
 *
 * @param gateway  the object
 * @return a status; MBM_BUSY also from within a hook of a port of its lines
 */
uint8_t mbm_gateway_poll(struct mbm_gateway *gateway);

/**
 * Returns for how long mbm_gateway_poll will have nothing to do, unless a byte arrives on a
 * line whose client has requests, or on a connection that the gateway reads (see
 * mbm_gateway_isReading), or a connection is lost.
 *
 * @param gateway  the object
 * @return microseconds; 0 means poll now, also from within a hook of the gateway; 0xFFFFFFFF
 *         means that no request is under way. While a connection does not accept a response,
 *         and while a function of the gateway's own units returns MBM_REPLY_PENDING, it is at
 *         most 1000
 */
uint32_t mbm_gateway_pollDelay(struct mbm_gateway *gateway);

/**
 * Sets how many requests of one connection may be under way at once
 * (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 4.4.1). The next
 * requests of the connection wait in its socket.
 *
 * @param gateway  the object
 * @param most     1 to 65535; the default is 65535. Fewer if there are not enough places for
 *                 requests
 * @return a status
 */
uint8_t mbm_gateway_setInFlight(struct mbm_gateway *gateway, uint16_t most);

/**
 * Sets for how long a request may wait until its line is free. After that time the gateway
 * answers it with exception 0A and does not send it. Set it to the time that the clients on
 * TCP wait, less the response timeout of the line: then no device carries out a request that
 * its client has given up.
 *
 * @param gateway  the object
 * @param timeMs   milliseconds, 1 to 1000000 (16 minutes); 0, the default, lets requests wait
 *                 for any time
 * @return a status
 */
uint8_t mbm_gateway_setQueueTime(struct mbm_gateway *gateway, uint32_t timeMs);

/**
 * Serves units of the gateway itself: those that a route to MBM_GATEWAY_LOCAL leads to. The
 * unit ids that such a route maps to are those of the units; 0 and 255 address the first
 * unit. A request for an id that no unit has gets no response.
 *
 * A function of a unit that returns MBM_REPLY_PENDING is called again at each
 * mbm_gateway_poll. Other requests go on meanwhile, also those for the same unit.
 *
 * @param gateway  the object
 * @param units    one unit, or an array of units; must stay valid for as long as the gateway is
 *                 used. Servers may serve the same units. NULL only if `count` is 0
 * @param count    how many units
 * @return a status; MBM_INVALID_ARGUMENT for a unit with an id above 255
 */
uint8_t mbm_gateway_serveUnits(struct mbm_gateway *gateway,
                               struct mbm_unit *units,
                               uint8_t count);

/**
 * Declares functions of your own. The gateway passes on every function. If one of your own is
 * declared, the gateway also checks the length of its requests, and knows on RTU when its
 * replies end without waiting for a silence.
 *
 * @param gateway    the object
 * @param functions  the declarations; they must stay valid for as long as the gateway is used.
 *                   NULL only if `count` is 0
 * @param count      how many declarations
 * @return a status; MBM_INVALID_ARGUMENT for a declaration that is not valid
 */
uint8_t mbm_gateway_setFunctions(struct mbm_gateway *gateway,
                                 const struct mbm_function *functions,
                                 uint8_t count);

/* ==== 12. Values ==================================================================== */

/** Passed to a function: use the order of the mbm_registers. As that order itself:
 *  MBM_ORDER_ABCD. */
#define MBM_ORDER_DEFAULT 0u
/** High word first, high byte first, as most devices do. A is the most significant byte.
 *  Example: 2923517522, which is 0xAE415652, is transmitted as AE41 5652 (hex). */
#define MBM_ORDER_ABCD 1u
/** Low word first, high byte first. The example is transmitted as 5652 AE41. */
#define MBM_ORDER_CDAB 2u
/** High word first, low byte first. The example is transmitted as 41AE 5256. */
#define MBM_ORDER_BADC 3u
/** Low word first, low byte first. The example is transmitted as 5256 41AE. */
#define MBM_ORDER_DCBA 4u
/** mbm_registers.kind: words that may only be read, for example the response words of
 *  mbm_node. */
#define MBM_REGISTERS_OF_WORDS 1u
/** mbm_registers.kind: bytes that may only be read, the high byte of each register first. */
#define MBM_REGISTERS_OF_BYTES 2u
/** mbm_registers.kind: words that may be read and written. */
#define MBM_REGISTERS_INTO_WORDS 3u
/** mbm_registers.kind: bytes that may be read and written, the high byte of each register
 *  first. */
#define MBM_REGISTERS_INTO_BYTES 4u

/**
 * A view of consecutive registers, with the addresses that the device gives them. The
 * view owns nothing: `data` points to memory of the program.
 *
 * mbm_registers_ofWords, ofBytes, intoWords and intoBytes fill the view in. You may also
 * set each field yourself. The get and set functions do not change the view. Several
 * threads may use one view at the same time as long as none of them writes the registers.
 * They return MBM_ILLEGAL_DATA_ADDRESS if a register that they need is not in the view.
 */
typedef struct mbm_registers {
    /** The words or bytes; `kind` says which. If it is NULL, every function returns
     *  MBM_NOT_INITIALISED. */
    const void *data;
    /** The device's address of the first register. */
    uint16_t first;
    /** How many registers; `first + count` is at most 65536. */
    uint16_t count;
    /** One of MBM_REGISTERS_... */
    uint8_t kind;
    /** One of MBM_ORDER_...: the order for calls with MBM_ORDER_DEFAULT. */
    uint8_t order;
} mbm_registers;

/**
 * Packs coils into bytes for a write. The first coil goes into the lowest bit of the
 * first byte (V1.1b3, 6.11). Unused bits of the last byte become 0; the bytes after it do
 * not change.
 *
 * @param coils     one byte for each coil: 0 is off, any other value is on
 * @param quantity  the number of coils, 0 to 65535
 * @param bytes     receives the bits, 8 in each byte
 * @param length    the number of bytes that `bytes` can hold
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing packed
 */
uint8_t mbm_bits_pack(const uint8_t *coils,
                      uint16_t quantity,
                      uint8_t *bytes,
                      uint16_t length);

/**
 * Unpacks the coils or discrete inputs that a read returned in bytes (V1.1b3, 6.1).
 *
 * @param bytes     the bits, 8 in each byte; the first coil is the lowest bit
 * @param length    the number of bytes
 * @param coils     receives one byte for each coil, 0 or 1
 * @param quantity  the number of coils, 0 to 65535
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if `bytes` has fewer bits than `quantity`
 */
uint8_t mbm_bits_unpack(const uint8_t *bytes,
                        uint16_t length,
                        uint8_t *coils,
                        uint16_t quantity);

/**
 * Gets the state of one coil or discrete input of a read, by its address in the device.
 *
 * @param bytes     the bits of the read, 8 in each byte; the first coil is the lowest bit
 * @param first     the address of the first coil of the read
 * @param quantity  the number of coils that were read; `bytes` holds that many bits
 * @param address   the address of the coil
 * @param on        receives 0 or 1
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the read or the read
 *         passes address 65535
 */
uint8_t mbm_bits_isSet(const uint8_t *bytes,
                       uint16_t first,
                       uint16_t quantity,
                       uint16_t address,
                       uint8_t *on);

/**
 * Sets one coil of a write, by its address in the device. The other coils do not change.
 *
 * @param bytes     the bits of the write, 8 in each byte; the first coil is the lowest bit
 * @param first     the address of the first coil of the write
 * @param quantity  the number of coils of the write; `bytes` holds that many bits
 * @param address   the address of the coil
 * @param on        0 is off, any other value is on
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the write or the write
 *         passes address 65535
 */
uint8_t mbm_bits_set(uint8_t *bytes,
                     uint16_t first,
                     uint16_t quantity,
                     uint16_t address,
                     uint8_t on);

/**
 * As mbm_bits_pack, but into words, 16 bits in each word; for example the transmit words
 * of a node.
 *
 * @param coils     one byte for each coil: 0 is off, any other value is on
 * @param quantity  the number of coils, 0 to 65535
 * @param words     receives the bits, 16 in each word
 * @param length    the number of words that `words` can hold
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing packed
 */
uint8_t mbm_bits_packWords(const uint8_t *coils,
                           uint16_t quantity,
                           uint16_t *words,
                           uint16_t length);

/**
 * As mbm_bits_unpack, but from words, for example the response words of a node.
 *
 * @param words     the bits, 16 in each word; the first coil is the lowest bit
 * @param length    the number of words
 * @param coils     receives one byte for each coil, 0 or 1
 * @param quantity  the number of coils, 0 to 65535
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if `words` has fewer bits than `quantity`
 */
uint8_t mbm_bits_unpackWords(const uint16_t *words,
                             uint16_t length,
                             uint8_t *coils,
                             uint16_t quantity);

/**
 * As mbm_bits_isSet, but in words, for example the response words of a node.
 *
 * @param words     the bits of the read, 16 in each word; the first coil is the lowest bit
 * @param first     the address of the first coil of the read
 * @param quantity  the number of coils that were read; `words` holds that many bits
 * @param address   the address of the coil
 * @param on        receives 0 or 1
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the read or the read
 *         passes address 65535
 */
uint8_t mbm_bits_isSetInWords(const uint16_t *words,
                              uint16_t first,
                              uint16_t quantity,
                              uint16_t address,
                              uint8_t *on);

/**
 * As mbm_bits_set, but in words, for example the transmit words of a node.
 *
 * @param words     the bits of the write, 16 in each word; the first coil is the lowest bit
 * @param first     the address of the first coil of the write
 * @param quantity  the number of coils of the write; `words` holds that many bits
 * @param address   the address of the coil
 * @param on        0 is off, any other value is on
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the write or the write
 *         passes address 65535
 */
uint8_t mbm_bits_setInWords(uint16_t *words,
                            uint16_t first,
                            uint16_t quantity,
                            uint16_t address,
                            uint8_t on);

/**
 * Fills in a view of words that were read as registers. The order is MBM_ORDER_ABCD
 * until you set `registers->order`. Nothing is copied: the view always shows the present
 * words.
 *
 * @param registers  the view to fill in; without data after an error
 * @param words      the words, for example the response words of mbm_node; must stay valid
 *                   while the view is used. NULL only if `count` is 0
 * @param count      how many words
 * @param first      the device's address of the first register, 0 to 65535
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the last address is greater than 65535
 */
uint8_t mbm_registers_ofWords(struct mbm_registers *registers,
                              const uint16_t *words,
                              uint16_t count,
                              uint16_t first);

/**
 * As mbm_registers_ofWords, for the data bytes of a reply or a request.
 *
 * @param registers  the view to fill in; without data after an error
 * @param bytes      the bytes, the high byte of each register first (V1.1b3, 4.2); must stay
 *                   valid while the view is used
 * @param length     how many bytes, an even number
 * @param first      the device's address of the first register, 0 to 65535
 * @return a status; see mbm_registers_ofWords. MBM_INVALID_ARGUMENT for an odd length
 */
uint8_t mbm_registers_ofBytes(struct mbm_registers *registers,
                              const uint8_t *bytes,
                              uint16_t length,
                              uint16_t first);

/**
 * As mbm_registers_ofWords, for words that you also write, for example the transmit
 * words of mbm_node.
 *
 * @param registers  the view to fill in; without data after an error
 * @param words      the words to write; must stay valid while the view is used
 * @param count      how many words
 * @param first      the device's address of the first register, 0 to 65535
 * @return a status; see mbm_registers_ofWords
 */
uint8_t mbm_registers_intoWords(struct mbm_registers *registers,
                                uint16_t *words,
                                uint16_t count,
                                uint16_t first);

/**
 * As mbm_registers_ofBytes, for bytes that you also write.
 *
 * @param registers  the view to fill in; without data after an error
 * @param bytes      the bytes to write; must stay valid while the view is used
 * @param length     how many bytes, an even number
 * @param first      the device's address of the first register, 0 to 65535
 * @return a status; see mbm_registers_ofBytes
 */
uint8_t mbm_registers_intoBytes(struct mbm_registers *registers,
                                uint8_t *bytes,
                                uint16_t length,
                                uint16_t first);

/**
 * Reads one bit of a register.
 *
 * @param registers  the registers
 * @param address    the device's address of the register
 * @param bit        0, the least significant, to 15
 * @param on         receives 0 or 1
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getBit(const struct mbm_registers *registers,
                             uint16_t address,
                             uint8_t bit,
                             uint8_t *on);

/**
 * Reads a number of one register, 0 to 65535. For a signed number, pass a pointer to an
 * int16_t, cast to uint16_t *. The order of words has no effect; the order of bytes has.
 *
 * @param registers  the registers
 * @param address    the device's address of the register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      receives the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getUint16(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                uint16_t *value);

/**
 * Reads a number of two registers, 0 to 4294967295. For a signed number (two's
 * complement), pass a pointer to an int32_t, cast to uint32_t *.
 *
 * @param registers  the registers
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      receives the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getUint32(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                uint32_t *value);

/**
 * Reads a number of four registers. For a signed number, pass a pointer to an int64_t,
 * cast to uint64_t *.
 *
 * @param registers  the registers
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      receives the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getUint64(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                uint64_t *value);

/**
 * Reads a float of two registers, an IEEE 754 binary32. Its bits are copied, also those
 * of a NaN.
 *
 * @param registers  the registers
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      receives the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getFloat(const struct mbm_registers *registers,
                               uint16_t address,
                               uint8_t order,
                               float *value);

/**
 * Reads a double of four registers, an IEEE 754 binary64. Its bits are copied. On AVR,
 * where a double of C has 32 bits (-mdouble=32), the number is rounded to the nearest.
 *
 * @param registers  the registers
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      receives the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getDouble(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                double *value);

/**
 * Reads a text. It ends at its first NUL or at the end of its field.
 *
 * The registers of a text follow each other in every order. In an order with the low
 * byte first, the first of two characters is the low byte of a register. Characters are
 * copied without a check, also if they are not ASCII.
 *
 * @param registers  the registers
 * @param address    the device's address of the first register of the field
 * @param length     length of the field in bytes, two for each register; an odd length ends
 *                   with the first character of a register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param text       receives the text and a NUL
 * @param capacity   size of `text` in bytes; `length + 1` are always enough
 * @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if `text` is
 */
uint8_t mbm_registers_getString(const struct mbm_registers *registers,
                                uint16_t address,
                                uint16_t length,
                                uint8_t order,
                                char *text,
                                uint16_t capacity);

/**
 * Reads raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each register
 * is first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low byte, for a
 * device that swaps the bytes of its registers.
 *
 * @param registers  the registers
 * @param address    the device's address of the first register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param bytes      receives the bytes; must not overlap the registers
 * @param length     how many bytes, two for each register; may be odd
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getBytes(const struct mbm_registers *registers,
                               uint16_t address,
                               uint8_t order,
                               uint8_t *bytes,
                               uint16_t length);

/**
 * Writes one bit of a register; the other bits do not change.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the register
 * @param bit        0, the least significant, to 15
 * @param on         0 for off, anything else for on
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setBit(const struct mbm_registers *registers,
                             uint16_t address,
                             uint8_t bit,
                             uint8_t on);

/**
 * Writes a number into one register. The order of words has no effect; the order of
 * bytes has.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setUint16(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                uint16_t value);

/**
 * Writes a number into two registers.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setUint32(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                uint32_t value);

/**
 * Writes a number into four registers.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      points to the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setUint64(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                const uint64_t *value);

/**
 * Writes a float into two registers, as an IEEE 754 binary32. Its bits are copied.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      points to the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setFloat(const struct mbm_registers *registers,
                               uint16_t address,
                               uint8_t order,
                               const float *value);

/**
 * Writes a double into four registers, as an IEEE 754 binary64. On AVR, where a double
 * of C has 32 bits (-mdouble=32), it is converted without loss.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first of its registers
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      points to the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setDouble(const struct mbm_registers *registers,
                                uint16_t address,
                                uint8_t order,
                                const double *value);

/**
 * Writes a text into a field and fills the rest of the field with NULs, in the layout
 * that mbm_registers_getString reads.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first register of the field
 * @param length     length of the field in bytes, two for each register; if it is odd, the byte
 *                   after the field becomes 0 too
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param text       the text; ends with a NUL, which need not fit into the field
 * @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if the text is longer than the
 *         field
 */
uint8_t mbm_registers_setString(const struct mbm_registers *registers,
                                uint16_t address,
                                uint16_t length,
                                uint8_t order,
                                const char *text);

/**
 * Writes raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each
 * register is first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low
 * byte, for a device that swaps the bytes of its registers.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param bytes      the bytes; must not overlap the registers
 * @param length     how many bytes, two for each register; if it is odd, the other byte of the
 *                   last register does not change
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setBytes(const struct mbm_registers *registers,
                               uint16_t address,
                               uint8_t order,
                               const uint8_t *bytes,
                               uint16_t length);

/* ==== 13. Packets =================================================================== */

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

/**
 * An object of a device identification.
 */
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
 * 05 | address, value | address, value
 * 06 | address, value | address, value
 * 07 | | exceptionStatus
 * 08 | subFunction, data | subFunction, data
 * 0B | | commStatus, eventCount
 * 0C | | commStatus, eventCount, messageCount, data (events, the latest first)
 * 0F, 10 | address, quantity, data | address, quantity
 * 11 | | byteCount, data
 * 14 | data (records) | data (records)
 * 15 | data (records) | data (records)
 * 16 | address, andMask, orMask | address, andMask, orMask
 * 17 | address, quantity, writeAddress, writeQuantity, data | data
 * 18 | address | data (registers)
 * 2B, MEI type 0E | meiType, readDeviceIdCode, objectId | see below
 * 2B, others | meiType, data | meiType, data
 * your own | data | data
 *
 * A response of 2B with MEI type 0E has meiType, readDeviceIdCode, conformity, moreFollows,
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

/**
 * The length of a PDU or frame, as far as it is known.
 */
typedef struct mbm_length {
    /** The length in bytes from the first byte on; `kind` says how to read it. */
    uint16_t bytes;
    /** MBM_LENGTH_EXACT, MBM_LENGTH_AT_LEAST, MBM_LENGTH_SILENCE or MBM_LENGTH_UNKNOWN. */
    uint8_t kind;
} mbm_length;

/**
 * Registers of a file: one group of function 14 or 15 (hex), in a request or a response.
 */
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
 * @param framing   the framing of the frame
 * @param packet    the packet, with its unit, and for TCP its transaction
 * @param frame     receives the frame; it must not overlap the packet's data
 * @param capacity  bytes of `frame`; MBM_MAX_FRAME suffice for RTU, MBM_MAX_TCP_FRAME for TCP,
 *                  MBM_MAX_PDU for MBM_FRAMING_NONE, MBM_MAX_ASCII_FRAME for all
 * @param length    receives the frame's length in bytes; 0 if the status is not MBM_OK
 * @return a status; MBM_BUFFER_TOO_SMALL; otherwise the status that mbm_frame_parse would
 *         return for such a frame
 */
uint8_t mbm_frame_build(const struct mbm_framing *framing,
                        const struct mbm_packet *packet,
                        uint8_t *frame,
                        uint16_t capacity,
                        uint16_t *length);

/**
 * Parses a frame into a packet. The packet's data point into the frame.
 *
 * If it returns an exception code for a request, mbm_frame_exception writes the exception
 * that answers the request.
 *
 * Any thread or interrupt may call it.
 *
 * @param framing      the framing of the frame
 * @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
 * @param frame        the frame, from its first byte to its last. An ASCII frame is decoded in
 *                     place, which overwrites it; other frames do not change
 * @param frameLength  the number of bytes of `frame`
 * @param packet       receives the packet. If the frame is valid but its PDU is not, it
 *                     receives only kind, unit, transaction and function. If the frame is not
 *                     valid, it receives only the kind. For MBM_INVALID_ARGUMENT it does not
 *                     change
 * @return MBM_OK, also for an exception. If the frame is not valid: MBM_INCOMPLETE_FRAME,
 *         MBM_MALFORMED_FRAME, or MBM_INVALID_CRC, also for a wrong LRC. If its request is not
 *         valid, the exception that answers it: MBM_ILLEGAL_FUNCTION, MBM_ILLEGAL_DATA_ADDRESS
 *         or MBM_ILLEGAL_DATA_VALUE. If its response is not valid: MBM_MALFORMED_REPLY, or
 *         MBM_INVALID_FUNCTION for a function code that the standard does not define and
 *         `framing` does not declare
 */
uint8_t mbm_frame_parse(const struct mbm_framing *framing,
                        uint8_t kind,
                        uint8_t *frame,
                        uint16_t frameLength,
                        struct mbm_packet *packet);

/**
 * Writes the frame of the exception that answers a request. Pass the status of
 * mbm_frame_parse if that refused the request, or an exception code of your choice if your
 * device refuses it.
 *
 * Any thread or interrupt may call it.
 *
 * @param framing   the framing of the frame
 * @param request   the request, as mbm_frame_parse filled it in
 * @param code      the exception code, 1 to 127, for example MBM_ILLEGAL_FUNCTION
 * @param frame     receives the frame; it may be the buffer of the request's frame
 * @param capacity  bytes of `frame`; 11 always suffice
 * @param length    receives the frame's length in bytes; 0 if the status is not MBM_OK
 * @return a status; MBM_BROADCAST_NOT_ALLOWED for unit 0 on a serial line, which no device
 *         answers; MBM_ILLEGAL_FUNCTION for a function code from 0x80 on, which no exception
 *         can contain; MBM_BUFFER_TOO_SMALL; MBM_INVALID_ARGUMENT also for MBM_FRAMING_NONE
 */
uint8_t mbm_frame_exception(const struct mbm_framing *framing,
                            const struct mbm_packet *request,
                            uint8_t code,
                            uint8_t *frame,
                            uint16_t capacity,
                            uint16_t *length);

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
 * @param framing   the framing of the frame
 * @param kind      MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
 * @param bytes     the frame's first bytes; more may follow
 * @param have      the number of bytes; may be 0
 * @param expected  receives the length; MBM_LENGTH_UNKNOWN and 0 if the status is not MBM_OK
 * @return a status; MBM_MALFORMED_FRAME if no frame starts with these bytes, or if no frame may
 *         be as long as they say
 */
uint8_t mbm_frame_expectedLength(const struct mbm_framing *framing,
                                 uint8_t kind,
                                 const uint8_t *bytes,
                                 uint16_t have,
                                 struct mbm_length *expected);

/**
 * Computes the length of the response frame to a request. If the device refuses the
 * request, it sends an exception instead: 5 bytes in RTU, 9 in TCP, 11 characters in
 * ASCII, 2 for MBM_FRAMING_NONE.
 *
 * Any thread or interrupt may call it. On a Cortex-M it takes 700 bytes of stack.
 *
 * @param framing   the framing of the frame
 * @param request   the request, as for mbm_frame_build
 * @param expected  receives the length. It is MBM_LENGTH_EXACT and 0 for a request that no
 *                  device answers: a broadcast, or 08 with sub-function 04. It is
 *                  MBM_LENGTH_UNKNOWN and 0 if the status is not MBM_OK
 * @return a status; MBM_INVALID_ARGUMENT if the packet is not a request; otherwise the status
 *         for which mbm_frame_build refuses the request
 */
uint8_t mbm_frame_replyLength(const struct mbm_framing *framing,
                              const struct mbm_packet *request,
                              struct mbm_length *expected);

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
uint8_t mbm_frame_looksLikeTcp(const uint8_t *bytes,
                               uint16_t have,
                               uint8_t allowUnknown,
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
uint8_t mbm_packet_nextRecord(const struct mbm_packet *packet,
                              uint16_t *cursor,
                              struct mbm_record *record);

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
uint8_t mbm_packet_nextObject(const struct mbm_packet *packet,
                              uint16_t *cursor,
                              struct mbm_object *object);

/**
 * Adds a record to the data of a packet of function 14 or 15 (hex) that you are going to
 * build. Set the kind and the function of the packet first, and dataLength to 0.
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
uint8_t mbm_packet_addRecord(struct mbm_packet *packet,
                             uint8_t *storage,
                             uint16_t capacity,
                             const struct mbm_record *record);

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
uint8_t mbm_packet_addObject(struct mbm_packet *packet,
                             uint8_t *storage,
                             uint16_t capacity,
                             const struct mbm_object *object);

/**
 * Describes a frame in one line of words, for example
 * "unit 17  request    03 read holding registers  107..109", or
 * "bad CRC, 8 bytes" if the frame is damaged.
 *
 * Any thread or interrupt may call it. On a Cortex-M it takes 1000 bytes of stack.
 *
 * @param framing      the framing of the frame
 * @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
 * @param frame        the frame, from its first byte to its last
 * @param frameLength  the number of bytes of `frame`
 * @param text         receives the line. A zero byte always ends it
 * @param size         bytes of `text`; 200 suffice for most frames, 2295 for all
 * @return a status; MBM_BUFFER_TOO_SMALL if `text` received only the start of the line;
 *         MBM_INVALID_ARGUMENT for MBM_FRAMING_NONE
 */
uint8_t mbm_frame_text(const struct mbm_framing *framing,
                       uint8_t kind,
                       const uint8_t *frame,
                       uint16_t frameLength,
                       char *text,
                       uint16_t size);

/* ==== 14. Sniffer =================================================================== */

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
 * You provide the storage. Initialise it with MBM_INIT. Call one of the mbm_sniffer_begin
 * functions first. Not re-entrant: use one object from one thread, and never from an
 * interrupt; pass bytes from an interrupt through an mbm_ring.
 */
typedef struct mbm_sniffer {
    /** Private. */
    void *pointers[1];
    /** Private. */
    uint32_t words[171];
} mbm_sniffer;

/**
 * One event on the bus.
 *
 * Its pointers point into the buffer of the sniffer, and are valid until the next call
 * with that sniffer.
 */
typedef struct mbm_event {
    /** The bytes of the frame; of MBM_EVENT_NOISE all its bytes. An ASCII frame is
     *  decoded: unit id, PDU, LRC. */
    const uint8_t *frame;
    /** The PDU within the frame; NULL without a PDU. */
    const uint8_t *pdu;
    /** The fields of the PDU, as mbm_frame_parse sets them. If the PDU is malformed, and
     *  for MBM_EVENT_TIMEOUT, MBM_EVENT_BAD_CRC and MBM_EVENT_NOISE, only kind, unit,
     *  transaction and function are set. */
    struct mbm_packet packet;
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
    /** MBM_OK; of a request that a server must refuse, the exception for it; of an
     *  exception its code; MBM_MALFORMED_REPLY if a reply does not match its request;
     *  MBM_RESPONSE_TIMED_OUT; MBM_INVALID_CRC; MBM_BUFFER_TOO_SMALL for noise that may
     *  be a frame longer than the buffer. */
    uint8_t status;
    /** The unit that the request addresses, or that replies; for MBM_EVENT_BAD_CRC the
     *  byte at that position. */
    uint8_t unit;
    /** The function code, of an exception the one of the request; for MBM_EVENT_BAD_CRC
     *  the byte at that position. */
    uint8_t function;
    /** The first bytes of the request's PDU: for replies, exceptions and timeouts, and
     *  for MBM_EVENT_UNPAIRED if the reply is late and its request is still known. */
    uint8_t requestHead[9];
    /** How many bytes of requestHead are set; 0 if the request is not known. */
    uint8_t requestHeadLength;
} mbm_event;

/**
 * Begins a sniffer for RTU frames on a serial line.
 *
 * You may call it again at any time. The sniffer then discards received bytes and
 * unanswered requests without an event, and its settings return to their defaults.
 *
 * @param sniffer  the object; initialised with MBM_INIT before the first call
 * @param buffer   holds received bytes until the sniffer has reported them; must stay valid for
 *                 as long as the sniffer is used
 * @param size     size of `buffer` in bytes, at least MBM_MIN_SNIFFER_BUFFER. MBM_MAX_FRAME
 *                 holds every frame; with separate directions use twice as much. A longer frame
 *                 becomes an event of kind MBM_EVENT_NOISE
 * @return a status; MBM_BUFFER_TOO_SMALL for a size that is too small
 */
uint8_t mbm_sniffer_beginRtu(struct mbm_sniffer *sniffer, uint8_t *buffer, uint16_t size);

/**
 * Begins a sniffer for ASCII frames on a serial line.
 *
 * @param sniffer  see mbm_sniffer_beginRtu
 * @param buffer   see mbm_sniffer_beginRtu
 * @param size     see mbm_sniffer_beginRtu; MBM_MAX_ASCII_FRAME holds every frame
 * @return a status; see mbm_sniffer_beginRtu
 */
uint8_t mbm_sniffer_beginAscii(struct mbm_sniffer *sniffer,
                               uint8_t *buffer,
                               uint16_t size);

/**
 * Begins a sniffer for a TCP stream of frames with the MBAP header.
 *
 * @param sniffer  see mbm_sniffer_beginRtu
 * @param buffer   see mbm_sniffer_beginRtu
 * @param size     see mbm_sniffer_beginRtu; MBM_MAX_TCP_FRAME holds every frame
 * @return a status; see mbm_sniffer_beginRtu
 */
uint8_t mbm_sniffer_beginTcp(struct mbm_sniffer *sniffer, uint8_t *buffer, uint16_t size);

/**
 * Begins a sniffer for a TCP stream of RTU frames.
 *
 * @param sniffer  see mbm_sniffer_beginRtu
 * @param buffer   see mbm_sniffer_beginRtu
 * @param size     see mbm_sniffer_beginRtu; MBM_MAX_FRAME holds every frame
 * @return a status; see mbm_sniffer_beginRtu
 */
uint8_t mbm_sniffer_beginRtuOverTcp(struct mbm_sniffer *sniffer,
                                    uint8_t *buffer,
                                    uint16_t size);

/**
 * Declares functions that the standard does not define, in place of those declared
 * before. The sniffer does not know the length of an undeclared function: silence then
 * ends an RTU frame.
 *
 * @param sniffer    the object
 * @param functions  an array that is copied; may be NULL if `count` is 0
 * @param count      how many functions, at most MBM_MAX_SNIFFER_FUNCTIONS
 * @return a status
 */
uint8_t mbm_sniffer_setFunctions(struct mbm_sniffer *sniffer,
                                 const struct mbm_function *functions,
                                 uint8_t count);

/**
 * Sets the character that ends an ASCII frame after CR, LF at first; as
 * mbm_client_setDelimiter. It has no effect in other framings.
 *
 * @param sniffer    the object
 * @param character  1 to 127, except CR, the colon and hexadecimal digits
 * @return a status
 */
uint8_t mbm_sniffer_setDelimiter(struct mbm_sniffer *sniffer, uint8_t character);

/**
 * Sets the baud rate of a serial line. From it the sniffer computes the silence between
 * RTU frames, and the arrival time of each byte if you feed several at once. Without it
 * the silence is 4 ms, and all bytes of one feed count as received at the same time.
 *
 * @param sniffer  the object
 * @param baud     bits per second; 0, the default, if the rate is unknown
 * @return a status
 */
uint8_t mbm_sniffer_setBaudRate(struct mbm_sniffer *sniffer, uint32_t baud);

/**
 * Sets how long the sniffer waits for the reply to a request before it reports
 * MBM_EVENT_TIMEOUT; 1000 ms at first. On a serial line the next request ends the wait
 * too. A timeout longer than the one of the client also pairs late replies with their
 * requests. For ten times the timeout, a reply to a request that has timed out is
 * reported as MBM_EVENT_UNPAIRED with the start of that request (requestHead).
 *
 * @param sniffer    the object
 * @param timeoutMs  1 to 65535 ms
 * @return a status
 */
uint8_t mbm_sniffer_setResponseTimeout(struct mbm_sniffer *sniffer, uint32_t timeoutMs);

/**
 * Sets how long the sniffer waits for the rest of an incomplete frame. Choose it longer
 * than the error of your time stamps. At first it is 50 ms in RTU and RTU over TCP,
 * which suits a USB adapter, and 1000 ms in ASCII and TCP.
 *
 * @param sniffer    the object
 * @param timeoutMs  1 to 65535 ms
 * @return a status
 */
uint8_t mbm_sniffer_setFrameTimeout(struct mbm_sniffer *sniffer, uint32_t timeoutMs);

/**
 * Passes received bytes to the sniffer. Then call mbm_sniffer_next until it returns 0.
 * If the sniffer did not accept all bytes, feed the rest now with the same time; no byte
 * is lost.
 *
 * @param sniffer    the object
 * @param direction  MBM_DIRECTION_BOTH; MBM_DIRECTION_CLIENT or MBM_DIRECTION_SERVER if you
 *                   receive the directions separately. Do not mix MBM_DIRECTION_BOTH with the
 *                   other two: on a change the sniffer discards the bytes that it has not
 *                   reported yet
 * @param bytes      the received bytes; NULL only if `length` is 0
 * @param length     how many bytes
 * @param nowUs      arrival time of the last of the bytes, in microseconds; may wrap
 * @return how many bytes the sniffer accepted; 0 also for a sniffer that was never begun, or
 *         for an invalid argument
 */
uint16_t mbm_sniffer_feed(struct mbm_sniffer *sniffer,
                          uint8_t direction,
                          const uint8_t *bytes,
                          uint16_t length,
                          uint32_t nowUs);

/**
 * Returns the next event on the bus, in order of time. Call it after each feed until it
 * returns 0. Call it also while no bytes arrive, at least every half hour: silence ends
 * frames, and requests time out.
 *
 * On a Cortex-M it takes 750 bytes of stack.
 *
 * @param sniffer  the object
 * @param nowUs    the time now, in microseconds; may wrap
 * @param event    receives the event; the data that it points to are valid until the next call
 *                 with this sniffer
 * @return 1 if there is an event. 0, with `event` unchanged, if there is none yet, for NULL,
 *         and for a sniffer that was never begun
 */
uint8_t mbm_sniffer_next(struct mbm_sniffer *sniffer,
                         uint32_t nowUs,
                         struct mbm_event *event);

/**
 * Writes an event as one line of text, for example
 * "unit 17  reply      03 read holding registers  107..109: 555 0 100".
 *
 * Any thread may call it while the event is valid.
 * On a Cortex-M it takes 550 bytes of stack.
 *
 * @param event  an event that mbm_sniffer_next returned
 * @param text   receives the line; always ends with a NUL
 * @param size   size of `text` in bytes; 200 are enough for most events, 2400 for all
 * @return a status; MBM_BUFFER_TOO_SMALL if the line was cut
 */
uint8_t mbm_event_text(const struct mbm_event *event, char *text, uint16_t size);

/* ==== 15. Trace ===================================================================== */

/** The smallest buffer of a trace, in bytes. */
#define MBM_MIN_TRACE_BUFFER 32
/** The bytes were received. */
#define MBM_TRACE_RECEIVED 0u
/** The bytes were sent. */
#define MBM_TRACE_SENT 1u

/**
 * A trace: stands between a port and the line, client or server that uses it, passes
 * everything on, and calls your hook for each frame that is sent or received.
 *
 * You provide the storage. Initialise it with MBM_INIT. Call mbm_trace_beginClient or
 * mbm_trace_beginServer, then begin the line, client or server with mbm_trace_port instead
 * of your port. The object must not move while its port is in use. A program that begins no
 * trace contains no part of it. Not re-entrant: use it from the thread of the object that
 * uses its port.
 */
typedef struct mbm_trace {
    /** Private. */
    void *pointers[26];
    /** Private. */
    uint32_t words[9];
} mbm_trace;

/**
 * One frame on a line or connection, or bytes that are no frame.
 */
typedef struct mbm_traceRecord {
    /** The bytes as they are on the line. Of a sniffer's event in ASCII they are decoded, from
     *  the unit to the LRC. */
    const uint8_t *bytes;
    /** When the first byte was sent or read, in microseconds by the clock of the port. The
     *  time of a frame that followed other bytes without a pause is estimated. Of a sniffer's
     *  event: when the last byte arrived. */
    uint32_t timeUs;
    /** The number of bytes. */
    uint16_t length;
    /** MBM_TRACE_RECEIVED or MBM_TRACE_SENT. */
    uint8_t direction;
    /** MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions. On a serial
     *  line a received frame may be the echo of a request, or may be meant for others; if a
     *  frame can be both, it is the kind that the other side of this link sends. */
    uint8_t kind;
    /** MBM_OK of a whole frame; MBM_INVALID_CRC if its CRC or LRC is wrong;
     *  MBM_INCOMPLETE_FRAME of the beginning of a frame whose rest did not come;
     *  MBM_MALFORMED_FRAME of bytes that begin no frame; MBM_BUFFER_TOO_SMALL of a piece of
     *  a frame that is longer than half of the trace's buffer. */
    uint8_t status;
} mbm_traceRecord;

/**
 * Begins the trace of a line or client. Then begin that line or client with
 * mbm_trace_port.
 *
 * The hook is called from within the functions of the node or client, when the last byte
 * of a frame was sent or read. Bytes that are not followed by the rest of a frame are handed
 * out at the first read after the frame timeout (see mbm_trace_setFrameTimeout), on a serial
 * line when the next frame is sent, when the link is lost, or by mbm_trace_flush. `record`
 * and its bytes are valid until the hook returns. The hook must not use this trace, nor the
 * object that uses its port: such a call returns MBM_BUSY and changes nothing. On a serial
 * line it should not take longer than a character.
 *
 * You may call this function again at any time, but not from within the hook. The trace then
 * drops the bytes that it has not handed out, and its frame timeout is the default.
 *
 * @param trace    the object; initialised with MBM_INIT before the first call
 * @param port     is copied; its hooks read, write and micros are required. Its optional hooks
 *                 are passed on. It must not be the port of this trace, nor that of a trace
 *                 that passes everything on to this one
 * @param framing  the framing of the object that will use the port, and the declarations of
 *                 your own functions, which must stay valid and unchanged. Without a
 *                 declaration, the end of a received RTU frame is not known from its bytes
 * @param buffer   holds incomplete frames: one half of it those that are sent, the other those
 *                 that are received. It must stay valid for as long as the trace is used
 * @param size     size of `buffer` in bytes, at least MBM_MIN_TRACE_BUFFER. Two times
 *                 MBM_MAX_FRAME, MBM_MAX_ASCII_FRAME or MBM_MAX_TCP_FRAME holds every frame; a
 *                 longer one is handed out in pieces
 * @param hook     is called for each frame
 * @param context  your pointer, passed to `hook`: for example the link or its name
 * @return a status; MBM_BUFFER_TOO_SMALL for a size that is too small; MBM_INVALID_ARGUMENT for
 *         a framing that is not valid
 */
uint8_t mbm_trace_beginClient(struct mbm_trace *trace,
                              const struct mbm_port *port,
                              const struct mbm_framing *framing,
                              uint8_t *buffer,
                              uint16_t size,
                              void (*hook)(void *context,
                                           const struct mbm_traceRecord *record),
                              void *context);

/**
 * Begins the trace of a server. Then begin that server with mbm_trace_port.
 *
 * @param trace    see mbm_trace_beginClient
 * @param port     see mbm_trace_beginClient
 * @param framing  see mbm_trace_beginClient
 * @param buffer   see mbm_trace_beginClient
 * @param size     see mbm_trace_beginClient
 * @param hook     see mbm_trace_beginClient
 * @param context  see mbm_trace_beginClient
 * @return a status; see mbm_trace_beginClient
 */
uint8_t mbm_trace_beginServer(struct mbm_trace *trace,
                              const struct mbm_port *port,
                              const struct mbm_framing *framing,
                              uint8_t *buffer,
                              uint16_t size,
                              void (*hook)(void *context,
                                           const struct mbm_traceRecord *record),
                              void *context);

/**
 * Returns the port that passes everything on to the port of the trace. Pass it to the begin
 * function of a node, client or server.
 *
 * @param trace  the object
 * @return the port, which is valid for as long as the trace is used. NULL for a trace that was
 *         never begun, and from within its hook: the begin functions refuse it
 */
const struct mbm_port *mbm_trace_port(struct mbm_trace *trace);

/**
 * Returns your port, to which the trace passes everything on. Hooks and functions of a server
 * get the context of the server's port as their `connection`, which is the trace: the context
 * of your port is `mbm_trace_innerPort(access->connection)->context`.
 *
 * @param trace  the object
 * @return a copy of your port, valid for as long as the trace is used. NULL for a trace that
 *         was never begun, and from within its hook
 */
const struct mbm_port *mbm_trace_innerPort(const struct mbm_trace *trace);

/**
 * Sets how long the trace waits for the rest of an incomplete frame. At first it is 50 ms in
 * RTU, which suits a USB adapter, and 1000 ms in the other framings.
 *
 * @param trace      the object
 * @param timeoutMs  1 to 65535 ms
 * @return a status
 */
uint8_t mbm_trace_setFrameTimeout(struct mbm_trace *trace, uint32_t timeoutMs);

/**
 * Calls the hook for the bytes that wait for the rest of their frame: before the program
 * ends, or before a link is closed.
 *
 * On a Cortex-M it takes 850 bytes of stack, as every traced frame does.
 *
 * @param trace  the object
 * @return a status
 */
uint8_t mbm_trace_flush(struct mbm_trace *trace);

/**
 * Makes the record of an event of a sniffer, so that one hook serves what this program sends
 * and what it overhears. The direction is MBM_TRACE_RECEIVED; `kind` says whether a client or
 * a server sent the frame.
 *
 * @param event   an event that mbm_sniffer_next returned
 * @param record  receives the record; its bytes are valid as long as those of the event
 * @return a status; MBM_INVALID_ARGUMENT for MBM_EVENT_TIMEOUT, which has no bytes
 */
uint8_t mbm_trace_ofEvent(const struct mbm_event *event, struct mbm_traceRecord *record);

/* ==== 16. Ring ====================================================================== */

/**
 * A receive ring between an interrupt handler and the main loop.
 *
 * The writer, which is an interrupt handler, a DMA callback or a thread, puts bytes in
 * with mbm_ring_put or mbm_ring_write. The reader, which is the main loop in the `read`
 * hook of a port, takes them out with mbm_ring_read. Each may interrupt the other at any
 * point. A ring has only one writer and only one reader at a time. The functions never
 * disable interrupts.
 */
typedef struct mbm_ring {
    /** Private. */
    uint8_t *bytes;
    /** Private. */
    uint16_t size;
    /** Private. */
    uint16_t positions[3];
} mbm_ring;

/**
 * Begins an empty ring over your storage. Neither writer nor reader may use the ring
 * meanwhile.
 *
 * @param ring   the object
 * @param bytes  your storage; it must stay valid for as long as the ring is used
 * @param size   bytes of storage, 2 to 65535, on an AVR 2 to 256. The ring holds one byte less
 * @return a status
 */
uint8_t mbm_ring_begin(struct mbm_ring *ring, uint8_t *bytes, uint16_t size);

/**
 * Puts one byte in. The writer calls it, also from an interrupt.
 *
 * @param ring  the object
 * @param byte  the received byte
 * @return 1; 0 if the ring was full: mbm_ring_lost counts the byte
 */
uint8_t mbm_ring_put(struct mbm_ring *ring, uint8_t byte);

/**
 * Puts bytes in, in order. The writer calls it, also from an interrupt.
 *
 * @param ring    the object
 * @param bytes   the received bytes; NULL only if `length` is 0
 * @param length  the number of bytes
 * @return the number of bytes that the ring took; mbm_ring_lost counts the others
 */
uint16_t mbm_ring_write(struct mbm_ring *ring, const uint8_t *bytes, uint16_t length);

/**
 * Takes bytes out, in order, without waiting. The reader calls it.
 *
 * @param ring      the object
 * @param bytes     receives the bytes; NULL only if `capacity` is 0
 * @param capacity  the number of bytes that `bytes` can hold
 * @return the number of bytes taken out; 0 if the ring was empty
 */
uint16_t mbm_ring_read(struct mbm_ring *ring, uint8_t *bytes, uint16_t capacity);

/**
 * Returns how many bytes mbm_ring_read can take out now. The reader calls it.
 *
 * @param ring  the object
 * @return the number of bytes; 0 also if the ring was never begun
 */
uint16_t mbm_ring_available(const struct mbm_ring *ring);

/**
 * Discards all bytes in the ring. The reader calls it.
 *
 * @param ring  the object
 */
void mbm_ring_clear(struct mbm_ring *ring);

/**
 * Returns how many bytes were lost because the ring was full, since mbm_ring_begin.
 * Writer and reader may call it.
 *
 * @param ring  the object
 * @return the number of bytes; it wraps at 65536, on an AVR at 256
 */
uint16_t mbm_ring_lost(const struct mbm_ring *ring);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_H */
