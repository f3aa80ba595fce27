/* mbm_frame_*: every function in all framings, lengths, exceptions, checksums. */
#include "crc.h"
#include "examples.h"
#include "test.h"

static const mbm_framing framings[] = {
    {.kind = MBM_FRAMING_RTU},
    {.kind = MBM_FRAMING_ASCII},
    {.kind = MBM_FRAMING_TCP},
    {.kind = MBM_FRAMING_RTU_OVER_TCP},
};
static const mbm_framing *const rtu = &framings[0], *const ascii = &framings[1],
                                *const tcp = &framings[2];

/* Builds a frame around a PDU without mbm. */
static uint16_t wrap(const mbm_framing *f, const mbm_packet *p, const uint8_t *pdu, uint16_t length,
                     uint8_t *frame)
{
    static const char digits[] = "0123456789ABCDEF";
    const uint8_t unit = (uint8_t)p->unit;
    uint8_t sum = unit;
    uint16_t i;

    if (f->kind == MBM_FRAMING_TCP) {
        const uint8_t header[] = {(uint8_t)(p->transaction >> 8),
                                  (uint8_t)p->transaction,
                                  0,
                                  0,
                                  0,
                                  (uint8_t)(length + 1),
                                  unit};

        memcpy(frame, header, 7);
        memcpy(frame + 7, pdu, length);
        return (uint16_t)(length + 7);
    }
    frame[0] = unit;
    memcpy(frame + 1, pdu, length);
    if (f->kind != MBM_FRAMING_ASCII)
        return (uint16_t)seal(frame, length + 1u);
    frame[0] = ':';
    for (i = 0; i < length; i++)
        sum = (uint8_t)(sum + pdu[i]);
    sum = (uint8_t)-sum;
    for (i = 0; i < length + 2u; i++) {
        uint8_t byte = i == 0 ? unit : i == length + 1u ? sum : pdu[i - 1];

        frame[1 + 2 * i] = (uint8_t)digits[byte >> 4];
        frame[2 + 2 * i] = (uint8_t)digits[byte & 15];
    }
    frame[1 + 2 * i] = '\r';
    frame[2 + 2 * i] = '\n';
    return (uint16_t)(2 * i + 3);
}

/* Writes example `i` as a frame of one framing, and its packet. */
static uint16_t framed(size_t i, const mbm_framing *f, uint8_t *pdu, mbm_packet *packet,
                       uint8_t *frame)
{
    uint16_t length = example_load(&examples[i], pdu, packet);

    packet->unit = 0x11;
    packet->transaction = f->kind == MBM_FRAMING_TCP ? 0x8180 : 0;
    return wrap(f, packet, pdu, length, frame);
}

TEST(every_function_is_built_and_parsed_in_every_framing)
{
    uint8_t pdu[MBM_MAX_PDU], wanted[MBM_MAX_ASCII_FRAME], built[MBM_MAX_ASCII_FRAME];
    mbm_packet packet, found;
    uint16_t length, size;

    for (size_t f = 0; f < COUNT(framings); f++) {
        for (size_t i = 0; i < example_count; i++) {
            length = framed(i, &framings[f], pdu, &packet, wanted);
            memset(built, 0xEE, sizeof built);
            OK(mbm_frame_build(&framings[f], &packet, built, length, &size));
            assert_int_equal(size, length);
            assert_memory_equal(built, wanted, length);
            assert_int_equal(built[length], 0xEE);
            IS(MBM_BUFFER_TOO_SMALL,
               mbm_frame_build(&framings[f], &packet, wanted, (uint16_t)(length - 1), &size));
            OK(mbm_frame_parse(&framings[f], example_side(&examples[i]), built, length, &found));
            assert_same_packet(&found, &packet);
        }
    }
}

