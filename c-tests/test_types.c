/* Numbers, texts and dates in forms other than two's complement and IEEE 754 of 32 and 64 bits:
 * what is in the registers, in every order, and what is refused. */
#include "mbm.h"
#include "test.h"

#include <math.h>

enum { FIRST = 100, WORDS = 8, UNTOUCHED = 0xABCD };

static uint16_t words[WORDS];
static mbm_registers r;

static void setup(void)
{
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = UNTOUCHED;
    OK(mbm_registers_intoWords(&r, words, WORDS, FIRST));
}

fixture each_test = {setup, NULL};

/* Compares the first words, and the others with what they were. */
static void expect(const uint16_t *wanted, unsigned count)
{
    for (unsigned i = 0; i < WORDS; i++)
        assert_int_equal(words[i], i < count ? wanted[i] : UNTOUCHED);
}

/* Asserts that a call is refused and writes nothing. */
#define NOTHING(status, call)                                                                      \
    do {                                                                                           \
        uint16_t kept[WORDS];                                                                      \
                                                                                                   \
        memcpy(kept, words, sizeof words);                                                         \
        IS(status, call);                                                                          \
        assert_memory_equal(kept, words, sizeof words);                                            \
    } while (0)

/* --- orders --- */

TEST(a_value_of_four_registers_has_eight_orders)
{
    static const struct {
        uint8_t order;
        uint16_t words[4];
    } orders[] = {{MBM_ORDER_ABCD, {0x0102, 0x0304, 0x0506, 0x0708}},
                  {MBM_ORDER_CDAB, {0x0708, 0x0506, 0x0304, 0x0102}},
                  {MBM_ORDER_BADC, {0x0201, 0x0403, 0x0605, 0x0807}},
                  {MBM_ORDER_DCBA, {0x0807, 0x0605, 0x0403, 0x0201}},
                  {MBM_ORDER_EFGHABCD, {0x0506, 0x0708, 0x0102, 0x0304}},
                  {MBM_ORDER_CDABGHEF, {0x0304, 0x0102, 0x0708, 0x0506}},
                  {MBM_ORDER_FEHGBADC, {0x0605, 0x0807, 0x0201, 0x0403}},
                  {MBM_ORDER_DCBAHGFE, {0x0403, 0x0201, 0x0807, 0x0605}}};
    const uint64_t number = 0x0102030405060708;
    const double pi = 3.141592653589793;

    for (unsigned i = 0; i < COUNT(orders); i++) {
        uint64_t back = 0, bits = 0;
        double real = 0;

        OK(mbm_registers_setUint64(&r, FIRST, orders[i].order, &number));
        expect(orders[i].words, 4);
        OK(mbm_registers_getUint64(&r, FIRST, orders[i].order, &back));
        assert_true(back == number);
        OK(mbm_registers_getBits(&r, FIRST, 4, orders[i].order, 8, 16, &bits));
        assert_true(bits == 0x0607);
        OK(mbm_registers_setDouble(&r, FIRST, orders[i].order, &pi));
        OK(mbm_registers_getDouble(&r, FIRST, orders[i].order, &real));
        assert_true(real == pi);
    }
}

TEST(an_order_by_halves_is_that_of_its_half_for_two_registers)
{
    for (uint8_t order = MBM_ORDER_ABCD; order <= MBM_ORDER_DCBA; order++) {
        uint32_t value = 0;

        OK(mbm_registers_setUint32(&r, FIRST, order, 0x01020304));
        OK(mbm_registers_getUint32(&r, FIRST, (uint8_t)(order + 4), &value));
        assert_int_equal(value, 0x01020304);
    }
}

/* --- numbers --- */

