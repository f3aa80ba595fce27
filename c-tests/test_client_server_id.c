/* The client reads server ids from devices whose byte count covers all data, and from
 * devices whose byte count covers the id alone, over RTU and RTU over TCP. */
#include "sim.h"
#include "test.h"

#include <string.h>

enum { CHARACTER = 100, DELAY = 3000 };

/* A device with a clock of its own, which gives each request the same response. */
typedef struct device {
    uint32_t now, end; /* microseconds; when the last byte of the response has arrived */
    uint8_t answer[64];
    size_t length, read;
} device;

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    device *d = (device *)context;
    uint16_t count = 0;

    while (d->end != 0 && count < capacity && d->read < d->length &&
           d->now >= d->end - CHARACTER * (uint32_t)(d->length - d->read - 1))
        bytes[count++] = d->answer[d->read++];
    return (int16_t)count;
}

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    device *d = (device *)context;

    assert_int_equal(length, 4);
    assert_int_equal(bytes[1], 0x11);
    d->end = d->now + DELAY + CHARACTER * (uint32_t)d->length;
    return (int16_t)length;
}

static uint32_t micros(void *context)
{
    return ((device *)context)->now += 10;
}

typedef uint8_t (*begin_function)(mbm_client *, const mbm_port *, uint8_t *, uint16_t);

static const begin_function framings[] = {mbm_client_beginRtu, mbm_client_beginRtuOverTcp};

static uint8_t reply[64];
static mbm_clientRequest request;
static device d;

/* Reads the server id of unit 17, which responds with these bytes. Returns the request's
 * status. */
static uint8_t report(begin_function begin, uint16_t capacity, const char *answer)
{
    static mbm_client client;
    static uint8_t frame[MBM_MAX_FRAME];
    mbm_port port = {0};

    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(reply, 0xEE, sizeof reply);
    memset(&d, 0, sizeof d);
    d.length = sim_bytes(d.answer, answer);
    port.context = &d;
    port.read = read_bytes;
    port.write = write_bytes;
    port.micros = micros;
    request.unit = 17;
    request.reply = reply;
    request.replyBytes = capacity;
    OK(begin(&client, &port, frame, sizeof frame));
    IS(MBM_PENDING, mbm_client_reportServerId(&client, &request));
    while (request.status == MBM_PENDING)
        (void)mbm_client_poll(&client);
    return request.status;
}

static void assert_report(const char *answer, const char *data)
{
    uint8_t expected[64];
    size_t length = sim_bytes(expected, data), i;

    for (i = 0; i < COUNT(framings); i++) {
        OK(report(framings[i], sizeof reply, answer));
        assert_int_equal(request.length, length);
        assert_memory_equal(reply, expected, length);
    }
}

TEST(a_server_id_whose_byte_count_covers_all_data_is_read)
{
    assert_report("11 11 03 01 02 FF +", "01 02 FF");
    assert_report("11 11 00 +", "");
    assert_report("11 11 0A 01 02 03 04 05 06 07 08 09 FF +", "01 02 03 04 05 06 07 08 09 FF");
}

TEST(a_server_id_whose_byte_count_covers_less_is_read_whole)
{
    assert_report("11 11 02 01 02 FF 07 08 +", "01 02 FF 07 08");
    assert_report("11 11 01 2A FF +", "2A FF");
    assert_report("11 11 00 2A FF +", "2A FF");
}

TEST(a_server_id_is_found_in_noise)
{
    assert_report("FF 00 55 / 11 11 02 01 02 FF 07 08 +", "01 02 FF 07 08");
    assert_report("12 11 02 01 02 + / 11 11 02 01 FF +", "01 FF");
    /* Noise after a response with a right byte count does not hide it. */
    assert_report("11 11 02 01 FF + / 00 00 00", "01 FF");
}

TEST(a_server_id_with_a_right_byte_count_ends_without_a_wait)
{
    OK(report(mbm_client_beginRtuOverTcp, sizeof reply, "11 11 02 01 FF +"));
    assert_in_range(d.now, d.end, d.end + 1000);
}

TEST(a_wrong_server_id_is_refused)
{
    for (size_t i = 0; i < COUNT(framings); i++) {
        begin_function begin = framings[i];

        /* The byte count is larger than the data. */
        assert_int_not_equal(report(begin, sizeof reply, "11 11 06 01 02 FF 07 08 +"), MBM_OK);
        /* The CRC is wrong. */
        assert_int_not_equal(report(begin, sizeof reply, "11 11 02 01 02 FF 07 08 00 00"), MBM_OK);
        /* An exception response. */
        IS(MBM_ILLEGAL_FUNCTION, report(begin, sizeof reply, "11 91 01 +"));
        /* The data do not fit. */
        IS(MBM_BUFFER_TOO_SMALL, report(begin, 4, "11 11 02 01 02 FF 07 08 +"));
        assert_int_equal(reply[0], 0xEE);
    }
}
