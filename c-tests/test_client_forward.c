/* Requests that the client forwards as they arrived, and the replies that it accepts for
 * them, over a port in memory. */
#include "every_call.h"
#include "await.h"
#include "client.h"
#include "server.h"
#include "examples.h"
#include "memory_port.h"
#include "test.h"

enum { UNIT = 7, REPLY = 252 };

typedef struct exchange {
    const char *request, *response;
    uint8_t bytes, response_bytes;
} exchange;

#define EXCHANGE(request, response)                                                                \
    {                                                                                              \
        request, response, sizeof request - 1, sizeof response - 1                                 \
    }

static const exchange exchanges[] = {
    EXCHANGE("\x01\x00\x13\x00\x0D",
             "\x01\x02\xCD\xFF"), /* the padding bits stay as they are too */
    EXCHANGE("\x02\x00\xC4\x00\x16", "\x02\x03\xAC\xDB\x35"),
    EXCHANGE("\x03\x00\x6B\x00\x03", "\x03\x06\x02\x2B\x00\x00\x00\x64"),
    EXCHANGE("\x04\x00\x08\x00\x01", "\x04\x02\x00\x0A"),
    EXCHANGE("\x05\x00\xAC\xFF\x00", "\x05\x00\xAC\xFF\x00"),
    EXCHANGE("\x06\x00\x01\x12\x34", "\x06\x00\x01\x12\x34"),
    EXCHANGE("\x07", "\x07\x6D"),
    EXCHANGE("\x08\x00\x00\x12\x34\x56\x78", "\x08\x00\x00\x12\x34\x56\x78"),
    EXCHANGE("\x08\x00\x0B\x00\x00", "\x08\x00\x0B\x12\x34"),
    EXCHANGE("\x0B", "\x0B\xFF\xFF\x01\x08"),
    EXCHANGE("\x0C", "\x0C\x08\x00\x00\x01\x08\x01\x21\x20\x00"),
    EXCHANGE("\x0F\x00\x13\x00\x0A\x02\xCD\xFF", "\x0F\x00\x13\x00\x0A"),
    EXCHANGE("\x10\x00\x01\x00\x02\x04\x00\x0A\x01\x02", "\x10\x00\x01\x00\x02"),
    EXCHANGE("\x11", "\x11\x03"
                     "abc"),
    EXCHANGE("\x14\x0E\x06\x00\x04\x00\x01\x00\x02\x06\x00\x03\x00\x09\x00\x02",
             "\x14\x0C\x05\x06\x0D\xFE\x00\x20\x05\x06\x33\xCD\x00\x40"),
    EXCHANGE("\x15\x0D\x06\x00\x04\x00\x07\x00\x03\x06\xAF\x04\xBE\x10\x0D",
             "\x15\x0D\x06\x00\x04\x00\x07\x00\x03\x06\xAF\x04\xBE\x10\x0D"),
    EXCHANGE("\x16\x00\x04\x00\xF2\x00\x25", "\x16\x00\x04\x00\xF2\x00\x25"),
    EXCHANGE("\x17\x00\x03\x00\x02\x00\x0E\x00\x01\x02\x00\xFF", "\x17\x04\x00\xFE\x0A\xCD"),
    EXCHANGE("\x18\x04\xDE", "\x18\x00\x06\x00\x02\x01\xB8\x12\x84"),
    EXCHANGE("\x2B\x0E\x01\x00", "\x2B\x0E\x01\x01\x00\x00\x01\x00\x02"
                                 "ab"),
    EXCHANGE("\x2B\x0D\x01\x02", "\x2B\x0D\x03\x04\x05"),
    EXCHANGE("\x41"
             "own",
             "\x41"
             "any data"),
};

static const int framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_TCP, MBM_FRAMING_RTU_OVER_TCP};

static memory_port m;
static mbm_client client;
static mbm_clientRequest request;
static uint8_t frame[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME], reply[REPLY];

static void begin(int framing)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(reply, 0xEE, sizeof reply);
    OK(CLIENT_BEGIN(&client, framing, &port, frame, outgoing));
    request.unit = UNIT;
    request.reply = reply;
    request.replyBytes = sizeof reply;
}

static uint8_t forward(const char *pdu, uint16_t bytes)
{
    const uint8_t *body = (const uint8_t *)pdu + 1;

    return mbm_client_forward(&client, &request, (uint8_t)pdu[0], body, (uint16_t)(bytes - 1));
}

