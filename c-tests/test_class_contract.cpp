/* What sketches for ModbusMaster rely on: the order of one transaction, and the state that it
 * leaves. */
// Included before cmocka, whose macro `fail` breaks the C++ library.
#include <memory>
#include <vector>

#include "wire.h"

fixture each_test = {reset_board, nullptr};

static void logs_callbacks(ModbusMaster &node)
{
    node.preTransmission([] { board().logEvent("pre"); });
    node.postTransmission([] { board().logEvent("post"); });
    node.idle([] { board().logEvent("idle"); });
}

TEST(a_transaction_discards_old_bytes_then_sends_then_waits)
{
    ModbusMaster node;
    Serial.character = 0;
    node.begin(1, Serial);
    logs_callbacks(node);
    for (int again = 0; again < 2; again++) {
        board().log.clear();
        Serial.inject(adu({1, 4, 2, 0x66, 0x66}));
        Serial.reply(adu({1, 3, 2, 0, 7}));
        assert_int_equal(node.readHoldingRegisters(0, 1), 0);
        assert_int_equal(node.getResponseBuffer(0), 7);
        assert_string_equal(board().log.c_str(), "read pre write flush post idle read ");
    }
}

TEST(a_write_taken_in_pieces_stays_between_the_callbacks)
{
    ModbusMaster node;
    Serial.character = 0;
    Serial.writeSpace = 3;
    node.begin(1, Serial);
    logs_callbacks(node);
    for (int again = 0; again < 2; again++) { /* first byte by byte, then in blocks */
        board().log.clear();
        Serial.reply(adu({1, 3, 2, 0, 7}));
        assert_int_equal(node.readHoldingRegisters(0, 1), 0);
        assert_sent(Serial, {1, 3, 0, 0, 0, 1});
        assert_string_equal(board().log.c_str(), "pre write flush post idle read ");
    }
}