TEST(a_register_of_bcd_has_four_digits)
{
    uint32_t value = 7;

    words[0] = 0x2301;
    words[1] = 0x4567;
    OK(mbm_registers_getBcd(&r, FIRST, 1, 0, &value));
    assert_int_equal(value, 2301);
    OK(mbm_registers_getBcd(&r, FIRST, 2, 0, &value));
    assert_int_equal(value, 23014567);
    OK(mbm_registers_getBcd(&r, FIRST, 2, MBM_ORDER_CDAB, &value));
    assert_int_equal(value, 45672301);
    OK(mbm_registers_getBcd(&r, FIRST, 1, MBM_ORDER_BADC, &value));
    assert_int_equal(value, 123);
    words[0] = 0x12A4;
    IS(MBM_MALFORMED_VALUE, mbm_registers_getBcd(&r, FIRST, 1, 0, &value));
    words[0] = 0x1F34;
    IS(MBM_MALFORMED_VALUE, mbm_registers_getBcd(&r, FIRST, 2, 0, &value));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getBcd(&r, FIRST, 0, 0, &value));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getBcd(&r, FIRST, 3, 0, &value));
    assert_int_equal(value, 123);
}

TEST(a_number_with_too_many_digits_for_bcd_is_refused)
{
    static const uint16_t most[] = {0x9999, 0x9999};

    OK(mbm_registers_setBcd(&r, FIRST, 1, 0, 9999));
    expect(most, 1);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setBcd(&r, FIRST, 1, 0, 10000));
    OK(mbm_registers_setBcd(&r, FIRST, 2, 0, 99999999));
    expect(most, 2);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setBcd(&r, FIRST, 2, 0, 100000000));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBcd(&r, FIRST, 0, 0, 0));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBcd(&r, FIRST, 3, 0, 1));
    NOTHING(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setBcd(&r, FIRST + WORDS - 1, 2, 0, 1));
}

TEST(registers_of_modulo_10000_are_four_digits_each)
{
    /* The energy of a PM710, 0108 18D4 002B 0000, lowest register first; then pairs and
     * triples, highest first. */
    static const struct {
        uint64_t number;
        uint16_t words[4], count;
        uint8_t order;
    } numbers[] = {{4363560264, {0x0108, 0x18D4, 0x002B, 0}, 4, MBM_ORDER_CDAB},
                   {4363560264, {0, 0x002B, 0x18D4, 0x0108}, 4, MBM_ORDER_ABCD},
                   {99999999, {9999, 9999}, 2, MBM_ORDER_ABCD},
                   {12345678, {5678, 1234}, 2, MBM_ORDER_CDAB},
                   {100020003, {1, 2, 3}, 3, MBM_ORDER_ABCD},
                   {100020003, {3, 2, 1}, 3, MBM_ORDER_CDAB},
                   {9999, {9999}, 1, MBM_ORDER_ABCD},
                   {9999999999999999, {9999, 9999, 9999, 9999}, 4, MBM_ORDER_ABCD},
                   {0, {0, 0, 0, 0}, 4, MBM_ORDER_CDAB}};
    uint64_t back = 0, more = 100000000;

    for (unsigned i = 0; i < COUNT(numbers); i++) {
        setup();
        OK(mbm_registers_setM10k(&r, FIRST, numbers[i].count, numbers[i].order,
                                 &numbers[i].number));
        expect(numbers[i].words, numbers[i].count);
        OK(mbm_registers_getM10k(&r, FIRST, numbers[i].count, numbers[i].order, &back));
        assert_true(back == numbers[i].number);
    }
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setM10k(&r, FIRST, 2, 0, &more));
    words[1] = 10000;
    IS(MBM_MALFORMED_VALUE, mbm_registers_getM10k(&r, FIRST, 3, 0, &back));
    words[1] = 0xFFFF;
    IS(MBM_MALFORMED_VALUE, mbm_registers_getM10k(&r, FIRST, 2, 0, &back));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_getM10k(&r, FIRST, 5, 0, &back));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setM10k(&r, FIRST, 0, 0, &back));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setM10k(&r, FIRST, 5, 0, &back));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setM10k(&r, FIRST, 3, MBM_ORDER_EFGHABCD, &back));
}