/* Sends the request and lets the response arrive. Returns the request's status. */
static uint8_t exchange_once(int framing, const exchange *e, const uint8_t *response, uint8_t bytes)
{
    uint8_t adu[300] = {0, 0, 0, 0, 0, (uint8_t)(bytes + 1), UNIT};

    begin(framing);
    IS(MBM_PENDING, forward(e->request, e->bytes));
    memory_port_send(&m, &client);
    memcpy(adu + 7, response, bytes);
    if (framing == MBM_FRAMING_TCP) {
        assert_int_equal(m.sent_count, 7 + e->bytes);
        assert_memory_equal(m.sent + 7, e->request, e->bytes);
        memcpy(adu, m.sent, 2);
        memory_port_bytes(&m, adu, 7u + bytes);
    } else {
        assert_int_equal(m.sent_count, 1 + e->bytes + 2);
        assert_memory_equal(m.sent + 1, e->request, e->bytes);
        memory_port_rtu(&m, adu + 6, 1u + bytes);
    }
    return memory_port_run(&m, &client, &request, 1000);
}

FRAMING_TEST(every_function_and_its_response_are_forwarded_unchanged)
{
    for (unsigned k = 0; k < COUNT(exchanges); k++) {
        const exchange *e = &exchanges[k];
        uint8_t exception[] = {(uint8_t)(e->request[0] | 0x80), 4};

        IS(MBM_OK, exchange_once(framing, e, (const uint8_t *)e->response, e->response_bytes));
        assert_int_equal(request.length, e->response_bytes - 1);
        assert_memory_equal(reply, e->response + 1, request.length);
        assert_int_equal(reply[request.length], 0xEE);
        IS(4, exchange_once(framing, e, exception, sizeof exception));
        assert_int_equal(request.exception, 4);
    }
}

/* The bytes of these responses are fixed by the request: each changed byte must be noticed. */
TEST(a_response_whose_repeated_bytes_differ_is_not_accepted)
{
    static const struct {
        uint8_t function, first, last;
    } repeated[] = {{1, 1, 1},    {2, 1, 1},    {3, 1, 1},    {4, 1, 1},    {5, 1, 4},
                    {6, 1, 4},    {0x0F, 1, 4}, {0x10, 1, 4}, {0x14, 1, 3}, {0x15, 1, 14},
                    {0x16, 1, 6}, {0x17, 1, 1}, {0x2B, 1, 2}};

    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned k = 0; k < COUNT(exchanges) - 2; k++)
            for (unsigned r = 0; r < COUNT(repeated); r++) {
                const exchange *e = &exchanges[k];

                if ((uint8_t)e->request[0] != repeated[r].function)
                    continue;
                for (unsigned at = repeated[r].first; at <= repeated[r].last; at++) {
                    uint8_t other[64];

                    memcpy(other, e->response, e->response_bytes);
                    other[at] ^= 1;
                    assert_true(exchange_once(framings[i], e, other, e->response_bytes) >= 0xE0);
                    assert_int_equal(reply[0], 0xEE);
                }
            }
}

FRAMING_TEST(force_listen_only_mode_ends_without_a_response)
{
    begin(framing);
    IS(MBM_PENDING, forward("\x08\x00\x04\x00\x00", 5));
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(request.length, 0);
}

