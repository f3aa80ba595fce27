/* Sends the answers of a server with their faults.
 *
 * Licence: MIT OR Apache-2.0. */
#include "fault_port.h"

#include "clock.h"
#include "fault_frame.h"
#include "port_over.h"

#include <string.h>

/* PAUSE: longer than t3.5 of any rate from 9600 baud on, in microseconds. */
enum { PAUSE = 5000 };

static int64_t now_us(void)
{
    return (int64_t)clock_micros(CLOCK_MONOTONIC);
}

static int has(const fault_port *port, enum fault_kind kind)
{
    return port->chosen.has[kind];
}

static uint32_t value(const fault_port *port, enum fault_kind kind)
{
    return port->chosen.value[kind];
}

/* A fault that is there for the whole run. */
static uint32_t lasting(const fault_port *port, enum fault_kind kind)
{
    return fault_value(&port->device->list, kind);
}

int fault_port_is_waiting(const fault_port *port)
{
    return port->piece < port->count || port->refused > 0 || port->is_closing;
}

/* --- the answer --- */

static uint32_t next_random(fault_port *port)
{
    port->random ^= port->random << 13;
    port->random ^= port->random >> 17;
    port->random ^= port->random << 5;
    return port->random;
}

/* Bytes without a pause between them are one piece, so that they are sent at once. */
static void add_piece(fault_port *port, uint32_t pause, const uint8_t *bytes, uint16_t length)
{
    memcpy(port->bytes + port->end, bytes, length);
    port->end = (uint16_t)(port->end + length);
    if (port->count > 0 && pause == 0 && !port->is_datagrams) {
        port->ends[port->count - 1] = port->end;
        return;
    }
    port->pausesUs[port->count] = pause;
    port->ends[port->count++] = port->end;
}

/* Gives an answer the unit and the number of a device that has others. */
static void name_answer(fault_port *port, fault_frame *of)
{
    uint32_t number = value(port, FAULT_TRANSACTION);

    if (has(port, FAULT_UNIT))
        of->body[0] = (uint8_t)value(port, FAULT_UNIT);
    if (!has(port, FAULT_TRANSACTION))
        return;
    if (number == FAULT_OWN_COUNT)
        number = ++port->device->answers;
    else if (number == FAULT_NUMBER_BEFORE)
        number = port->transaction;
    of->header[0] = (uint8_t)(number >> 8);
    of->header[1] = (uint8_t)number;
}

/* Makes the pieces of an answer with the faults that were chosen. */
static void make_pieces(fault_port *port, const uint8_t *answer, uint16_t length)
{
    uint8_t frame[FAULT_FRAME_BYTES], noise[256];
    fault_frame of = {0}, foreign;
    uint16_t count, number;

    fault_frame_take_apart(port->framing, answer, length, &of);
    number = (uint16_t)(of.header[0] << 8 | of.header[1]);
    name_answer(port, &of);
    port->transaction = number;
    if (has(port, FAULT_NOISE)) {
        for (count = 0; count < value(port, FAULT_NOISE); count++)
            noise[count] = (uint8_t)next_random(port);
        add_piece(port, 0, noise, count);
    }
    if (has(port, FAULT_FOREIGN)) {
        foreign = of;
        foreign.body[0] = (uint8_t)(foreign.body[0] >= 247 ? 1 : foreign.body[0] + 1);
        count = fault_frame_put_together(port->framing, &foreign, frame);
        add_piece(port, 0, frame, count);
    }
    if (has(port, FAULT_WRONG_LENGTH))
        fault_frame_lengthen(port->framing, &of);
    count = fault_frame_put_together(port->framing, &of, frame);
    if (has(port, FAULT_DAMAGED))
        fault_frame_damage(port->framing, frame, count);
    if (has(port, FAULT_CUT) && value(port, FAULT_CUT) < count)
        count = (uint16_t)value(port, FAULT_CUT);
    add_piece(port, has(port, FAULT_FOREIGN) ? PAUSE : 0, frame, count);
    if (has(port, FAULT_TWICE))
        add_piece(port, 0, frame, count);
}

static void lose(fault_port *port)
{
    port->is_lost = 1;
    fault_port_end(port);
}

/* --- requests that a device drops while it answers another one --- */

