/* The faults of ModbusMaster 2.0.1 that this class does not have. */
#include "wire.h"

fixture each_test = {reset_board, nullptr};

#if defined(_UTIL_CRC16_H_)
#error "the guard of avr-libc's <util/crc16.h> is taken"
#endif

static const uint32_t gap_without_baud_rate = 4000;

MASTER_TEST(available_counts_every_word)
{
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.available(), 1);
    assert_int_equal(node.receive(), 7);
    assert_int_equal(node.available(), 0);
}

MASTER_TEST(the_largest_reads_are_complete)
{
    Bytes registers = raw({1, 3, 250}), coils = raw({1, 1, 250});
    for (int i = 0; i < 250; i++) {
        registers.push_back(static_cast<uint8_t>(i));
        coils.push_back(static_cast<uint8_t>(255 - i));
    }
    Serial.reply(sealed(registers));
    assert_int_equal(node.readHoldingRegisters(0, 125), 0);
    assert_int_equal(node.available(), 125);
    for (int i = 0; i < 125; i++)
        assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(i)),
                         (2 * i) << 8 | (2 * i + 1));
    Serial.reply(sealed(coils));
    assert_int_equal(node.readCoils(0, 2000), 0);
    for (int i = 0; i < 125; i++)
        assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(i)),
                         (254 - 2 * i) << 8 | (255 - 2 * i));
}

MASTER_TEST(writes_of_more_than_the_buffer_send_nothing)
{
    for (int quantity : {124, 256, 257, 65535}) {
        uint16_t words = static_cast<uint16_t>(quantity);
        assert_int_equal(node.writeMultipleRegisters(0, words), 3);
        assert_int_equal(node.readWriteMultipleRegisters(0, 1, 0, words), 3);
    }
    for (int quantity : {1969, 4096, 4097, 65535})
        assert_int_equal(node.writeMultipleCoils(0, static_cast<uint16_t>(quantity)), 3);
    assert_int_equal(Serial.sent.size(), 0);
}

MASTER_TEST(a_lenient_object_accepts_replies_that_deviate)
{
    node.setResponseTimeout(50);
    node.setLenient(true);
    Serial.reply(adu({1, 6, 0, 1, 0, 8}));
    assert_int_equal(node.writeSingleRegister(1, 7), 0);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 4), 0);
    assert_int_equal(node.available(), 1);
    assert_int_equal(node.getResponseBuffer(0), 7);
    node.setSlaveID(0);
    Serial.reply(adu({0, 3, 2, 0, 9}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 9);
    node.setLenient(false);
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBBroadcastNotAllowed);
}

class Babbler : public Stream {
public:
    int available() override { return 1; }
    int read() override { return 0x55; }
    int peek() override { return 0x55; }
    size_t write(uint8_t) override { return 1; }
};

TEST(a_request_on_a_line_that_is_never_silent_times_out)
{
    Babbler babbler;
    ModbusMaster node;
    node.begin(1, babbler);
    node.setResponseTimeout(100);
    board().tick = 2; /* one poll reads up to 255 bytes, and the clock once for each */
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBLineBusy);
    assert_in_range(board().now, 100000, 105000); /* the timeout and the gap */
}

TEST(a_request_on_a_port_that_accepts_no_bytes_times_out)
{
    ModbusMaster node;
    Serial.writeSpace = 0;
    node.begin(1, Serial);
    node.setResponseTimeout(100);
    node.postTransmission([] { board().logEvent("post"); });
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBLineBusy);
    assert_string_equal(board().log.c_str(), "post ");
}

/* Returns the silence before a request that follows a successful one. */
static uint32_t silence_before(ModbusMaster &first, ModbusMaster &second,
                               HardwareSerial &port = Serial)
{
    port.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(first.readHoldingRegisters(0, 1), 0);
    /* The last of the seven bytes has come. */
    uint32_t end = port.sentAt + port.delay + 6 * port.character;
    port.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(second.readHoldingRegisters(0, 1), 0);
    return port.startedAt - end;
}

MASTER_TEST(a_silence_is_kept_before_each_request)
{
    assert_in_range(silence_before(node, node), gap_without_baud_rate - 100,
                    gap_without_baud_rate + 100);
    node.setBaudRate(115200);
    assert_in_range(silence_before(node, node), 1650, 1850);
    node.setGap(9000);
    assert_in_range(silence_before(node, node), 8900, 9100);
    node.begin(9600);
    assert_in_range(silence_before(node, node), 3911, 4111);
}

#if !defined(MODBUSMASTER_SHARE_LINE)
/* A port that tells its rate, as those of the ESP8266 and the ESP32. */
class RatedSerial : public HardwareSerial {
public:
    int baudRate() { return static_cast<int>(baud); }
};