TEST(registers_of_modulo_10000_may_have_a_sign_each)
{
    static const struct {
        int64_t number;
        uint16_t words[4], count;
        uint8_t order;
    } numbers[] = {{-12345678, {(uint16_t)-1234, (uint16_t)-5678}, 2, MBM_ORDER_ABCD},
                   {-10000, {0, (uint16_t)-1}, 2, MBM_ORDER_CDAB},
                   {-9999999999999999,
                    {(uint16_t)-9999, (uint16_t)-9999, (uint16_t)-9999, (uint16_t)-9999},
                    4,
                    MBM_ORDER_ABCD},
                   {100020003, {3, 2, 1}, 3, MBM_ORDER_CDAB}};
    int64_t back = 0, less = -100000000, least = INT64_MIN;

    for (unsigned i = 0; i < COUNT(numbers); i++) {
        setup();
        OK(mbm_registers_setSignedM10k(&r, FIRST, numbers[i].count, numbers[i].order,
                                       &numbers[i].number));
        expect(numbers[i].words, numbers[i].count);
        OK(mbm_registers_getSignedM10k(&r, FIRST, numbers[i].count, numbers[i].order, &back));
        assert_true(back == numbers[i].number);
    }
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setSignedM10k(&r, FIRST, 2, 0, &less));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setSignedM10k(&r, FIRST, 4, 0, &least));
    words[0] = 0x8000;
    IS(MBM_MALFORMED_VALUE, mbm_registers_getSignedM10k(&r, FIRST, 1, 0, &back));
    words[0] = (uint16_t)-10000;
    IS(MBM_MALFORMED_VALUE, mbm_registers_getSignedM10k(&r, FIRST, 1, 0, &back));
}

TEST(a_number_of_24_bits_is_in_the_low_bits_of_two_registers)
{
    static const uint16_t minus_one[] = {0xFFFF, 0xFFFF}, large[] = {0x00FF, 0xFFFF};
    uint32_t whole = 0;
    int32_t value = 0;

    /* Example of a meter: the exponent -3 and -123456 are FDFE 1DC0. */
    words[0] = 0xFDFE;
    words[1] = 0x1DC0;
    OK(mbm_registers_getInt24(&r, FIRST, 0, &value));
    assert_int_equal(value, -123456);
    OK(mbm_registers_getUint24(&r, FIRST, 0, &whole));
    assert_int_equal(whole, 0xFE1DC0);
    OK(mbm_registers_setInt24(&r, FIRST, 0, -1));
    expect(minus_one, 2);
    OK(mbm_registers_setUint24(&r, FIRST, 0, 0xFFFFFF));
    expect(large, 2);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setUint24(&r, FIRST, 0, 0x1000000));
    OK(mbm_registers_setInt24(&r, FIRST, 0, 8388607));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setInt24(&r, FIRST, 0, 8388608));
    OK(mbm_registers_setInt24(&r, FIRST, 0, -8388608));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setInt24(&r, FIRST, 0, -8388609));
    OK(mbm_registers_getInt24(&r, FIRST, 0, &value));
    assert_int_equal(value, -8388608);
}

TEST(a_number_of_48_bits_has_three_registers)
{
    static const uint16_t high_first[] = {0x0102, 0x0304, 0x0506},
                          minus_two[] = {0xFFFE, 0xFFFF, 0xFFFF};
    const uint64_t number = 0x010203040506, more = 0x1000000000000;
    const int64_t negative = -2, most = 0x7FFFFFFFFFFF, above = 0x800000000000,
                  least = -0x800000000000, below = -0x800000000001;
    uint64_t whole = 0;
    int64_t value = 0;

    OK(mbm_registers_setUint48(&r, FIRST, 0, &number));
    expect(high_first, 3);
    OK(mbm_registers_getUint48(&r, FIRST, MBM_ORDER_DCBA, &whole));
    assert_true(whole == 0x060504030201);
    OK(mbm_registers_setInt48(&r, FIRST, MBM_ORDER_CDAB, &negative));
    expect(minus_two, 3);
    OK(mbm_registers_getInt48(&r, FIRST, MBM_ORDER_CDAB, &value));
    assert_true(value == -2);
    OK(mbm_registers_getUint48(&r, FIRST, MBM_ORDER_CDAB, &whole));
    assert_true(whole == 0xFFFFFFFFFFFE);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setUint48(&r, FIRST, 0, &more));
    OK(mbm_registers_setInt48(&r, FIRST, 0, &most));
    OK(mbm_registers_setInt48(&r, FIRST, 0, &least));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setInt48(&r, FIRST, 0, &above));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setInt48(&r, FIRST, 0, &below));
}

