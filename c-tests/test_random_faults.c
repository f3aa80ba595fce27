/* Thousands of transactions on a bad wire. The data of a call that succeeds are right, whatever
 * happens to its reply.
 *
 * No RTU master can notice two kinds of wrong data. They are counted separately:
 * - blind: the damaged bytes are a frame with a right CRC, one in 65536;
 * - late: the reply to an earlier request of the same unit, function and length arrived
 *   while the master waited for this one. Nothing in an RTU frame says which request it
 *   answers. The quiet time after a timeout makes this rare.
 * Requests vary in unit, function and length, so that most late replies can be
 * distinguished, and are.
 *
 * MBM_SEED and MBM_TRANSACTIONS in the environment change the run. */
#include "crc.h"
#include "model.h"
#include "sim.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

fixture each_test = {sim_setup, sim_teardown};

enum { TIMEOUT_MS = 50, LEDGER = 64 };

/* What may happen to a reply or to the request. */
enum {
    LOST = 1 << 0,      /* the device does not receive the request */
    DROP = 1 << 1,      /* a byte of the reply is missing */
    FLIP = 1 << 2,      /* a bit is wrong */
    INSERT = 1 << 3,    /* extra bytes in the reply */
    DELAY = 1 << 4,     /* it arrives after the timeout */
    DUPLICATE = 1 << 5, /* it arrives twice */
    FOREIGN = 1 << 6,   /* a frame of another unit before it */
    STALE = 1 << 7,     /* a frame of another function before it */
    CUT = 1 << 8,       /* a pause inside it */
    NOISE = 1 << 9,     /* random bytes before it */
    HEADER = 1 << 10,   /* bytes that look like its start before it */
    ECHO = 1 << 11,     /* the request comes back first; echo discard is on */
    KINDS = 12,
    DESTROYED = LOST | DROP | FLIP | INSERT | DELAY
};

typedef struct frame {
    size_t length;
    uint8_t bytes[260];
} frame;

typedef struct run {
    uint32_t random;
    model device;
    request asked;        /* the request that the device received last */
    frame reply;          /* and its reply, undamaged */
    int carried_out;      /* in this transaction */
    unsigned faults;      /* of this attempt */
    frame ledger[LEDGER]; /* undamaged replies to earlier requests */
    unsigned written;
    uint8_t received[4096]; /* the bytes that the master read for this request */
    size_t received_length;
    unsigned right, failed, intact, late, blind, wrong, exceptions;
    uint64_t longest;
} run;

static uint32_t draw(run *r, uint32_t below)
{
    r->random ^= r->random << 13;
    r->random ^= r->random >> 17;
    r->random ^= r->random << 5;
    return r->random % below;
}

static void scribble(run *r, uint8_t *bytes, size_t length)
{
    while (length-- > 0)
        *bytes++ = (uint8_t)draw(r, 256);
}

static unsigned draw_faults(run *r)
{
    uint32_t dice = draw(r, 100);
    unsigned faults = 0;

    if (dice >= 40)
        faults |= 1u << draw(r, KINDS);
    if (dice >= 85)
        faults |= 1u << draw(r, KINDS);
    if (dice >= 95)
        faults |= 1u << draw(r, KINDS);
    return faults;
}

static void damage(run *r, frame *f)
{
    size_t at = draw(r, (uint32_t)f->length), more = 1 + draw(r, 3);

    if (r->faults & FLIP)
        f->bytes[at] ^= (uint8_t)(1u << draw(r, 8));
    if (r->faults & DROP) {
        at = draw(r, (uint32_t)f->length);
        memmove(f->bytes + at, f->bytes + at + 1, --f->length - at);
    }
    if (r->faults & INSERT && f->length + more < sizeof f->bytes) {
        at = 1 + draw(r, (uint32_t)f->length - 1);
        memmove(f->bytes + at + more, f->bytes + at, f->length - at);
        scribble(r, f->bytes + at, more);
        f->length += more;
    }
}

/* Sends what comes before the reply. Returns when the reply may begin. */
static uint64_t in_front(sim *s, run *r, uint64_t at)
{
    uint8_t bytes[64];
    size_t length = 0;

    if (r->faults & FOREIGN) {
        size_t data = 2 + draw(r, 10);

        bytes[0] = (uint8_t)(r->asked.unit + 1 + draw(r, 100));
        bytes[1] = r->asked.function;
        bytes[2] = (uint8_t)data;
        scribble(r, bytes + 3, data);
        length = seal(bytes, 3 + data);
    } else if (r->faults & STALE) {
        bytes[0] = r->asked.unit;
        bytes[1] = r->asked.function == 6 ? 5 : 6;
        scribble(r, bytes + 2, 4);
        length = seal(bytes, 6);
    } else if (r->faults & HEADER) {
        length = 1 + draw(r, 12);
        memcpy(bytes, r->reply.bytes, 3);
        scribble(r, bytes + 3, 12);
    } else if (r->faults & NOISE) {
        length = 1 + draw(r, 20);
        scribble(r, bytes, length);
    }
    sim_deliver(s, at, bytes, length);
    return at + length * s->character + (length && draw(r, 3) == 0 ? draw(r, 8000) : 0);
}

