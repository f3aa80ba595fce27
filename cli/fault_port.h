/* The port of a server that plays the faults of its answers: changes them, sends them late, in
 * pieces or not at all, and closes its connection. */
#pragma once

#include "fault.h"
#include "mbm.h"

/* Pieces: noise, an answer of another unit, and the answer twice. */
enum { FAULT_PORT_BYTES = 2048, FAULT_PORT_PIECES = 4, FAULT_PORT_REFUSALS = 144 };

/* What the connections of a device share. */
typedef struct fault_device {
    fault_list list;
    int64_t quietUs; /* when the last byte of a request or an answer came or left */
    const struct fault_port *answering;
    uint16_t answers;
} fault_device;

/* The frames of Modbus TCP in what a connection receives. */
typedef struct fault_walk {
    uint8_t head[8]; /* of the frame, up to its function code */
    uint16_t have, left;
    uint8_t drops; /* the frame is dropped */
} fault_walk;

typedef struct fault_port {
    mbm_port below;
    fault_device *device;
    uint8_t framing, is_datagrams, is_lost, is_closing;
    uint32_t charUs;     /* the time of a byte on a serial line */
    fault_choice chosen; /* the faults of the request that is answered; all 0: none */
    /* The answer that is still to be sent: pieces, each after a pause. */
    uint8_t bytes[FAULT_PORT_BYTES];
    uint16_t ends[FAULT_PORT_PIECES];
    uint32_t pausesUs[FAULT_PORT_PIECES];
    uint16_t count, piece, sent, end;
    uint32_t sinceUs, pauseUs; /* the next byte is due `pauseUs` after `sinceUs` */
    uint32_t random;
    /* Answers to requests that were dropped as busy; sent between frames. */
    uint8_t refusals[FAULT_PORT_REFUSALS];
    uint16_t refused;
    fault_walk walk;
    /* The connection, in microseconds: when it was opened, when its last byte came or left, and
     * when the first byte of the request came that is served next; 0: with the one before. */
    int64_t openedUs, activeUs, beganUs;
    uint32_t answers;
    uint16_t transaction; /* of the request before */
} fault_port;

/* Begins it on a port, which may send each frame as a datagram. `charUs` is the time that a byte
 * takes on the line. Returns the port for the server, whose context is the fault_port. */
mbm_port fault_port_begin(fault_port *port, fault_device *device, const mbm_port *below,
                          uint8_t framing, int is_datagrams, uint32_t charUs);

/* The connection was closed: forgets what was to be sent. */
void fault_port_end(fault_port *port);

/* Whether an answer, or the end of the connection, is still to come. */
int fault_port_is_waiting(const fault_port *port);

/* Returns the microseconds until something is due: 0 if the link is lost, UINT32_MAX if nothing is
 * to be sent or closed. */
uint32_t fault_port_delay(fault_port *port);

/* Counts a request, and chooses the faults of its answer for the port that it came from. Returns
 * the exception that answers it, with which it is not carried out, or 0. */
uint8_t fault_device_take(fault_device *device, const mbm_request *request);
