/* A plan of the fields of device.yaml above the client of an RTU line: with the table that mbm
 * header writes, or with BY_HAND as one writes it. */
#define DEVICE_PLAN
#ifdef BY_HAND
#include "mbm.h"

enum {
    DEVICE_RELAY,
    DEVICE_ALARM,
    DEVICE_SETPOINT,
    DEVICE_MODE,
    DEVICE_VOLTAGE_1,
    DEVICE_VOLTAGE_2,
    DEVICE_POWER,
    DEVICE_FREQUENCY,
    DEVICE_VERSION,
    DEVICE_ENERGY,
    DEVICE_FIELDS,
    DEVICE_READS = 7,
    DEVICE_DATA_WORDS = 13,
    DEVICE_MODE_AUTOMATIC = 1
};

#define INPUT(address_, type_, ...)                                                                \
    {                                                                                              \
        .unit = 17, .table = MBM_TABLE_INPUT_REGISTERS, .type = (type_), .address = (address_),    \
        __VA_ARGS__                                                                                \
    }
#define HOLDING(address_, type_, ...)                                                              \
    {                                                                                              \
        .unit = 17, .table = MBM_TABLE_HOLDING_REGISTERS, .type = (type_), .address = (address_),  \
        __VA_ARGS__                                                                                \
    }

static const mbm_planField device_fields[DEVICE_FIELDS] = {
    [DEVICE_VOLTAGE_1] = INPUT(0, MBM_TYPE_UINT16, .intervalMs = 1000, .divisor = 10),
    [DEVICE_VOLTAGE_2] = INPUT(1, MBM_TYPE_UINT16, .intervalMs = 1000, .divisor = 10),
    [DEVICE_POWER] = INPUT(2, MBM_TYPE_INT32, .intervalMs = 1000, .divisor = 10),
    [DEVICE_ENERGY] = INPUT(4, MBM_TYPE_UINT32, .order = MBM_ORDER_CDAB, .intervalMs = 5000),
    [DEVICE_FREQUENCY] = INPUT(6, MBM_TYPE_FLOAT, .intervalMs = 1000),
    [DEVICE_SETPOINT] = HOLDING(100, MBM_TYPE_INT16, .intervalMs = 1000, .divisor = 10),
    [DEVICE_MODE] = HOLDING(101, MBM_TYPE_UINT16, .intervalMs = 1000),
    [DEVICE_VERSION] = HOLDING(102, MBM_TYPE_UINT16, .intervalMs = 5000),
    [DEVICE_RELAY] = {.unit = 17,
                      .table = MBM_TABLE_COILS,
                      .type = MBM_TYPE_BIT,
                      .intervalMs = 1000},
    [DEVICE_ALARM] = {.unit = 17,
                      .table = MBM_TABLE_DISCRETE_INPUTS,
                      .type = MBM_TYPE_BIT,
                      .intervalMs = 1000},
};

static const uint16_t device_counts[DEVICE_READS] = {1, 1, 2, 3, 1, 1, 1};
#else
#include "device.h"
#endif

#include "client.h"

static mbm_planPosition positions[DEVICE_FIELDS];
static mbm_planRead reads[DEVICE_READS];
static uint16_t data[DEVICE_DATA_WORDS];

static const mbm_planSetup setup = PLAN_SETUP(device_fields, .readCount = DEVICE_READS);

int main(void)
{
    static mbm_plan plan;
    int32_t value;
    float hertz;

    begin_port();
    USED(&setup);
    (void)mbm_client_beginRtu(&client, &port, frame, sizeof frame);
    uart = mbm_plan_beginGrouped(&plan, &client, &setup, device_counts, NULL);
    for (;;) {
        (void)mbm_plan_poll(&plan);
        (void)mbm_client_poll(&client);
        if (mbm_plan_getInt32(&plan, DEVICE_POWER, 0, &value) == MBM_OK)
            ticks = (uint32_t)value;
        if (mbm_plan_getInt32(&plan, DEVICE_MODE, 0, &value) == MBM_OK &&
            value == DEVICE_MODE_AUTOMATIC)
            uart = 1;
        if (mbm_plan_getFloat(&plan, DEVICE_FREQUENCY, 0, &hertz) == MBM_OK)
            USED(&hertz);
    }
}
