/* mbm_sniffer_*: the events that it reports for a bus of the test's own, and the calls that
 * it refuses. */
#include "refused.h"
#include "hooked_port.h"
#include "examples.h"
#include "test.h"

static mbm_sniffer sniffer;
static uint8_t buffer[2 * MBM_MAX_ASCII_FRAME];
static uint32_t now;

static const uint8_t request[] = {3, 0, 107, 0, 3}, reply[] = {3, 6, 2, 0x2B, 0, 0, 0, 100};

static void begin(uint8_t framing)
{
    now = 0;
    OK(mbm_sniffer_begin(&sniffer, framing, buffer, sizeof buffer));
}

/* Builds the frame of a PDU of unit 17. */
static uint16_t frame_of(uint8_t kind, const uint8_t *pdu, uint16_t length, uint8_t side,
                         uint8_t *frame)
{
    mbm_framing framing = {.kind = kind};
    mbm_packet packet;
    uint16_t size = 0;

    OK(mbm_frame_parse(PDU(NULL, 0), side, (uint8_t *)pdu, length, &packet));
    packet.unit = 17;
    packet.transaction = 7;
    OK(mbm_frame_build(&framing, &packet, frame, MBM_MAX_ASCII_FRAME, &size));
    return size;
}

static void feed(const uint8_t *bytes, uint16_t length)
{
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, bytes, length, now), length);
}

/* Asserts the text of the next event. */
static void assert_next(const char *words)
{
    mbm_event event;
    char text[200];

    assert_int_equal(mbm_sniffer_next(&sniffer, now, &event), 1);
    OK(mbm_event_text(&event, text, sizeof text));
    assert_string_equal(text, words);
}

static void assert_nothing(void)
{
    mbm_event event;

    assert_int_equal(mbm_sniffer_next(&sniffer, now, &event), 0);
}

TEST(a_request_and_its_reply_are_reported_with_values_in_each_framing)
{
    uint8_t kind, frame[MBM_MAX_ASCII_FRAME];
    mbm_event event;
    uint16_t length;

    for (kind = MBM_FRAMING_RTU; kind <= MBM_FRAMING_RTU_OVER_TCP; kind++) {
        begin(kind);
        length = frame_of(kind, request, sizeof request, MBM_PACKET_REQUEST, frame);
        feed(frame, length);
        assert_int_equal(mbm_sniffer_next(&sniffer, now, &event), 1);
        assert_int_equal(event.kind, MBM_EVENT_REQUEST);
        assert_int_equal(event.length, length);
        assert_int_equal(event.packet.address, 107);
        assert_int_equal(event.packet.quantity, 3);
        assert_memory_equal(event.pdu, request, sizeof request);
        if (kind != MBM_FRAMING_ASCII)
            assert_memory_equal(event.frame, frame, length);
        now += 12345;
        feed(frame, frame_of(kind, reply, sizeof reply, MBM_PACKET_RESPONSE, frame));
        assert_int_equal(mbm_sniffer_next(&sniffer, now, &event), 1);
        assert_int_equal(event.kind, MBM_EVENT_REPLY);
        OK(event.status);
        assert_int_equal(event.unit, 17);
        assert_int_equal(event.function, 3);
        assert_int_equal(event.timeUs, 12345);
        assert_int_equal(event.responseTimeUs, 12345);
        assert_int_equal(event.address, 107);
        assert_int_equal(event.quantity, 3);
        assert_int_equal(event.packet.kind, MBM_PACKET_RESPONSE);
        assert_int_equal(event.packet.transaction, kind == MBM_FRAMING_TCP ? 7 : 0);
        assert_int_equal(event.packet.dataLength, 6);
        assert_memory_equal(event.packet.data, reply + 2, 6);
        assert_memory_equal(event.requestHead, request, sizeof request);
        assert_int_equal(event.requestHeadLength, sizeof request);
        assert_nothing();
    }
}

