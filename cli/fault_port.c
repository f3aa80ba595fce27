#define _GNU_SOURCE
#include "fault_port.h"

#include <stdio.h>
#include <string.h>

/* PAUSE: longer than t3.5 of any rate from 9600 baud on, in microseconds. */
enum { MBAP = 6, PAUSE = 5000 };

/* The body of a frame is its unit and PDU. `header` is that of Modbus TCP. */
typedef struct parts {
    uint8_t header[MBAP];
    uint8_t body[MBM_MAX_PDU + 2];
    uint16_t length;
} parts;

static uint32_t next_random(fault_port *port)
{
    port->random ^= port->random << 13;
    port->random ^= port->random >> 17;
    port->random ^= port->random << 5;
    return port->random;
}

/* --- frames --- */

static uint8_t digit(uint8_t character)
{
    return (uint8_t)(character <= '9' ? character - '0' : character - 'A' + 10);
}

/* Takes a frame apart, which the server has built. */
static void take_apart(uint8_t framing, const uint8_t *frame, uint16_t length, parts *of)
{
    const uint8_t *body = frame;
    uint16_t i;

    of->length = (uint16_t)(length - 2);
    if (framing == MBM_FRAMING_TCP) {
        memcpy(of->header, frame, MBAP);
        of->length = (uint16_t)(length - MBAP);
        body += MBAP;
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

/* Puts a frame together. Returns its length. */
static uint16_t put_together(uint8_t framing, const parts *of, uint8_t *frame)
{
    const uint16_t length = of->length;
    uint16_t crc, i, at = 0;

    switch (framing) {
    case MBM_FRAMING_TCP:
        memcpy(frame, of->header, MBAP);
        memcpy(frame + MBAP, of->body, length);
        return (uint16_t)(MBAP + length);
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

/* Damages CRC, LRC or the protocol identifier. */
static void damage(uint8_t framing, uint8_t *frame, uint16_t length)
{
    uint8_t *lrc = &frame[length - 3];

    if (framing == MBM_FRAMING_TCP)
        frame[2] ^= 0xFF;
    else if (framing == MBM_FRAMING_ASCII)
        *lrc = *lrc == '0' ? '1' : '0';
    else
        frame[length - 1] ^= 0xFF;
}

/* Makes the length wrong that the frame has of itself. */
static void lengthen(uint8_t framing, parts *of)
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

/* --- what is sent --- */

/* Bytes without a pause between them are one piece, so that they are sent at once. */
static void add_piece(fault_port *port, uint32_t pause, const uint8_t *bytes, uint16_t length)
{
    memcpy(port->bytes + port->end, bytes, length);
    port->end = (uint16_t)(port->end + length);
    if (port->count > 0 && pause == 0 && !port->is_datagrams) {
        port->ends[port->count - 1] = port->end;
        return;
    }
    port->pauses[port->count] = pause;
    port->ends[port->count++] = port->end;
}

/* Makes the pieces of an answer with the faults that were chosen. */
static void make_pieces(fault_port *port, const uint8_t *answer, uint16_t length)
{
    const fault_choice *chosen = &port->chosen;
    uint8_t frame[MBM_MAX_ASCII_FRAME + 4], noise[256];
    parts of = {0}, foreign;
    uint16_t count;

    take_apart(port->framing, answer, length, &of);
    if (chosen->has[FAULT_NOISE]) {
        for (count = 0; count < chosen->value[FAULT_NOISE]; count++)
            noise[count] = (uint8_t)next_random(port);
        add_piece(port, 0, noise, count);
    }
    if (chosen->has[FAULT_FOREIGN]) {
        foreign = of;
        foreign.body[0] = (uint8_t)(foreign.body[0] >= 247 ? 1 : foreign.body[0] + 1);
        count = put_together(port->framing, &foreign, frame);
        add_piece(port, 0, frame, count);
    }
    if (chosen->has[FAULT_WRONG_LENGTH])
        lengthen(port->framing, &of);
    count = put_together(port->framing, &of, frame);
    if (chosen->has[FAULT_DAMAGED])
        damage(port->framing, frame, count);
    if (chosen->has[FAULT_CUT] && chosen->value[FAULT_CUT] < count)
        count = (uint16_t)chosen->value[FAULT_CUT];
    add_piece(port, chosen->has[FAULT_FOREIGN] ? PAUSE : 0, frame, count);
    if (chosen->has[FAULT_TWICE])
        add_piece(port, 0, frame, count);
}

static int is_waiting(const fault_port *port)
{
    return port->piece < port->count || port->is_closing;
}

/* Sends what is due. */
static void send_due(fault_port *port)
{
    const uint32_t slow = port->chosen.has[FAULT_SLOW] ? port->chosen.value[FAULT_SLOW] * 1000u : 0;

    while (is_waiting(port)) {
        const uint32_t now = port->below.micros(port->below.context);
        uint16_t until;
        int16_t count;

        if (now - port->since < port->pause)
            return;
        if (port->is_closing) {
            port->is_closing = 0;
            port->is_lost = 1;
            return;
        }
        until = slow ? (uint16_t)(port->sent + 1) : port->ends[port->piece];
        count = port->below.write(port->below.context, port->bytes + port->sent,
                                  (uint16_t)(until - port->sent));
        if (count < 0)
            port->is_lost = 1;
        if (count < 0)
            port->piece = port->count;
        if (count <= 0)
            return;
        port->sent = (uint16_t)(port->sent + count);
        port->since = now;
        port->pause = slow;
        if (port->sent == port->ends[port->piece] && ++port->piece < port->count &&
            port->pauses[port->piece] > slow)
            port->pause = port->pauses[port->piece];
    }
}

/* --- the port --- */

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    fault_port *port = (fault_port *)context;

    return port->is_lost ? -1 : port->below.read(port->below.context, bytes, capacity);
}

/* The server writes an answer at once. */
static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    fault_port *port = (fault_port *)context;

    if (port->is_lost)
        return -1;
    port->count = port->piece = port->sent = port->end = 0;
    port->since = port->below.micros(port->below.context);
    port->pause = port->chosen.has[FAULT_LATE] ? port->chosen.value[FAULT_LATE] * 1000u : 0;
    if (port->chosen.has[FAULT_CLOSE])
        port->is_closing = 1;
    else if (!port->chosen.has[FAULT_DEAF])
        make_pieces(port, bytes, length);
    send_due(port);
    return (int16_t)length;
}

static uint8_t flush(void *context)
{
    fault_port *port = (fault_port *)context;

    send_due(port);
    if (is_waiting(port))
        return 0;
    return port->below.flush ? port->below.flush(port->below.context) : 1;
}

static uint32_t micros(void *context)
{
    const fault_port *port = (const fault_port *)context;

    return port->below.micros(port->below.context);
}

static void before_sending(void *context)
{
    const fault_port *port = (const fault_port *)context;

    if (port->below.preTransmission)
        port->below.preTransmission(port->below.context);
}

static void after_sending(void *context)
{
    const fault_port *port = (const fault_port *)context;

    if (port->below.postTransmission)
        port->below.postTransmission(port->below.context);
}

mbm_port fault_port_begin(fault_port *port, const mbm_port *below, uint8_t framing,
                          int is_datagrams)
{
    const mbm_port above = {.context = port,
                            .read = read_bytes,
                            .write = write_bytes,
                            .micros = micros,
                            .flush = flush,
                            .preTransmission = before_sending,
                            .postTransmission = after_sending};

    memset(port, 0, sizeof *port);
    port->below = *below;
    port->framing = framing;
    port->is_datagrams = (uint8_t)is_datagrams;
    port->random = 1;
    return above;
}

uint32_t fault_port_delay(fault_port *port)
{
    const uint32_t passed = port->below.micros(port->below.context) - port->since;

    /* The next read says so. */
    if (port->is_lost)
        return 0;
    if (!is_waiting(port))
        return UINT32_MAX;
    /* The port below accepts no bytes now. */
    return passed < port->pause ? port->pause - passed : 1000;
}
