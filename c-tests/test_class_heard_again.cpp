/* What a lost reply costs a sketch: one that waits for each reply, with the defaults, and one that
 * cancels its requests. On a board with as little RAM as an Uno, whose objects share a line. */
#define SHIM_UARTS 1
#define RAMEND 0x08FF
#include "wire.h"

fixture each_test = {reset_board, nullptr};

enum : uint32_t { MS = 1000 };

static ModbusMaster node;

static void begin(uint8_t unit = 1)
{
    node.begin(unit, Serial);
    node.setBlocking(true);
}

/* Reads a register without waiting for longer than the limit, as a sketch with a loop does. */
static uint8_t reads(uint32_t limit)
{
    const uint32_t began = board().now;
    uint8_t status = node.readHoldingRegisters(0, 1);

    while (status == ModbusMaster::ku8MBPending) {
        if (board().now - began >= limit) {
            node.cancel();
            IS(MBM_CANCELLED, node.status());
            return MBM_CANCELLED;
        }
        board().now += 100;
        status = node.poll();
    }
    if (status == 0)
        assert_int_equal(node.getResponseBuffer(0), 7);
    return status;
}

/* The next reply holds the value until no other one can follow it: that takes the response timeout.
 */
TEST(with_the_defaults_one_lost_reply_costs_one_more_response_timeout)
{
    begin();
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    const uint32_t began = board().now;
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 7);
    assert_in_range(board().now - began, 2100 * MS, 2125 * MS);
    const uint32_t later = board().now;
    Serial.reply(adu({1, 3, 2, 0, 8}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 8);
    assert_in_range(board().now - later, 0, 20 * MS);
}

TEST(a_sketch_that_cancels_its_requests_hears_the_device_again)
{
    for (uint32_t limit : {30 * MS, 60 * MS, 120 * MS, 400 * MS}) {
        reset_board();
        begin();
        node.setResponseTimeout(200);
        node.setBlocking(false);
        assert_int_not_equal(reads(limit), 0); /* there is no reply */
        const uint32_t lost = board().now;
        /* The device answers the next request that is really sent. */
        Serial.reply(adu({1, 3, 2, 0, 7}));
        for (;;) {
            const size_t sent = Serial.sent.size();
            const uint32_t began = board().now;
            if (reads(limit) == 0)
                break;
            /* The request waits for its unit, or was sent so late that its reply missed the limit.
             */
            assert_in_range(began - lost, 0, 5 * 200 * MS);
            if (Serial.sent.size() > sent)
                Serial.reply(adu({1, 3, 2, 0, 7}));
        }
        for (int again = 0; again < 50; again++) {
            Serial.reply(adu({1, 3, 2, 0, 7}));
            assert_int_equal(reads(limit), 0);
        }
    }
}

/* A second node on the line is read at once, though the first one waits for its unit. */
TEST(a_node_that_waits_for_its_unit_does_not_keep_another_one_from_the_line)
{
    ModbusMaster other;

    begin();
    other.begin(2, Serial);
    node.setBlocking(false);
    IS(MBM_CANCELLED, reads(50 * MS));
    board().now += 150 * MS;
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    for (int i = 0; i < 100; i++)
        assert_int_equal(node.poll(), ModbusMaster::ku8MBPending);
    Serial.reply(adu({2, 3, 2, 0, 9}));
    const uint32_t began = board().now;
    assert_int_equal(other.readHoldingRegisters(0, 1), 0);
    assert_int_equal(other.getResponseBuffer(0), 9);
    assert_in_range(board().now - began, 0, 30 * MS);
    IS(MBM_CANCELLED, node.poll());
}

/* It is refused, and the pending one still reads from its own Stream. */
TEST(a_request_that_is_refused_leaves_the_pending_one_to_its_node)
{
    ModbusMaster other;
    HardwareSerial another_line;

    begin(5); /* which the tests above have not asked */
    other.begin(2, another_line);
    node.setBlocking(false);
    Serial.reply(adu({5, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    while (Serial.sent.empty()) {
        assert_int_equal(node.poll(), ModbusMaster::ku8MBPending);
        assert_int_equal(other.readHoldingRegisters(0, 1), ModbusMaster::ku8MBBusy);
    }
    assert_int_equal(other.readHoldingRegisters(0, 1), ModbusMaster::ku8MBBusy);
    board().now += 10 * MS;
    while (node.poll() == ModbusMaster::ku8MBPending)
        board().now += 100;
    assert_int_equal(node.status(), 0);
    assert_int_equal(node.getResponseBuffer(0), 7);
    assert_true(another_line.sent.empty());
}