TEST(the_silence_follows_the_rate_that_the_port_tells)
{
    RatedSerial port;
    ModbusMaster node;
    node.begin(1, port);
    assert_in_range(silence_before(node, node, port), gap_without_baud_rate - 100,
                    gap_without_baud_rate + 100); /* it is closed */
    port.begin(19200);
    node.begin(1, port);
    assert_in_range(silence_before(node, node, port), 1950, 2100);
    ModbusMaster copy(node);
    assert_in_range(silence_before(copy, copy, port), 1950, 2100);
    port.begin(115200);
    node.begin(1, port);
    assert_in_range(silence_before(node, node, port), 1700, 1850);
    /* The rate of another port is not known. */
    node.begin(1, Serial);
    assert_in_range(silence_before(node, node), gap_without_baud_rate - 100,
                    gap_without_baud_rate + 100);
}

TEST(a_rate_or_gap_that_the_sketch_sets_stays_whatever_the_port_tells)
{
    RatedSerial port;
    ModbusMaster paced, slow;
    port.begin(115200);
    paced.setGap(9000);
    paced.begin(1, port);
    assert_in_range(silence_before(paced, paced, port), 8900, 9100);
    slow.begin(1, port);
    slow.setBaudRate(2400);
    slow.begin(1, port);
    assert_in_range(silence_before(slow, slow, port), 15900, 16200);
    slow.begin(1, Serial);
    assert_in_range(silence_before(slow, slow), 15900, 16200);
}

TEST(a_hook_cannot_change_the_rate_by_begin)
{
    static RatedSerial port;
    static ModbusMaster node;
    port.begin(19200);
    node.begin(1, port);
    port.begin(115200);
    node.preTransmission([] { node.begin(1, port); });
    assert_in_range(silence_before(node, node, port), 1950, 2100);
}
#endif

TEST(the_silence_counts_from_another_objects_last_use)
{
    ModbusMaster first, second;
    first.begin(1, Serial);
    second.begin(1, Serial);
    board().now += 1000000;
    for (int again = 0; again < 3; again++) {
        assert_in_range(silence_before(first, second), gap_without_baud_rate,
                        gap_without_baud_rate + 100);
        assert_in_range(silence_before(second, first), gap_without_baud_rate,
                        gap_without_baud_rate + 100);
    }
}

MASTER_TEST(a_line_that_was_silent_for_long_enough_needs_no_wait)
{
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    board().now += 1000000;
    uint32_t other_request = board().now;
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_in_range(Serial.startedAt - other_request, 0, 200);
}

TEST(a_pause_between_two_objects_counts_as_silence)
{
    ModbusMaster first, second;
    first.begin(1, Serial);
    second.begin(1, Serial);
    board().now += 100000000; /* later than any time of an earlier test */
    uint32_t other_request = board().now;
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(first.readHoldingRegisters(0, 1), 0);
    assert_in_range(Serial.startedAt - other_request, 0, 200);
    board().now += 1000000;
    other_request = board().now;
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(second.readHoldingRegisters(0, 1), 0);
    assert_in_range(Serial.startedAt - other_request, 0, 200);
}

/* A device whose first reply is later than the timeout. It replies to all requests in order. */
MASTER_TEST(a_late_reply_is_not_taken_for_that_of_a_later_request)
{
    node.setResponseTimeout(50);
    assert_int_equal(node.readHoldingRegisters(0, 1), node.ku8MBResponseTimedOut);
    Serial.reply(joined(adu({1, 3, 2, 0, 0}), adu({1, 3, 2, 0, 1})));
    for (int value = 1; value < 5; value++) {
        if (value > 1)
            Serial.reply(adu({1, 3, 2, 0, value}));
        assert_int_equal(node.readHoldingRegisters(static_cast<uint16_t>(value), 1), 0);
        assert_int_equal(node.getResponseBuffer(0), value);
    }
}

MASTER_TEST(the_response_timeout_can_be_set)
{
    for (int ms : {1, 200, 5000}) {
        node.setResponseTimeout(static_cast<uint16_t>(ms));
        node.setQuietTime(0);
        node.setGap(0);
        assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBResponseTimedOut);
        assert_in_range(board().now - Serial.sentAt, ms * 1000, ms * 1000 + 200);
    }
}

/* The time of a call without a reply: that of the request on the wire, and the timeout. */
static uint32_t failing_call(ModbusMaster &node)
{
    uint32_t began = board().now;
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    return board().now - began;
}