TEST(frames_of_other_implementations_are_parsed_and_built)
{
    static const struct {
        uint8_t framing, kind;
        const char *hex;
    } frames[] = {
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "10 01 006B 0003 0E96"},
        {MBM_FRAMING_TCP, MBM_PACKET_REQUEST, "8180 0000 0006 10 01 006B 0003"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "03 01 02 CD6B D543"},
        {MBM_FRAMING_TCP, MBM_PACKET_RESPONSE, "8180 0000 0005 03 01 02 CD6B"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "10 02 006B 0003 4A96"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "03 02 02 CD6B D507"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "01 03 006B 0001 F5D6"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "01 03 02 CD6B AD3B"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "01 04 006B 0001 4016"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "01 04 02 CD6B AC4F"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "11 05 006B FF00 FF76"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "03 05 0002 FF00 2C18"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "11 06 006B 0101 3AD6"},
        {MBM_FRAMING_TCP, MBM_PACKET_RESPONSE, "8180 0000 0006 03 06 0002 FF00"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "11 0F 0410 0003 01 05 8E1F"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "11 0F 0410 0003 17AF"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "11 10 0410 0003 06 00C8 0082 8701 2F7D"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "11 10 0410 0003 826D"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "10 11 CC7C"},
        {MBM_FRAMING_TCP, MBM_PACKET_REQUEST, "8180 0000 0002 10 11"},
        {MBM_FRAMING_TCP, MBM_PACKET_RESPONSE, "8180 0000 0008 10 11 02 0102 00 0102"},
        {MBM_FRAMING_RTU, MBM_PACKET_REQUEST, "11 17 0410 0001 0112 0002 04 00C8 0082 64E2"},
        {MBM_FRAMING_TCP, MBM_PACKET_REQUEST,
         "0138 0000 000F 11 17 0410 0001 0112 0002 04 00C8 0082"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "11 17 02 CD6B 6908"},
        {MBM_FRAMING_RTU, MBM_PACKET_RESPONSE, "0A 81 02 B053"},
        {MBM_FRAMING_TCP, MBM_PACKET_RESPONSE, "DA87 0000 0003 01 81 03"},
    };
    uint8_t frame[64], built[64];
    mbm_packet packet;
    uint16_t length, size;

    for (size_t i = 0; i < COUNT(frames); i++) {
        const mbm_framing *f = &framings[frames[i].framing];

        length = hex_bytes(frame, frames[i].hex);
        OK(mbm_frame_parse(f, frames[i].kind, frame, length, &packet));
        OK(mbm_frame_build(f, &packet, built, sizeof built, &size));
        assert_int_equal(size, length);
        assert_memory_equal(built, frame, length);
    }
}

TEST(the_first_bytes_of_a_frame_determine_its_length)
{
    uint8_t pdu[MBM_MAX_PDU], frame[MBM_MAX_ASCII_FRAME];
    mbm_packet packet;
    mbm_length expected;
    uint16_t length;

    for (size_t f = 0; f < COUNT(framings); f++) {
        for (size_t i = 0; i < example_count; i++) {
            uint8_t side = example_side(&examples[i]), last = MBM_LENGTH_UNKNOWN;

            length = framed(i, &framings[f], pdu, &packet, frame);
            for (uint16_t have = 0; have <= length; have++) {
                OK(mbm_frame_expectedLength(&framings[f], side, frame, have, &expected));
                last = expected.kind;
                if (last == MBM_LENGTH_EXACT)
                    assert_int_equal(expected.bytes, length);
                else if (last == MBM_LENGTH_AT_LEAST)
                    assert_in_range(expected.bytes, have + 1, length);
                else
                    assert_int_equal(expected.bytes, 0);
            }
            /* A TCP frame has a length field, an ASCII frame an end character. */
            if (&framings[f] == tcp || &framings[f] == ascii)
                assert_int_equal(last, MBM_LENGTH_EXACT);
        }
    }
}

