/* The functions of the contract with programs for ModbusMaster: the bytes that each sends,
 * what each takes from a reply, the buffers of words and the queue. Unit 17 is 11 on the
 * wire. */
#include "sim.h"
#include "test.h"

#include <string.h>

#define WORD(index) s->response[index]
#define LAST(text) sim_assert_sent(s, s->sent - 1, text)

SIM_TEST(reads_coils_and_inputs_as_the_specification_shows)
{
    sim_answer(s, 1, 500, "11 01 03 CD 6B 05 +");
    OK(mbm_node_readCoils(n, 19, 19));
    LAST("11 01 00 13 00 13 +");
    assert_int_equal(WORD(0), 0x6BCD);
    assert_int_equal(WORD(1), 0x0005);
    sim_answer(s, 1, 500, "11 02 03 AC DB 35 +");
    OK(mbm_node_readDiscreteInputs(n, 196, 22));
    LAST("11 02 00 C4 00 16 +");
    assert_int_equal(WORD(0), 0xDBAC);
    assert_int_equal(WORD(1), 0x0035);
}

SIM_TEST(reads_registers_as_the_specification_shows)
{
    sim_answer(s, 1, 500, "11 03 06 02 2B 00 00 00 64 +");
    OK(mbm_node_readHoldingRegisters(n, 107, 3));
    LAST("11 03 00 6B 00 03 +");
    assert_int_equal(WORD(0), 555);
    assert_int_equal(WORD(1), 0);
    assert_int_equal(WORD(2), 100);
    sim_answer(s, 1, 500, "11 04 02 00 0A +");
    OK(mbm_node_readInputRegisters(n, 8, 1));
    LAST("11 04 00 08 00 01 +");
    assert_int_equal(WORD(0), 10);
}

SIM_TEST(writes_single_cells_as_the_specification_shows)
{
    sim_answer(s, 1, 500, "11 05 00 AC FF 00 +");
    OK(mbm_node_writeSingleCoil(n, 172, 1));
    LAST("11 05 00 AC FF 00 +");
    sim_answer(s, 1, 500, "11 05 00 AC 00 00 +");
    OK(mbm_node_writeSingleCoil(n, 172, 0));
    LAST("11 05 00 AC 00 00 +");
    sim_answer(s, 1, 500, "11 06 00 01 00 03 +");
    OK(mbm_node_writeSingleRegister(n, 1, 3));
    LAST("11 06 00 01 00 03 +");
}

SIM_TEST(any_state_except_zero_is_on)
{
    static const uint8_t states[] = {1, 2, 0x80, 0xFF};

    for (size_t i = 0; i < COUNT(states); i++) {
        sim_answer(s, 1, 500, "11 05 00 00 FF 00 +");
        OK(mbm_node_writeSingleCoil(n, 0, states[i]));
        LAST("11 05 00 00 FF 00 +");
    }
}

