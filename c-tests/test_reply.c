/* mbm_client_reply: the reply of each function as a packet, compared with what
 * mbm_frame_parse makes of the frame that arrived. */
#include "every_call.h"
#include "served.h"
#include "examples.h"
#include "memory_port.h"
#include "test.h"

enum { UNIT = 7 };

static const uint8_t kinds[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                MBM_FRAMING_RTU_OVER_TCP};
static const mbm_rule any_length;

static memory_port m;
static mbm_client client;
static mbm_clientRequest request;
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME], pdu[MBM_MAX_PDU];
static uint16_t reply[MBM_MAX_PDU / 2 + 1], data[MBM_MAX_PDU / 2 + 1];

static void begin(uint8_t kind)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&request, 0, sizeof request);
    OK(CLIENT_BEGIN(&client, kind, &port, frame, outgoing));
    request.unit = UNIT;
    request.reply = reply;
    request.replyBytes = sizeof reply;
}

static mbm_framing framing_of(uint8_t kind)
{
    return (mbm_framing){.kind = kind};
}

/* The data of a packet as words in the machine's byte order. */
static void use_words(const mbm_packet *packet)
{
    for (uint16_t i = 0; i < packet->dataLength / 2; i++)
        data[i] = (uint16_t)(packet->data[2 * i] << 8 | packet->data[2 * i + 1]);
}

static void use_bytes(const mbm_packet *packet)
{
    if (packet->dataLength)
        memcpy(data, packet->data, packet->dataLength);
}

/* Queues the request that a packet describes. */
static uint8_t ask(const mbm_packet *p)
{
    const uint16_t bytes = p->dataLength, words = (uint16_t)(bytes / 2);
    mbm_client *c = &client;
    mbm_clientRequest *r = &request;

    use_bytes(p);
    r->data = data;
    switch (p->function) {
    case 0x01: return mbm_client_readCoils(c, r, p->address, p->quantity);
    case 0x02: return mbm_client_readDiscreteInputs(c, r, p->address, p->quantity);
    case 0x03: return mbm_client_readHoldingRegisters(c, r, p->address, p->quantity);
    case 0x04: return mbm_client_readInputRegisters(c, r, p->address, p->quantity);
    case 0x05: return mbm_client_writeSingleCoil(c, r, p->address, (uint8_t)p->value);
    case 0x06: return mbm_client_writeSingleRegister(c, r, p->address, p->value);
    case 0x07: return mbm_client_readExceptionStatus(c, r);
    case 0x08: use_words(p); return mbm_client_diagnostics(c, r, p->subFunction, words);
    case 0x0B: return mbm_client_getCommEventCounter(c, r);
    case 0x0C: return mbm_client_getCommEventLog(c, r);
    case 0x0F: return mbm_client_writeMultipleCoils(c, r, p->address, p->quantity);
    case 0x10: use_words(p); return mbm_client_writeMultipleRegisters(c, r, p->address, words);
    case 0x11: return mbm_client_reportServerId(c, r);
    case 0x14: return mbm_client_readFileRecords(c, r, bytes);
    case 0x15: return mbm_client_writeFileRecords(c, r, bytes);
    case 0x16: return mbm_client_maskWriteRegister(c, r, p->address, p->andMask, p->orMask);
    case 0x17:
        use_words(p);
        return mbm_client_readWriteMultipleRegisters(c, r, p->address, p->quantity, p->writeAddress,
                                                     words);
    case 0x18: return mbm_client_readFifoQueue(c, r, p->address);
    case 0x2B:
        if (p->meiType == MBM_MEI_READ_DEVICE_IDENTIFICATION)
            return mbm_client_readDeviceIdentification(c, r, p->readDeviceIdCode, p->objectId);
        return mbm_client_encapsulatedInterfaceTransport(c, r, p->meiType, bytes);
    default: return mbm_client_custom(c, r, p->function, bytes, &any_length);
    }
}

/* Lets the frame of a response arrive for the request that was queued, and waits until the
 * request has ended. Then `wanted` is what mbm_frame_parse makes of the frame. */
static uint8_t answer(uint8_t kind, const mbm_packet *response, uint8_t *received,
                      mbm_packet *wanted)
{
    const mbm_framing framing = framing_of(kind);
    mbm_packet sent = *response;
    uint16_t length;

    memory_port_send(&m, &client);
    sent.unit = UNIT;
    sent.transaction = mbm_client_wireTransaction(&request);
    OK(mbm_frame_build(&framing, &sent, received, MBM_MAX_ASCII_FRAME, &length));
    memory_port_bytes(&m, received, length);
    (void)memory_port_run(&m, &client, &request, 100);
    OK(mbm_frame_parse(&framing, MBM_PACKET_RESPONSE, received, length, wanted));
    return request.status;
}

