/* Each function for frames and packets is held to its comment in mbm.h: results, limits, NULL.
 * test_promises_values has their texts. */
#include "mbm.h"
#include "refused.h"
#include "crc.h"
#include "test.h"

static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};
static const mbm_framing ascii = {.kind = MBM_FRAMING_ASCII};
static const mbm_framing tcp = {.kind = MBM_FRAMING_TCP};

static const mbm_framing *const framings[] = {&rtu, &ascii, &tcp};
static const uint16_t longest[] = {MBM_MAX_FRAME, MBM_MAX_ASCII_FRAME, MBM_MAX_TCP_FRAME};

static mbm_packet read_of(uint16_t quantity)
{
    return (mbm_packet){.kind = MBM_PACKET_REQUEST,
                        .function = MBM_FC_READ_HOLDING_REGISTERS,
                        .unit = 17,
                        .transaction = 0x1234,
                        .address = 107,
                        .quantity = quantity};
}

/* What a refused call leaves in the caller's variables: a length of 0, no expected length. */
static mbm_length expected;
static uint16_t length;
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

TEST(the_longest_frames_fit_into_the_buffers_that_are_named)
{
    uint8_t data[MBM_MAX_PDU] = {0}, frame[MBM_MAX_ASCII_FRAME];

    for (unsigned i = 0; i < COUNT(framings); i++) {
        /* 08, return query data, may have any number of data bytes. */
        mbm_packet packet = {
            .function = MBM_FC_DIAGNOSTICS, .unit = 1, .data = data, .dataLength = MBM_MAX_PDU - 3};

        OK(mbm_frame_build(framings[i], &packet, frame, longest[i], &length));
        assert_int_equal(length, longest[i]);
        NO_LENGTH(MBM_BUFFER_TOO_SMALL,
                  mbm_frame_build(framings[i], &packet, frame, longest[i] - 1, &length));
        packet.dataLength++;
        assert_int_not_equal(mbm_frame_build(framings[i], &packet, frame, sizeof frame, &length),
                             MBM_OK);
        assert_int_equal(length, 0);
    }
}

TEST(a_frame_is_never_built_malformed)
{
    static const struct {
        uint16_t address, quantity;
        uint8_t status;
    } rows[] = {{0, 1, MBM_OK},
                {0, 125, MBM_OK},
                {0, 0, MBM_ILLEGAL_DATA_VALUE},
                {0, 126, MBM_ILLEGAL_DATA_VALUE},
                {65535, 1, MBM_OK},
                {65535, 2, MBM_ILLEGAL_DATA_ADDRESS},
                {65411, 125, MBM_OK},
                {65412, 125, MBM_ILLEGAL_DATA_ADDRESS}};
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    mbm_packet packet = read_of(0);

    for (unsigned f = 0; f < COUNT(framings); f++) {
        for (unsigned i = 0; i < COUNT(rows); i++) {
            packet.address = rows[i].address;
            packet.quantity = rows[i].quantity;
            IS(rows[i].status, mbm_frame_build(framings[f], &packet, frame, sizeof frame, &length));
            assert_int_equal(length == 0, rows[i].status != MBM_OK);
            IS(rows[i].status, mbm_frame_replyLength(framings[f], &packet, &expected));
            if (rows[i].status == MBM_OK) {
                mbm_packet parsed;

                OK(mbm_frame_parse(framings[f], MBM_PACKET_REQUEST, frame, length, &parsed));
                assert_int_equal(parsed.quantity, rows[i].quantity);
            } else {
                assert_int_equal(expected.kind, MBM_LENGTH_UNKNOWN);
                assert_int_equal(expected.bytes, 0);
            }
        }
    }
}

static const mbm_framing none = {.kind = 9}, alone = {.kind = MBM_FRAMING_NONE};

TEST(invalid_arguments_leave_no_length_and_change_nothing)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME] = {17, 3, 0, 107, 0, 3, 0x76, 0x87};
    mbm_packet packet = read_of(7), response = {.kind = MBM_PACKET_RESPONSE, .function = 3};
    char text[80];

