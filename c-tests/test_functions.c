/* The ten functions at the limits of their quantities, against a libmodbus server. The
 * tests look up written values in the server's own memory. */
#include "await.h"
#include "node.h"
#include "server.h"
#include "test.h"

#include <string.h>

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

fixture each_test = {start, stop};

TEST(reads_holding_registers)
{
    static const uint16_t quantities[] = {1, 2, 64, 65, 125};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        assert_int_equal(mbm_node_readHoldingRegisters(&n.node, 3, quantities[q]), MBM_OK);
        assert_int_equal(mbm_node_available(&n.node), quantities[q]);
        for (unsigned i = 0; i < quantities[q]; i++)
            assert_int_equal(n.response[i], server_pattern(3 + i));
    }
}

TEST(reads_input_registers)
{
    static const uint16_t quantities[] = {1, 2, 64, 65, 125};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        assert_int_equal(mbm_node_readInputRegisters(&n.node, 9, quantities[q]), MBM_OK);
        for (unsigned i = 0; i < quantities[q]; i++)
            assert_int_equal(n.response[i], (uint16_t)~server_pattern(9 + i));
    }
}

static const uint16_t bit_quantities[] = {1, 8, 16, 17, 1968, 2000};

TEST(reads_coils)
{
    unsigned i;

    for (size_t q = 0; q < COUNT(bit_quantities); q++) {
        assert_int_equal(mbm_node_readCoils(&n.node, 5, bit_quantities[q]), MBM_OK);
        for (i = 0; i < bit_quantities[q]; i++)
            assert_int_equal(node_bit(&n, i), server_bit_pattern(5 + i));
        for (; i % 16; i++)
            assert_int_equal(node_bit(&n, i), 0);
    }
}

TEST(reads_discrete_inputs)
{
    unsigned i;

    for (size_t q = 0; q < COUNT(bit_quantities); q++) {
        assert_int_equal(mbm_node_readDiscreteInputs(&n.node, 7, bit_quantities[q]), MBM_OK);
        for (i = 0; i < bit_quantities[q]; i++)
            assert_int_equal(node_bit(&n, i), !server_bit_pattern(7 + i));
        for (; i % 16; i++)
            assert_int_equal(node_bit(&n, i), 0);
    }
}

TEST(writes_a_single_coil)
{
    assert_int_equal(mbm_node_writeSingleCoil(&n.node, 30, 0), MBM_OK);
    assert_int_equal(peer.mapping->tab_bits[30], 0);
    assert_int_equal(mbm_node_writeSingleCoil(&n.node, 30, 1), MBM_OK);
    assert_int_equal(peer.mapping->tab_bits[30], 1);
    assert_int_equal(mbm_node_writeSingleCoil(&n.node, 30, 0), MBM_OK);
    assert_int_equal(mbm_node_writeSingleCoil(&n.node, 30, 0xAA), MBM_OK);
    assert_int_equal(peer.mapping->tab_bits[30], 1);
}

TEST(writes_a_single_register)
{
    assert_int_equal(mbm_node_writeSingleRegister(&n.node, 499, 0xBEEF), MBM_OK);
    assert_int_equal(peer.mapping->tab_registers[499], 0xBEEF);
    assert_int_equal(mbm_node_writeSingleRegister(&n.node, 0, 0), MBM_OK);
    assert_int_equal(peer.mapping->tab_registers[0], 0);
}

TEST(writes_multiple_coils)
{
    static const uint16_t quantities[] = {1, 8, 16, 17, 1968};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        uint16_t quantity = quantities[q];

        memset(peer.mapping->tab_bits, 0, SERVER_BITS);
        peer.mapping->tab_bits[11 + quantity] = 1;
        for (unsigned i = 0; i < 1968; i++)
            node_set_bit(&n, i, i % 3 == 0 || i + 1 == quantity);
        assert_int_equal(mbm_node_writeMultipleCoils(&n.node, 11, quantity), MBM_OK);
        assert_int_equal(peer.mapping->tab_bits[10], 0);
        for (unsigned i = 0; i < quantity; i++)
            assert_int_equal(peer.mapping->tab_bits[11 + i], i % 3 == 0 || i + 1 == quantity);
        assert_int_equal(peer.mapping->tab_bits[11 + quantity], 1);
    }
}

TEST(writes_multiple_registers)
{
    static const uint16_t quantities[] = {1, 2, 64, 65, 123};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        uint16_t quantity = quantities[q];

        memset(peer.mapping->tab_registers, 0, 2 * SERVER_REGISTERS);
        for (unsigned i = 0; i < 123; i++)
            n.transmit[i] = (uint16_t)(i * 257 + quantity);
        assert_int_equal(mbm_node_writeMultipleRegisters(&n.node, 21, quantity), MBM_OK);
        for (unsigned i = 0; i < quantity; i++)
            assert_int_equal(peer.mapping->tab_registers[21 + i], (uint16_t)(i * 257 + quantity));
        assert_int_equal(peer.mapping->tab_registers[21 + quantity], 0);
    }
}

TEST(mask_writes_a_register)
{
    peer.mapping->tab_registers[4] = 0x0012;
    assert_int_equal(mbm_node_maskWriteRegister(&n.node, 4, 0x00F2, 0x0025), MBM_OK);
    /* The standard's example, 6.16. */
    assert_int_equal(peer.mapping->tab_registers[4], 0x0017);
}

