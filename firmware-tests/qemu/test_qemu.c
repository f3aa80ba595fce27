/* The bare metal firmware on every machine that QEMU plays: against a libmodbus server,
 * whose memory is checked, and against a device of the tests' own on a line with faults. The
 * firmware's report is checked too.
 *
 *     test_qemu [MACHINE...] */
#include "device.h"
#include "machine.h"
#include "mbm.h"
#include "report.h"
#include "server.h"
#include "test.h"

#include <unistd.h>

static const machine *board;
static server peer;
static run done;
static int hung; /* 1: a run on this machine had to be killed, so no more are started */

/* A word of the report, and a word of a step in it. */
static uint16_t report_word(const uint16_t *registers, unsigned word)
{
    return registers[REPORT_ADDRESS + word];
}

static uint16_t step_word(const uint16_t *registers, enum step step, unsigned word)
{
    return registers[REPORT_ADDRESS + REPORT_HEAD + STEP_SIZE * (unsigned)step + word];
}

static uint16_t of_absent(const uint16_t *registers)
{
    return report_word(registers, REPORT_ABSENT_MILLIS);
}

/* The firmware's sum of words, in which each word is weighted with its position. */
static uint16_t sum_of(const uint16_t *words, unsigned count)
{
    unsigned i, sum = 0;

    for (i = 0; i < count; i++)
        sum += (i + 1) * words[i];
    return (uint16_t)sum;
}

static uint16_t sum_of_bits(const uint8_t *bits, unsigned count)
{
    uint16_t words[8] = {0};
    unsigned i;

    for (i = 0; i < count; i++)
        if (bits[i])
            words[i / 16] |= (uint16_t)(1u << i % 16);
    return sum_of(words, (count + 15) / 16);
}

static void assert_read(const uint16_t *registers, enum step step, unsigned words, uint16_t sum)
{
    assert_int_equal(step_word(registers, step, STEP_STATUS), MBM_OK);
    assert_int_equal(step_word(registers, step, STEP_WORDS), words);
    assert_int_equal(step_word(registers, step, STEP_SUM), sum);
}

/* Asserts that the run was not killed and that `code` steps had another status than expected. */
static void ended_with(int code)
{
    if (!done.ended || done.code != code)
        print_error("%s", done.console);
    assert_true(done.ended);
    assert_int_equal(done.code, code);
}

static uint16_t *held(void)
{
    assert_int_equal(report_word(peer.mapping->tab_registers, REPORT_MAGIC), REPORT_IS_HERE);
    return peer.mapping->tab_registers;
}

/* Other work of this computer can only make times longer, so the shortest of some runs counts. */
enum { RUNS = 5, MOST_ABSENT = 4 * ABSENT_TIMEOUT };

static int run_with_libmodbus(void **state)
{
    unsigned runs = 1;

    for (;; runs++) {
        server_start(&peer, UNIT);
        done = machine_run(board, peer.line.ours);
        hung = !done.ended;
        if (hung || runs == RUNS || of_absent(peer.mapping->tab_registers) <= MOST_ABSENT)
            return 0;
        server_stop(&peer);
    }
}

static int stop(void **state)
{
    server_stop(&peer);
    return 0;
}

/* Every step ended as the firmware expects, and the console shows it. */
static void ends_with_every_request_as_expected(void **state)
{
    ended_with(0);
    assert_int_equal(report_word(held(), REPORT_STEPS), STEPS);
    assert_int_equal(report_word(held(), REPORT_UNEXPECTED), 0);
    assert_non_null(strstr(done.console, "read again: "));
}

static void writes_a_register(void **state)
{
    assert_int_equal(step_word(held(), WRITE_REGISTER, STEP_STATUS), MBM_OK);
    assert_int_equal(held()[100], 0xBEEF);
    assert_int_equal(held()[99], server_pattern(99));
}

static void writes_queued_registers(void **state)
{
    assert_int_equal(step_word(held(), WRITE_REGISTERS, STEP_STATUS), MBM_OK);
    assert_int_equal(held()[101], 0x1122);
    assert_int_equal(held()[103], 0x3344);
    assert_int_equal(held()[106], server_pattern(106));
}

static void writes_a_coil(void **state)
{
    assert_int_equal(step_word(held(), WRITE_COIL, STEP_STATUS), MBM_OK);
    assert_int_equal(peer.mapping->tab_bits[40], 1);
}

static void writes_coils(void **state)
{
    unsigned i;

    assert_int_equal(step_word(held(), WRITE_COILS, STEP_STATUS), MBM_OK);
    assert_int_equal(peer.mapping->tab_bits[49], server_bit_pattern(49));
    for (i = 0; i < 19; i++)
        assert_int_equal(peer.mapping->tab_bits[50 + i], 0x5A5C3u >> i & 1);
    assert_int_equal(peer.mapping->tab_bits[69], server_bit_pattern(69));
}

