/* A plan refuses these, and changes nothing then; calls from within its hooks. */
#include "refused.h"
#include "hooked_port.h"
#include "plan_fields.h"

static void refuses(uint8_t status, uint16_t wrong)
{
    uint16_t field = 77;

    REFUSED(status, d.plan, plan_device_try(&d, &field));
    assert_int_equal(field, wrong);
    REFUSED(status, d.plan, plan_device_try(&d, NULL));
    IS(MBM_NOT_INITIALISED, mbm_plan_poll(&d.plan));
}

TEST(a_wrong_field_is_named)
{
    add(MBM_TYPE_UINT16, 0);
    mbm_planField *field = add(MBM_TYPE_UINT32, 20);
#define WRONG(status, member, value) WITH(member, value, refuses(status, 1))
    WRONG(MBM_INVALID_ARGUMENT, field->type, 99);
    WRONG(MBM_INVALID_ARGUMENT, field->table, 5);
    WRONG(MBM_ILLEGAL_DATA_ADDRESS, field->address, 0xFFFF);
    WRONG(MBM_BROADCAST_NOT_ALLOWED, field->unit, 0);
    WRONG(MBM_INVALID_ARGUMENT, field->unit, 300); /* not 44 */
    WRONG(MBM_INVALID_ARGUMENT, field->unit, 256); /* not a broadcast */
    WRONG(MBM_ILLEGAL_DATA_VALUE, field->count, 63);
    WRONG(MBM_INVALID_ARGUMENT, field->bit, 1); /* of a number */
    field->type = MBM_TYPE_BIT;
    WRONG(MBM_INVALID_ARGUMENT, field->bit, 16);
    field->bit = 9;
    WRONG(MBM_INVALID_ARGUMENT, field->count, 8);
    field->bit = 0;
    field->type = MBM_TYPE_UINT32;
    WRONG(MBM_BUFFER_TOO_SMALL, d.setup.readCount, 1);
    d.setup.readCount = 2;
    WRONG(MBM_BUFFER_TOO_SMALL, d.setup.dataWords, 2);
    d.setup.dataWords = 3;
    plan_device_start(&d);
}

TEST(a_setup_that_is_not_complete_is_refused)
{
    add(MBM_TYPE_UINT16, 0);
#define WITHOUT(member, value) WITH(d.setup.member, value, refuses(MBM_INVALID_ARGUMENT, 0xFFFF))
    WITHOUT(fields, NULL);
    WITHOUT(positions, NULL);
    WITHOUT(reads, NULL);
    WITHOUT(data, NULL);
    WITHOUT(requests, NULL);
    WITHOUT(requestCount, 0);
    WITHOUT(requestCount, 17);
    WITHOUT(unitCount, 1);
    WITHOUT(excludedCount, 1);
    WITHOUT(fieldCount, 0);
    WITHOUT(fieldCount, MBM_PLAN_MAX_FIELDS + 1);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_begin(NULL, &d.client, &d.setup, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_begin(&d.plan, NULL, &d.setup, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_begin(&d.plan, &d.client, NULL, NULL));
    memset(&d.client, 0, sizeof d.client);
    refuses(MBM_NOT_INITIALISED, 0xFFFF);
}

TEST(limits_and_ranges_of_a_unit_above_255_are_refused)
{
    mbm_planUnitLimits limits[2] = {{.unit = 255}, {.unit = 256}};
    mbm_planExcludedRange ranges[2] = {{.unit = 255, .table = HOLDING},
                                       {.unit = 301, .table = HOLDING}};

    add(MBM_TYPE_UINT16, 0);
    plan_device_start(&d);
    d.setup.units = limits;
    d.setup.unitCount = 2;
    INVALID(d.plan, plan_device_try(&d, NULL));
    d.setup.unitCount = 1;
    d.setup.excluded = ranges;
    d.setup.excludedCount = 2;
    INVALID(d.plan, plan_device_try(&d, NULL));
    d.setup.excludedCount = 1;
    plan_device_start(&d);
}

TEST(a_plan_that_begins_again_gives_its_requests_up)
{
    mbm_clientRequest more[2];

    memset(more, 0, sizeof more);
    add(MBM_TYPE_UINT16, 0);
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 1);
    plan_device_start(&d);
    assert_int_equal(mbm_client_pending(&d.client), 0);
    IS(MBM_CANCELLED, d.requests[0].status);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 1);
    /* A setup that is not complete is refused before anything is given up. */
    WITH(d.setup.requestCount, 0, INVALID(d.plan, plan_device_try(&d, NULL)));
    INVALID(d.plan, mbm_plan_begin(&d.plan, &d.client, NULL, NULL));
    INVALID(d.plan, mbm_plan_begin(&d.plan, NULL, &d.setup, NULL));
    assert_int_equal(mbm_client_pending(&d.client), 1);
    plan_device_run(&d, 200);
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[0]);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_refresh(&d.plan, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getStatus(&d.plan, 1, NULL));
}

