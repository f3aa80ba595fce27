/* mbm_packet_*: every function in both directions, PDUs that are cut short or changed, and
 * packets that are not possible. */
#include "examples.h"
#include "test.h"

static const mbm_rule three_bytes = {MBM_RULE_FIXED, 3, 0};

TEST(every_example_is_parsed_to_its_fields)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet wanted, found;
    uint16_t length;

    for (size_t i = 0; i < example_count; i++) {
        length = example_load(&examples[i], pdu, &wanted);
        OK(mbm_frame_parse(PDU(NULL, 0), example_side(&examples[i]), pdu, length, &found));
        assert_same_packet(&found, &wanted);
        if (found.dataLength)
            assert_ptr_equal(found.data, wanted.data);
    }
}

TEST(every_example_is_built_byte_for_byte)
{
    uint8_t pdu[MBM_MAX_PDU], built[MBM_MAX_PDU];
    mbm_packet packet;
    uint16_t length, found;

    for (size_t i = 0; i < example_count; i++) {
        length = example_load(&examples[i], pdu, &packet);
        memset(built, 0xEE, sizeof built);
        OK(mbm_frame_build(PDU(NULL, 0), &packet, built, length, &found));
        assert_int_equal(found, length);
        assert_memory_equal(built, pdu, length);
        assert_int_equal(built[length], 0xEE);
        IS(MBM_BUFFER_TOO_SMALL,
           mbm_frame_build(PDU(NULL, 0), &packet, built, (uint16_t)(length - 1), &found));
    }
}

TEST(every_sub_function_of_08_is_built_and_parsed)
{
    static const uint8_t zero[2];
    uint8_t pdu[5];
    unsigned sub_function, known = 0;

    for (sub_function = 0; sub_function < 0x200; sub_function++) {
        mbm_packet packet = {.function = MBM_FC_DIAGNOSTICS, .data = zero, .dataLength = 2}, found;
        uint16_t length;
        uint8_t status;

        packet.subFunction = (uint16_t)sub_function;
        status = mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length);
        if (status == MBM_OK) {
            OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, length, &found));
            assert_same_packet(&found, &packet);
            known++;
        } else {
            IS(MBM_ILLEGAL_FUNCTION, status);
        }
        packet.kind = MBM_PACKET_RESPONSE;
        /* Force Listen Only Mode has no response. */
        IS(status == MBM_OK && sub_function != MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY
               ? MBM_OK
               : MBM_MALFORMED_REPLY,
           mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    }
    assert_int_equal(known, 15);
}

/* Asserts that a PDU is parsed right, so that building the packet gives the same bytes, or
 * is refused with a fitting status. Returns whether it was parsed. */
static unsigned parsed_right(uint8_t side, const uint8_t *pdu, uint16_t length)
{
    uint8_t again[MBM_MAX_PDU];
    mbm_packet packet;
    uint16_t found;
    uint8_t status = mbm_frame_parse(PDU(NULL, 0), side, (uint8_t *)pdu, length, &packet);

    if (status == MBM_OK) {
        OK(mbm_frame_build(PDU(NULL, 0), &packet, again, sizeof again, &found));
        assert_int_equal(found, length);
        assert_memory_equal(again, pdu, length);
        return 1;
    }
    if (side == MBM_PACKET_REQUEST)
        assert_in_range(status, MBM_ILLEGAL_FUNCTION, MBM_ILLEGAL_DATA_VALUE);
    else
        assert_true(status == MBM_INVALID_FUNCTION || status == MBM_MALFORMED_REPLY);
    assert_null(packet.data);
    assert_int_equal(packet.kind, side);
    assert_int_equal(packet.function, length ? pdu[0] : 0);
    return 0;
}

TEST(a_pdu_cut_short_is_parsed_right_or_refused)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;
    uint16_t length;
    unsigned right = 0;

    for (size_t i = 0; i < example_count; i++) {
        length = example_load(&examples[i], pdu, &packet);
        for (uint16_t cut = 0; cut < length; cut++)
            right += parsed_right(example_side(&examples[i]), pdu, cut);
    }
    /* The data of 08/00, 2B/0D and 41, and those of 11 after its byte count, may have any
     * length. */
    assert_in_range(right, 1, 16);
}