SIM_TEST(writes_many_cells_as_the_specification_shows)
{
    s->transmit[0] = 0x01CD;
    sim_answer(s, 1, 500, "11 0F 00 13 00 0A +");
    OK(mbm_node_writeMultipleCoils(n, 19, 10));
    LAST("11 0F 00 13 00 0A 02 CD 01 +");
    s->transmit[0] = 0x000A;
    s->transmit[1] = 0x0102;
    sim_answer(s, 1, 500, "11 10 00 01 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
    LAST("11 10 00 01 00 02 04 00 0A 01 02 +");
}

SIM_TEST(mask_writes_as_the_specification_shows)
{
    sim_answer(s, 1, 500, "11 16 00 04 00 F2 00 25 +");
    OK(mbm_node_maskWriteRegister(n, 4, 0x00F2, 0x0025));
    LAST("11 16 00 04 00 F2 00 25 66 E2");
}

SIM_TEST(reads_and_writes_at_once_as_the_specification_shows)
{
    for (uint8_t i = 0; i < 3; i++)
        s->transmit[i] = 0x00FF;
    sim_answer(s, 1, 500, "11 17 0C 00 FE 0A CD 00 01 00 03 00 0D 00 FF +");
    OK(mbm_node_readWriteMultipleRegisters(n, 3, 6, 14, 3));
    LAST("11 17 00 03 00 06 00 0E 00 03 06 00 FF 00 FF 00 FF +");
    assert_int_equal(WORD(0), 254);
    assert_int_equal(WORD(1), 2765);
    assert_int_equal(WORD(5), 255);
}

/* Complete frames with their CRC, as the documentation of another library shows them. */
SIM_TEST(frames_are_the_same_as_in_the_documentation_of_another_library)
{
    mbm_node_setResponseTimeout(n, 1);
    mbm_line_setGap(&s->line, 0);
    mbm_line_setQuietTime(&s->line, 0);
    mbm_node_setSlaveID(n, 16);
    mbm_node_readCoils(n, 107, 3);
    LAST("10 01 00 6B 00 03 0E 96");
    mbm_node_readDiscreteInputs(n, 107, 3);
    LAST("10 02 00 6B 00 03 4A 96");
    mbm_node_setSlaveID(n, 1);
    sim_answer(s, 1, 100, "01 03 02 CD 6B AD 3B");
    mbm_node_setResponseTimeout(n, 2000);
    OK(mbm_node_readHoldingRegisters(n, 107, 1));
    LAST("01 03 00 6B 00 01 F5 D6");
    assert_int_equal(WORD(0), 0xCD6B);
    sim_answer(s, 1, 100, "01 04 02 CD 6B AC 4F");
    OK(mbm_node_readInputRegisters(n, 107, 1));
    LAST("01 04 00 6B 00 01 40 16");
    mbm_node_setSlaveID(n, 17);
    sim_answer(s, 1, 100, "11 05 00 6B FF 00 FF 76");
    OK(mbm_node_writeSingleCoil(n, 107, 1));
    LAST("11 05 00 6B FF 00 FF 76");
    sim_answer(s, 1, 100, "11 06 00 6B 01 01 3A D6");
    OK(mbm_node_writeSingleRegister(n, 107, 0x0101));
    LAST("11 06 00 6B 01 01 3A D6");
    s->transmit[0] = 0x0005;
    sim_answer(s, 1, 100, "11 0F 04 10 00 03 17 AF");
    OK(mbm_node_writeMultipleCoils(n, 0x410, 3));
    LAST("11 0F 04 10 00 03 01 05 8E 1F");
    s->transmit[0] = 0x00C8;
    s->transmit[1] = 0x0082;
    s->transmit[2] = 0x8701;
    sim_answer(s, 1, 100, "11 10 04 10 00 03 82 6D");
    OK(mbm_node_writeMultipleRegisters(n, 0x410, 3));
    LAST("11 10 04 10 00 03 06 00 C8 00 82 87 01 2F 7D");
    sim_answer(s, 1, 100, "11 17 02 CD 6B 69 08");
    OK(mbm_node_readWriteMultipleRegisters(n, 0x410, 1, 0x112, 2));
    LAST("11 17 04 10 00 01 01 12 00 02 04 00 C8 00 82 64 E2");
}

SIM_TEST(units_248_to_255_are_accepted)
{
    mbm_node_setSlaveID(n, 248);
    sim_answer(s, 1, 100, "F8 03 02 00 01 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    sim_begin(s, 255);
    assert_int_equal(mbm_node_getSlaveID(n), 255);
    sim_answer(s, 1, 100, "FF 03 02 00 01 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    LAST("FF 03 00 00 00 01 +");
}

SIM_TEST(the_last_odd_byte_of_coils_is_padded_with_zero)
{
    memset(s->response, 0xFF, sizeof s->response);
    sim_answer(s, 1, 100, "11 01 03 CD 6B FF +");
    OK(mbm_node_readCoils(n, 0, 24));
    assert_int_equal(WORD(1), 0x00FF);
    assert_int_equal(mbm_node_available(n), 2);
    /* The bits beyond the requested quantity are no data, whatever the device sends. */
    sim_answer(s, 1, 100, "11 01 01 FF +");
    OK(mbm_node_readCoils(n, 0, 3));
    assert_int_equal(WORD(0), 0x0007);
}

SIM_TEST(coil_pad_bits_are_sent_as_zero)
{
    s->transmit[0] = 0xFFFF;
    sim_answer(s, 1, 100, "11 0F 00 00 00 03 +");
    OK(mbm_node_writeMultipleCoils(n, 0, 3));
    LAST("11 0F 00 00 00 03 01 07 +");
    sim_answer(s, 1, 100, "11 0F 00 00 00 09 +");
    OK(mbm_node_writeMultipleCoils(n, 0, 9));
    LAST("11 0F 00 00 00 09 02 FF 01 +");
}

SIM_TEST(a_transmit_word_that_the_program_sets_leaves_the_queue)
{
    mbm_node_beginTransmission(n, 7);
    s->transmit[122] = 1;
    s->transmit[0] = 0xAAAA;
    OK(mbm_node_send(n, 0xBBBB));
    sim_answer(s, 1, 100, "11 10 00 07 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 07 00 01 02 BB BB +");
}

SIM_TEST(words_that_the_program_changes_leave_the_indices_alone)
{
    sim_answer(s, 1, 100, "11 03 04 00 01 00 02 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    assert_int_equal(mbm_node_receive(n), 1);
    memset(s->response, 0, sizeof s->response);
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(mbm_node_receive(n), 0);
    mbm_node_beginTransmission(n, 3);
    mbm_node_send(n, 0x1111);
    memset(s->transmit, 0, sizeof s->transmit);
    mbm_node_send(n, 0x2222);
    sim_answer(s, 1, 100, "11 10 00 03 00 02 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 03 00 02 04 00 00 22 22 +");
}

SIM_TEST(begin_transmission_empties_the_queue_and_keeps_the_words)
{
    mbm_node_beginTransmission(n, 1);
    mbm_node_send(n, 0x1111);
    mbm_node_send(n, 0x2222);
    mbm_node_beginTransmission(n, 2);
    mbm_node_send(n, 0x3333);
    sim_answer(s, 1, 100, "11 10 00 02 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 02 00 01 02 33 33 +");
    sim_answer(s, 1, 100, "11 10 00 09 00 02 +");
    OK(mbm_node_writeMultipleRegisters(n, 9, 2));
    LAST("11 10 00 09 00 02 04 33 33 22 22 +");
}

SIM_TEST(send_queues_words)
{
    mbm_node_beginTransmission(n, 0x100);
    OK(mbm_node_send(n, 0x1234));
    OK(mbm_node_send(n, 0xAB));
    sim_answer(s, 1, 100, "11 10 01 00 00 02 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 01 00 00 02 04 12 34 00 AB +");
}

SIM_TEST(send_bit_queues_bits_lowest_first)
{
    static const uint8_t bits[] = {1, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1, 9};

    memset(s->transmit, 0xFF, sizeof s->transmit);
    mbm_node_beginTransmission(n, 5);
    for (size_t i = 0; i < COUNT(bits); i++)
        OK(mbm_node_sendBit(n, bits[i]));
    sim_answer(s, 1, 100, "11 0F 00 05 00 12 +");
    OK(mbm_node_writeQueuedCoils(n));
    LAST("11 0F 00 05 00 12 03 8D 80 03 +");
}

SIM_TEST(a_word_after_bits_starts_a_new_word)
{
    mbm_node_beginTransmission(n, 5);
    mbm_node_sendBit(n, 1);
    mbm_node_sendBit(n, 1);
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 10 00 05 00 02 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 05 00 02 04 00 03 12 34 +");
}

SIM_TEST(queued_registers_are_complete_words_only)
{
    mbm_node_beginTransmission(n, 5);
    for (unsigned i = 0; i < 17; i++)
        mbm_node_sendBit(n, 1);
    sim_answer(s, 1, 100, "11 10 00 05 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 05 00 01 02 FF FF +");
}

SIM_TEST(words_beyond_the_transmit_buffer_are_not_queued)
{
    mbm_node_beginTransmission(n, 0);
    for (unsigned i = 0; i < 123; i++)
        OK(mbm_node_send(n, 1));
    assert_int_equal(mbm_node_send(n, 3), MBM_BUFFER_TOO_SMALL);
    assert_int_equal(s->transmit[122], 1);
    assert_int_equal(mbm_node_sendBit(n, 1), MBM_BUFFER_TOO_SMALL);
    sim_answer(s, 1, 100, "11 10 00 00 00 7B +");
    OK(mbm_node_writeQueuedRegisters(n));
    assert_int_equal(s->frames[0].length, 9 + 2 * 123);
}

SIM_TEST(any_transaction_empties_the_queue_but_keeps_the_words)
{
    mbm_node_beginTransmission(n, 5);
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 03 02 00 01 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    /* A quantity of 0 gets the status that a device would return. Nothing is sent. */
    assert_int_equal(mbm_node_writeQueuedRegisters(n), MBM_ILLEGAL_DATA_VALUE);
    assert_int_equal(mbm_node_writeQueuedCoils(n), MBM_ILLEGAL_DATA_VALUE);
    assert_int_equal(mbm_node_readWriteQueuedRegisters(n, 0, 1), MBM_ILLEGAL_DATA_VALUE);
    assert_int_equal(s->sent, 1);
    assert_int_equal(s->transmit[0], 0x1234);
}

SIM_TEST(a_failed_transaction_empties_the_queue_and_rewinds_receive)
{
    sim_answer(s, 1, 100, "11 03 04 00 01 00 02 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 2));
    assert_int_equal(mbm_node_receive(n), 1);
    mbm_node_beginTransmission(n, 5);
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 86 04 +");
    assert_int_equal(mbm_node_writeSingleRegister(n, 1, 2), MBM_SERVER_DEVICE_FAILURE);
    assert_int_equal(mbm_node_receive(n), 1);
    assert_int_equal(mbm_node_writeQueuedRegisters(n), MBM_ILLEGAL_DATA_VALUE);
}

SIM_TEST(the_write_address_is_shared_by_all_writing_functions)
{
    sim_answer(s, 1, 100, "11 06 00 55 00 09 +");
    OK(mbm_node_writeSingleRegister(n, 0x55, 9));
    mbm_node_send(n, 0x1234);
    sim_answer(s, 1, 100, "11 10 00 55 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
    LAST("11 10 00 55 00 01 02 12 34 +");
    sim_answer(s, 1, 100, "11 05 00 66 00 00 +");
    OK(mbm_node_writeSingleCoil(n, 0x66, 0));
    mbm_node_sendBit(n, 1);
    sim_answer(s, 1, 100, "11 0F 00 66 00 01 +");
    OK(mbm_node_writeQueuedCoils(n));
    LAST("11 0F 00 66 00 01 01 01 +");
    sim_answer(s, 1, 100, "11 16 00 77 00 00 00 00 +");
    OK(mbm_node_maskWriteRegister(n, 0x77, 0, 0));
    mbm_node_send(n, 0xAAAA);
    sim_answer(s, 1, 100, "11 17 02 00 01 +");
    OK(mbm_node_readWriteQueuedRegisters(n, 3, 1));
    LAST("11 17 00 03 00 01 00 77 00 01 02 AA AA +");
}

SIM_TEST(single_writes_overwrite_the_first_transmit_words)
{
    memset(s->transmit, 0xEE, sizeof s->transmit);
    sim_answer(s, 1, 100, "11 06 00 01 12 34 +");
    OK(mbm_node_writeSingleRegister(n, 1, 0x1234));
    assert_int_equal(s->transmit[0], 0x1234);
    assert_int_equal(s->transmit[1], 0xEEEE);
    sim_answer(s, 1, 100, "11 16 00 01 00 0A 00 0B +");
    OK(mbm_node_maskWriteRegister(n, 1, 10, 11));
    assert_int_equal(s->transmit[0], 10);
    assert_int_equal(s->transmit[1], 11);
    assert_int_equal(s->transmit[2], 0xEEEE);
}

SIM_TEST(a_read_makes_exactly_its_words_available_to_receive)
{
    sim_answer(s, 1, 100, "11 03 02 AB CD +");
    OK(mbm_node_readHoldingRegisters(n, 6, 1));
    LAST("11 03 00 06 00 01 +");
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(mbm_node_receive(n), 0xABCD);
    assert_int_equal(mbm_node_available(n), 0);
    assert_int_equal(mbm_node_receive(n), 0xFFFF);
    sim_answer(s, 1, 100, "11 83 02 +");
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_readHoldingRegisters(n, 6, 1));
    assert_int_equal(mbm_node_available(n), 0);
}

SIM_TEST(begin_is_cheap_and_switches_slaves)
{
    s->transmit[3] = 0x4711;
    mbm_node_setResponseTimeout(n, 50);
    sim_begin(s, 2);
    sim_answer(s, 1, 100, "02 03 02 00 07 +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    LAST("02 03 00 00 00 01 +");
    mbm_node_send(n, 1);
    sim_begin(s, 3);
    assert_int_equal(mbm_node_getSlaveID(n), 3);
    assert_int_equal(WORD(0), 7);
    assert_int_equal(s->transmit[3], 0x4711);
    /* The queue is empty, the settings stay. */
    assert_int_equal(mbm_node_writeQueuedRegisters(n), MBM_ILLEGAL_DATA_VALUE);
    s->limit = s->now + 100000;
    assert_int_equal(mbm_node_readHoldingRegisters(n, 0, 1), MBM_RESPONSE_TIMED_OUT);
}

SIM_TEST(set_slave_id_counts_from_the_next_request_on)
{
    sim_answer(s, 1, 100, "F7 03 02 00 07 +");
    OK(mbm_node_setSlaveID(n, 247));
    assert_int_equal(mbm_node_getSlaveID(n), 247);
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
}
