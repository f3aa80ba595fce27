/* Values in words by one call each: against libmodbus's getters, and against the functions of a
 * view. */
#include "mbm.h"
#include "test.h"

#include <math.h>
#include <modbus.h>

static const uint8_t orders[] = {MBM_ORDER_DEFAULT,  MBM_ORDER_ABCD,     MBM_ORDER_CDAB,
                                 MBM_ORDER_BADC,     MBM_ORDER_DCBA,     MBM_ORDER_EFGHABCD,
                                 MBM_ORDER_CDABGHEF, MBM_ORDER_FEHGBADC, MBM_ORDER_DCBAHGFE};
/* Numbers of both signs, of each size, and a NaN. */
static const uint16_t samples[][4] = {{0x4366, 0x8001, 0xC009, 0x21FB},
                                      {0xFFFE, 0x1234, 0x7FC0, 0x0001},
                                      {0, 0, 0, 0},
                                      {0x8000, 0x0000, 0x3DCC, 0xCCCD}};

static int same(const void *a, const void *b, size_t size)
{
    return memcmp(a, b, size) == 0;
}

/* libmodbus 3.1.6 reads floats as its names say. What it writes has another order than its name. */
TEST(a_float_of_words_is_that_of_libmodbus_in_each_order)
{
    static float (*const theirs[])(const uint16_t *) = {
        modbus_get_float_abcd, modbus_get_float_cdab, modbus_get_float_badc, modbus_get_float_dcba};
    float ours, other;

    for (size_t i = 0; i < COUNT(samples); i++) {
        for (size_t k = 0; k < COUNT(theirs); k++) {
            ours = mbm_words_getFloat(samples[i], (uint8_t)(MBM_ORDER_ABCD + k));
            other = theirs[k](samples[i]);
            assert_true(same(&ours, &other, sizeof ours));
        }
        ours = mbm_words_getFloat(samples[i], MBM_ORDER_CDAB);
        other = modbus_get_float(samples[i]);
        assert_true(same(&ours, &other, sizeof ours));
    }
    assert_true(mbm_words_getFloat((const uint16_t[]){0x4366, 0x8000}, MBM_ORDER_ABCD) == 230.5f);
    assert_true(mbm_words_getFloat((const uint16_t[]){0x8000, 0x4366}, MBM_ORDER_CDAB) == 230.5f);
}

TEST(values_of_words_are_those_of_a_view_in_each_order)
{
    for (size_t i = 0; i < COUNT(samples); i++) {
        for (size_t k = 0; k < COUNT(orders); k++) {
            const uint16_t *words = samples[i];
            const uint8_t order = orders[k];
            mbm_registers view;
            uint16_t word;
            uint32_t two;
            uint64_t four;
            double wide, got;

            OK(mbm_registers_ofWords(&view, words, 4, 0));
            OK(mbm_registers_getUint16(&view, 0, order, &word));
            OK(mbm_registers_getUint32(&view, 0, order, &two));
            OK(mbm_registers_getUint64(&view, 0, order, &four));
            OK(mbm_registers_getDouble(&view, 0, order, &wide));
            assert_int_equal(mbm_words_getUint16(words, order), word);
            assert_int_equal(mbm_words_getInt16(words, order), (int16_t)word);
            assert_int_equal(mbm_words_getUint32(words, order), two);
            assert_int_equal(mbm_words_getInt32(words, order), (int32_t)two);
            assert_true(mbm_words_getUint64(words, order) == four);
            assert_true(mbm_words_getInt64(words, order) == (int64_t)four);
            got = mbm_words_getDouble(words, order);
            assert_true(same(&got, &wide, sizeof got));
        }
    }
}

