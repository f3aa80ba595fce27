/* The values of a plan in every type and order, and its reads. */
#include "plan_fields.h"

#include <math.h>

/* Registers of a number, the most significant first, as a device with `order` has them. */
static void put(uint16_t address, uint64_t number, unsigned registers, uint8_t order)
{
    for (unsigned i = 0; i < registers; i++) {
        unsigned at = order == MBM_ORDER_CDAB || order == MBM_ORDER_DCBA ? i : registers - 1 - i;
        uint16_t word = (uint16_t)(number >> (16 * i));

        if (order == MBM_ORDER_BADC || order == MBM_ORDER_DCBA)
            word = (uint16_t)(word << 8 | word >> 8);
        d.registers[address + at] = word;
    }
}

TEST_WITH(integers_have_their_sign_in_every_order, NULL, NULL)
{
    static const struct {
        uint8_t type;
        unsigned registers;
        uint64_t bits;
        int64_t value;
    } numbers[] = {
        {MBM_TYPE_UINT16, 1, 0xFFFE, 0xFFFE},
        {MBM_TYPE_INT16, 1, 0xFFFE, -2},
        {MBM_TYPE_UINT32, 2, 0xAE415652, 2923517522},
        {MBM_TYPE_INT32, 2, 0xAE415652, -1371449774},
        {MBM_TYPE_UINT64, 4, 0x0123456789ABCDEF, 0x0123456789ABCDEF},
        {MBM_TYPE_INT64, 4, 0xFFFFFFFFFFFFFFFE, -2},
        {MBM_TYPE_INT64, 4, 0x8000000000000000, INT64_MIN},
    };

    for (uint8_t order = MBM_ORDER_DEFAULT; order <= MBM_ORDER_DCBA; order++) {
        plan_device_begin(&d, 0);
        for (unsigned i = 0; i < COUNT(numbers); i++) {
            add(numbers[i].type, (uint16_t)(10 * i))->order = order;
            put((uint16_t)(10 * i), numbers[i].bits, numbers[i].registers, order);
        }
        d.setup.registerGap = 10;
        read_all();
        assert_int_equal(d.requested, 1);
        for (unsigned i = 0; i < COUNT(numbers); i++)
            assert_true(plan_device_integer(&d, (uint16_t)i, 0) == numbers[i].value);
        for (unsigned i = 1; i < COUNT(numbers); i++) {
            int32_t value;
            uint8_t fits = numbers[i].value <= INT32_MAX && numbers[i].registers < 4;

            assert_int_equal(mbm_plan_getInt32(&d.plan, (uint16_t)i, 0, &value) == MBM_OK, fits);
            if (fits)
                assert_int_equal(value, numbers[i].value);
        }
    }
}

TEST_WITH(floats_and_doubles_are_numbers_too, NULL, NULL)
{
    const float pi = 3.14159274f;
    const double e = 2.718281828459045;
    uint32_t pi_bits;
    uint64_t e_bits;

    memcpy(&pi_bits, &pi, sizeof pi);
    memcpy(&e_bits, &e, sizeof e);
    for (uint8_t order = MBM_ORDER_ABCD; order <= MBM_ORDER_DCBA; order++) {
        float single = 0;
        double wide = 0;
        int64_t none = 77;

        plan_device_begin(&d, 0);
        add(MBM_TYPE_FLOAT, 10)->order = order;
        add(MBM_TYPE_DOUBLE, 20)->order = order;
        add(MBM_TYPE_INT16, 30);
        put(10, pi_bits, 2, order);
        put(20, e_bits, 4, order);
        put(30, 0xFFFD, 1, MBM_ORDER_ABCD);
        d.setup.registerGap = 10;
        read_all();
        OK(mbm_plan_getFloat(&d.plan, 0, 0, &single));
        assert_true(single == pi);
        OK(mbm_plan_getNumber(&d.plan, 0, 0, &wide));
        assert_true(wide == (double)pi);
        OK(mbm_plan_getNumber(&d.plan, 1, 0, &wide));
        assert_true(wide == e);
        OK(mbm_plan_getFloat(&d.plan, 1, 0, &single));
        assert_true(single == (float)e);
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getFloat(&d.plan, 2, 0, &single));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, 0, 0, &none));
        IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, 1, 0, &none));
        assert_int_equal(none, 77);
    }
}

