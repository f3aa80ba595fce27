/* A plan reads libmodbus's server, on a serial line and over TCP: every value is what the
 * server's memory holds, and a server that is stopped is seen. */
#define _GNU_SOURCE
#include "client.h"
#include "clock.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <unistd.h>

enum { UNIT = 17, FIELDS = 7, WORDS = 128 };

#define ROW(table_, type_, address_, count_)                                                       \
    {                                                                                              \
        .unit = UNIT, .table = (table_), .type = (type_), .address = (address_),                   \
        .count = (count_), .intervalMs = 50                                                        \
    }

static const mbm_planField fields[FIELDS] = {
    ROW(MBM_TABLE_HOLDING_REGISTERS, MBM_TYPE_UINT16, 0, 10),
    ROW(MBM_TABLE_HOLDING_REGISTERS, MBM_TYPE_UINT32, 20, 3),
    ROW(MBM_TABLE_HOLDING_REGISTERS, MBM_TYPE_UINT64, 200, 1),
    ROW(MBM_TABLE_INPUT_REGISTERS, MBM_TYPE_UINT16, 5, 4),
    ROW(MBM_TABLE_COILS, MBM_TYPE_BIT, 3, 20),
    ROW(MBM_TABLE_COILS, MBM_TYPE_BIT, 30, 9),
    ROW(MBM_TABLE_DISCRETE_INPUTS, MBM_TYPE_BIT, 100, 1),
};
static mbm_planPosition positions[FIELDS];
static mbm_planRead reads[FIELDS];
static mbm_clientRequest requests[4];
static uint16_t data[WORDS];

static mbm_planSetup setup = {.fields = fields,
                              .positions = positions,
                              .reads = reads,
                              .data = data,
                              .requests = requests,
                              .backoffMs = 100,
                              .longestBackoffMs = 200,
                              .fieldCount = FIELDS,
                              .readCount = FIELDS,
                              .dataWords = WORDS,
                              .bitGap = 16,
                              .registerGap = 16};
static mbm_plan plan;
static asker a;

static void begin(uint8_t requestCount)
{
    memset(&plan, 0, sizeof plan);
    setup.requestCount = requestCount;
    OK(mbm_client_setResponseTimeout(&a.client, 200));
    OK(mbm_plan_begin(&plan, &a.client, &setup, NULL));
}

/* Polls until every field has a status, or asserts that it gets it in time. */
static void poll_until(uint8_t status)
{
    double until = seconds() + 60;
    uint16_t field = 0;

    while (field < FIELDS) {
        assert_true(seconds() < until);
        OK(mbm_plan_poll(&plan));
        (void)mbm_client_poll(&a.client);
        if (mbm_plan_getStatus(&plan, field, NULL) == status)
            field++;
        else
            usleep(500);
    }
}

/* A number of the server's pattern, the first register the most significant. */
static uint64_t number(unsigned address, unsigned registers)
{
    uint64_t value = 0;

    while (registers-- > 0)
        value = value << 16 | server_pattern(address++);
    return value;
}

static void check_values(const modbus_mapping_t *memory)
{
    for (uint16_t field = 0; field < FIELDS; field++) {
        const mbm_planField *f = &fields[field];
        unsigned size = f->type == MBM_TYPE_UINT64 ? 4 : f->type == MBM_TYPE_UINT32 ? 2 : 1;

        for (uint16_t i = 0; i < f->count; i++) {
            int64_t value = -1;
            uint64_t wanted = number(f->address + size * i, size);

            if (f->table == MBM_TABLE_COILS)
                wanted = memory->tab_bits[f->address + i];
            if (f->table == MBM_TABLE_DISCRETE_INPUTS)
                wanted = memory->tab_input_bits[f->address + i];
            if (f->table == MBM_TABLE_INPUT_REGISTERS)
                wanted = memory->tab_input_registers[f->address + i];
            if (wanted > INT64_MAX) {
                IS(MBM_OUT_OF_RANGE, mbm_plan_getInteger(&plan, field, i, &value));
            } else {
                OK(mbm_plan_getInteger(&plan, field, i, &value));
                assert_true((uint64_t)value == wanted);
            }
        }
    }
}

TEST(every_value_is_that_of_the_server_on_a_line)
{
    server s;
    mbm_planReadInfo read;

    server_start(&s, UNIT);
    asker_begin_rtu(&a, s.line.ours);
    begin(1);
    OK(mbm_plan_getRead(&plan, 4, &read));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getRead(&plan, 5, &read));
    poll_until(MBM_OK);
    check_values(s.mapping);
    /* The plan sees values that change. */
    s.mapping->tab_registers[3] = 4711;
    for (int64_t value = 0; value != 4711;) {
        /* It is an error while a read that took too long is repeated. */
        (void)mbm_plan_getInteger(&plan, 0, 3, &value);
        OK(mbm_plan_poll(&plan));
        (void)mbm_client_poll(&a.client);
    }
    server_stop(&s);
}

TEST(every_value_is_that_of_the_server_over_tcp)
{
    tcp_server s;

    tcp_server_start(&s);
    asker_begin_tcp(&a, s.port);
    begin(4);
    poll_until(MBM_OK);
    check_values(s.mapping);
    OK(mbm_plan_end(&plan));
    mbm_tcp_close(&a.tcp);
    tcp_server_stop(&s);
}

TEST(a_server_that_hangs_up_is_a_lost_link_until_it_is_connected_again)
{
    tcp_server s;

    tcp_server_start(&s);
    asker_begin_tcp(&a, s.port);
    begin(4);
    poll_until(MBM_OK);
    tcp_server_stop(&s);
    poll_until(MBM_LINK_LOST);
    OK(mbm_plan_end(&plan));
    mbm_tcp_close(&a.tcp);
}
