/* Reads --fault, chooses the faults of each request, and changes its answer.
 *
 * Licence: MIT OR Apache-2.0. */
#include "fault.h"

#include "numbers.h"
#include "port_over.h"

#include <stdio.h>
#include <string.h>

enum { VALUE_NONE, VALUE_TIME, VALUE_NUMBER };
enum {
    ON_LINES = 1 << PLACE_RTU | 1 << PLACE_ASCII | 1 << PLACE_PTY,
    ON_STREAMS = 1 << PLACE_TCP | 1 << PLACE_RTU_OVER_TCP | 1 << PLACE_TLS,
    ON_DATAGRAMS = 1 << PLACE_UDP,
    ON_BYTES = ON_LINES | ON_STREAMS,
    ON_ALL = ON_BYTES | ON_DATAGRAMS
};

static const struct {
    const char *name;
    int value, places;
    uint32_t most;
    const char *example;
} KINDS[FAULT_KINDS] = {
    [FAULT_LATE] = {"late", VALUE_TIME, ON_ALL, 600000, "late=750ms"},
    [FAULT_DEAF] = {"deaf", VALUE_NONE, ON_ALL, 0, ""},
    [FAULT_SLOW] = {"slow", VALUE_TIME, ON_BYTES, 10000, "slow=5ms"},
    [FAULT_DAMAGED] = {"damaged", VALUE_NONE, ON_BYTES, 0, ""},
    [FAULT_CUT] = {"cut", VALUE_NUMBER, ON_BYTES, 512, "cut=3"},
    [FAULT_NOISE] = {"noise", VALUE_NUMBER, ON_BYTES, 256, "noise=4"},
    [FAULT_TWICE] = {"twice", VALUE_NONE, ON_ALL, 0, ""},
    [FAULT_EXCEPTION] = {"exception", VALUE_NUMBER, ON_ALL, 127, "exception=6"},
    [FAULT_FOREIGN] = {"foreign", VALUE_NONE, ON_ALL, 0, ""},
    [FAULT_WRONG_LENGTH] = {"wrong-length", VALUE_NONE, ON_BYTES, 0, ""},
    [FAULT_CLOSE] = {"close", VALUE_NONE, ON_STREAMS, 0, ""},
};

/* Lists the faults that a line can have. */
static const char *listed(enum place_kind line, char text[200])
{
    size_t length = 0;
    int kind;

    for (kind = 0; kind < FAULT_KINDS; kind++)
        if (KINDS[kind].places >> line & 1)
            length += (size_t)snprintf(text + length, 200 - length, "%s%s", length ? ", " : "",
                                       KINDS[kind].name);
    return text;
}

/* Reads the value of a fault, which is NULL if there is none. */
static const char *read_value(const char *value, const char *text, fault *one)
{
    const int wanted = KINDS[one->kind].value;
    const char *wrong = NULL;
    int64_t number = 0;

    if (wanted == VALUE_NONE)
        return value ? say("\"%s\": %s has no value", text, KINDS[one->kind].name) : NULL;
    if (!value)
        return say("\"%s\": the value is missing, such as %s", text, KINDS[one->kind].example);
    if (wanted == VALUE_TIME)
        wrong = number_time(value, 1, KINDS[one->kind].most, &one->value);
    else
        wrong = number_read(value, 1, KINDS[one->kind].most, &number);
    if (wrong)
        return say("\"%s\": %s", text, wrong);
    if (wanted == VALUE_NUMBER)
        one->value = (uint32_t)number;
    return NULL;
}

