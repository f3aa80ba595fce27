/* What a refused call leaves in the caller's variables: lengths become 0, all other
 * variables stay as they were. */
#include "refused.h"
#include "mbm.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

/* --- values --- */

TEST(refused_values_change_nothing)
{
    uint16_t *two = (uint16_t *)malloc(4);
    uint8_t *bytes = (uint8_t *)malloc(2), coils[20];
    const uint64_t big = 1;
    const float number = 1;
    const double longer = 1;
    mbm_registers r;

    two[0] = two[1] = 0x1111;
    memset(bytes, 0x22, 2);
    memset(coils, 1, sizeof coils);
    OK(mbm_registers_intoWords(&r, two, 2, 100));
#define KEPT(status, call)                                                                         \
    do {                                                                                           \
        IS(status, call);                                                                          \
        assert_true(two[0] == 0x1111 && two[1] == 0x1111);                                         \
        assert_true(bytes[0] == 0x22 && bytes[1] == 0x22);                                         \
    } while (0)
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setBit(&r, 102, 0, 1));
    KEPT(MBM_INVALID_ARGUMENT, mbm_registers_setBit(&r, 100, 16, 1));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setUint16(&r, 102, 0, 1));
    KEPT(MBM_INVALID_ARGUMENT, mbm_registers_setUint16(&r, 100, 9, 1));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setUint32(&r, 101, 0, 1));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setUint64(&r, 100, 0, &big));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setFloat(&r, 101, 0, &number));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setDouble(&r, 100, 0, &longer));
    KEPT(MBM_INVALID_ARGUMENT, mbm_registers_setFloat(&r, 100, 0, NULL));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setString(&r, 100, 5, 0, "a"));
    KEPT(MBM_INVALID_ARGUMENT, mbm_registers_setString(&r, 100, 4, 0, NULL));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setBytes(&r, 100, MBM_ORDER_ABCD, coils, 5));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_setBytes(&r, 101, 0, coils, 4));
    KEPT(MBM_BUFFER_TOO_SMALL, mbm_bits_pack(coils, 17, bytes, 2));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_set(bytes, 10, 16, 26, 1));
    KEPT(MBM_ILLEGAL_DATA_ADDRESS, mbm_bits_setInWords(two, 10, 32, 9, 1));
    /* A view that is refused covers no registers. */
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_intoWords(&r, two, 2, 65535));
    IS(MBM_NOT_INITIALISED, mbm_registers_setUint16(&r, 65535, 0, 1));
    free(two);
    free(bytes);
}

/* --- the caller's variables --- */

