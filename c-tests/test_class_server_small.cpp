/* ModbusServer with the frame buffer that it has on AVR. */
#define MODBUSSERVER_FRAME_BYTES MBM_FRAME_BYTES(64)
#include "wire.h"

#include "ModbusServer.h"

static ModbusRegisterArray<125> registers;
static ModbusServer server;

static void receive(const Bytes &bytes)
{
    Serial.inject(bytes);
    for (unsigned i = 0; i < 1000; i++)
        OK(server.poll());
}

static void start()
{
    reset_board();
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
}

fixture each_test = {start, nullptr};

TEST(an_object_is_little_more_than_its_frame)
{
    assert_true(sizeof server <=
                MBM_FRAME_BYTES(64) + sizeof(mbm_server) + sizeof(mbm_unit) + 9 * sizeof(void *));
    assert_true(sizeof(ModbusRegisters) == sizeof(mbm_registerTable));
    assert_true(sizeof(ModbusBits) == sizeof(mbm_bitTable));
}

TEST(transfers_of_64_registers_fit)
{
    Bytes write = raw({17, 16, 0, 0, 0, 64, 128});
    Bytes response = raw({17, 3, 128});
    for (int i = 0; i < 128; i++)
        write.push_back(static_cast<uint8_t>(i));
    response.insert(response.end(), write.begin() + 7, write.end());
    receive(sealed(write));
    assert_sent(Serial, {17, 16, 0, 0, 0, 64});
    assert_int_equal(registers[63], 126 << 8 | 127);
    receive(adu({17, 3, 0, 0, 0, 64}));
    assert_int_equal(Serial.sent.size(), 1);
    assert_bytes(Serial.sent[0], sealed(response));
}

TEST(a_longer_response_becomes_an_exception)
{
    receive(adu({17, 3, 0, 0, 0, 125}));
    assert_sent(Serial, {17, 0x83, 4});
}

TEST(a_request_longer_than_the_buffer_is_ignored)
{
    Bytes write = raw({17, 16, 0, 0, 0, 123, 246});
    write.resize(7 + 246, 0xEE);
    registers[0] = 1;
    receive(sealed(write));
    assert_int_equal(Serial.sent.size(), 0);
    assert_int_equal(registers[0], 1);
    receive(adu({17, 3, 0, 0, 0, 1}));
    assert_sent(Serial, {17, 3, 2, 0, 1});
}
