/* Two tasks read two devices on one line: holding registers 100 and 101 of the units 17 and 18.
 * While one waits for a reply, it sleeps. Licence: MIT OR Apache-2.0. */
#include "mps2.h"

enum { FIRST = 100, COUNT = 2, BAUD = 19200, PRIORITY = 2 };

/* A device: its node, and the place of what was read from it. */
typedef struct device {
    mbm_node node;
    uint8_t unit;
    uint16_t pause; /* milliseconds */
    uint16_t response[COUNT];
} device;

static mbm_port port;
static mbm_line line = MBM_INIT;
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];
static device meter = {.unit = 17, .pause = 1000}, pump = {.unit = 18, .pause = 300};

static void print(const device *d, uint8_t status)
{
    mps2_print("unit ");
    mps2_printNumber(d->unit);
    if (status == MBM_OK) {
        mps2_print(", registers 100 and 101: ");
        mps2_printNumber(d->response[0]);
        mps2_print(" ");
        mps2_printNumber(d->response[1]);
    } else {
        mps2_print(", no registers: ");
        mps2_print(mbm_status_text(status));
    }
    mps2_print("\n");
}

static void read_forever(void *parameter)
{
    device *d = parameter;

    for (;;) {
        /* One task at a time has the line and the console. */
        uint8_t status = mbm_freertos_take(&mps2_line.line, pdMS_TO_TICKS(5000));

        if (status == MBM_OK) {
            status = mbm_node_readHoldingRegisters(&d->node, FIRST, COUNT);
            print(d, status);
            mbm_freertos_give(&mps2_line.line);
        }
        vTaskDelay(pdMS_TO_TICKS(d->pause));
    }
}

static void begin(device *d, const char *name)
{
    mbm_node_begin(&d->node, &line, d->unit, d->response, COUNT, NULL, 0);
    mbm_node_setResponseTimeout(&d->node, 500); /* milliseconds */
    (void)mps2_task(read_forever, name, d, PRIORITY);
}

int main(void)
{
    if (mbm_freertos_open(&mps2_line, &port) != MBM_OK)
        return 1;
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, BAUD);
    begin(&meter, "meter");
    begin(&pump, "pump");
    mps2_startLine();
    vTaskStartScheduler();
    return 1;
}