static void assert_reply_is(const mbm_packet *wanted)
{
    mbm_packet found;

    OK(mbm_client_reply(&request, pdu, sizeof pdu, &found));
    assert_same_packet(&found, wanted);
    if (found.dataLength)
        assert_true(found.data >= pdu && found.data + found.dataLength <= pdu + sizeof pdu);
}

/* Calls `check` with the packets of each request and its response, in each framing. */
static void with_each_exchange(void (*check)(uint8_t kind, const mbm_packet *asked,
                                             const mbm_packet *response, const uint8_t *body,
                                             uint16_t bytes))
{
    uint8_t asked_pdu[MBM_MAX_PDU], response_pdu[MBM_MAX_PDU];
    mbm_packet asked, response;
    size_t i, k, count = 0;

    for (i = 0; i + 1 < example_count; i++) {
        const uint16_t length = example_load(&examples[i], asked_pdu, &asked);

        (void)example_load(&examples[i + 1], response_pdu, &response);
        if (asked.kind != MBM_PACKET_REQUEST)
            continue;
        assert_int_equal(response.kind, MBM_PACKET_RESPONSE);
        count++;
        for (k = 0; k < COUNT(kinds); k++) {
            begin(kinds[k]);
            check(kinds[k], &asked, &response, asked_pdu + 1, (uint16_t)(length - 1));
        }
    }
    assert_true(count > 25);
}

#define EXCHANGES_TEST(name)                                                                       \
    static void each_##name(uint8_t kind, const mbm_packet *asked, const mbm_packet *response,     \
                            const uint8_t *body, uint16_t bytes);                                  \
    TEST(name)                                                                                     \
    {                                                                                              \
        with_each_exchange(each_##name);                                                           \
    }                                                                                              \
    static void each_##name(                                                                       \
        __attribute__((unused)) uint8_t kind, __attribute__((unused)) const mbm_packet *asked,     \
        __attribute__((unused)) const mbm_packet *response,                                        \
        __attribute__((unused)) const uint8_t *body, __attribute__((unused)) uint16_t bytes)

EXCHANGES_TEST(the_reply_of_each_function_is_the_packet_of_its_frame)
{
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted;

    (void)body;
    (void)bytes;
    IS(MBM_PENDING, ask(asked));
    IS(MBM_PENDING, mbm_client_reply(&request, pdu, sizeof pdu, &wanted));
    OK(answer(kind, response, received, &wanted));
    /* The client does not keep the byte count of a server id. */
    if (wanted.function == MBM_FC_REPORT_SERVER_ID)
        wanted.byteCount = (uint8_t)wanted.dataLength;
    assert_reply_is(&wanted);
    /* Once more, since the first call changed nothing. */
    assert_reply_is(&wanted);
}

EXCHANGES_TEST(the_reply_of_a_forwarded_request_is_the_packet_of_its_frame)
{
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted;

    IS(MBM_PENDING, mbm_client_forward(&client, &request, asked->function, body, bytes));
    OK(answer(kind, response, received, &wanted));
    assert_reply_is(&wanted);
}

EXCHANGES_TEST(the_reply_of_a_refused_request_is_an_exception_packet)
{
    const mbm_packet refusal = {.kind = MBM_PACKET_EXCEPTION,
                                .function = asked->function,
                                .exceptionCode = MBM_SERVER_DEVICE_FAILURE};
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted;

    (void)response;
    (void)body;
    (void)bytes;
    request.reply = NULL;
    IS(MBM_PENDING, ask(asked));
    IS(MBM_SERVER_DEVICE_FAILURE, answer(kind, &refusal, received, &wanted));
    assert_reply_is(&wanted);
    IS(MBM_SERVER_DEVICE_FAILURE, wanted.exceptionCode);
}

