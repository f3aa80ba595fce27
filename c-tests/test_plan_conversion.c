/* Values with a conversion: of a plan, and of registers that were read without one. */
#include "plan_fields.h"

#include <math.h>

static void put_float(uint16_t address, float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    d.registers[address] = (uint16_t)(bits >> 16);
    d.registers[address + 1] = (uint16_t)bits;
}

static void expect(uint16_t field, const mbm_planConversion *conversion, double expected)
{
    double value = -1;

    assert_int_equal(mbm_plan_getConverted(&d.plan, field, 0, conversion, &value), MBM_OK);
    assert_true(value == expected);
}

static void expect_status(uint16_t field, const mbm_planConversion *conversion, uint8_t status)
{
    double value = -1;

    assert_int_equal(mbm_plan_getConverted(&d.plan, field, 0, conversion, &value), status);
    assert_true(value == -1);
}

TEST(an_offset_is_added_after_the_scale_of_the_field)
{
    static const mbm_planConversion celsius = {.offset = -27315, .offsetDecimals = 2};
    int32_t value;

    add(MBM_TYPE_UINT16, 0)->divisor = 10;
    d.registers[0] = 3000;
    read_all();
    /* 300.0 - 273.15: a double of the difference, not a difference of doubles. */
    expect(0, &celsius, 26.85);
    assert_int_equal(mbm_plan_getDecimal(&d.plan, 0, 0, &celsius, 2, &value), MBM_OK);
    assert_int_equal(value, 2685);
    assert_int_equal(mbm_plan_getDecimal(&d.plan, 0, 0, &celsius, 1, &value), MBM_OK);
    assert_int_equal(value, 269);
    expect(0, NULL, 300);
}

TEST(a_power_of_ten_comes_from_its_field_in_the_same_reply)
{
    static const mbm_planConversion power = {.powerField = 1, .flags = MBM_CONVERSION_POWER};
    int32_t value;

    add(MBM_TYPE_INT16, 0);
    add(MBM_TYPE_INT16, 1);
    d.registers[0] = (uint16_t)-2305;
    d.registers[1] = (uint16_t)-1;
    read_all();
    assert_int_equal(d.requested, 1);
    expect(0, &power, -230.5);
    assert_int_equal(mbm_plan_getDecimal(&d.plan, 0, 0, &power, 0, &value), MBM_OK);
    assert_int_equal(value, -231);
    /* The device changes its scale: number and power change in one reply. */
    d.registers[0] = (uint16_t)-23;
    d.registers[1] = 1;
    plan_device_run(&d, 1000);
    expect(0, &power, -230);
    /* SunSpec's "not implemented", and numbers that no device means. */
    d.registers[1] = 0x8000;
    plan_device_run(&d, 1000);
    expect_status(0, &power, MBM_NOT_AVAILABLE);
    d.registers[1] = 11;
    plan_device_run(&d, 1000);
    expect_status(0, &power, MBM_NOT_AVAILABLE);
    assert_int_equal(mbm_plan_getDecimal(&d.plan, 0, 0, &power, 0, &value), MBM_NOT_AVAILABLE);
    d.registers[1] = 0;
    plan_device_run(&d, 1000);
    expect(0, &power, -23);
}

TEST(a_value_whose_power_was_not_read_is_not_available)
{
    static const mbm_planConversion power = {.powerField = 1, .flags = MBM_CONVERSION_POWER};

    add(MBM_TYPE_UINT16, 0);
    /* Another request, which is the only one of the input registers. */
    plan_device_add(&d, 1, MBM_TABLE_INPUT_REGISTERS, MBM_TYPE_INT16, 1, 1000);
    d.registers[0] = 50;
    d.registers[1] = (uint16_t)-1;
    d.silent_function = 4;
    plan_device_start(&d);
    plan_device_run(&d, 50);
    expect_status(0, &power, MBM_NOT_AVAILABLE);
    /* Once the power arrives, the value is there. */
    d.silent_function = 0;
    plan_device_run(&d, 5000);
    expect(0, &power, 5);
    /* A power that fails to arrive is not used for a number that arrives. */
    d.silent_function = 4;
    plan_device_run(&d, 1500);
    assert_int_equal(mbm_plan_getStatus(&d.plan, 0, NULL), MBM_OK);
    assert_int_equal(mbm_plan_getStatus(&d.plan, 1, NULL), MBM_RESPONSE_TIMED_OUT);
    expect_status(0, &power, MBM_NOT_AVAILABLE);
    d.silent_function = 0;
    plan_device_run(&d, 20000);
    expect(0, &power, 5);
}