static void device(sim *s, const sim_frame *sent)
{
    run *r = (run *)s->context;
    uint64_t at = sent->end + 500 + draw(r, 10000);

    r->received_length = 0;
    assert_true(request_parse(&r->asked, sent->bytes, sent->length));
    r->faults = draw_faults(r);
    if (s->echo)
        r->faults |= ECHO;
    if (r->faults & LOST)
        return;
    r->reply.length = model_answer(&r->device, &r->asked, r->reply.bytes);
    r->ledger[r->written++ % LEDGER] = r->reply;
    r->carried_out = 1;
    frame f = r->reply;
    damage(r, &f);
    if (r->faults & DELAY)
        at += 1000 * (TIMEOUT_MS + draw(r, 300));
    at = in_front(s, r, at);
    if (r->faults & CUT) {
        size_t half = draw(r, (uint32_t)f.length);

        sim_deliver(s, at, f.bytes, half);
        at += half * s->character + 2000 + draw(r, 15000);
        sim_deliver(s, at, f.bytes + half, f.length - half);
        at += (f.length - half) * s->character;
    } else {
        sim_deliver(s, at, f.bytes, f.length);
        at += f.length * s->character;
    }
    if (r->faults & DUPLICATE)
        sim_deliver(s, at + draw(r, 10000), f.bytes, f.length);
}

static void tap(sim *s, uint8_t byte)
{
    run *r = (run *)s->context;

    if (r->received_length < sizeof r->received)
        r->received[r->received_length++] = byte;
}

static uint16_t quantity(run *r, uint32_t most)
{
    return (uint16_t)(1 + draw(r, draw(r, 8) == 0 ? most : 12));
}

/* Makes a request of a random kind to a random unit. */
static uint8_t make_request(sim *s, run *r)
{
    mbm_node *n = &s->node;
    uint16_t address = (uint16_t)draw(r, MODEL_CELLS);
    uint16_t other = (uint16_t)draw(r, MODEL_CELLS);
    uint8_t i, words = (uint8_t)(1 + draw(r, 123));

    for (i = 0; i < words; i++)
        s->transmit[i] = (uint16_t)draw(r, 65536);
    mbm_node_setSlaveID(n, (uint8_t)(MODEL_FIRST_UNIT + draw(r, MODEL_UNITS)));
    s->echo = draw(r, 12) == 0;
    mbm_line_setEchoDiscard(&s->line, s->echo);
    mbm_node_setBlocking(n, draw(r, 2) != 0);
    s->read_piece = (uint16_t)(draw(r, 3) ? 0 : 1 + draw(r, 5));
    s->write_piece = (uint16_t)(draw(r, 3) ? 0 : 8 + draw(r, 5));
    switch (draw(r, 10)) {
    case 0: return mbm_node_readCoils(n, address, quantity(r, 2000));
    case 1: return mbm_node_readDiscreteInputs(n, address, quantity(r, 2000));
    case 2: return mbm_node_readHoldingRegisters(n, address, quantity(r, 125));
    case 3: return mbm_node_readInputRegisters(n, address, quantity(r, 125));
    case 4: return mbm_node_writeSingleCoil(n, address, (uint8_t)draw(r, 2));
    case 5: return mbm_node_writeSingleRegister(n, address, other);
    case 6: return mbm_node_writeMultipleCoils(n, address, quantity(r, 1968));
    case 7: return mbm_node_writeMultipleRegisters(n, address, quantity(r, 123));
    case 8: return mbm_node_maskWriteRegister(n, address, other, (uint16_t)draw(r, 65536));
    default:
        return mbm_node_readWriteMultipleRegisters(n, address, quantity(r, 125), other,
                                                   quantity(r, 121));
    }
}

/* Returns whether the status and the data of the call are those of this reply frame. */
static int agrees_with(const sim *s, const run *r, uint8_t status, const frame *f)
{
    const uint8_t *b = f->bytes;
    int bits = r->asked.function <= 2;

    if (b[0] != r->asked.unit || (b[1] & 0x7F) != r->asked.function)
        return 0;
    if (b[1] & 0x80)
        return status == b[2] && f->length == 5;
    if (status != MBM_OK)
        return 0;
    if (r->asked.function > 4 && r->asked.function != 0x17)
        /* The response repeats fields of the request, so with other fields it answers
         * another request. */
        return be16(b + 2) == r->asked.address && be16(b + 4) == r->asked.value &&
               (r->asked.function != 0x16 || be16(b + 6) == r->asked.or_mask);
    for (unsigned i = 0; i < b[2]; i += 2) {
        unsigned first = b[3 + i], second = i + 1 < b[2] ? b[4 + i] : 0;
        unsigned word = bits ? second << 8 | first : first << 8 | second;

        if (bits && i + 2 >= b[2] && r->asked.quantity % 16)
            word &= (1u << r->asked.quantity % 16) - 1;
        if (s->response[i / 2] != word)
            return 0;
    }
    return b[2] == (bits ? (r->asked.quantity + 7) / 8 : 2 * r->asked.quantity);
}

