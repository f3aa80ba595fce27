/* Frames that are cut short or changed, wrong MBAP lengths, wrong ASCII characters, NULL. */
#include "examples.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};
static const mbm_framing ascii = {.kind = MBM_FRAMING_ASCII};
static const mbm_framing tcp = {.kind = MBM_FRAMING_TCP};

/* Writes example `i` as a frame of unit 0x11. */
static uint16_t framed(size_t i, const mbm_framing *f, uint8_t *frame)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;
    uint16_t length;

    example_load(&examples[i], pdu, &packet);
    packet.unit = 0x11;
    packet.transaction = 0x8180;
    OK(mbm_frame_build(f, &packet, frame, MBM_MAX_ASCII_FRAME, &length));
    return length;
}

/* Parses a copy in memory of exactly this size, so that sanitizers report a read beyond it.
 * A frame that is parsed must be built to the same bytes, except for lower case. */
static uint8_t parsed(const mbm_framing *f, uint8_t side, const uint8_t *frame, uint16_t length)
{
    uint8_t *copy = malloc(length ? length : 1), again[MBM_MAX_ASCII_FRAME];
    mbm_packet packet;
    uint16_t size;

    assert_non_null(copy);
    memcpy(copy, frame, length);
    uint8_t status = mbm_frame_parse(f, side, copy, length, &packet);
    if (status == MBM_OK) {
        OK(mbm_frame_build(f, &packet, again, sizeof again, &size));
        assert_int_equal(size, length);
        for (uint16_t i = 0; i < length; i++)
            if (f->kind == MBM_FRAMING_ASCII && frame[i] >= 'a' && frame[i] <= 'f')
                assert_int_equal(again[i], frame[i] - 'a' + 'A');
            else
                assert_int_equal(again[i], frame[i]);
    } else if (status >= MBM_INCOMPLETE_FRAME || status == MBM_INVALID_CRC) {
        assert_int_equal(packet.function, 0);
    } else {
        assert_int_equal(packet.unit, f->kind == MBM_FRAMING_TCP ? frame[6] : 0x11);
    }
    free(copy);
    return status;
}

TEST(an_rtu_frame_that_is_cut_or_changed_is_refused)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint16_t length;

    for (size_t i = 0; i < example_count; i++) {
        uint8_t side = example_side(&examples[i]);

        length = framed(i, &rtu, frame);
        for (uint16_t at = 0; at < length; at++)
            IS(at < 4 ? MBM_INCOMPLETE_FRAME : MBM_INVALID_CRC, parsed(&rtu, side, frame, at));
        for (uint16_t at = 0; at < length; at++) {
            for (unsigned flip = 1; flip < 256; flip++) {
                frame[at] ^= (uint8_t)flip;
                IS(MBM_INVALID_CRC, parsed(&rtu, side, frame, length));
                frame[at] ^= (uint8_t)flip;
            }
        }
    }
    memset(frame, 0, sizeof frame);
    IS(MBM_MALFORMED_FRAME, parsed(&rtu, MBM_PACKET_REQUEST, frame, 257));
}

TEST(a_tcp_frame_that_is_cut_or_changed_is_parsed_right_or_refused)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint16_t length;

    for (size_t i = 0; i < example_count; i++) {
        uint8_t side = example_side(&examples[i]);

        length = framed(i, &tcp, frame);
        for (uint16_t at = 0; at < length; at++)
            IS(MBM_INCOMPLETE_FRAME, parsed(&tcp, side, frame, at));
        for (uint16_t at = 0; at < length; at++) {
            for (unsigned flip = 1; flip < 256; flip++) {
                uint8_t status;

                frame[at] ^= (uint8_t)flip;
                status = parsed(&tcp, side, frame, length);
                if (at == 2 || at == 3 || at == 4)
                    assert_int_equal(status, MBM_MALFORMED_FRAME);
                if (at == 5)
                    assert_true(status == MBM_MALFORMED_FRAME || status == MBM_INCOMPLETE_FRAME);
                frame[at] ^= (uint8_t)flip;
            }
        }
    }
}

