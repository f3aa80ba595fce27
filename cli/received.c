/* Notes the bytes that pass a port, and says in words what is wrong with them. */
#include "received.h"

#include "numbers.h"
#include "port_over.h"

#include <string.h>

enum { MBAP = 7, COUNTED = 6, SHORTEST = 2, LONGEST = 254 };

static unsigned number_at(const uint8_t *bytes)
{
    return (unsigned)bytes[0] << 8 | bytes[1];
}

/* --- the port --- */

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    received *to = (received *)context;
    const int16_t count = to->below.read(to->below.context, bytes, capacity);

    if (count > 0 && to->count < RECEIVED_BYTES) {
        const size_t space = RECEIVED_BYTES - to->count;

        memcpy(to->bytes + to->count, bytes, (size_t)count < space ? (size_t)count : space);
    }
    if (count > 0)
        to->count += (uint16_t)count;
    return count;
}

/* Calls `each` for the frames of Modbus TCP that were sent last, until it returns a value other
 * than 0, and returns that. */
static int of_sent(const received *from, int (*each)(const uint8_t *frame, void *context),
                   void *context)
{
    size_t at = 0;
    int found = 0;

    while (!found && at + MBAP < from->sent_count) {
        found = each(from->sent + at, context);
        at += COUNTED + number_at(from->sent + at + 4);
    }
    return found;
}

/* Whether a frame with this transaction number came since the last request. */
static int has_come(const received *from, unsigned transaction)
{
    const size_t have = from->count < RECEIVED_BYTES ? from->count : RECEIVED_BYTES;
    size_t at = 0;

    while (at + MBAP <= have) {
        if (number_at(from->bytes + at) == transaction)
            return 1;
        at += COUNTED + number_at(from->bytes + at + 4);
    }
    return 0;
}

/* Notes a request that has got no reply with its number: that may still come. */
static int note_earlier(const uint8_t *frame, void *context)
{
    received *to = (received *)context;

    if (has_come(to, number_at(frame)))
        return 0;
    to->earlier[to->earlier_count++ % RECEIVED_EARLIER] = (uint16_t)number_at(frame);
    return 0;
}

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    received *to = (received *)context;
    const int16_t count = to->below.write(to->below.context, bytes, length);

    if (count <= 0)
        return count;
    if (to->framing == MBM_FRAMING_TCP)
        (void)of_sent(to, note_earlier, to);
    to->sent_count = count < RECEIVED_SENT ? (uint16_t)count : RECEIVED_SENT;
    memcpy(to->sent, bytes, to->sent_count);
    to->count = 0;
    return count;
}

mbm_port received_begin(received *to, const mbm_port *below, uint8_t framing)
{
    mbm_port above;

    memset(to, 0, sizeof *to);
    above = port_over(&to->below, below);
    above.read = read_bytes;
    above.write = write_bytes;
    to->framing = framing;
    return above;
}

/* --- what came --- */

static int has_transaction(const uint8_t *frame, void *context)
{
    return number_at(frame) == *(const unsigned *)context;
}

static int is_earlier(const received *from, unsigned transaction)
{
    uint32_t i;

    for (i = 0; i < RECEIVED_EARLIER && i < from->earlier_count; i++)
        if (from->earlier[i] == transaction)
            return 1;
    return 0;
}

/* What is wrong with the first frame of Modbus TCP that came, or NULL. */
static const char *text_of_tcp(const received *from)
{
    const uint8_t *bytes = from->bytes;
    unsigned transaction, length;

    if (from->count < MBAP)
        return say("%u byte%s came, and a reply begins with a header of 7", (unsigned)from->count,
                   from->count == 1 ? "" : "s");
    transaction = number_at(bytes);
    length = number_at(bytes + 4);
    if (number_at(bytes + 2) != 0)
        return say("a reply came with protocol id %u, which is 0 in Modbus TCP%s",
                   number_at(bytes + 2),
                   bytes[0] == from->sent[6] && (bytes[1] & 0x7F) == from->sent[MBAP]
                       ? "; it looks like a frame of rtu+tcp://"
                       : "");
    if (length < SHORTEST || length > LONGEST)
        return say("a reply came whose header announces %u bytes, and %d to %d are possible",
                   length, SHORTEST, LONGEST);
    if (!of_sent(from, has_transaction, &transaction)) {
        if (is_earlier(from, transaction))
            return "a reply to an earlier request came; a slow device needs a longer --timeout";
        return from->accept & MBM_ACCEPT_TRANSACTION
                   ? say("a reply came with transaction number %u that does not answer the request",
                         transaction)
                   : say("a reply with transaction number %u came, and the request had %u; --accept "
                         "transaction takes it",
                         transaction, number_at(from->sent));
    }
    if (from->count < COUNTED + length)
        return say("a reply came whose header announces %u bytes, and %u came", length,
                   (unsigned)from->count - COUNTED);
    if (bytes[6] == from->sent[6])
        return NULL;
    return from->accept & MBM_ACCEPT_UNIT
               ? say("a reply of unit %u came", bytes[6])
               : say("a reply of unit %u came; --accept unit takes it", bytes[6]);
}

int received_is_echo(const received *from)
{
    return from->count > 0 && from->count == from->sent_count && from->count <= RECEIVED_BYTES &&
           memcmp(from->bytes, from->sent, from->count) == 0;
}

const char *received_text(const received *from)
{
    if (from->count == 0 || from->sent_count == 0)
        return NULL;
    if (received_is_echo(from))
        return "its own request came back";
    if (from->framing == MBM_FRAMING_TCP)
        return text_of_tcp(from);
    return say("%u byte%s came that %s no reply", (unsigned)from->count,
               from->count == 1 ? "" : "s", from->count == 1 ? "is" : "are");
}