TEST(a_plan_whose_new_table_is_wrong_has_ended)
{
    uint16_t field = 0;

    add(MBM_TYPE_UINT16, 0);
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    d.fields[0].unit = 0;
    IS(MBM_BROADCAST_NOT_ALLOWED, plan_device_try(&d, &field));
    assert_int_equal(field, 0);
    assert_int_equal(mbm_client_pending(&d.client), 0);
    IS(MBM_NOT_INITIALISED, mbm_plan_poll(&d.plan));
    d.fields[0].unit = 1;
    plan_device_start(&d);
    plan_device_run(&d, 200);
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[0]);
}

/* Begins again, with one field of two, in the update of the first. */
static unsigned updates;

static void begin_again(void *context, mbm_plan *plan, uint16_t field)
{
    if (updates++ == 0) {
        d.setup.fieldCount = 1;
        OK(mbm_plan_begin(plan, &d.client, &d.setup, NULL));
    }
}

TEST(a_plan_may_begin_again_in_its_update)
{
    updates = 0;
    add(MBM_TYPE_UINT16, 0);
    add(MBM_TYPE_UINT16, 1);
    d.setup.update = begin_again;
    plan_device_start(&d);
    plan_device_run(&d, 200);
    /* Once for the first field of the old plan, once for the new plan. */
    assert_int_equal(updates, 2);
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[0]);
}

TEST(a_table_that_is_not_grouped_as_the_counts_say_is_refused)
{
    static const uint16_t counts[] = {1, 2};
    uint16_t field = 77;

    add(MBM_TYPE_UINT16, 0);
    add(MBM_TYPE_UINT16, 20);
    add(MBM_TYPE_UINT16, 145);
    d.setup.readCount = 2;
#define TRY(status, wrong)                                                                         \
    REFUSED(status, d.plan, mbm_plan_beginGrouped(&d.plan, &d.client, &d.setup, counts, &field));  \
    assert_int_equal(field, wrong)
    TRY(MBM_INVALID_ARGUMENT, 2); /* 126 registers */
    WITH(d.fields[2].address, 19, TRY(MBM_INVALID_ARGUMENT, 2));
    d.fields[2].address = 144;
    WITH(d.setup.readCount, 1, TRY(MBM_INVALID_ARGUMENT, 0xFFFF));
    WITH(d.setup.dataWords, 125, TRY(MBM_BUFFER_TOO_SMALL, 1));
    d.setup.dataWords = 126;
    OK(mbm_plan_beginGrouped(&d.plan, &d.client, &d.setup, counts, &field));
    assert_int_equal(field, 0xFFFF);
}

TEST(a_wrong_field_of_a_grouped_table_is_named)
{
    static const uint16_t counts[] = {1, 2};
    uint16_t field = 77;

    add(MBM_TYPE_UINT16, 0);
    add(MBM_TYPE_UINT16, 20);
    mbm_planField *last = add(MBM_TYPE_UINT16, 21);
    d.setup.readCount = 2;
#define NAMES(status, member, value) WITH(last->member, value, TRY(status, 2))
    NAMES(MBM_BROADCAST_NOT_ALLOWED, unit, 0);
    NAMES(MBM_INVALID_ARGUMENT, unit, 257); /* not 1 */
    NAMES(MBM_INVALID_ARGUMENT, unit, 2);
    NAMES(MBM_INVALID_ARGUMENT, table, 5);
    NAMES(MBM_INVALID_ARGUMENT, type, 99);
    last->type = MBM_TYPE_UINT32;
    NAMES(MBM_ILLEGAL_DATA_ADDRESS, address, 0xFFFF);
}