TEST(an_ascii_frame_that_is_cut_or_changed_is_parsed_right_or_refused)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint16_t length;
    unsigned right;

    for (size_t i = 0; i < example_count; i++) {
        uint8_t side = example_side(&examples[i]);

        length = framed(i, &ascii, frame);
        for (uint16_t at = 0; at < length; at++)
            IS(MBM_INCOMPLETE_FRAME, parsed(&ascii, side, frame, at));
        for (uint16_t at = 0; at < length; at++) {
            uint8_t was = frame[at];

            for (unsigned value = right = 0; value < 256; value++) {
                frame[at] = (uint8_t)value;
                right += parsed(&ascii, side, frame, length) == MBM_OK;
            }
            /* A hexadecimal letter may be in lower case. */
            assert_int_equal(right, was >= 'A' && was <= 'F' ? 2 : 1);
            frame[at] = was;
        }
    }
}

TEST(a_packet_with_a_unit_above_255_is_refused)
{
    const mbm_framing *const kinds[] = {&rtu, &ascii, &tcp};
    uint8_t frame[MBM_MAX_ASCII_FRAME], was[MBM_MAX_ASCII_FRAME] = {0};
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = 3, .quantity = 1};
    mbm_length expected;
    uint16_t length;

    memset(frame, 0, sizeof frame);
    for (size_t i = 0; i < COUNT(kinds); i++) {
        packet.unit = 300; /* not 44 */
        IS(MBM_INVALID_ARGUMENT, mbm_frame_build(kinds[i], &packet, frame, sizeof frame, &length));
        assert_int_equal(length, 0);
        IS(MBM_INVALID_ARGUMENT,
           mbm_frame_exception(kinds[i], &packet, 2, frame, sizeof frame, &length));
        assert_int_equal(length, 0);
        packet.unit = 256; /* not a broadcast */
        IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(kinds[i], &packet, &expected));
        assert_memory_equal(frame, was, sizeof frame);
    }
    packet.unit = 255;
    OK(mbm_frame_build(&tcp, &packet, frame, sizeof frame, &length));
    assert_int_equal(frame[6], 255);
}

TEST(impossible_mbap_lengths_are_malformed)
{
    static const uint16_t lengths[] = {0, 1, 255, 256, 65535};
    uint8_t frame[600] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};
    mbm_length expected;
    uint16_t total;

    for (size_t i = 0; i < COUNT(lengths); i++) {
        frame[4] = (uint8_t)(lengths[i] >> 8);
        frame[5] = (uint8_t)lengths[i];
        IS(MBM_MALFORMED_FRAME, parsed(&tcp, MBM_PACKET_REQUEST, frame, 12));
        IS(MBM_MALFORMED_FRAME, parsed(&tcp, MBM_PACKET_REQUEST, frame, 261));
        IS(MBM_MALFORMED_FRAME,
           mbm_frame_expectedLength(&tcp, MBM_PACKET_REQUEST, frame, 6, &expected));
        IS(MBM_MALFORMED_FRAME, mbm_frame_looksLikeTcp(frame, 12, 1, &total));
    }
    frame[4] = 0;
    frame[5] = 254;
    OK(mbm_frame_expectedLength(&tcp, MBM_PACKET_REQUEST, frame, 7, &expected));
    assert_int_equal(expected.bytes, MBM_MAX_TCP_FRAME);
    IS(MBM_INCOMPLETE_FRAME, parsed(&tcp, MBM_PACKET_REQUEST, frame, 12));
    frame[5] = 5;
    IS(MBM_MALFORMED_FRAME, parsed(&tcp, MBM_PACKET_REQUEST, frame, 12));
}

