/* Values in registers, compared with constants and not with another library's results; and values
 * in words by one call each, compared with libmodbus too. */
#include "mbm.h"
#include "test.h"

#include <math.h>
#include <modbus.h>

static const uint8_t orders[] = {MBM_ORDER_ABCD, MBM_ORDER_CDAB, MBM_ORDER_BADC, MBM_ORDER_DCBA};

/* 2923517522 as a double word, and pi as a double, in each of the four orders. */
static const uint8_t double_words[4][4] = {
    {0xAE, 0x41, 0x56, 0x52},
    {0x56, 0x52, 0xAE, 0x41},
    {0x41, 0xAE, 0x52, 0x56},
    {0x52, 0x56, 0x41, 0xAE},
};
static const uint8_t pi[4][8] = {
    {0x40, 0x09, 0x21, 0xFB, 0x54, 0x44, 0x2D, 0x18},
    {0x2D, 0x18, 0x54, 0x44, 0x21, 0xFB, 0x40, 0x09},
    {0x09, 0x40, 0xFB, 0x21, 0x44, 0x54, 0x18, 0x2D},
    {0x18, 0x2D, 0x44, 0x54, 0xFB, 0x21, 0x09, 0x40},
};

/* Copies bytes into words, as a master keeps them. */
static void to_words(uint16_t *words, const uint8_t *bytes, unsigned count)
{
    for (; count > 0; count--, bytes += 2)
        *words++ = (uint16_t)(bytes[0] << 8 | bytes[1]);
}

static int same(const void *a, const void *b, size_t size)
{
    return memcmp(a, b, size) == 0;
}

TEST(a_double_word_is_read_in_four_orders)
{
    uint16_t words[2];
    mbm_registers r;
    uint32_t value;
    int32_t negative;

    for (unsigned i = 0; i < 4; i++) {
        for (unsigned over_words = 0; over_words < 2; over_words++) {
            to_words(words, double_words[i], 2);
            if (over_words)
                OK(mbm_registers_ofWords(&r, words, 2, 30001));
            else
                OK(mbm_registers_ofBytes(&r, double_words[i], 4, 30001));
            OK(mbm_registers_getUint32(&r, 30001, orders[i], &value));
            assert_int_equal(value, 2923517522u);
            r.order = orders[i];
            OK(mbm_registers_getUint32(&r, 30001, MBM_ORDER_DEFAULT, (uint32_t *)&negative));
            assert_int_equal(negative, -1371449774);
        }
    }
}

TEST(the_default_order_is_high_word_first)
{
    mbm_registers r;
    uint32_t value;

    OK(mbm_registers_ofBytes(&r, double_words[0], 4, 0));
    assert_int_equal(r.order, MBM_ORDER_ABCD);
    OK(mbm_registers_getUint32(&r, 0, MBM_ORDER_DEFAULT, &value));
    assert_int_equal(value, 2923517522u);
    r.order = MBM_ORDER_DEFAULT;
    OK(mbm_registers_getUint32(&r, 0, MBM_ORDER_DEFAULT, &value));
    assert_int_equal(value, 2923517522u);
}

TEST(floats_are_ieee_754)
{
    static const struct {
        float value;
        uint16_t high, low;
    } cases[] = {
        {1.0f, 0x3F80, 0x0000},         {-2.0f, 0xC000, 0x0000}, {230.5f, 0x4366, 0x8000},
        {0.1f, 0x3DCC, 0xCCCD},         {0.0f, 0x0000, 0x0000},  {INFINITY, 0x7F80, 0x0000},
        {-123456.789f, 0xC7F1, 0x2065},
    };
    uint16_t words[2];
    mbm_registers r;
    float value;

    OK(mbm_registers_intoWords(&r, words, 2, 0));
    for (unsigned i = 0; i < COUNT(cases); i++) {
        words[0] = cases[i].high;
        words[1] = cases[i].low;
        OK(mbm_registers_getFloat(&r, 0, MBM_ORDER_ABCD, &value));
        assert_true(same(&value, &cases[i].value, 4));
        OK(mbm_registers_setFloat(&r, 0, MBM_ORDER_CDAB, &value));
        assert_int_equal(words[0], cases[i].low);
        assert_int_equal(words[1], cases[i].high);
    }
    words[0] = 0x7FC0;
    words[1] = 0x1234;
    OK(mbm_registers_getFloat(&r, 0, MBM_ORDER_ABCD, &value));
    assert_true(isnan(value));
    OK(mbm_registers_setFloat(&r, 0, MBM_ORDER_DCBA, &value));
    assert_int_equal(words[0], 0x3412);
    assert_int_equal(words[1], 0xC07F);
}

