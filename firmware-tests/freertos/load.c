/* Two tasks read one device under load: a task of higher priority takes the processor for 3 of 8
 * ms, one of lower priority all that is left. Then faults, and after each a right request. `mbm
 * serve` or libmodbus answers as unit 17, whose holding registers 100 and 101 are 2301 and 50. The
 * last line says whether all was right. */
#include "mps2.h"

enum {
    UNIT = 17,
    FIRST = 100,
    COUNT = 2,
    BAUD = 19200,
    REQUESTS = 200,
    HOG_BUSY = 3,
    HOG_REST = 5
};

typedef struct reader {
    mbm_node node;
    uint16_t response[COUNT];
    volatile uint32_t right, wrong;
} reader;

static mbm_port port;
static mbm_line line = MBM_INIT;
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];
static reader readers[2];
static volatile uint32_t spins, hogs, sleepers;
static uint32_t failures;

static uint8_t read(reader *r)
{
    uint8_t status = mbm_freertos_take(&mps2_line.line, pdMS_TO_TICKS(5000));

    if (status == MBM_OK) {
        status = mbm_node_readHoldingRegisters(&r->node, FIRST, COUNT);
        mbm_freertos_give(&mps2_line.line);
    }
    return status;
}

static void say(const char *what, uint32_t number)
{
    mps2_print(what);
    mps2_print(": ");
    mps2_printNumber(number);
    mps2_print("\n");
}

static void expect(const char *what, uint8_t expected, uint8_t status)
{
    mps2_print(what);
    mps2_print(": ");
    mps2_print(mbm_status_text(status));
    if (status != expected) {
        failures++;
        mps2_print(" (not expected)");
    }
    mps2_print("\n");
}

static void is_right(const char *after)
{
    readers[0].response[0] = 0;
    expect(after, MBM_OK, read(&readers[0]));
    if (readers[0].response[0] != 2301)
        failures++;
}

/* Higher priority: takes the processor for HOG_BUSY of each HOG_BUSY + HOG_REST ticks. */
static void take_processor(void *none)
{
    (void)none;
    for (;;) {
        const TickType_t began = xTaskGetTickCount();

        while (xTaskGetTickCount() - began < HOG_BUSY) {
        }
        hogs++;
        vTaskDelay(HOG_REST);
    }
}

/* Lower priority: never sleeps. What it counts, mbm's tasks have left to it. */
static void spin(void *none)
{
    (void)none;
    for (;;)
        spins++;
}

static void read_many(void *parameter)
{
    reader *r = parameter;
    unsigned i;

    for (i = 0; i < REQUESTS; i++) {
        const uint8_t status = read(r);

        if (status == MBM_OK && r->response[0] == 2301 && r->response[1] == 50) {
            r->right++;
        } else {
            r->wrong++;
        }
    }
    sleepers++;
    for (;;)
        vTaskDelay(portMAX_DELAY);
}

static void fault_uart(void)
{
    mps2_stopLine();
    expect("UART not started", MBM_LINE_BUSY, read(&readers[0]));
    mps2_startLine();
    is_right("UART started");
    say("frames that did not leave", mbm_freertos_stalled(&mps2_line));
    failures += mbm_freertos_stalled(&mps2_line) != 1;
}

static void fault_link(void)
{
    mbm_freertos_close(&mps2_line);
    expect("line closed", MBM_LINK_LOST, read(&readers[0]));
    if (mbm_freertos_open(&mps2_line, &port) != MBM_OK)
        failures++;
    is_right("line opened again");
}

/* More bytes than the ring holds, while no task reads it. */
static void fault_ring(void)
{
    static const uint8_t noise[MBM_MAX_FRAME + 44];
    BaseType_t woken = pdFALSE;

    taskENTER_CRITICAL();
    mbm_freertos_receivedFromISR(&mps2_line, noise, sizeof noise, &woken);
    taskEXIT_CRITICAL();
    say("bytes lost", mbm_freertos_lost(&mps2_line));
    failures += mbm_freertos_lost(&mps2_line) != 44;
    is_right("after the lost bytes");
}

static volatile uint8_t holds, other_status;

static void take_in_vain(void *none)
{
    (void)none;
    for (;;) {
        while (!holds)
            vTaskDelay(1);
        other_status = mbm_freertos_take(&mps2_line.line, pdMS_TO_TICKS(50));
        holds = 0;
    }
}

static void fault_mutex(void)
{
    (void)mbm_freertos_take(&mps2_line.line, portMAX_DELAY);
    holds = 1;
    while (holds)
        vTaskDelay(1);
    mbm_freertos_give(&mps2_line.line);
    expect("line of another task", MBM_BUSY, other_status);
    is_right("line given back");
}

static void check(void *parameter)
{
    TaskHandle_t *tasks = parameter;
    unsigned i;

    while (sleepers < 2)
        vTaskDelay(10);
    for (i = 0; i < 2; i++) {
        say("right", readers[i].right);
        say("wrong", readers[i].wrong);
        failures += readers[i].right != REQUESTS;
        say("words of stack that were never used, of 200", uxTaskGetStackHighWaterMark(tasks[i]));
    }
    say("times that the higher priority took the processor", hogs);
    say("rounds of the lower priority", spins);
    failures += hogs == 0 || spins == 0;
    fault_uart();
    fault_link();
    fault_ring();
    fault_mutex();
    say("failures", failures);
    mps2_print(failures ? "load: wrong\n" : "load: all is right\n");
    for (;;)
        vTaskDelay(portMAX_DELAY);
}

int main(void)
{
    static TaskHandle_t tasks[2];
    unsigned i;

    if (mbm_freertos_open(&mps2_line, &port) != MBM_OK)
        return 1;
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, BAUD);
    for (i = 0; i < 2; i++) {
        mbm_node_begin(&readers[i].node, &line, UNIT, readers[i].response, COUNT, NULL, 0);
        mbm_node_setResponseTimeout(&readers[i].node, 1000);
        tasks[i] = mps2_task(read_many, "reader", &readers[i], 2);
    }
    (void)mps2_task(take_processor, "hog", NULL, 4);
    (void)mps2_task(spin, "spinner", NULL, 1);
    (void)mps2_task(check, "check", tasks, 3);
    (void)mps2_task(take_in_vain, "other", NULL, 2);
    mps2_startLine();
    vTaskStartScheduler();
    return 1;
}
