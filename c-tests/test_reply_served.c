/* Replies of mbm's own server as packets, field by field, and an identification of many
 * objects, in each framing. */
#include "memory_port.h"
#include "served.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

enum { OBJECTS = 40, LENGTH = 90 };

static served s;
static memory_port m;
static mbm_client client;
static mbm_clientRequest request;
static mbm_packet packet;
static uint8_t framing, frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint8_t pdu[MBM_MAX_PDU], reply[MBM_MAX_PDU + 1], one_reply[250];
static unsigned replies;

static void begin(void)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&request, 0, sizeof request);
    if (framing == MBM_FRAMING_RTU)
        OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    else if (framing == MBM_FRAMING_ASCII)
        OK(mbm_client_beginAscii(&client, &port, frame, sizeof frame));
    else
        OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
    request.unit = SERVED_UNIT;
    request.reply = reply;
    request.replyBytes = sizeof reply;
}

/* Lets the server answer until a request has ended. */
static uint8_t serve(const mbm_clientRequest *until)
{
    const mbm_framing kind = {.kind = framing};
    uint8_t buffer[MBM_MAX_ASCII_FRAME];
    uint16_t length;

    replies = 0;
    while (memory_port_run(&m, &client, until, 1) == MBM_PENDING) {
        if (m.sent_count == 0)
            continue;
        memcpy(buffer, m.sent, m.sent_count);
        OK(mbm_unit_respond(s.units, 2, NULL, &kind, buffer, (uint16_t)m.sent_count, sizeof buffer,
                            &length));
        assert_true(length > 0);
        m.sent_count = 0;
        memory_port_bytes(&m, buffer, length);
        replies++;
    }
    return until->status;
}

/* Asserts that a request was queued, and reads its reply. */
static void reads(uint8_t queued)
{
    IS(MBM_PENDING, queued);
    (void)serve(&request);
    OK(mbm_client_reply(&request, pdu, sizeof pdu, &packet));
}

static void check_fields(void)
{
    static const uint8_t parts[] = {14, 6, 0, 4, 0, 7, 0, 2, 6, 0, 4, 0, 1, 0, 1};
    static const uint8_t twelve[2] = {0x12, 0x34};
    static const uint16_t word[] = {0x1234};
    mbm_record record;
    mbm_object object;
    uint16_t cursor = 0;

    reads(mbm_client_readExceptionStatus(&client, &request));
    assert_int_equal(packet.exceptionStatus, 0x6D);

    request.data = word;
    reads(mbm_client_diagnostics(&client, &request, MBM_DIAGNOSTICS_RETURN_QUERY_DATA, 1));
    assert_int_equal(packet.subFunction, 0);
    assert_memory_equal(packet.data, twelve, 2);

    s.diagnostics.events = 7;
    reads(mbm_client_getCommEventCounter(&client, &request));
    assert_int_equal(packet.commStatus, 0);
    assert_int_equal(packet.eventCount, 7);
    s.diagnostics.events = 8;
    s.diagnostics.busMessages = 900;
    reads(mbm_client_getCommEventLog(&client, &request));
    assert_int_equal(packet.eventCount, 8);
    assert_in_range(packet.messageCount, 900, 901);

    reads(mbm_client_reportServerId(&client, &request));
    assert_int_equal(packet.byteCount, packet.dataLength);
    assert_int_equal(packet.dataLength, 8);
    assert_memory_equal(packet.data, "mbm\xFFtest", 8);

    s.records[7] = 0x1234;
    s.records[8] = 0x5678;
    s.records[1] = 0xBEEF;
    reads(mbm_client_forward(&client, &request, 0x14, parts, sizeof parts));
    assert_true(mbm_packet_nextRecord(&packet, &cursor, &record));
    assert_int_equal(record.length, 2);
    assert_memory_equal(record.data, "\x12\x34\x56\x78", 4);
    assert_true(mbm_packet_nextRecord(&packet, &cursor, &record));
    assert_memory_equal(record.data, "\xBE\xEF", 2);
    assert_false(mbm_packet_nextRecord(&packet, &cursor, &record));

    request.data = word;
    reads(mbm_client_writeFileRecord(&client, &request, 4, 9, 1));
    cursor = 0;
    assert_true(mbm_packet_nextRecord(&packet, &cursor, &record));
    assert_int_equal(record.file, 4);
    assert_int_equal(record.record, 9);
    assert_memory_equal(record.data, twelve, 2);
    assert_int_equal(s.records[9], 0x1234);

    reads(mbm_client_readFifoQueue(&client, &request, 0x04DE));
    assert_int_equal(packet.dataLength, 4);
    assert_memory_equal(packet.data, "\x01\xB8\x12\x84", 4);

    reads(mbm_client_readDeviceIdentification(&client, &request, MBM_DEVICE_ID_INDIVIDUAL, 2));
    cursor = 0;
    assert_int_equal(packet.moreFollows, 0);
    assert_int_equal(packet.objectCount, 1);
    assert_true(mbm_packet_nextObject(&packet, &cursor, &object));
    assert_int_equal(object.id, 2);
    assert_memory_equal(object.data, "V1.0", 4);

    request.data = twelve;
    reads(mbm_client_custom(&client, &request, SERVED_ECHO, 2, &(mbm_rule){MBM_RULE_FIXED, 3, 0}));
    assert_int_equal(packet.function, SERVED_ECHO);
    assert_memory_equal(packet.data, twelve, 2);

    reads(mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    assert_int_equal(packet.kind, MBM_PACKET_EXCEPTION);
    assert_int_equal(packet.exceptionCode, MBM_ILLEGAL_DATA_ADDRESS);
}

static void with_each_framing(void (*check)(void))
{
    static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP};

    for (size_t i = 0; i < COUNT(framings); i++) {
        framing = framings[i];
        served_prepare(&s);
        begin();
        check();
    }
}

