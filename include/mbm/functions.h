/**
 * @file mbm/functions.h
 * @brief Function codes, their lengths, and framings.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_FUNCTIONS_H
#define MBM_FUNCTIONS_H

#include "base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Functions and framings: codes, length rules; RTU, ASCII, TCP ================== */

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
#define MBM_FC_ENCAPSULATED_INTERFACE_TRANSPORT 43u
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
    mbm_rule request;
    /** The length of its responses. */
    mbm_rule response;
} mbm_function;

/**
 * Describes frames: their framing, and the functions of your own in them. As MBM_INIT, it
 * means RTU with the functions of the standard only.
 */
typedef struct mbm_framing {
    /** The declarations of your own functions; may be NULL if `functionCount` is 0. */
    const mbm_function *functions;
    /** The number of declarations in `functions`. */
    uint8_t functionCount;
    /** MBM_FRAMING_RTU, _ASCII, _TCP, _RTU_OVER_TCP or _NONE. */
    uint8_t kind;
    /** ASCII only: the last character of a frame; 0 means line feed (V1.1b3, 6.8.1,
     *  sub-function 03). */
    uint8_t delimiter;
} mbm_framing;

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_FUNCTIONS_H */