TEST(a_number_is_scaled_and_rounded_to_the_nearest)
{
    static const struct {
        uint16_t bits;
        int32_t multiplier, divisor;
        int64_t value;
    } scales[] = {
        {2301, 1, 10, 230},   {2305, 1, 10, 231},
        {0xFFFB, 1, 10, -1}, /* -0.5 */
        {0xFFFC, 1, 10, 0},   {7, -3, 2, -11},
        {0xFFF9, -3, 2, 11},  {1000, 0, 0, 1000},
        {1000, 0, 3, 333},    {1000, 100000, 0, 100000000},
        {5, 1, INT32_MAX, 0}, {30000, INT32_MIN, 1, -64424509440000},
    };

    for (unsigned i = 0; i < COUNT(scales); i++) {
        mbm_planField *field = add(MBM_TYPE_INT16, (uint16_t)i);

        field->multiplier = scales[i].multiplier;
        field->divisor = scales[i].divisor;
        put((uint16_t)i, scales[i].bits, 1, MBM_ORDER_ABCD);
    }
    read_all();
    for (unsigned i = 0; i < COUNT(scales); i++) {
        int64_t product = (int64_t)(int16_t)scales[i].bits * scales[i].multiplier;
        int32_t value = 77;

        assert_true(plan_device_integer(&d, (uint16_t)i, 0) == scales[i].value);
        /* The same with 32 bits, where the product has no more. */
        if (scales[i].divisor < INT32_MAX && product < INT32_MAX && product > -INT32_MAX) {
            OK(mbm_plan_getInt32(&d.plan, (uint16_t)i, 0, &value));
            assert_int_equal(value, scales[i].value);
        }
    }
}

TEST(bits_of_a_register_are_one_number_in_every_order)
{
    static const struct {
        uint8_t bit;
        uint16_t count, value;
    } parts[] = {{0, 0, 1},   {0, 1, 1},    {15, 1, 1},      {4, 1, 0},      {0, 4, 0x5},
                 {4, 4, 0xC}, {8, 8, 0xA3}, {3, 13, 0x1478}, {0, 16, 0xA3C5}};

    for (uint8_t order = MBM_ORDER_ABCD; order <= MBM_ORDER_DCBA; order++) {
        plan_device_begin(&d, 0);
        put(7, 0xA3C5, 1, order);
        for (unsigned i = 0; i < COUNT(parts); i++) {
            mbm_planField *field = plan_device_add(&d, 1, HOLDING, MBM_TYPE_BIT, 7, 1000);

            field->order = order;
            field->bit = parts[i].bit;
            field->count = parts[i].count;
        }
        d.fields[COUNT(parts) - 1].multiplier = -2;
        read_all();
        assert_int_equal(d.requested, 1);
        assert_int_equal(d.log[0].quantity, 1);
        for (unsigned i = 0; i < COUNT(parts); i++) {
            int64_t value = i + 1 < COUNT(parts) ? parts[i].value : -2 * parts[i].value;
            int32_t small;
            double number;

            assert_true(plan_device_integer(&d, (uint16_t)i, 0) == value);
            OK(mbm_plan_getInt32(&d.plan, (uint16_t)i, 0, &small));
            assert_true(small == value);
            OK(mbm_plan_getNumber(&d.plan, (uint16_t)i, 0, &number));
            assert_true(number == (double)value);
            assert_int_equal(mbm_plan_getInt32(&d.plan, (uint16_t)i, 1, &small),
                             MBM_INVALID_ARGUMENT);
        }
    }
}

TEST(fields_that_overlap_have_their_own_values_from_one_read)
{
    put(10, 0x12345678, 2, MBM_ORDER_ABCD);
    add(MBM_TYPE_UINT32, 10);
    add(MBM_TYPE_UINT16, 10);
    mbm_planField *half = add(MBM_TYPE_UINT16, 11);
    half->divisor = 2;
    add(MBM_TYPE_UINT16, 11);
    read_all();
    assert_int_equal(d.requested, 1);
    assert_int_equal(d.log[0].quantity, 2);
    assert_true(plan_device_integer(&d, 0, 0) == 0x12345678);
    assert_true(plan_device_integer(&d, 1, 0) == 0x1234);
    assert_true(plan_device_integer(&d, 2, 0) == 0x5678 / 2);
    assert_true(plan_device_integer(&d, 3, 0) == 0x5678);
    assert_int_equal(plan_device_updates(&d, 0), 1);
    assert_int_equal(plan_device_updates(&d, 3), 1);
}

