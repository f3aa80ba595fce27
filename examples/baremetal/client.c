/* A Modbus client on a board without an operating system. The main loop queues requests and
 * sleeps whenever the client has nothing to do. The UART's interrupt fills a ring with the
 * received bytes. The requests are those of main.c.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm.h"
#include "report.h"

enum { TIMEOUT = PRESENT_TIMEOUT };

/* A request of main.c: its name, the function that queues it, its unit and the expected
 * status. */
typedef struct task {
    const char *name;
    uint8_t (*queue)(mbm_clientRequest *request);
    uint8_t unit, expected;
} task;

/* All storage is the program's own; mbm allocates nothing. */
static mbm_client client = MBM_INIT;
static mbm_counters counters = MBM_INIT;
static mbm_clientRequest requests[STEPS + 1] = MBM_INIT;
static uint8_t frame[MBM_MAX_FRAME];

/* One buffer for all replies: a serial line has one request in flight at a time, and the
 * reply is noted before the next request begins. */
static uint16_t reply[MBM_MAX_READ_REGISTERS];

static uint16_t report[REPORT_SIZE];
static uint32_t ended_at;

static uint8_t write_register(mbm_clientRequest *r)
{
    return mbm_client_writeSingleRegister(&client, r, 100, 0xBEEF);
}

static uint8_t write_registers(mbm_clientRequest *r)
{
    static const uint16_t words[] = {0x1122, 0x5566, 0x3344};

    r->data = words;
    return mbm_client_writeMultipleRegisters(&client, r, 101, 3);
}

static uint8_t write_coil(mbm_clientRequest *r)
{
    return mbm_client_writeSingleCoil(&client, r, 40, 1);
}

static uint8_t write_coils(mbm_clientRequest *r)
{
    static const uint8_t coils[] = {0xC3, 0xA5, 0x05};

    r->data = coils;
    return mbm_client_writeMultipleCoils(&client, r, 50, 19);
}

static uint8_t read_holding(mbm_clientRequest *r)
{
    return mbm_client_readHoldingRegisters(&client, r, 20, 10);
}

static uint8_t read_input_registers(mbm_clientRequest *r)
{
    return mbm_client_readInputRegisters(&client, r, 30, 10);
}

static uint8_t read_coils(mbm_clientRequest *r)
{
    return mbm_client_readCoils(&client, r, 45, 37);
}

static uint8_t read_inputs(mbm_clientRequest *r)
{
    return mbm_client_readDiscreteInputs(&client, r, 70, 21);
}

static uint8_t mask_write(mbm_clientRequest *r)
{
    return mbm_client_maskWriteRegister(&client, r, 102, 0x00FF, 0x3400);
}

static uint8_t read_write(mbm_clientRequest *r)
{
    static const uint16_t words[] = {0xCAFE, 0xF00D};

    r->data = words;
    return mbm_client_readWriteMultipleRegisters(&client, r, 100, 6, 104, 2);
}

static uint8_t read_longest(mbm_clientRequest *r)
{
    return mbm_client_readHoldingRegisters(&client, r, 0, 125);
}

static uint8_t read_absent_register(mbm_clientRequest *r)
{
    return mbm_client_readHoldingRegisters(&client, r, 60000, 1);
}

static uint8_t write_everywhere(mbm_clientRequest *r)
{
    return mbm_client_writeSingleRegister(&client, r, 130, 0x5A5A);
}

static uint8_t read_what_was_broadcast(mbm_clientRequest *r)
{
    return mbm_client_readHoldingRegisters(&client, r, 130, 1);
}

static uint8_t read_one(mbm_clientRequest *r)
{
    return mbm_client_readHoldingRegisters(&client, r, 0, 1);
}

static uint8_t read_two(mbm_clientRequest *r)
{
    return mbm_client_readHoldingRegisters(&client, r, 100, 2);
}

static const task tasks[STEPS] = {
    [WRITE_REGISTER] = {"write a register", write_register, UNIT, MBM_OK},
    [WRITE_REGISTERS] = {"write registers", write_registers, UNIT, MBM_OK},
    [WRITE_COIL] = {"write a coil", write_coil, UNIT, MBM_OK},
    [WRITE_COILS] = {"write 19 coils", write_coils, UNIT, MBM_OK},
    [READ_HOLDING] = {"read holding registers", read_holding, UNIT, MBM_OK},
    [READ_INPUT_REGISTERS] = {"read input registers", read_input_registers, UNIT, MBM_OK},
    [READ_COILS] = {"read 37 coils", read_coils, UNIT, MBM_OK},
    [READ_INPUTS] = {"read 21 discrete inputs", read_inputs, UNIT, MBM_OK},
    [MASK_WRITE] = {"mask a register", mask_write, UNIT, MBM_OK},
    [READ_WRITE] = {"write 2 registers and read 6", read_write, UNIT, MBM_OK},
    [READ_LONGEST] = {"read 125 registers", read_longest, UNIT, MBM_OK},
    [READ_ABSENT_REGISTER] = {"read an absent register", read_absent_register, UNIT,
                              MBM_ILLEGAL_DATA_ADDRESS},
    [BROADCAST] = {"write a register in every unit", write_everywhere, 0, MBM_OK},
    [READ_WHAT_WAS_BROADCAST] = {"read the broadcast register", read_what_was_broadcast, UNIT,
                                 MBM_OK},
    [ASK_ABSENT_UNIT] = {"read from a unit that is absent", read_one, ABSENT_UNIT,
                         MBM_RESPONSE_TIMED_OUT},
    [READ_AGAIN] = {"read again", read_two, UNIT, MBM_OK},
};