TEST(a_pdu_with_one_byte_changed_is_parsed_right_or_refused)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;
    uint16_t length;
    unsigned value, right = 0, all = 0;

    for (size_t i = 0; i < example_count; i++) {
        length = example_load(&examples[i], pdu, &packet);
        for (uint16_t at = 0; at < length; at++) {
            uint8_t was = pdu[at];

            for (value = 0; value < 256; value++) {
                pdu[at] = (uint8_t)value;
                right += parsed_right(example_side(&examples[i]), pdu, length);
                all++;
            }
            pdu[at] = was;
        }
    }
    assert_in_range(right, 1, all - 1);
}

TEST(an_extra_byte_is_refused_unless_the_data_may_have_any_length)
{
    uint8_t pdu[MBM_MAX_PDU + 1];
    mbm_packet packet;
    unsigned right = 0;

    for (size_t i = 0; i < example_count; i++) {
        uint16_t length = example_load(&examples[i], pdu, &packet);

        pdu[length] = 0;
        right += parsed_right(example_side(&examples[i]), pdu, (uint16_t)(length + 1));
    }
    /* The response of 11, and 2B/0D and 41 in both directions. */
    assert_int_equal(right, 5);
}

TEST(an_impossible_packet_is_not_built)
{
    static const uint8_t data[600];
    static const struct {
        uint8_t status;
        mbm_packet packet;
    } refused[] = {
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x01, .quantity = 0}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x01, .quantity = 2001}},
        {MBM_ILLEGAL_DATA_ADDRESS, {.function = 0x02, .address = 0xFFFF, .quantity = 2}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x03, .quantity = 126}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x08, .dataLength = 3}},
        {MBM_ILLEGAL_FUNCTION, {.function = 0x08, .subFunction = 5, .dataLength = 2}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x0F, .quantity = 9, .dataLength = 1}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x10, .quantity = 2, .dataLength = 3}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x10, .quantity = 2, .dataLength = 4 + 256}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x10, .quantity = 125, .dataLength = 250}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x14, .dataLength = 0}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x14, .dataLength = 7}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x15, .dataLength = 600}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x17, .quantity = 1, .writeQuantity = 0}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = 5}},
        {MBM_ILLEGAL_DATA_VALUE, {.function = 0x41, .dataLength = 253}},
        {MBM_ILLEGAL_FUNCTION, {.function = 0x00}},
        {MBM_ILLEGAL_FUNCTION, {.function = 0x09}},
        {MBM_ILLEGAL_FUNCTION, {.function = 0x83}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x01}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x03, .dataLength = 1}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x04, .dataLength = 252}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x0C, .dataLength = 65}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x11, .byteCount = 1}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x14, .dataLength = 4}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x15, .dataLength = 9}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_RESPONSE, .function = 0x18, .dataLength = 64}},
        {MBM_MALFORMED_REPLY,
         {.kind = MBM_PACKET_RESPONSE,
          .function = 0x2B,
          .meiType = 0x0E,
          .readDeviceIdCode = 1,
          .objectCount = 1}},
        {MBM_INVALID_FUNCTION, {.kind = MBM_PACKET_RESPONSE, .function = 0x09}},
        {MBM_INVALID_FUNCTION,
         {.kind = MBM_PACKET_EXCEPTION, .function = 0x81, .exceptionCode = 1}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_EXCEPTION, .function = 0x01}},
        {MBM_MALFORMED_REPLY, {.kind = MBM_PACKET_EXCEPTION, .function = 1, .exceptionCode = 0x80}},
        {MBM_INVALID_ARGUMENT, {.kind = 3, .function = 0x03, .quantity = 1}},
        {MBM_INVALID_ARGUMENT, {.kind = 255, .function = 0x03, .quantity = 1}},
    };
    uint8_t built[700];
    uint16_t length = 0x5555;

    for (size_t i = 0; i < COUNT(refused); i++) {
        mbm_packet packet = refused[i].packet;

        packet.data = data;
        IS(refused[i].status, mbm_frame_build(PDU(NULL, 0), &packet, built, sizeof built, &length));
        IS(refused[i].status, mbm_frame_build(PDU(NULL, 0), &packet, built, MBM_MAX_PDU, &length));
        assert_int_equal(length, 0);
    }
}