static void reads_holding_registers(void **state)
{
    assert_read(held(), READ_HOLDING, 10, sum_of(held() + 20, 10));
}

static void reads_input_registers(void **state)
{
    assert_read(held(), READ_INPUT_REGISTERS, 10,
                sum_of(peer.mapping->tab_input_registers + 30, 10));
}

static void reads_coils(void **state)
{
    assert_read(held(), READ_COILS, 3, sum_of_bits(peer.mapping->tab_bits + 45, 37));
}

static void reads_discrete_inputs(void **state)
{
    assert_read(held(), READ_INPUTS, 2, sum_of_bits(peer.mapping->tab_input_bits + 70, 21));
}

static void mask_writes_a_register(void **state)
{
    assert_int_equal(step_word(held(), MASK_WRITE, STEP_STATUS), MBM_OK);
    assert_int_equal(held()[102], (0x5566 & 0x00FF) | 0x3400);
}

static void writes_and_reads_in_one_request(void **state)
{
    assert_int_equal(held()[104], 0xCAFE);
    assert_int_equal(held()[105], 0xF00D);
    assert_read(held(), READ_WRITE, 6, sum_of(held() + 100, 6));
}

static void reads_125_registers(void **state)
{
    assert_read(held(), READ_LONGEST, 125, sum_of(held(), 125));
}

static void returns_an_exception(void **state)
{
    assert_int_equal(step_word(held(), READ_ABSENT_REGISTER, STEP_STATUS),
                     MBM_ILLEGAL_DATA_ADDRESS);
    assert_int_equal(report_word(held(), REPORT_EXCEPTIONS), 1);
}

static void a_broadcast_arrives_and_gets_no_response(void **state)
{
    assert_int_equal(step_word(held(), BROADCAST, STEP_STATUS), MBM_OK);
    assert_int_equal(held()[130], 0x5A5A);
    assert_read(held(), READ_WHAT_WAS_BROADCAST, 1, 0x5A5A);
}

static void an_absent_unit_times_out_when_it_should(void **state)
{
    uint16_t millis = of_absent(held());

    assert_int_equal(step_word(held(), ASK_ABSENT_UNIT, STEP_STATUS), MBM_RESPONSE_TIMED_OUT);
    assert_int_equal(report_word(held(), REPORT_TIMEOUTS), 1);
    /* The gap before the request counts too, and so does other work of this computer. */
    assert_in_range(millis, ABSENT_TIMEOUT, MOST_ABSENT);
    assert_read(held(), READ_AGAIN, 2, sum_of(held() + 100, 2));
}

static void counts_what_happened(void **state)
{
    assert_int_equal(report_word(held(), REPORT_REQUESTS), STEPS);
    /* Neither the broadcast nor the request to the absent unit is answered. */
    assert_int_equal(report_word(held(), REPORT_REPLIES), STEPS - 2);
    assert_int_equal(report_word(held(), REPORT_BAD_CRC), 0);
    assert_int_equal(report_word(held(), REPORT_FOREIGN_FRAMES), 0);
    assert_int_equal(report_word(held(), REPORT_RESYNCHRONISATIONS), 0);
}

/* Only the firmware with the client reads a ring that an interrupt fills. It polls when
 * something is due or bytes have arrived, and sleeps otherwise. */
static void sleeps_instead_of_polling(void **state)
{
    unsigned polls = report_word(held(), REPORT_POLLS), sleeps = report_word(held(), REPORT_SLEEPS);

    assert_int_equal(report_word(held(), REPORT_LOST_BYTES), 0);
    if (!strstr(board->name, "-client")) {
        assert_int_equal(polls + sleeps, 0);
        return;
    }
    print_message("%s: %u polls, %u sleeps\n", board->name, polls, sleeps);
    assert_in_range(sleeps, STEPS, polls);
    /* The bytes take seconds on the wire. A loop without sleep would poll a million times. */
    assert_in_range(polls, STEPS, 3000);
}

/* Asserts what every step must read from the tests' own device. `met` is the status of the
 * request that meets the fault. */
static void all_is_right(const device *d, uint8_t met)
{
    const uint16_t *registers = d->memory.holding[0];
    unsigned i;

    assert_int_equal(report_word(registers, REPORT_MAGIC), REPORT_IS_HERE);
    assert_int_equal(d->malformed, 0);
    assert_int_equal(d->number, STEPS + 1);
    for (i = 0; i < STEPS; i++) {
        uint16_t status = step_word(registers, (enum step)i, STEP_STATUS);

        if (i == READ_HOLDING)
            assert_int_equal(status, met);
        else if (i == READ_ABSENT_REGISTER)
            assert_int_equal(status, MBM_ILLEGAL_DATA_ADDRESS);
        else if (i == ASK_ABSENT_UNIT)
            assert_int_equal(status, MBM_RESPONSE_TIMED_OUT);
        else
            assert_int_equal(status, MBM_OK);
    }
    if (met == MBM_OK)
        assert_read(registers, READ_HOLDING, 10, sum_of(registers + 20, 10));
    assert_read(registers, READ_INPUT_REGISTERS, 10, sum_of(d->memory.readings[0] + 30, 10));
    assert_read(registers, READ_COILS, 3, sum_of_bits(d->memory.coils[0] + 45, 37));
    assert_read(registers, READ_WRITE, 6, sum_of(registers + 100, 6));
}