TEST(every_example_is_found_as_a_frame)
{
    uint8_t kind, pdu[MBM_MAX_PDU], frame[MBM_MAX_ASCII_FRAME];
    mbm_framing framing = {0};
    mbm_packet packet;
    mbm_event event;
    uint16_t length, size;

    for (kind = MBM_FRAMING_RTU; kind <= MBM_FRAMING_TCP; kind++) {
        framing.kind = kind;
        for (size_t i = 0; i < example_count; i++) {
            uint8_t side = example_side(&examples[i]);

            begin(kind);
            length = example_load(&examples[i], pdu, &packet);
            packet.unit = 17;
            OK(mbm_frame_build(&framing, &packet, frame, sizeof frame, &size));
            /* Only the direction distinguishes a reply without a request from a request. */
            assert_int_equal(mbm_sniffer_feed(&sniffer,
                                              side == MBM_PACKET_REQUEST ? MBM_DIRECTION_CLIENT
                                                                         : MBM_DIRECTION_SERVER,
                                              frame, size, now),
                             size);
            now += 10000;
            assert_int_equal(mbm_sniffer_next(&sniffer, now, &event), 1);
            assert_int_equal(event.kind,
                             side == MBM_PACKET_REQUEST ? MBM_EVENT_REQUEST : MBM_EVENT_UNPAIRED);
            assert_int_equal(event.pduLength, length);
            assert_memory_equal(event.pdu, pdu, length);
        }
    }
}

TEST(timeouts_damage_and_noise_are_reported)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint16_t length = frame_of(MBM_FRAMING_RTU, request, sizeof request, MBM_PACKET_REQUEST, frame);

    begin(MBM_FRAMING_RTU);
    OK(mbm_sniffer_setBaudRate(&sniffer, 19200));
    OK(mbm_sniffer_setResponseTimeout(&sniffer, 200));
    OK(mbm_sniffer_setFrameTimeout(&sniffer, 20));
    feed(frame, length);
    now += 199999;
    assert_next("unit 17  request    03 read holding registers  107..109");
    assert_nothing();
    now += 1;
    assert_next("unit 17  timeout    03 read holding registers  107..109");
    frame[3] ^= 1;
    feed(frame, length);
    now += 20000;
    assert_next("bad CRC, 8 bytes");
    feed((const uint8_t *)"\xFF\xFF\xFF", 3);
    now += 20000;
    assert_next("noise, 3 bytes");
    feed((const uint8_t *)"\x11\x83\x02\xC1\x34", 5);
    assert_next("unit 17  unpaired   03 read holding registers: exception 02 illegal data address");
    assert_nothing();
}

TEST(more_bytes_than_the_buffer_holds_are_fed_in_parts)
{
    static uint8_t traffic[6000];
    uint8_t small[MBM_MAX_FRAME], frame[MBM_MAX_ASCII_FRAME];
    uint16_t length = 0, fed = 0, size;
    unsigned requests = 0, replies = 0;
    mbm_event event;

    while (length + 100u < sizeof traffic) {
        size = frame_of(MBM_FRAMING_RTU, request, sizeof request, MBM_PACKET_REQUEST, frame);
        memcpy(traffic + length, frame, size);
        length = (uint16_t)(length + size);
        size = frame_of(MBM_FRAMING_RTU, reply, sizeof reply, MBM_PACKET_RESPONSE, frame);
        memcpy(traffic + length, frame, size);
        length = (uint16_t)(length + size);
    }
    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, small, sizeof small));
    while (fed < length) {
        uint16_t taken = mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, traffic + fed,
                                          (uint16_t)(length - fed), 0);

        assert_true(taken > 0);
        fed = (uint16_t)(fed + taken);
        while (mbm_sniffer_next(&sniffer, 0, &event)) {
            requests += event.kind == MBM_EVENT_REQUEST;
            replies += event.kind == MBM_EVENT_REPLY;
        }
    }
    assert_int_equal(requests, length / 19);
    assert_int_equal(replies, length / 19);
}

TEST(user_defined_functions_are_reported)
{
    const mbm_function own[] = {{0x55, {MBM_RULE_FIXED, 3, 0}, {MBM_RULE_COUNTED, 1, 0}}};
    mbm_function many[MBM_MAX_SNIFFER_FUNCTIONS + 1];
    mbm_framing framing = {.functions = own, .functionCount = 1};
    mbm_packet packet = {0};
    uint8_t frame[MBM_MAX_FRAME];
    uint16_t size;

    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, buffer, sizeof buffer));
    OK(mbm_sniffer_setFunctions(&sniffer, own, 1));
    packet.unit = 17;
    packet.function = 0x55;
    packet.data = (const uint8_t *)"\x01\x02";
    packet.dataLength = 2;
    OK(mbm_frame_build(&framing, &packet, frame, sizeof frame, &size));
    now = 0;
    feed(frame, size);
    assert_next("unit 17  request    55 unknown function: 01 02");
    for (size_t i = 0; i < COUNT(many); i++)
        many[i] = own[0];
    IS(MBM_INVALID_ARGUMENT, mbm_sniffer_setFunctions(&sniffer, many, COUNT(many)));
    many[0].code = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_sniffer_setFunctions(&sniffer, many, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_sniffer_setFunctions(&sniffer, NULL, 1));
    /* A refused function leaves the others as they were. */
    feed(frame, size);
    assert_next("unit 17  reply      55 unknown function: 01 02");
    OK(mbm_sniffer_setFunctions(&sniffer, NULL, 0));
}

