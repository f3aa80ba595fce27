/* Sketches with a server on simulated boards. A libmodbus client sends the requests. */
#include "bus.h"
#include "crc.h"
#include "sketch.h"
#include "mbm.h"
#include "test.h"

static const kind *const kinds[] = {&uno, &relaxed, &mega, &relaxed_mega};

/* t3.5 at 19200 baud in cycles, and a tick of the core's clock, by which a response may be
 * early. */
enum { T35 = 32080, TICK = 64 };

/* Expects an exception to a request that the client has no function for. */
static void refuses(modbus_t *client, const uint8_t *request, size_t length, uint8_t exception)
{
    uint8_t answer[MODBUS_RTU_MAX_ADU_LENGTH];

    assert_true(modbus_send_raw_request(client, (uint8_t *)(uintptr_t)request, (int)length) > 0);
    assert_int_equal(modbus_receive_confirmation(client, answer), 5);
    assert_int_equal(answer[1], request[1] | 0x80);
    assert_int_equal(answer[2], exception);
}

/* --- the example ServeSensorAndRelay */

typedef struct served {
    bus line;
    const kind *on;
    /* of the driver-enable pin */
    uint64_t rose, fell;
    int level;
    unsigned responses, wrong;
} served;

static void driver_switched(void *context, int level, uint64_t cycle)
{
    served *s = context;

    *(level ? &s->rose : &s->fell) = cycle;
    s->level = level;
}

/* Checks each response: it comes after t3.5, and the driver is on for it and no longer. */
static void response_seen(void *context, const wire *w, size_t length)
{
    served *s = context;
    uint64_t last_bit = w->last_started + 10 * w->bit;

    s->responses++;
    s->wrong += s->level != 0;
    s->wrong += s->rose >= w->first_started || s->rose <= w->received;
    s->wrong += s->fell < last_bit || s->fell < w->first_started + length * 10 * w->bit;
    /* Off within a character, before a client could send again. */
    s->wrong += s->fell - last_bit > 10 * w->bit;
    s->wrong += w->first_started - w->received < T35 - TICK;
}

/* Starts the example and lets it set up. */
static served *example(const kind *k)
{
    served *s = calloc(1, sizeof *s);
    board *b = kind_start(k, "ServeSensorAndRelay");

    assert_non_null(s);
    s->on = k;
    bus_open(&s->line, b, k->bus, 17);
    s->line.watcher = response_seen;
    s->line.context = s;
    board_watch_pin(b, k->pin2.port, k->pin2.bit, driver_switched, s);
    board_sensor(b, 0, 2500);
    assert_true(board_run(b, 250 * MS));
    return s;
}

static void done(served *s)
{
    assert_int_equal(s->wrong, 0);
    bus_close(&s->line);
    board_free(s->line.on);
    free(s);
}

static int relay(const served *s)
{
    return is_high(s->line.on, s->on->pin4);
}

/* A test on each kind of board. */
#define ON_ALL(name)                                                                               \
    static void name##_on(const kind *k);                                                          \
    TEST(name)                                                                                     \
    {                                                                                              \
        for (unsigned i = 0; i < COUNT(kinds); i++)                                                \
            name##_on(kinds[i]);                                                                   \
    }                                                                                              \
    static void name##_on(const kind *k)

ON_ALL(the_sensor_is_an_input_register)
{
    static const unsigned volts[] = {1250, 5000, 0};
    static const uint16_t readings[] = {256, 1023, 0};
    served *s = example(k);
    uint16_t reading;
    unsigned i;

    bus_go(&s->line);
    assert_int_equal(modbus_read_input_registers(s->line.client, 0, 1, &reading), 1);
    assert_in_range(reading, 510, 514);
    bus_halt(&s->line);
    for (i = 0; i < COUNT(volts); i++) {
        board_sensor(s->line.on, 0, volts[i]);
        assert_true(board_run(s->line.on, 150 * MS));
        bus_go(&s->line);
        assert_int_equal(modbus_read_input_registers(s->line.client, 0, 1, &reading), 1);
        bus_halt(&s->line);
        assert_in_range(reading + 2u, readings[i], readings[i] + 4u);
    }
    assert_int_equal(s->responses, 4);
    done(s);
}

