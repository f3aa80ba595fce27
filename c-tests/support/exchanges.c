#include "exchanges.h"

#include "sim.h"

#include <stdlib.h>

uint8_t exchange_unit(const exchange *e)
{
    uint8_t bytes[512];

    return e->request && e->request[0] && sim_bytes(bytes, e->request) > 0 ? bytes[0]
           : e->request && !e->request[0]                                  ? 0
                                                                           : 17;
}

uint16_t exchange_words(uint16_t *words, const char *text)
{
    uint16_t count = 0;
    char *end;

    for (; text && *text; text = end)
        words[count++] = (uint16_t)strtoul(text, &end, 16);
    return count;
}

/* clang-format off */
#define WITH(...) {__VA_ARGS__}
/* A read, a write, a write without more words than its arguments, and a call that fails. */
#define READS(function, with, request, reply, response)  \
    {function, with, NULL, request, reply, MBM_OK, response, 0}
#define WRITES(function, with, words, request, reply)  \
    {function, with, words, request, reply, MBM_OK, NULL, 0}
#define REPEATS(function, with, frame) {function, with, NULL, frame, frame, MBM_OK, NULL, 0}
#define FAILS(status, function, with, reply) {function, with, NULL, NULL, reply, status, NULL, 0}
/* A read of one register that ends with an exception code. */
#define CODE(status, code, reply) {3, {0, 1}, NULL, NULL, reply, status, NULL, code}

#define GROUP(name, ...)  \
    static const exchange name[] = {__VA_ARGS__};  \
    const exchange_group name##_rows = {name, sizeof name / sizeof name[0]};

GROUP(frames_are_those_of_the_specification,
    READS(0x01, WITH(19, 19), "11 01 00 13 00 13 +", "11 01 03 CD 6B 05 +", "6BCD 0005"),
    READS(0x02, WITH(196, 22), "11 02 00 C4 00 16 +", "11 02 03 AC DB 35 +", "DBAC 0035"),
    READS(0x03, WITH(107, 3), "11 03 00 6B 00 03 +", "11 03 06 02 2B 00 00 00 64 +", "022B 0000 0064"),
    READS(0x04, WITH(8, 1), "11 04 00 08 00 01 +", "11 04 02 00 0A +", "000A"),
    REPEATS(0x05, WITH(172, 1), "11 05 00 AC FF 00 +"),
    REPEATS(0x05, WITH(172, 0), "11 05 00 AC 00 00 +"),
    REPEATS(0x06, WITH(1, 3), "11 06 00 01 00 03 +"),
    WRITES(0x0F, WITH(19, 10), "01CD", "11 0F 00 13 00 0A 02 CD 01 +", "11 0F 00 13 00 0A +"),
    WRITES(0x10, WITH(1, 2), "000A 0102", "11 10 00 01 00 02 04 00 0A 01 02 +", "11 10 00 01 00 02 +"),
    REPEATS(0x16, WITH(4, 0x00F2, 0x0025), "11 16 00 04 00 F2 00 25 66 E2"),
    {0x17, {3, 6, 14, 3}, "00FF 00FF 00FF", "11 17 00 03 00 06 00 0E 00 03 06 00 FF 00 FF 00 FF +",
     "11 17 0C 00 FE 0A CD 00 01 00 03 00 0D 00 FF +", MBM_OK, "00FE 0ACD 0001 0003 000D 00FF", 0})

/* With their CRC. */
GROUP(frames_are_those_of_the_documentation_of_another_library,
    {1, {107, 3}, NULL, "10 01 00 6B 00 03 0E 96", NULL, MBM_RESPONSE_TIMED_OUT, NULL, 0},
    {2, {107, 3}, NULL, "10 02 00 6B 00 03 4A 96", NULL, MBM_RESPONSE_TIMED_OUT, NULL, 0},
    READS(0x03, WITH(107, 1), "01 03 00 6B 00 01 F5 D6", "01 03 02 CD 6B AD 3B", "CD6B"),
    READS(0x04, WITH(107, 1), "01 04 00 6B 00 01 40 16", "01 04 02 CD 6B AC 4F", "CD6B"),
    REPEATS(0x05, WITH(107, 1), "11 05 00 6B FF 00 FF 76"),
    REPEATS(0x06, WITH(107, 0x0101), "11 06 00 6B 01 01 3A D6"),
    WRITES(0x0F, WITH(0x410, 3), "0005", "11 0F 04 10 00 03 01 05 8E 1F", "11 0F 04 10 00 03 17 AF"),
    WRITES(0x10, WITH(0x410, 3), "00C8 0082 8701", "11 10 04 10 00 03 06 00 C8 00 82 87 01 2F 7D",
           "11 10 04 10 00 03 82 6D"),
    {0x17, {0x410, 1, 0x112, 2}, "00C8 0082", "11 17 04 10 00 01 01 12 00 02 04 00 C8 00 82 64 E2",
     "11 17 02 CD 6B 69 08", MBM_OK, "CD6B", 0})

