/* Refuses and drops requests as devices of the field do, and sends answers with their faults. */
#include "fault_port.h"

#include "clock.h"
#include "port_over.h"

#include <string.h>

/* PAUSE: longer than t3.5 of any rate from 9600 baud on, in microseconds. */
enum { PAUSE = 5000 };

/* --- frames, taken apart so that a fault can change them --- */

/* The bytes before the unit on Modbus TCP: transaction number, protocol identifier, length. */
enum { FRAME_HEADER = 6, FRAME_BYTES = MBM_MAX_ASCII_FRAME + 4 };

/* The body of a frame is its unit and PDU. `header` is that of Modbus TCP. */
typedef struct frame_parts {
    uint8_t header[FRAME_HEADER];
    uint8_t body[MBM_MAX_PDU + 2];
    uint16_t length; /* of the body */
} frame_parts;

static uint8_t digit(uint8_t character)
{
    return (uint8_t)(character <= '9' ? character - '0' : character - 'A' + 10);
}

/* Takes apart a frame that the server has built. `framing` is one of MBM_FRAMING_. */
static void take_apart(uint8_t framing, const uint8_t *frame, uint16_t length, frame_parts *of)
{
    const uint8_t *body = frame;
    uint16_t i;

    of->length = (uint16_t)(length - 2);
    if (framing == MBM_FRAMING_TCP) {
        memcpy(of->header, frame, FRAME_HEADER);
        of->length = (uint16_t)(length - FRAME_HEADER);
        body += FRAME_HEADER;
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

/* Puts a frame together, in FRAME_BYTES. Returns its length. */
static uint16_t put_together(uint8_t framing, const frame_parts *of, uint8_t *frame)
{
    const uint16_t length = of->length;
    uint16_t crc, i, at = 0;

    switch (framing) {
    case MBM_FRAMING_TCP:
        memcpy(frame, of->header, FRAME_HEADER);
        memcpy(frame + FRAME_HEADER, of->body, length);
        return (uint16_t)(FRAME_HEADER + length);
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

/* Makes the length or the byte count in the frame wrong. */
static void lengthen(uint8_t framing, frame_parts *of)
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

/* --- faults --- */

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
static void name_answer(fault_port *port, frame_parts *of)
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
    uint8_t frame[FRAME_BYTES], noise[256];
    frame_parts of = {0}, foreign;
    uint16_t count, number;

    take_apart(port->framing, answer, length, &of);
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
        count = put_together(port->framing, &foreign, frame);
        add_piece(port, 0, frame, count);
    }
    if (has(port, FAULT_WRONG_LENGTH))
        lengthen(port->framing, &of);
    count = put_together(port->framing, &of, frame);
    if (has(port, FAULT_DAMAGED))
        damage(port->framing, frame, count);
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
    uint8_t frame[FRAME_BYTES];
    frame_parts of = {.header = {walk->head[0], walk->head[1], 0, 0, 0, 3},
                      .body = {walk->head[6], walk->head[7] | 0x80, MBM_SERVER_DEVICE_BUSY},
                      .length = 3};
    uint16_t length;

    if (!lasting(port, FAULT_BUSY) || walk->have < sizeof walk->head)
        return;
    name_answer(port, &of);
    length = put_together(port->framing, &of, frame);
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
        if (walk->have == FRAME_HEADER)
            walk->left = (uint16_t)(walk->head[4] << 8 | walk->head[5]);
        else if (walk->have > FRAME_HEADER)
            walk->left--;
        if (!walk->drops)
            bytes[passed++] = byte;
        if (walk->have < FRAME_HEADER || walk->left > 0)
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

/* --- what the device makes of a request --- */

/* Addresses that a request reads or writes. */
typedef struct touched {
    uint16_t address, quantity;
    uint8_t is_bits;
} touched;

static uint16_t word_at(const mbm_request *request, uint16_t at)
{
    return at + 2 <= request->length ? (uint16_t)(request->data[at] << 8 | request->data[at + 1])
                                     : 0;
}

/* Finds the blocks of a request, at most two. Returns how many there are. */
static int find_blocks(const mbm_request *request, touched blocks[2])
{
    const uint16_t first = word_at(request, 0), second = word_at(request, 2);

    switch (request->function) {
    case 1:
    case 2:
    case 15: blocks[0] = (touched){first, second, 1}; return 1;
    case 3:
    case 4:
    case 16: blocks[0] = (touched){first, second, 0}; return 1;
    case 5: blocks[0] = (touched){first, 1, 1}; return 1;
    case 6:
    case 22: blocks[0] = (touched){first, 1, 0}; return 1;
    case 23:
        blocks[0] = (touched){first, second, 0};
        blocks[1] = (touched){word_at(request, 4), word_at(request, 6), 0};
        return 2;
    default: return 0;
    }
}

/* Whether a fault of the device refuses a block. */
static int refuses_block(const fault *one, const touched *of)
{
    switch (one->kind) {
    case FAULT_MOST_REGISTERS: return !of->is_bits && of->quantity > one->value;
    case FAULT_MOST_BITS: return of->is_bits && of->quantity > one->value;
    case FAULT_HOLE:
        return of->address <= one->last && (uint32_t)of->address + of->quantity > one->value;
    default: return 0;
    }
}

/* Returns the exception of a request for a function that the device does not have, or for a block
 * that it refuses; else 0. */
static uint8_t refusal_of(const fault_device *device, const fault_choice *chosen,
                          const mbm_request *request)
{
    const fault_list *list = &device->list;
    int is_missing = 0, is_allowed = !chosen->has[FAULT_ONLY_FUNCTION], is_refused = 0, j;
    touched blocks[2];
    const int count = find_blocks(request, blocks);
    uint32_t i;

    for (i = 0; i < list->count; i++) {
        const fault *one = &list->faults[i];
        const int is_of_function = one->value == request->function;

        if (!fault_is_due(list, one))
            continue;
        is_allowed |= one->kind == FAULT_ONLY_FUNCTION && is_of_function;
        is_missing |= one->kind == FAULT_NO_FUNCTION && is_of_function;
        for (j = 0; j < count; j++)
            is_refused |= refuses_block(one, &blocks[j]);
    }
    if (is_missing || !is_allowed)
        return MBM_ILLEGAL_FUNCTION;
    if (is_refused)
        return chosen->has[FAULT_REFUSED_WITH] ? (uint8_t)chosen->value[FAULT_REFUSED_WITH]
                                               : MBM_ILLEGAL_DATA_ADDRESS;
    return 0;
}

/* Whether the request came too early: after the connection was made, or after the last bytes. */
static int is_early(const fault_device *device, const fault_port *port, int64_t began)
{
    const int64_t delay = (int64_t)port->chosen.value[FAULT_NEEDS_DELAY] * 1000,
                  wait = (int64_t)port->chosen.value[FAULT_NEEDS_MESSAGE_WAIT] * 1000;

    return (delay && began - port->openedUs < delay) || (wait && began - device->quietUs < wait);
}

static int is_answering_another(const fault_device *device, const fault_port *port)
{
    return device->answering && device->answering != port &&
           fault_port_is_waiting(device->answering) &&
           fault_value(&device->list, FAULT_ONE_REQUEST);
}

/* Whether a fault was chosen that changes any answer: those up to FAULT_TRANSACTION do. */
static int is_hit(const fault_choice *chosen)
{
    int kind;

    for (kind = FAULT_LATE; kind <= FAULT_TRANSACTION; kind++)
        if (chosen->has[kind])
            return 1;
    return 0;
}

uint8_t fault_device_take(fault_device *device, const mbm_request *request)
{
    fault_port *port = (fault_port *)request->connection;
    const int64_t now = (int64_t)clock_micros(CLOCK_MONOTONIC);
    const int64_t began = port->beganUs ? port->beganUs : port->activeUs;
    const uint32_t deaf_after = fault_value(&device->list, FAULT_DEAF_AFTER);
    const int is_deaf = deaf_after && port->answers >= deaf_after;
    uint8_t exception;
    int drops;

    device->list.requests++;
    fault_choose(&device->list, &port->chosen);
    drops = is_deaf || is_early(device, port, began) || is_answering_another(device, port);
    port->beganUs = 0;
    device->quietUs = now;
    exception = (uint8_t)port->chosen.value[FAULT_EXCEPTION];
    if (drops) {
        exception = MBM_SERVER_DEVICE_BUSY;
        port->chosen.has[FAULT_DEAF] |= is_deaf || !fault_value(&device->list, FAULT_BUSY);
    } else if (exception == 0) {
        exception = refusal_of(device, &port->chosen, request);
    }
    device->list.hit += drops || exception || is_hit(&port->chosen);
    return exception;
}