TEST(values_of_four_registers_have_four_orders_too)
{
    mbm_registers r, w;
    uint64_t wide;
    int64_t negative;
    double value;
    uint8_t bytes[8];

    for (unsigned i = 0; i < 4; i++) {
        OK(mbm_registers_ofBytes(&r, pi[i], 8, 100));
        OK(mbm_registers_getDouble(&r, 100, orders[i], &value));
        assert_true(value > 3.14159265358979 && value < 3.14159265358980);
        OK(mbm_registers_getUint64(&r, 100, orders[i], &wide));
        assert_true(wide == 0x400921FB54442D18u);
        OK(mbm_registers_getUint64(&r, 100, orders[i], (uint64_t *)&negative));
        assert_true(negative == 0x400921FB54442D18);

        OK(mbm_registers_intoBytes(&w, bytes, 8, 100));
        w.order = orders[i];
        memset(bytes, 0, 8);
        OK(mbm_registers_setDouble(&w, 100, MBM_ORDER_DEFAULT, &value));
        assert_memory_equal(bytes, pi[i], 8);
        memset(bytes, 0, 8);
        OK(mbm_registers_setUint64(&w, 100, MBM_ORDER_DEFAULT, &wide));
        assert_memory_equal(bytes, pi[i], 8);
        negative = -2;
        OK(mbm_registers_setUint64(&w, 100, MBM_ORDER_ABCD, (const uint64_t *)&negative));
        OK(mbm_registers_getUint64(&w, 100, MBM_ORDER_ABCD, &wide));
        assert_true(wide == 0xFFFFFFFFFFFFFFFEu);
    }
}

TEST(a_double_word_is_written_in_four_orders)
{
    uint8_t bytes[4];
    uint16_t words[2], wanted[2];
    mbm_registers b, w;

    OK(mbm_registers_intoBytes(&b, bytes, 4, 9));
    OK(mbm_registers_intoWords(&w, words, 2, 9));
    for (unsigned i = 0; i < 4; i++) {
        to_words(wanted, double_words[i], 2);
        OK(mbm_registers_setUint32(&b, 9, orders[i], 2923517522u));
        OK(mbm_registers_setUint32(&w, 9, orders[i], (uint32_t)-1371449774));
        assert_memory_equal(bytes, double_words[i], 4);
        assert_memory_equal(words, wanted, 4);
    }
}

TEST(one_register_is_read_as_number_bytes_and_bits)
{
    uint16_t words[] = {0x80FE, 0xAAAA};
    mbm_registers r;
    uint16_t word;
    int16_t number;
    uint8_t byte;
    int8_t small;

    OK(mbm_registers_intoWords(&r, words, 2, 5));
    OK(mbm_registers_getUint16(&r, 5, MBM_ORDER_DEFAULT, &word));
    assert_int_equal(word, 0x80FE);
    OK(mbm_registers_getUint16(&r, 5, MBM_ORDER_CDAB, &word));
    assert_int_equal(word, 0x80FE);
    OK(mbm_registers_getUint16(&r, 5, MBM_ORDER_BADC, &word));
    assert_int_equal(word, 0xFE80);
    OK(mbm_registers_getUint16(&r, 5, MBM_ORDER_DEFAULT, (uint16_t *)&number));
    assert_int_equal(number, -32514);
    OK(mbm_registers_getBytes(&r, 5, MBM_ORDER_ABCD, &byte, 1));
    assert_int_equal(byte, 0x80);
    OK(mbm_registers_getBytes(&r, 5, MBM_ORDER_BADC, &byte, 1));
    assert_int_equal(byte, 0xFE);
    OK(mbm_registers_getBytes(&r, 5, MBM_ORDER_BADC, (uint8_t *)&small, 1));
    assert_int_equal(small, -2);
    OK(mbm_registers_getBit(&r, 5, 15, &byte));
    assert_int_equal(byte, 1);
    OK(mbm_registers_getBit(&r, 5, 0, &byte));
    assert_int_equal(byte, 0);
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getBit(&r, 5, 16, &byte));

    OK(mbm_registers_setBit(&r, 6, 0, 7));
    OK(mbm_registers_setBit(&r, 6, 15, 0));
    assert_int_equal(words[1], 0x2AAB);
    IS(MBM_INVALID_ARGUMENT, mbm_registers_setBit(&r, 6, 16, 0));
    OK(mbm_registers_setBytes(&r, 6, MBM_ORDER_ABCD, (const uint8_t *)"\x12", 1));
    OK(mbm_registers_setBytes(&r, 6, MBM_ORDER_BADC, (const uint8_t *)"\xFF", 1));
    assert_int_equal(words[1], 0x12FF);
    OK(mbm_registers_setUint16(&r, 6, MBM_ORDER_DCBA, 0x3456));
    assert_int_equal(words[1], 0x5634);
    OK(mbm_registers_setUint16(&r, 6, MBM_ORDER_DEFAULT, (uint16_t)-2));
    assert_int_equal(words[1], 0xFFFE);
}