GROUP(any_state_except_zero_is_on,
    REPEATS(0x05, WITH(0, 1), "11 05 00 00 FF 00 +"),
    REPEATS(0x05, WITH(0, 2), "11 05 00 00 FF 00 +"),
    REPEATS(0x05, WITH(0, 0x80), "11 05 00 00 FF 00 +"),
    REPEATS(0x05, WITH(0, 0xFF), "11 05 00 00 FF 00 +"))

/* The bits beyond the quantity are no data, whatever the device sends. */
GROUP(unused_bits_are_zero_in_both_directions,
    READS(0x01, WITH(0, 24), "11 01 00 00 00 18 +", "11 01 03 CD 6B FF +", "6BCD 00FF"),
    READS(0x01, WITH(0, 3), "11 01 00 00 00 03 +", "11 01 01 FF +", "0007"),
    WRITES(0x0F, WITH(0, 3), "FFFF", "11 0F 00 00 00 03 01 07 +", "11 0F 00 00 00 03 +"),
    WRITES(0x0F, WITH(0, 9), "FFFF", "11 0F 00 00 00 09 02 FF 01 +", "11 0F 00 00 00 09 +"))

GROUP(units_248_to_255_are_accepted,
    READS(0x03, WITH(0, 1), "F7 03 00 00 00 01 +", "F7 03 02 00 07 +", "0007"),
    READS(0x03, WITH(0, 1), "F8 03 00 00 00 01 +", "F8 03 02 00 01 +", "0001"),
    READS(0x03, WITH(0, 1), "FF 03 00 00 00 01 +", "FF 03 02 00 02 +", "0002"))

GROUP(the_last_address_can_be_read_and_written,
    READS(0x03, WITH(65535, 1), "11 03 FF FF 00 01 +", "11 03 02 00 07 +", "0007"),
    WRITES(0x0F, WITH(65534, 2), "0001", "11 0F FF FE 00 02 01 01 +", "11 0F FF FE 00 02 +"),
    REPEATS(0x06, WITH(65535, 2), "11 06 FF FF 00 02 +"),
    {0x17, {65535, 1, 65535, 1}, "0003", "11 17 FF FF 00 01 FF FF 00 01 02 00 03 +",
     "11 17 02 00 07 +", MBM_OK, "0007", 0})

GROUP(reads_of_more_than_64_registers_are_sent,
    {3, {0, 65}, NULL, "11 03 00 00 00 41 +", "11 83 02 +", 2, NULL, 2},
    {3, {0, 66}, NULL, "11 03 00 00 00 42 +", "11 83 02 +", 2, NULL, 2},
    {3, {0, 125}, NULL, "11 03 00 00 00 7D +", "11 83 02 +", 2, NULL, 2})

GROUP(only_writes_are_broadcast,
    {0x01, {0, 1}, NULL, "", NULL, MBM_BROADCAST_NOT_ALLOWED, NULL, 0},
    {0x02, {0, 1}, NULL, "", NULL, MBM_BROADCAST_NOT_ALLOWED, NULL, 0},
    {0x03, {0, 1}, NULL, "", NULL, MBM_BROADCAST_NOT_ALLOWED, NULL, 0},
    {0x04, {0, 1}, NULL, "", NULL, MBM_BROADCAST_NOT_ALLOWED, NULL, 0},
    {0x17, {0, 1, 0, 1}, "0001", "", NULL, MBM_BROADCAST_NOT_ALLOWED, NULL, 0},
    WRITES(0x05, WITH(1, 1), NULL, "00 05 00 01 FF 00 +", NULL),
    WRITES(0x06, WITH(1, 2), NULL, "00 06 00 01 00 02 +", NULL),
    WRITES(0x0F, WITH(1, 9), "01FF", "00 0F 00 01 00 09 02 FF 01 +", NULL),
    WRITES(0x10, WITH(1, 1), "0002", "00 10 00 01 00 01 02 00 02 +", NULL),
    WRITES(0x16, WITH(1, 2, 3), NULL, "00 16 00 01 00 02 00 03 +", NULL))