/* Reads N, N- or N/M. */
static const char *read_when(char *when, const char *text, fault *one)
{
    char *slash = strchr(when, '/');
    const size_t length = strlen(when);
    int64_t first, every = 0;
    const char *wrong;

    if (slash)
        *slash = '\0';
    else if (length > 1 && when[length - 1] == '-') {
        when[length - 1] = '\0';
        every = 1;
    }
    wrong = number_read(when, 1, UINT32_MAX, &first);
    if (!wrong && slash)
        wrong = number_read(slash + 1, 1, UINT32_MAX, &every);
    if (wrong)
        return say("\"%s\": after @ stand N, N- or N/M, such as @3, @3- or @3/10; %s", text, wrong);
    one->first = (uint32_t)first;
    one->every = (uint32_t)every;
    return NULL;
}

const char *fault_read(fault_list *list, const char *text, enum place_kind line)
{
    fault *one = &list->faults[list->count];
    char copy[80], names[200], *when, *value;
    const char *wrong;
    int kind = 0;

    if (list->count == FAULT_MOST)
        return say("there are more than %d faults", FAULT_MOST);
    if ((size_t)snprintf(copy, sizeof copy, "%s", text) >= sizeof copy)
        return say("a fault is too long");
    when = strchr(copy, '@');
    if (when)
        *when++ = '\0';
    value = strchr(copy, '=');
    if (value)
        *value++ = '\0';
    while (kind < FAULT_KINDS && strcmp(KINDS[kind].name, copy) != 0)
        kind++;
    if (kind == FAULT_KINDS)
        return say("\"%s\" is no fault: on this line they are %s", copy, listed(line, names));
    if (!(KINDS[kind].places >> line & 1))
        return say("\"%s\": this line cannot have it: it can have %s", copy, listed(line, names));
    *one = (fault){.kind = (enum fault_kind)kind, .first = 1, .every = 1};
    wrong = read_value(value, text, one);
    if (!wrong && when)
        wrong = read_when(when, text, one);
    if (!wrong)
        list->count++;
    return wrong;
}

void fault_choose(fault_list *list, fault_choice *choice)
{
    const uint32_t number = ++list->requests;
    uint32_t i, chosen = 0;

    memset(choice, 0, sizeof *choice);
    for (i = 0; i < list->count; i++) {
        const fault *one = &list->faults[i];

        if (number != one->first &&
            (one->every == 0 || number < one->first || (number - one->first) % one->every != 0))
            continue;
        choice->has[one->kind] = 1;
        choice->value[one->kind] = one->value;
        chosen = 1;
    }
    list->hit += chosen;
}

/* --- frames --- */

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

static uint8_t digit(uint8_t character)
{
    return (uint8_t)(character <= '9' ? character - '0' : character - 'A' + 10);
}

/* Takes apart a frame that the server has built. */
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

/* Makes the length or the byte count in the frame wrong. */
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
    port->pausesUs[port->count] = pause;
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

        if (now - port->sinceUs < port->pauseUs)
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
        port->sinceUs = now;
        port->pauseUs = slow;
        if (port->sent == port->ends[port->piece] && ++port->piece < port->count &&
            port->pausesUs[port->piece] > slow)
            port->pauseUs = port->pausesUs[port->piece];
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
    port->sinceUs = port->below.micros(port->below.context);
    port->pauseUs = port->chosen.has[FAULT_LATE] ? port->chosen.value[FAULT_LATE] * 1000u : 0;
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

mbm_port fault_port_begin(fault_port *port, const mbm_port *below, uint8_t framing,
                          int is_datagrams)
{
    mbm_port above;

    memset(port, 0, sizeof *port);
    above = port_over(&port->below, below);
    above.read = read_bytes;
    above.write = write_bytes;
    above.flush = flush;
    port->framing = framing;
    port->is_datagrams = (uint8_t)is_datagrams;
    port->random = 1;
    return above;
}

uint32_t fault_port_delay(fault_port *port)
{
    const uint32_t passed = port->below.micros(port->below.context) - port->sinceUs;

    /* The next read says so. */
    if (port->is_lost)
        return 0;
    if (!is_waiting(port))
        return UINT32_MAX;
    /* The port below accepts no bytes now. */
    return passed < port->pauseUs ? port->pauseUs - passed : 1000;
}