/* Notes the answer to a request that was dropped, if the device says that it is busy. */
static void refuse(fault_port *port)
{
    const fault_walk *walk = &port->walk;
    uint8_t frame[FAULT_FRAME_BYTES];
    fault_frame of = {.header = {walk->head[0], walk->head[1], 0, 0, 0, 3},
                      .body = {walk->head[6], walk->head[7] | 0x80, MBM_SERVER_DEVICE_BUSY},
                      .length = 3};
    uint16_t length;

    if (!lasting(port, FAULT_BUSY) || walk->have < sizeof walk->head)
        return;
    name_answer(port, &of);
    length = fault_frame_put_together(port->framing, &of, frame);
    if (port->refused + length > sizeof port->refusals)
        return;
    memcpy(port->refusals + port->refused, frame, length);
    port->refused = (uint16_t)(port->refused + length);
}

/* Walks over received bytes of Modbus TCP, and moves those of the frames that are not dropped to
 * the front. Returns how many they are. `drops` is about the frames that begin here; the server
 * asks for the bytes of one frame. */
static uint16_t pass(fault_port *port, uint8_t *bytes, uint16_t count, int drops)
{
    fault_walk *walk = &port->walk;
    uint16_t i, passed = 0;

    for (i = 0; i < count; i++) {
        const uint8_t byte = bytes[i];

        if (walk->have == 0)
            walk->drops = (uint8_t)drops;
        if (walk->have < sizeof walk->head)
            walk->head[walk->have] = byte;
        if (walk->have < UINT16_MAX)
            walk->have++;
        if (walk->have == FAULT_FRAME_HEADER)
            walk->left = (uint16_t)(walk->head[4] << 8 | walk->head[5]);
        else if (walk->have > FAULT_FRAME_HEADER)
            walk->left--;
        if (!walk->drops)
            bytes[passed++] = byte;
        if (walk->have < FAULT_FRAME_HEADER || walk->left > 0)
            continue;
        if (walk->drops)
            refuse(port);
        walk->have = 0;
    }
    return passed;
}

/* Reads and drops what has come while another request is answered. */
static void drop_requests(fault_port *port)
{
    uint8_t bytes[MBM_MAX_ASCII_FRAME];
    int16_t count;

    if (!lasting(port, FAULT_ONE_REQUEST))
        return;
    while ((count = port->below.read(port->below.context, bytes, sizeof bytes)) > 0) {
        port->activeUs = port->device->quietUs = now_us();
        if (port->framing == MBM_FRAMING_TCP)
            (void)pass(port, bytes, (uint16_t)count, 1);
    }
    if (count < 0)
        lose(port);
}

/* --- sending --- */

/* How many bytes are handed over at once: all as long as there are no blocks, and the time from
 * one block to the next in microseconds. */
static uint16_t block_of(const fault_port *port, uint32_t *pauseUs)
{
    const uint32_t slow = value(port, FAULT_SLOW) * 1000u, charUs = slow ? slow : port->charUs;
    uint32_t block = has(port, FAULT_BLOCKS) ? value(port, FAULT_BLOCKS) : UINT16_MAX;

    if (has(port, FAULT_BLOCKS_EVERY)) {
        const uint32_t most = value(port, FAULT_BLOCKS_EVERY) * 1000u / charUs;

        *pauseUs = value(port, FAULT_BLOCKS_EVERY) * 1000u;
        if (most >= block)
            *pauseUs = block * charUs;
        else
            block = most ? most : 1;
    } else if (has(port, FAULT_BLOCKS)) {
        *pauseUs = block * charUs;
    } else {
        *pauseUs = slow;
        block = slow ? 1 : UINT16_MAX;
    }
    return (uint16_t)block;
}

/* Sends the refusals between two frames. Returns whether they have left. */
static int send_refusals(fault_port *port)
{
    int16_t count;

    if (port->refused == 0 || (port->sent > 0 && port->piece < port->count))
        return 1;
    count = port->below.write(port->below.context, port->refusals, port->refused);
    if (count < 0) {
        lose(port);
        return 0;
    }
    port->refused = (uint16_t)(port->refused - count);
    memmove(port->refusals, port->refusals + count, port->refused);
    return port->refused == 0;
}

