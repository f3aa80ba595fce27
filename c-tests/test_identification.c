/* mbm_identification: reading all objects of a device that the test plays, reply by reply,
 * and devices that never come to an end. */
#include "sim.h"
#include "memory_port.h"
#include "test.h"

enum { UNIT = 7, REPLIES = 300, OBJECTS = 64 };

static memory_port m;
static mbm_client client;
static mbm_identification id;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME], reply[250];

static uint8_t ids[OBJECTS], values[OBJECTS][8], lengths[OBJECTS];
static unsigned handed, ended, asked;
static uint8_t requested[REPLIES];
static void (*in_object)(void);

static void take(void *context, const mbm_object *object)
{
    assert_ptr_equal(context, &handed);
    if (handed < OBJECTS) {
        ids[handed] = object->id;
        lengths[handed] = object->length;
        memcpy(values[handed], object->data, object->length < 8 ? object->length : 8);
    }
    handed++;
    assert_int_equal(id.count, handed);
    if (in_object)
        in_object();
}

static void end(void *context, mbm_identification *identification)
{
    assert_ptr_equal(context, &handed);
    assert_ptr_equal(identification, &id);
    assert_int_not_equal(id.request.status, MBM_PENDING);
    ended++;
}

static void begin_port(void)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
}

static void begin(void)
{
    begin_port();
    memset(&id, 0, sizeof id);
    handed = ended = asked = 0;
    in_object = NULL;
    id.request.unit = UNIT;
    id.request.reply = reply;
    id.request.replyBytes = sizeof reply;
    id.object = take;
    id.done = end;
    id.context = &handed;
}

fixture each_test = {begin, NULL};

/* Waits until a request is sent, and lets a reply arrive. `objects` are the bytes after the
 * number of objects. */
static void answer(uint8_t more, uint8_t next, uint8_t count, const char *objects, size_t bytes)
{
    const mbm_framing framing = {.kind = MBM_FRAMING_TCP};
    mbm_packet packet;

    memory_port_send(&m, &client);
    OK(mbm_frame_parse(&framing, MBM_PACKET_REQUEST, m.sent, (uint16_t)m.sent_count, &packet));
    assert_int_equal(packet.function, 0x2B);
    assert_int_equal(packet.meiType, 0x0E);
    assert_int_equal(packet.unit, UNIT);
    requested[asked++] = packet.objectId;
    assert_true(asked < REPLIES);

    {
        const uint8_t head[] = {m.sent[0], m.sent[1],
                                0,         0,
                                0,         (uint8_t)(bytes + 8),
                                UNIT,      0x2B,
                                0x0E,      packet.readDeviceIdCode,
                                0x83,      more,
                                next,      count};

        memory_port_bytes(&m, head, sizeof head);
    }
    memory_port_bytes(&m, (const uint8_t *)objects, bytes);
    m.sent_count = 0;
    (void)mbm_client_poll(&client);
}

#define ANSWER(more, next, count, objects) answer(more, next, count, objects, sizeof objects - 1)

static void read_all(uint8_t code)
{
    IS(MBM_PENDING, mbm_identification_read(&id, &client, code, 0));
}

static void assert_ended(uint8_t status, unsigned objects)
{
    assert_int_equal(id.request.status, status);
    assert_int_equal(handed, objects);
    assert_int_equal(ended, 1);
    assert_int_equal(mbm_client_pending(&client), 0);
}

TEST(all_objects_are_read_with_as_many_requests_as_it_takes)
{
    read_all(MBM_DEVICE_ID_EXTENDED);
    ANSWER(0xFF, 2, 2, "\x00\x03mbm\x01\x00");
    assert_int_equal(handed, 2);
    IS(MBM_PENDING, id.request.status);
    ANSWER(0xFF, 0x80, 1, "\x02\x01v");
    ANSWER(0, 0, 1, "\xFF\x02\x00\x01");
    assert_ended(MBM_OK, 4);
    assert_int_equal(id.conformity, 0x83);
    assert_memory_equal(ids, "\x00\x01\x02\xFF", 4);
    assert_memory_equal(lengths, "\x03\x00\x01\x02", 4);
    assert_memory_equal(values[0], "mbm", 3);
    assert_memory_equal(values[3], "\x00\x01", 2);
    assert_memory_equal(requested, "\x00\x02\x80", 3);

    /* Once more with the same storage. */
    handed = ended = 0;
    id.object = NULL;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0, 0, 1, "\x00\x01m");
    assert_ended(MBM_OK, 0);
    assert_int_equal(id.count, 1);
}