TEST(the_first_bytes_of_a_pdu_determine_its_length)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;
    mbm_length expected;
    uint16_t length;

    for (size_t i = 0; i < example_count; i++) {
        uint8_t side = example_side(&examples[i]), kind = MBM_LENGTH_UNKNOWN;
        uint8_t id_goes_on = examples[i].packet.byteCount;

        length = example_load(&examples[i], pdu, &packet);
        for (uint16_t have = 0; have <= length; have++) {
            OK(mbm_frame_expectedLength(PDU(NULL, 0), side, pdu, have, &expected));
            kind = expected.kind;
            if (kind == MBM_LENGTH_EXACT)
                assert_int_equal(expected.bytes, id_goes_on ? id_goes_on + 2 : length);
            else if (kind == MBM_LENGTH_AT_LEAST)
                assert_in_range(expected.bytes, have + 1, length);
            else
                assert_int_equal(expected.bytes, 0);
        }
        if (packet.function == 0x41)
            assert_int_equal(kind, MBM_LENGTH_UNKNOWN);
        else if ((packet.function == 0x08 && packet.subFunction == 0) || packet.meiType == 0x0D)
            assert_int_equal(kind, MBM_LENGTH_SILENCE);
        else
            assert_int_equal(kind, MBM_LENGTH_EXACT);
    }
    OK(mbm_frame_expectedLength(PDU(NULL, 0), MBM_PACKET_RESPONSE, (const uint8_t *)"\x03\xFB", 2,
                                &expected));
    IS(MBM_MALFORMED_FRAME, mbm_frame_expectedLength(PDU(NULL, 0), MBM_PACKET_RESPONSE,
                                                     (const uint8_t *)"\x03\xFC", 2, &expected));
}

TEST(a_request_determines_the_length_of_its_response)
{
    uint8_t pdu[MBM_MAX_PDU], reply[MBM_MAX_PDU];
    mbm_packet request, response;
    mbm_length expected;

    for (size_t i = 0; i < example_count; i++) {
        uint16_t length;

        example_load(&examples[i], pdu, &request);
        if (request.kind != MBM_PACKET_REQUEST) {
            IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(PDU(NULL, 0), &request, &expected));
            continue;
        }
        length = example_load(&examples[i + 1], reply, &response);
        OK(mbm_frame_replyLength(PDU(NULL, 0), &request, &expected));
        if (request.function == 0x03)
            assert_int_equal(expected.bytes, 2 + 2 * request.quantity);
        if (expected.kind == MBM_LENGTH_EXACT) {
            assert_int_equal(expected.bytes, length);
        } else if (!strchr("\x0C\x11\x18\x2B\x41", request.function)) {
            fail_msg("function %02X: its request must determine the length of the response",
                     request.function);
        }
        if (expected.kind == MBM_LENGTH_AT_LEAST)
            assert_in_range(expected.bytes, 1, length);
    }
    request = (mbm_packet){.function = 0x03, .quantity = 126};
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_frame_replyLength(PDU(NULL, 0), &request, &expected));
    request = (mbm_packet){
        .function = 0x08, .subFunction = 4, .dataLength = 2, .data = (const uint8_t *)"\0"};
    OK(mbm_frame_replyLength(PDU(NULL, 0), &request, &expected));
    assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
    assert_int_equal(expected.bytes, 0);
}