TEST(a_request_that_is_not_forwarded_is_not_queued)
{
    static const uint8_t body[253] = {0};
    const void *before = &body[9];

    begin(MBM_FRAMING_RTU);
    request.data = before;
    IS(MBM_ILLEGAL_DATA_VALUE, forward("\x03\x00\x00\x00\x00", 5));
    IS(MBM_ILLEGAL_DATA_VALUE, forward("\x03\x00\x00\x00\x01\x00", 6));
    IS(MBM_ILLEGAL_DATA_ADDRESS, forward("\x03\xFF\xFF\x00\x02", 5));
    IS(MBM_ILLEGAL_DATA_VALUE, forward("\x10\x00\x00\x00\x01\x03\x00\x00", 8));
    IS(MBM_ILLEGAL_FUNCTION, mbm_client_forward(&client, &request, 0, body, 4));
    IS(MBM_ILLEGAL_FUNCTION, mbm_client_forward(&client, &request, 0x83, body, 4));
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_client_forward(&client, &request, 0x41, body, 253));
    IS(MBM_INVALID_ARGUMENT, mbm_client_forward(&client, &request, 0x41, NULL, 1));
    request.replyBytes = 6;
    IS(MBM_BUFFER_TOO_SMALL, forward("\x03\x00\x00\x00\x03", 5));
    request.unit = 0;
    request.replyBytes = sizeof reply;
    IS(MBM_BROADCAST_NOT_ALLOWED, forward("\x03\x00\x00\x00\x03", 5));
    assert_ptr_equal(request.data, before);
    assert_int_equal(mbm_client_pending(&client), 0);
    request.unit = UNIT;
    IS(MBM_PENDING, mbm_client_forward(&client, &request, 0x41, NULL, 0));
    IS(MBM_BUSY, mbm_client_forward(&client, &request, 0x41, NULL, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_client_forward(&client, NULL, 0x41, NULL, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_client_forward(NULL, &request, 0x41, NULL, 0));
    memset(&client, 0, sizeof client);
    IS(MBM_NOT_INITIALISED, mbm_client_forward(&client, &request, 0x41, NULL, 0));
}

/* Forwards the bytes, and expects on the line the PDU that mbm_frame_build makes of the packet. */
static void is_sent_as_built(int framing, const mbm_packet *packet, const uint8_t *body,
                             uint16_t bytes)
{
    const mbm_function declared = {
        packet->function, {MBM_RULE_SILENCE, 0, 0}, {MBM_RULE_SILENCE, 0, 0}};
    uint8_t pdu[MBM_MAX_PDU];
    uint16_t length;

    begin(framing);
    OK(mbm_frame_build(PDU(&declared, 1), packet, pdu, sizeof pdu, &length));
    if (!body) {
        body = pdu + 1;
        bytes = (uint16_t)(length - 1);
    }
    IS(MBM_PENDING, mbm_client_forward(&client, &request, packet->function, body, bytes));
    memory_port_send(&m, &client);
    if (framing == MBM_FRAMING_TCP) {
        assert_int_equal(m.sent_count, 7 + length);
        assert_memory_equal(m.sent + 7, pdu, length);
    } else {
        assert_int_equal(m.sent_count, 1 + length + 2);
        assert_memory_equal(m.sent + 1, pdu, length);
    }
}

TEST(every_request_that_is_built_is_forwarded)
{
    unsigned i, forwarded = 0;

    for (i = 0; i < COUNT(framings); i++)
        for (size_t k = 0; k < example_count; k++) {
            uint8_t pdu[MBM_MAX_PDU];
            mbm_packet packet;

            (void)example_load(&examples[k], pdu, &packet);
            if (example_side(&examples[k]) != MBM_PACKET_REQUEST)
                continue;
            is_sent_as_built(framings[i], &packet, NULL, 0);
            forwarded++;
        }
    assert_true(forwarded >= 19 * COUNT(framings));
}

/* Up to as many records as a request holds, or its reply, each of `length` registers. */
static void records_are_forwarded(int framing, uint8_t function, uint16_t length)
{
    static const uint8_t registers[250] = {1, 2, 3, 4};
    uint8_t storage[251], pdu[MBM_MAX_PDU];
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = function};
    mbm_record record = {registers, 6, 0, length};
    uint16_t bytes;

    while (mbm_packet_addRecord(&packet, storage, sizeof storage, &record) == MBM_OK &&
           mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &bytes) == MBM_OK) {
        is_sent_as_built(framing, &packet, packet.data, packet.dataLength);
        record.record++;
    }
    assert_true(record.record > 0);
}

FRAMING_TEST(records_are_forwarded_as_they_were_added)
{
    static const uint16_t lengths[] = {1, 2, 3, 7, 60, 122};

    for (unsigned k = 0; k < COUNT(lengths); k++) {
        if (lengths[k] <= 121)
            records_are_forwarded(framing, MBM_FC_READ_FILE_RECORD, lengths[k]);
        records_are_forwarded(framing, MBM_FC_WRITE_FILE_RECORD, lengths[k]);
    }
}