TEST(idle_is_called_only_while_the_master_waits_for_a_reply)
{
    static unsigned yields_before_sending;
    ModbusMaster node;
    node.begin(1, Serial);
    node.setGap(15000);
    node.setResponseTimeout(20);
    logs_callbacks(node);
    node.preTransmission([] { yields_before_sending = board().yields; });
    assert_int_equal(node.readCoils(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    assert_string_equal(board().log.c_str(), "write flush post idle ");
    assert_true(yields_before_sending > 100); // the wait for the silence yields too
}

MASTER_TEST(the_driver_is_off_again_after_a_failure)
{
    node.setResponseTimeout(20);
    logs_callbacks(node);
    node.idle(nullptr);
    assert_int_equal(node.writeSingleCoil(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    assert_string_equal(board().log.c_str(), "pre write flush post ");
}

TEST(the_response_timeout_is_two_seconds)
{
    ModbusMaster with_stream, of_version_0_9;
    with_stream.begin(1, Serial);
    of_version_0_9.begin(19200);
    for (ModbusMaster *node : {&with_stream, &of_version_0_9}) {
        assert_int_equal(node->readCoils(0, 1), ModbusMaster::ku8MBResponseTimedOut);
        assert_in_range(board().now - Serial.sentAt, 2000000, 2000200);
    }
}

MASTER_TEST(a_failure_keeps_the_response_words_and_a_transaction_the_transmit_words)
{
    node.setTransmitBuffer(0, 0x0A0B);
    Serial.reply(adu({1, 3, 4, 0, 7, 0, 8}));
    assert_int_equal(node.readHoldingRegisters(0, 2), 0);
    Serial.reply(raw({1, 3, 4, 9, 9, 9, 9, 0, 0}));
    assert_int_equal(node.readHoldingRegisters(0, 2), ModbusMaster::ku8MBInvalidCRC);
    assert_int_equal(node.getResponseBuffer(0), 7);
    assert_int_equal(node.getResponseBuffer(1), 8);
    Serial.sent.clear();
    Serial.reply(adu({1, 16, 0, 0, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(0, 1), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 1, 2, 0x0A, 0x0B});
}

MASTER_TEST(any_transaction_empties_the_queue)
{
    node.beginTransmission(0);
    node.send(0x1234);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.writeMultipleRegisters(), ModbusMaster::ku8MBIllegalDataValue);

    node.beginTransmission(0);
    node.send(0x1234);
    node.setResponseTimeout(5);
    assert_int_equal(node.writeMultipleRegisters(), ModbusMaster::ku8MBResponseTimedOut);
    Serial.sent.clear();
    node.send(0x5678);
    Serial.reply(adu({1, 16, 0, 0, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 1, 2, 0x56, 0x78});
}

MASTER_TEST(any_transaction_takes_receive_back_to_the_first_word)
{
    Serial.reply(adu({1, 3, 4, 0, 7, 0, 8}));
    assert_int_equal(node.readHoldingRegisters(0, 2), 0);
    assert_int_equal(node.receive(), 7);
    Serial.reply(adu({1, 6, 0, 0, 0, 1}));
    assert_int_equal(node.writeSingleRegister(0, 1), 0);
    assert_int_equal(node.receive(), 7);
}

MASTER_TEST(the_write_address_is_shared)
{
    node.beginTransmission(0x11);
    Serial.reply(adu({1, 6, 0, 0x55, 0, 1}));
    assert_int_equal(node.writeSingleRegister(0x55, 1), 0);
    Serial.sent.clear();
    node.send(9);
    Serial.reply(adu({1, 16, 0, 0x55, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 0x55, 0, 1, 2, 0, 9});
}

TEST(callbacks_survive_begin)
{
    ModbusMaster node;
    logs_callbacks(node);
    node.begin(1, Serial);
    node.begin(2, Serial);
    Serial.character = 0;
    Serial.reply(adu({2, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_string_equal(board().log.c_str(), "pre write flush post idle read ");
}

TEST(zero_and_nullptr_remove_callbacks)
{
    ModbusMaster node;
    logs_callbacks(node);
    node.preTransmission(nullptr);
    node.postTransmission(nullptr);
    node.idle(nullptr);
    Serial.character = 0;
    node.begin(1, Serial);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_string_equal(board().log.c_str(), "write flush read ");
}

MASTER_TEST(a_long_idle_does_not_lose_the_reply)
{
    node.idle([] { board().now += 1900000; });
    Serial.delay = 1500000;
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
}

TEST(an_idle_callback_may_use_another_object)
{
    static ModbusMaster other;
    ModbusMaster node;
    other.begin(2, Serial1);
    node.begin(1, Serial);
    Serial1.reply(adu({2, 3, 2, 0, 22}));
    Serial.reply(adu({1, 3, 2, 0, 11}));
    Serial.delay = 100000;
    node.idle([] {
        if (Serial1.sent.empty())
            assert_int_equal(other.readHoldingRegisters(0, 1), 0);
    });
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 11);
    assert_int_equal(other.getResponseBuffer(0), 22);
}

TEST(requests_of_an_idle_callback_on_its_own_object_are_refused)
{
    static ModbusMaster *self;
    static unsigned calls;
    ModbusMaster node;
    self = &node;
    calls = 0;
    node.begin(1, Serial);
    node.idle([] {
        calls++;
        assert_int_equal(self->readCoils(0, 1), ModbusMaster::ku8MBBusy);
    });
    Serial.reply(adu({1, 3, 2, 0, 11}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(Serial.sent.size(), 1);
    assert_true(calls > 10);
}

TEST(copies_have_buffers_and_callbacks_of_their_own)
{
    static int called;
    called = 0;
    std::unique_ptr<ModbusMaster> original(new ModbusMaster(5));
    original->begin(5, Serial);
    original->setResponseTimeout(40);
    original->preTransmission([](void *context) { ++*static_cast<int *>(context); }, &called);
    original->setTransmitBuffer(0, 0x0102);
    Serial.reply(adu({5, 3, 2, 0, 7}));
    assert_int_equal(original->readHoldingRegisters(0, 1), 0);

    ModbusMaster copy(*original), assigned;
    assigned = copy;
    original.reset();
    copy.setTransmitBuffer(0, 0x0304);
    assert_int_equal(copy.getResponseBuffer(0), 7);
    assert_int_equal(assigned.available(), 1);
    Serial.sent.clear();
    Serial.reply(adu({5, 16, 0, 0, 0, 1}));
    assert_int_equal(assigned.writeMultipleRegisters(0, 1), 0);
    assert_sent(Serial, {5, 16, 0, 0, 0, 1, 2, 1, 2});
    Serial.reply(adu({5, 16, 0, 0, 0, 1}));
    assert_int_equal(copy.writeMultipleRegisters(0, 1), 0);
    assert_sent(Serial, {5, 16, 0, 0, 0, 1, 2, 3, 4});
    assert_int_equal(called, 3);
    assert_int_equal(copy.readCoils(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    assert_in_range(board().now - Serial.sentAt, 40000, 40200);
}

MASTER_TEST(a_copy_leaves_a_pending_request_to_the_original)
{
    node.setBlocking(false);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    while (Serial.sent.empty())
        assert_int_equal(node.poll(), ModbusMaster::ku8MBPending);
    ModbusMaster copy(node);
    assert_int_equal(copy.status(), ModbusMaster::ku8MBCancelled);
    while (node.poll() == ModbusMaster::ku8MBPending) {
    }
    assert_int_equal(node.status(), 0);
    assert_int_equal(node.getResponseBuffer(0), 7);
    assert_int_equal(copy.getResponseBuffer(0), 0);
}

TEST(an_assignment_cancels_the_pending_request)
{
    ModbusMaster node, other;
    node.begin(1, Serial);
    node.setBlocking(false);
    node.setPostFlushHold(10);
    logs_callbacks(node);
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    while (Serial.sent.empty())
        assert_int_equal(node.poll(), ModbusMaster::ku8MBPending);
    assert_string_equal(board().log.c_str(), "pre write flush ");
    node = other;
    assert_string_equal(board().log.c_str(), "pre write flush post ");
}

TEST(an_assignment_to_itself_changes_nothing)
{
    ModbusMaster node, &alias = node;
    node.begin(1, Serial);
    node.beginTransmission(2);
    node.send(3);
    node = alias;
    Serial.reply(adu({1, 16, 0, 2, 0, 1}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 2, 0, 1, 2, 0, 3});
}

TEST(objects_live_in_containers_that_move_them)
{
    std::vector<ModbusMaster> nodes;
    for (uint8_t slave = 1; slave < 6; slave++) {
        nodes.push_back(ModbusMaster());
        nodes.back().begin(slave, Serial);
    }
    for (int slave = 1; slave < 6; slave++) {
        Serial.reply(adu({slave, 4, 2, 0, slave * 3}));
        ModbusMaster &node = nodes[static_cast<size_t>(slave) - 1];
        assert_int_equal(node.readInputRegisters(0, 1), 0);
        assert_int_equal(node.getResponseBuffer(0), slave * 3);
    }
}