TEST(one_object_is_read_alone)
{
    IS(MBM_PENDING, mbm_identification_read(&id, &client, MBM_DEVICE_ID_INDIVIDUAL, 4));
    ANSWER(0, 0, 1, "\x04\x01n");
    assert_ended(MBM_OK, 1);
    assert_int_equal(requested[0], 4);
}

TEST(another_object_than_the_one_requested_alone_is_malformed)
{
    IS(MBM_PENDING, mbm_identification_read(&id, &client, MBM_DEVICE_ID_INDIVIDUAL, 4));
    ANSWER(0, 0, 1, "\x03\x01n");
    assert_ended(MBM_MALFORMED_REPLY, 0);
}

TEST(a_device_that_lacks_the_first_object_may_begin_with_its_first)
{
    IS(MBM_PENDING, mbm_identification_read(&id, &client, MBM_DEVICE_ID_REGULAR, 5));
    ANSWER(0, 0, 2, "\x01\x01n\x00\x01m");
    assert_ended(MBM_OK, 2);
}

TEST(the_same_next_object_forever_is_no_progress)
{
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 1, 1, "\x00\x01m");
    ANSWER(0xFF, 1, 1, "\x01\x01n"); /* it names the object that it has just sent */
    assert_ended(MBM_NO_PROGRESS, 2);
    assert_memory_equal(ids, "\x00\x01", 2);

    begin();
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 0, 1, "\x00\x01m");
    assert_ended(MBM_NO_PROGRESS, 1);
}

TEST(a_next_object_before_those_received_is_no_progress)
{
    read_all(MBM_DEVICE_ID_EXTENDED);
    ANSWER(0xFF, 0x80, 1, "\x00\x01m");
    ANSWER(0xFF, 3, 1, "\x81\x01n");
    assert_ended(MBM_NO_PROGRESS, 2);
}

TEST(objects_that_were_sent_before_are_not_handed_out_again)
{
    read_all(MBM_DEVICE_ID_EXTENDED);
    ANSWER(0xFF, 2, 2, "\x00\x01m\x01\x01n");
    /* It does not know the object that it named, and begins again. */
    ANSWER(0xFF, 2, 2, "\x00\x01m\x01\x01n");
    assert_ended(MBM_NO_PROGRESS, 2);

    /* It sends an object that is new, but before the one that it named. */
    begin();
    read_all(MBM_DEVICE_ID_EXTENDED);
    ANSWER(0xFF, 5, 1, "\x00\x01m");
    ANSWER(0xFF, 3, 1, "\x02\x01v");
    assert_ended(MBM_NO_PROGRESS, 1);

    /* An object in two parts. */
    begin();
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 1, 1, "\x00\x02mb");
    ANSWER(0, 0, 2, "\x00\x01m\x01\x01n");
    assert_ended(MBM_NO_PROGRESS, 1);
}

TEST(no_object_although_more_follow_is_no_progress)
{
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 1, 0, "");
    assert_ended(MBM_NO_PROGRESS, 0);

    begin();
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0, 0, 0, "");
    assert_ended(MBM_OK, 0);
}

/* The client asks at most once for each of the 256 objects, whatever the device answers. */
TEST(a_device_that_names_every_object_is_asked_256_times)
{
    char object[] = "?\x01x";

    read_all(MBM_DEVICE_ID_EXTENDED);
    for (unsigned next = 0; next < 256; next++) {
        object[0] = (char)next;
        ANSWER(0xFF, (uint8_t)(next + 1), 1, object);
    }
    assert_int_equal(asked, 256);
    assert_ended(MBM_NO_PROGRESS, 256);
}

TEST(an_object_that_is_cut_off_is_malformed)
{
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 1, 1, "\x00\x01m");
    ANSWER(0, 0, 2, "\x01\x01n\x02\x05v");
    assert_ended(MBM_MALFORMED_REPLY, 1);

    begin();
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0, 0, 1, "\x00\x01m\x01\x01n"); /* one more than it counts */
    assert_ended(MBM_MALFORMED_REPLY, 0);

    begin();
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0x01, 1, 1, "\x00\x01m"); /* neither 00 nor FF */
    assert_ended(MBM_MALFORMED_REPLY, 0);
}