TEST(the_reply_to_records_that_were_added_is_accepted)
{
    static const uint8_t registers[] = {0xBE, 0xEF}, reading[] = {6, 0, 4, 0, 7, 0, 2};
    static const uint8_t data[] = {UNIT, 0x14, 6, 5, 6, 0x12, 0x34, 0x56, 0x78},
                         other[] = {UNIT, 0x14, 4, 3, 6, 0x12, 0x34};
    uint8_t storage[16], written[] = {UNIT, 0x15, 9, 6, 0, 4, 0, 1, 0, 1, 0xBE, 0xEF};
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = MBM_FC_READ_FILE_RECORD};
    mbm_record record = {registers, 4, 7, 2};

    begin(MBM_FRAMING_RTU);
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &record));
    assert_memory_equal(storage, reading, sizeof reading);
    IS(MBM_PENDING, mbm_client_forward(&client, &request, 0x14, packet.data, packet.dataLength));
    memory_port_send(&m, &client);
    memory_port_rtu(&m, data, sizeof data);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(request.length, sizeof data - 2);
    assert_memory_equal(reply, data + 2, request.length);

    m.sent_count = 0;
    IS(MBM_PENDING, mbm_client_forward(&client, &request, 0x14, packet.data, packet.dataLength));
    memory_port_send(&m, &client);
    memory_port_rtu(&m, other, sizeof other); /* one register instead of two */
    assert_true(memory_port_run(&m, &client, &request, 1000) >= 0xE0);

    begin(MBM_FRAMING_RTU);
    packet.function = MBM_FC_WRITE_FILE_RECORD;
    packet.dataLength = 0;
    record.record = record.length = 1;
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &record));
    IS(MBM_PENDING, mbm_client_forward(&client, &request, 0x15, packet.data, packet.dataLength));
    memory_port_send(&m, &client);
    memory_port_rtu(&m, written, sizeof written);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_memory_equal(reply, written + 2, sizeof written - 2);
}

/* The ten functions at the limits of their quantities, against a libmodbus server. The
 * tests look up written values in the server's own memory. */

static server peer;
static node n;

static void start(void)
{
    server_start(&peer, 17);
    node_begin(&n, peer.line.ours, 17);
}

static void stop(void)
{
    server_stop(&peer);
}

TEST_WITH(reads_holding_registers, start, stop)
{
    static const uint16_t quantities[] = {1, 2, 64, 65, 125};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        OK(mbm_node_readHoldingRegisters(&n.node, 3, quantities[q]));
        assert_int_equal(mbm_node_available(&n.node), quantities[q]);
        for (unsigned i = 0; i < quantities[q]; i++)
            assert_int_equal(n.response[i], server_pattern(3 + i));
    }
}

TEST_WITH(reads_input_registers, start, stop)
{
    static const uint16_t quantities[] = {1, 2, 64, 65, 125};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        OK(mbm_node_readInputRegisters(&n.node, 9, quantities[q]));
        for (unsigned i = 0; i < quantities[q]; i++)
            assert_int_equal(n.response[i], (uint16_t)~server_pattern(9 + i));
    }
}

static const uint16_t bit_quantities[] = {1, 8, 16, 17, 1968, 2000};

TEST_WITH(reads_coils, start, stop)
{
    unsigned i;

    for (size_t q = 0; q < COUNT(bit_quantities); q++) {
        OK(mbm_node_readCoils(&n.node, 5, bit_quantities[q]));
        for (i = 0; i < bit_quantities[q]; i++)
            assert_int_equal(node_bit(&n, i), server_bit_pattern(5 + i));
        for (; i % 16; i++)
            assert_int_equal(node_bit(&n, i), 0);
    }
}

TEST_WITH(reads_discrete_inputs, start, stop)
{
    unsigned i;

    for (size_t q = 0; q < COUNT(bit_quantities); q++) {
        OK(mbm_node_readDiscreteInputs(&n.node, 7, bit_quantities[q]));
        for (i = 0; i < bit_quantities[q]; i++)
            assert_int_equal(node_bit(&n, i), !server_bit_pattern(7 + i));
        for (; i % 16; i++)
            assert_int_equal(node_bit(&n, i), 0);
    }
}

TEST_WITH(writes_a_single_coil, start, stop)
{
    OK(mbm_node_writeSingleCoil(&n.node, 30, 0));
    assert_int_equal(peer.mapping->tab_bits[30], 0);
    OK(mbm_node_writeSingleCoil(&n.node, 30, 1));
    assert_int_equal(peer.mapping->tab_bits[30], 1);
    OK(mbm_node_writeSingleCoil(&n.node, 30, 0));
    OK(mbm_node_writeSingleCoil(&n.node, 30, 0xAA));
    assert_int_equal(peer.mapping->tab_bits[30], 1);
}