/* Each function of the plan is held to its comment in mbm.h: results, limits, NULL.
 * test_plan_refused has every table that is refused. */

enum { TYPES = MBM_TYPE_REGISTERS, UINT16_FIELD = MBM_TYPE_UINT16 - 1 };

static mbm_plan none;

/* A field of two values, a text of four characters or two registers, of every type; its index is
 * that of the type in `types`. */
static void start(void)
{
    plan_device_begin(&d, 0);
    for (uint8_t type = MBM_TYPE_BIT; type <= MBM_TYPE_REGISTERS; type++) {
        uint8_t table = type == MBM_TYPE_BIT ? MBM_TABLE_COILS : MBM_TABLE_HOLDING_REGISTERS;

        plan_device_add(&d, 1, table, type, (uint16_t)(10 * type), 1000)->count =
            type == MBM_TYPE_TEXT ? 4 : 2;
    }
    memset(d.registers, 0, sizeof d.registers);
    plan_device_start(&d);
}

/* In the order of MBM_TYPE_... */
static const struct {
    uint8_t is_integer, is_int32, is_number, is_float, is_text, is_registers;
} types[] = {{1, 1, 1, 0, 0, 0}, {1, 1, 1, 0, 0, 1}, {1, 1, 1, 0, 0, 1}, {1, 1, 1, 0, 0, 1},
             {1, 1, 1, 0, 0, 1}, {1, 0, 1, 0, 0, 1}, {1, 0, 1, 0, 0, 1}, {0, 0, 1, 1, 0, 1},
             {0, 0, 1, 1, 0, 1}, {0, 0, 0, 0, 1, 1}, {0, 0, 0, 0, 0, 1}};

/* One variable for the values of all types. */
static union {
    int64_t integer;
    int32_t int32;
    double number;
    float single;
    char text[8];
    mbm_registers view;
} value;

/* Asserts that a getter returns a status, and changes the value only if that is MBM_OK. */
#define GETS(wanted, call)                                                                         \
    do {                                                                                           \
        memset(&value, 0x77, sizeof value);                                                        \
        if ((wanted) == MBM_OK)                                                                    \
            OK(call);                                                                              \
        else                                                                                       \
            REFUSED(wanted, value, call);                                                          \
    } while (0)

#define OK_IF(is) ((is) ? MBM_OK : MBM_INVALID_ARGUMENT)