/* Writes by one function, and reads by the other: no word but those of the number changes. */
#define ROUND_TRIP(Type, count, value)                                                             \
    do {                                                                                           \
        uint16_t words[5] = {0xEEEE, 0xEEEE, 0xEEEE, 0xEEEE, 0xEEEE};                              \
        OK(mbm_words_set##Type(words, order, value));                                              \
        assert_true(mbm_words_get##Type(words, order) == (value));                                 \
        assert_int_equal(words[count], 0xEEEE);                                                    \
    } while (0)

TEST(a_value_set_into_words_is_read_back_in_each_order)
{
    for (size_t k = 0; k < COUNT(orders); k++) {
        const uint8_t order = orders[k];

        ROUND_TRIP(Uint16, 1, 0xFE01u);
        ROUND_TRIP(Int16, 1, -2);
        ROUND_TRIP(Uint32, 2, 4000000001u);
        ROUND_TRIP(Int32, 2, -2000000001);
        ROUND_TRIP(Uint64, 4, UINT64_MAX - 7);
        ROUND_TRIP(Int64, 4, -8000000000000000001);
        ROUND_TRIP(Float, 2, 230.5f);
        ROUND_TRIP(Double, 4, -2.7182818284590452);
    }
}

TEST(a_text_of_words_ends_with_its_field)
{
    uint16_t words[3] = {0, 0, 0xEEEE};
    char text[6] = "";

    OK(mbm_words_setString(words, MBM_ORDER_ABCD, 4, "mbm"));
    assert_int_equal(words[0], 'm' << 8 | 'b');
    assert_int_equal(words[1], 'm' << 8);
    assert_int_equal(words[2], 0xEEEE);
    OK(mbm_words_getString(words, MBM_ORDER_ABCD, 4, text, 5));
    assert_string_equal(text, "mbm");
    OK(mbm_words_getString(words, MBM_ORDER_BADC, 2, text, 3));
    assert_string_equal(text, "bm");
    IS(MBM_BUFFER_TOO_SMALL, mbm_words_getString(words, MBM_ORDER_ABCD, 4, text, 3));
    IS(MBM_BUFFER_TOO_SMALL, mbm_words_setString(words, MBM_ORDER_ABCD, 4, "metre"));
    assert_string_equal(text, "bm");
}

TEST(no_words_and_an_unknown_order_are_no_number)
{
    static const uint16_t one[4] = {0x3F80, 0x3F80, 0x3F80, 0x3F80};
    uint16_t words[4] = {7, 7, 7, 7};
    char text[3] = "x";

    for (unsigned i = 0; i < 2; i++) {
        const uint16_t *from = i == 0 ? NULL : one;
        uint16_t *into = i == 0 ? NULL : words;
        const uint8_t order = i == 0 ? MBM_ORDER_ABCD : 9;
        const uint8_t status = i == 0 ? MBM_NOT_INITIALISED : MBM_INVALID_ARGUMENT;

        assert_true(isnan(mbm_words_getFloat(from, order)));
        assert_true(isnan(mbm_words_getDouble(from, order)));
        assert_int_equal(mbm_words_getUint16(from, order), 0);
        assert_int_equal(mbm_words_getInt16(from, order), 0);
        assert_int_equal(mbm_words_getUint32(from, order), 0);
        assert_int_equal(mbm_words_getInt32(from, order), 0);
        assert_true(mbm_words_getUint64(from, order) == 0);
        assert_true(mbm_words_getInt64(from, order) == 0);
        IS(status, mbm_words_getString(from, order, 2, text, sizeof text));
        IS(status, mbm_words_setUint16(into, order, 1));
        IS(status, mbm_words_setInt16(into, order, 1));
        IS(status, mbm_words_setUint32(into, order, 1));
        IS(status, mbm_words_setInt32(into, order, 1));
        IS(status, mbm_words_setUint64(into, order, 1));
        IS(status, mbm_words_setInt64(into, order, 1));
        IS(status, mbm_words_setFloat(into, order, 1));
        IS(status, mbm_words_setDouble(into, order, 1));
        IS(status, mbm_words_setString(into, order, 2, "a"));
    }
    assert_memory_equal(words, ((const uint16_t[]){7, 7, 7, 7}), sizeof words);
    assert_string_equal(text, "x");
}