TEST(a_number_beyond_32_bits_is_too_large_for_int32)
{
    static const struct {
        uint8_t type;
        uint64_t bits;
        int32_t multiplier, divisor;
        uint8_t status;
        int32_t value;
    } numbers[] = {
        {MBM_TYPE_UINT32, INT32_MAX, 0, 0, MBM_OK, INT32_MAX},
        {MBM_TYPE_UINT32, 0x80000000, 0, 0, MBM_OUT_OF_RANGE, 0},
        {MBM_TYPE_UINT32, UINT32_MAX, 0, 4, MBM_OUT_OF_RANGE, 0},
        {MBM_TYPE_UINT32, UINT32_MAX - 2, 0, 4, MBM_OK, 1073741823},
        {MBM_TYPE_INT32, 0x80000001, 0, 0, MBM_OK, -INT32_MAX},
        {MBM_TYPE_INT32, 0x80000000, 0, 0, MBM_OK, INT32_MIN},
        {MBM_TYPE_INT32, 0x80000000, -1, 0, MBM_OUT_OF_RANGE, 0},
        {MBM_TYPE_UINT32, 0x80000000, -1, 0, MBM_OK, INT32_MIN},
        {MBM_TYPE_UINT32, 0x80000001, -1, 0, MBM_OUT_OF_RANGE, 0},
        {MBM_TYPE_INT32, 0xFFFFFFFF, 7, 2, MBM_OK, -4},
        {MBM_TYPE_INT16, 0x8000, INT32_MIN, 0, MBM_OUT_OF_RANGE, 0},
        {MBM_TYPE_UINT64, 1, 0, 0, MBM_INVALID_ARGUMENT, 0},
        {MBM_TYPE_FLOAT, 1, 0, 0, MBM_INVALID_ARGUMENT, 0},
    };

    for (unsigned i = 0; i < COUNT(numbers); i++) {
        mbm_planField *field = add(numbers[i].type, (uint16_t)(4 * i));
        uint8_t type = numbers[i].type;

        field->multiplier = numbers[i].multiplier;
        field->divisor = numbers[i].divisor;
        put((uint16_t)(4 * i), numbers[i].bits,
            type == MBM_TYPE_INT16    ? 1
            : type == MBM_TYPE_UINT64 ? 4
                                      : 2,
            MBM_ORDER_ABCD);
    }
    read_all();
    for (unsigned i = 0; i < COUNT(numbers); i++) {
        int32_t value = 77;

        IS(numbers[i].status, mbm_plan_getInt32(&d.plan, (uint16_t)i, 0, &value));
        assert_int_equal(value, numbers[i].status == MBM_OK ? numbers[i].value : 77);
    }
}

TEST(a_scaled_number_is_the_nearest_double)
{
    static const struct {
        uint8_t type;
        uint64_t bits;
        int32_t multiplier, divisor;
        double value;
    } numbers[] = {
        {MBM_TYPE_UINT16, 2301, 0, 10, 230.1},
        {MBM_TYPE_INT16, 0xFF38, 0, 100, -2.0},
        {MBM_TYPE_INT16, 215, 1, 10, 21.5},
        {MBM_TYPE_UINT32, UINT32_MAX, 1000, 7, 4294967295000.0 / 7},
        {MBM_TYPE_INT64, (uint64_t)-9007199254740993, 0, 0, -9007199254740992.0},
        {MBM_TYPE_FLOAT, 0x3FC00000, -3, 2, -2.25},           /* 1.5 */
        {MBM_TYPE_DOUBLE, 0x3FB999999999999A, 0, 3, 0.1 / 3}, /* 0.1 */
        {MBM_TYPE_FLOAT, 0xFF800000, -3, 2, HUGE_VAL},        /* -infinity */
    };
    unsigned i;
    double value = 77;

    for (i = 0; i < COUNT(numbers); i++) {
        mbm_planField *field = add(numbers[i].type, (uint16_t)(4 * i));
        unsigned registers =
            numbers[i].type <= MBM_TYPE_INT16                                        ? 1
            : numbers[i].type <= MBM_TYPE_INT32 || numbers[i].type == MBM_TYPE_FLOAT ? 2
                                                                                     : 4;

        field->multiplier = numbers[i].multiplier;
        field->divisor = numbers[i].divisor;
        put((uint16_t)(4 * i), numbers[i].bits, registers, MBM_ORDER_ABCD);
    }
    add(MBM_TYPE_BIT, 3);
    d.registers[3] = 1;
    add(MBM_TYPE_TEXT, 100)->count = 4;
    read_all();
    for (i = 0; i < COUNT(numbers); i++) {
        OK(mbm_plan_getNumber(&d.plan, (uint16_t)i, 0, &value));
        assert_true(value == numbers[i].value);
    }
    OK(mbm_plan_getNumber(&d.plan, (uint16_t)i, 0, &value));
    assert_true(value == 1);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getNumber(&d.plan, (uint16_t)(i + 1), 0, &value));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getNumber(&d.plan, 0, 1, &value));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getNumber(&d.plan, 0, 0, NULL));
    assert_true(value == 1);
}

