/* How a plan groups fields into reads, beside go-modbus-client, on made-up tables with overlaps.
 * That library sorts the fields of a unit by address. It begins a request where the limit or an
 * excluded range demands it, whatever lies between the fields. */
#include "memory_port.h"
#include "test.h"

enum { MOST = 1000, FIRST_EXCLUDED = 300, LAST_EXCLUDED = 319, NEAR_EXCLUDED = 280 };

/* The requests, and the bits and registers in them, by go-modbus-client. */
static const struct {
    unsigned requests, quantity;
} expected[] = {
#include "grouping/expected.h"
};

static uint32_t state;

/* As `below` in grouping/main.go. */
static uint32_t below(uint32_t limit)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 16) % limit;
}

static mbm_planField field_of(uint32_t shape, uint32_t characters, int is_bits)
{
    static const uint8_t types[] = {MBM_TYPE_FLOAT,  MBM_TYPE_FLOAT, MBM_TYPE_DOUBLE,
                                    MBM_TYPE_TEXT,   MBM_TYPE_BIT,   MBM_TYPE_BIT,
                                    MBM_TYPE_UINT16, MBM_TYPE_UINT16};
    mbm_planField field = {.table = MBM_TABLE_COILS, .type = MBM_TYPE_BIT, .intervalMs = 1000};

    if (is_bits)
        return field;
    field.table = MBM_TABLE_HOLDING_REGISTERS;
    field.type = types[shape];
    if (field.type == MBM_TYPE_TEXT)
        field.count = (uint16_t)characters;
    if (field.type == MBM_TYPE_BIT)
        field.bit = (uint8_t)(characters / 8);
    return field;
}

/* As `fields` in grouping/main.go. */
static uint16_t make_table(uint32_t number, mbm_planField *fields, mbm_planSetup *setup)
{
    static const uint16_t counts[] = {5, 10, 20, 50, 100, 200, 500, 1000};
    uint16_t made = 0;

    state = number;
    uint32_t count = counts[below(8)];
    uint32_t spread = 2 + below(20);
    setup->registersPerRead = setup->bitsPerRead = (uint16_t)(20 + below(106));
    setup->excludedCount = below(3) == 0;
    int is_bits = below(4) == 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t shape = below(8);
        const uint16_t unit = (uint16_t)(1 + below(3));
        const uint16_t address = (uint16_t)below(count * spread);
        const uint32_t characters = 8 * (1 + below(4));

        if (address > LAST_EXCLUDED || address < NEAR_EXCLUDED) {
            fields[made] = field_of(shape, characters, is_bits);
            fields[made].unit = unit;
            fields[made++].address = address;
        }
    }
    return made;
}

TEST(a_plan_needs_no_request_more_than_go_modbus_client)
{
    static mbm_planField fields[MOST];
    static mbm_planPosition positions[MOST];
    static mbm_planRead reads[MOST];
    static uint16_t data[0xFFFF];
    static const mbm_planExcludedRange excluded[] = {
        {.first = FIRST_EXCLUDED, .last = LAST_EXCLUDED, .table = MBM_TABLE_COILS},
        {.first = FIRST_EXCLUDED, .last = LAST_EXCLUDED, .table = MBM_TABLE_HOLDING_REGISTERS}};
    unsigned theirs = 0, ours = 0;

    for (uint32_t number = 0; number < COUNT(expected); number++) {
        mbm_planSetup setup = {.fields = fields,
                               .positions = positions,
                               .reads = reads,
                               .data = data,
                               .excluded = excluded,
                               .dataWords = COUNT(data),
                               .registerGap = 0xFFFF,
                               .bitGap = 0xFFFF};
        uint8_t frame[MBM_MAX_TCP_FRAME], reply[MBM_MAX_TCP_FRAME];
        memory_port memory = {0};
        const mbm_port port = memory_port_of(&memory);
        mbm_clientRequest request = MBM_INIT;
        mbm_client client = MBM_INIT;
        mbm_plan plan = MBM_INIT;
        mbm_planReadInfo info;
        unsigned requests = 0, quantity = 0;

        setup.fieldCount = setup.readCount = make_table(number, fields, &setup);
        setup.excludedCount = setup.excludedCount ? COUNT(excluded) : 0;
        setup.requests = &request;
        setup.requestCount = 1;
        OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, reply, sizeof reply));
        OK(mbm_plan_begin(&plan, &client, &setup, NULL));
        while (mbm_plan_getRead(&plan, (uint16_t)requests, &info) == MBM_OK) {
            quantity += info.quantity;
            requests++;
        }
        mbm_plan_end(&plan);
        assert_int_equal(requests, expected[number].requests);
        assert_true(quantity <= expected[number].quantity);
        ours += quantity;
        theirs += expected[number].quantity;
    }
    /* docs/plan.md has these figures. */
    assert_int_equal(theirs, 259257);
    assert_int_equal(ours, 236068);
}