TEST(an_exception_ends_it_with_that_status)
{
    uint8_t frame[] = {0, 0, 0, 0, 0, 3, UNIT, 0xAB, MBM_ILLEGAL_DATA_ADDRESS};

    read_all(MBM_DEVICE_ID_REGULAR);
    ANSWER(0xFF, 3, 1, "\x02\x01v");
    memory_port_send(&m, &client);
    memcpy(frame, m.sent, 2);
    memory_port_bytes(&m, frame, sizeof frame);
    (void)mbm_client_poll(&client);
    assert_ended(MBM_ILLEGAL_DATA_ADDRESS, 1);
    IS(MBM_ILLEGAL_DATA_ADDRESS, id.request.exception);
}

TEST(a_device_that_falls_silent_ends_it_with_a_timeout)
{
    OK(mbm_client_setRetries(&client, 1));
    read_all(MBM_DEVICE_ID_REGULAR);
    ANSWER(0xFF, 3, 1, "\x02\x01v");
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &id.request, 1000));
    assert_ended(MBM_RESPONSE_TIMED_OUT, 1);
}

TEST(a_reply_that_does_not_fit_ends_it)
{
    id.request.replyBytes = 9;
    read_all(MBM_DEVICE_ID_REGULAR);
    ANSWER(0xFF, 1, 1, "\x00\x03mbm");
    ANSWER(0, 0, 1, "\x01\x04name");
    assert_ended(MBM_BUFFER_TOO_SMALL, 1);
}

static mbm_clientRequest others[MBM_CLIENT_DEPTH];

static void fill_the_queue(void)
{
    for (unsigned i = 0; i < MBM_CLIENT_DEPTH; i++) {
        others[i].unit = UNIT;
        (void)mbm_client_writeSingleCoil(&client, &others[i], 0, 1);
    }
    assert_int_equal(mbm_client_pending(&client), MBM_CLIENT_DEPTH);
}

TEST(others_may_fill_the_queue_meanwhile)
{
    OK(mbm_client_setInFlight(&client, 1));
    in_object = fill_the_queue;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 1, 1, "\x00\x01m");
    in_object = NULL;
    IS(MBM_PENDING, id.request.status);
    ANSWER(0, 0, 1, "\x01\x01n");
    OK(id.request.status);
    assert_int_equal(handed, 2);
    assert_int_equal(ended, 1);
}

/* After the last reply there is nothing to cancel. */
static void cancel(void)
{
    (void)mbm_client_cancel(&client, &id.request);
}

TEST(cancelling_in_object_ends_the_calls)
{
    in_object = cancel;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 2, 2, "\x00\x01m\x01\x01n");
    IS(MBM_CANCELLED, id.request.status);
    assert_int_equal(handed, 1);
    assert_int_equal(ended, 0);
    assert_int_equal(mbm_client_pending(&client), 0);

    begin();
    in_object = cancel;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0, 0, 2, "\x00\x01m\x01\x01n");
    assert_ended(MBM_OK, 2);
}

TEST(it_may_be_cancelled_between_two_replies)
{
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 2, 1, "\x00\x01m");
    OK(mbm_client_cancel(&client, &id.request));
    IS(MBM_CANCELLED, id.request.status);
    (void)mbm_client_poll(&client);
    assert_int_equal(ended, 0);
    read_all(MBM_DEVICE_ID_BASIC);
}

TEST(beginning_the_client_again_gives_it_up)
{
    in_object = begin_port;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0xFF, 2, 2, "\x00\x01m\x01\x01n");
    IS(MBM_CANCELLED, id.request.status);
    assert_int_equal(handed, 1);
    assert_int_equal(ended, 0);
    in_object = NULL;
    handed = 0;
    read_all(MBM_DEVICE_ID_BASIC);
}

static void spoil_the_reply(void)
{
    memset(reply, 0xFF, sizeof reply);
}

TEST(overwriting_the_reply_in_object_harms_nothing)
{
    in_object = spoil_the_reply;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0, 0, 2, "\x00\x01m\x01\x01n");
    assert_ended(MBM_OK, 1);
}

