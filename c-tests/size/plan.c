/* A plan of ten fields above the client of an RTU line with every function: WITHOUT_MBM leaves
 * out the plan alone, GROUPED the code that groups the fields. Its table and its storage are not
 * counted. */
#ifdef WITHOUT_MBM
#define PLAN(call) 0
#undef WITHOUT_MBM
#else
#define PLAN(call) (call)
#define WITH_PLAN
#endif
#include "client.h"

#ifdef GROUPED
enum { READS = 4 };

#ifdef WITH_PLAN
static const uint16_t counts[READS] = {6, 2, 1, 1};
#endif

#define BEGIN(plan) mbm_plan_beginGrouped((plan), &client, &setup, counts, NULL)
#else
enum { READS = 10 };

#define BEGIN(plan) mbm_plan_begin((plan), &client, &setup, NULL)
#endif

#define FIELD(address_, type_, interval)                                                           \
    {                                                                                              \
        .unit = 1, .table = MBM_TABLE_HOLDING_REGISTERS, .type = (type_), .address = (address_),   \
        .intervalMs = (interval), .divisor = 10                                                    \
    }

static const mbm_planField fields[10] = {
    FIELD(0, MBM_TYPE_UINT16, 1000),  FIELD(1, MBM_TYPE_UINT16, 1000),
    FIELD(2, MBM_TYPE_UINT16, 1000),  FIELD(10, MBM_TYPE_INT32, 1000),
    FIELD(12, MBM_TYPE_INT32, 1000),  FIELD(14, MBM_TYPE_INT32, 1000),
    FIELD(20, MBM_TYPE_UINT32, 5000), FIELD(22, MBM_TYPE_UINT32, 5000),
    FIELD(40, MBM_TYPE_UINT32, 5000), FIELD(50, MBM_TYPE_UINT16, 5000),
};
static mbm_planPosition positions[10];
static mbm_planRead reads[READS];
static uint16_t data[WORDS];

static void update(void *context, mbm_plan *plan, uint16_t field)
{
    int32_t value;

    (void)context;
    (void)field;
    USED(plan);
    if (PLAN(mbm_plan_getStatus(plan, field, NULL)) == MBM_OK &&
        PLAN(mbm_plan_getInt32(plan, field, 0, &value)) == MBM_OK) {
        USED(&value);
        uart = (uint8_t)value;
    }
}

static const mbm_planSetup setup =
    PLAN_SETUP(fields, .readCount = READS, .update = update, .registerGap = 8);

int main(void)
{
    static mbm_plan plan;

    begin_port();
    USED(&setup);
    USED(&plan);
    (void)CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    (void)PLAN(BEGIN(&plan));
    for (;;) {
        (void)PLAN(mbm_plan_poll(&plan));
        every_function();
    }
}
