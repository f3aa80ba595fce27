/* ModbusMaster's members in C, by their names, with a libmodbus server on a terminal. */
#include "client.h"
#include "server.h"
#include "test.h"

enum { UNIT = 17 };

static server peer;
static node own;
static mbm_node *const n = &own.node;
static mbm_nodeCallbacks callbacks;
static unsigned idle_calls, pre_calls, post_calls;

static void count_idle(void)
{
    idle_calls++;
}

static void count_pre(void)
{
    assert_int_equal(pre_calls, post_calls);
    pre_calls++;
}

static void count_post(void)
{
    post_calls++;
    assert_int_equal(pre_calls, post_calls);
}

static void setup(void)
{
    idle_calls = pre_calls = post_calls = 0;
    memset(&callbacks, 0, sizeof callbacks);
    server_start(&peer, UNIT);
    node_begin(&own, peer.line.ours, UNIT);
    OK(mbm_nodeCallbacks_begin(&callbacks, &own.port));
    OK(mbm_line_beginRtu(&own.line, mbm_nodeCallbacks_port(&callbacks), own.frame, MBM_MAX_FRAME));
    OK(mbm_line_setBaudRate(&own.line, 115200));
    OK(mbm_node_idle(n, count_idle));
    OK(mbm_node_preTransmission(n, count_pre));
    OK(mbm_node_postTransmission(n, count_post));
}

static void teardown(void)
{
    server_stop(&peer);
}

fixture each_test = {setup, teardown};

/* The example Basic of ModbusMaster. */
TEST(basic_writes_two_words_and_reads_six)
{
    const uint32_t counter = 0x00012345;

    OK(mbm_node_setTransmitBuffer(n, 0, (uint16_t)counter));
    OK(mbm_node_setTransmitBuffer(n, 1, (uint16_t)(counter >> 16)));
    OK(mbm_node_writeMultipleRegisters(n, 0, 2));
    assert_int_equal(peer.mapping->tab_registers[0], 0x2345);
    assert_int_equal(peer.mapping->tab_registers[1], 1);
    OK(mbm_node_readHoldingRegisters(n, 2, 6));
    for (uint8_t i = 0; i < 6; i++)
        assert_int_equal(mbm_node_getResponseBuffer(n, i), server_pattern(2u + i));
    assert_int_equal(pre_calls, 2);
    assert_int_equal(post_calls, 2);
    assert_true(idle_calls > 0);
}

/* The example PhoenixContact_nanoLC: bits 16 to a word, and an address that the device lacks. */
TEST(seventeen_coils_are_two_words)
{
    OK(mbm_node_readCoils(n, 3, 17));
    for (unsigned i = 0; i < 17; i++)
        assert_int_equal(mbm_node_getResponseBuffer(n, (uint8_t)(i / 16)) >> i % 16 & 1,
                         server_bit_pattern(3 + i));
    assert_int_equal(mbm_node_getResponseBuffer(n, 1) & ~1u, 0);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, SERVER_REGISTERS - 1, 2));
}

TEST(what_request_from_reads_is_received_word_by_word)
{
    assert_int_equal(mbm_node_requestFrom(n, 40, 3), 3);
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(mbm_node_available(n), 3 - i);
        assert_int_equal(mbm_node_receive(n), server_pattern(40 + i));
    }
    assert_int_equal(mbm_node_receive(n), 0xFFFF);
    assert_int_equal(mbm_node_requestFrom(n, SERVER_REGISTERS, 1), 0);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_status(n));
}

TEST(what_is_sent_arrives_in_the_registers_and_coils_of_the_peer)
{
    const uint16_t *words = peer.mapping->tab_registers;

    OK(mbm_node_beginTransmission(n, 10));
    OK(mbm_node_send8(n, 0xAB));
    OK(mbm_node_send(n, 0x1234));
    OK(mbm_node_send32(n, 0xDEADBEEF));
    OK(mbm_node_writeQueuedRegisters(n));
    assert_true(words[10] == 0xAB && words[11] == 0x1234);
    assert_true(words[12] == 0xBEEF && words[13] == 0xDEAD);
    OK(mbm_node_beginTransmission(n, 100));
    for (unsigned i = 0; i < 5; i++)
        OK(mbm_node_sendBit(n, i % 2 == 0));
    OK(mbm_node_writeQueuedCoils(n));
    for (unsigned i = 0; i < 5; i++)
        assert_int_equal(peer.mapping->tab_bits[100 + i], i % 2 == 0);
    assert_int_equal(peer.mapping->tab_bits[105], server_bit_pattern(105));
    OK(mbm_node_beginTransmission(n, 20));
    OK(mbm_node_send32(n, 0x00070008));
    OK(mbm_node_readWriteQueuedRegisters(n, 20, 2));
    assert_int_equal(mbm_node_getResponseBuffer(n, 0), 8);
    assert_int_equal(mbm_node_getResponseBuffer(n, 1), 7);
}

TEST(cleared_words_are_zero_and_are_written_as_zero)
{
    OK(mbm_node_readInputRegisters(n, 5, 2));
    assert_int_equal(mbm_node_getResponseBuffer(n, 1), (uint16_t)~server_pattern(6));
    OK(mbm_node_clearResponseBuffer(n));
    assert_int_equal(mbm_node_getResponseBuffer(n, 1), 0);
    OK(mbm_node_setTransmitBuffer(n, 1, 7));
    OK(mbm_node_clearTransmitBuffer(n));
    OK(mbm_node_writeMultipleRegisters(n, 30, 2));
    assert_int_equal(peer.mapping->tab_registers[31], 0);
}

TEST(statuses_have_the_numbers_of_the_constants_of_modbusmaster)
{
    static const uint8_t numbers[][2] = {
        {MBM_OK, 0x00},                    /* ku8MBSuccess */
        {MBM_ILLEGAL_FUNCTION, 0x01},      /* ku8MBIllegalFunction */
        {MBM_ILLEGAL_DATA_ADDRESS, 0x02},  /* ku8MBIllegalDataAddress */
        {MBM_ILLEGAL_DATA_VALUE, 0x03},    /* ku8MBIllegalDataValue */
        {MBM_SERVER_DEVICE_FAILURE, 0x04}, /* ku8MBSlaveDeviceFailure */
        {MBM_INVALID_SLAVE_ID, 0xE0},      /* ku8MBInvalidSlaveID */
        {MBM_INVALID_FUNCTION, 0xE1},      /* ku8MBInvalidFunction */
        {MBM_RESPONSE_TIMED_OUT, 0xE2},    /* ku8MBResponseTimedOut */
        {MBM_INVALID_CRC, 0xE3},           /* ku8MBInvalidCRC */
    };

    for (size_t i = 0; i < COUNT(numbers); i++)
        assert_int_equal(numbers[i][0], numbers[i][1]);
}