TEST(a_number_beyond_64_bits_is_too_large)
{
    int64_t value = 77;

    add(MBM_TYPE_UINT64, 0);
    add(MBM_TYPE_INT64, 4)->multiplier = 3;
    add(MBM_TYPE_UINT64, 8)->divisor = 2;
    add(MBM_TYPE_INT64, 12)->multiplier = -1;
    add(MBM_TYPE_UINT64, 16)->multiplier = -1;
    put(0, UINT64_MAX, 4, MBM_ORDER_ABCD);
    put(4, INT64_MAX, 4, MBM_ORDER_ABCD);
    put(8, UINT64_MAX - 1, 4, MBM_ORDER_ABCD);
    put(12, 0x8000000000000000, 4, MBM_ORDER_ABCD);
    put(16, 0x8000000000000001, 4, MBM_ORDER_ABCD);
    read_all();
    IS(MBM_OUT_OF_RANGE, mbm_plan_getInteger(&d.plan, 0, 0, &value));
    IS(MBM_OUT_OF_RANGE, mbm_plan_getInteger(&d.plan, 1, 0, &value));
    IS(MBM_OUT_OF_RANGE, mbm_plan_getInteger(&d.plan, 3, 0, &value));
    IS(MBM_OUT_OF_RANGE, mbm_plan_getInteger(&d.plan, 4, 0, &value));
    assert_int_equal(value, 77);
    OK(mbm_plan_getInteger(&d.plan, 2, 0, &value));
    assert_true(value == INT64_MAX);
}

TEST(the_least_integer_is_an_integer)
{
    int64_t value = 77;
    int32_t short_value = 77;

    add(MBM_TYPE_INT64, 0);
    add(MBM_TYPE_UINT64, 4)->multiplier = -1;
    add(MBM_TYPE_INT32, 8);
    add(MBM_TYPE_INT64, 12)->divisor = 3;
    put(0, 0x8000000000000000, 4, MBM_ORDER_ABCD);
    put(4, 0x8000000000000000, 4, MBM_ORDER_ABCD);
    put(8, 0x80000000, 2, MBM_ORDER_ABCD);
    put(12, 0x8000000000000000, 4, MBM_ORDER_ABCD);
    read_all();
    OK(mbm_plan_getInteger(&d.plan, 0, 0, &value));
    assert_true(value == INT64_MIN);
    value = 77;
    OK(mbm_plan_getInteger(&d.plan, 1, 0, &value));
    assert_true(value == INT64_MIN);
    OK(mbm_plan_getInteger(&d.plan, 2, 0, &value));
    assert_true(value == INT32_MIN);
    OK(mbm_plan_getInt32(&d.plan, 2, 0, &short_value));
    assert_true(short_value == INT32_MIN);
    OK(mbm_plan_getInteger(&d.plan, 3, 0, &value));
    assert_true(value == -3074457345618258603);
}

TEST(a_field_may_have_many_values)
{
    int64_t value = 77;

    add(MBM_TYPE_UINT32, 0)->count = 5;
    add(MBM_TYPE_BIT, 3)->count = 30;
    for (unsigned i = 0; i < 5; i++)
        put((uint16_t)(2 * i), 100000u * i, 2, MBM_ORDER_ABCD);
    read_all();
    for (unsigned i = 0; i < 5; i++)
        assert_int_equal(plan_device_integer(&d, 0, (uint16_t)i), 100000 * i);
    for (unsigned i = 0; i < 30; i++)
        assert_int_equal(plan_device_integer(&d, 1, (uint16_t)i), d.registers[3 + i] & 1);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, 0, 5, &value));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, 1, 30, &value));
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getInteger(&d.plan, 2, 0, &value));
    assert_int_equal(value, 77);
}