TEST(every_register_is_a_sign_and_an_amount)
{
    for (int32_t number = -32767; number <= 32767; number++) {
        int32_t back = 0;

        OK(mbm_registers_setSignMagnitude(&r, FIRST, 1, 0, number));
        assert_int_equal(words[0], number < 0 ? 0x8000 - number : number);
        OK(mbm_registers_getSignMagnitude(&r, FIRST, 1, 0, &back));
        assert_int_equal(back, number);
    }
}

TEST(the_sign_of_two_registers_is_the_highest_bit)
{
    static const uint16_t minus_1000[] = {0x8000, 1000};
    int32_t value = 0;

    OK(mbm_registers_setSignMagnitude(&r, FIRST, 2, 0, -1000));
    expect(minus_1000, 2);
    OK(mbm_registers_getSignMagnitude(&r, FIRST, 2, 0, &value));
    assert_int_equal(value, -1000);
    words[0] = 0x8000;
    words[1] = 0;
    OK(mbm_registers_getSignMagnitude(&r, FIRST, 2, 0, &value));
    assert_int_equal(value, 0);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setSignMagnitude(&r, FIRST, 1, 0, 32768));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setSignMagnitude(&r, FIRST, 1, 0, -32768));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setSignMagnitude(&r, FIRST, 2, 0, INT32_MIN));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setSignMagnitude(&r, FIRST, 3, 0, 1));
}

TEST(a_half_float_is_a_float_exactly)
{
    static const struct {
        uint16_t half;
        float value;
    } halves[] = {{0x3C00, 1}, {0xC000, -2}, {0x4D60, 21.5f}, {0x7BFF, 65504}, {0x0001, 0x1p-24f}};
    const float large = 65520, tiny = 1e-9f;
    float back = 0;

    for (unsigned i = 0; i < COUNT(halves); i++) {
        OK(mbm_registers_setHalf(&r, FIRST, 0, &halves[i].value));
        expect(&halves[i].half, 1);
        OK(mbm_registers_getHalf(&r, FIRST, 0, &back));
        assert_true(back == halves[i].value);
    }
    words[0] = 0x7E00;
    OK(mbm_registers_getHalf(&r, FIRST, 0, &back));
    assert_true(isnan(back));
    words[0] = 0x00FC; /* -infinity, with its bytes swapped */
    OK(mbm_registers_getHalf(&r, FIRST, MBM_ORDER_BADC, &back));
    assert_true(isinf(back) && back < 0);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setHalf(&r, FIRST, 0, &large));
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setHalf(&r, FIRST, 0, &tiny));
}

TEST(bits_of_a_field_are_a_number_and_leave_the_others)
{
    static const uint16_t changed[] = {0xABCF, 0xFFCD};
    const uint64_t ones = 0x3FF, more = 0x400, all = UINT64_MAX, bit = 1;
    uint64_t value = 0;

    OK(mbm_registers_setBits(&r, FIRST, 2, 0, 8, 10, &ones));
    expect(changed, 2);
    OK(mbm_registers_getBits(&r, FIRST, 2, 0, 8, 10, &value));
    assert_true(value == 0x3FF);
    OK(mbm_registers_getBits(&r, FIRST, 2, 0, 0, 32, &value));
    assert_true(value == 0xABCFFFCD);
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setBits(&r, FIRST, 2, 0, 8, 10, &more));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBits(&r, FIRST, 2, 0, 23, 10, &bit));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBits(&r, FIRST, 2, 0, 0, 0, &bit));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBits(&r, FIRST, 0, 0, 0, 1, &bit));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBits(&r, FIRST, 5, 0, 0, 1, &bit));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBits(&r, FIRST, 4, 0, 255, 255, &bit));
    OK(mbm_registers_setBits(&r, FIRST, 4, MBM_ORDER_DCBA, 0, 64, &all));
    OK(mbm_registers_getBits(&r, FIRST, 4, 0, 63, 1, &value));
    assert_true(value == 1);
}