GROUP(exceptions_are_returned_and_those_of_no_valid_code_are_malformed,
    CODE(1, 1, "11 83 01 +"), CODE(2, 2, "11 83 02 +"), CODE(8, 8, "11 83 08 +"),
    CODE(0x0B, 0x0B, "11 83 0B +"), CODE(0x55, 0x55, "11 83 55 +"), CODE(0x7F, 0x7F, "11 83 7F +"),
    CODE(MBM_MALFORMED_REPLY, 0, "11 83 00 +"), CODE(MBM_MALFORMED_REPLY, 0x80, "11 83 80 +"),
    CODE(MBM_MALFORMED_REPLY, 0xE2, "11 83 E2 +"), CODE(MBM_MALFORMED_REPLY, 0xFF, "11 83 FF +"),
    CODE(MBM_INVALID_CRC, 0, "11 83 02 00 00"),
    /* After four bytes that look like the start of a longer reply. */
    {3, {0, 10}, NULL, NULL, "11 03 14 00 / 11 83 02 +", 2, NULL, 2})

GROUP(each_failure_has_its_status,
    FAILS(MBM_RESPONSE_TIMED_OUT, 0x03, WITH(0, 1), NULL),
    FAILS(MBM_INVALID_SLAVE_ID, 0x03, WITH(0, 1), "12 03 02 00 01 +"),
    FAILS(MBM_INVALID_FUNCTION, 0x03, WITH(0, 1), "11 04 02 00 01 +"),
    FAILS(MBM_INVALID_FUNCTION, 0x03, WITH(0, 1), "11 84 02 +"),
    FAILS(MBM_INVALID_CRC, 0x03, WITH(0, 1), "11 03 02 00 01 00 00"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 04 00 01 00 02 +"),
    FAILS(MBM_RESPONSE_TIMED_OUT, 0x03, WITH(0, 1), "11 03 02 00"))

GROUP(the_most_specific_failure_is_reported,
    FAILS(MBM_INVALID_FUNCTION, 0x03, WITH(0, 1), "12 03 02 00 01 + / 11 04 02 00 01 +"),
    FAILS(MBM_INVALID_FUNCTION, 0x03, WITH(0, 1), "11 04 02 00 01 + / 12 03 02 00 01 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 04 00 01 00 02 + / 11 04 02 00 01 +"))

GROUP(a_byte_count_that_does_not_suit_the_request_is_malformed,
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 4), "11 03 02 AA AA +"),
    FAILS(MBM_MALFORMED_REPLY, 0x01, WITH(0, 8), "11 01 02 FF FF +"),
    FAILS(MBM_MALFORMED_REPLY, 0x17, WITH(0, 2, 0, 1), "11 17 02 FF FF +"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 FB 12 34 56 78 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 FC 12 34 56 78 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 FD 12 34 56 78 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 FE 12 34 56 78 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x03, WITH(0, 1), "11 03 FF 12 34 56 78 +"),
    FAILS(MBM_INVALID_CRC, 0x03, WITH(0, 1), "11 03 FB 12 34 56 78"))

GROUP(an_echo_with_another_address_or_value_is_malformed,
    FAILS(MBM_MALFORMED_REPLY, 0x05, WITH(1, 1), "11 05 00 02 FF 00 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x05, WITH(1, 1), "11 05 00 01 00 00 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x06, WITH(1, 0x1234), "11 06 00 02 12 34 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x06, WITH(1, 0x1234), "11 06 00 01 12 35 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x0F, WITH(1, 9), "11 0F 00 01 00 08 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x0F, WITH(1, 9), "11 0F 00 00 00 09 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x10, WITH(1, 2), "11 10 00 01 00 01 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x10, WITH(1, 2), "11 10 01 01 00 02 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x16, WITH(1, 2, 3), "11 16 00 01 00 02 00 04 +"),
    FAILS(MBM_MALFORMED_REPLY, 0x16, WITH(1, 2, 3), "11 16 00 01 00 06 00 03 +"))

#define AFTER(noise)  \
    READS(0x03, WITH(0, 2), "11 03 00 00 00 02 +", noise " / 11 03 04 12 34 56 78 +", "1234 5678")
GROUP(a_reply_is_found_after_noise_and_after_frames_that_are_no_answer,
    AFTER("00"), AFTER("FF FE 7F 00 33"), AFTER("11"), AFTER("11 11 11 11"),
    /* noise that looks like its header */
    AFTER("11 03"), AFTER("11 03 04"), AFTER("11 03 04 00"), AFTER("11 03 04 12 34 56 78"),
    AFTER("11 03 04 00 00 00 00 00 00"), AFTER("11 83"), AFTER("11 83 02 00 00"),
    /* frames of another unit */
    AFTER("12 03 04 AA AA BB BB +"), AFTER("12 83 02 +"),
    AFTER("12 03 00 00 00 02 + / 12 03 04 AA AA BB BB +"),
    /* late replies of another function or length */
    AFTER("11 04 04 AA AA BB BB +"), AFTER("11 03 02 AA AA +"), AFTER("11 06 00 01 00 02 +"),
    AFTER("11 84 02 +"))
/* clang-format on */