TEST_WITH(each_type_has_its_getters, start, NULL)
{
    assert_int_equal(COUNT(types), TYPES);
    plan_device_run(&d, 500);
    for (unsigned i = 0; i < COUNT(types); i++) {
        uint16_t field = (uint16_t)i, index;

        OK(mbm_plan_getStatus(&d.plan, field, NULL));
        for (index = 0; index < 3; index++) {
            int is = index < 2;

            GETS(OK_IF(is && types[i].is_integer),
                 mbm_plan_getInteger(&d.plan, field, index, &value.integer));
            GETS(OK_IF(is && types[i].is_int32),
                 mbm_plan_getInt32(&d.plan, field, index, &value.int32));
            GETS(OK_IF(is && types[i].is_number),
                 mbm_plan_getNumber(&d.plan, field, index, &value.number));
            GETS(OK_IF(is && types[i].is_float),
                 mbm_plan_getFloat(&d.plan, field, index, &value.single));
            GETS(OK_IF(is && types[i].is_number),
                 mbm_plan_getConverted(&d.plan, field, index, NULL, &value.number));
            GETS(OK_IF(is && types[i].is_int32),
                 mbm_plan_getDecimal(&d.plan, field, index, NULL, 0, &value.int32));
        }
        GETS(OK_IF(types[i].is_text), mbm_plan_getText(&d.plan, field, value.text, 5));
        GETS(OK_IF(types[i].is_registers), mbm_plan_getRegisters(&d.plan, field, &value.view));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getInt32(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getNumber(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getFloat(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getConverted(&d.plan, field, 0, NULL, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getDecimal(&d.plan, field, 0, NULL, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getText(&d.plan, field, NULL, 5));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getRegisters(&d.plan, field, NULL));
    }
}

/* Makes all calls that take a field or a read, with a plan and an index. */
static void every_call_returns(uint8_t status, mbm_plan *plan, uint16_t field)
{
    uint32_t age = 7;
    mbm_planReadInfo read;

    GETS(status, mbm_plan_getInteger(plan, field, 0, &value.integer));
    GETS(status, mbm_plan_getInt32(plan, field, 0, &value.int32));
    GETS(status, mbm_plan_getNumber(plan, field, 0, &value.number));
    GETS(status, mbm_plan_getFloat(plan, field, 0, &value.single));
    GETS(status, mbm_plan_getConverted(plan, field, 0, NULL, &value.number));
    GETS(status, mbm_plan_getDecimal(plan, field, 0, NULL, 0, &value.int32));
    IS(status, mbm_plan_checkAvailable(plan, field, 0, NULL));
    GETS(status, mbm_plan_getText(plan, field, value.text, sizeof value.text));
    GETS(status, mbm_plan_getRegisters(plan, field, &value.view));
    REFUSED(status, age, mbm_plan_getStatus(plan, field, &age));
    IS(status, mbm_plan_refresh(plan, field));
    memset(&read, 0x77, sizeof read);
    REFUSED(status, read, mbm_plan_getRead(plan, field, &read));
}

TEST_WITH(a_field_that_does_not_exist_is_refused, start, NULL)
{
    plan_device_run(&d, 500);
    every_call_returns(MBM_INVALID_ARGUMENT, &d.plan, TYPES);
    every_call_returns(MBM_INVALID_ARGUMENT, &d.plan, 0xFFFF);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getRead(&d.plan, 0, NULL));
}

TEST_WITH(a_plan_that_was_never_begun_refuses_every_call, start, NULL)
{
    static const uint16_t count = 1;
    mbm_plan *const plans[] = {NULL, &none};
    uint16_t blocks[PLAN_FIELDS];
    mbm_planSplitting splitting = {.blocks = blocks}, no_blocks = MBM_INIT;

    for (unsigned i = 0; i < COUNT(plans); i++) {
        const uint8_t status = i == 0 ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        every_call_returns(status, plans[i], 0);
        IS(status, mbm_plan_poll(plans[i]));
        IS(status, mbm_plan_pollSplitting(plans[i], &splitting));
        IS(status, mbm_plan_end(plans[i]));
        assert_int_equal(mbm_plan_pollDelay(plans[i]), UINT32_MAX);
    }
    IS(MBM_INVALID_ARGUMENT, mbm_plan_pollSplitting(&d.plan, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_pollSplitting(&d.plan, &no_blocks));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_begin(NULL, &d.client, &d.setup, NULL));
    INVALID(none, mbm_plan_begin(&none, NULL, &d.setup, NULL));
    INVALID(none, mbm_plan_begin(&none, &d.client, NULL, NULL));
#define GROUPED(plan, client, setup, counts)                                                       \
    mbm_plan_beginGrouped((plan), (client), (setup), (counts), NULL)
    IS(MBM_INVALID_ARGUMENT, GROUPED(NULL, &d.client, &d.setup, &count));
    INVALID(none, GROUPED(&none, NULL, &d.setup, &count));
    INVALID(none, GROUPED(&none, &d.client, NULL, &count));
    INVALID(none, GROUPED(&none, &d.client, &d.setup, NULL));
#undef GROUPED
}

TEST_WITH(a_value_is_pending_before_the_first_reply_and_ages_after_it, start, NULL)
{
    mbm_planReadInfo read;
    uint32_t age = 0;

    IS(MBM_PENDING, mbm_plan_getStatus(&d.plan, UINT16_FIELD, &age));
    assert_int_equal(age, UINT32_MAX);
    GETS(MBM_PENDING, mbm_plan_getInteger(&d.plan, UINT16_FIELD, 0, &value.integer));
    OK(mbm_plan_getRead(&d.plan, 0, &read));
    IS(MBM_PENDING, read.status);
    assert_int_equal(mbm_plan_pollDelay(&d.plan), 0);
    plan_device_run(&d, 500);
    OK(mbm_plan_getStatus(&d.plan, UINT16_FIELD, &age));
    assert_in_range(age, 0, 500);
    OK(mbm_plan_end(&d.plan));
    IS(MBM_NOT_INITIALISED, mbm_plan_getStatus(&d.plan, 0, &age));
}

TEST(a_conversion_of_registers_refuses_null_and_what_the_registers_lack)
{
    static const mbm_planField fields[2] = {
        {.unit = 1, .table = HOLDING, .type = MBM_TYPE_UINT16, .address = 1, .intervalMs = 1},
        {.unit = 1, .table = HOLDING, .type = MBM_TYPE_FLOAT, .address = 1, .intervalMs = 1}};
    static const mbm_planConversion real = {.powerField = 1, .flags = MBM_CONVERSION_POWER};
    const uint16_t words[2] = {1, 2};
    mbm_registers one, empty = {0};

    OK(mbm_registers_ofWords(&one, words, 2, 1));
    GETS(MBM_OK, mbm_registers_getConverted(&one, fields, 0, 0, NULL, &value.number));
    GETS(MBM_OK, mbm_registers_getDecimal(&one, fields, 0, 0, NULL, 0, &value.int32));
    IS(MBM_OK, mbm_registers_checkAvailable(&one, fields, 0, 0, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getConverted(&one, fields, 0, 0, NULL, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getDecimal(&one, fields, 0, 0, NULL, 0, NULL));
    GETS(MBM_INVALID_ARGUMENT, mbm_registers_getConverted(&one, NULL, 0, 0, NULL, &value.number));
    GETS(MBM_INVALID_ARGUMENT, mbm_registers_getDecimal(NULL, fields, 0, 0, NULL, 0, &value.int32));
    GETS(MBM_INVALID_ARGUMENT, mbm_registers_getDecimal(&one, fields, 1, 0, NULL, 0, &value.int32));
    GETS(MBM_INVALID_ARGUMENT,
         mbm_registers_getConverted(&one, fields, 0, 0, &real, &value.number));
    GETS(MBM_NOT_INITIALISED,
         mbm_registers_getConverted(&empty, fields, 0, 0, NULL, &value.number));
    IS(MBM_NOT_INITIALISED, mbm_registers_checkAvailable(&empty, fields, 0, 0, NULL));
    OK(mbm_registers_ofWords(&one, words, 1, 1));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_checkAvailable(&one, fields, 1, 0, NULL));
}

/* --- calls from within the hooks of the client's port, from `done` of another request, and from
 * `update` --- */

static hooked_port wire;
static mbm_plan other;
static unsigned entered, updated;
static uint8_t status_in_hooks;

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

    OK(mbm_plan_getNumber(&d.plan, 0, 0, &number));
    assert_true(number == 0x1234);
    OK(mbm_plan_getInteger(&d.plan, 0, 0, &integer));
    assert_int_equal(integer, 0x1234);
    OK(mbm_plan_getInt32(&d.plan, 0, 0, &short_integer));
    assert_int_equal(short_integer, 0x1234);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getFloat(&d.plan, 0, 0, &single));
    OK(mbm_plan_getText(&d.plan, 1, text, sizeof text));
    assert_string_equal(text, "abcd");
    OK(mbm_plan_getRegisters(&d.plan, 1, &registers));
    OK(mbm_plan_getRead(&d.plan, 0, &read));
    assert_int_equal(read.quantity, 3);
}

static void within_port(int hook)
{
    uint32_t age;

    entered++;
    UNCHANGED(d.plan, {
        IS(MBM_BUSY, mbm_plan_poll(&d.plan));
        assert_int_equal(mbm_plan_pollDelay(&d.plan), 0);
        IS(MBM_BUSY, mbm_plan_refresh(&d.plan, 0));
        IS(MBM_BUSY, mbm_plan_end(&d.plan));
        IS(MBM_BUSY, plan_device_try(&d, NULL));
        IS(MBM_BUSY, mbm_plan_begin(&other, &d.client, &d.setup, NULL));
        IS(status_in_hooks, mbm_plan_getStatus(&d.plan, 0, &age));
        if (status_in_hooks == MBM_OK)
            every_value_is_there();
    });
    IS(MBM_PENDING, d.requests[0].status);
}

static void begin_hooked(void)
{
    const mbm_port port = hooked_port_of(&wire);

    rtu();
    memset(&wire, 0, sizeof wire);
    memset(&other, 0, sizeof other);
    wire.step = 500;
    entered = updated = 0;
    status_in_hooks = MBM_PENDING;
    OK(mbm_client_beginRtu(&d.client, &port, d.frame, sizeof d.frame));
    plan_device_add(&d, 17, HOLDING, MBM_TYPE_UINT16, 1, 10000);
    plan_device_add(&d, 17, HOLDING, MBM_TYPE_TEXT, 2, 10000)->count = 4;
    d.setup.update = NULL;
}

/* Polls until the plan's request has ended. */
static void run(void)
{
    OK(mbm_plan_poll(&d.plan));
    wire.within = within_port;
    wire.first = wire.last = wire.length = 0;
    for (unsigned i = 0; i < 3000 && mbm_client_poll(&d.client) == MBM_PENDING; i++)
        if (wire.length > 0 && wire.last == 0)
            hooked_port_arrive_rtu(&wire, 17, "\3\6\x12\x34\x61\x62\x63\x64", 8);
    wire.within = NULL;
    OK(d.requests[0].status);
}

TEST_WITH(no_hook_of_the_clients_port_may_change_the_plan, begin_hooked, NULL)
{
    plan_device_start(&d);
    run();
    assert_true(entered > 3);
    OK(mbm_plan_poll(&d.plan));
    OK(mbm_plan_getStatus(&d.plan, 0, NULL));
    /* Again, while there are values. */
    status_in_hooks = MBM_OK;
    entered = 0;
    OK(mbm_plan_refresh(&d.plan, 1));
    run();
    assert_true(entered > 3);
    OK(mbm_plan_end(&d.plan));
}

static void update(void *context, mbm_plan *of, uint16_t field)
{
    assert_ptr_equal(of, &d.plan);
    OK(mbm_plan_getStatus(&d.plan, field, NULL));
    every_value_is_there();
    /* Polls call no hook that is called already. */
    (void)mbm_client_poll(&d.client);
    OK(mbm_plan_refresh(&d.plan, field));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), 0);
    updated++;
    if (updated == 2) {
        OK(mbm_plan_poll(&d.plan));
        IS(MBM_PENDING, d.requests[0].status);
    }
}