TEST(another_delimiter_ends_ascii_frames)
{
    mbm_framing framing = {.kind = MBM_FRAMING_ASCII, .delimiter = '!'};
    mbm_packet packet = {.unit = 17, .function = 7};
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    uint16_t size;

    OK(mbm_frame_build(&framing, &packet, frame, sizeof frame, &size));
    assert_int_equal(frame[size - 1], '!');
    begin(MBM_FRAMING_ASCII);
    IS(MBM_INVALID_ARGUMENT, mbm_sniffer_setDelimiter(&sniffer, ':'));
    IS(MBM_INVALID_ARGUMENT, mbm_sniffer_setDelimiter(&sniffer, 0));
    OK(mbm_sniffer_setDelimiter(&sniffer, '!'));
    feed(frame, size);
    assert_next("unit 17  request    07 read exception status");
}

TEST(a_frame_is_explained_in_each_framing_and_refused_in_words)
{
    uint8_t kind, frame[MBM_MAX_ASCII_FRAME];
    mbm_framing framing = {0};
    char text[100];
    uint16_t length;

    for (kind = MBM_FRAMING_RTU; kind <= MBM_FRAMING_RTU_OVER_TCP; kind++) {
        framing.kind = kind;
        length = frame_of(kind, reply, sizeof reply, MBM_PACKET_RESPONSE, frame);
        OK(mbm_frame_text(&framing, MBM_PACKET_RESPONSE, frame, length, text, sizeof text));
        assert_string_equal(text, "unit 17  reply      03 read holding registers: 555 0 100");
        length = frame_of(kind, request, sizeof request, MBM_PACKET_REQUEST, frame);
        OK(mbm_frame_text(&framing, MBM_PACKET_REQUEST, frame, length, text, sizeof text));
        assert_string_equal(text, "unit 17  request    03 read holding registers  107..109");
    }
    framing.kind = MBM_FRAMING_RTU;
    OK(mbm_frame_text(&framing, MBM_PACKET_REQUEST, frame, 8, text, sizeof text));
    frame[2] ^= 1;
    OK(mbm_frame_text(&framing, MBM_PACKET_REQUEST, frame, 8, text, sizeof text));
    assert_string_equal(text, "bad CRC, 8 bytes");
    OK(mbm_frame_text(&framing, MBM_PACKET_REQUEST, frame, 3, text, sizeof text));
    assert_string_equal(text, "incomplete frame, 3 bytes");
    OK(mbm_frame_text(&framing, MBM_PACKET_REQUEST, buffer, 300, text, sizeof text));
    assert_string_equal(text, "no frame, 300 bytes");
    framing.kind = MBM_FRAMING_ASCII;
    memset(buffer, ':', sizeof buffer);
    OK(mbm_frame_text(&framing, MBM_PACKET_REQUEST, buffer, sizeof buffer, text, sizeof text));
    assert_string_equal(text, "no frame, 1026 bytes");
}