TEST(the_quiet_time_counts_from_the_failure_while_the_sketch_does_other_work)
{
    const uint32_t request = 8 * 573, call = request + 200000, slack = 500;
    ModbusMaster node, other;
    node.begin(1, Serial);
    other.begin(2, Serial);
    node.setResponseTimeout(200);
    other.setResponseTimeout(200);
    board().now += 1000000;
    assert_in_range(failing_call(node), call, call + slack);
    for (uint32_t pause : {150000u, 100000u, 60000u, 1000u}) {
        uint32_t left = pause < 100000 ? 100000 - pause : 0;
        board().now += pause;
        node.begin(1, Serial); /* some sketches do so before each request */
        assert_in_range(failing_call(node), call + left, call + left + slack);
    }
    /* For another object on the same line only the gap counts, not the quiet time. */
    assert_in_range(failing_call(other), call, call + 4000 + slack);
    board().now += 100000;
    assert_in_range(failing_call(node), call, call + slack);
}

TEST(a_broadcast_succeeds_after_the_turnaround_delay)
{
    ModbusMaster node;
    node.begin(0, Serial);
    node.setTurnaroundDelay(70);
    assert_int_equal(node.writeSingleRegister(1, 2), 0);
    assert_sent(Serial, {0, 6, 0, 1, 0, 2});
    assert_in_range(board().now - Serial.sentAt, 70000, 70200);
    assert_int_equal(node.readCoils(0, 1), ModbusMaster::ku8MBBroadcastNotAllowed);
    assert_int_equal(Serial.sent.size(), 0);
}

MASTER_TEST(a_reply_complete_as_the_deadline_passes_succeeds)
{
    node.idle([] { board().now += 3000000; });
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 7);
}

MASTER_TEST(a_word_after_bits_starts_a_new_word)
{
    node.beginTransmission(0);
    node.sendBit(true);
    node.send(0x0203);
    Serial.reply(adu({1, 16, 0, 0, 0, 2}));
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_sent(Serial, {1, 16, 0, 0, 0, 2, 4, 0, 1, 2, 3});
}

TEST(callbacks_may_have_a_context)
{
    char log[] = "...";
    ModbusMaster node;
    node.preTransmission([](void *at) { *static_cast<char *>(at) = 'p'; }, log);
    node.postTransmission([](void *at) { *static_cast<char *>(at) = 'q'; }, log + 1);
    node.idle([](void *at) { *static_cast<char *>(at) = 'i'; }, log + 2);
    node.begin(1, Serial);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_string_equal(log, "pqi");
}

TEST(the_driver_can_be_held_on_after_the_flush)
{
    static uint32_t released;
    ModbusMaster node;
    node.begin(9600);
    node.setPostFlushHold(2);
    node.postTransmission([] { released = board().now; });
    Serial.delay = 10000;
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_in_range(released - Serial.sentAt, 2 * 1146, 2 * 1146 + 100);
}

MASTER_TEST(an_echo_is_dropped_with_setEcho)
{
    node.setResponseTimeout(50);
    node.setEchoDiscard(true);
    Serial.reply(adu({1, 6, 0, 1, 0, 2}));
    assert_int_equal(node.writeSingleRegister(1, 2), ModbusMaster::ku8MBResponseTimedOut);
    Serial.reply(joined(adu({1, 6, 0, 1, 0, 2}), adu({1, 6, 0, 1, 0, 2})));
    assert_int_equal(node.writeSingleRegister(1, 2), 0);
    Serial.reply(joined(adu({1, 3, 0, 0, 0, 1}), adu({1, 3, 2, 0, 7})));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
}

MASTER_TEST(the_wait_yields)
{
    node.setResponseTimeout(100);
    unsigned before = board().yields;
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBResponseTimedOut);
    assert_true(board().yields - before > 4000);
}

TEST(a_request_without_a_reply_is_repeated_with_setRetries)
{
    mbm_counters counters = {};
    ModbusMaster node;
    node.begin(1, Serial);
    node.setRetries(2);
    node.setCounters(&counters);
    node.setResponseTimeout(50);
    Serial.reply(raw({}));
    Serial.reply(raw({1, 3, 2, 0, 7, 0, 0}));
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
    assert_int_equal(Serial.sent.size(), 3);
    assert_int_equal(counters.requests, 3);
    assert_int_equal(counters.timeouts, 1);
    assert_int_equal(counters.badCrc, 1);
}

MASTER_TEST(a_request_may_be_polled_or_cancelled)
{
    node.setBlocking(false);
    Serial.reply(adu({1, 3, 2, 0, 7}));
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    assert_int_equal(node.status(), ModbusMaster::ku8MBPending);
    while (node.poll() == ModbusMaster::ku8MBPending) {
    }
    assert_int_equal(node.status(), 0);
    assert_int_equal(node.receive(), 7);
    assert_int_equal(node.readHoldingRegisters(0, 1), ModbusMaster::ku8MBPending);
    node.cancel();
    assert_int_equal(node.poll(), ModbusMaster::ku8MBCancelled);
}
