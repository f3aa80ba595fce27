/* The bare metal firmware with a server, on every machine that QEMU plays. A libmodbus
 * client sends the requests.
 *
 *     test_serve [MACHINE...] */
#define _GNU_SOURCE
#include "clock.h"
#include "crc.h"
#include "machine.h"
#include "mbm.h"
#include "pty.h"
#include "serve.h"
#include "test.h"

#include <errno.h>
#include <modbus.h>
#include <unistd.h>

/* Longer than the silence that ends a frame. */
enum { SILENCE_MS = 2 * SERVE_SILENCE / 1000 };

static const machine *board;
static pty line;
static running firmware;
static modbus_t *client;

static uint16_t value(unsigned i)
{
    return (uint16_t)((i * 40503u + 77u) % SERVE_MOST);
}

static uint8_t bit(unsigned i)
{
    return value(i) >> 6 & 1;
}

static int start(void **state)
{
    pty_open(&line);
    firmware = machine_start(board, "serve", line.ours);
    if (!machine_says(&firmware, "serving"))
        return -1;
    client = modbus_new_rtu(line.path, 115200, 'N', 8, 1);
    if (!client || modbus_set_slave(client, SERVE_UNIT) || modbus_connect(client) ||
        modbus_set_response_timeout(client, 60, 0) || modbus_set_byte_timeout(client, 60, 0))
        return -1;
    return 0;
}

static int stop(void **state)
{
    modbus_close(client);
    modbus_free(client);
    machine_finish(&firmware, 0);
    pty_close(&line);
    return 0;
}

/* Returns the client after a pause. The standard requires t3.5 between a response and the
 * next request, but libmodbus sends at once, and on a pty characters take no time. */
static modbus_t *client_after_pause(void)
{
    usleep(20000);
    return client;
}

static void registers_are_written_and_read(void **state)
{
    uint16_t words[SERVE_CELLS], back[SERVE_CELLS];
    unsigned i;

    for (i = 0; i < SERVE_CELLS; i++)
        words[i] = value(i);
    assert_int_equal(modbus_write_registers(client_after_pause(), SERVE_BASE, 123, words), 123);
    assert_int_equal(modbus_write_registers(client_after_pause(), SERVE_BASE + 123, 7, words + 123),
                     7);
    assert_int_equal(modbus_read_registers(client_after_pause(), SERVE_BASE, 125, back), 125);
    assert_memory_equal(words, back, 250);
    assert_int_equal(modbus_read_registers(client_after_pause(), SERVE_BASE + 5, 125, back), 125);
    assert_memory_equal(words + 5, back, 250);
    assert_int_equal(modbus_write_register(client_after_pause(), SERVE_BASE + 129, 4711), 1);
    assert_int_equal(modbus_read_registers(client_after_pause(), SERVE_BASE + 128, 2, back), 2);
    assert_int_equal(back[0], value(128));
    assert_int_equal(back[1], 4711);
    /* The values that the hook after the write has set. */
    assert_int_equal(modbus_read_input_registers(client_after_pause(), SERVE_BASE + 9, 120, back),
                     120);
    for (i = 0; i < 120; i++)
        assert_int_equal(back[i], (uint16_t)~value(9 + i));
}

static void coils_are_written_and_read(void **state)
{
    uint8_t bits[SERVE_CELLS], back[SERVE_CELLS];
    unsigned i;

    for (i = 0; i < SERVE_CELLS; i++)
        bits[i] = bit(i);
    assert_int_equal(modbus_write_bits(client_after_pause(), SERVE_BASE, 129, bits), 129);
    assert_int_equal(modbus_read_bits(client_after_pause(), SERVE_BASE + 3, 126, back), 126);
    assert_memory_equal(bits + 3, back, 126);
    assert_int_equal(modbus_write_bit(client_after_pause(), SERVE_BASE + 50, !bit(50)), 1);
    assert_int_equal(modbus_read_bits(client_after_pause(), SERVE_BASE + 49, 3, back), 3);
    assert_int_equal(back[0], bit(49));
    assert_int_equal(back[1], !bit(50));
    assert_int_equal(back[2], bit(51));
    assert_int_equal(modbus_read_input_bits(client_after_pause(), SERVE_BASE + 1, 49, back), 49);
    for (i = 0; i < 49; i++)
        assert_int_equal(back[i], !bit(1 + i));
}

static void refuses(const uint8_t *request, size_t length, uint8_t exception)
{
    uint8_t answer[MODBUS_RTU_MAX_ADU_LENGTH];

    assert_true(modbus_send_raw_request(client_after_pause(), (uint8_t *)(uintptr_t)request,
                                        (int)length) > 0);
    assert_int_equal(modbus_receive_confirmation(client, answer), 5);
    assert_int_equal(answer[1], request[1] | 0x80);
    assert_int_equal(answer[2], exception);
}