#define NO_LENGTH_OF(call) NO_LENGTH(MBM_INVALID_ARGUMENT, mbm_frame_##call)
#define UNKNOWN_BY(call) UNKNOWN(MBM_INVALID_ARGUMENT, mbm_frame_##call)
#define REFUSES(call) INVALID(packet, mbm_frame_##call)
    NO_LENGTH_OF(build(NULL, &packet, frame, 99, &length));
    NO_LENGTH_OF(build(&none, &packet, frame, 99, &length));
    NO_LENGTH_OF(build(&rtu, NULL, frame, 99, &length));
    NO_LENGTH_OF(build(&alone, NULL, frame, 99, &length));
    NO_LENGTH_OF(build(&rtu, &packet, NULL, 99, &length));
    REFUSES(build(&rtu, &packet, frame + 20, 99, NULL));
    REFUSES(parse(NULL, 0, frame, 8, &packet));
    REFUSES(parse(&none, 0, frame, 8, &packet));
    REFUSES(parse(&rtu, 2, frame, 8, &packet));
    REFUSES(parse(&alone, 2, frame, 8, &packet));
    REFUSES(parse(&rtu, 0, NULL, 8, &packet));
    REFUSES(parse(&alone, 0, NULL, 8, &packet));
    REFUSES(parse(&rtu, 0, frame, 8, NULL));
    NO_LENGTH_OF(exception(NULL, &packet, 1, frame, 11, &length));
    NO_LENGTH_OF(exception(&alone, &packet, 1, frame, 11, &length));
    NO_LENGTH_OF(exception(&rtu, NULL, 1, frame, 11, &length));
    NO_LENGTH_OF(exception(&rtu, &packet, 0, frame, 11, &length));
    NO_LENGTH_OF(exception(&rtu, &packet, 1, NULL, 11, &length));
    REFUSES(exception(&rtu, &packet, 1, frame, 11, NULL));
    UNKNOWN_BY(expectedLength(NULL, 0, frame, 2, &expected));
    UNKNOWN_BY(expectedLength(&rtu, 2, frame, 2, &expected));
    UNKNOWN_BY(expectedLength(&rtu, 9, frame, 2, &expected));
    UNKNOWN_BY(expectedLength(&rtu, 0, NULL, 2, &expected));
    UNKNOWN_BY(expectedLength(&alone, 0, NULL, 2, &expected));
    REFUSES(expectedLength(&rtu, 0, frame, 2, NULL));
    UNKNOWN_BY(replyLength(NULL, &packet, &expected));
    UNKNOWN_BY(replyLength(&rtu, NULL, &expected));
    UNKNOWN_BY(replyLength(&rtu, &response, &expected));
    REFUSES(replyLength(&rtu, &packet, NULL));
    REFUSES(replyLength(&alone, &packet, NULL));
    NO_LENGTH_OF(looksLikeTcp(NULL, 8, 0, &length));
    REFUSES(looksLikeTcp(frame, 8, 0, NULL));
    REFUSES(text(NULL, 0, frame, 8, text, sizeof text));
    REFUSES(text(&alone, 0, frame, 8, text, sizeof text));
    REFUSES(text(&rtu, 2, frame, 8, text, sizeof text));
    REFUSES(text(&rtu, 0, NULL, 8, text, sizeof text));
    REFUSES(text(&rtu, 0, frame, 8, NULL, sizeof text));
    IS(MBM_INVALID_ARGUMENT, mbm_event_text(NULL, text, sizeof text));
}

TEST(a_refused_call_sets_its_length_to_0)
{
    mbm_packet packet = read_of(1);
    uint8_t frame[16];

    NO_LENGTH(MBM_BUFFER_TOO_SMALL, mbm_frame_build(&rtu, &packet, frame, 7, &length));
    NO_LENGTH(MBM_BUFFER_TOO_SMALL, mbm_frame_build(&alone, &packet, frame, 4, &length));
    NO_LENGTH(MBM_BUFFER_TOO_SMALL, mbm_frame_exception(&rtu, &packet, 1, frame, 4, &length));
    NO_LENGTH(MBM_INCOMPLETE_FRAME,
              mbm_frame_looksLikeTcp((const uint8_t *)"\0\1\0\0", 4, 0, &length));
    packet.quantity = 0;
    UNKNOWN(MBM_ILLEGAL_DATA_VALUE, mbm_frame_replyLength(&alone, &packet, &expected));
    UNKNOWN(MBM_ILLEGAL_DATA_VALUE, mbm_frame_replyLength(&rtu, &packet, &expected));
}