ON_ALL(the_relay_is_a_coil)
{
    served *s = example(k);
    uint8_t on = 7;
    unsigned i;

    assert_int_equal(relay(s), 0);
    for (i = 1; i < 4; i++) {
        uint8_t wanted = i & 1;

        bus_go(&s->line);
        assert_int_equal(modbus_write_bit(s->line.client, 0, wanted), 1);
        assert_int_equal(modbus_read_bits(s->line.client, 0, 1, &on), 1);
        bus_halt(&s->line);
        assert_int_equal(on, wanted);
        assert_int_equal(relay(s), wanted);
    }
    on = 0;
    bus_go(&s->line);
    assert_int_equal(modbus_write_bits(s->line.client, 0, 1, &on), 1);
    bus_halt(&s->line);
    assert_int_equal(relay(s), 0);
    done(s);
}

ON_ALL(access_to_absent_data_gets_an_exception)
{
    static const uint8_t no_quantity[] = {17, 4, 0, 0, 0, 0}, no_level[] = {17, 5, 0, 0, 1, 2};
    served *s = example(k);
    uint16_t words[2];
    uint8_t bits[2] = {1, 1};

    bus_go(&s->line);
    EXCEPTION(1, modbus_read_registers(s->line.client, 0, 1, words));
    EXCEPTION(1, modbus_read_input_bits(s->line.client, 0, 1, bits));
    EXCEPTION(1, modbus_write_register(s->line.client, 0, 1));
    EXCEPTION(2, modbus_read_input_registers(s->line.client, 1, 1, words));
    EXCEPTION(2, modbus_read_input_registers(s->line.client, 0, 2, words));
    EXCEPTION(2, modbus_write_bits(s->line.client, 0, 2, bits));
    EXCEPTION(2, modbus_write_bit(s->line.client, 65535, 1));
    refuses(s->line.client, no_quantity, sizeof no_quantity, 3);
    refuses(s->line.client, no_level, sizeof no_level, 3);
    bus_halt(&s->line);
    assert_int_equal(s->responses, 9);
    assert_int_equal(relay(s), 0);
    done(s);
}

/* Sets coil 0 with a request to `unit`, which gets no response: the client waits for one,
 * also after a broadcast. Returns the coil as unit 17 has it then. */
static uint8_t coil_after_write_to(served *s, int unit)
{
    uint8_t on = 7;

    modbus_set_response_timeout(s->line.client, 0, 200000);
    modbus_set_slave(s->line.client, unit);
    bus_go(&s->line);
    FAILS(ETIMEDOUT, modbus_write_bit(s->line.client, 0, 1));
    bus_halt(&s->line);
    bus_settle(&s->line);
    bus_go(&s->line);
    modbus_set_response_timeout(s->line.client, 20, 0);
    modbus_set_slave(s->line.client, 17);
    assert_int_equal(modbus_read_bits(s->line.client, 0, 1, &on), 1);
    bus_halt(&s->line);
    return on;
}

ON_ALL(other_units_and_damaged_frames_get_no_response)
{
    static const uint8_t broadcast_read[] = {0, 1, 0, 0, 0, 1};
    uint8_t frame[16] = {17, 5, 0, 0, 0xFF, 0};
    size_t length = seal(frame, 6);
    served *s = example(k);
    unsigned i;

    for (i = 0; i < 8 * length; i += 5) {
        frame[i / 8] ^= (uint8_t)(1 << i % 8);
        assert_false(bus_send(&s->line, frame, length));
        frame[i / 8] ^= (uint8_t)(1 << i % 8);
    }
    for (i = 1; i < length; i++)
        assert_false(bus_send(&s->line, frame, i));
    frame[0] = 16;
    assert_false(bus_send(&s->line, frame, seal(frame, 6)));
    /* A response of another unit. */
    memcpy(frame, "\x10\x04\x02\x01\x02", 5);
    assert_false(bus_send(&s->line, frame, seal(frame, 5)));
    memcpy(frame, broadcast_read, 6);
    assert_false(bus_send(&s->line, frame, seal(frame, 6)));
    assert_int_equal(relay(s), 0);
    assert_int_equal(s->rose, 0);

    assert_int_equal(coil_after_write_to(s, 18), 0);
    assert_int_equal(s->responses, 1);
    done(s);
}

ON_ALL(a_broadcast_switches_the_relay_without_a_response)
{
    served *s = example(k);

    assert_int_equal(coil_after_write_to(s, MODBUS_BROADCAST_ADDRESS), 1);
    assert_int_equal(relay(s), 1);
    assert_int_equal(s->responses, 1);
    done(s);
}

/* --- four arrays, two units, a function of the sketch */

