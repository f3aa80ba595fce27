/* mbm_frame_* against libmodbus, RTU over a pty and TCP over loopback: mbm builds the
 * requests of libmodbus's client and parses the responses of its server. */
#define _GNU_SOURCE
#include "await.h"
#include "examples.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};
static const mbm_framing tcp = {.kind = MBM_FRAMING_TCP};

/* Reads one frame, as long as its first bytes say. */
static uint16_t receive(int fd, const mbm_framing *f, uint8_t kind, uint8_t *frame)
{
    uint16_t have = 0;
    mbm_length expected;

    for (;;) {
        struct pollfd wait = {fd, POLLIN, 0};
        ssize_t count;

        OK(mbm_frame_expectedLength(f, kind, frame, have, &expected));
        assert_true(expected.kind == MBM_LENGTH_EXACT || expected.kind == MBM_LENGTH_AT_LEAST);
        if (have == expected.bytes) {
            assert_int_equal(expected.kind, MBM_LENGTH_EXACT);
            return have;
        }
        assert_int_equal(poll(&wait, 1, PATIENCE_MS), 1);
        count = read(fd, frame + have, (size_t)(expected.bytes - have));
        assert_true(count > 0);
        have = (uint16_t)(have + count);
    }
}

/* The calls of libmodbus's client, and the packet that each call sends. */
enum { CALLS = 11 };
static const uint16_t words[] = {0x1234, 0xABCD, 0x0001};
static const uint8_t wire_words[] = {0x12, 0x34, 0xAB, 0xCD, 0x00, 0x01};
static const uint8_t bits[] = {1, 0, 1, 1, 0, 0, 0, 1, 1, 1}, wire_bits[] = {0x8D, 0x03};

static void call(modbus_t *client, unsigned number)
{
    uint8_t bytes[MODBUS_MAX_READ_BITS];
    uint16_t registers[MODBUS_MAX_READ_REGISTERS];
    int done = 0;

    switch (number) {
    case 0: done = modbus_read_bits(client, 0x13, 0x25, bytes); break;
    case 1: done = modbus_read_input_bits(client, 0xC4, 0x16, bytes); break;
    case 2: done = modbus_read_registers(client, 0x6B, 3, registers); break;
    case 3: done = modbus_read_input_registers(client, 8, 125, registers); break;
    case 4: done = modbus_write_bit(client, 0xAC, 1); break;
    case 5: done = modbus_write_register(client, 1, 3); break;
    case 6: done = modbus_write_bits(client, 0x13, 10, bits); break;
    case 7: done = modbus_write_registers(client, 1, 3, words); break;
    case 8: done = modbus_mask_write_register(client, 4, 0xF2, 0x25); break;
    case 9: done = modbus_write_and_read_registers(client, 14, 3, words, 3, 6, registers); break;
    case 10: done = modbus_report_slave_id(client, (int)sizeof bytes, bytes); break;
    }
    /* There is no server. */
    assert_int_equal(done, -1);
}

static const mbm_packet sent[CALLS] = {
    {.function = 0x01, .address = 0x13, .quantity = 0x25},
    {.function = 0x02, .address = 0xC4, .quantity = 0x16},
    {.function = 0x03, .address = 0x6B, .quantity = 3},
    {.function = 0x04, .address = 8, .quantity = 125},
    {.function = 0x05, .address = 0xAC, .value = 1},
    {.function = 0x06, .address = 1, .value = 3},
    {.function = 0x0F, .address = 0x13, .quantity = 10, .data = wire_bits, .dataLength = 2},
    {.function = 0x10, .address = 1, .quantity = 3, .data = wire_words, .dataLength = 6},
    {.function = 0x16, .address = 4, .andMask = 0xF2, .orMask = 0x25},
    {.function = 0x17,
     .address = 3,
     .quantity = 6,
     .writeAddress = 14,
     .writeQuantity = 3,
     .data = wire_words,
     .dataLength = 6},
    {.function = 0x11},
};

static void sends_what_we_build(modbus_t *client, int fd, const mbm_framing *f)
{
    uint8_t frame[MBM_MAX_TCP_FRAME], built[MBM_MAX_TCP_FRAME];
    mbm_packet found, wanted;
    uint16_t length, size;

    assert_int_equal(modbus_set_slave(client, 17), 0);
    assert_int_equal(modbus_set_response_timeout(client, 0, 1000), 0);
    for (unsigned number = 0; number < CALLS; number++) {
        call(client, number);
        length = receive(fd, f, MBM_PACKET_REQUEST, frame);
        wanted = sent[number];
        wanted.unit = 17;
        memcpy(built, frame, length);
        OK(mbm_frame_parse(f, MBM_PACKET_REQUEST, built, length, &found));
        wanted.transaction = found.transaction;
        assert_same_packet(&found, &wanted);
        OK(mbm_frame_build(f, &wanted, built, sizeof built, &size));
        assert_int_equal(size, length);
        assert_memory_equal(built, frame, length);
    }
}