TEST(a_text_that_does_not_fit_is_cut_and_terminated)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    mbm_framing framing = {0};
    mbm_event event = {0};
    char text[57];
    uint16_t length = frame_of(MBM_FRAMING_RTU, reply, sizeof reply, MBM_PACKET_RESPONSE, frame);

    memset(text, 'x', sizeof text);
    IS(MBM_BUFFER_TOO_SMALL,
       mbm_frame_text(&framing, MBM_PACKET_RESPONSE, frame, length, text, 15));
    assert_string_equal(text, "unit 17  reply");
    assert_int_equal(text[15], 'x');
    IS(MBM_BUFFER_TOO_SMALL,
       mbm_frame_text(&framing, MBM_PACKET_RESPONSE, frame, length, text, 56));
    OK(mbm_frame_text(&framing, MBM_PACKET_RESPONSE, frame, length, text, 57));
    IS(MBM_BUFFER_TOO_SMALL, mbm_frame_text(&framing, MBM_PACKET_RESPONSE, frame, length, text, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_text(&framing, 2, frame, length, text, 57));
    assert_string_equal(text, "");
    IS(MBM_INVALID_ARGUMENT, mbm_frame_text(NULL, 0, frame, length, text, 57));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_text(&framing, 0, NULL, length, text, 57));
    IS(MBM_INVALID_ARGUMENT, mbm_frame_text(&framing, 0, frame, length, NULL, 57));
    IS(MBM_INVALID_ARGUMENT, mbm_event_text(NULL, text, 57));
    event.kind = 7;
    IS(MBM_INVALID_ARGUMENT, mbm_event_text(&event, text, 57));
    event.kind = MBM_EVENT_TIMEOUT;
    event.requestHeadLength = 200;
    OK(mbm_event_text(&event, text, 57));
}

/* Each function of the sniffer and of the trace is held to its comment in mbm.h: results, limits,
 * defaults, NULL. test_promises_values has mbm_event_text. */

static mbm_sniffer s, never;
static mbm_trace t, no_trace;
static hooked_port wire;
static mbm_port port;

static void setup(void)
{
    memset(&s, 0, sizeof s);
    memset(&never, 0, sizeof never);
    memset(&t, 0, sizeof t);
    memset(&no_trace, 0, sizeof no_trace);
    memset(&wire, 0, sizeof wire);
    port = hooked_port_of(&wire);
}

/* --- sniffer --- */

/* The framings, with the frame timeout by default in milliseconds. */
static const struct {
    uint8_t kind;
    uint32_t frameTimeout;
} sniffers[] = {{MBM_FRAMING_RTU, 199},
                {MBM_FRAMING_ASCII, 1000},
                {MBM_FRAMING_TCP, 1000},
                {MBM_FRAMING_RTU_OVER_TCP, 199}};

static uint32_t now; /* of the promised */

/* Feeds the first bytes of a request, at most `most`, and returns the milliseconds until the first
 * event of one of two kinds. */
static uint32_t event_after(uint8_t framing, uint16_t most, uint8_t kind, uint8_t other)
{
    const mbm_framing as = {.kind = framing};
    mbm_packet packet = {.unit = 17, .function = MBM_FC_READ_COILS, .quantity = 1};
    uint8_t bytes[32];
    uint16_t length;
    mbm_event event;

    OK(mbm_frame_build(&as, &packet, bytes, sizeof bytes, &length));
    if (length > most)
        length = most;
    now += 100000000;
    assert_int_equal(mbm_sniffer_feed(&s, MBM_DIRECTION_BOTH, bytes, length, now), length);
    for (uint32_t ms = 0; ms < 70000; ms++, now += 1000)
        while (mbm_sniffer_next(&s, now, &event))
            if (event.kind == kind || event.kind == other)
                return ms;
    fail();
    return 0;
}

static uint32_t response_timeout(uint8_t framing)
{
    return event_after(framing, UINT16_MAX, MBM_EVENT_TIMEOUT, MBM_EVENT_TIMEOUT);
}

static uint32_t frame_timeout(uint8_t framing)
{
    return event_after(framing, 4, MBM_EVENT_BAD_CRC, MBM_EVENT_NOISE);
}