TEST(a_text_ends_at_its_first_nul_or_with_its_field)
{
    static const uint8_t bytes[] = {'M', 'E', 'T', 'E', 'R', ' ', '7', 0, 'X', 'Y'};
    static const uint8_t swapped[] = {'E', 'M', 'E', 'T', ' ', 'R', 0, '7'};
    mbm_registers r;
    char text[11];

    OK(mbm_registers_ofBytes(&r, bytes, sizeof bytes, 10));
    OK(mbm_registers_getString(&r, 10, 10, MBM_ORDER_DEFAULT, text, sizeof text));
    assert_string_equal(text, "METER 7");
    OK(mbm_registers_getString(&r, 10, 5, MBM_ORDER_CDAB, text, sizeof text));
    assert_string_equal(text, "METER");
    OK(mbm_registers_getString(&r, 14, 2, MBM_ORDER_DEFAULT, text, 3));
    assert_string_equal(text, "XY");
    strcpy(text, "old");
    IS(MBM_BUFFER_TOO_SMALL, mbm_registers_getString(&r, 14, 2, MBM_ORDER_DEFAULT, text, 2));
    IS(MBM_BUFFER_TOO_SMALL, mbm_registers_getString(&r, 14, 2, MBM_ORDER_DEFAULT, text, 0));
    IS(MBM_ILLEGAL_DATA_ADDRESS,
       mbm_registers_getString(&r, 14, 3, MBM_ORDER_DEFAULT, text, sizeof text));
    assert_string_equal(text, "old");
    OK(mbm_registers_ofBytes(&r, swapped, sizeof swapped, 10));
    OK(mbm_registers_getString(&r, 10, 8, MBM_ORDER_BADC, text, sizeof text));
    assert_string_equal(text, "METER 7");
}

TEST(a_text_is_written_with_zeros_after_it)
{
    uint8_t bytes[9] = "........";
    mbm_registers r;

    OK(mbm_registers_intoBytes(&r, bytes, 8, 0));
    OK(mbm_registers_setString(&r, 0, 5, MBM_ORDER_DEFAULT, "ABC"));
    assert_memory_equal(bytes, "ABC\0\0\0..", 8);
    OK(mbm_registers_setString(&r, 1, 4, MBM_ORDER_DCBA, "ABCD"));
    assert_memory_equal(bytes, "ABBADC..", 8);
    IS(MBM_BUFFER_TOO_SMALL, mbm_registers_setString(&r, 0, 4, MBM_ORDER_DEFAULT, "abcde"));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setString(&r, 1, 7, MBM_ORDER_DEFAULT, "abc"));
    assert_memory_equal(bytes, "ABBADC..", 8);
}

TEST(raw_bytes_are_copied_in_wire_order)
{
    static const uint8_t three[] = {3, 4, 5};
    uint16_t words[] = {0x0102, 0x0304, 0x0506};
    uint8_t bytes[3] = {0};
    mbm_registers r;

    OK(mbm_registers_intoWords(&r, words, 3, 40));
    r.order = MBM_ORDER_DCBA;
    OK(mbm_registers_getBytes(&r, 41, MBM_ORDER_ABCD, bytes, 3));
    assert_memory_equal(bytes, three, 3);
    OK(mbm_registers_setBytes(&r, 40, MBM_ORDER_ABCD, three, 3));
    assert_int_equal(words[0], 0x0304);
    assert_int_equal(words[1], 0x0504);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setBytes(&r, 42, MBM_ORDER_ABCD, three, 3));
    assert_int_equal(words[2], 0x0506);
}

