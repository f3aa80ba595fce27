/* A task serves ten holding registers from address 100 as unit 17, and sleeps until bytes come.
 * Another one changes them. Licence: MIT OR Apache-2.0. */
#include "mps2.h"

enum { BASE = 100, SIZE = 10, BAUD = 19200, SERVER_PRIORITY = 3, SENSOR_PRIORITY = 1 };

static uint16_t words[SIZE];
static mbm_registerTable holding = {.words = words, .base = BASE, .size = SIZE};
static mbm_unit unit = {.id = 17};
static mbm_server server = MBM_INIT;
static uint8_t request[MBM_MAX_FRAME];
static mbm_port port;

static void serve(void *parameter)
{
    (void)parameter;
    for (;;) {
        (void)mbm_server_poll(&server);
        mbm_freertos_wait(&mps2_line.line, mbm_server_pollDelay(&server));
    }
}

/* Counts seconds in the first register. A critical section around a value of several registers
 * keeps the server from answering with half of it. */
static void measure(void *parameter)
{
    (void)parameter;
    for (;;) {
        vTaskDelay(pdMS_TO_TICKS(1000));
        taskENTER_CRITICAL();
        words[0]++;
        words[1] = (uint16_t)(3u * words[0]);
        taskEXIT_CRITICAL();
    }
}

int main(void)
{
    if (mbm_freertos_open(&mps2_line, &port) != MBM_OK)
        return 1;
    mbm_unit_serveHoldingRegisters(&unit, &holding);
    mbm_server_beginRtu(&server, &port, &unit, 1, request, sizeof request);
    mbm_server_setBaudRate(&server, BAUD);
    (void)mps2_task(serve, "server", NULL, SERVER_PRIORITY);
    (void)mps2_task(measure, "sensor", NULL, SENSOR_PRIORITY);
    mps2_startLine();
    mps2_print("unit 17 serves the holding registers 100 to 109\n");
    vTaskStartScheduler();
    return 1;
}
