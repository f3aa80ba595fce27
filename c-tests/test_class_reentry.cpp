/* Calls from within an object's own callbacks are refused and change nothing. */
#include "server_checks.h"

#include "ModbusMaster.h"

fixture each_test = {reset_board, nullptr};

static ModbusMaster *calling;
static ModbusServer *polled;
static unsigned entered;
static HardwareSerial elsewhere;

static void begin_elsewhere()
{
    ModbusMaster fresh;
    entered++;
    calling->begin(2, elsewhere);
    *calling = fresh;
    fresh = *calling;
    assert_int_equal(calling->readCoils(0, 1), ModbusMaster::ku8MBBusy);
    assert_int_equal(calling->status(), ModbusMaster::ku8MBBusy);
}

TEST(callbacks_around_a_request_cannot_begin_or_assign_their_master)
{
    ModbusMaster node;
    calling = &node;
    entered = 0;
    node.begin(1, Serial);
    node.setResponseTimeout(20);
    node.preTransmission(begin_elsewhere);
    node.postTransmission(begin_elsewhere);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 7);
    assert_int_equal(node.getSlaveID(), 1);
    assert_int_equal(entered, 2);
}

static void use_words()
{
    entered++;
    assert_int_equal(calling->getResponseBuffer(0), 7);
    assert_int_equal(calling->setTransmitBuffer(1, 8), 0);
    calling->clearResponseBuffer();
}

TEST(callbacks_around_a_request_may_use_the_words)
{
    ModbusMaster node;
    calling = &node;
    entered = 0;
    node.begin(1, Serial);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    node.preTransmission(use_words);
    Serial.reply(adu({1, 3, 2, 0, 9}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(entered, 1);
    assert_int_equal(node.getResponseBuffer(0), 9);
    node.preTransmission(nullptr);
    node.setTransmitBuffer(0, 6);
    Serial.sent.clear();
    Serial.reply(adu({1, 16, 0, 0, 0, 2}));
    assert_int_equal(node.writeMultipleRegisters(0, 2), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 2, 4, 0, 6, 0, 8});
}

static uint8_t begin_other(const mbm_access &)
{
    entered++;
    IS(MBM_BUSY, polled->begin(9, elsewhere, 9600));
    IS(MBM_BUSY, polled->beginAscii(9, elsewhere));
    IS(MBM_BUSY, polled->poll());
    assert_int_equal(polled->getUnitID(), 17);
    polled->setBaudRate(300);
    return 0;
}

TEST(hooks_cannot_begin_their_server)
{
    ModbusRegisterArray<2> registers;
    ModbusServer server;
    polled = &server;
    entered = 0;
    ModbusHooks hooks;
    hooks.beforeWrite(begin_other);
    registers.setHooks(hooks);
    OK(server.holdingRegisters(registers));
    OK(server.begin(17, Serial, 19200));
    expect_response(server, {17, 6, 0, 1, 0, 5}, {17, 6, 0, 1, 0, 5});
    expect_response(server, {17, 6, 0, 1, 0, 6}, {17, 6, 0, 1, 0, 6});
    assert_int_equal(entered, 2);
    assert_int_equal(registers[1], 6);
}

TEST(several_units_may_serve_one_array)
{
    ModbusRegisterArray<2> registers;
    ModbusUnit units[] = {{17}, {18}};
    ModbusServer server;
    OK(units[0].holdingRegisters(registers));
    OK(units[1].holdingRegisters(registers));
    IS(MBM_BUSY, units[1].inputRegisters(registers));
    OK(server.begin(units, Serial, 19200));
    expect_response(server, {17, 6, 0, 1, 0, 5}, {17, 6, 0, 1, 0, 5});
    expect_response(server, {18, 3, 0, 1, 0, 1}, {18, 3, 2, 0, 5});
}