TEST_WITH(writes_a_single_register, start, stop)
{
    OK(mbm_node_writeSingleRegister(&n.node, 499, 0xBEEF));
    assert_int_equal(peer.mapping->tab_registers[499], 0xBEEF);
    OK(mbm_node_writeSingleRegister(&n.node, 0, 0));
    assert_int_equal(peer.mapping->tab_registers[0], 0);
}

TEST_WITH(writes_multiple_coils, start, stop)
{
    static const uint16_t quantities[] = {1, 8, 16, 17, 1968};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        uint16_t quantity = quantities[q];

        memset(peer.mapping->tab_bits, 0, SERVER_BITS);
        peer.mapping->tab_bits[11 + quantity] = 1;
        for (unsigned i = 0; i < 1968; i++)
            node_set_bit(&n, i, i % 3 == 0 || i + 1 == quantity);
        OK(mbm_node_writeMultipleCoils(&n.node, 11, quantity));
        assert_int_equal(peer.mapping->tab_bits[10], 0);
        for (unsigned i = 0; i < quantity; i++)
            assert_int_equal(peer.mapping->tab_bits[11 + i], i % 3 == 0 || i + 1 == quantity);
        assert_int_equal(peer.mapping->tab_bits[11 + quantity], 1);
    }
}

TEST_WITH(writes_multiple_registers, start, stop)
{
    static const uint16_t quantities[] = {1, 2, 64, 65, 123};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        uint16_t quantity = quantities[q];

        memset(peer.mapping->tab_registers, 0, 2 * SERVER_REGISTERS);
        for (unsigned i = 0; i < 123; i++)
            n.transmit[i] = (uint16_t)(i * 257 + quantity);
        OK(mbm_node_writeMultipleRegisters(&n.node, 21, quantity));
        for (unsigned i = 0; i < quantity; i++)
            assert_int_equal(peer.mapping->tab_registers[21 + i], (uint16_t)(i * 257 + quantity));
        assert_int_equal(peer.mapping->tab_registers[21 + quantity], 0);
    }
}

TEST_WITH(mask_writes_a_register, start, stop)
{
    peer.mapping->tab_registers[4] = 0x0012;
    OK(mbm_node_maskWriteRegister(&n.node, 4, 0x00F2, 0x0025));
    /* The standard's example, 6.16. */
    assert_int_equal(peer.mapping->tab_registers[4], 0x0017);
}

TEST_WITH(reads_and_writes_multiple_registers, start, stop)
{
    static const struct {
        uint16_t read, write;
    } quantities[] = {{1, 1}, {2, 64}, {64, 2}, {125, 121}};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        for (unsigned i = 0; i < quantities[q].write; i++)
            n.transmit[i] = (uint16_t)(0x4000 + i * 3);
        peer.mapping->tab_registers[300 + quantities[q].write] = 0x7777;
        OK(mbm_node_readWriteMultipleRegisters(&n.node, 300, quantities[q].read, 300,
                                               quantities[q].write));
        assert_int_equal(peer.mapping->tab_registers[300 + quantities[q].write], 0x7777);
        /* The server writes before it reads. */
        for (unsigned i = 0; i < quantities[q].read; i++) {
            uint16_t value = peer.mapping->tab_registers[300 + i];

            if (i < quantities[q].write)
                assert_int_equal(value, 0x4000 + i * 3);
            assert_int_equal(n.response[i], value);
        }
    }
}

