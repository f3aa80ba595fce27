#include "sim.h"
#include "crc.h"
#include "model.h"
#include "test.h"

static void note(sim *s, char event)
{
    if (s->order_length > 0 && s->order[s->order_length - 1] == event)
        return;
    if (s->order_length + 1 < SIM_ORDER) {
        s->order_at[s->order_length] = s->now;
        s->order[s->order_length++] = event;
    }
}

static uint32_t micros(void *context)
{
    sim *s = (sim *)context;

    s->now += s->step;
    if (s->now > s->limit)
        fail_msg("hang: still waiting after %lu ms", (unsigned long)(s->limit / 1000));
    return (uint32_t)(s->clock_start + s->now);
}

static int16_t claimed(const sim *s, uint16_t count)
{
    return (int16_t)(count + s->overclaim);
}

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    sim *s = (sim *)context;
    uint16_t count = 0;

    if (s->read_dead)
        return -1;
    if (s->read_piece && capacity > s->read_piece)
        capacity = s->read_piece;
    while (count < capacity && s->first < s->last && s->incoming[s->first].at <= s->now) {
        bytes[count] = s->incoming[s->first++].byte;
        count++;
    }
    if (s->first == s->last)
        s->first = s->last = 0;
    if (count > 0) {
        s->last_byte = s->now;
        note(s, 'R');
    }
    return count == capacity ? claimed(s, count) : (int16_t)count;
}

void sim_deliver(sim *s, uint64_t at, const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        unsigned place;

        at += s->character;
        assert_true(s->last < SIM_BYTES);
        for (place = s->last++; place > s->first && s->incoming[place - 1].at > at; place--)
            s->incoming[place] = s->incoming[place - 1];
        s->incoming[place].at = at;
        s->incoming[place].byte = bytes[i];
    }
}

void sim_deliver_ascii(sim *s, uint64_t at, const uint8_t *frame, size_t length)
{
    static const char digits[] = "0123456789ABCDEF";
    uint8_t text[520] = ":", byte, sum = 0;
    size_t i, count = 1;

    for (i = 0; i + 1 < length; i++) {
        /* The LRC takes the place of the CRC. */
        byte = i + 2 < length ? frame[i] : (uint8_t)-sum;
        sum = (uint8_t)(sum + byte);
        text[count++] = (uint8_t)digits[byte >> 4];
        text[count++] = (uint8_t)digits[byte & 15];
    }
    text[count++] = '\r';
    text[count++] = '\n';
    sim_deliver(s, at, text, count);
}

/* A complete request has left. From now on its answers have a time. */
static void request_ended(sim *s, const sim_frame *frame)
{
    for (unsigned i = 0; i < s->answered; i++)
        if (s->answers[i].request == s->sent)
            sim_deliver(s, frame->end + s->answers[i].delay, s->answers[i].bytes,
                        s->answers[i].length);
    if (s->device)
        s->device(s, frame);
}

static int digit(char c)
{
    return c <= '9' ? c - '0' : (c & ~0x20) - 'A' + 10;
}

/* Converts a complete frame of ASCII with a right LRC to RTU. Returns 1 if it is one. */
static int is_ascii(sim_frame *frame)
{
    uint8_t bytes[sizeof frame->bytes], sum = 0;
    uint16_t i, count = 0;

    if (frame->bytes[0] != ':' || frame->bytes[frame->length - 1] != '\n')
        return 0;
    for (i = 1; i + 3 < frame->length; i += 2) {
        const char *pair = (const char *)frame->bytes + i;

        bytes[count] = (uint8_t)(digit(pair[0]) << 4 | digit(pair[1]));
        sum = (uint8_t)(sum + bytes[count++]);
    }
    if (sum != 0 || count < 3)
        return 0;
    memcpy(frame->bytes, bytes, count - 1);
    frame->length = (uint16_t)seal(frame->bytes, count - 1);
    return frame->ascii = 1;
}

static void byte_sent(sim *s, uint8_t byte)
{
    sim_frame *frame = s->sent > 0 ? &s->frames[s->sent - 1] : NULL;
    uint64_t start = s->transmitted > s->now ? s->transmitted : s->now;
    request parsed;

    if (!frame || frame->whole || s->driver_on == 1) {
        assert_true(s->sent < SIM_FRAMES);
        frame = &s->frames[s->sent++];
        memset(frame, 0, sizeof *frame);
        frame->begin = s->now;
        frame->silence = s->now - s->last_byte;
        if (s->driver_on)
            s->driver_on = 2; /* the frame has begun with the driver on */
    }
    s->transmitted = s->last_byte = frame->end = start + s->character;
    if (frame->length < sizeof frame->bytes)
        frame->bytes[frame->length++] = byte;
    if (s->echo)
        sim_deliver(s, start, &byte, 1);
    if ((frame->bytes[0] != ':' || is_ascii(frame)) &&
        request_parse(&parsed, frame->bytes, frame->length)) {
        frame->whole = 1;
        request_ended(s, frame);
    }
}

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    sim *s = (sim *)context;
    uint16_t i, count = length;

    note(s, 'W');
    if (s->port.preTransmission && !s->driver_on)
        s->write_without_driver++;
    if (s->write_never)
        return 0;
    if (s->write_busy && s->busy++ % (s->write_busy + 1) != s->write_busy)
        return 0;
    if (s->write_piece && count > s->write_piece)
        count = s->write_piece;
    for (i = 0; i < count; i++) {
        byte_sent(s, bytes[i]);
        if (s->write_dies_at && s->frames[s->sent - 1].length == s->write_dies_at)
            return -1;
    }
    return count == length ? claimed(s, count) : (int16_t)count;
}