TEST(mbm_builds_the_requests_that_libmodbus_sends_over_rtu)
{
    pty line;

    pty_open(&line);
    modbus_t *client = modbus_new_rtu(line.path, 115200, 'N', 8, 1);
    assert_non_null(client);
    assert_int_equal(modbus_connect(client), 0);
    sends_what_we_build(client, line.ours, &rtu);
    modbus_close(client);
    modbus_free(client);
    pty_close(&line);
}

TEST(mbm_builds_the_requests_that_libmodbus_sends_over_tcp)
{
    uint16_t port;
    int listener = tcp_listenOnFree(&port), peer;

    modbus_t *client = modbus_new_tcp("127.0.0.1", port);
    assert_non_null(client);
    assert_int_equal(modbus_connect(client), 0);
    peer = accept(listener, NULL, NULL);
    assert_true(peer >= 0);
    sends_what_we_build(client, peer, &tcp);
    modbus_close(client);
    modbus_free(client);
    close(peer);
    close(listener);
}

/* Sends a request and parses the reply, whose length must be the one that the request implies. */
static void request_reply(int fd, const mbm_framing *f, mbm_packet request, uint8_t *frame,
                          mbm_packet *reply)
{
    mbm_length expected;
    uint16_t length;

    request.unit = 17;
    request.transaction = f->kind == MBM_FRAMING_TCP ? 0xDA87 : 0;
    OK(mbm_frame_replyLength(f, &request, &expected));
    OK(mbm_frame_build(f, &request, frame, MBM_MAX_TCP_FRAME, &length));
    assert_int_equal(write(fd, frame, length), length);
    length = receive(fd, f, MBM_PACKET_RESPONSE, frame);
    OK(mbm_frame_parse(f, MBM_PACKET_RESPONSE, frame, length, reply));
    if (reply->kind != MBM_PACKET_EXCEPTION && expected.kind == MBM_LENGTH_EXACT)
        assert_int_equal(length, expected.bytes);
    assert_int_equal(reply->function, request.function);
    assert_int_equal(reply->unit, 17);
    assert_int_equal(reply->transaction, request.transaction);
}

static uint16_t word(const mbm_packet *reply, unsigned index)
{
    return (uint16_t)(reply->data[2 * index] << 8 | reply->data[2 * index + 1]);
}

static void answers_what_we_parse(int fd, const mbm_framing *f, const modbus_mapping_t *memory)
{
    uint8_t frame[MBM_MAX_TCP_FRAME];
    mbm_packet reply;

    for (unsigned i = 0; i < CALLS; i++) {
        const mbm_packet *request = &sent[i];
        unsigned at;

        request_reply(fd, f, *request, frame, &reply);
        assert_int_equal(reply.kind, MBM_PACKET_RESPONSE);
        assert_int_equal(reply.address, reply.dataLength ? 0 : request->address);
        assert_int_equal(reply.value, request->value);
        assert_int_equal(reply.andMask, request->andMask);
        assert_int_equal(reply.orMask, request->orMask);
        for (at = 0; at < request->quantity && reply.dataLength; at++) {
            unsigned cell = request->address + at;

            if (request->function <= 0x02)
                assert_int_equal(reply.data[at / 8] >> at % 8 & 1,
                                 request->function == 0x01 ? memory->tab_bits[cell]
                                                           : memory->tab_input_bits[cell]);
            else
                assert_int_equal(word(&reply, at), request->function == 0x04
                                                       ? memory->tab_input_registers[cell]
                                                       : memory->tab_registers[cell]);
        }
    }
    assert_int_equal(reply.function, 0x11);
    assert_int_equal(reply.byteCount, reply.dataLength);
    assert_int_equal(memory->tab_bits[0xAC], 1);
    assert_int_equal(memory->tab_registers[14], 0x1234);
    assert_int_equal(memory->tab_registers[16], 0x0001);
    request_reply(fd, f, (mbm_packet){.function = 0x03, .address = 0xFF00, .quantity = 1}, frame,
                  &reply);
    assert_int_equal(reply.kind, MBM_PACKET_EXCEPTION);
    IS(MBM_ILLEGAL_DATA_ADDRESS, reply.exceptionCode);
}

TEST(mbm_parses_the_responses_of_libmodbus_over_rtu)
{
    static server peer;

    server_start(&peer, 17);
    answers_what_we_parse(peer.line.ours, &rtu, peer.mapping);
    server_stop(&peer);
}

TEST(mbm_parses_the_responses_of_libmodbus_over_tcp)
{
    tcp_server peer;

    tcp_server_start(&peer);
    int fd = tcp_connectTo(peer.port);
    answers_what_we_parse(fd, &tcp, peer.mapping);
    close(fd);
    tcp_server_stop(&peer);
}

/* --- Frames that are cut short or changed, wrong MBAP lengths, wrong ASCII characters, NULL --- */

static const mbm_framing ascii = {.kind = MBM_FRAMING_ASCII};

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
                    IS(MBM_MALFORMED_FRAME, status);
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