TEST_WITH(writes_queued_words_and_bits, start, stop)
{
    mbm_node_beginTransmission(&n.node, 40);
    mbm_node_send(&n.node, 0x1122);
    mbm_node_send(&n.node, 0x33);
    mbm_node_send(&n.node, 0x6677);
    mbm_node_send(&n.node, 0x4455);
    OK(mbm_node_writeQueuedRegisters(&n.node));
    assert_int_equal(peer.mapping->tab_registers[40], 0x1122);
    assert_int_equal(peer.mapping->tab_registers[41], 0x0033);
    assert_int_equal(peer.mapping->tab_registers[42], 0x6677);
    assert_int_equal(peer.mapping->tab_registers[43], 0x4455);

    memset(peer.mapping->tab_bits, 1, SERVER_BITS);
    mbm_node_beginTransmission(&n.node, 50);
    mbm_node_sendBit(&n.node, 0);
    mbm_node_sendBit(&n.node, 7);
    mbm_node_sendBit(&n.node, 0);
    OK(mbm_node_writeQueuedCoils(&n.node));
    assert_memory_equal(peer.mapping->tab_bits + 49, "\1\0\1\0\1", 5);

    mbm_node_beginTransmission(&n.node, 60);
    mbm_node_send(&n.node, 0xABCD);
    OK(mbm_node_readWriteQueuedRegisters(&n.node, 59, 2));
    assert_int_equal(n.response[0], server_pattern(59));
    assert_int_equal(n.response[1], 0xABCD);
}

TEST_WITH(requests_words_to_receive, start, stop)
{
    OK(mbm_node_readHoldingRegisters(&n.node, 10, 3));
    assert_int_equal(mbm_node_available(&n.node), 3);
    assert_int_equal(mbm_node_receive(&n.node), server_pattern(10));
    assert_int_equal(mbm_node_receive(&n.node), server_pattern(11));
    assert_int_equal(mbm_node_available(&n.node), 1);
    assert_int_equal(mbm_node_receive(&n.node), server_pattern(12));
    assert_int_equal(mbm_node_available(&n.node), 0);
    assert_int_equal(mbm_node_receive(&n.node), 0xFFFF);
}

TEST_WITH(returns_exceptions_of_the_server, start, stop)
{
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(&n.node, SERVER_REGISTERS, 1));
    assert_int_equal(mbm_node_getExceptionCode(&n.node), 2);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_writeSingleCoil(&n.node, SERVER_BITS, 1));
    assert_int_equal(n.counters.exceptions, 2);
    OK(mbm_node_readCoils(&n.node, 0, 1));
    assert_int_equal(mbm_node_getExceptionCode(&n.node), 0);
}

static void reaches_unit(uint8_t unit)
{
    server other;

    server_start(&other, unit);
    node_begin(&n, other.line.ours, unit);
    OK(mbm_node_readHoldingRegisters(&n.node, 0, 1));
    assert_int_equal(n.response[0], server_pattern(0));
    server_stop(&other);
    node_begin(&n, peer.line.ours, 17);
}

TEST_WITH(reaches_units_1_and_247, start, stop)
{
    reaches_unit(1);
    reaches_unit(247);
}

TEST_WITH(an_absent_unit_times_out, start, stop)
{
    mbm_node_setSlaveID(&n.node, 18);
    mbm_node_setResponseTimeout(&n.node, 50);
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(&n.node, 0, 1));
    assert_int_equal(n.counters.timeouts, 1);
}

TEST_WITH(a_broadcast_reaches_the_server_and_succeeds, start, stop)
{
    mbm_node_setSlaveID(&n.node, 0);
    mbm_line_setTurnaroundDelay(&n.line, 60);
    OK(mbm_node_writeSingleRegister(&n.node, 70, 0x5A5A));
    AWAIT(peer.mapping->tab_registers[70] == 0x5A5A);
    IS(MBM_BROADCAST_NOT_ALLOWED, mbm_node_readHoldingRegisters(&n.node, 70, 1));
    mbm_node_setSlaveID(&n.node, 17);
    OK(mbm_node_readHoldingRegisters(&n.node, 70, 1));
    assert_int_equal(n.response[0], 0x5A5A);
}

TEST_WITH(a_non_blocking_request_is_pending_until_polled_to_its_end, start, stop)
{
    uint8_t status;
    unsigned polls = 0;

    mbm_node_setBlocking(&n.node, 0);
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&n.node, 3, 2));
    IS(MBM_BUSY, mbm_node_writeSingleRegister(&n.node, 3, 1));
    assert_int_equal(n.counters.requests, 0);
    while ((status = mbm_node_poll(&n.node)) == MBM_PENDING)
        polls++;
    OK(status);
    /* One poll sends the request. How many polls find no reply depends on the server. */
    assert_true(polls > 0);
    assert_int_equal(n.counters.requests, 1);
    assert_int_equal(n.response[1], server_pattern(4));
    OK(mbm_node_poll(&n.node));
}