TEST_WITH(update_may_call_every_function, begin_hooked, NULL)
{
    d.setup.update = update;
    plan_device_start(&d);
    run();
    assert_int_equal(updated, 0);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(updated, 2);
    OK(mbm_plan_end(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 0);
}

static void poll_when_done(void *context, mbm_clientRequest *ended)
{
    ++*(unsigned *)context;
    OK(mbm_plan_poll(&d.plan));
    IS(MBM_PENDING, d.requests[0].status);
    IS(MBM_PENDING, mbm_plan_getStatus(&d.plan, 0, NULL));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), UINT32_MAX);
    OK(mbm_plan_end(&d.plan));
    IS(MBM_CANCELLED, d.requests[0].status);
    plan_device_start(&d);
}

TEST_WITH(done_of_another_request_may_call_every_function, begin_hooked, NULL)
{
    unsigned calls = 0;
    mbm_clientRequest own = {.unit = 3, .done = poll_when_done, .context = &calls};

    OK(mbm_client_setResponseTimeout(&d.client, 20));
    plan_device_start(&d);
    IS(MBM_PENDING, mbm_client_readCoils(&d.client, &own, 0, 1));
    for (unsigned i = 0; i < 3000 && mbm_client_poll(&d.client) == MBM_PENDING; i++) {
    }
    assert_int_equal(calls, 1);
    IS(MBM_RESPONSE_TIMED_OUT, own.status);
    OK(mbm_plan_end(&d.plan));
}

/* In TCP frames unit 0 is a unit. */
TEST(unit_0_is_read_over_tcp_and_refused_on_a_serial_line)
{
    uint16_t field = 77;

    plan_device_begin(&d, 1);
    plan_device_add(&d, 0, HOLDING, MBM_TYPE_UINT16, 5, 1000);
    plan_device_add(&d, 1, HOLDING, MBM_TYPE_UINT16, 5, 1000);
    plan_device_start(&d);
    plan_device_run(&d, 500);
    assert_int_equal(plan_device_requests(&d, 0), 1);
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[5]);
    assert_int_equal(plan_device_integer(&d, 1, 0), d.registers[5]);

    plan_device_begin(&d, 0);
    plan_device_add(&d, 1, HOLDING, MBM_TYPE_UINT16, 5, 1000);
    plan_device_add(&d, 0, HOLDING, MBM_TYPE_UINT16, 5, 1000);
    IS(MBM_BROADCAST_NOT_ALLOWED, plan_device_try(&d, &field));
    assert_int_equal(field, 1);
}
