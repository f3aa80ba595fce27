/* What ends mbm_tty_wait, and what does not. */
#define _GNU_SOURCE
#include "await.h"
#include "clock.h"
#include "mbm_tty.h"
#include "pty.h"
#include "test.h"

#include <pthread.h>
#include <signal.h>
#include <unistd.h>

static pty line;
static const mbm_tty_options PLAIN = {.baud = 19200, .parity = 'E', .stop = 1};

static void begin(void)
{
    alarm(2 * PATIENCE_MS / 1000);
    pty_open(&line);
}

static void end(void)
{
    pty_close(&line);
    alarm(0);
}

fixture each_test = {begin, end};

TEST(wait_ends_with_a_byte_with_the_time_or_with_the_line)
{
    mbm_port port;
    uint8_t byte;
    mbm_tty tty;
    double start;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    port = mbm_tty_port(&tty);
    assert_int_equal(mbm_tty_wait(&tty, 0), 0);
    start = seconds();
    assert_int_equal(mbm_tty_wait(&tty, 30500), 0);
    assert_true(seconds() - start >= 0.0305);
    assert_int_equal(write(line.ours, "x", 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    assert_int_equal(port.read(port.context, &byte, 1), 1);
    close(line.ours);
    line.ours = -1;
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    mbm_tty_close(&tty);
}

/* A server whose function is pending reads nothing, so its program sleeps. */
TEST(bytes_that_are_not_read_do_not_end_the_next_wait)
{
    mbm_port port;
    uint8_t byte;
    mbm_tty tty;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    port = mbm_tty_port(&tty);
    assert_int_equal(write(line.ours, "ab", 2), 2);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    assert_int_equal(mbm_tty_wait(&tty, 1000), 0);
    assert_int_equal(port.write(port.context, &byte, 0), 0);
    assert_int_equal(mbm_tty_wait(&tty, 1000), 0);
    /* After the program has read from the port, bytes end the wait again. */
    assert_int_equal(port.read(port.context, &byte, 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    mbm_tty_close(&tty);
}

/* A program that has sent something waits for what comes back, also if it has not read before. */
TEST(after_a_write_bytes_end_the_wait_again)
{
    mbm_port port;
    mbm_tty tty;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    port = mbm_tty_port(&tty);
    assert_int_equal(write(line.ours, "a", 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    assert_int_equal(mbm_tty_wait(&tty, 1000), 0);
    assert_int_equal(port.write(port.context, (const uint8_t *)"b", 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    mbm_tty_close(&tty);
}

static uint16_t pending(void *context, const mbm_request *request, uint8_t *response,
                        uint16_t capacity)
{
    (void)context;
    (void)request;
    (void)response;
    (void)capacity;
    return MBM_REPLY_PENDING;
}

/* The program's loop of the server while its function is pending: each round sleeps for the
 * time of pollDelay, though the next request has arrived. */
TEST(a_server_with_a_pending_function_sleeps_between_polls)
{
    static const uint8_t request[] = {0x11, 0x41, 0xCD, 0xD0};
    static mbm_server server;
    static mbm_unit unit;
    static mbm_custom custom;
    uint8_t frame[MBM_MAX_FRAME];
    mbm_port port;
    mbm_tty tty;

    unit.id = 0x11;
    custom.code = 0x41;
    custom.serve = pending;
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    port = mbm_tty_port(&tty);
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    assert_int_equal(write(line.ours, request, sizeof request), sizeof request);
    AWAIT((OK(mbm_server_poll(&server)), mbm_server_pollDelay(&server) == 1000));
    assert_int_equal(write(line.ours, request, sizeof request), sizeof request);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    for (unsigned i = 0; i < 10; i++) {
        OK(mbm_server_poll(&server));
        assert_int_equal(mbm_tty_wait(&tty, mbm_server_pollDelay(&server)), 0);
    }
    mbm_tty_close(&tty);
}

static void ignore_signal(int signal_number)
{
    (void)signal_number;
}

static volatile int waited;

/* A signal before the wait does not end it, so this thread sends one after the other. */
static void *interrupt(void *thread)
{
    while (!waited) {
        usleep(10000);
        pthread_kill(*(pthread_t *)thread, SIGUSR1);
    }
    return NULL;
}

TEST(a_signal_ends_the_wait)
{
    struct sigaction action = {0};
    pthread_t self = pthread_self(), other;
    double start = seconds();
    mbm_tty tty;

    action.sa_handler = ignore_signal;
    sigaction(SIGUSR1, &action, NULL);
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    assert_int_equal(pthread_create(&other, NULL, interrupt, &self), 0);
    assert_int_equal(mbm_tty_wait(&tty, 60000000), 0);
    waited = 1;
    pthread_join(other, NULL);
    assert_true(seconds() - start < 50);
    mbm_tty_close(&tty);
}