TEST(a_declared_function_keeps_its_length)
{
    const mbm_function own[] = {
        {0x41, three_bytes, {MBM_RULE_COUNTED, 1, 2}},
        {0x55, {MBM_RULE_SILENCE, 0, 0}, three_bytes},
    };
    static const uint8_t request[] = {0x41, 1, 2}, response[] = {0x41, 1, 9, 8, 7};
    static const uint8_t beyond[] = {0x55, 1, 2};
    mbm_packet packet;
    mbm_length expected;
    uint8_t built[8];
    uint16_t length;

    OK(mbm_frame_parse(PDU(own, 2), MBM_PACKET_REQUEST, (uint8_t *)request, 3, &packet));
    OK(mbm_frame_build(PDU(own, 2), &packet, built, sizeof built, &length));
    assert_int_equal(length, 3);
    OK(mbm_frame_replyLength(PDU(own, 2), &packet, &expected));
    assert_int_equal(expected.kind, MBM_LENGTH_AT_LEAST);
    packet.dataLength = 1;
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_frame_build(PDU(own, 2), &packet, built, sizeof built, &length));
    IS(MBM_ILLEGAL_DATA_VALUE,
       mbm_frame_parse(PDU(own, 2), MBM_PACKET_REQUEST, (uint8_t *)request, 2, &packet));
    OK(mbm_frame_parse(PDU(own, 2), MBM_PACKET_RESPONSE, (uint8_t *)response, 5, &packet));
    IS(MBM_MALFORMED_REPLY,
       mbm_frame_parse(PDU(own, 2), MBM_PACKET_RESPONSE, (uint8_t *)response, 4, &packet));
    OK(mbm_frame_expectedLength(PDU(own, 2), MBM_PACKET_RESPONSE, response, 2, &expected));
    assert_int_equal(expected.bytes, 5);

    IS(MBM_ILLEGAL_FUNCTION,
       mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, (uint8_t *)beyond, 3, &packet));
    OK(mbm_frame_parse(PDU(own, 2), MBM_PACKET_REQUEST, (uint8_t *)beyond, 3, &packet));
    OK(mbm_frame_build(PDU(own, 2), &packet, built, sizeof built, &length));
    IS(MBM_ILLEGAL_FUNCTION, mbm_frame_build(PDU(own, 1), &packet, built, sizeof built, &length));
}

TEST(an_impossible_declaration_is_an_invalid_argument)
{
    static const mbm_function wrong[] = {
        {0, {0, 0, 0}, {0, 0, 0}},
        {0x80, {0, 0, 0}, {0, 0, 0}},
        {0x41, {3, 1, 0}, {0, 0, 0}},
        {0x41, {0, 0, 0}, {MBM_RULE_FIXED, 0, 0}},
        {0x41, {MBM_RULE_FIXED, 254, 0}, {0, 0, 0}},
        {0x41, {MBM_RULE_COUNTED, 0, 0}, {0, 0, 0}},
        {0x41, {MBM_RULE_COUNTED, 253, 0}, {0, 0, 0}},
    };
    static const uint8_t pdu[] = {0x41, 1, 2};
    mbm_packet packet;
    mbm_length expected;

    for (size_t i = 0; i < COUNT(wrong); i++) {
        IS(MBM_INVALID_ARGUMENT,
           mbm_frame_parse(PDU(&wrong[i], 1), MBM_PACKET_REQUEST, (uint8_t *)pdu, 3, &packet));
        IS(MBM_INVALID_ARGUMENT,
           mbm_frame_expectedLength(PDU(&wrong[i], 1), MBM_PACKET_REQUEST, pdu, 3, &expected));
    }
}

TEST(null_is_an_invalid_argument)
{
    uint8_t pdu[8] = {0x03, 0, 0, 0, 1};
    mbm_packet packet;
    mbm_length expected;
    uint16_t length;

    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, 5, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, NULL, 5, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(PDU(NULL, 1), MBM_PACKET_REQUEST, pdu, 5, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, 5, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_EXCEPTION, pdu, 5, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), NULL, pdu, 8, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 1), &packet, pdu, 8, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), &packet, NULL, 8, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), &packet, pdu, 8, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(PDU(NULL, 0), 3, pdu, 1, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(PDU(NULL, 0), 0, NULL, 1, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(PDU(NULL, 0), 0, pdu, 1, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(PDU(NULL, 0), NULL, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(PDU(NULL, 0), &packet, NULL));
    packet.function = 0x41;
    packet.dataLength = 1;
    packet.data = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), &packet, pdu, 8, &length));
}

TEST(data_inside_the_buffer_to_write_are_an_invalid_argument)
{
    uint8_t pdu[8] = {0x41, 1, 2};
    mbm_packet packet;
    uint16_t length;

    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, 3, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), &packet, pdu, 8, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(PDU(NULL, 0), &packet, pdu + 2, 6, &length));
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu + 3, 5, &length));
}

/* The records of functions 14 and 15 and the objects of a device identification: adding
 * them to a packet, and reading them one by one. */

