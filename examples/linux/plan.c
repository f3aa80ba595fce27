/* A plan at work: a constant table says which values of which units are wanted, and how often.
 * The plan groups them into reads, makes the reads and says how old each value is.
 *
 *     plan rtu:/dev/ttyUSB0,19200 -s 10
 *     plan tcp:192.168.0.7
 *
 * shows the values of units 17 and 18 once a second. -s is how many seconds (until Ctrl-C).
 * `make plan` runs it without hardware, where unit 17 answers and unit 18 does not.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "line.h"
#include "trace.h"

#include <inttypes.h>
#include <stdio.h>
#include <unistd.h>

enum { FIELDS = 10, WORDS = 64, REQUESTS = 4, HOLDING = MBM_TABLE_HOLDING_REGISTERS };

/* The table: it may stay in flash. */
static const mbm_planField fields[FIELDS] = {
    {.unit = 17,
     .table = HOLDING,
     .type = MBM_TYPE_UINT16,
     .address = 0,
     .intervalMs = 500,
     .divisor = 10},
    {.unit = 17,
     .table = HOLDING,
     .type = MBM_TYPE_UINT16,
     .address = 1,
     .intervalMs = 500,
     .divisor = 10},
    {.unit = 17,
     .table = HOLDING,
     .type = MBM_TYPE_UINT16,
     .address = 2,
     .intervalMs = 500,
     .divisor = 10},
    {.unit = 17,
     .table = HOLDING,
     .type = MBM_TYPE_INT32,
     .address = 6,
     .intervalMs = 500,
     .divisor = 1000},
    {.unit = 17,
     .table = HOLDING,
     .type = MBM_TYPE_UINT32,
     .address = 20,
     .intervalMs = 2000,
     .order = MBM_ORDER_CDAB},
    {.unit = 17,
     .table = HOLDING,
     .type = MBM_TYPE_UINT32,
     .address = 22,
     .intervalMs = 2000,
     .order = MBM_ORDER_CDAB},
    {.unit = 17,
     .table = MBM_TABLE_INPUT_REGISTERS,
     .type = MBM_TYPE_INT16,
     .address = 40,
     .intervalMs = 1000,
     .divisor = 100},
    {.unit = 17, .table = MBM_TABLE_COILS, .type = MBM_TYPE_BIT, .address = 3, .intervalMs = 1000},
    {.unit = 17, .table = MBM_TABLE_COILS, .type = MBM_TYPE_BIT, .address = 9, .intervalMs = 1000},
    {.unit = 18, .table = HOLDING, .type = MBM_TYPE_UINT16, .address = 0, .intervalMs = 1000},
};
static const char *const names[FIELDS] = {
    "voltage 1 (V)",    "voltage 2 (V)",   "voltage 3 (V)", "power (kW)",    "energy in (kWh)",
    "energy out (kWh)", "temperature (C)", "pump runs",     "valve is open", "level of unit 18"};

static mbm_planPosition positions[FIELDS];
static mbm_planRead reads[FIELDS];
static mbm_clientRequest requests[REQUESTS] = MBM_INIT;
static uint16_t data[WORDS];
static unsigned updates;

/* Called for each field whose read has ended. */
static void count_update(void *context, mbm_plan *plan, uint16_t field)
{
    (void)context;
    (void)plan;
    (void)field;
    updates++;
}

static const mbm_planSetup setup = {.fields = fields,
                                    .positions = positions,
                                    .reads = reads,
                                    .data = data,
                                    .requests = requests,
                                    .update = count_update,
                                    .fieldCount = FIELDS,
                                    .readCount = FIELDS,
                                    .dataWords = WORDS,
                                    .bitGap = 16,
                                    .registerGap = 8,
                                    .requestCount = REQUESTS};
static mbm_plan plan = MBM_INIT;
static line at;

static void show_reads(void)
{
    mbm_planReadInfo read;
    uint16_t count = 0;

    printf("the plan reads %d fields with these requests:\n", FIELDS);
    for (; mbm_plan_getRead(&plan, count, &read) == MBM_OK; count++)
        printf("  unit %u, %s: %u from %u on, every %" PRIu32 " ms\n", read.unit,
               line_tables(read.table), read.quantity, read.address, read.intervalMs);
}

static void show_values(uint32_t second)
{
    uint16_t field;

    printf("second %" PRIu32 ", %u updates\n", second, updates);
    for (field = 0; field < FIELDS; field++) {
        uint32_t age;
        uint8_t status = mbm_plan_getStatus(&plan, field, &age);
        double value;

        printf("  %-18s", names[field]);
        if (mbm_plan_getNumber(&plan, field, 0, &value) == MBM_OK)
            printf("%14.10g  %5" PRIu32 " ms old", value, age);
        else
            printf("%14s  %11s", "-", "");
        printf("  %s\n", mbm_status_text(status));
    }
    fflush(stdout);
}

static const char USAGE[] = "plan PLACE [-s SECONDS]\n"
                            "  -s SECONDS       until Ctrl-C if left out";

int main(int argc, char **argv)
{
    uint32_t begin, second = 0;
    long seconds = 0;
    int option;
    uint16_t wrong;
    uint8_t status;

    trace_options(&argc, argv);
    if (line_wants_help(argc, argv))
        return line_usage(0, USAGE);
    while ((option = getopt(argc, argv, "s:")) != -1) {
        if (option != 's')
            return line_usage(1, USAGE);
        seconds = line_number(optarg, 1, 1000000);
    }
    if (argc - optind != 1)
        return line_usage(1, USAGE);
    if (line_open(&at, argv[optind]) != 0)
        return 1;
    (void)mbm_client_setResponseTimeout(&at.client, 300);
    status = mbm_plan_begin(&plan, &at.client, &setup, &wrong);
    if (status != MBM_OK) {
        fprintf(stderr, "plan: field %u: %s\n", wrong, mbm_status_text(status));
        return 1;
    }
    show_reads();
    begin = line_milliseconds();
    while (!line_ended && (seconds == 0 || second < (uint32_t)seconds)) {
        uint32_t delay, passed;

        (void)mbm_plan_poll(&plan);
        line_poll(&at);
        passed = line_milliseconds() - begin;
        if (passed >= (second + 1) * 1000) {
            show_values(++second);
            continue;
        }
        delay = mbm_plan_pollDelay(&plan) / 1000;
        passed = (second + 1) * 1000 - passed;
        line_rest(&at, delay < passed ? delay : passed);
    }
    (void)mbm_plan_end(&plan);
    line_close(&at);
    return 0;
}
