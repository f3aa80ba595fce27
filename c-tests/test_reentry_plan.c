/* Every function of a plan, called from within each hook of its client's port, from `done` of
 * another request, and from `update`. */
#include "unchanged.h"
#include "hooked_port.h"
#include "test.h"

#include <string.h>

enum { WORDS = 4 };

static hooked_port wire;
static mbm_port port;
static uint8_t frame[256];
static mbm_client client;
static mbm_clientRequest own;

static const mbm_planField fields[2] = {
    {.unit = 17,
     .table = MBM_TABLE_HOLDING_REGISTERS,
     .type = MBM_TYPE_UINT16,
     .address = 1,
     .intervalMs = 10000},
    {.unit = 17,
     .table = MBM_TABLE_HOLDING_REGISTERS,
     .type = MBM_TYPE_TEXT,
     .address = 2,
     .count = 4,
     .intervalMs = 10000},
};
static mbm_planPosition positions[2];
static mbm_planRead reads[2];
static mbm_clientRequest requests[1];
static uint16_t data[WORDS];
static mbm_planSetup setup;
static mbm_plan plan, other;

/* The values of the fields, once they were read. */
static void every_value_is_there(void)
{
    mbm_registers registers;
    mbm_planReadInfo read;
    double number;
    int64_t integer;
    int32_t short_integer;
    float single;
    char text[5];

    OK(mbm_plan_getNumber(&plan, 0, 0, &number));
    assert_true(number == 0x1234);
    OK(mbm_plan_getInteger(&plan, 0, 0, &integer));
    assert_int_equal(integer, 0x1234);
    OK(mbm_plan_getInt32(&plan, 0, 0, &short_integer));
    assert_int_equal(short_integer, 0x1234);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getFloat(&plan, 0, 0, &single));
    OK(mbm_plan_getText(&plan, 1, text, sizeof text));
    assert_string_equal(text, "abcd");
    OK(mbm_plan_getRegisters(&plan, 1, &registers));
    OK(mbm_plan_getRead(&plan, 0, &read));
    assert_int_equal(read.quantity, 3);
}

static uint8_t status_in_hooks;

static void within_port(int hook)
{
    uint32_t age;

    (void)hook;
    UNCHANGED_BY(plan, {
        IS(MBM_BUSY, mbm_plan_poll(&plan));
        assert_int_equal(mbm_plan_pollDelay(&plan), 0);
        IS(MBM_BUSY, mbm_plan_refresh(&plan, 0));
        IS(MBM_BUSY, mbm_plan_end(&plan));
        IS(MBM_BUSY, mbm_plan_begin(&plan, &client, &setup, NULL));
        IS(MBM_BUSY, mbm_plan_begin(&other, &client, &setup, NULL));
        IS(status_in_hooks, mbm_plan_getStatus(&plan, 0, &age));
        if (status_in_hooks == MBM_OK)
            every_value_is_there();
    });
    assert_int_equal(requests[0].status, MBM_PENDING);
}

static unsigned updated;

static void update(void *context, mbm_plan *of, uint16_t field)
{
    (void)context;
    assert_ptr_equal(of, &plan);
    wire.within = NULL;
    OK(mbm_plan_getStatus(&plan, field, NULL));
    every_value_is_there();
    /* Polls call no hook that is called already. */
    (void)mbm_client_poll(&client);
    OK(mbm_plan_refresh(&plan, field));
    assert_int_equal(mbm_plan_pollDelay(&plan), 0);
    updated++;
    if (updated == 2) {
        OK(mbm_plan_poll(&plan));
        IS(MBM_PENDING, requests[0].status);
    }
}

static const uint8_t reply[] = {3, 6, 0x12, 0x34, 'a', 'b', 'c', 'd'};

static void begin(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&client, 0, sizeof client);
    memset(&own, 0, sizeof own);
    memset(&plan, 0, sizeof plan);
    memset(&other, 0, sizeof other);
    memset(requests, 0, sizeof requests);
    memset(&setup, 0, sizeof setup);
    setup.fields = fields;
    setup.positions = positions;
    setup.reads = reads;
    setup.data = data;
    setup.requests = requests;
    setup.fieldCount = 2;
    setup.readCount = 2;
    setup.dataWords = WORDS;
    setup.requestCount = 1;
    entered = updated = 0;
    status_in_hooks = MBM_PENDING;
    wire.step = 500;
    port = hooked_port_of(&wire);
    OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
}

fixture each_test = {begin, NULL};

/* Polls until the plan's request has ended. */
static void run(void)
{
    OK(mbm_plan_poll(&plan));
    wire.within = within_port;
    for (unsigned i = 0; i < 3000 && mbm_client_poll(&client) == MBM_PENDING; i++) {
        if (wire.length > 0 && wire.last == 0)
            hooked_port_arrive_rtu(&wire, 17, reply, sizeof reply);
    }
    wire.within = NULL;
    OK(requests[0].status);
}

TEST(no_hook_of_the_clients_port_may_change_the_plan)
{
    OK(mbm_plan_begin(&plan, &client, &setup, NULL));
    run();
    assert_true(entered > 3);
    OK(mbm_plan_poll(&plan));
    OK(mbm_plan_getStatus(&plan, 0, NULL));
    /* Again, while there are values. */
    status_in_hooks = MBM_OK;
    entered = 0;
    memset(&wire.arriving, 0, sizeof wire.arriving);
    wire.first = wire.last = wire.length = 0;
    OK(mbm_plan_refresh(&plan, 1));
    run();
    assert_true(entered > 3);
    OK(mbm_plan_end(&plan));
}

TEST(update_may_call_every_function)
{
    setup.update = update;
    OK(mbm_plan_begin(&plan, &client, &setup, NULL));
    run();
    assert_int_equal(updated, 0);
    OK(mbm_plan_poll(&plan));
    assert_int_equal(updated, 2);
    OK(mbm_plan_end(&plan));
    assert_int_equal(mbm_client_pending(&client), 0);
}

static void done(void *context, mbm_clientRequest *ended)
{
    (void)ended;
    ++*(unsigned *)context;
    OK(mbm_plan_poll(&plan));
    IS(MBM_PENDING, requests[0].status);
    IS(MBM_PENDING, mbm_plan_getStatus(&plan, 0, NULL));
    assert_int_equal(mbm_plan_pollDelay(&plan), UINT32_MAX);
    OK(mbm_plan_end(&plan));
    IS(MBM_CANCELLED, requests[0].status);
    OK(mbm_plan_begin(&plan, &client, &setup, NULL));
}

TEST(done_of_another_request_may_call_every_function)
{
    unsigned calls = 0, i;

    OK(mbm_client_setResponseTimeout(&client, 20));
    OK(mbm_plan_begin(&plan, &client, &setup, NULL));
    own.unit = 3;
    own.done = done;
    own.context = &calls;
    IS(MBM_PENDING, mbm_client_readCoils(&client, &own, 0, 1));
    for (i = 0; i < 3000 && mbm_client_poll(&client) == MBM_PENDING; i++) {
    }
    assert_int_equal(calls, 1);
    IS(MBM_RESPONSE_TIMED_OUT, own.status);
    OK(mbm_plan_end(&plan));
}
