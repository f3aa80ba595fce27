/* A task polls a client, which reads two devices without blocking calls; another task has a write
 * sent by the same client. Licence: MIT OR Apache-2.0. */
#include "mps2.h"

enum { FIRST = 100, COUNT = 2, BAUD = 19200, CLIENT_TASK = 3, WRITER_TASK = 2, DEVICES = 2 };

static mbm_port port;
static mbm_client client = MBM_INIT;
static uint8_t frame[MBM_MAX_FRAME];
static mbm_clientRequest reads[DEVICES], order;
static uint16_t words[DEVICES][COUNT];

static void print(const mbm_clientRequest *request, const uint16_t *read)
{
    mps2_print("unit ");
    mps2_printNumber(request->unit);
    if (request->status != MBM_OK) {
        mps2_print(": ");
        mps2_print(mbm_status_text(request->status));
    } else if (read != NULL) {
        mps2_print(", registers 100 and 101: ");
        mps2_printNumber(read[0]);
        mps2_print(" ");
        mps2_printNumber(read[1]);
    } else {
        mps2_print(": written");
    }
    mps2_print("\n");
}

/* Called in the client's task. The request goes into the queue again. */
static void has_read(void *context, mbm_clientRequest *request)
{
    print(request, context);
    (void)mbm_client_readHoldingRegisters(&client, request, FIRST, COUNT);
}

static void has_written(void *context, mbm_clientRequest *request)
{
    print(request, context);
}

/* Polls the client while no other task has it. */
static void poll_forever(void *none)
{
    (void)none;
    for (;;) {
        uint32_t delay;

        (void)mbm_freertos_take(&mps2_line.line, portMAX_DELAY);
        (void)mbm_client_poll(&client);
        delay = mbm_client_pollDelay(&client);
        mbm_freertos_give(&mps2_line.line);
        mbm_freertos_wait(&mps2_line.line, delay);
    }
}

/* Queues a request, and wakes the client's task. */
static void write_forever(void *none)
{
    uint16_t value = 0;

    (void)none;
    for (;;) {
        (void)mbm_freertos_take(&mps2_line.line, portMAX_DELAY);
        order.unit = 17;
        order.done = has_written;
        (void)mbm_client_writeSingleRegister(&client, &order, FIRST, ++value);
        mbm_freertos_give(&mps2_line.line);
        mbm_freertos_wake(&mps2_line.line);
        vTaskDelay(pdMS_TO_TICKS(500));
    }
}

int main(void)
{
    uint8_t i;

    if (mbm_freertos_open(&mps2_line, &port) != MBM_OK)
        return 1;
    mbm_client_beginRtu(&client, &port, frame, sizeof frame);
    mbm_client_setBaudRate(&client, BAUD);
    for (i = 0; i < DEVICES; i++) {
        reads[i].unit = (uint8_t)(17 + i);
        reads[i].reply = words[i];
        reads[i].replyBytes = sizeof words[i];
        reads[i].done = has_read;
        reads[i].context = words[i];
        (void)mbm_client_readHoldingRegisters(&client, &reads[i], FIRST, COUNT);
    }
    (void)mps2_task(poll_forever, "client", NULL, CLIENT_TASK);
    (void)mps2_task(write_forever, "writer", NULL, WRITER_TASK);
    mps2_startLine();
    vTaskStartScheduler();
    return 1;
}