static void refuses(uint8_t status)
{
    const mbm_identification before = id;

    IS(status, mbm_identification_read(&id, &client, MBM_DEVICE_ID_BASIC, 0));
    assert_memory_equal(&id, &before, sizeof id);
}

static void read_again(void)
{
    refuses(MBM_BUSY);
}

TEST(it_is_busy_while_it_is_pending_and_in_its_object)
{
    read_all(MBM_DEVICE_ID_BASIC);
    refuses(MBM_BUSY);
    in_object = read_again;
    ANSWER(0xFF, 1, 1, "\x00\x01m");
    ANSWER(0, 0, 1, "\x01\x01n");
    assert_ended(MBM_OK, 2);
}

TEST(wrong_arguments_change_nothing)
{
    id.request.unit = 256;
    refuses(MBM_INVALID_ARGUMENT);
    id.request.unit = UNIT;
    fill_the_queue();
    refuses(MBM_QUEUE_FULL);
    assert_int_equal(ended, 0);
}

static void read_the_next(void *context, mbm_identification *identification)
{
    ended++;
    if (ended == 1)
        IS(MBM_PENDING, mbm_identification_read(identification, &client, MBM_DEVICE_ID_REGULAR, 3));
}

TEST(done_may_read_the_next)
{
    id.done = read_the_next;
    read_all(MBM_DEVICE_ID_BASIC);
    ANSWER(0, 0, 1, "\x00\x01m");
    IS(MBM_PENDING, id.request.status);
    handed = 0;
    ANSWER(0, 0, 1, "\x03\x01u");
    assert_int_equal(ended, 2);
    OK(id.request.status);
    assert_memory_equal(requested, "\x00\x03", 2);
}

/* The client reads server ids from devices whose byte count covers all data, and from
 * devices whose byte count covers the id alone, over RTU and RTU over TCP. */

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

static uint8_t id_reply[64];
static mbm_clientRequest request;
static device d;

/* Reads the server id of unit 17, which responds with these bytes. Returns the request's
 * status. */
static uint8_t report(begin_function begins, uint16_t capacity, const char *answer)
{
    static mbm_client asking;
    static uint8_t frame[MBM_MAX_FRAME];
    mbm_port port = {0};

    memset(&asking, 0, sizeof asking);
    memset(id_reply, 0xEE, sizeof id_reply);
    memset(&d, 0, sizeof d);
    d.length = sim_bytes(d.answer, answer);
    port.context = &d;
    port.read = read_bytes;
    port.write = write_bytes;
    port.micros = micros;
    request = (mbm_clientRequest){.unit = 17, .reply = id_reply, .replyBytes = capacity};
    OK(begins(&asking, &port, frame, sizeof frame));
    IS(MBM_PENDING, mbm_client_reportServerId(&asking, &request));
    while (request.status == MBM_PENDING)
        (void)mbm_client_poll(&asking);
    return request.status;
}

static void assert_report(const char *answer, const char *data)
{
    uint8_t expected[64];
    size_t length = sim_bytes(expected, data), i;

    for (i = 0; i < COUNT(framings); i++) {
        OK(report(framings[i], sizeof id_reply, answer));
        assert_int_equal(request.length, length);
        assert_memory_equal(id_reply, expected, length);
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
    OK(report(mbm_client_beginRtuOverTcp, sizeof id_reply, "11 11 02 01 FF +"));
    assert_in_range(d.now, d.end, d.end + 1000);
}

TEST(a_wrong_server_id_is_refused)
{
    for (size_t i = 0; i < COUNT(framings); i++) {
        begin_function begins = framings[i];

        /* The byte count is larger than the data. */
        assert_int_not_equal(report(begins, sizeof id_reply, "11 11 06 01 02 FF 07 08 +"), MBM_OK);
        /* The CRC is wrong. */
        assert_int_not_equal(report(begins, sizeof id_reply, "11 11 02 01 02 FF 07 08 00 00"),
                             MBM_OK);
        /* An exception response. */
        IS(MBM_ILLEGAL_FUNCTION, report(begins, sizeof id_reply, "11 91 01 +"));
        /* The data do not fit. */
        IS(MBM_BUFFER_TOO_SMALL, report(begins, 4, "11 11 02 01 02 FF 07 08 +"));
        assert_int_equal(id_reply[0], 0xEE);
    }
}