TEST(bytes_of_a_device_that_swaps_them_are_put_in_order)
{
    static const uint8_t straight[] = {1, 2, 3, 4, 5}, swapped[] = {2, 1, 4, 3, 6};
    const uint8_t data[] = {1, 2, 3, 4, 5, 6};
    uint16_t words[] = {0x0102, 0x0304, 0x0506};
    uint8_t bytes[5], back[6];
    mbm_registers r;

    for (size_t i = 0; i < COUNT(orders); i++) {
        const uint8_t *wanted = i < 2 ? straight : swapped;

        OK(mbm_registers_ofBytes(&r, data, 6, 40));
        OK(mbm_registers_getBytes(&r, 40, orders[i], bytes, 5));
        assert_memory_equal(bytes, wanted, 5);
        OK(mbm_registers_ofWords(&r, words, 3, 40));
        r.order = orders[i];
        OK(mbm_registers_getBytes(&r, 40, MBM_ORDER_DEFAULT, bytes, 5));
        assert_memory_equal(bytes, wanted, 5);
        memset(back, 9, 6);
        OK(mbm_registers_intoBytes(&r, back, 6, 40));
        OK(mbm_registers_setBytes(&r, 40, orders[i], wanted, 5));
        assert_memory_equal(back, data, 4);
        assert_int_equal(back[4], i < 2 ? 5 : 9);
        assert_int_equal(back[5], i < 2 ? 9 : 6);
    }
    memset(bytes, 7, 5);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getBytes(&r, 41, MBM_ORDER_BADC, bytes, 5));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setBytes(&r, 41, MBM_ORDER_BADC, straight, 5));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getBytes(&r, 40, 9, bytes, 2));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_setBytes(&r, 40, 9, straight, 2));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getBytes(&r, 40, 0, NULL, 2));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_setBytes(NULL, 40, 0, straight, 2));
    OK(mbm_registers_ofBytes(&r, data, 6, 40));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_setBytes(&r, 40, 0, straight, 2));
    assert_int_equal(bytes[0], 7);
}

TEST(an_access_outside_of_a_view_changes_nothing)
{
    uint16_t words[4] = {0xAAAA, 0xAAAA, 0xAAAA, 0xAAAA};
    mbm_registers r;
    uint64_t wide = 5;
    uint32_t value = 5;
    float number = 5;

    OK(mbm_registers_intoWords(&r, words, 4, 65532));
    for (unsigned address = 0; address <= 65535; address++) {
        uint16_t at = (uint16_t)address;

        if (address < 65532 || address == 65535) {
            IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getUint32(&r, at, 0, &value));
            IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getFloat(&r, at, 0, &number));
            IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setUint32(&r, at, 0, 1));
        }
        if (address != 65532) {
            IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getUint64(&r, at, 0, &wide));
            IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setUint64(&r, at, 0, &wide));
        }
    }
    assert_int_equal(value, 5);
    assert_true(wide == 5);
    assert_true(words[0] == 0xAAAA && words[3] == 0xAAAA);
    OK(mbm_registers_getUint64(&r, 65532, 0, &wide));
    OK(mbm_registers_setUint32(&r, 65534, 0, 1));
    assert_int_equal(words[3], 1);
}

TEST(a_view_beyond_register_65535_is_refused)
{
    uint16_t words[2] = {0}, word;
    uint8_t bytes[4] = {0};
    mbm_registers r;

    OK(mbm_registers_ofWords(&r, words, 1, 65535));
    OK(mbm_registers_getUint16(&r, 65535, 0, &word));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_ofWords(&r, words, 2, 65535));
    IS(MBM_NOT_INITIALISED, mbm_registers_getUint16(&r, 65535, 0, &word));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_intoBytes(&r, bytes, 4, 65535));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_ofBytes(&r, bytes, 3, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_intoBytes(&r, bytes, 1, 0));
    OK(mbm_registers_ofBytes(&r, bytes, 4, 65534));
    r.first = 65535;
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getUint16(&r, 65535, 0, &word));
    OK(mbm_registers_ofWords(&r, words, 0, 0));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getUint16(&r, 0, 0, &word));
}

/* --- Packed coils, checked against the examples of V1.1b3 --- */

/* The response of 6.1: coils 20 to 38, which have the addresses 19 to 37 on the wire. */
static const uint8_t coils_19[] = {0xCD, 0x6B, 0x05};
static const uint16_t words_19[] = {0x6BCD, 0x0005};
static const uint8_t on_19[19] = {1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1};

TEST(a_coil_is_found_by_its_address)
{
    uint8_t on;

    for (unsigned i = 0; i < 19; i++) {
        OK(mbm_bits_isSet(coils_19, 19, 19, (uint16_t)(19 + i), &on));
        assert_int_equal(on, on_19[i]);
        OK(mbm_bits_isSetInWords(words_19, 19, 19, (uint16_t)(19 + i), &on));
        assert_int_equal(on, on_19[i]);
    }
}