TEST_WITH(a_sniffer_begins_in_every_framing_or_changes_nothing, setup, NULL)
{
    for (unsigned i = 0; i < COUNT(sniffers); i++) {
        setup();
        OK(mbm_sniffer_begin(&s, sniffers[i].kind, buffer, MBM_MIN_SNIFFER_BUFFER));
        IS(MBM_INVALID_ARGUMENT, mbm_sniffer_begin(NULL, sniffers[i].kind, buffer, 300));
        INVALID(s, mbm_sniffer_begin(&s, sniffers[i].kind, NULL, 300));
        REFUSED(MBM_BUFFER_TOO_SMALL, s,
                mbm_sniffer_begin(&s, sniffers[i].kind, buffer, MBM_MIN_SNIFFER_BUFFER - 1));
        INVALID(s, mbm_sniffer_begin(&s, MBM_FRAMING_NONE, buffer, 300));
        INVALID(s, mbm_sniffer_begin(&s, 255, buffer, 300));
        OK(mbm_sniffer_begin(&s, sniffers[i].kind, buffer, 300));
        assert_int_equal(response_timeout(sniffers[i].kind), 1000);
        assert_int_equal(frame_timeout(sniffers[i].kind), sniffers[i].frameTimeout);
        OK(mbm_sniffer_setResponseTimeout(&s, 5));
        OK(mbm_sniffer_setFrameTimeout(&s, 300));
        assert_int_equal(response_timeout(sniffers[i].kind), 5);
        assert_int_equal(frame_timeout(sniffers[i].kind), 300);
        OK(mbm_sniffer_begin(&s, sniffers[i].kind, buffer, 300));
        assert_int_equal(response_timeout(sniffers[i].kind), 1000);
        assert_int_equal(frame_timeout(sniffers[i].kind), sniffers[i].frameTimeout);
    }
}

TEST_WITH(times_and_declarations_of_a_sniffer_have_limits, setup, NULL)
{
    static const mbm_function wrong = {.code = 200};
    mbm_function right[MBM_MAX_SNIFFER_FUNCTIONS + 1];

    memset(right, 0, sizeof right);
    for (unsigned i = 0; i < COUNT(right); i++)
        right[i].code = (uint8_t)(65 + i);
    OK(mbm_sniffer_begin(&s, MBM_FRAMING_RTU, buffer, 300));
    INVALID(s, mbm_sniffer_setResponseTimeout(&s, 0));
    INVALID(s, mbm_sniffer_setResponseTimeout(&s, 65536));
    INVALID(s, mbm_sniffer_setFrameTimeout(&s, 0));
    INVALID(s, mbm_sniffer_setFrameTimeout(&s, 65536));
    OK(mbm_sniffer_setResponseTimeout(&s, 65535));
    assert_int_equal(response_timeout(MBM_FRAMING_RTU), 65535);
    OK(mbm_sniffer_setFrameTimeout(&s, 65535));
    assert_int_equal(frame_timeout(MBM_FRAMING_RTU), 65535);
    OK(mbm_sniffer_setBaudRate(&s, 9600));
    OK(mbm_sniffer_setBaudRate(&s, 0));
    OK(mbm_sniffer_setFunctions(&s, NULL, 0));
    OK(mbm_sniffer_setFunctions(&s, right, MBM_MAX_SNIFFER_FUNCTIONS));
    INVALID(s, mbm_sniffer_setFunctions(&s, right, MBM_MAX_SNIFFER_FUNCTIONS + 1));
    INVALID(s, mbm_sniffer_setFunctions(&s, NULL, 1));
    INVALID(s, mbm_sniffer_setFunctions(&s, &wrong, 1));
    INVALID(s, mbm_sniffer_setDelimiter(&s, ':'));
    for (unsigned i = 0; i < 256; i++) {
        int is_digit = (i >= '0' && i <= '9') || (i >= 'A' && i <= 'F') || (i >= 'a' && i <= 'f');

        OK(mbm_sniffer_begin(&s, MBM_FRAMING_ASCII, buffer, 300));
        IS(i == 0 || i > 127 || i == '\r' || i == ':' || is_digit ? MBM_INVALID_ARGUMENT : MBM_OK,
           mbm_sniffer_setDelimiter(&s, (uint8_t)i));
    }
}

TEST_WITH(a_sniffer_that_was_never_begun_reports_nothing, setup, NULL)
{
    mbm_sniffer *const both[] = {NULL, &never};
    mbm_event event;

    for (unsigned i = 0; i < COUNT(both); i++) {
        uint8_t status = both[i] == NULL ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        IS(status, mbm_sniffer_setResponseTimeout(both[i], 1));
        IS(status, mbm_sniffer_setFrameTimeout(both[i], 1));
        IS(status, mbm_sniffer_setBaudRate(both[i], 1));
        IS(status, mbm_sniffer_setFunctions(both[i], NULL, 0));
        IS(status, mbm_sniffer_setDelimiter(both[i], '\n'));
        assert_int_equal(mbm_sniffer_feed(both[i], 0, buffer, 4, 0), 0);
        memset(&event, 0x77, sizeof event);
        REFUSED(0, event, mbm_sniffer_next(both[i], 0, &event));
    }
    OK(mbm_sniffer_begin(&s, MBM_FRAMING_RTU, buffer, 300));
    REFUSED(0, event, mbm_sniffer_next(&s, 0, &event));
    assert_int_equal(mbm_sniffer_next(&s, 0, NULL), 0);
    assert_int_equal(mbm_sniffer_feed(&s, 0, NULL, 0, 0), 0);
}