TEST(a_number_that_means_not_available_is_a_status)
{
    static const uint16_t numbers[] = {0x7FFF, 0xFFFF, 0x8000, 0x0000};
    static const mbm_planConversion listed = {.notAvailable = numbers, .notAvailableCount = 4};
    static const mbm_planConversion standard = {.flags = MBM_CONVERSION_STANDARD};
    char text[8];

    add(MBM_TYPE_INT32, 0);
    add(MBM_TYPE_UINT16, 2);
    add(MBM_TYPE_TEXT, 3)->count = 4;
    d.registers[0] = 0x7FFF;
    d.registers[1] = 0xFFFF;
    d.registers[2] = 0xFFFF;
    d.registers[3] = d.registers[4] = 0;
    read_all();
    expect_status(0, &listed, MBM_NOT_AVAILABLE);
    assert_int_equal(mbm_plan_checkAvailable(&d.plan, 0, 0, &listed), MBM_NOT_AVAILABLE);
    expect(0, &standard, 2147483647);
    expect_status(1, &standard, MBM_NOT_AVAILABLE);
    expect(1, NULL, 65535);
    assert_int_equal(mbm_plan_checkAvailable(&d.plan, 2, 0, &standard), MBM_NOT_AVAILABLE);
    assert_int_equal(mbm_plan_checkAvailable(&d.plan, 2, 0, NULL), MBM_OK);
    expect_status(2, NULL, MBM_INVALID_ARGUMENT);
    d.registers[0] = 0x8000;
    d.registers[1] = 0;
    d.registers[4] = 'x';
    plan_device_run(&d, 1000);
    assert_int_equal(mbm_plan_checkAvailable(&d.plan, 0, 0, &listed), MBM_NOT_AVAILABLE);
    assert_int_equal(mbm_plan_checkAvailable(&d.plan, 0, 0, &standard), MBM_NOT_AVAILABLE);
    assert_int_equal(mbm_plan_checkAvailable(&d.plan, 2, 0, &standard), MBM_OK);
    assert_int_equal(mbm_plan_getText(&d.plan, 2, text, sizeof text), MBM_OK);
    d.registers[1] = 1;
    plan_device_run(&d, 1000);
    expect(0, &listed, -2147483647);
}

TEST(a_float_that_is_not_a_number_has_no_value)
{
    add(MBM_TYPE_FLOAT, 0);
    put_float(0, NAN);
    read_all();
    expect_status(0, NULL, MBM_NOT_AVAILABLE);
    put_float(0, INFINITY);
    plan_device_run(&d, 1000);
    expect(0, NULL, (double)INFINITY);
    put_float(0, 21.5f);
    plan_device_run(&d, 1000);
    expect(0, NULL, 21.5);
}

TEST(registers_are_converted_as_a_plan_converts_them)
{
    static const mbm_planField fields[] = {
        {.unit = 1,
         .table = MBM_TABLE_HOLDING_REGISTERS,
         .type = MBM_TYPE_UINT32,
         .order = MBM_ORDER_CDAB,
         .address = 100,
         .count = 2,
         .intervalMs = 1},
        {.unit = 1, .table = HOLDING, .type = MBM_TYPE_INT16, .address = 104, .intervalMs = 1},
        {.unit = 1,
         .table = HOLDING,
         .type = MBM_TYPE_TEXT,
         .address = 105,
         .count = 3,
         .intervalMs = 1},
    };
    static const mbm_planConversion conversion = {.offset = 5,
                                                  .offsetDecimals = 1,
                                                  .powerField = 1,
                                                  .flags = MBM_CONVERSION_POWER |
                                                           MBM_CONVERSION_STANDARD};
    static const mbm_planConversion standard = {.flags = MBM_CONVERSION_STANDARD};
    uint16_t words[] = {0xFFFF, 0xFFFF, 0x0001, 0x0002, (uint16_t)-3, 0, 0x4100};
    mbm_registers registers;
    double value = -1;
    int32_t decimal = -1;

    assert_int_equal(mbm_registers_ofWords(&registers, words, 7, 100), MBM_OK);
    assert_int_equal(mbm_registers_getConverted(&registers, fields, 0, 0, &conversion, &value),
                     MBM_NOT_AVAILABLE);
    assert_int_equal(mbm_registers_getConverted(&registers, fields, 0, 1, &conversion, &value),
                     MBM_OK);
    assert_true(value == 131.573);
    assert_int_equal(mbm_registers_getDecimal(&registers, fields, 0, 1, &conversion, 2, &decimal),
                     MBM_OK);
    assert_int_equal(decimal, 13157);
    assert_int_equal(mbm_registers_checkAvailable(&registers, fields, 0, 1, NULL), MBM_OK);
    assert_int_equal(mbm_registers_checkAvailable(&registers, fields, 2, 0, &standard), MBM_OK);
    words[6] = 0;
    assert_int_equal(mbm_registers_checkAvailable(&registers, fields, 2, 0, &standard),
                     MBM_NOT_AVAILABLE);
    /* The registers lack the power, and then the number. */
    assert_int_equal(mbm_registers_ofWords(&registers, words, 4, 100), MBM_OK);
    assert_int_equal(mbm_registers_getConverted(&registers, fields, 0, 1, &conversion, &value),
                     MBM_ILLEGAL_DATA_ADDRESS);
    assert_int_equal(mbm_registers_ofWords(&registers, words + 2, 3, 102), MBM_OK);
    assert_int_equal(mbm_registers_getConverted(&registers, fields, 0, 0, &conversion, &value),
                     MBM_ILLEGAL_DATA_ADDRESS);
    assert_int_equal(mbm_registers_checkAvailable(&registers, fields, 0, 2, NULL),
                     MBM_INVALID_ARGUMENT);
    assert_true(value == 131.573);
}