TEST(a_request_determines_the_length_of_its_reply_frame)
{
    static const uint16_t lengths[] = {11, 23, 15, 11};
    mbm_packet packet = {.unit = 1, .function = 0x03, .quantity = 3};
    mbm_length expected;

    for (size_t f = 0; f < COUNT(framings); f++) {
        OK(mbm_frame_replyLength(&framings[f], &packet, &expected));
        assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
        assert_int_equal(expected.bytes, lengths[f]);
    }
    packet = (mbm_packet){.unit = 0, .function = 0x06};
    OK(mbm_frame_replyLength(rtu, &packet, &expected));
    assert_int_equal(expected.bytes, 0);
    assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
    OK(mbm_frame_replyLength(tcp, &packet, &expected));
    assert_int_equal(expected.bytes, 12);
}

/* True for a function that has an example, and for a user-defined one. */
static int has_example(uint8_t function)
{
    for (size_t i = 0; i < example_count; i++)
        if (examples[i].packet.function == function)
            return 1;
    return (function >= 65 && function <= 72) || (function >= 100 && function <= 110);
}

TEST(bytes_look_like_tcp_with_or_without_unknown_functions)
{
    uint8_t frame[] = {0x81, 0x80, 0, 0, 0, 6, 0x10, 1, 0, 0x6B, 0, 3};
    uint16_t length = 0, have;

    for (have = 0; have < 8; have++)
        IS(MBM_INCOMPLETE_FRAME, mbm_frame_looksLikeTcp(frame, have, 0, &length));
    for (have = 8; have <= sizeof frame; have++) {
        OK(mbm_frame_looksLikeTcp(frame, have, 0, &length));
        assert_int_equal(length, 12);
    }
    for (unsigned function = 0; function < 256; function++) {
        uint8_t fits = 0, any = 0;

        frame[7] = (uint8_t)function;
        for (frame[5] = 2; frame[5] < 255; frame[5]++) {
            fits |= mbm_frame_looksLikeTcp(frame, 8, 0, &length) == MBM_OK;
            any |= mbm_frame_looksLikeTcp(frame, 8, 1, &length) == MBM_OK;
        }
        if (fits != has_example((uint8_t)(function & 0x7F)))
            fail_msg("function %02X: c-tests/support/examples.c and `is_public` in "
                     "src/pdu/mod.rs differ",
                     function);
        assert_int_equal(any, (function & 0x7F) != 0);
    }
    frame[5] = 6;
    frame[7] = 3;
    frame[3] = 1;
    IS(MBM_MALFORMED_FRAME, mbm_frame_looksLikeTcp(frame, 4, 1, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_looksLikeTcp(NULL, 8, 1, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_looksLikeTcp(frame, 8, 1, NULL));
}

/* Returns whether a header with this length, followed by these bytes, looks like TCP. */
static int looks_like_tcp(uint8_t length, const char *pdu)
{
    uint8_t frame[64] = {0, 1, 0, 0, 0, length, 0x11};
    uint16_t total = 0, have = (uint16_t)(7 + hex_bytes(frame + 7, pdu));
    uint8_t status = mbm_frame_looksLikeTcp(frame, have, 1, &total);

    if (status == MBM_OK)
        assert_int_equal(total, 6 + length);
    else
        IS(MBM_MALFORMED_FRAME, status);
    return status == MBM_OK;
}

TEST(a_header_with_a_length_that_the_function_never_has_does_not_look_like_tcp)
{
    unsigned length;

    /* A request has 5 bytes. A response has as many as its byte count says, at least 2. */
    assert_false(looks_like_tcp(2, "01"));
    assert_true(looks_like_tcp(3, "01"));
    assert_true(looks_like_tcp(6, "01 0000 0001"));
    assert_false(looks_like_tcp(7, "01 0000 0001"));
    assert_true(looks_like_tcp(7, "01 04 0000"));
    assert_false(looks_like_tcp(8, "01 04 0000"));
    /* Only the bytes that have arrived are checked. Bytes after the frame are not. */
    assert_true(looks_like_tcp(7, "01 04 0000 0000 0005"));
    assert_false(looks_like_tcp(4, "01 04 00"));
    /* Functions of fixed length. */
    assert_true(looks_like_tcp(2, "07"));
    assert_true(looks_like_tcp(3, "07 2A"));
    assert_false(looks_like_tcp(4, "07 2A 00"));
    assert_true(looks_like_tcp(8, "16"));
    assert_false(looks_like_tcp(7, "16"));
    for (length = 2; length < 255; length++) {
        /* An exception has 2 bytes, whatever its function. */
        assert_int_equal(looks_like_tcp((uint8_t)length, "81"), length == 3);
        assert_int_equal(looks_like_tcp((uint8_t)length, "D5 01"), length == 3);
        /* A function whose length is unknown may have any length. */
        assert_true(looks_like_tcp((uint8_t)length, "55"));
        assert_int_equal(looks_like_tcp((uint8_t)length, "08 0000"), length >= 4);
        assert_int_equal(looks_like_tcp((uint8_t)length, "2B 0D"), length >= 3);
        /* The byte count of a server id may cover the id alone. A request has one byte. */
        assert_int_equal(looks_like_tcp((uint8_t)length, "11 02"), length == 2 || length >= 5);
    }
}

TEST(the_length_of_a_server_id_is_found_by_its_crc)
{
    static const char whole[] = "10 11 02 01FF 00EF", more[] = "10 11 02 0102 00 0102 0000";
    uint8_t bytes[16];
    mbm_length expected;
    uint16_t have, length = hex_bytes(bytes, whole);
    mbm_packet packet;

    OK(mbm_frame_parse(rtu, MBM_PACKET_RESPONSE, bytes, length, &packet));
    for (have = 3; have <= length; have++) {
        OK(mbm_frame_expectedLength(rtu, MBM_PACKET_RESPONSE, bytes, have, &expected));
        assert_int_equal(expected.kind, have < 7 ? MBM_LENGTH_AT_LEAST : MBM_LENGTH_EXACT);
        assert_int_equal(expected.bytes, 7);
    }
    /* Where the byte count covers the id alone, only the end of the frame shows the length. */
    length = hex_bytes(bytes, more);
    OK(mbm_frame_expectedLength(rtu, MBM_PACKET_RESPONSE, bytes, length, &expected));
    assert_int_equal(expected.kind, MBM_LENGTH_SILENCE);
    OK(mbm_frame_expectedLength(&framings[3], MBM_PACKET_RESPONSE, bytes, length, &expected));
    assert_int_equal(expected.kind, MBM_LENGTH_UNKNOWN);
}

TEST(a_refused_request_is_answered_with_its_exception)
{
    static const struct {
        const char *pdu;
        uint8_t status;
    } refused[] = {
        {"09", MBM_ILLEGAL_FUNCTION},
        {"08 0005 0000", MBM_ILLEGAL_FUNCTION},
        {"03 FFFF 0002", MBM_ILLEGAL_DATA_ADDRESS},
        {"01 0000 0000", MBM_ILLEGAL_DATA_VALUE},
        {"10 0000 0001 03 000000", MBM_ILLEGAL_DATA_VALUE},
        {"00", MBM_ILLEGAL_FUNCTION},
    };
    uint8_t pdu[16], frame[64], reply[32], wanted[32];
    mbm_packet packet, answer;
    uint16_t length, size;

    for (size_t f = 0; f < COUNT(framings); f++) {
        for (size_t i = 0; i < COUNT(refused); i++) {
            uint8_t exception[2];
            mbm_packet head = {.unit = 0x0A, .transaction = f == 2 ? 0xDA87 : 0};

            length = hex_bytes(pdu, refused[i].pdu);
            length = wrap(&framings[f], &head, pdu, length, frame);
            IS(refused[i].status,
               mbm_frame_parse(&framings[f], MBM_PACKET_REQUEST, frame, length, &packet));
            assert_int_equal(packet.unit, 0x0A);
            assert_int_equal(packet.function, pdu[0]);
            assert_null(packet.data);
            OK(mbm_frame_exception(&framings[f], &packet, refused[i].status, reply, 11, &size));
            exception[0] = pdu[0] | 0x80;
            exception[1] = refused[i].status;
            assert_int_equal(size, wrap(&framings[f], &head, exception, 2, wanted));
            assert_memory_equal(reply, wanted, size);
            IS(MBM_BUFFER_TOO_SMALL, mbm_frame_exception(&framings[f], &packet, refused[i].status,
                                                         wanted, (uint16_t)(size - 1), &length));
            OK(mbm_frame_parse(&framings[f], MBM_PACKET_RESPONSE, reply, size, &answer));
            assert_int_equal(answer.kind, MBM_PACKET_EXCEPTION);
            assert_int_equal(answer.exceptionCode, refused[i].status);
            assert_int_equal(answer.transaction, head.transaction);
        }
    }
}

TEST(a_serial_broadcast_and_a_bad_frame_get_no_exception)
{
    mbm_packet head = {.unit = 0}, packet;
    uint8_t frame[32], reply[32];
    uint16_t size;
    const uint8_t pdu[] = {9}, exception[] = {0x83};

    uint16_t length = wrap(ascii, &head, pdu, 1, frame);
    IS(MBM_ILLEGAL_FUNCTION, mbm_frame_parse(ascii, MBM_PACKET_REQUEST, frame, length, &packet));
    IS(MBM_BROADCAST_NOT_ALLOWED,
       mbm_frame_exception(ascii, &packet, MBM_ILLEGAL_FUNCTION, reply, 32, &size));
    length = wrap(tcp, &head, pdu, 1, frame);
    IS(MBM_ILLEGAL_FUNCTION, mbm_frame_parse(tcp, MBM_PACKET_REQUEST, frame, length, &packet));
    OK(mbm_frame_exception(tcp, &packet, MBM_ILLEGAL_FUNCTION, reply, 32, &size));
    length = wrap(tcp, &head, exception, 1, frame);
    IS(MBM_ILLEGAL_FUNCTION, mbm_frame_parse(tcp, MBM_PACKET_REQUEST, frame, length, &packet));
    IS(MBM_ILLEGAL_FUNCTION,
       mbm_frame_exception(tcp, &packet, MBM_ILLEGAL_FUNCTION, reply, 32, &size));
    IS(MBM_INCOMPLETE_FRAME, mbm_frame_parse(rtu, MBM_PACKET_REQUEST, frame, 3, &packet));
    IS(MBM_INVALID_ARGUMENT,
       mbm_frame_exception(rtu, &packet, MBM_INCOMPLETE_FRAME, reply, 32, &size));
    packet.kind = MBM_PACKET_RESPONSE;
    IS(MBM_INVALID_ARGUMENT, mbm_frame_exception(rtu, &packet, 1, reply, 32, &size));
}

TEST(a_declared_function_is_built_and_parsed_in_every_framing)
{
    const mbm_function own = {0x55, {MBM_RULE_COUNTED, 1, 0}, {MBM_RULE_FIXED, 2, 0}};
    const uint8_t pdu[] = {0x55, 2, 8, 9};
    mbm_packet head = {.unit = 1}, packet;
    mbm_length expected;
    uint8_t frame[32], built[32];
    uint16_t length, size;

    for (size_t f = 0; f < COUNT(framings); f++) {
        mbm_framing with = framings[f];

        with.functions = &own;
        with.functionCount = 1;
        length = wrap(&with, &head, pdu, 4, frame);
        OK(mbm_frame_expectedLength(&with, MBM_PACKET_REQUEST, frame, length, &expected));
        assert_int_equal(expected.bytes, length);
        OK(mbm_frame_parse(&with, MBM_PACKET_REQUEST, frame, length, &packet));
        OK(mbm_frame_replyLength(&with, &packet, &expected));
        assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
        OK(mbm_frame_build(&with, &packet, built, sizeof built, &size));
        assert_int_equal(size, length);
        IS(MBM_ILLEGAL_FUNCTION,
           mbm_frame_build(&framings[f], &packet, built, sizeof built, &size));
    }
}