TEST(one_file_record_has_its_head_again)
{
    uint8_t received[MBM_MAX_ASCII_FRAME], bytes[8];
    mbm_packet response = {
        .kind = MBM_PACKET_RESPONSE, .function = 0x14, .data = bytes, .dataLength = 6};
    mbm_record record;
    mbm_packet wanted, found;
    uint16_t cursor = 0;

    hex_bytes(bytes, "05 06 0DFE 0020");
    begin(MBM_FRAMING_RTU);
    IS(MBM_PENDING, mbm_client_readFileRecord(&client, &request, 4, 1, 2));
    OK(answer(MBM_FRAMING_RTU, &response, received, &wanted));
    assert_reply_is(&wanted);
    OK(mbm_client_reply(&request, pdu, sizeof pdu, &found));
    assert_true(mbm_packet_nextRecord(&found, &cursor, &record));
    assert_int_equal(record.length, 2);
    assert_memory_equal(record.data, "\x0D\xFE\x00\x20", 4);
    assert_false(mbm_packet_nextRecord(&found, &cursor, &record));

    hex_bytes(bytes, "0DFE 0020");
    begin(MBM_FRAMING_RTU);
    response.function = 0x15;
    response.dataLength = 0;
    data[0] = 0x0DFE;
    data[1] = 0x0020;
    request.data = data;
    OK(mbm_packet_addRecord(&response, pdu, sizeof pdu, &(mbm_record){bytes, 4, 7, 2}));
    IS(MBM_PENDING, mbm_client_writeFileRecord(&client, &request, 4, 7, 2));
    OK(answer(MBM_FRAMING_RTU, &response, received, &wanted));
    assert_reply_is(&wanted);
    request.data = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&request, pdu, sizeof pdu, &found));
}

TEST(unused_bits_are_zero)
{
    const mbm_packet response = {.kind = MBM_PACKET_RESPONSE,
                                 .function = 0x01,
                                 .data = (const uint8_t *)"\xFF\xFF",
                                 .dataLength = 2};
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted, found;

    begin(MBM_FRAMING_RTU);
    IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 11));
    OK(answer(MBM_FRAMING_RTU, &response, received, &wanted));
    OK(mbm_client_reply(&request, pdu, sizeof pdu, &found));
    assert_int_equal(found.dataLength, 2);
    assert_memory_equal(found.data, "\xFF\x07", 2);
}

/* Asserts that there is no reply, and that the packet does not change. */
static void refuses(uint8_t status)
{
    mbm_packet found;

    memset(&found, 0x5A, sizeof found);
    mbm_packet before = found;
    IS(status, mbm_client_reply(&request, pdu, sizeof pdu, &found));
    assert_memory_equal(&found, &before, sizeof found);
}

TEST(a_request_without_a_reply_says_why)
{
    static const mbm_packet registers = {.kind = MBM_PACKET_RESPONSE,
                                         .function = 0x03,
                                         .data = (const uint8_t *)"\x12\x34",
                                         .dataLength = 2};
    static const mbm_packet log = {.kind = MBM_PACKET_RESPONSE,
                                   .function = 0x0C,
                                   .data = (const uint8_t *)"\x01\x02\x03",
                                   .dataLength = 3};
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted;

    begin(MBM_FRAMING_RTU);
    refuses(MBM_INVALID_ARGUMENT); /* never queued */

    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    refuses(MBM_PENDING);
    OK(mbm_client_cancel(&client, &request));
    refuses(MBM_CANCELLED);

    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
    refuses(MBM_RESPONSE_TIMED_OUT);

    begin(MBM_FRAMING_TCP);
    request.reply = NULL;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    OK(answer(MBM_FRAMING_TCP, &registers, received, &wanted));
    refuses(MBM_BUFFER_TOO_SMALL);

    begin(MBM_FRAMING_TCP);
    request.replyBytes = 8; /* the log has nine */
    IS(MBM_PENDING, mbm_client_getCommEventLog(&client, &request));
    IS(MBM_BUFFER_TOO_SMALL, answer(MBM_FRAMING_TCP, &log, received, &wanted));
    refuses(MBM_BUFFER_TOO_SMALL);
}

TEST(a_request_that_no_device_answers_has_no_reply)
{
    begin(MBM_FRAMING_RTU);
    request.unit = 0;
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 1, 2));
    OK(memory_port_run(&m, &client, &request, 1000));
    refuses(MBM_INVALID_ARGUMENT);

    begin(MBM_FRAMING_RTU);
    request.data = data;
    IS(MBM_PENDING,
       mbm_client_diagnostics(&client, &request, MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY, 1));
    OK(memory_port_run(&m, &client, &request, 1000));
    refuses(MBM_INVALID_ARGUMENT);
}

TEST(a_refused_request_does_not_keep_an_earlier_exception)
{
    const mbm_packet refusal = {
        .kind = MBM_PACKET_EXCEPTION, .function = 0x03, .exceptionCode = MBM_ILLEGAL_DATA_VALUE};
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted;

    begin(MBM_FRAMING_TCP);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    IS(MBM_ILLEGAL_DATA_VALUE, answer(MBM_FRAMING_TCP, &refusal, received, &wanted));
    IS(MBM_ILLEGAL_DATA_VALUE, request.exception);
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_client_readHoldingRegisters(&client, &request, 0, 0));
    assert_int_equal(request.exception, 0);
    refuses(MBM_ILLEGAL_DATA_VALUE);
}

