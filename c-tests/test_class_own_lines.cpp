/* A board with as little RAM as an Uno, and objects that have a line each. */
#define SHIM_UARTS 1
#define RAMEND 0x08FF
#define MODBUSMASTER_OWN_LINES
#include "wire.h"

fixture each_test = {reset_board, nullptr};

static HardwareSerial other_line;

TEST_ROW(objects_have_a_line_each,
         assert_in_range(sizeof(ModbusMaster),
                         2 * (125 + 123) + sizeof(mbm_line) + sizeof(mbm_node) + 255, 1300))

TEST(two_objects_have_a_pending_request_at_the_same_time)
{
    ModbusMaster first, second;
    first.begin(1, Serial);
    second.begin(2, other_line);
    first.setBlocking(false);
    second.setBlocking(false);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    other_line.reply(adu({2, 3, 2, 0, 8}));
    assert_int_equal(first.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    assert_int_equal(second.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    for (int i = 0; i < 1000; i++) {
        first.poll();
        second.poll();
        board().now += 100;
    }
    assert_int_equal(first.status(), 0);
    assert_int_equal(first.getResponseBuffer(0), 7);
    assert_int_equal(second.status(), 0);
    assert_int_equal(second.getResponseBuffer(0), 8);
}
