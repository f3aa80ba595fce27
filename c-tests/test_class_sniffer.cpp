/* ModbusSniffer on a simulated board: what it prints of a line that others use. */
#include "wire.h"

#include "ModbusSniffer.h"

fixture each_test = {reset_board, nullptr};

/* Collects the printed text. */
class Paper : public Print {
public:
    using Print::write;
    std::string text;
    size_t write(uint8_t value) override
    {
        text += static_cast<char>(value);
        return 1;
    }
};

/* Polls the sniffer for `ms` milliseconds. */
static void run_loop(ModbusSniffer &sniffer, uint32_t ms)
{
    uint32_t until = board().now + ms * 1000;
    while (static_cast<int32_t>(until - board().now) > 0)
        sniffer.poll();
}

/* Lets a frame arrive byte by byte after `ms` milliseconds. Returns the last printed line,
 * without its time. If the frame is a request and the one before has no reply, the sniffer
 * prints a line for that one first. */
static std::string prints(ModbusSniffer &sniffer, Paper &paper, const Bytes &bytes,
                          uint32_t ms = 10)
{
    paper.text.clear();
    Serial.arrive(bytes, board().now + ms * 1000, Serial.character);
    run_loop(sniffer, ms + 25);
    size_t end = paper.text.rfind("\r\n");
    size_t line = end == std::string::npos || end == 0 ? end : paper.text.rfind('\n', end - 1);
    size_t begin = paper.text.find(" ms ", line == std::string::npos ? 0 : line);
    return begin == std::string::npos ? paper.text : paper.text.substr(begin + 4);
}

#define PRINTS(expected, ...)                                                                      \
    assert_string_equal(prints(sniffer, paper, __VA_ARGS__).c_str(), expected "\r\n")

struct Listening {
    ModbusSniffer sniffer;
    Paper paper;
    Listening()
    {
        sniffer.printTo(paper);
        OK(sniffer.begin(Serial, 19200));
    }
};

TEST(requests_and_replies_are_printed)
{
    Listening l;
    ModbusSniffer &sniffer = l.sniffer;
    Paper &paper = l.paper;
    PRINTS("unit 17 request 03 read holding registers 107..109", adu({17, 3, 0, 107, 0, 3}));
    std::string reply = prints(sniffer, paper, adu({17, 3, 6, 2, 43, 0, 0, 0, 100}));
    const char begin[] = "unit 17 reply 03 read holding registers 107..109: 555 0 100 (";
    assert_int_equal(reply.compare(0, sizeof begin - 1, begin), 0);
    // The response time is measured in steps of the loop, which takes 25 ms.
    unsigned took = 0;
    assert_int_equal(sscanf(reply.c_str() + sizeof begin - 1, "%u ms)", &took), 1);
    assert_in_range(took, 25, 45);
    PRINTS("unit 1 request 04 read input registers 8", adu({1, 4, 0, 8, 0, 1}));
    PRINTS("unit 17 request 01 read coils 19..22", adu({17, 1, 0, 19, 0, 4}));
    reply = prints(sniffer, paper, adu({17, 1, 1, 0x0D}));
    assert_int_equal(reply.find("unit 17 reply 01 read coils 19..22: 1 0 1 1 ("), 0);
}

TEST(writes_are_printed_with_their_values)
{
    Listening l;
    ModbusSniffer &sniffer = l.sniffer;
    Paper &paper = l.paper;
    PRINTS("unit 2 request 06 write single register 5: 1234", adu({2, 6, 0, 5, 0x04, 0xD2}));
    PRINTS("unit 2 request 05 write single coil 6: 1", adu({2, 5, 0, 6, 0xFF, 0}));
    PRINTS("unit 2 request 10 write multiple registers 1..2: 10 258",
           adu({2, 16, 0, 1, 0, 2, 4, 0, 10, 1, 2}));
    PRINTS("unit 2 request 0F write multiple coils 0..9: 1 0 1 1 0 0 1 1 1 0",
           adu({2, 15, 0, 0, 0, 10, 2, 0xCD, 1}));
    PRINTS("unit 2 request 16 mask write register 4: and F2 or 25",
           adu({2, 22, 0, 4, 0, 0xF2, 0, 0x25}));
    PRINTS("unit 2 request 07 read exception status", adu({2, 7}));
    PRINTS("unit 2 request 08 diagnostics: A5 37", adu({2, 8, 0, 0, 0xA5, 0x37}));
}