TEST(ascii_digits_may_be_lower_case_and_must_come_in_pairs)
{
    static const struct {
        uint8_t status;
        const char *text;
    } frames[] = {
        {MBM_OK, ":0207F7\r\n"},
        {MBM_OK, ":0207f7\r\n"},
        {MBM_MALFORMED_FRAME, ":0207F\r\n"},
        {MBM_MALFORMED_FRAME, ":0207FG\r\n"},
        {MBM_MALFORMED_FRAME, ":02 7F7\r\n"},
        {MBM_MALFORMED_FRAME, "0207F7\r\n"},
        {MBM_MALFORMED_FRAME, ":02FE\r\n"},
        {MBM_MALFORMED_FRAME, ":\r\n"},
        {MBM_INVALID_CRC, ":0207F6\r\n"},
        {MBM_INCOMPLETE_FRAME, ":0207F7\r"},
        {MBM_INCOMPLETE_FRAME, ":0207F7\n"},
        {MBM_INCOMPLETE_FRAME, ":0207F7\n\r"},
        {MBM_INCOMPLETE_FRAME, ":0207F7"},
        {MBM_INCOMPLETE_FRAME, ""},
    };
    mbm_framing other = {.kind = MBM_FRAMING_ASCII, .delimiter = '!'};
    mbm_length expected;
    mbm_packet packet;
    uint8_t text[600];
    uint16_t length;

    for (size_t i = 0; i < COUNT(frames); i++) {
        length = (uint16_t)strlen(frames[i].text);
        memcpy(text, frames[i].text, length);
        IS(frames[i].status, mbm_frame_parse(&ascii, MBM_PACKET_REQUEST, text, length, &packet));
    }
    memcpy(text, ":0207F7\r!", 9);
    IS(MBM_INCOMPLETE_FRAME, parsed(&ascii, MBM_PACKET_REQUEST, text, 9));
    OK(mbm_frame_expectedLength(&other, MBM_PACKET_REQUEST, text, 9, &expected));
    assert_int_equal(expected.bytes, 9);
    IS(MBM_MALFORMED_FRAME,
       mbm_frame_expectedLength(&ascii, MBM_PACKET_REQUEST, text, 9, &expected));
    OK(mbm_frame_parse(&other, MBM_PACKET_REQUEST, text, 9, &packet));
    OK(mbm_frame_build(&other, &packet, text, 9, &length));
    assert_memory_equal(text, ":0207F7\r!", 9);
    memset(text, '0', sizeof text);
    text[0] = ':';
    IS(MBM_MALFORMED_FRAME, parsed(&ascii, MBM_PACKET_REQUEST, text, 514));
}

TEST(first_bytes_that_begin_no_frame_are_malformed)
{
    mbm_length expected;

#define FIRST(framing, text)                                                                       \
    mbm_frame_expectedLength(&framing, MBM_PACKET_RESPONSE, (const uint8_t *)(text),               \
                             sizeof(text) - 1, &expected)
    IS(MBM_MALFORMED_FRAME, FIRST(rtu, "\x01\x03\xFC"));
    IS(MBM_MALFORMED_FRAME, FIRST(tcp, "\x00\x01\x00\x01"));
    IS(MBM_MALFORMED_FRAME, FIRST(ascii, "0"));
    IS(MBM_MALFORMED_FRAME, FIRST(ascii, ":0x"));
    IS(MBM_MALFORMED_FRAME, FIRST(ascii, ":0103FC"));
    OK(FIRST(rtu, "\x01\x55"));
    assert_int_equal(expected.kind, MBM_LENGTH_UNKNOWN);
    OK(FIRST(ascii, ":0155"));
    assert_int_equal(expected.kind, MBM_LENGTH_SILENCE);
}

TEST(null_is_an_invalid_argument)
{
    const mbm_framing unknown = {.kind = 5}, no_list = {.functionCount = 1};
    mbm_packet packet = {.unit = 1, .function = 0x03, .quantity = 1};
    mbm_length expected;
    uint8_t frame[16];
    uint16_t length;

    OK(mbm_frame_build(&rtu, &packet, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(NULL, &packet, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(&unknown, &packet, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(&no_list, &packet, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(&rtu, NULL, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(&rtu, &packet, NULL, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_build(&rtu, &packet, frame, 16, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(NULL, 0, frame, 8, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(&rtu, 2, frame, 8, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(&rtu, 0, NULL, 8, &packet));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_parse(&rtu, 0, frame, 8, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_exception(NULL, &packet, 1, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_exception(&rtu, NULL, 1, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_exception(&rtu, &packet, 1, NULL, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_exception(&rtu, &packet, 1, frame, 16, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_exception(&rtu, &packet, 0, frame, 16, &length));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(NULL, 0, frame, 1, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(&rtu, 2, frame, 1, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(&rtu, 0, NULL, 1, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_expectedLength(&rtu, 0, frame, 1, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(NULL, &packet, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(&rtu, NULL, &expected));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_replyLength(&rtu, &packet, NULL));
}