/* Sends what is due of the answer. Returns whether something has left. */
static int send_bytes(fault_port *port)
{
    uint32_t pause;
    const uint16_t block = block_of(port, &pause), end = port->ends[port->piece];
    const uint16_t length = (uint16_t)(end - port->sent);
    const int16_t count = port->below.write(port->below.context, port->bytes + port->sent,
                                            length < block ? length : block);

    if (count < 0)
        lose(port);
    if (count <= 0)
        return 0;
    port->sent = (uint16_t)(port->sent + count);
    port->sinceUs = port->below.micros(port->below.context);
    port->pauseUs = pause;
    port->activeUs = port->device->quietUs = now_us();
    if (port->sent == end && ++port->piece < port->count && port->pausesUs[port->piece] > pause)
        port->pauseUs = port->pausesUs[port->piece];
    return 1;
}

/* Sends what is due. */
static void send_due(fault_port *port)
{
    while (!port->is_lost && fault_port_is_waiting(port)) {
        drop_requests(port);
        if (port->is_lost || !send_refusals(port))
            return;
        if (port->piece == port->count && !port->is_closing)
            return;
        if (port->below.micros(port->below.context) - port->sinceUs < port->pauseUs)
            return;
        if (port->piece == port->count)
            lose(port);
        else if (!send_bytes(port))
            return;
    }
}

/* --- the port --- */

/* Returns the microseconds until the connection was idle for too long. */
static uint32_t idle_delay(const fault_port *port)
{
    const int64_t most = (int64_t)lasting(port, FAULT_CLOSE_IDLE) * 1000;
    int64_t left;

    if (most == 0)
        return UINT32_MAX;
    left = port->activeUs + most - now_us();
    return left > 0 ? (uint32_t)left : 0;
}

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    fault_port *port = (fault_port *)context;
    int16_t count;

    if (port->is_lost)
        return -1;
    count = port->below.read(port->below.context, bytes, capacity);
    if (count == 0 && idle_delay(port) == 0)
        lose(port);
    if (port->is_lost)
        return -1;
    if (count <= 0)
        return count;
    port->activeUs = now_us();
    if (port->beganUs == 0)
        port->beganUs = port->activeUs;
    if (port->framing == MBM_FRAMING_TCP && !port->is_datagrams && lasting(port, FAULT_ONE_REQUEST))
        count = (int16_t)pass(port, bytes, (uint16_t)count, 0);
    return count;
}

/* The server writes an answer at once. */
static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    fault_port *port = (fault_port *)context;
    uint32_t pause;

    if (port->is_lost)
        return -1;
    port->count = port->piece = port->sent = port->end = 0;
    port->sinceUs = port->below.micros(port->below.context);
    port->pauseUs = value(port, FAULT_LATE) * 1000u;
    if (has(port, FAULT_CLOSE)) {
        port->is_closing = 1;
    } else if (!has(port, FAULT_DEAF)) {
        make_pieces(port, bytes, length);
        if (has(port, FAULT_BLOCKS) || has(port, FAULT_BLOCKS_EVERY)) {
            (void)block_of(port, &pause);
            port->pauseUs += pause;
        }
        port->answers++;
        if (lasting(port, FAULT_CLOSE_AFTER) && port->answers >= lasting(port, FAULT_CLOSE_AFTER))
            port->is_closing = 1;
    }
    if (fault_port_is_waiting(port))
        port->device->answering = port;
    send_due(port);
    return (int16_t)length;
}

static uint8_t flush(void *context)
{
    fault_port *port = (fault_port *)context;

    send_due(port);
    if (fault_port_is_waiting(port))
        return 0;
    return port->below.flush ? port->below.flush(port->below.context) : 1;
}

mbm_port fault_port_begin(fault_port *port, fault_device *device, const mbm_port *below,
                          uint8_t framing, int is_datagrams, uint32_t charUs)
{
    mbm_port above;

    memset(port, 0, sizeof *port);
    above = port_over(&port->below, below);
    above.read = read_bytes;
    above.write = write_bytes;
    above.flush = flush;
    port->device = device;
    port->framing = framing;
    port->is_datagrams = (uint8_t)is_datagrams;
    port->charUs = charUs;
    port->random = 1;
    port->openedUs = port->activeUs = now_us();
    return above;
}

void fault_port_end(fault_port *port)
{
    port->count = port->piece = port->refused = port->is_closing = 0;
}

uint32_t fault_port_delay(fault_port *port)
{
    uint32_t passed;

    /* The next read says so. */
    if (port->is_lost)
        return 0;
    if (!fault_port_is_waiting(port))
        return idle_delay(port);
    passed = port->below.micros(port->below.context) - port->sinceUs;
    /* The port below accepts no bytes now. */
    return passed < port->pauseUs ? port->pauseUs - passed : 1000;
}