TEST(an_exception_has_the_length_and_the_codes_that_are_named)
{
    static const uint16_t lengths[] = {5, 11, 9};
    mbm_packet request = read_of(3), parsed;
    uint8_t frame[11];

    for (unsigned f = 0; f < COUNT(framings); f++) {
        for (unsigned code = 0; code < 256; code++) {
            uint8_t status =
                mbm_frame_exception(framings[f], &request, (uint8_t)code, frame, 11, &length);

            IS(code >= 1 && code <= 127 ? MBM_OK : MBM_INVALID_ARGUMENT, status);
            assert_int_equal(length, status == MBM_OK ? lengths[f] : 0);
            if (status != MBM_OK)
                continue;
            OK(mbm_frame_expectedLength(framings[f], MBM_PACKET_RESPONSE, frame, length,
                                        &expected));
            assert_true(framings[f] == &ascii || expected.bytes == length);
            OK(mbm_frame_parse(framings[f], MBM_PACKET_RESPONSE, frame, length, &parsed));
            assert_int_equal(parsed.kind, MBM_PACKET_EXCEPTION);
            assert_int_equal(parsed.exceptionCode, code);
            assert_int_equal(parsed.function, request.function);
        }
        NO_LENGTH(MBM_BUFFER_TOO_SMALL,
                  mbm_frame_exception(framings[f], &request, 2, frame, lengths[f] - 1, &length));
        request.function = 0x80;
        IS(MBM_ILLEGAL_FUNCTION, mbm_frame_exception(framings[f], &request, 2, frame, 11, &length));
        request = read_of(3);
        request.unit = 0;
        IS(framings[f] == &tcp ? MBM_OK : MBM_BROADCAST_NOT_ALLOWED,
           mbm_frame_exception(framings[f], &request, 2, frame, 11, &length));
        OK(mbm_frame_replyLength(framings[f], &request, &expected));
        assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
        assert_int_equal(expected.bytes == 0, framings[f] != &tcp);
        request.unit = 17;
    }
}

TEST(a_listen_only_request_has_no_reply)
{
    static const uint8_t zero[2];
    mbm_packet request = {.function = MBM_FC_DIAGNOSTICS,
                          .unit = 17,
                          .subFunction = MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY,
                          .data = zero,
                          .dataLength = 2};

    for (unsigned f = 0; f < COUNT(framings); f++) {
        OK(mbm_frame_replyLength(framings[f], &request, &expected));
        assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
        assert_int_equal(expected.bytes, 0);
    }
}

TEST(a_frame_that_does_not_hold_fills_in_what_is_known)
{
    /* Quantity 0 in a right frame, then a wrong CRC. */
    uint8_t frame[8] = {17, 3, 0, 107, 0, 0};
    mbm_packet packet;

    seal(frame, 6);
    memset(&packet, 0x77, sizeof packet);
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_frame_parse(&rtu, MBM_PACKET_REQUEST, frame, 8, &packet));
    assert_int_equal(packet.kind, MBM_PACKET_REQUEST);
    assert_int_equal(packet.unit, 17);
    assert_int_equal(packet.function, 3);
    assert_int_equal(packet.address, 0);
    frame[7] ^= 1;
    memset(&packet, 0x77, sizeof packet);
    IS(MBM_INVALID_CRC, mbm_frame_parse(&rtu, MBM_PACKET_REQUEST, frame, 8, &packet));
    assert_int_equal(packet.unit, 0);
    assert_int_equal(packet.function, 0);
    frame[1] = 0x63;
    seal(frame, 6);
    IS(MBM_INVALID_FUNCTION, mbm_frame_parse(&rtu, MBM_PACKET_RESPONSE, frame, 8, &packet));
    IS(MBM_INCOMPLETE_FRAME, mbm_frame_parse(&rtu, MBM_PACKET_REQUEST, frame, 0, &packet));
    IS(MBM_ILLEGAL_FUNCTION, mbm_frame_parse(&rtu, MBM_PACKET_REQUEST, frame, 8, &packet));
}