TEST(arrays_units_hooks_and_a_function_are_served)
{
    static const uint8_t busy[] = {17, 6, 0, 100, 0xFF, 0}, nothing[] = {17, 65};
    static const uint8_t adds[] = {17, 65, 200, 100, 7}, sum[] = {17, 65, 1, 51};
    board *b = kind_start(&uno, "Serve");
    uint16_t report = board_symbol(b, "report"), words = board_symbol(b, "words");
    uint16_t sent[64], back[64];
    uint8_t bits[64], frame[16];
    unsigned i;
    bus l;

    bus_open(&l, b, '0', 17);
    assert_true(board_run_until(b, report, 1, 100 * MS));
    for (i = 0; i < 64; i++)
        sent[i] = (uint16_t)(i * 40503u + 7);
    bus_go(&l);
    assert_int_equal(modbus_write_registers(l.client, 100, 64, sent), 64);
    assert_int_equal(modbus_read_registers(l.client, 100, 64, back), 64);
    assert_memory_equal(sent, back, sizeof sent);
    assert_int_equal(modbus_read_input_registers(l.client, 200, 64, back), 64);
    for (i = 0; i < 64; i++)
        assert_int_equal(back[i], 1000 + i);
    assert_true(modbus_mask_write_register(l.client, 101, 0x0F0F, 0xA000) == 1);
    assert_int_equal(modbus_write_and_read_registers(l.client, 102, 2, sent, 100, 4, back), 4);
    bus_halt(&l);
    assert_int_equal(back[0], sent[0]);
    assert_int_equal(back[1], (sent[1] & 0x0F0F) | 0xA000);
    assert_int_equal(back[2], sent[0]);
    assert_int_equal(back[3], sent[1]);
    assert_int_equal(board_word(b, (uint16_t)(words + 4)), sent[0]);
    assert_int_equal(board_word(b, (uint16_t)(words + 126)), sent[63]);
    /* The hooks were called three times, the last time for two registers from 102 on. */
    assert_int_equal(board_byte(b, (uint16_t)(report + 1)), 3);
    assert_int_equal(board_byte(b, (uint16_t)(report + 2)), 3);
    assert_int_equal(board_word(b, (uint16_t)(report + 3)), 102);
    assert_int_equal(board_word(b, (uint16_t)(report + 5)), 2);

    bus_go(&l);
    for (i = 0; i < 64; i++)
        bits[i] = sent[i] >> 5 & 1;
    assert_int_equal(modbus_write_bits(l.client, 300, 64, bits), 64);
    memset(bits, 9, sizeof bits);
    assert_int_equal(modbus_read_bits(l.client, 301, 63, bits), 63);
    for (i = 0; i < 63; i++)
        assert_int_equal(bits[i], sent[i + 1] >> 5 & 1);
    assert_int_equal(modbus_read_input_bits(l.client, 400, 50, bits), 50);
    for (i = 0; i < 50; i++)
        assert_int_equal(bits[i], i % 3 == 0);

    EXCEPTION(2, modbus_read_registers(l.client, 99, 2, back));
    EXCEPTION(2, modbus_read_registers(l.client, 163, 2, back));
    EXCEPTION(2, modbus_read_bits(l.client, 300, 65, bits));
    refuses(l.client, busy, sizeof busy, 6);
    assert_int_equal(modbus_write_register(l.client, 100, 0xFEFF), 1);

    refuses(l.client, nothing, sizeof nothing, 3);
    bus_halt(&l);

    /* The client does not know the length of the response to 65. */
    memcpy(frame, adds, sizeof adds);
    assert_true(bus_send(&l, frame, seal(frame, sizeof adds)));
    assert_int_equal(l.length, 6);
    assert_int_equal(crc16(l.last, l.length), 0);
    assert_memory_equal(l.last, sum, sizeof sum);
    modbus_flush(l.client);

    modbus_set_slave(l.client, 18);
    bus_go(&l);
    assert_int_equal(modbus_write_register(l.client, 1, 0x1818), 1);
    assert_int_equal(modbus_read_registers(l.client, 0, 2, back), 2);
    EXCEPTION(1, modbus_read_input_registers(l.client, 200, 1, back + 2));
    bus_halt(&l);
    assert_int_equal(back[0], 0);
    assert_int_equal(back[1], 0x1818);
    bus_close(&l);
    board_free(b);
}

/* --- the code for avrxmega3. No simulator here has such a chip, so the code runs on an
 * ATmega1284P, in a program without interrupts (bare/bare.c). libmodbus's client sends requests to
 * its server, and its master to a libmodbus server. */

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
