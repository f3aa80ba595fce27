/* Each function of the sniffer and of the trace is held to its comment in mbm.h: results, limits,
 * defaults, NULL. test_promises_frame has mbm_event_text. */
#include "refused.h"
#include "hooked_port.h"
#include "mbm.h"
#include "test.h"

#include <string.h>

static mbm_sniffer s, never;
static mbm_trace t, no_trace;
static hooked_port wire;
static mbm_port port;
static uint8_t buffer[2 * MBM_MAX_ASCII_FRAME];

static void setup(void)
{
    memset(&s, 0, sizeof s);
    memset(&never, 0, sizeof never);
    memset(&t, 0, sizeof t);
    memset(&no_trace, 0, sizeof no_trace);
    memset(&wire, 0, sizeof wire);
    port = hooked_port_of(&wire);
}

fixture each_test = {setup, NULL};

/* --- sniffer --- */

/* The framings, with the frame timeout by default in milliseconds. */
static const struct {
    uint8_t kind;
    uint32_t frameTimeout;
} sniffers[] = {{MBM_FRAMING_RTU, 199},
                {MBM_FRAMING_ASCII, 1000},
                {MBM_FRAMING_TCP, 1000},
                {MBM_FRAMING_RTU_OVER_TCP, 199}};

static uint32_t now; /* of the sniffer */

/* Feeds the first bytes of a request, of which there are at most `most`, and returns the
 * milliseconds until the first event of one of two kinds. */
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

TEST(a_sniffer_begins_in_every_framing_or_changes_nothing)
{
    for (unsigned i = 0; i < COUNT(sniffers); i++) {
        setup();
        OK(mbm_sniffer_begin(&s, sniffers[i].kind, buffer, MBM_MIN_SNIFFER_BUFFER));
        IS(MBM_INVALID_ARGUMENT, mbm_sniffer_begin(NULL, sniffers[i].kind, buffer, 300));
        REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_begin(&s, sniffers[i].kind, NULL, 300));
        REFUSED(MBM_BUFFER_TOO_SMALL, s,
                mbm_sniffer_begin(&s, sniffers[i].kind, buffer, MBM_MIN_SNIFFER_BUFFER - 1));
        REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_begin(&s, MBM_FRAMING_NONE, buffer, 300));
        REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_begin(&s, 255, buffer, 300));
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

TEST(times_and_declarations_of_a_sniffer_have_limits)
{
    static const mbm_function wrong = {.code = 200};
    mbm_function right[MBM_MAX_SNIFFER_FUNCTIONS + 1];

    memset(right, 0, sizeof right);
    for (unsigned i = 0; i < COUNT(right); i++)
        right[i].code = (uint8_t)(65 + i);
    OK(mbm_sniffer_begin(&s, MBM_FRAMING_RTU, buffer, 300));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setResponseTimeout(&s, 0));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setResponseTimeout(&s, 65536));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setFrameTimeout(&s, 0));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setFrameTimeout(&s, 65536));
    OK(mbm_sniffer_setResponseTimeout(&s, 65535));
    assert_int_equal(response_timeout(MBM_FRAMING_RTU), 65535);
    OK(mbm_sniffer_setFrameTimeout(&s, 65535));
    assert_int_equal(frame_timeout(MBM_FRAMING_RTU), 65535);
    OK(mbm_sniffer_setBaudRate(&s, 9600));
    OK(mbm_sniffer_setBaudRate(&s, 0));
    OK(mbm_sniffer_setFunctions(&s, NULL, 0));
    OK(mbm_sniffer_setFunctions(&s, right, MBM_MAX_SNIFFER_FUNCTIONS));
    REFUSED(MBM_INVALID_ARGUMENT, s,
            mbm_sniffer_setFunctions(&s, right, MBM_MAX_SNIFFER_FUNCTIONS + 1));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setFunctions(&s, NULL, 1));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setFunctions(&s, &wrong, 1));
    REFUSED(MBM_INVALID_ARGUMENT, s, mbm_sniffer_setDelimiter(&s, ':'));
    for (unsigned i = 0; i < 256; i++) {
        int is_digit = (i >= '0' && i <= '9') || (i >= 'A' && i <= 'F') || (i >= 'a' && i <= 'f');

        OK(mbm_sniffer_begin(&s, MBM_FRAMING_ASCII, buffer, 300));
        IS(i == 0 || i > 127 || i == '\r' || i == ':' || is_digit ? MBM_INVALID_ARGUMENT : MBM_OK,
           mbm_sniffer_setDelimiter(&s, (uint8_t)i));
    }
}

TEST(a_sniffer_that_was_never_begun_reports_nothing)
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
    (void)context;
    (void)record;
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

TEST(a_trace_begins_or_changes_nothing)
{
    static const uint8_t kinds[] = {MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
    static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU}, none = {.kind = MBM_FRAMING_NONE};
    mbm_port lacking;

    for (unsigned i = 0; i < COUNT(kinds); i++) {
        const uint8_t kind = kinds[i];

        setup();
        OK(mbm_trace_begin(&t, kind, &port, &rtu, buffer, MBM_MIN_TRACE_BUFFER, hook, NULL));
        IS(MBM_INVALID_ARGUMENT, mbm_trace_begin(NULL, kind, &port, &rtu, buffer, 600, hook, NULL));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, NULL, &rtu, buffer, 600, hook, NULL));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, &port, NULL, buffer, 600, hook, NULL));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, &port, &none, buffer, 600, hook, NULL));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, &port, &rtu, NULL, 600, hook, NULL));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, &port, &rtu, buffer, 600, NULL, NULL));
        REFUSED(
            MBM_BUFFER_TOO_SMALL, t,
            mbm_trace_begin(&t, kind, &port, &rtu, buffer, MBM_MIN_TRACE_BUFFER - 1, hook, NULL));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, mbm_trace_port(&t), &rtu, buffer, 600, hook, NULL));
        lacking = port;
        lacking.write = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, kind, &lacking, &rtu, buffer, 600, hook, NULL));
        assert_non_null(mbm_trace_port(&t));
        REFUSED(MBM_INVALID_ARGUMENT, t,
                mbm_trace_begin(&t, MBM_PACKET_EXCEPTION, &port, &rtu, buffer, 600, hook, NULL));
        assert_int_equal(trace_timeout(), 200);
        OK(mbm_trace_setFrameTimeout(&t, 65535));
        assert_int_equal(trace_timeout(), 65535);
        REFUSED(MBM_INVALID_ARGUMENT, t, mbm_trace_setFrameTimeout(&t, 0));
        REFUSED(MBM_INVALID_ARGUMENT, t, mbm_trace_setFrameTimeout(&t, 65536));
        OK(mbm_trace_flush(&t));
        OK(mbm_trace_begin(&t, kind, &port, FRAMING(MBM_FRAMING_TCP), buffer, 600, hook, NULL));
        assert_int_equal(trace_timeout(), 1000);
    }
}

TEST(a_trace_that_was_never_begun_has_no_port)
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
    memset(&event, 0, sizeof event);
    event.kind = MBM_EVENT_TIMEOUT;
    REFUSED(MBM_INVALID_ARGUMENT, record, mbm_trace_ofEvent(&event, &record));
    REFUSED(MBM_INVALID_ARGUMENT, record, mbm_trace_ofEvent(NULL, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_trace_ofEvent(&event, NULL));
}