static uint8_t flush(void *context)
{
    sim *s = (sim *)context;

    note(s, 'F');
    return !s->flush_never && (s->flush_lies || s->now >= s->transmitted);
}

static void pre(void *context)
{
    sim *s = (sim *)context;

    note(s, 'P');
    assert_int_equal(s->driver_on, 0);
    s->driver_on = 1;
}

static void post(void *context)
{
    sim *s = (sim *)context;

    note(s, 'O');
    assert_int_not_equal(s->driver_on, 0);
    s->driver_on = 0;
    if (s->now < s->transmitted)
        s->post_before_last_bit++;
}

static void idle(void *context, mbm_node *node)
{
    sim *s = (sim *)context;
    uint64_t next = s->now + s->idle_step;

    note(s, 'I');
    s->waits = node;
    s->idles++;
    if (s->driver_on)
        s->idle_while_driving++;
    if (s->first < s->last && s->incoming[s->first].at < next && s->incoming[s->first].at > s->now)
        next = s->incoming[s->first].at;
    s->now = next;
    if (s->on_idle)
        s->on_idle(s);
}

void sim_begin(sim *s, uint8_t unit)
{
    s->port.context = s;
    s->port.read = read_bytes;
    s->port.write = write_bytes;
    s->port.micros = micros;
    s->port.flush = flush;
    s->port.preTransmission = pre;
    s->port.postTransmission = post;
    s->port.idle = idle;
    assert_int_equal(mbm_line_beginRtu(&s->line, &s->port, s->buffer, MBM_MAX_FRAME), MBM_OK);
    sim_node(s, unit);
}

void sim_node(sim *s, uint8_t unit)
{
    assert_int_equal(mbm_node_begin(&s->node, &s->line, unit, s->response, MBM_MAX_READ_REGISTERS,
                                    s->transmit, MBM_MAX_WRITE_REGISTERS),
                     MBM_OK);
}

static sim *current;

sim *sim_of_test(void)
{
    return current;
}

void sim_setup(void)
{
    sim *s = current = (sim *)calloc(1, sizeof *s);

    assert_non_null(s);
    s->step = 2;
    s->idle_step = 20;
    s->character = 100;
    s->limit = 100000000;
    sim_begin(s, 17);
    assert_int_equal(mbm_line_setCounters(&s->line, &s->counters), MBM_OK);
    s->last_byte = s->now;
}

void sim_teardown(void)
{
    sim end = *current;
    unsigned i, cut = 0;

    free(current); /* before the checks, since they may not return */
    for (i = 0; i < end.sent; i++)
        cut += !end.frames[i].whole;
    assert_int_equal(cut, end.cut_allowed);
    assert_int_equal(end.idle_while_driving, 0);
    assert_int_equal(end.write_without_driver, 0);
    assert_int_equal(end.driver_on, 0);
    if (cut == 0 && !end.flush_lies && !end.flush_never)
        assert_int_equal(end.post_before_last_bit, 0);
}

size_t sim_bytes(uint8_t *bytes, const char *text)
{
    size_t length = 0, start = 0;

    for (; *text; text++) {
        if (*text == '+') {
            length = start + seal(bytes + start, length - start);
        } else if (*text == '/') {
            start = length;
        } else if (*text != ' ') {
            bytes[length++] = (uint8_t)(digit(text[0]) << 4 | digit(text[1]));
            text++;
        }
    }
    return length;
}

void sim_answer(sim *s, unsigned nth, uint32_t delay, const char *text)
{
    unsigned at = s->answered++ % SIM_ANSWERS;

    assert_true(s->answered <= SIM_ANSWERS);
    s->answers[at].request = s->sent + nth;
    s->answers[at].delay = delay;
    s->answers[at].length = (uint16_t)sim_bytes(s->answers[at].bytes, text);
}

void sim_deliver_text(sim *s, uint64_t at, const char *text)
{
    uint8_t bytes[512];

    sim_deliver(s, at, bytes, sim_bytes(bytes, text));
}

void sim_assert_sent(const sim *s, unsigned index, const char *text)
{
    uint8_t bytes[512];
    size_t length = sim_bytes(bytes, text);

    assert_true(index < s->sent);
    assert_int_equal(s->frames[index].length, length);
    assert_memory_equal(s->frames[index].bytes, bytes, length);
}

void sim_assert_order(const sim *s, const char *which, const char *order)
{
    char seen[SIM_ORDER + 1];
    size_t i, length = 0;

    for (i = 0; i < s->order_length; i++)
        if (strchr(which, s->order[i]) && (length == 0 || seen[length - 1] != s->order[i]))
            seen[length++] = s->order[i];
    seen[length] = '\0';
    assert_string_equal(seen, order);
}

uint8_t sim_poll(sim *s)
{
    uint8_t status;

    while ((status = mbm_node_poll(&s->node)) == MBM_PENDING)
        s->now += s->idle_step;
    return status;
}

uint64_t sim_time_of(const sim *s, char event)
{
    const char *at = (const char *)memchr(s->order, event, s->order_length);

    assert_non_null(at);
    return s->order_at[at - s->order];
}

void sim_assert_time(uint64_t time, uint64_t wanted)
{
    assert_in_range(time, wanted, wanted + SIM_SLACK);
}

uint8_t sim_read_one(sim *s)
{
    return mbm_node_readHoldingRegisters(&s->node, 0, 1);
}

void sim_reads(sim *s, uint32_t delay)
{
    sim_answer(s, 1, delay, "11 03 02 00 2A +");
    OK(sim_read_one(s));
    assert_int_equal(s->response[0], 42);
}