TEST(a_request_of_14_is_made_of_records)
{
    const mbm_record records[] = {{NULL, 4, 1, 2}, {NULL, 3, 9, 2}};
    uint8_t storage[14], pdu[16], wanted[16];
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = MBM_FC_READ_FILE_RECORD};
    mbm_record record;
    uint16_t length, cursor = 0, i = 0;

    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[0]));
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[1]));
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    assert_int_equal(length, hex_bytes(wanted, "14 0E 06 0004 0001 0002 06 0003 0009 0002"));
    assert_memory_equal(pdu, wanted, length);

    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, length, &packet));
    for (; mbm_packet_nextRecord(&packet, &cursor, &record); i++) {
        assert_int_equal(record.file, records[i].file);
        assert_int_equal(record.record, records[i].record);
        assert_int_equal(record.length, records[i].length);
        assert_null(record.data);
    }
    assert_int_equal(i, 2);
}

/* Adds two records of two registers each, and reads them back. */
static void carries_data(uint8_t kind, uint8_t function, const char *hex, int is_named)
{
    const uint8_t first[] = {0x0D, 0xFE, 0x00, 0x20}, second[] = {0x33, 0xCD, 0x00, 0x40};
    const mbm_record records[] = {{first, 4, 1, 2}, {second, 3, 9, 2}};
    uint8_t storage[251], pdu[MBM_MAX_PDU], wanted[64];
    mbm_packet packet = {.kind = kind, .function = function};
    mbm_record record;
    uint16_t length, cursor = 0, i = 0;

    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[0]));
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[1]));
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    assert_int_equal(length, hex_bytes(wanted, hex));
    assert_memory_equal(pdu, wanted, length);
    OK(mbm_frame_parse(PDU(NULL, 0), kind, pdu, length, &packet));
    for (; mbm_packet_nextRecord(&packet, &cursor, &record); i++) {
        assert_int_equal(record.file, is_named ? records[i].file : 0);
        assert_int_equal(record.record, is_named ? records[i].record : 0);
        assert_int_equal(record.length, 2);
        assert_memory_equal(record.data, records[i].data, 4);
    }
    assert_int_equal(i, 2);
    assert_int_equal(cursor, packet.dataLength);
}

TEST(responses_of_14_and_both_packets_of_15_have_records_with_data)
{
    const char *written = "15 16 06 0004 0001 0002 0DFE0020 06 0003 0009 0002 33CD0040";

    carries_data(MBM_PACKET_RESPONSE, 0x14, "14 0C 05 06 0DFE 0020 05 06 33CD 0040", 0);
    carries_data(MBM_PACKET_REQUEST, 0x15, written, 1);
    carries_data(MBM_PACKET_RESPONSE, 0x15, written, 1);
}

TEST(an_impossible_record_is_not_added)
{
    static uint8_t data[500];
    static const struct {
        uint8_t status, kind, function;
        mbm_record record;
    } refused[] = {
        {MBM_ILLEGAL_DATA_ADDRESS, MBM_PACKET_REQUEST, 0x14, {NULL, 0, 1, 1}},
        {MBM_ILLEGAL_DATA_ADDRESS, MBM_PACKET_REQUEST, 0x14, {NULL, 1, 9999, 2}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x14, {NULL, 1, 1, 0}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x14, {NULL, 1, 1, 125}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x15, {data, 1, 1, 0}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x15, {data, 1, 1, 250}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x15, {data, 1, 1, 0x8000}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_RESPONSE, 0x14, {data, 0, 0, 0}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_RESPONSE, 0x14, {data, 0, 0, 127}},
        {MBM_ILLEGAL_FUNCTION, MBM_PACKET_REQUEST, 0x18, {data, 1, 1, 1}},
        {MBM_INVALID_ARGUMENT, MBM_PACKET_REQUEST, 0x15, {NULL, 1, 1, 1}},
        {MBM_INVALID_ARGUMENT, MBM_PACKET_EXCEPTION, 0x15, {data, 1, 1, 1}},
    };
    uint8_t storage[600];

    for (size_t i = 0; i < COUNT(refused); i++) {
        mbm_packet packet = {.kind = refused[i].kind, .function = refused[i].function};

        IS(refused[i].status,
           mbm_packet_addRecord(&packet, storage, sizeof storage, &refused[i].record));
        assert_int_equal(packet.dataLength, 0);
        assert_null(packet.data);
    }
}

