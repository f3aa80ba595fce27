/* Packed coils, checked against the examples of V1.1b3. */
#include "mbm.h"
#include "test.h"

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

TEST(null_is_an_invalid_argument)
{
    uint8_t byte = 0;
    uint16_t word = 0;

    IS(MBM_INVALID_ARGUMENT, mbm_bits_pack(NULL, 1, &byte, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_pack(&byte, 1, NULL, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_unpack(NULL, 1, &byte, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_unpack(&byte, 1, NULL, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_isSet(NULL, 0, 1, 0, &byte));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_isSet(&byte, 0, 1, 0, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_isSetInWords(&word, 0, 1, 0, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_set(NULL, 0, 1, 0, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_setInWords(NULL, 0, 1, 0, 1));
}
