/* A plan that divides the reads that a device refuses, over a port in memory with a clock of its
 * own. tests/plan_splitting.rs has random devices. */
#include "plan_device.h"
#include "test.h"

enum { COILS = MBM_TABLE_COILS, HOLDING = MBM_TABLE_HOLDING_REGISTERS, SECOND = 1000 };
enum { RETRY = 600 * SECOND };

static plan_device d;
static uint16_t blocks[PLAN_FIELDS];

static void splitting(int is_tcp)
{
    plan_device_begin(&d, is_tcp);
    d.splitting.blocks = blocks;
}

static void rtu(void)
{
    splitting(0);
}

fixture each_test = {rtu, NULL};

/* Fields of one register from address 0 on. */
static void add_registers(uint16_t count)
{
    for (uint16_t i = 0; i < count; i++)
        (void)plan_device_add(&d, 1, HOLDING, MBM_TYPE_UINT16, i, SECOND);
}

static uint8_t status(uint16_t field)
{
    return mbm_plan_getStatus(&d.plan, field, NULL);
}

/* All fields are read but those that the device lacks. */
static void expect_found(void)
{
    for (uint16_t i = 0; i < d.setup.fieldCount; i++) {
        const uint16_t address = d.fields[i].address;
        const uint16_t mask = d.fields[i].table == COILS ? 1 : 0xFFFF;

        IS(d.lacks[address] ? MBM_ILLEGAL_DATA_ADDRESS : MBM_OK, status(i));
        if (!d.lacks[address])
            assert_int_equal(plan_device_integer(&d, i, 0), d.registers[address] & mask);
    }
}

/* Begins the plan, and lets it search until its fields are due again. */
static void search(void)
{
    plan_device_start(&d);
    plan_device_run(&d, 900);
}

static unsigned reads(void)
{
    mbm_planReadInfo read;
    uint16_t count = 0;

    while (mbm_plan_getRead(&d.plan, count, &read) == MBM_OK)
        count++;
    return count;
}

/* Two reads are sent each second, and no other request. */
static void expect_two_reads_a_second(void)
{
    const unsigned before = d.requested;

    plan_device_run(&d, 10 * SECOND);
    assert_int_equal(d.requested - before, 20);
}

TEST(a_register_that_the_device_lacks_is_found_and_the_others_are_read_together)
{
    add_registers(16);
    d.lacks[5] = 1;
    search();
    expect_found();
    assert_int_equal(reads(), 3);
    expect_two_reads_a_second();
    expect_found();
}

TEST(a_register_that_is_missing_between_two_fields_leaves_two_reads)
{
    add_registers(16);
    for (uint16_t i = 11; i < 16; i++)
        d.fields[i].address++;
    d.setup.registerGap = 1;
    d.splitting.retryMs = 15 * SECOND;
    d.lacks[11] = 1;
    plan_device_start(&d);
    assert_int_equal(reads(), 1);
    plan_device_run(&d, 900);
    expect_found();
    assert_int_equal(reads(), 2);
    expect_two_reads_a_second();
    expect_found();
    /* What could not be joined is tried once more, in vain and then with success. */
    plan_device_run(&d, 10 * SECOND);
    assert_int_equal(reads(), 2);
    d.lacks[11] = 0;
    plan_device_run(&d, 10 * SECOND);
    assert_int_equal(reads(), 1);
    expect_found();
}

TEST(only_the_field_that_is_not_there_is_told_of_an_exception)
{
    add_registers(16);
    d.lacks[5] = 1;
    search();
    for (unsigned i = 0; i < d.updated; i++)
        IS(d.updates[i].field == 5 ? MBM_ILLEGAL_DATA_ADDRESS : MBM_OK, d.updates[i].status);
    assert_int_equal(plan_device_updates(&d, 5), 1);
}

TEST(a_field_is_tried_again_after_ten_minutes_and_read_with_the_others_if_it_is_there)
{
    add_registers(16);
    d.lacks[5] = 1;
    for (uint16_t i = 0; i < 16; i++)
        d.fields[i].intervalMs = 60 * SECOND;
    plan_device_start(&d);
    plan_device_run(&d, RETRY - 5 * SECOND);
    assert_int_equal(plan_device_updates(&d, 5), 1);
    d.lacks[5] = 0;
    plan_device_run(&d, 125 * SECOND);
    expect_found();
    assert_int_equal(reads(), 1);
    /* The device loses another one. */
    d.lacks[12] = 1;
    plan_device_run(&d, 125 * SECOND);
    expect_found();
}

TEST(the_time_until_the_next_try_is_a_setting)
{
    add_registers(4);
    d.lacks[2] = 1;
    d.splitting.retryMs = 3 * SECOND;
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    assert_in_range(plan_device_updates(&d, 2), 3, 4);
    expect_found();
}

TEST(a_device_that_refuses_long_reads_is_read_in_shorter_ones)
{
    add_registers(16);
    d.longest = 10;
    search();
    expect_found();
    assert_int_equal(reads(), 2);
    expect_two_reads_a_second();
}

TEST(coils_are_found_too_and_keep_their_values)
{
    for (uint16_t i = 0; i < 16; i++)
        (void)plan_device_add(&d, 1, COILS, MBM_TYPE_BIT, (uint16_t)(3 + i), SECOND);
    search();
    expect_found();
    d.lacks[9] = d.lacks[17] = 1;
    plan_device_run(&d, 2 * SECOND);
    expect_found();
    for (uint16_t i = 0; i < 16; i++)
        assert_int_equal(plan_device_integer(&d, i, 0), d.registers[3 + i] & 1);
}