TEST(bytes_of_a_reply_are_converted_too)
{
    static const mbm_planField field = {.unit = 1,
                                        .table = HOLDING,
                                        .type = MBM_TYPE_INT16,
                                        .address = 7,
                                        .intervalMs = 1,
                                        .divisor = 10};
    static const mbm_planConversion conversion = {.offset = -40};
    static const uint8_t bytes[] = {0x01, 0x02};
    mbm_registers registers;
    int32_t value;

    assert_int_equal(mbm_registers_ofBytes(&registers, bytes, 2, 7), MBM_OK);
    assert_int_equal(mbm_registers_getDecimal(&registers, &field, 0, 0, &conversion, 1, &value),
                     MBM_OK);
    assert_int_equal(value, 258 - 400);
}

TEST(a_wrong_conversion_is_refused_and_changes_nothing)
{
    static const mbm_planConversion deep = {.offsetDecimals = 10},
                                    listed = {.notAvailableCount = 1},
                                    beyond = {.powerField = 2, .flags = MBM_CONVERSION_POWER},
                                    real = {.powerField = 1, .flags = MBM_CONVERSION_POWER};
    mbm_planField field = {
        .unit = 1, .table = MBM_TABLE_COILS, .type = MBM_TYPE_BIT, .intervalMs = 1};
    uint16_t word = 1;
    mbm_registers registers;
    int32_t value = -1;

    add(MBM_TYPE_UINT16, 0);
    add(MBM_TYPE_FLOAT, 1);
    expect_status(0, NULL, MBM_NOT_INITIALISED);
    plan_device_start(&d);
    expect_status(0, NULL, MBM_PENDING);
    plan_device_run(&d, 200);
    expect_status(0, &deep, MBM_INVALID_ARGUMENT);
    expect_status(0, &listed, MBM_INVALID_ARGUMENT);
    expect_status(0, &beyond, MBM_INVALID_ARGUMENT);
    expect_status(0, &real, MBM_INVALID_ARGUMENT);
    expect_status(2, NULL, MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_plan_getConverted(&d.plan, 0, 0, NULL, NULL), MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_plan_getConverted(NULL, 0, 0, NULL, &(double){0}), MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_plan_getDecimal(&d.plan, 0, 0, NULL, 10, &value), MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_plan_getDecimal(&d.plan, 1, 0, NULL, 0, &value), MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_registers_ofWords(&registers, &word, 1, 0), MBM_OK);
    assert_int_equal(mbm_registers_getDecimal(&registers, NULL, 0, 0, NULL, 0, &value),
                     MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_registers_getDecimal(NULL, &field, 0, 0, NULL, 0, &value),
                     MBM_INVALID_ARGUMENT);
    assert_int_equal(mbm_registers_getDecimal(&registers, &field, 0, 0, NULL, 0, &value),
                     MBM_INVALID_ARGUMENT);
    field.table = HOLDING;
    field.bit = 16;
    assert_int_equal(mbm_registers_getDecimal(&registers, &field, 0, 0, NULL, 0, &value),
                     MBM_INVALID_ARGUMENT);
    assert_int_equal(value, -1);
    field.bit = 0;
    assert_int_equal(mbm_registers_getDecimal(&registers, &field, 0, 0, NULL, 0, &value), MBM_OK);
    assert_int_equal(value, 1);
}