TEST(reads_and_writes_multiple_registers)
{
    static const struct {
        uint16_t read, write;
    } quantities[] = {{1, 1}, {2, 64}, {64, 2}, {125, 121}};

    for (size_t q = 0; q < COUNT(quantities); q++) {
        for (unsigned i = 0; i < quantities[q].write; i++)
            n.transmit[i] = (uint16_t)(0x4000 + i * 3);
        peer.mapping->tab_registers[300 + quantities[q].write] = 0x7777;
        assert_int_equal(mbm_node_readWriteMultipleRegisters(&n.node, 300, quantities[q].read, 300,
                                                             quantities[q].write),
                         MBM_OK);
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

TEST(writes_queued_words_and_bits)
{
    mbm_node_beginTransmission(&n.node, 40);
    mbm_node_send(&n.node, 0x1122);
    mbm_node_send(&n.node, 0x33);
    mbm_node_send(&n.node, 0x6677);
    mbm_node_send(&n.node, 0x4455);
    assert_int_equal(mbm_node_writeQueuedRegisters(&n.node), MBM_OK);
    assert_int_equal(peer.mapping->tab_registers[40], 0x1122);
    assert_int_equal(peer.mapping->tab_registers[41], 0x0033);
    assert_int_equal(peer.mapping->tab_registers[42], 0x6677);
    assert_int_equal(peer.mapping->tab_registers[43], 0x4455);

    memset(peer.mapping->tab_bits, 1, SERVER_BITS);
    mbm_node_beginTransmission(&n.node, 50);
    mbm_node_sendBit(&n.node, 0);
    mbm_node_sendBit(&n.node, 7);
    mbm_node_sendBit(&n.node, 0);
    assert_int_equal(mbm_node_writeQueuedCoils(&n.node), MBM_OK);
    assert_memory_equal(peer.mapping->tab_bits + 49, "\1\0\1\0\1", 5);

    mbm_node_beginTransmission(&n.node, 60);
    mbm_node_send(&n.node, 0xABCD);
    assert_int_equal(mbm_node_readWriteQueuedRegisters(&n.node, 59, 2), MBM_OK);
    assert_int_equal(n.response[0], server_pattern(59));
    assert_int_equal(n.response[1], 0xABCD);
}

TEST(requests_words_to_receive)
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

TEST(returns_exceptions_of_the_server)
{
    assert_int_equal(mbm_node_readHoldingRegisters(&n.node, SERVER_REGISTERS, 1),
                     MBM_ILLEGAL_DATA_ADDRESS);
    assert_int_equal(mbm_node_getExceptionCode(&n.node), 2);
    assert_int_equal(mbm_node_writeSingleCoil(&n.node, SERVER_BITS, 1), MBM_ILLEGAL_DATA_ADDRESS);
    assert_int_equal(n.counters.exceptions, 2);
    assert_int_equal(mbm_node_readCoils(&n.node, 0, 1), MBM_OK);
    assert_int_equal(mbm_node_getExceptionCode(&n.node), 0);
}

static void reaches_unit(uint8_t unit)
{
    server other;

    server_start(&other, unit);
    node_begin(&n, other.line.ours, unit);
    assert_int_equal(mbm_node_readHoldingRegisters(&n.node, 0, 1), MBM_OK);
    assert_int_equal(n.response[0], server_pattern(0));
    server_stop(&other);
    node_begin(&n, peer.line.ours, 17);
}

TEST(reaches_units_1_and_247)
{
    reaches_unit(1);
    reaches_unit(247);
}

TEST(an_absent_unit_times_out)
{
    mbm_node_setSlaveID(&n.node, 18);
    mbm_node_setResponseTimeout(&n.node, 50);
    assert_int_equal(mbm_node_readHoldingRegisters(&n.node, 0, 1), MBM_RESPONSE_TIMED_OUT);
    assert_int_equal(n.counters.timeouts, 1);
}

TEST(a_broadcast_reaches_the_server_and_succeeds)
{
    mbm_node_setSlaveID(&n.node, 0);
    mbm_line_setTurnaroundDelay(&n.line, 60);
    assert_int_equal(mbm_node_writeSingleRegister(&n.node, 70, 0x5A5A), MBM_OK);
    AWAIT(peer.mapping->tab_registers[70] == 0x5A5A);
    assert_int_equal(mbm_node_readHoldingRegisters(&n.node, 70, 1), MBM_BROADCAST_NOT_ALLOWED);
    mbm_node_setSlaveID(&n.node, 17);
    assert_int_equal(mbm_node_readHoldingRegisters(&n.node, 70, 1), MBM_OK);
    assert_int_equal(n.response[0], 0x5A5A);
}

TEST(a_non_blocking_request_is_pending_until_polled_to_its_end)
{
    uint8_t status;
    unsigned polls = 0;

    mbm_node_setBlocking(&n.node, 0);
    assert_int_equal(mbm_node_readHoldingRegisters(&n.node, 3, 2), MBM_PENDING);
    assert_int_equal(mbm_node_writeSingleRegister(&n.node, 3, 1), MBM_BUSY);
    assert_int_equal(n.counters.requests, 0);
    while ((status = mbm_node_poll(&n.node)) == MBM_PENDING)
        polls++;
    assert_int_equal(status, MBM_OK);
    /* One poll sends the request. How many polls find no reply depends on the server. */
    assert_true(polls > 0);
    assert_int_equal(n.counters.requests, 1);
    assert_int_equal(n.response[1], server_pattern(4));
    assert_int_equal(mbm_node_poll(&n.node), MBM_OK);
}