TEST(exceptions_and_silent_units_are_printed)
{
    Listening l;
    ModbusSniffer &sniffer = l.sniffer;
    Paper &paper = l.paper;
    OK(sniffer.setResponseTimeout(200));
    IS(MBM_INVALID_ARGUMENT, sniffer.setFrameTimeout(0));
    OK(sniffer.setFrameTimeout(50));
    prints(sniffer, paper, adu({17, 3, 0, 107, 0, 3}));
    std::string text = prints(sniffer, paper, adu({17, 0x83, 2}));
    const char exception[] = "unit 17 exception 03 read holding registers 107..109: code 02 (";
    assert_int_equal(text.compare(0, sizeof exception - 1, exception), 0);
    prints(sniffer, paper, adu({17, 6, 0, 1, 0, 1}));
    paper.text.clear();
    run_loop(sniffer, 250);
    assert_non_null(
        strstr(paper.text.c_str(), " ms unit 17 no reply 06 write single register 1 (200 ms)\r\n"));
}

TEST(damaged_frames_and_noise_are_printed_as_bytes)
{
    Listening l;
    ModbusSniffer &sniffer = l.sniffer;
    Paper &paper = l.paper;
    Bytes damaged = adu({17, 3, 0, 107, 0, 3});
    damaged[3] = 106;
    std::string text = prints(sniffer, paper, damaged, 60);
    run_loop(sniffer, 300);
    assert_non_null(strstr(paper.text.c_str(), " bytes: 11 03 00 6A 00 03"));
    text = prints(sniffer, paper, raw({0xFF, 0xFE}), 100);
    run_loop(sniffer, 300);
    assert_non_null(strstr(paper.text.c_str(), "noise, 2 bytes: FF FE\r\n"));
}

static unsigned replies;

static void count_replies(const mbm_event &event)
{
    replies += event.kind == MBM_EVENT_REPLY;
}

TEST(a_callback_gets_each_event)
{
    ModbusSniffer sniffer;
    Paper paper;
    unsigned events = 0;
    uint16_t value = 0;
    sniffer.poll(); // before begin it does nothing
    sniffer.begin(Serial, 19200);
    sniffer.onEvent([&](const mbm_event &event) {
        events++;
        if (event.kind == MBM_EVENT_REPLY)
            value = static_cast<uint16_t>(event.packet.data[0] * 256 + event.packet.data[1]);
    });
    prints(sniffer, paper, adu({17, 3, 0, 107, 0, 1}));
    prints(sniffer, paper, adu({17, 3, 2, 2, 43}));
    assert_int_equal(events, 2);
    assert_int_equal(value, 555);
    assert_string_equal(paper.text.c_str(), ""); // printTo was not called
    replies = 0;
    sniffer.onEvent(count_replies);
    sniffer.printTo(paper);
    prints(sniffer, paper, adu({17, 3, 0, 107, 0, 1}));
    sniffer.printNothing();
    assert_string_equal(prints(sniffer, paper, adu({17, 3, 2, 2, 43})).c_str(), "");
    assert_int_equal(replies, 1);
    assert_int_equal(events, 2);
}

TEST(ascii_frames_are_printed_too)
{
    ModbusSniffer sniffer;
    Paper paper;
    sniffer.printTo(paper);
    OK(sniffer.beginAscii(Serial));
    const char request[] = ":1103006B000180\r\n";
    PRINTS("unit 17 request 03 read holding registers 107",
           Bytes(request, request + sizeof request - 1));
}

TEST(nothing_is_ever_sent)
{
    Listening l;
    prints(l.sniffer, l.paper, adu({17, 3, 0, 107, 0, 1}));
    Serial.flush();
    assert_int_equal(Serial.sent.size(), 1);
    assert_int_equal(Serial.sent[0].size(), 0);
}