TEST(several_requests_in_flight_change_nothing)
{
    splitting(1);
    OK(mbm_client_setInFlight(&d.client, 4));
    d.setup.requestCount = 4;
    add_registers(16);
    for (uint16_t i = 0; i < 16; i++) {
        d.fields[i].address = (uint16_t)(i + i / 4 * 10);
        d.fields[i].intervalMs = 60 * SECOND;
    }
    d.lacks[1] = d.lacks[2] = d.lacks[17] = d.lacks[45] = 1;
    plan_device_start(&d);
    assert_int_equal(reads(), 4);
    plan_device_run(&d, 20 * SECOND);
    expect_found();
    memset(d.lacks, 0, sizeof d.lacks);
    plan_device_run(&d, RETRY);
    plan_device_run(&d, 125 * SECOND);
    expect_found();
    assert_int_equal(reads(), 4);
}

TEST(without_storage_a_refused_read_stays_one)
{
    add_registers(4);
    d.lacks[2] = 1;
    d.setup.readCount = 1;
    plan_device_start(&d);
    plan_device_run(&d, 2500);
    for (uint16_t i = 0; i < 4; i++)
        IS(MBM_ILLEGAL_DATA_ADDRESS, status(i));
    assert_int_equal(reads(), 1);
    assert_int_equal(d.requested, 3);
}

TEST(fields_that_were_grouped_before_need_storage_for_more_reads)
{
    const uint16_t counts[1] = {8};

    add_registers(8);
    d.lacks[2] = 1;
    d.setup.readCount = 1;
    d.splitting.readCount = 8;
    OK(mbm_plan_beginGrouped(&d.plan, &d.client, &d.setup, counts, NULL));
    plan_device_run(&d, 900);
    expect_found();
    assert_int_equal(reads(), 3);
}

TEST(a_plan_that_begins_again_has_found_nothing)
{
    add_registers(8);
    d.lacks[2] = 1;
    search();
    expect_found();
    d.lacks[2] = 0;
    plan_device_start(&d);
    assert_int_equal(reads(), 1);
    plan_device_run(&d, 900);
    expect_found();
    assert_int_equal(reads(), 1);
}

TEST(a_bit_and_its_register_are_found_as_one)
{
    for (unsigned i = 0; i < 4; i++) {
        (void)plan_device_add(&d, 1, HOLDING, MBM_TYPE_UINT16, (uint16_t)i, SECOND);
        plan_device_add(&d, 1, HOLDING, MBM_TYPE_BIT, (uint16_t)i, SECOND)->bit = 3;
    }
    d.lacks[2] = 1;
    search();
    for (uint16_t i = 0; i < 8; i++)
        IS(i / 2 == 2 ? MBM_ILLEGAL_DATA_ADDRESS : MBM_OK, status(i));
    assert_int_equal(reads(), 3);
}

TEST(a_silent_unit_is_left_alone_while_it_is_searched)
{
    add_registers(8);
    d.lacks[2] = 1;
    plan_device_start(&d);
    plan_device_run(&d, 20);
    d.answers[1] = SILENT;
    plan_device_run(&d, 10 * SECOND);
    assert_in_range(d.requested, 3, 12);
    d.answers[1] = ANSWERS;
    plan_device_run(&d, 20 * SECOND);
    expect_found();
}

/* --- a power of ten --- */

/* A number, a register, and the number's power of ten. */
static const mbm_planConversion power = {.powerField = 2, .flags = MBM_CONVERSION_POWER};

static void add_scaled(void)
{
    add_registers(3);
    d.fields[0].type = d.fields[2].type = MBM_TYPE_INT16;
    d.registers[0] = 2305;
    d.registers[2] = (uint16_t)-1;
}

static void expect_scaled(double expected)
{
    double value = 0;

    OK(mbm_plan_getConverted(&d.plan, 0, 0, &power, &value));
    assert_true(value == expected);
}

static void expect_nothing(void)
{
    double value;

    IS(MBM_NOT_AVAILABLE, mbm_plan_getConverted(&d.plan, 0, 0, &power, &value));
}

TEST(a_power_of_ten_that_comes_to_lie_in_another_read_is_found_there)
{
    add_scaled();
    search();
    assert_int_equal(reads(), 1);
    expect_scaled(230.5);
    d.lacks[1] = 1;
    plan_device_run(&d, 2 * SECOND);
    assert_int_equal(reads(), 3);
    expect_scaled(230.5);
    /* Each changes with the next reply to its own read. */
    d.registers[0] = 23;
    d.registers[2] = 1;
    plan_device_run(&d, 2 * SECOND);
    expect_scaled(230);
    /* The device has the register between them again: they are one read. */
    d.lacks[1] = 0;
    plan_device_run(&d, RETRY + 5 * SECOND);
    assert_int_equal(reads(), 1);
    expect_scaled(230);
}

TEST(a_value_is_not_available_if_its_power_of_ten_in_another_read_is_not_there)
{
    add_scaled();
    d.lacks[1] = 1;
    search();
    expect_scaled(230.5);
    d.lacks[2] = 1;
    plan_device_run(&d, 2 * SECOND);
    IS(MBM_OK, status(0));
    IS(MBM_ILLEGAL_DATA_ADDRESS, status(2));
    expect_nothing();
    d.lacks[1] = d.lacks[2] = 0;
    plan_device_run(&d, RETRY + 5 * SECOND);
    expect_scaled(230.5);
}

TEST(a_value_has_no_power_of_ten_while_its_read_is_searched_for_the_first_time)
{
    uint32_t ms;

    add_scaled();
    d.lacks[1] = 1;
    plan_device_start(&d);
    for (ms = 0; ms < 900; ms++) {
        double value;

        plan_device_run(&d, 1);
        if (mbm_plan_getConverted(&d.plan, 0, 0, &power, &value) == MBM_OK)
            assert_true(value == 230.5);
    }
    expect_scaled(230.5);
}