TEST(groups_that_fill_the_storage_leave_the_packet_as_it_was)
{
    uint8_t storage[9], elsewhere[9];
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = MBM_FC_READ_FILE_RECORD};
    mbm_record record = {NULL, 4, 1, 2};

    IS(MBM_BUFFER_TOO_SMALL, mbm_packet_addRecord(&packet, storage, 6, &record));
    OK(mbm_packet_addRecord(&packet, storage, 7, &record));
    IS(MBM_BUFFER_TOO_SMALL, mbm_packet_addRecord(&packet, storage, 9, &record));
    assert_int_equal(packet.dataLength, 7);
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, elsewhere, 9, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, storage, 6, &record));
    packet.function = MBM_FC_WRITE_FILE_RECORD;
    packet.dataLength = 0;
    record.data = storage;
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, storage, 9, &record));
}

TEST(a_device_identification_is_made_of_objects)
{
    const mbm_object objects[] = {
        {(const uint8_t *)"mbm", 3, 0}, {NULL, 0, 1}, {(const uint8_t *)"V2.11", 5, 2}};
    uint8_t storage[14], pdu[21], wanted[21];
    mbm_packet packet = {.kind = MBM_PACKET_RESPONSE,
                         .function = MBM_FC_ENCAPSULATED_INTERFACE_TRANSPORT,
                         .meiType = MBM_MEI_READ_DEVICE_IDENTIFICATION,
                         .readDeviceIdCode = MBM_DEVICE_ID_BASIC,
                         .conformity = 1};
    mbm_object object;
    uint16_t length, cursor = 0, i;

    for (i = 0; i < 3; i++)
        OK(mbm_packet_addObject(&packet, storage, sizeof storage, &objects[i]));
    IS(MBM_BUFFER_TOO_SMALL, mbm_packet_addObject(&packet, storage, sizeof storage, &objects[1]));
    assert_int_equal(packet.objectCount, 3);
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    assert_int_equal(length,
                     hex_bytes(wanted, "2B 0E 01 01 00 00 03 00 03 6D626D 01 00 02 05 56322E3131"));
    assert_memory_equal(pdu, wanted, length);

    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_RESPONSE, pdu, length, &packet));
    for (i = 0; mbm_packet_nextObject(&packet, &cursor, &object); i++) {
        assert_int_equal(object.id, i);
        assert_int_equal(object.length, objects[i].length);
        if (object.length)
            assert_memory_equal(object.data, objects[i].data, object.length);
    }
    assert_int_equal(i, 3);
    packet.objectCount = 2;
    IS(MBM_MALFORMED_REPLY, mbm_frame_build(PDU(NULL, 0), &packet, wanted, sizeof wanted, &length));
    packet.meiType = MBM_MEI_CANOPEN;
    IS(MBM_ILLEGAL_FUNCTION, mbm_packet_addObject(&packet, pdu + 7, 14, &objects[0]));
}

TEST(other_packets_have_neither_records_nor_objects)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;
    mbm_record record;
    mbm_object object;

    for (size_t i = 0; i < example_count; i++) {
        uint16_t cursor = 0, other = 0;

        example_load(&examples[i], pdu, &packet);
        if (packet.function != 0x14 && packet.function != 0x15)
            assert_false(mbm_packet_nextRecord(&packet, &cursor, &record));
        if (!packet.objectCount)
            assert_false(mbm_packet_nextObject(&packet, &other, &object));
    }
}

TEST(null_returns_nothing_and_adds_nothing)
{
    uint8_t pdu[MBM_MAX_PDU], storage[16];
    mbm_packet packet;
    mbm_record record = {NULL, 1, 1, 1};
    mbm_object object = {NULL, 0, 0};
    uint16_t cursor = 0, length;

    length = hex_bytes(pdu, "14 07 06 0004 0001 0002");
    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, length, &packet));
    assert_false(mbm_packet_nextRecord(&packet, NULL, &record));
    assert_false(mbm_packet_nextRecord(&packet, &cursor, NULL));
    cursor = 0xFFFF;
    assert_false(mbm_packet_nextRecord(&packet, &cursor, &record));
    packet.dataLength = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, NULL, 16, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, storage, 16, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addObject(&packet, storage, 16, NULL));
    object.length = 1;
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addObject(&packet, storage, 16, &object));
}