TEST(a_coil_outside_of_the_words_has_no_state)
{
    static const uint16_t outside[] = {0, 18, 38, 39, 65535};
    uint8_t bytes[3] = {0};
    uint16_t words[2] = {0};
    uint8_t on = 7;

    for (unsigned i = 0; i < COUNT(outside); i++) {
        IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_isSet(coils_19, 19, 19, outside[i], &on));
        IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_isSetInWords(words_19, 19, 19, outside[i], &on));
        IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_set(bytes, 19, 19, outside[i], 1));
        IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_setInWords(words, 19, 19, outside[i], 1));
    }
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_isSet(coils_19, 0, 0, 0, &on));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_isSet(coils_19, 65535, 2, 65535, &on));
    assert_int_equal(on, 7);
    assert_int_equal(bytes[0] | bytes[1] | bytes[2] | words[0] | words[1], 0);
    OK(mbm_bits_isSet(coils_19, 65535, 1, 65535, &on));
    assert_int_equal(on, 1);
}

TEST(setting_a_coil_leaves_the_others)
{
    uint8_t bytes[] = {0xCD, 0x6B, 0x05};
    uint16_t words[] = {0x6BCD, 0x0005};

    OK(mbm_bits_set(bytes, 19, 19, 20, 0xFF));
    OK(mbm_bits_set(bytes, 19, 19, 37, 0));
    assert_int_equal(bytes[0], 0xCF);
    assert_int_equal(bytes[1], 0x6B);
    assert_int_equal(bytes[2], 0x01);
    OK(mbm_bits_setInWords(words, 19, 19, 20, 2));
    OK(mbm_bits_setInWords(words, 19, 19, 37, 0));
    assert_int_equal(words[0], 0x6BCF);
    assert_int_equal(words[1], 0x0001);
}

TEST(coils_are_packed_lowest_bit_first)
{
    /* The request of 6.11. */
    static const uint8_t coils[] = {1, 0, 0xFF, 1, 0, 0, 2, 1, 1, 0};
    uint8_t bytes[] = {0xFF, 0xFF, 0xFF};
    uint16_t words[] = {0, 0xFFFF};

    OK(mbm_bits_pack(coils, 10, bytes, 3));
    assert_int_equal(bytes[0], 0xCD);
    assert_int_equal(bytes[1], 0x01);
    assert_int_equal(bytes[2], 0xFF);
    for (unsigned i = 0; i < COUNT(coils); i++)
        OK(mbm_bits_setInWords(words, 0, 10, (uint16_t)i, coils[i]));
    assert_int_equal(words[0], 0x01CD);
    assert_int_equal(words[1], 0xFFFF);
    OK(mbm_bits_pack(coils, 0, bytes, 0));
    IS(MBM_BUFFER_TOO_SMALL, mbm_bits_pack(coils, 10, bytes + 2, 1));
    assert_int_equal(bytes[2], 0xFF);
}

TEST(coils_are_unpacked_to_one_byte_each)
{
    uint8_t coils[25] = {0};

    OK(mbm_bits_unpack(coils_19, 3, coils, 19));
    assert_memory_equal(coils, on_19, 19);
    coils[24] = 7;
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_unpack(coils_19, 3, coils, 25));
    assert_memory_equal(coils, on_19, 19);
    assert_int_equal(coils[24], 7);
}

/* --- values in words by one call each, against libmodbus's getters and the functions of a view ---
 */

static const uint8_t every_order[] = {MBM_ORDER_DEFAULT,  MBM_ORDER_ABCD,     MBM_ORDER_CDAB,
                                      MBM_ORDER_BADC,     MBM_ORDER_DCBA,     MBM_ORDER_EFGHABCD,
                                      MBM_ORDER_CDABGHEF, MBM_ORDER_FEHGBADC, MBM_ORDER_DCBAHGFE};

/* Numbers of both signs, of each size, and a NaN. */
static const uint16_t samples[][4] = {{0x4366, 0x8001, 0xC009, 0x21FB},
                                      {0xFFFE, 0x1234, 0x7FC0, 0x0001},
                                      {0, 0, 0, 0},
                                      {0x8000, 0x0000, 0x3DCC, 0xCCCD}};

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
        for (size_t k = 0; k < COUNT(every_order); k++) {
            const uint16_t *words = samples[i];
            const uint8_t order = every_order[k];
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
    for (size_t k = 0; k < COUNT(every_order); k++) {
        const uint8_t order = every_order[k];

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