/* --- texts --- */

TEST(a_text_has_one_character_in_each_register_or_two)
{
    static const struct {
        const char *name;
        uint16_t words[4], count;
        uint8_t form, order;
    } texts[] = {
        {"two", {0x4162, 0x6300}, 2, 0, MBM_ORDER_ABCD},
        {"two, swapped", {0x6241, 0x0063}, 2, 0, MBM_ORDER_BADC},
        {"two, spaces", {0x4162, 0x6320}, 2, MBM_TEXT_SPACES, MBM_ORDER_ABCD},
        {"two, spaces, swapped", {0x6241, 0x2063}, 2, MBM_TEXT_SPACES, MBM_ORDER_DCBA},
        {"low", {0x41, 0x62, 0x63, 0}, 4, MBM_TEXT_LOW_BYTES, MBM_ORDER_ABCD},
        {"high", {0x4100, 0x6200, 0x6300, 0}, 4, MBM_TEXT_HIGH_BYTES, MBM_ORDER_ABCD},
        {"high, any order", {0x4100, 0x6200, 0x6300, 0}, 4, MBM_TEXT_HIGH_BYTES, MBM_ORDER_DCBA},
        {"low, spaces",
         {0x41, 0x62, 0x63, 0x20},
         4,
         MBM_TEXT_LOW_BYTES | MBM_TEXT_SPACES,
         MBM_ORDER_ABCD},
        {"high, spaces",
         {0x4100, 0x6200, 0x6300, 0x2000},
         4,
         MBM_TEXT_HIGH_BYTES | MBM_TEXT_SPACES,
         MBM_ORDER_CDAB}};
    char back[5];

    for (unsigned i = 0; i < COUNT(texts); i++) {
        setup();
        OK(mbm_registers_setText(&r, FIRST, 4, texts[i].order, texts[i].form, "Abc"));
        expect(texts[i].words, texts[i].count);
        OK(mbm_registers_getText(&r, FIRST, 4, texts[i].order, texts[i].form, back, 5));
        assert_string_equal(back, "Abc");
        IS(MBM_BUFFER_TOO_SMALL,
           mbm_registers_getText(&r, FIRST, 4, texts[i].order, texts[i].form, back, 3));
        NOTHING(MBM_BUFFER_TOO_SMALL,
                mbm_registers_setText(&r, FIRST, 4, texts[i].order, texts[i].form, "Abcde"));
    }
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setText(&r, FIRST, 4, 0, 3, "Abc"));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setText(&r, FIRST, 4, 0, 8, "Abc"));
    NOTHING(MBM_ILLEGAL_DATA_ADDRESS,
            mbm_registers_setText(&r, FIRST, WORDS + 1, 0, MBM_TEXT_LOW_BYTES, ""));
}

TEST(spaces_end_a_text_that_is_filled_with_them_and_no_other)
{
    char back[9];

    OK(mbm_registers_setText(&r, FIRST, 8, 0, MBM_TEXT_SPACES, "a b"));
    OK(mbm_registers_getText(&r, FIRST, 8, 0, MBM_TEXT_SPACES, back, 9));
    assert_string_equal(back, "a b");
    OK(mbm_registers_getText(&r, FIRST, 8, 0, 0, back, 9));
    assert_string_equal(back, "a b     ");
    /* A NUL ends it too, with spaces before it. */
    words[1] = 0x2000;
    OK(mbm_registers_getText(&r, FIRST, 8, 0, MBM_TEXT_SPACES, back, 9));
    assert_string_equal(back, "a");
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setText(&r, FIRST, 8, 0, MBM_TEXT_SPACES, "ends "));
    OK(mbm_registers_setText(&r, FIRST, 8, 0, 0, "ends "));
    OK(mbm_registers_setText(&r, FIRST, 3, 0, MBM_TEXT_SPACES, ""));
    OK(mbm_registers_getText(&r, FIRST, 3, 0, MBM_TEXT_SPACES, back, 1));
    assert_string_equal(back, "");
}

/* --- dates --- */

