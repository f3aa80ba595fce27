/**
 * @file mbm/trace.h
 * @brief The trace: calls your hook for each frame sent and received.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_TRACE_H
#define MBM_TRACE_H

#include "functions.h"

#ifdef __cplusplus
extern "C" {
#endif

struct mbm_event;

/* ==== Trace: calls your hook for each frame sent and received ======================= */

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
 * You provide the storage. Initialise it with MBM_INIT. Call mbm_trace_begin, then begin the
 * line, client or server with mbm_trace_port instead of your port. The object must not move
 * while its port is in use. A program that begins no trace contains no part of it. Not
 * re-entrant: use it from the thread of the object that uses its port.
 */
typedef struct mbm_trace {
    void *pointers[26]; /**< Private. */
    uint32_t words[9]; /**< Private. */
} mbm_trace;

/** One frame on a line or connection, or bytes that are no frame. */
typedef struct mbm_traceRecord {
    /** The bytes as they are on the line. For a sniffer's event in ASCII they are decoded, from
     *  the unit to the LRC. */
    const uint8_t *bytes;
    /** When the first byte was sent or read, in microseconds by the clock of the port. The time
     *  of a frame that followed other bytes without a pause is estimated. For a sniffer's event
     *  it is the time at which the last byte arrived. */
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
 * Begins the trace of a line, client or server. Then begin that line, client or server with
 * mbm_trace_port.
 *
 * The hook is called from within the functions of the node, client or server, when the last
 * byte of a frame was sent or read. Bytes of an incomplete frame are handed out at the first
 * read after the frame timeout (see mbm_trace_setFrameTimeout), on a serial line when the next
 * frame is sent, when the link is lost, or by mbm_trace_flush. `record` and its bytes are
 * valid until the hook returns. The hook must not use this trace or the object that uses its
 * port: such a call returns MBM_BUSY and changes nothing. On a serial line it should not take
 * longer than a character.
 *
 * You may call this function again at any time, but not from within the hook. The trace then
 * drops the bytes that it has not handed out, and its frame timeout is the default.
 *
 * @param sends    the frames that the object on the port sends: MBM_PACKET_REQUEST for a line or
 *                 client, MBM_PACKET_RESPONSE for a server
 * @param port     is copied; its hooks read, write and micros are required. Its optional hooks
 *                 are passed on. It must not be the port of this trace or of a trace that
 *                 passes everything on to this one
 * @param framing  the framing of the object that will use the port, and the declarations of your
 *                 own functions, which must stay valid and unchanged. Without a declaration, the
 *                 end of a received RTU frame is not known from its bytes
 * @param buffer   holds incomplete frames: one half of it those that are sent, the other those
 *                 that are received. It must stay valid for as long as the trace is used
 * @param size     size of `buffer` in bytes, at least MBM_MIN_TRACE_BUFFER. Two times
 *                 MBM_MAX_FRAME, MBM_MAX_ASCII_FRAME or MBM_MAX_TCP_FRAME holds every frame; a
 *                 longer one is handed out in pieces
 * @param hook     is called for each frame
 * @param context  your pointer, passed to `hook`: for example the link or its name
 * @return a status; MBM_BUFFER_TOO_SMALL for a size that is too small; MBM_INVALID_ARGUMENT for a
 *         framing or `sends` that is not valid
 */
uint8_t mbm_trace_begin(mbm_trace *trace, uint8_t sends, const mbm_port *port,
                        const mbm_framing *framing, uint8_t *buffer, uint16_t size,
                        void (*hook)(void *context, const mbm_traceRecord *record), void *context);

/**
 * Returns the port that passes everything on to the port of the trace. Pass it to the begin
 * function of a node, client or server.
 *
 * @return the port, which is valid for as long as the trace is used. NULL for a trace that was
 *         never begun, and from within its hook: the begin functions refuse it
 */
const mbm_port *mbm_trace_port(mbm_trace *trace);

/**
 * Sets how long the trace waits for the rest of an incomplete frame. At first it is 200 ms in
 * RTU, which suits a USB adapter and a UART with a FIFO, and 1000 ms in the other framings.
 *
 * @param timeoutMs  1 to 65535 ms
 */
uint8_t mbm_trace_setFrameTimeout(mbm_trace *trace, uint32_t timeoutMs);

/**
 * Calls the hook for the bytes that wait for the rest of their frame: before the program
 * ends, or before a link is closed.
 *
 * On a Cortex-M it takes 850 bytes of stack, as every traced frame does.
 */
uint8_t mbm_trace_flush(mbm_trace *trace);

/**
 * Makes the record of an event of a sniffer, so that one hook serves the frames that this
 * program sends and those that it overhears. The direction is MBM_TRACE_RECEIVED; `kind` says
 * whether a client or a server sent the frame.
 *
 * @param event   an event that mbm_sniffer_next returned
 * @param record  receives the record; its bytes are valid as long as those of the event
 * @return a status; MBM_INVALID_ARGUMENT for MBM_EVENT_TIMEOUT, which has no bytes
 */
uint8_t mbm_trace_ofEvent(const struct mbm_event *event, mbm_traceRecord *record);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_TRACE_H */
