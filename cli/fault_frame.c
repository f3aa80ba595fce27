/* Takes frames apart, puts them together, and makes them wrong.
 *
 * Licence: MIT OR Apache-2.0. */
#include "fault_frame.h"

#include <string.h>

static uint8_t digit(uint8_t character)
{
    return (uint8_t)(character <= '9' ? character - '0' : character - 'A' + 10);
}

void fault_frame_take_apart(uint8_t framing, const uint8_t *frame, uint16_t length, fault_frame *of)
{
    const uint8_t *body = frame;
    uint16_t i;

    of->length = (uint16_t)(length - 2);
    if (framing == MBM_FRAMING_TCP) {
        memcpy(of->header, frame, FAULT_FRAME_HEADER);
        of->length = (uint16_t)(length - FAULT_FRAME_HEADER);
        body += FAULT_FRAME_HEADER;
    } else if (framing == MBM_FRAMING_ASCII) {
        of->length = (uint16_t)((length - 5) / 2);
    }
    if (of->length > MBM_MAX_PDU + 1)
        of->length = MBM_MAX_PDU + 1;
    for (i = 0; i < of->length; i++)
        of->body[i] = framing != MBM_FRAMING_ASCII
                          ? body[i]
                          : (uint8_t)(digit(frame[1 + 2 * i]) << 4 | digit(frame[2 + 2 * i]));
}

uint16_t fault_frame_put_together(uint8_t framing, const fault_frame *of, uint8_t *frame)
{
    const uint16_t length = of->length;
    uint16_t crc, i, at = 0;

    switch (framing) {
    case MBM_FRAMING_TCP:
        memcpy(frame, of->header, FAULT_FRAME_HEADER);
        memcpy(frame + FAULT_FRAME_HEADER, of->body, length);
        return (uint16_t)(FAULT_FRAME_HEADER + length);
    case MBM_FRAMING_ASCII:
        frame[at++] = ':';
        for (i = 0; i <= length; i++) {
            const uint8_t byte = i < length ? of->body[i] : mbm_frame_lrc(of->body, length);

            frame[at++] = (uint8_t) "0123456789ABCDEF"[byte >> 4];
            frame[at++] = (uint8_t) "0123456789ABCDEF"[byte & 15];
        }
        frame[at++] = '\r';
        frame[at++] = '\n';
        return at;
    default:
        memcpy(frame, of->body, length);
        crc = mbm_frame_crc16(of->body, length);
        frame[length] = (uint8_t)crc;
        frame[length + 1] = (uint8_t)(crc >> 8);
        return (uint16_t)(length + 2);
    }
}

void fault_frame_damage(uint8_t framing, uint8_t *frame, uint16_t length)
{
    uint8_t *lrc = &frame[length - 3];

    if (framing == MBM_FRAMING_TCP)
        frame[2] ^= 0xFF;
    else if (framing == MBM_FRAMING_ASCII)
        *lrc = *lrc == '0' ? '1' : '0';
    else
        frame[length - 1] ^= 0xFF;
}

void fault_frame_lengthen(uint8_t framing, fault_frame *of)
{
    static const uint8_t COUNTED[] = {1, 2, 3, 4, 12, 17, 20, 21, 23};

    if (framing == MBM_FRAMING_TCP) {
        if (++of->header[5] == 0)
            of->header[4]++;
    } else if (memchr(COUNTED, of->body[1], sizeof COUNTED)) {
        of->body[2]++;
    } else {
        of->body[of->length++] = 0;
    }
}