static void expect_date(const mbm_date *is, const mbm_date *wanted)
{
    assert_memory_equal(is, wanted, sizeof *is);
}

TEST(a_layout_says_what_the_registers_of_a_date_hold)
{
    /* Six registers as Growatt and Sungrow, and as Solis have them; three as Deye has them; three
     * and four as Square D has them; two and two as Electrex has them; BCD; a day; a time. */
    static const struct {
        const char *layout;
        uint8_t is_bcd, order;
        uint16_t words[7], count;
        mbm_date date;
    } dates[] = {
        {"Y M D h m s", 0, 0, {2026, 9, 16, 9, 30, 22}, 6, {2026, 0, 9, 16, 9, 30, 22, 0}},
        {"y M D h m s", 0, 0, {26, 6, 13, 0, 1, 50}, 6, {2026, 0, 6, 13, 0, 1, 50, 0}},
        {"yM Dh ms", 0, 0, {0x1A0B, 0x1B17, 0x3B3A}, 3, {2026, 0, 11, 27, 23, 59, 58, 0}},
        {"yM Dh ms",
         0,
         MBM_ORDER_BADC,
         {0x0B1A, 0x171B, 0x3A3B},
         3,
         {2026, 0, 11, 27, 23, 59, 58, 0}},
        {"MD nh ms", 0, 0, {0x0B1B, 0x7E17, 0x3B3A}, 3, {2026, 0, 11, 27, 23, 59, 58, 0}},
        {"MD nh ms f", 0, 0, {0x0B1B, 0x7E17, 0x3B3A, 999}, 4, {2026, 999, 11, 27, 23, 59, 58, 0}},
        {"Cy MD -h ms",
         0,
         0,
         {0x141A, 0x0B1B, 0x0017, 0x3B3A},
         4,
         {2026, 0, 11, 27, 23, 59, 58, 0}},
        {"sm h- DM yC",
         1,
         0,
         {0x5859, 0x2300, 0x2711, 0x2620},
         4,
         {2026, 0, 11, 27, 23, 59, 58, 0}},
        {"Y M D h", 1, 0, {0x2026, 0x11, 0x27, 0x23}, 4, {2026, 0, 11, 27, 23, 0, 0, 0}},
        {"Y M D", 0, 0, {2024, 2, 29}, 3, {2024, 0, 2, 29, 0, 0, 0, 0}},
        {"Y M D", 0, MBM_ORDER_CDAB, {2024, 2, 29}, 3, {2024, 0, 2, 29, 0, 0, 0, 0}},
        {"hm", 0, 0, {0x071E}, 1, {0, 0, 0, 0, 7, 30, 0, 0}},
        {"s m h", 0, 0, {0, 30, 7}, 3, {0, 0, 0, 0, 7, 30, 0, 0}}};

    for (unsigned i = 0; i < COUNT(dates); i++) {
        mbm_date back = MBM_INIT;

        setup();
        OK(mbm_registers_setDate(&r, FIRST, dates[i].order, dates[i].layout, dates[i].is_bcd,
                                 &dates[i].date));
        expect(dates[i].words, dates[i].count);
        OK(mbm_registers_getDate(&r, FIRST, dates[i].order, dates[i].layout, dates[i].is_bcd,
                                 &back));
        expect_date(&back, &dates[i].date);
    }
}