TEST(a_frame_is_parsed_whatever_its_crc_is)
{
    static const uint8_t wanted[] = {17, 3, 0, 107, 0, 3};
    uint8_t bytes[MBM_MAX_FRAME + 1];
    uint8_t text[] = ":1103006B00037F\r\n";
    mbm_packet packet;

    memset(bytes, 0x5A, sizeof bytes);
    memcpy(bytes, wanted, sizeof wanted);
    IS(MBM_INVALID_CRC, mbm_frame_parse(&rtu, MBM_PACKET_REQUEST, bytes, 8, &packet));
    OK(mbm_frame_parseWithoutCrc(&rtu, MBM_PACKET_REQUEST, bytes, 8, &packet));
    assert_true(packet.unit == 17 && packet.address == 107 && packet.quantity == 3);
    /* Everything else is checked as by mbm_frame_parse. */
    IS(MBM_MALFORMED_REPLY,
       mbm_frame_parseWithoutCrc(&rtu, MBM_PACKET_RESPONSE, bytes, 8, &packet));
    IS(MBM_ILLEGAL_DATA_VALUE,
       mbm_frame_parseWithoutCrc(&rtu, MBM_PACKET_REQUEST, bytes, 9, &packet));
    for (uint16_t have = 0; have < 4; have++)
        IS(MBM_INCOMPLETE_FRAME,
           mbm_frame_parseWithoutCrc(&rtu, MBM_PACKET_REQUEST, bytes, have, &packet));
    IS(MBM_MALFORMED_FRAME,
       mbm_frame_parseWithoutCrc(&rtu, MBM_PACKET_REQUEST, bytes, sizeof bytes, &packet));
    INVALID(packet, mbm_frame_parseWithoutCrc(NULL, 0, bytes, 8, &packet));
    INVALID(packet, mbm_frame_parseWithoutCrc(&rtu, 2, bytes, 8, &packet));
    INVALID(packet, mbm_frame_parseWithoutCrc(&rtu, 0, NULL, 8, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parseWithoutCrc(&rtu, 0, bytes, 8, NULL));
    /* The LRC of ASCII is checked: it should be 7E. */
    IS(MBM_INVALID_CRC, mbm_frame_parseWithoutCrc(&ascii, MBM_PACKET_REQUEST, text,
                                                  (uint16_t)(sizeof text - 1), &packet));
}

TEST(an_exception_is_taken_out_of_its_frame)
{
    uint8_t of_rtu[] = {0x0A, 0x81, 2, 0xB0, 0x53};
    uint8_t of_tcp[] = {0xDA, 0x87, 0, 0, 0, 3, 1, 0x81, 3};
    uint8_t response[] = {17, 3, 2, 0, 7, 0, 0};
    mbm_packet packet, parsed;

    OK(mbm_frame_asException(&rtu, of_rtu, sizeof of_rtu, &packet));
    assert_int_equal(packet.kind, MBM_PACKET_EXCEPTION);
    assert_true(packet.unit == 10 && packet.function == 1 && packet.exceptionCode == 2);
    OK(mbm_frame_parse(&rtu, MBM_PACKET_RESPONSE, of_rtu, sizeof of_rtu, &parsed));
    assert_memory_equal(&packet, &parsed, sizeof packet);
    OK(mbm_frame_asException(&tcp, of_tcp, sizeof of_tcp, &packet));
    assert_true(packet.transaction == 0xDA87 && packet.exceptionCode == 3);
    of_rtu[3] ^= 1;
    REFUSED(MBM_INVALID_CRC, packet, mbm_frame_asException(&rtu, of_rtu, 5, &packet));
    REFUSED(MBM_INCOMPLETE_FRAME, packet, mbm_frame_asException(&rtu, of_rtu, 3, &packet));
    of_tcp[8] = 0;
    REFUSED(MBM_MALFORMED_REPLY, packet, mbm_frame_asException(&tcp, of_tcp, 9, &packet));
    of_tcp[8] = 128;
    REFUSED(MBM_MALFORMED_REPLY, packet, mbm_frame_asException(&tcp, of_tcp, 9, &packet));
    seal(response, 5);
    REFUSED(MBM_INVALID_FUNCTION, packet, mbm_frame_asException(&rtu, response, 7, &packet));
    INVALID(packet, mbm_frame_asException(NULL, of_tcp, 9, &packet));
    INVALID(packet, mbm_frame_asException(&tcp, NULL, 9, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_asException(&tcp, of_tcp, 9, NULL));
    INVALID(packet, mbm_frame_asException(&alone, of_tcp, 9, &packet));
}

TEST(bytes_look_like_tcp_from_the_eighth_on)
{
    uint8_t bytes[12] = {0x12, 0x34, 0, 0, 0, 6, 17, 3, 0, 107, 0, 3};

    for (uint16_t have = 0; have < 8; have++)
        NO_LENGTH(MBM_INCOMPLETE_FRAME, mbm_frame_looksLikeTcp(bytes, have, 0, &length));
    OK(mbm_frame_looksLikeTcp(bytes, 8, 0, &length));
    assert_int_equal(length, 12);
    bytes[7] = 0x63; /* reserved by the standard */
    NO_LENGTH(MBM_MALFORMED_FRAME, mbm_frame_looksLikeTcp(bytes, 8, 0, &length));
    OK(mbm_frame_looksLikeTcp(bytes, 8, 1, &length));
    bytes[7] = 0;
    IS(MBM_MALFORMED_FRAME, mbm_frame_looksLikeTcp(bytes, 8, 1, &length));
    bytes[7] = 3;
    bytes[2] = 1; /* the protocol identifier */
    IS(MBM_MALFORMED_FRAME, mbm_frame_looksLikeTcp(bytes, 12, 0, &length));
}

TEST(the_first_bytes_may_be_none)
{

    for (unsigned f = 0; f < COUNT(framings); f++) {
        OK(mbm_frame_expectedLength(framings[f], MBM_PACKET_REQUEST, NULL, 0, &expected));
        assert_int_equal(expected.kind, MBM_LENGTH_AT_LEAST);
    }
    NO_LENGTH(MBM_INCOMPLETE_FRAME, mbm_frame_looksLikeTcp(NULL, 0, 0, &length));
}

TEST(checksums_are_those_of_the_guide)
{
    const uint8_t bytes[] = {2, 7};

    assert_int_equal(mbm_frame_crc16(NULL, 9), 0xFFFF);
    assert_int_equal(mbm_frame_crc16(bytes, 0), 0xFFFF);
    /* Serial line guide V1.02, 6.2.2: the frame ends with 41 12. */
    assert_int_equal(mbm_frame_crc16(bytes, 2), 0x1241);
    assert_int_equal(mbm_frame_crc16((const uint8_t *)"123456789", 9), 0x4B37);
    assert_int_equal(mbm_frame_lrc(NULL, 9), 0);
    assert_int_equal(mbm_frame_lrc(bytes, 0), 0);
    assert_int_equal(mbm_frame_lrc(bytes, 2), 0xF7);
}

/* --- mbm_packet_* --- */

TEST(packets_without_records_or_objects_have_none)
{
    mbm_packet packet = read_of(3), read_file = {.function = MBM_FC_READ_FILE_RECORD,
                                                 .data = (const uint8_t *)"\6\0\1\0\0\0\1",
                                                 .dataLength = 7};
    uint8_t storage[8];
    uint16_t cursor = 5;
    mbm_record record;
    mbm_object object;

    memset(&record, 0x77, sizeof record);
    memset(&object, 0x77, sizeof object);
#define NONE(unchanged, next, ...) REFUSED(0, unchanged, next(__VA_ARGS__))
    NONE(record, mbm_packet_nextRecord, &packet, &cursor, &record);
    NONE(object, mbm_packet_nextObject, &packet, &cursor, &object);
    NONE(record, mbm_packet_nextRecord, NULL, &cursor, &record);
    NONE(object, mbm_packet_nextObject, NULL, &cursor, &object);
    NONE(record, mbm_packet_nextRecord, &packet, NULL, &record);
    NONE(object, mbm_packet_nextObject, &packet, NULL, &object);
    NONE(cursor, mbm_packet_nextRecord, &packet, &cursor, NULL);
    NONE(cursor, mbm_packet_nextObject, &packet, &cursor, NULL);
    assert_int_equal(cursor, 5);
    cursor = 0;
    NONE(cursor, mbm_packet_nextRecord, &read_file, &cursor, NULL);
    REFUSED(1, read_file, mbm_packet_nextRecord(&read_file, &cursor, &record));
    INVALID(read_file, mbm_packet_addRecord(&read_file, NULL, 8, &record));
    INVALID(read_file, mbm_packet_addObject(&read_file, storage, 8, &object));
}

/* Asserts that `packet` does not take what is added, also with another value of a field. */
#define ADDS(status, what, storage, bytes, added)                                                  \
    REFUSED(status, packet, mbm_packet_add##what(&packet, storage, bytes, added))
#define ADDS_WITH(field, value, status, what)                                                      \
    WITH(field, value, ADDS(status, what, storage, sizeof storage, &added))

TEST(records_are_added_within_their_limits)
{
    static const uint8_t words[300];
    uint8_t storage[251];
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = MBM_FC_WRITE_FILE_RECORD};
    mbm_record added = {.data = words, .file = 1, .record = 9999, .length = 1};

    ADDS(MBM_INVALID_ARGUMENT, Record, NULL, 251, &added);
    ADDS(MBM_INVALID_ARGUMENT, Record, storage, 251, NULL);
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(NULL, storage, 251, &added));
    ADDS_WITH(packet.function, MBM_FC_READ_COILS, MBM_ILLEGAL_FUNCTION, Record);
    ADDS_WITH(packet.kind, MBM_PACKET_EXCEPTION, MBM_INVALID_ARGUMENT, Record);
    ADDS_WITH(added.file, 0, MBM_ILLEGAL_DATA_ADDRESS, Record);
    ADDS_WITH(added.record, 10000, MBM_ILLEGAL_DATA_ADDRESS, Record);
    ADDS_WITH(added.data, storage + 10, MBM_INVALID_ARGUMENT, Record);
    ADDS(MBM_BUFFER_TOO_SMALL, Record, storage, 8, &added);
    OK(mbm_packet_addRecord(&packet, storage, 9, &added));
    assert_int_equal(packet.dataLength, 9);
    assert_ptr_equal(packet.data, storage);
    ADDS_WITH(packet.data, words, MBM_INVALID_ARGUMENT, Record);
    /* As many as fit into a frame: 27 of one register, and 251 bytes are enough. */
    while (mbm_packet_addRecord(&packet, storage, sizeof storage, &added) == MBM_OK)
        assert_in_range(packet.dataLength, 18, 251);
    assert_int_equal(packet.dataLength, 27 * 9);
}

TEST(objects_are_added_within_their_limits)
{
    static const uint8_t value[] = "value";
    uint8_t storage[246];
    mbm_packet packet = {.kind = MBM_PACKET_RESPONSE,
                         .function = MBM_FC_ENCAPSULATED_INTERFACE_TRANSPORT,
                         .meiType = MBM_MEI_READ_DEVICE_IDENTIFICATION};
    mbm_object added = {.data = value, .length = 5, .id = 0x80};

    ADDS(MBM_INVALID_ARGUMENT, Object, NULL, 246, &added);
    ADDS(MBM_INVALID_ARGUMENT, Object, storage, 246, NULL);
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addObject(NULL, storage, 246, &added));
    ADDS_WITH(packet.meiType, MBM_MEI_CANOPEN, MBM_ILLEGAL_FUNCTION, Object);
    ADDS_WITH(packet.kind, MBM_PACKET_REQUEST, MBM_ILLEGAL_FUNCTION, Object);
    ADDS_WITH(added.data, storage, MBM_INVALID_ARGUMENT, Object);
    ADDS(MBM_BUFFER_TOO_SMALL, Object, storage, 6, &added);
    OK(mbm_packet_addObject(&packet, storage, 7, &added));
    assert_int_equal(packet.dataLength, 7);
    assert_int_equal(packet.objectCount, 1);
    ADDS_WITH(packet.data, value, MBM_INVALID_ARGUMENT, Object);
    while (mbm_packet_addObject(&packet, storage, sizeof storage, &added) == MBM_OK)
        assert_in_range(packet.dataLength, 14, 246);
    assert_int_equal(packet.objectCount, 35);
    ADDS(MBM_BUFFER_TOO_SMALL, Object, storage, sizeof storage, &added);
}