TEST(a_refused_call_sets_its_length_to_0)
{
    const mbm_framing rtu = {.kind = MBM_FRAMING_RTU}, none = {.kind = 9};
    mbm_packet packet = {.function = 3, .quantity = 1, .unit = 17};
    mbm_length expected;
    uint8_t frame[16] = {17, 3, 0, 0, 0, 1};
    uint16_t length;
    mbm_unit unit;

#define NO_LENGTH(status, call)                                                                    \
    do {                                                                                           \
        length = 0x7777;                                                                           \
        IS(status, call);                                                                          \
        assert_int_equal(length, 0);                                                               \
    } while (0)
#define UNKNOWN(status, call)                                                                      \
    do {                                                                                           \
        memset(&expected, 0x77, sizeof expected);                                                  \
        IS(status, call);                                                                          \
        assert_int_equal(expected.bytes, 0);                                                       \
        assert_int_equal(expected.kind, MBM_LENGTH_UNKNOWN);                                       \
    } while (0)
    memset(&unit, 0, sizeof unit);
    NO_LENGTH(MBM_INVALID_ARGUMENT,
              mbm_unit_respond(&unit, 1, NULL, FRAMING(4), frame, 8, 16, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT,
              mbm_unit_respond(NULL, 1, NULL, FRAMING(0), frame, 8, 16, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT,
              mbm_unit_respond(&unit, 1, NULL, FRAMING(0), NULL, 8, 16, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT,
              mbm_unit_respond(&unit, 1, NULL, FRAMING(0), frame, 17, 16, &length));
    NO_LENGTH(MBM_OK, mbm_unit_respond(&unit, 1, NULL, FRAMING(0), frame, 8, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_unit_respond(&unit, 1, NULL, FRAMING(0), frame, 8, 16, NULL));
    NO_LENGTH(MBM_INVALID_ARGUMENT, mbm_frame_build(&none, &packet, frame, 16, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT, mbm_frame_build(&rtu, NULL, frame, 16, &length));
    NO_LENGTH(MBM_BUFFER_TOO_SMALL, mbm_frame_build(&rtu, &packet, frame, 7, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), NULL, frame, 16, &length));
    NO_LENGTH(MBM_BUFFER_TOO_SMALL, mbm_frame_build(PDU(NULL, 0), &packet, frame, 4, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT, mbm_frame_exception(&rtu, &packet, 0, frame, 16, &length));
    NO_LENGTH(MBM_BUFFER_TOO_SMALL, mbm_frame_exception(&rtu, &packet, 1, frame, 4, &length));
    NO_LENGTH(MBM_INVALID_ARGUMENT, mbm_frame_looksLikeTcp(NULL, 8, 0, &length));
    NO_LENGTH(MBM_INCOMPLETE_FRAME,
              mbm_frame_looksLikeTcp((const uint8_t *)"\0\1\0\0", 4, 0, &length));
    UNKNOWN(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(&rtu, 9, frame, 2, &expected));
    UNKNOWN(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(NULL, 0, frame, 2, &expected));
    UNKNOWN(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(&rtu, NULL, &expected));
    UNKNOWN(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(PDU(NULL, 0), 0, NULL, 2, &expected));
    packet.quantity = 0;
    UNKNOWN(MBM_ILLEGAL_DATA_VALUE, mbm_frame_replyLength(PDU(NULL, 0), &packet, &expected));
    UNKNOWN(MBM_ILLEGAL_DATA_VALUE, mbm_frame_replyLength(&rtu, &packet, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(PDU(NULL, 0), &packet, NULL));
}

TEST(a_refused_call_leaves_other_variables_unchanged)
{
    const mbm_framing rtu = {.kind = MBM_FRAMING_RTU}, none = {.kind = 9};
    static mbm_sniffer sniffer;
    mbm_packet packet;
    mbm_record record;
    mbm_object object;
    mbm_event event;
    mbm_registers r;
    uint8_t frame[8] = {0}, byte = 0x77, bytes[4] = {7, 7, 7, 7};
    uint16_t word = 0x7777, cursor = 0, words2[1] = {0};
    uint32_t wide = 0x77777777;
    char text[4] = "777";

    memset(&packet, 0x77, sizeof packet);
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_frame_parse(&none, 0, frame, 8, &packet));
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_frame_parse(&rtu, 2, frame, 8, &packet));
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_frame_parse(&rtu, 0, NULL, 8, &packet));
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_frame_parse(PDU(NULL, 0), 2, frame, 8, &packet));
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_frame_parse(PDU(NULL, 0), 0, NULL, 8, &packet));
    memset(&packet, 0, sizeof packet);
    memset(&record, 0x77, sizeof record);
    memset(&object, 0x77, sizeof object);
    REFUSED(0, record, mbm_packet_nextRecord(&packet, &cursor, &record));
    REFUSED(0, object, mbm_packet_nextObject(&packet, &cursor, &object));
    packet.function = 0x14;
    packet.data = (const uint8_t *)"\6\0\1\0\0\0\1";
    packet.dataLength = 7;
    REFUSED(0, cursor, mbm_packet_nextRecord(&packet, &cursor, NULL));
    REFUSED(1, packet, mbm_packet_nextRecord(&packet, &cursor, &record));
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_packet_addRecord(&packet, NULL, 8, &record));
    REFUSED(MBM_INVALID_ARGUMENT, packet, mbm_packet_addObject(&packet, frame, 8, &object));
    memset(&sniffer, 0, sizeof sniffer);
    memset(&event, 0x77, sizeof event);
    REFUSED(0, event, mbm_sniffer_next(&sniffer, 0, &event));
    OK(mbm_registers_ofWords(&r, words2, 1, 0));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, byte, mbm_registers_getBit(&r, 1, 0, &byte));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, word, mbm_registers_getUint16(&r, 1, 0, &word));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, wide, mbm_registers_getUint32(&r, 0, 0, &wide));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, bytes,
            mbm_registers_getBytes(&r, 0, MBM_ORDER_ABCD, bytes, 4));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, text, mbm_registers_getString(&r, 1, 2, 0, text, 4));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, byte, mbm_bits_isSet(bytes, 0, 8, 8, &byte));
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, bytes, mbm_bits_unpack(frame, 0, bytes, 4));
}

TEST(the_text_of_invalid_argument_mentions_ranges)
{
    assert_non_null(strstr(mbm_status_text(MBM_INVALID_ARGUMENT), "out of range"));
    assert_non_null(strstr(mbm_status_text(MBM_INVALID_ARGUMENT), "NULL"));
    assert_non_null(strstr(mbm_status_text(MBM_BUSY), "hook"));
}