TEST(registers_that_hold_no_date_have_a_status_of_their_own)
{
    static const struct {
        const char *layout;
        uint8_t is_bcd;
        uint16_t words[6];
    } wrong[] = {{"Y M D h m s", 0, {2026, 2, 29, 0, 0, 0}},
                 {"Y M D h m s", 0, {2026, 0, 1, 0, 0, 0}},
                 {"Y M D h m s", 0, {2026, 13, 1, 0, 0, 0}},
                 {"Y M D h m s", 0, {2026, 1, 1, 24, 0, 0}},
                 {"Y M D h m s", 0, {2026, 1, 1, 0, 60, 0}},
                 {"Y M D h m s", 0, {2026, 1, 1, 0, 0, 60}},
                 {"Y M D h m s", 0, {2026, 257, 1, 0, 0, 0}},
                 {"Y M D h m s", 0, {0, 0, 0, 0, 0, 0}},
                 {"Y M D h m s", 0, {0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF}},
                 {"yM Dh ms", 0, {0xFFFF, 0xFFFF, 0xFFFF}},
                 {"yM Dh ms", 1, {0x261A, 0x0100, 0}},
                 {"yM Dh ms", 0, {0, 0, 0}},
                 {"n M D", 0, {0xFFFF, 1, 1}},
                 {"yC M D", 0, {0xFFFF, 1, 1}},
                 {"hm", 0, {0x1800}}};

    for (unsigned i = 0; i < COUNT(wrong); i++) {
        mbm_date back = {.year = 7};

        memcpy(words, wrong[i].words, sizeof wrong[i].words);
        IS(MBM_MALFORMED_VALUE,
           mbm_registers_getDate(&r, FIRST, 0, wrong[i].layout, wrong[i].is_bcd, &back));
        assert_int_equal(back.year, 7);
    }
}

TEST(a_date_that_the_registers_cannot_hold_exactly_is_refused)
{
    static const struct {
        uint8_t status;
        const char *layout;
        uint8_t is_bcd;
        mbm_date date;
    } wrong[] = {{MBM_INVALID_ARGUMENT, "Y M D", 0, {2026, 0, 2, 29, 0, 0, 0, 0}},
                 {MBM_INVALID_ARGUMENT, "Y M D", 0, {0, 0, 0, 0, 0, 0, 0, 0}},
                 {MBM_INVALID_ARGUMENT, "h m", 0, {2026, 0, 1, 1, 1, 1, 0, 0}},
                 {MBM_INVALID_ARGUMENT, "Y M D h", 0, {2026, 0, 1, 1, 24, 0, 0, 0}},
                 {MBM_OUT_OF_RANGE, "Y M D", 0, {2026, 0, 1, 1, 1, 0, 0, 0}},
                 {MBM_OUT_OF_RANGE, "Y M D h m", 0, {2026, 0, 1, 1, 1, 1, 1, 0}},
                 {MBM_OUT_OF_RANGE, "Y M D h m s", 0, {2026, 5, 1, 1, 1, 1, 1, 0}},
                 {MBM_OUT_OF_RANGE, "yM Dh", 0, {2256, 0, 1, 1, 1, 0, 0, 0}},
                 {MBM_OUT_OF_RANGE, "yM Dh", 0, {1999, 0, 1, 1, 1, 0, 0, 0}},
                 {MBM_OUT_OF_RANGE, "nM Dh", 0, {1899, 0, 1, 1, 1, 0, 0, 0}},
                 {MBM_OUT_OF_RANGE, "yM Dh", 1, {2100, 0, 1, 1, 1, 0, 0, 0}}};

    for (unsigned i = 0; i < COUNT(wrong); i++)
        NOTHING(wrong[i].status, mbm_registers_setDate(&r, FIRST, 0, wrong[i].layout,
                                                       wrong[i].is_bcd, &wrong[i].date));
}

TEST(a_layout_that_is_none_is_refused)
{
    static const char *const WRONG[] = {
        "",         " ",         "Y  M D",        "YMD",         "Y M D ", "Y M",     "M D h m s",
        "Y M D m",  "Y M D h s", "Y M D h m s q", "Y Y M D",     "YM D",   "y Y M D", "C M D",
        "h m s hf", "s",         "D h",           "Y M D h m f", "--",     "x"};
    mbm_date date = {.year = 2026, .month = 1, .day = 1};

    for (unsigned i = 0; i < COUNT(WRONG); i++) {
        NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setDate(&r, FIRST, 0, WRONG[i], 0, &date));
        IS(MBM_INVALID_ARGUMENT, mbm_registers_getDate(&r, FIRST, 0, WRONG[i], 0, &date));
    }
}

