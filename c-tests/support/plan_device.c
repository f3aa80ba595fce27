#include "plan_device.h"
#include "test.h"

static void log_update(void *context, mbm_plan *plan, uint16_t field)
{
    plan_device *d = (plan_device *)context;
    plan_update *update = &d->updates[d->updated++];

    assert_true(d->updated <= PLAN_LOG);
    update->ms = d->memory.now / 1000;
    update->field = field;
    update->status = mbm_plan_getStatus(plan, field, NULL);
}

void plan_device_begin(plan_device *d, int is_tcp)
{
    memset(d, 0, sizeof *d);
    d->is_tcp = is_tcp != 0;
    mbm_port port = memory_port_of(&d->memory);
    if (is_tcp)
        OK(mbm_client_beginTcp(&d->client, &port, d->frame, sizeof d->frame, d->outgoing,
                               sizeof d->outgoing));
    else
        OK(mbm_client_beginRtu(&d->client, &port, d->frame, sizeof d->frame));
    OK(mbm_client_setResponseTimeout(&d->client, 100));
    for (unsigned i = 0; i < PLAN_REGISTERS; i++)
        d->registers[i] = (uint16_t)(i * 40503u + 7u);
    d->setup.fields = d->fields;
    d->setup.positions = d->positions;
    d->setup.reads = d->reads;
    d->setup.data = d->data;
    d->setup.requests = d->requests;
    d->setup.update = log_update;
    d->setup.context = d;
    d->setup.readCount = PLAN_FIELDS;
    d->setup.dataWords = PLAN_WORDS;
    d->setup.requestCount = 1;
}

mbm_planField *plan_device_add(plan_device *d, uint8_t unit, uint8_t table, uint8_t type,
                               uint16_t address, uint32_t intervalMs)
{
    mbm_planField *field = &d->fields[d->setup.fieldCount++];

    assert_true(d->setup.fieldCount <= PLAN_FIELDS);
    field->unit = unit;
    field->table = table;
    field->type = type;
    field->address = address;
    field->intervalMs = intervalMs;
    return field;
}

uint8_t plan_device_try(plan_device *d, uint16_t *field)
{
    return mbm_plan_begin(&d->plan, &d->client, &d->setup, field);
}

void plan_device_start(plan_device *d)
{
    uint16_t field = 0;

    IS(MBM_OK, plan_device_try(d, &field));
    assert_int_equal(field, 0xFFFF);
}

/* Returns the exception with which a PDU is refused, or 0. */
static uint8_t refusal(const plan_device *d, const uint8_t *request)
{
    unsigned address = (unsigned)request[1] << 8 | request[2];
    unsigned quantity = (unsigned)request[3] << 8 | request[4], i;

    for (i = address; i < address + quantity; i++)
        if (d->lacks[i])
            return MBM_ILLEGAL_DATA_ADDRESS;
    return d->longest > 0 && quantity > d->longest ? MBM_ILLEGAL_DATA_VALUE : 0;
}

/* Writes the reply to a PDU, and returns its length. */
static size_t respond(const plan_device *d, const uint8_t *request, uint8_t *reply)
{
    unsigned address = (unsigned)request[1] << 8 | request[2];
    unsigned quantity = (unsigned)request[3] << 8 | request[4], i;

    assert_true(address + quantity <= PLAN_REGISTERS);
    reply[0] = request[0];
    if (request[0] <= 2) {
        reply[1] = (uint8_t)((quantity + 7) / 8);
        memset(reply + 2, 0, reply[1]);
        for (i = 0; i < quantity; i++)
            reply[2 + i / 8] |= (uint8_t)((d->registers[address + i] & 1) << i % 8);
    } else {
        reply[1] = (uint8_t)(2 * quantity);
        for (i = 0; i < quantity; i++) {
            reply[2 + 2 * i] = (uint8_t)(d->registers[address + i] >> 8);
            reply[3 + 2 * i] = (uint8_t)d->registers[address + i];
        }
    }
    return 2u + reply[1];
}

static void answer(plan_device *d, const uint8_t *header, uint8_t unit, const uint8_t *pdu)
{
    uint8_t frame[MBM_MAX_TCP_FRAME];
    size_t length, head = d->is_tcp ? 7 : 1;
    uint8_t way = d->answers[unit];

    if (way == SILENT || pdu[0] == d->silent_function)
        return;
    length = head + respond(d, pdu, frame + head);
    if (way == EXCEPTION || refusal(d, pdu)) {
        frame[head] |= 0x80;
        frame[head + 1] = way == EXCEPTION ? 4 : refusal(d, pdu);
        length = head + 2;
    }
    frame[head - 1] = unit;
    if (d->is_tcp) {
        memcpy(frame, header, 4);
        frame[4] = (uint8_t)((length - 6) >> 8);
        frame[5] = (uint8_t)(length - 6);
        memory_port_bytes(&d->memory, frame, way == HALF_A_REPLY ? length / 2 : length);
    } else if (way == HALF_A_REPLY) {
        memory_port_bytes(&d->memory, frame, length / 2);
    } else {
        memory_port_rtu(&d->memory, frame, length);
        if (way == WRONG_CRC)
            d->memory.arriving[d->memory.arriving_count - 1] ^= 1;
    }
}

/* Logs and answers every request that was sent. */
static void serve(plan_device *d)
{
    size_t size = d->is_tcp ? 12 : 8, at;

    for (at = 0; at + size <= d->memory.sent_count; at += size) {
        const uint8_t *frame = d->memory.sent + at;
        const uint8_t *pdu = frame + (d->is_tcp ? 7 : 1);
        plan_request *request = &d->log[d->requested++];

        assert_true(d->requested <= PLAN_LOG);
        request->ms = d->memory.now / 1000;
        request->unit = pdu[-1];
        request->function = pdu[0];
        request->address = (uint16_t)(pdu[1] << 8 | pdu[2]);
        request->quantity = (uint16_t)(pdu[3] << 8 | pdu[4]);
        assert_true(request->unit < PLAN_UNITS);
        answer(d, frame, request->unit, pdu);
    }
    assert_int_equal(at, d->memory.sent_count);
    d->memory.sent_count = 0;
}

void plan_device_run(plan_device *d, uint32_t ms)
{
    uint32_t begin = d->memory.now;

    while (d->memory.now - begin < ms * 1000) {
        uint32_t left = ms * 1000 - (d->memory.now - begin), delay;

        if (d->splitting.blocks)
            OK(mbm_plan_pollSplitting(&d->plan, &d->splitting));
        else
            OK(mbm_plan_poll(&d->plan));
        (void)mbm_client_poll(&d->client);
        if (d->memory.sent_count > 0) {
            serve(d);
            continue;
        }
        delay = mbm_plan_pollDelay(&d->plan);
        if (delay > mbm_client_pollDelay(&d->client))
            delay = mbm_client_pollDelay(&d->client);
        if (delay > left)
            delay = left;
        d->memory.now += delay > 0 ? delay : 1;
    }
}

unsigned plan_device_requests(const plan_device *d, uint8_t unit)
{
    unsigned i, count = 0;

    for (i = 0; i < d->requested; i++)
        count += d->log[i].unit == unit;
    return count;
}

unsigned plan_device_updates(const plan_device *d, uint16_t field)
{
    unsigned i, count = 0;

    for (i = 0; i < d->updated; i++)
        count += d->updates[i].field == field;
    return count;
}

int64_t plan_device_integer(plan_device *d, uint16_t field, uint16_t index)
{
    int64_t value = 0;

    OK(mbm_plan_getInteger(&d->plan, field, index, &value));
    return value;
}
