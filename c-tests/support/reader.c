#include "reader.h"

#include "crc.h"
#include "faults.h"
#include "test.h"

static void answer(sim *s, const sim_frame *request)
{
    bench *b = (bench *)s->context;
    uint8_t frame[300], asked[8];
    device *d = NULL;

    for (unsigned i = 0; i < b->count; i++)
        if (b->devices[i].unit == request->bytes[0])
            d = &b->devices[i];
    if (!d || d->unit == 0)
        return;
    d->requests++;
    if (d->requests >= d->lost && d->requests < d->lost + d->losses)
        return;
    memcpy(asked, request->bytes, sizeof asked);
    if (asked[1] == 3)
        asked[5] = (uint8_t)(asked[5] + d->deviates);
    else if (d->repeats_wrong)
        asked[5] ^= 0x55;
    size_t length = fault_right_reply(frame, asked);
    if (d->requests == 1 && d->exception) {
        frame[1] |= 0x80;
        frame[2] = d->exception;
        length = seal(frame, 3);
    }
    if (d->requests == d->damaged)
        frame[length - 1] ^= 0x40;
    if (d->requests == d->cut)
        length /= 2;
    memset(frame + length, 0, d->trailing);
    length += d->trailing;
    uint64_t at = (d->free > request->end ? d->free : request->end) +
                  (d->requests == d->late ? d->takes_for_late : d->takes);
    if (request->ascii)
        sim_deliver_ascii(s, at, frame, length);
    else
        sim_deliver(s, at, frame, length);
    d->free = at + (request->ascii ? 2 : 1) * length * s->character;
}

device *bench_add(bench *b, uint8_t unit, uint32_t takes)
{
    device *d = &b->devices[b->count++];

    assert_true(b->count <= DEVICES);
    *d = (device){.unit = unit, .takes = takes};
    return d;
}

void device_loses(device *d, unsigned losses)
{
    d->lost = d->requests + 1;
    d->losses = losses;
}

void device_is_late(device *d, uint32_t takes)
{
    d->late = d->requests + 1;
    d->takes_for_late = takes;
}

void bench_begin(bench *b, sim *s, reader_kind kind, uint32_t timeout)
{
    memset(b, 0, sizeof *b);
    b->s = s;
    b->kind = kind;
    s->device = answer;
    s->context = b;
    s->limit = UINT64_C(1000000000000);
    s->first = s->last = 0;
    s->sent = 0;
    s->now += 100000 * MS;
    if (kind == CLIENT_READS)
        OK(mbm_client_beginRtu(&b->client, &s->port, b->frame, MBM_MAX_FRAME));
    else if (kind == ASCII_CLIENT_READS)
        OK(mbm_client_beginAscii(&b->client, &s->port, b->frame, sizeof b->frame));
    sim_begin(s, UNIT);
    OK(mbm_node_setBlocking(&s->node, 0));
    bench_set_timeout(b, timeout);
}

void bench_set_timeout(bench *b, uint32_t timeout)
{
    OK(mbm_node_setResponseTimeout(&b->s->node, timeout / MS));
    if (b->kind != NODE_READS)
        OK(mbm_client_setResponseTimeout(&b->client, (uint16_t)(timeout / MS)));
}

void sleep_until_a_byte(sim *s, uint32_t delay, uint64_t end)
{
    uint64_t until = s->now + (delay > 0 ? delay : 1);

    if (s->first < s->last && s->incoming[s->first].at > s->now && s->incoming[s->first].at < until)
        until = s->incoming[s->first].at;
    s->now = until < end ? until : end;
}

uint8_t bench_starts(bench *b, uint8_t unit, uint16_t address)
{
    if (b->s->sent > SIM_FRAMES / 2 && b->s->frames[b->s->sent - 1].whole)
        b->s->sent = 0;
    if (b->kind == NODE_READS) {
        OK(mbm_node_setSlaveID(&b->s->node, unit));
        return mbm_node_readHoldingRegisters(&b->s->node, address, 1);
    }
    b->request.unit = unit;
    b->request.reply = &b->word;
    b->request.replyBytes = sizeof b->word;
    return mbm_client_readHoldingRegisters(&b->client, &b->request, address, 1);
}

uint8_t bench_polls(bench *b)
{
    if (b->kind == NODE_READS)
        return mbm_node_poll(&b->s->node);
    (void)mbm_client_poll(&b->client);
    return b->request.status;
}

void bench_cancels(bench *b)
{
    if (b->kind == NODE_READS)
        OK(mbm_node_cancel(&b->s->node));
    else
        OK(mbm_client_cancel(&b->client, &b->request));
}

uint8_t bench_goes_on(bench *b, uint16_t address, uint32_t limit)
{
    uint64_t end = b->s->now + limit;
    uint8_t status;

    while ((status = bench_polls(b)) == MBM_PENDING && b->s->now < end)
        sleep_until_a_byte(b->s,
                           b->kind == NODE_READS ? mbm_node_pollDelay(&b->s->node)
                                                 : mbm_client_pollDelay(&b->client),
                           end);
    if (status == MBM_OK)
        assert_int_equal(b->kind == NODE_READS ? b->s->response[0] : b->word, fault_value(address));
    return status;
}

uint8_t bench_reads(bench *b, uint8_t unit, uint16_t address, uint32_t limit)
{
    IS(MBM_PENDING, bench_starts(b, unit, address));
    uint8_t status = bench_goes_on(b, address, limit);
    if (status == MBM_PENDING) {
        bench_cancels(b);
        status = MBM_CANCELLED;
    }
    return status;
}