TEST(a_date_of_iec_870_5_4_has_three_or_four_registers)
{
    /* 2026-11-27 23:59:58.123, Friday, in summer time, not synchronised. */
    static const uint16_t plain[] = {26, 0x0B1B, 0x173B, 58123};
    const mbm_date friday = {2026, 123, 11, 27, 23, 59, 58, 0};
    mbm_date back = MBM_INIT, other = friday;

    OK(mbm_registers_setIecDate(&r, FIRST, 4, 0, &friday));
    expect(plain, 4);
    words[1] |= 6 << 5;
    words[2] |= 0x8080;
    words[0] |= 0xFF80;
    OK(mbm_registers_getIecDate(&r, FIRST, 4, 0, &back));
    other.flags = MBM_DATE_SUMMER_TIME | MBM_DATE_UNRELIABLE;
    expect_date(&back, &other);
    OK(mbm_registers_setIecDate(&r, FIRST, 4, MBM_ORDER_CDAB, &other));
    assert_int_equal(words[0], 58123);
    assert_int_equal(words[1], 0x97BB);
    assert_int_equal(words[3], 26);
    OK(mbm_registers_getIecDate(&r, FIRST, 4, MBM_ORDER_CDAB, &back));
    expect_date(&back, &other);
    setup();
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setIecDate(&r, FIRST, 3, 0, &friday));
    other.second = 0;
    other.millisecond = other.flags = 0;
    OK(mbm_registers_setIecDate(&r, FIRST, 3, 0, &other));
    expect(plain, 3);
    OK(mbm_registers_getIecDate(&r, FIRST, 3, 0, &back));
    expect_date(&back, &other);
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setIecDate(&r, FIRST, 2, 0, &other));
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setIecDate(&r, FIRST, 5, 0, &other));
    other.year = 2128;
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setIecDate(&r, FIRST, 3, 0, &other));
    other.year = 1999;
    NOTHING(MBM_OUT_OF_RANGE, mbm_registers_setIecDate(&r, FIRST, 3, 0, &other));
    other.month = 0;
    NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setIecDate(&r, FIRST, 3, 0, &other));
    memset(words, 0, sizeof words);
    IS(MBM_MALFORMED_VALUE, mbm_registers_getIecDate(&r, FIRST, 3, 0, &back));
    memset(words, 0xFF, sizeof words);
    IS(MBM_MALFORMED_VALUE, mbm_registers_getIecDate(&r, FIRST, 4, 0, &back));
}

TEST(a_date_is_a_number_of_seconds_since_1970)
{
    static const struct {
        int64_t seconds;
        mbm_date date;
    } dates[] = {{0, {1970, 0, 1, 1, 0, 0, 0, 0}},
                 {1234567890, {2009, 0, 2, 13, 23, 31, 30, 0}},
                 {4294967295, {2106, 0, 2, 7, 6, 28, 15, 0}},
                 {-1, {1969, 0, 12, 31, 23, 59, 59, 0}},
                 {253402300799, {9999, 0, 12, 31, 23, 59, 59, 0}}};
    const int64_t late = 253402300800;
    mbm_date date = {.year = 7}, none = {.year = 2026, .month = 2, .day = 29}, noon = {.hour = 12};
    int64_t seconds = 5;

    for (unsigned i = 0; i < COUNT(dates); i++) {
        OK(mbm_date_getSeconds(&dates[i].date, &seconds));
        assert_true(seconds == dates[i].seconds);
        OK(mbm_date_setSeconds(&date, &dates[i].seconds));
        expect_date(&date, &dates[i].date);
    }
    IS(MBM_OUT_OF_RANGE, mbm_date_setSeconds(&date, &late));
    IS(MBM_INVALID_ARGUMENT, mbm_date_setSeconds(&date, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_date_setSeconds(NULL, &late));
    IS(MBM_INVALID_ARGUMENT, mbm_date_getSeconds(&none, &seconds));
    IS(MBM_INVALID_ARGUMENT, mbm_date_getSeconds(&noon, &seconds));
    IS(MBM_INVALID_ARGUMENT, mbm_date_getSeconds(NULL, &seconds));
    IS(MBM_INVALID_ARGUMENT, mbm_date_getSeconds(&dates[0].date, NULL));
    assert_int_equal(date.year, 9999);
    assert_true(seconds == 253402300799);
}
