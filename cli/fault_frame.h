/* The answers of a server, taken apart so that a fault can change them.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef FAULT_FRAME_H
#define FAULT_FRAME_H

#include "mbm.h"

#include <stdint.h>

/* The bytes before the unit on Modbus TCP: transaction number, protocol identifier, length. */
enum { FAULT_FRAME_HEADER = 6, FAULT_FRAME_BYTES = MBM_MAX_ASCII_FRAME + 4 };

/* The body of a frame is its unit and PDU. `header` is that of Modbus TCP. */
typedef struct fault_frame {
    uint8_t header[FAULT_FRAME_HEADER];
    uint8_t body[MBM_MAX_PDU + 2];
    uint16_t length; /* of the body */
} fault_frame;

/* Takes apart a frame that the server has built. `framing` is one of MBM_FRAMING_. */
void fault_frame_take_apart(uint8_t framing, const uint8_t *frame, uint16_t length,
                            fault_frame *of);

/* Puts a frame together, in FAULT_FRAME_BYTES. Returns its length. */
uint16_t fault_frame_put_together(uint8_t framing, const fault_frame *of, uint8_t *frame);

/* Damages CRC, LRC or the protocol identifier. */
void fault_frame_damage(uint8_t framing, uint8_t *frame, uint16_t length);

/* Makes the length or the byte count in the frame wrong. */
void fault_frame_lengthen(uint8_t framing, fault_frame *of);

#endif