TEST(a_text_ends_at_its_nul_or_with_its_field)
{
    char text[8] = "unset";

    add(MBM_TYPE_TEXT, 0)->count = 5;
    add(MBM_TYPE_TEXT, 3)->count = 6;
    d.fields[1].order = MBM_ORDER_BADC;
    put(0, 0x4D6574657221, 3, MBM_ORDER_ABCD); /* "Meter!" */
    put(3, 0x656B5700, 2, MBM_ORDER_ABCD);     /* "ek", "W" and NUL */
    read_all();
    IS(MBM_BUFFER_TOO_SMALL, mbm_plan_getText(&d.plan, 0, text, 5));
    assert_string_equal(text, "unset");
    OK(mbm_plan_getText(&d.plan, 0, text, 6));
    assert_string_equal(text, "Meter");
    OK(mbm_plan_getText(&d.plan, 1, text, sizeof text));
    assert_string_equal(text, "ke");
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getText(&d.plan, 0, NULL, 6));
    IS(MBM_BUFFER_TOO_SMALL, mbm_plan_getText(&d.plan, 0, text, 0));
    {
        float number = 0;

        IS(MBM_INVALID_ARGUMENT, mbm_plan_getFloat(&d.plan, 0, 0, &number));
    }
}

TEST(the_registers_of_a_field_are_a_view)
{
    mbm_registers view;
    uint32_t value = 0;

    add(MBM_TYPE_UINT16, 10);
    add(MBM_TYPE_UINT32, 12)->order = MBM_ORDER_CDAB;
    add(MBM_TYPE_BIT, 3);
    put(12, 123456789, 2, MBM_ORDER_CDAB);
    d.setup.registerGap = 1;
    read_all();
    OK(mbm_plan_getRegisters(&d.plan, 1, &view));
    assert_int_equal(view.first, 12);
    assert_int_equal(view.count, 2);
    OK(mbm_registers_getUint32(&view, 12, MBM_ORDER_DEFAULT, &value));
    assert_int_equal(value, 123456789);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getRegisters(&d.plan, 2, &view));
}

TEST(registers_as_they_are_are_read_whole_and_left_to_the_functions_of_registers)
{
    mbm_registers view;
    uint8_t bytes[6];

    add(MBM_TYPE_UINT16, 9);
    add(MBM_TYPE_REGISTERS, 10)->count = 3;
    d.fields[1].order = MBM_ORDER_DCBA;
    put(10, 0x010203040506, 3, MBM_ORDER_ABCD);
    read_all();
    assert_int_equal(d.requested, 1);
    OK(mbm_plan_getRegisters(&d.plan, 1, &view));
    assert_int_equal(view.first, 10);
    assert_int_equal(view.count, 3);
    assert_int_equal(view.order, MBM_ORDER_DCBA);
    OK(mbm_registers_getBytes(&view, 10, MBM_ORDER_ABCD, bytes, sizeof bytes));
    assert_memory_equal(bytes, "\1\2\3\4\5\6", sizeof bytes);
}

TEST(the_reads_can_be_looked_at)
{
    mbm_planReadInfo read;

    add(MBM_TYPE_UINT16, 50);
    add(MBM_TYPE_UINT16, 10);
    add(MBM_TYPE_UINT16, 11);
    plan_device_start(&d);
    OK(mbm_plan_getRead(&d.plan, 0, &read));
    assert_int_equal(read.unit, 1);
    assert_int_equal(read.table, HOLDING);
    assert_int_equal(read.address, 10);
    assert_int_equal(read.quantity, 2);
    assert_int_equal(read.intervalMs, 1000);
    IS(MBM_PENDING, read.status);
    OK(mbm_plan_getRead(&d.plan, 1, &read));
    assert_int_equal(read.address, 50);
    plan_device_run(&d, 200);
    OK(mbm_plan_getRead(&d.plan, 1, &read));
    IS(MBM_OK, read.status);
    IS(MBM_INVALID_ARGUMENT, mbm_plan_getRead(&d.plan, 2, &read));
    assert_int_equal(read.address, 50);
}