static void refusals_are_exceptions(void **state)
{
    static const uint8_t no_quantity[] = {17, 3, 0, 100, 0, 0}, half_on[] = {17, 5, 0, 100, 1, 0};
    static const uint8_t unknown[] = {17, 100, 1};
    uint16_t words[2] = {1, SERVE_MOST + 1};
    uint8_t bits[2];

    assert_int_equal(modbus_write_register(client_after_pause(), SERVE_BASE, 9), 1);
    EXCEPTION(2, modbus_read_registers(client_after_pause(), SERVE_BASE - 1, 2, words));
    EXCEPTION(2, modbus_read_input_registers(client_after_pause(), SERVE_BASE + 129, 2, words));
    EXCEPTION(2, modbus_read_bits(client_after_pause(), SERVE_BASE + 129, 2, bits));
    EXCEPTION(2, modbus_read_input_bits(client_after_pause(), 65535, 1, bits));
    EXCEPTION(1, modbus_mask_write_register(client_after_pause(), SERVE_BASE, 0, 1));
    words[0] = 1;
    words[1] = SERVE_MOST + 1;
    EXCEPTION(3, modbus_write_registers(client_after_pause(), SERVE_BASE, 2, words));
    refuses(no_quantity, sizeof no_quantity, 3);
    refuses(half_on, sizeof half_on, 3);
    refuses(unknown, sizeof unknown, 1);
    assert_int_equal(modbus_read_registers(client_after_pause(), SERVE_BASE, 1, words), 1);
    assert_int_equal(words[0], 9);
}

/* Waits for a time in which this computer was never late, so that the firmware has seen the
 * silence too. If it finds two frames without silence between them, only the last one
 * counts. */
static void silence(void)
{
    double begun = seconds(), first = begun, last = begun;

    while (last - begun < 2e-3 * SILENCE_MS && last - first < 20) {
        double now;

        usleep(5000);
        now = seconds();
        if (now - last > 0.03)
            begun = now;
        last = now;
    }
}

/* Sends bytes with silence before and after them. Nothing must come back. */
static void is_ignored(const uint8_t *frame, size_t length)
{
    uint8_t byte;

    silence();
    assert_int_equal(write(modbus_get_socket(client), frame, length), length);
    silence();
    assert_int_not_equal(read(modbus_get_socket(client), &byte, 1), 1);
}

/* Reads the register after frames that were ignored. The emulator may have been away during the
 * silence before, and then the firmware finds the request at the end of the frame before: a master
 * sends it again. */
static uint16_t word_after_ignored(int address)
{
    uint16_t word = 0;
    int tries, count = -1;

    modbus_set_response_timeout(client, 10, 0);
    for (tries = 0; tries < 6 && count != 1; tries++) {
        silence();
        count = modbus_read_registers(client, address, 1, &word);
        assert_true(count == 1 || errno == ETIMEDOUT);
    }
    modbus_set_response_timeout(client, 60, 0);
    assert_int_equal(count, 1);
    return word;
}

static void damaged_frames_and_other_units_get_no_response(void **state)
{
    uint8_t frame[16] = {SERVE_UNIT, 6, 0, 102, 0x12, 0x34};
    size_t length = seal(frame, 6);

    assert_int_equal(modbus_write_register(client_after_pause(), 102, 5), 1);
    frame[5] ^= 0x10;
    is_ignored(frame, length);
    frame[5] ^= 0x10;
    is_ignored(frame, length - 1);
    frame[0]++;
    is_ignored(frame, seal(frame, 6));
    assert_int_equal(word_after_ignored(102), 5);
}

static void a_broadcast_is_carried_out_without_a_response(void **state)
{
    uint8_t frame[16] = {0, 6, 0, 103, 0x12, 0x34};
    const size_t length = seal(frame, 6);
    int tries;

    /* As there, the first ones may be lost. */
    for (tries = 0; tries < 6; tries++) {
        is_ignored(frame, length);
        if (word_after_ignored(103) == 0x1234)
            return;
    }
    fail_msg("the broadcast was not carried out");
}

static void the_firmware_ends_when_its_coil_is_set(void **state)
{
    run done;

    assert_int_equal(modbus_write_bit(client_after_pause(), SERVE_END, 1), 1);
    done = machine_finish(&firmware, 1);
    if (done.code != 0)
        print_error("%s", done.console);
    assert_true(done.ended);
    assert_int_equal(done.code, 0);
    assert_non_null(strstr(done.console, "serving"));
}

static int test_machine(const machine *m)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registers_are_written_and_read),
        cmocka_unit_test(coils_are_written_and_read),
        cmocka_unit_test(refusals_are_exceptions),
        cmocka_unit_test(damaged_frames_and_other_units_get_no_response),
        cmocka_unit_test(a_broadcast_is_carried_out_without_a_response),
        cmocka_unit_test(the_firmware_ends_when_its_coil_is_set),
    };

    /* The image with the client is for the same machine, so it is left out. */
    if (strstr(m->name, "-client"))
        return 0;
    board = m;
    /* In case all other time limits fail: ends this program, and QEMU with it. */
    alarm(900);
    return cmocka_run_group_tests_name(m->name, tests, start, stop);
}

int main(int argc, char **argv)
{
    return machine_each(argc, argv, test_machine);
}
