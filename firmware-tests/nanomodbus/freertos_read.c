/* examples/freertos/read_registers.c over nanoMODBUS, for scripts/bench/kits: two tasks share a
 * line. nanoMODBUS waits in its read function, so that sleeps a tick while nothing has come. With
 * WITHOUT it is the same program without Modbus. Licence: MIT OR Apache-2.0. */
#include "mps2.h"

enum { FIRST = 100, COUNT = 2, PRIORITY = 2 };

/* A device, and the place of what was read from it. */
typedef struct device {
    uint8_t unit;
    uint16_t pause; /* milliseconds */
    uint16_t response[COUNT];
} device;

static mbm_port port;
static device meter = {.unit = 17, .pause = 1000}, pump = {.unit = 18, .pause = 300};

#ifndef WITHOUT
#include "nanomodbus.h"

static nmbs_t nmbs;

/* Milliseconds; a negative time has no end. */
static int32_t receive(uint8_t *bytes, uint16_t count, int32_t timeout, void *context)
{
    const TickType_t began = xTaskGetTickCount();
    uint16_t taken = 0;

    (void)context;
    while (taken < count) {
        const int16_t more = port.read(port.context, bytes + taken, (uint16_t)(count - taken));

        if (more > 0)
            taken = (uint16_t)(taken + more);
        else if (timeout >= 0 && xTaskGetTickCount() - began > pdMS_TO_TICKS((uint32_t)timeout))
            break;
        else
            vTaskDelay(1);
    }
    return taken;
}

static int32_t transmit(const uint8_t *bytes, uint16_t count, int32_t timeout, void *context)
{
    (void)timeout;
    (void)context;
    return port.write(port.context, bytes, count);
}

static void begin_line(void)
{
    nmbs_platform_conf platform;

    nmbs_platform_conf_create(&platform);
    platform.transport = NMBS_TRANSPORT_RTU;
    platform.read = receive;
    platform.write = transmit;
    (void)nmbs_client_create(&nmbs, &platform);
    nmbs_set_read_timeout(&nmbs, 500);
    nmbs_set_byte_timeout(&nmbs, 20);
}

static int ask(device *d)
{
    nmbs_set_destination_rtu_address(&nmbs, d->unit);
    return nmbs_read_holding_registers(&nmbs, FIRST, COUNT, d->response) == NMBS_ERROR_NONE;
}
#else
static void begin_line(void) {}

static int ask(device *d)
{
    (void)d;
    return 1;
}
#endif

static void print(const device *d, int isRight)
{
    mps2_print("unit ");
    mps2_printNumber(d->unit);
    if (isRight) {
        mps2_print(", registers 100 and 101: ");
        mps2_printNumber(d->response[0]);
        mps2_print(" ");
        mps2_printNumber(d->response[1]);
    } else {
        mps2_print(", no registers");
    }
    mps2_print("\n");
}

static void read_forever(void *parameter)
{
    device *d = parameter;

    for (;;) {
        if (mbm_freertos_take(&mps2_line.line, pdMS_TO_TICKS(5000)) == MBM_OK) {
            print(d, ask(d));
            mbm_freertos_give(&mps2_line.line);
        }
        vTaskDelay(pdMS_TO_TICKS(d->pause));
    }
}

int main(void)
{
    if (mbm_freertos_open(&mps2_line, &port) != MBM_OK)
        return 1;
    begin_line();
    (void)mps2_task(read_forever, "meter", &meter, PRIORITY);
    (void)mps2_task(read_forever, "pump", &pump, PRIORITY);
    mps2_startLine();
    vTaskStartScheduler();
    return 1;
}