/* Notes the status of a request that has ended, and the sum of the words that it read. */
static void note(void *context, mbm_clientRequest *request)
{
    const task *t = context;
    uint16_t *words = report + REPORT_HEAD + STEP_SIZE * (t - tasks);
    uint8_t i, count = (uint8_t)((request->length + 1u) / 2u);
    uint16_t sum = 0;

    /* Each word is weighted with its position, so that a wrong order changes the sum. */
    for (i = 0; i < count; i++) {
        sum = (uint16_t)(sum + (i + 1u) * reply[i]);
    }
    for (i = 0; i < MBM_MAX_READ_REGISTERS; i++) {
        reply[i] = 0;
    }
    words[STEP_STATUS] = request->status;
    words[STEP_WORDS] = count;
    words[STEP_SUM] = sum;
    if (request->status != t->expected) {
        report[REPORT_UNEXPECTED]++;
    }
    ended_at = clock_micros(0);
    console_print(t->name);
    console_print(": ");
    console_print(mbm_status_text(request->status));
    console_print("\n");
}

/* Queues the steps from `first` to `last`, and sleeps until all have ended. */
static void carry_out(enum step first, enum step last)
{
    unsigned step;

    for (step = first; step <= last; step++) {
        mbm_clientRequest *request = &requests[step];

        request->unit = tasks[step].unit;
        request->reply = reply;
        request->replyBytes = sizeof reply;
        request->done = note;
        request->context = (void *)(uintptr_t)&tasks[step];
        if (tasks[step].queue(request) != MBM_PENDING) {
            note(request->context, request);
        }
    }
    while (mbm_client_poll(&client) == MBM_PENDING) {
        report[REPORT_POLLS]++;
        sleep_at_most(mbm_client_pollDelay(&client));
    }
}

static uint8_t send_report(void)
{
    mbm_clientRequest *request = &requests[STEPS];

    report[REPORT_MAGIC] = REPORT_IS_HERE;
    report[REPORT_STEPS] = STEPS;
    report[REPORT_REQUESTS] = (uint16_t)counters.requests;
    report[REPORT_REPLIES] = (uint16_t)counters.replies;
    report[REPORT_EXCEPTIONS] = (uint16_t)counters.exceptions;
    report[REPORT_BAD_CRC] = (uint16_t)counters.badCrc;
    report[REPORT_TIMEOUTS] = (uint16_t)counters.timeouts;
    report[REPORT_FOREIGN_FRAMES] = (uint16_t)counters.foreignFrames;
    report[REPORT_RESYNCHRONISATIONS] = (uint16_t)counters.resynchronisations;
    report[REPORT_SLEEPS] = (uint16_t)sleeps;
    report[REPORT_LOST_BYTES] = uart_lost();
    request->unit = UNIT;
    request->data = report;
    (void)mbm_client_writeMultipleRegisters(&client, request, REPORT_ADDRESS, REPORT_SIZE);
    while (mbm_client_poll(&client) == MBM_PENDING) {
        sleep_at_most(mbm_client_pollDelay(&client));
    }
    return request->status;
}

int main(void)
{
    mbm_port port = {0};
    uint32_t start;

    uart_start();
    clock_start();
    sleep_start();

    port.read = uart_read;
    port.write = uart_write;
    port.micros = clock_micros;
    port.flush = uart_flush;
    (void)mbm_client_beginRtu(&client, &port, frame, sizeof frame);
    (void)mbm_client_setBaudRate(&client, BAUD);
    (void)mbm_client_setResponseTimeout(&client, TIMEOUT);
    (void)mbm_client_setCounters(&client, &counters);

    carry_out(WRITE_REGISTER, READ_WHAT_WAS_BROADCAST);
    (void)mbm_client_setResponseTimeout(&client, ABSENT_TIMEOUT);
    start = ended_at;
    carry_out(ASK_ABSENT_UNIT, ASK_ABSENT_UNIT);
    report[REPORT_ABSENT_MILLIS] = (uint16_t)((ended_at - start) / 1000u);
    (void)mbm_client_setResponseTimeout(&client, TIMEOUT);
    carry_out(READ_AGAIN, READ_AGAIN);
    if (send_report() != MBM_OK) {
        return 255;
    }
    return report[REPORT_UNEXPECTED];
}