TEST(a_log_that_the_client_accepted_may_be_malformed)
{
    static const mbm_framing framing = {.kind = MBM_FRAMING_RTU};
    /* Two bytes do not hold the status, the events and the messages. */
    uint8_t short_log[] = {UNIT, 0x0C, 2, 0, 0, 0, 0};
    mbm_packet wanted;

    begin(MBM_FRAMING_RTU);
    IS(MBM_PENDING, mbm_client_getCommEventLog(&client, &request));
    memory_port_send(&m, &client);
    memory_port_rtu(&m, short_log, 5);
    OK(memory_port_run(&m, &client, &request, 100));
    refuses(MBM_MALFORMED_REPLY);
    short_log[5] = (uint8_t)mbm_frame_crc16(short_log, 5);
    short_log[6] = (uint8_t)(mbm_frame_crc16(short_log, 5) >> 8);
    IS(MBM_MALFORMED_REPLY, mbm_frame_parse(&framing, MBM_PACKET_RESPONSE, short_log, 7, &wanted));
}

TEST(memory_that_is_missing_too_small_or_shared_is_refused)
{
    static const mbm_packet response = {.kind = MBM_PACKET_RESPONSE,
                                        .function = 0x03,
                                        .data = (const uint8_t *)"\x12\x34",
                                        .dataLength = 2};
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted, found;

    begin(MBM_FRAMING_RTU);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
    OK(answer(MBM_FRAMING_RTU, &response, received, &wanted));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(NULL, pdu, sizeof pdu, &found));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&request, NULL, sizeof pdu, &found));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&request, pdu, sizeof pdu, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_client_reply(&request, (uint8_t *)reply, sizeof reply, &found));
    IS(MBM_BUFFER_TOO_SMALL, mbm_client_reply(&request, pdu, 0, &found));
    IS(MBM_BUFFER_TOO_SMALL, mbm_client_reply(&request, pdu, 3, &found));
    OK(mbm_client_reply(&request, pdu, 4, &found));
    assert_int_equal(reply[0], 0x1234);
}

static uint8_t status_in_done;

static void read_reply(void *context, mbm_clientRequest *ended)
{
    status_in_done = mbm_client_reply(ended, pdu, sizeof pdu, (mbm_packet *)context);
}

TEST(done_may_read_the_reply)
{
    static const mbm_packet response = {
        .kind = MBM_PACKET_RESPONSE, .function = 0x0B, .commStatus = 0xFFFF, .eventCount = 0x108};
    uint8_t received[MBM_MAX_ASCII_FRAME];
    mbm_packet wanted, found;

    begin(MBM_FRAMING_TCP);
    request.done = read_reply;
    request.context = &found;
    status_in_done = MBM_BUSY;
    IS(MBM_PENDING, mbm_client_getCommEventCounter(&client, &request));
    OK(answer(MBM_FRAMING_TCP, &response, received, &wanted));
    OK(status_in_done);
    assert_same_packet(&found, &wanted);
    assert_int_equal(found.eventCount, 0x108);
}

/* Replies of mbm's own server as packets, field by field, and an identification of many
 * objects, in each framing. */

enum { OBJECTS = 40, LENGTH = 90 };

static served s;

static mbm_packet packet;
static uint8_t framing, client_frame[MBM_MAX_ASCII_FRAME], client_outgoing[MBM_MAX_TCP_FRAME];
static uint8_t reply_pdu[MBM_MAX_PDU], data_reply[MBM_MAX_PDU + 1], one_reply[250];
static unsigned replies;

static void begin_client(void)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&request, 0, sizeof request);
    OK(CLIENT_BEGIN(&client, framing, &port, client_frame, client_outgoing));
    request.unit = SERVED_UNIT;
    request.reply = data_reply;
    request.replyBytes = sizeof data_reply;
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
    OK(mbm_client_reply(&request, reply_pdu, sizeof reply_pdu, &packet));
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
    IS(MBM_ILLEGAL_DATA_ADDRESS, packet.exceptionCode);
}

static void with_each_framing(void (*check)(void))
{
    static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP};

    for (size_t i = 0; i < COUNT(framings); i++) {
        framing = framings[i];
        served_prepare(&s);
        begin_client();
        check();
    }
}

TEST_ROW(the_fields_of_the_servers_replies_have_names, with_each_framing(check_fields))

static char texts[OBJECTS][LENGTH];
static unsigned handed, first;

static void assert_next(void *context, const mbm_object *object)
{
    const unsigned index = first + handed++;

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

TEST_ROW(an_identification_of_many_objects_is_read_to_its_end,
         with_each_framing(check_identification))