/* --- trace --- */

static unsigned records;

static void hook(void *context, const mbm_traceRecord *record)
{
    records++;
}

/* The milliseconds until the trace hands out the beginning of a frame. */
static uint32_t trace_timeout(void)
{
    const mbm_port *traced = mbm_trace_port(&t);
    uint8_t bytes[8];
    uint32_t ms;

    hooked_port_arrive(&wire, "\0\1\0\0", 4);
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 4);
    records = 0;
    for (ms = 0; records == 0; ms++, wire.now += 1000)
        assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 0);
    return ms - 1;
}

TEST_WITH(a_trace_begins_or_changes_nothing, setup, NULL)
{
    static const uint8_t kinds[] = {MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
    static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU}, none = {.kind = MBM_FRAMING_NONE};
    mbm_port lacking;

    for (unsigned i = 0; i < COUNT(kinds); i++) {
        const uint8_t kind = kinds[i];

        setup();
        OK(mbm_trace_begin(&t, kind, &port, &rtu, buffer, MBM_MIN_TRACE_BUFFER, hook, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_trace_begin(NULL, kind, &port, &rtu, buffer, 600, hook, NULL));
        INVALID(t, mbm_trace_begin(&t, kind, NULL, &rtu, buffer, 600, hook, NULL));
        INVALID(t, mbm_trace_begin(&t, kind, &port, NULL, buffer, 600, hook, NULL));
        INVALID(t, mbm_trace_begin(&t, kind, &port, &none, buffer, 600, hook, NULL));
        INVALID(t, mbm_trace_begin(&t, kind, &port, &rtu, NULL, 600, hook, NULL));
        INVALID(t, mbm_trace_begin(&t, kind, &port, &rtu, buffer, 600, NULL, NULL));
        REFUSED(
            MBM_BUFFER_TOO_SMALL, t,
            mbm_trace_begin(&t, kind, &port, &rtu, buffer, MBM_MIN_TRACE_BUFFER - 1, hook, NULL));
        INVALID(t, mbm_trace_begin(&t, kind, mbm_trace_port(&t), &rtu, buffer, 600, hook, NULL));
        lacking = port;
        lacking.write = NULL;
        INVALID(t, mbm_trace_begin(&t, kind, &lacking, &rtu, buffer, 600, hook, NULL));
        assert_non_null(mbm_trace_port(&t));
        INVALID(t, mbm_trace_begin(&t, MBM_PACKET_EXCEPTION, &port, &rtu, buffer, 600, hook, NULL));
        assert_int_equal(trace_timeout(), 200);
        OK(mbm_trace_setFrameTimeout(&t, 65535));
        assert_int_equal(trace_timeout(), 65535);
        INVALID(t, mbm_trace_setFrameTimeout(&t, 0));
        INVALID(t, mbm_trace_setFrameTimeout(&t, 65536));
        OK(mbm_trace_flush(&t));
        OK(mbm_trace_begin(&t, kind, &port, FRAMING(MBM_FRAMING_TCP), buffer, 600, hook, NULL));
        assert_int_equal(trace_timeout(), 1000);
    }
}

TEST_WITH(a_trace_that_was_never_begun_has_no_port, setup, NULL)
{
    mbm_trace *const both[] = {NULL, &no_trace};
    mbm_traceRecord record;
    mbm_event event;

    for (unsigned i = 0; i < COUNT(both); i++) {
        uint8_t status = both[i] == NULL ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        assert_null(mbm_trace_port(both[i]));
        IS(status, mbm_trace_setFrameTimeout(both[i], 1));
        IS(status, mbm_trace_flush(both[i]));
    }
    memset(&record, 0x77, sizeof record);
    event = (mbm_event){.kind = MBM_EVENT_TIMEOUT};
    INVALID(record, mbm_trace_ofEvent(&event, &record));
    INVALID(record, mbm_trace_ofEvent(NULL, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_trace_ofEvent(&event, NULL));
}