static int was_received(const run *r, const frame *f)
{
    for (size_t at = 0; at + f->length <= r->received_length; at++)
        if (memcmp(r->received + at, f->bytes, f->length) == 0)
            return 1;
    return 0;
}

/* Returns whether the call took the reply to an earlier request. */
static int is_late(const sim *s, const run *r, uint8_t status)
{
    for (unsigned i = 0; i < LEDGER && i < r->written; i++)
        if (agrees_with(s, r, status, &r->ledger[i]) && was_received(r, &r->ledger[i]))
            return 1;
    return 0;
}

/* Returns whether the bytes that the master read contain a frame with a right CRC and these
 * data. */
static int is_blind(const sim *s, const run *r, uint8_t status)
{
    frame f;

    for (size_t at = 0; at < r->received_length; at++)
        for (size_t length = 5; length <= 256 && at + length <= r->received_length; length++)
            if (crc16(r->received + at, length) == 0) {
                f.length = length;
                memcpy(f.bytes, r->received + at, length);
                if (agrees_with(s, r, status, &f))
                    return 1;
            }
    return 0;
}

static void transact(sim *s, run *r, unsigned retries)
{
    uint64_t began = s->now;

    s->sent = 0;
    s->order_length = 0;
    r->carried_out = 0;
    s->limit = s->now + (retries + 1) * 400000u; /* the call hangs if it takes longer */
    uint8_t status = make_request(s, r);
    if (status == MBM_PENDING)
        status = sim_poll(s);
    for (unsigned i = 0; i < s->sent; i++)
        assert_true(s->frames[i].whole);
    if (s->now - began > r->longest)
        r->longest = s->now - began;
    if (status >= 0x80) {
        r->failed++;
        r->intact += s->sent > 0 && !(r->faults & DESTROYED);
    } else if (r->carried_out && agrees_with(s, r, status, &r->reply)) {
        r->right++;
        r->exceptions += status != MBM_OK;
    } else if (is_late(s, r, status)) {
        r->late++;
    } else if (is_blind(s, r, status)) {
        r->blind++;
    } else {
        r->wrong++;
        print_message("wrong: function %02X, faults %03X, status %02X\n", r->asked.function,
                      r->faults, status);
    }
    s->now += draw(r, 3) ? 0 : draw(r, 20000);
}

static unsigned long setting(const char *name, unsigned long otherwise)
{
    const char *text = getenv(name);

    return text ? strtoul(text, NULL, 0) : otherwise;
}

static unsigned transactions(void)
{
    return (unsigned)setting("MBM_TRANSACTIONS", 20000);
}

static unsigned run_faults(sim *s, unsigned retries)
{
    unsigned long seed = setting("MBM_SEED", 20240229);
    static run fresh, this_run; /* static: too large for some stacks */
    run *r = &this_run;
    unsigned i;

    *r = fresh;
    r->random = (uint32_t)seed ? (uint32_t)seed : 1;
    model_start(&r->device);
    s->context = r;
    s->device = device;
    s->tap = tap;
    s->character = 50;
    s->step = 10;
    s->idle_step = 200;
    s->clock_start = 0xFFFFF000u;
    sim_begin(s, MODEL_FIRST_UNIT);
    mbm_node_setResponseTimeout(&s->node, TIMEOUT_MS);
    mbm_line_setRetries(&s->line, (uint8_t)retries);
    for (i = 0; i < transactions(); i++)
        transact(s, r, retries);
    print_message("faults: seed %lu, retries %u, transactions %u: right %u (exceptions %u), "
                  "failed %u (reply intact %u), late %u, blind %u, WRONG %u; longest %lu ms\n",
                  seed, retries, i, r->right, r->exceptions, r->failed, r->intact, r->late,
                  r->blind, r->wrong, (unsigned long)(r->longest / 1000));
    assert_int_equal(r->wrong, 0);
    assert_true(r->right > i / 2);
    assert_true(r->blind <= 1 + i / 5000);
    assert_true(r->late <= 1 + i / 500);
    return r->failed;
}

TEST(no_fault_makes_a_call_return_wrong_data)
{
    assert_true(run_faults(sim_of_test(), 0) < transactions() / 2);
}

TEST(with_two_retries_far_fewer_calls_fail)
{
    assert_true(run_faults(sim_of_test(), 2) < transactions() / 10);
}