TEST(the_fields_of_the_servers_replies_have_names)
{
    with_each_framing(check_fields);
}

static char texts[OBJECTS][LENGTH];
static unsigned handed, first;

static void assert_next(void *context, const mbm_object *object)
{
    const unsigned index = first + handed++;

    (void)context;
    assert_true(index < OBJECTS);
    assert_int_equal(object->id, index < 3 ? index : 0x80 + index);
    assert_int_equal(object->length, LENGTH);
    assert_memory_equal(object->data, texts[index], LENGTH);
}

static void assert_read(uint8_t code, uint8_t object, unsigned count, unsigned at_least)
{
    mbm_identification id = {
        .request = {.unit = SERVED_UNIT, .reply = one_reply, .replyBytes = sizeof one_reply},
        .object = assert_next};

    handed = 0;
    IS(MBM_PENDING, mbm_identification_read(&id, &client, code, object));
    OK(serve(&id.request));
    assert_int_equal(handed, count);
    assert_int_equal(id.count, count);
    assert_int_equal(id.conformity, 0x83);
    assert_true(replies >= at_least);
}

static void check_identification(void)
{
    static mbm_object objects[OBJECTS];

    for (unsigned i = 0; i < OBJECTS; i++) {
        memset(texts[i], 'a' + (int)i % 26, LENGTH);
        objects[i].data = (const uint8_t *)texts[i];
        objects[i].length = LENGTH;
        objects[i].id = (uint8_t)(i < 3 ? i : 0x80 + i);
    }
    s.identification.objects = objects;
    s.identification.count = OBJECTS;
    first = 0;
    assert_read(MBM_DEVICE_ID_EXTENDED, 0, OBJECTS, OBJECTS / 2);
    assert_read(MBM_DEVICE_ID_REGULAR, 0, 3, 2);
    assert_read(MBM_DEVICE_ID_BASIC, 0, 3, 2);
    first = 1;
    assert_read(MBM_DEVICE_ID_BASIC, 1, 2, 1);
    first = 20;
    assert_read(MBM_DEVICE_ID_EXTENDED, 0x80 + 20, OBJECTS - 20, (OBJECTS - 20) / 2);
    assert_read(MBM_DEVICE_ID_INDIVIDUAL, 0x80 + 20, 1, 1);
}

TEST(an_identification_of_many_objects_is_read_to_its_end)
{
    with_each_framing(check_identification);
}
