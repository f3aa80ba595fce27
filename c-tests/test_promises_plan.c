/* Each function of the plan is held to its comment in mbm.h: results, limits, NULL.
 * test_plan_refused has every table that is refused. */
#include "refused.h"
#include "plan_device.h"
#include "test.h"

#include <string.h>

enum { TYPES = MBM_TYPE_TEXT, UINT16_FIELD = MBM_TYPE_UINT16 - 1 };

static plan_device d;
static mbm_plan none;

/* A field of two values, a text of four characters, of every type; its index is
 * that of the type in `types`. */
static void start(void)
{
    plan_device_begin(&d, 0);
    for (uint8_t type = MBM_TYPE_BIT; type <= MBM_TYPE_TEXT; type++) {
        uint8_t table = type == MBM_TYPE_BIT ? MBM_TABLE_COILS : MBM_TABLE_HOLDING_REGISTERS;

        plan_device_add(&d, 1, table, type, (uint16_t)(10 * type), 1000)->count =
            type == MBM_TYPE_TEXT ? 4 : 2;
    }
    memset(d.registers, 0, sizeof d.registers);
    plan_device_start(&d);
}

fixture each_test = {start, NULL};

/* In the order of MBM_TYPE_... */
static const struct {
    uint8_t is_integer, is_int32, is_number, is_float, is_text, is_registers;
} types[] = {{1, 1, 1, 0, 0, 0}, {1, 1, 1, 0, 0, 1}, {1, 1, 1, 0, 0, 1}, {1, 1, 1, 0, 0, 1},
             {1, 1, 1, 0, 0, 1}, {1, 0, 1, 0, 0, 1}, {1, 0, 1, 0, 0, 1}, {0, 0, 1, 1, 0, 1},
             {0, 0, 1, 1, 0, 1}, {0, 0, 0, 0, 1, 1}};

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

TEST(each_type_has_its_getters)
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
        }
        GETS(OK_IF(types[i].is_text), mbm_plan_getText(&d.plan, field, value.text, 5));
        GETS(OK_IF(types[i].is_registers), mbm_plan_getRegisters(&d.plan, field, &value.view));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getInt32(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getNumber(&d.plan, field, 0, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getFloat(&d.plan, field, 0, NULL));
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
    GETS(status, mbm_plan_getText(plan, field, value.text, sizeof value.text));
    GETS(status, mbm_plan_getRegisters(plan, field, &value.view));
    REFUSED(status, age, mbm_plan_getStatus(plan, field, &age));
    IS(status, mbm_plan_refresh(plan, field));
    memset(&read, 0x77, sizeof read);
    REFUSED(status, read, mbm_plan_getRead(plan, field, &read));
}

TEST(a_field_that_does_not_exist_is_refused)
{
    plan_device_run(&d, 500);
    every_call_returns(MBM_INVALID_ARGUMENT, &d.plan, TYPES);
    every_call_returns(MBM_INVALID_ARGUMENT, &d.plan, 0xFFFF);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getRead(&d.plan, 0, NULL));
}

TEST(what_was_never_begun_is_refused)
{
    static const uint16_t count = 1;

    every_call_returns(MBM_INVALID_ARGUMENT, NULL, 0);
    every_call_returns(MBM_NOT_INITIALISED, &none, 0);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_poll(NULL));
    IS(MBM_NOT_INITIALISED, mbm_plan_poll(&none));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_end(NULL));
    IS(MBM_NOT_INITIALISED, mbm_plan_end(&none));
    assert_int_equal(mbm_plan_pollDelay(NULL), UINT32_MAX);
    assert_int_equal(mbm_plan_pollDelay(&none), UINT32_MAX);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_begin(NULL, &d.client, &d.setup, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, none, mbm_plan_begin(&none, NULL, &d.setup, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, none, mbm_plan_begin(&none, &d.client, NULL, NULL));
#define GROUPED(plan, client, setup, counts)                                                       \
    mbm_plan_beginGrouped((plan), (client), (setup), (counts), NULL)
    IS(MBM_INVALID_ARGUMENT, GROUPED(NULL, &d.client, &d.setup, &count));
    REFUSED(MBM_INVALID_ARGUMENT, none, GROUPED(&none, NULL, &d.setup, &count));
    REFUSED(MBM_INVALID_ARGUMENT, none, GROUPED(&none, &d.client, NULL, &count));
    REFUSED(MBM_INVALID_ARGUMENT, none, GROUPED(&none, &d.client, &d.setup, NULL));
#undef GROUPED
}

TEST(a_value_is_pending_before_the_first_reply_and_ages_after_it)
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
