/* The code for avrxmega3. No simulator here has such a chip, so the code runs on an
 * ATmega1284P, in a program without interrupts (bare/bare.c). libmodbus's client sends
 * requests to its server, and its master to a libmodbus server. */
#include "bus.h"
#include "crc.h"
#include "sketch.h"
#include "test.h"

enum { UNIT = 17, SLAVE = 1 };

static const kind bare = {"avrxmega3", "atmega1284p", '0', {'B', 5}, {'D', 2}, {'D', 4}};

/* Sends a request with its CRC. Returns the length of the response without its CRC, or 0. */
static size_t request_response(bus *line, const uint8_t *request, size_t length)
{
    uint8_t frame[16];

    memcpy(frame, request, length);
    if (!bus_send(line, frame, seal(frame, length)) || line->length < 4)
        return 0;
    /* The CRC of a frame that includes its CRC is 0. */
    return crc16(line->last, line->length) == 0 ? line->length - 2 : 0;
}

TEST(the_avrxmega3_code_serves_and_sends_requests)
{
    static const uint8_t write[] = {UNIT, 6, 0, 0, 0, 1}, read[] = {UNIT, 3, 0, 1, 0, 4};
    static const uint8_t beyond[] = {UNIT, 3, 0, 7, 0, 2};
    static const uint8_t refused[] = {UNIT, 0x83, 2};
    uint8_t expected[3 + 8] = {UNIT, 3, 8, 0, 0};
    board *b = kind_start(&bare, "Bare");
    bus line;
    server s;

    server_start(&s, SLAVE);
    bus_open(&line, b, bare.bus, UNIT);
    board_uart(b, '1', peer_libmodbus, &s);
    assert_true(board_run(b, 10 * MS));
    assert_int_equal(request_response(&line, beyond, sizeof beyond), sizeof refused);
    assert_memory_equal(line.last, refused, sizeof refused);
    assert_int_equal(request_response(&line, write, sizeof write), sizeof write);
    assert_memory_equal(line.last, write, sizeof write);
    /* Its master reads three registers, and its server serves the status and the values. */
    assert_true(board_run(b, 200 * MS));
    for (unsigned i = 0; i < 3; i++) {
        expected[5 + 2 * i] = (uint8_t)(server_pattern(40 + i) >> 8);
        expected[6 + 2 * i] = (uint8_t)server_pattern(40 + i);
    }
    assert_int_equal(request_response(&line, read, sizeof read), sizeof expected);
    assert_memory_equal(line.last, expected, sizeof expected);
    bus_close(&line);
    server_stop(&s);
    board_free(b);
}