static void run_with_device(device *d, device_fault spoil, int code)
{
    assert_false(hung);
    device_start(d, READ_HOLDING + 1, spoil);
    done = machine_run(board, d->line.ours);
    hung = !done.ended;
    device_stop(d);
    ended_with(code);
}

static void the_clock_keeps_time(void **state)
{
    static device d;
    const uint32_t right = 1000u * (ABSENT_TIMEOUT + 100);
    uint32_t waited = UINT32_MAX;
    unsigned runs;

    /* From the request to the absent unit to the next request: its timeout and the quiet
     * time of 100 ms. */
    for (runs = 0; runs < RUNS && waited > right / 10 * 19; runs++) {
        run_with_device(&d, NULL, 0);
        all_is_right(&d, MBM_OK);
        waited = (uint32_t)(d.at[READ_AGAIN + 1] - d.at[ASK_ABSENT_UNIT + 1]);
    }
    assert_in_range(waited, right / 10 * 8, right / 10 * 19);
}

static void a_fault_ends_as_expected(void **state)
{
    static device d;
    const fault *f = *state;
    const uint16_t *registers = d.memory.holding[0];
    uint8_t failed = f->status != MBM_OK;

    run_with_device(&d, f->spoil, failed);
    all_is_right(&d, f->status);
    assert_int_equal(report_word(registers, REPORT_UNEXPECTED), failed);
    assert_int_equal(report_word(registers, REPORT_BAD_CRC), f->status == MBM_INVALID_CRC);
    assert_int_equal(report_word(registers, REPORT_TIMEOUTS),
                     1 + (f->status == MBM_RESPONSE_TIMED_OUT));
    assert_int_equal(report_word(registers, REPORT_RESYNCHRONISATIONS), f->resynchronisation);
    assert_int_equal(report_word(registers, REPORT_FOREIGN_FRAMES), f->foreign);
}

#define BEHAVIOUR(test)                                                                            \
    {                                                                                              \
#test, test                                                                                \
    }

static const struct {
    const char *name;
    CMUnitTestFunction function;
} behaviours[] = {
    BEHAVIOUR(ends_with_every_request_as_expected),
    BEHAVIOUR(writes_a_register),
    BEHAVIOUR(writes_queued_registers),
    BEHAVIOUR(writes_a_coil),
    BEHAVIOUR(writes_coils),
    BEHAVIOUR(reads_holding_registers),
    BEHAVIOUR(reads_input_registers),
    BEHAVIOUR(reads_coils),
    BEHAVIOUR(reads_discrete_inputs),
    BEHAVIOUR(mask_writes_a_register),
    BEHAVIOUR(writes_and_reads_in_one_request),
    BEHAVIOUR(reads_125_registers),
    BEHAVIOUR(returns_an_exception),
    BEHAVIOUR(a_broadcast_arrives_and_gets_no_response),
    BEHAVIOUR(an_absent_unit_times_out_when_it_should),
    BEHAVIOUR(counts_what_happened),
    BEHAVIOUR(sleeps_instead_of_polling),
    BEHAVIOUR(the_clock_keeps_time),
};

enum { MOST_TESTS = 40, MOST_NAME = 100 };

static int test_machine(const machine *m)
{
    struct CMUnitTest tests[MOST_TESTS];
    char names[MOST_TESTS][MOST_NAME];
    unsigned i, count = 0;
    char *space;

    memset(tests, 0, sizeof tests);
    for (i = 0; i < COUNT(behaviours) + fault_count && count < MOST_TESTS; i++, count++) {
        int plain = i < COUNT(behaviours);
        const fault *f = plain ? NULL : &faults[i - COUNT(behaviours)];

        snprintf(names[i], MOST_NAME, "%s: %s", m->name, plain ? behaviours[i].name : f->name);
        for (space = names[i]; *space; space++)
            if (*space == '_')
                *space = ' ';
        tests[i].name = names[i];
        tests[i].test_func = plain ? behaviours[i].function : a_fault_ends_as_expected;
        tests[i].initial_state = (void *)(uintptr_t)f;
    }
    board = m;
    /* In case all other time limits fail: ends this program, and QEMU with it. */
    alarm(900);
    return _cmocka_run_group_tests(m->name, tests, count, run_with_libmodbus, stop);
}

int main(int argc, char **argv)
{
    return machine_each(argc, argv, test_machine);
}
