/* The UARTs of ports/baremetal in the test kit for ports, on every machine that QEMU plays. A
 * process returns each byte, as a wire from TX to RX does.
 *
 *     test_porttest [MACHINE...] */
#define _GNU_SOURCE
#include "machine.h"
#include "pty.h"
#include "test.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

static const machine *board;
static pty line;
static pid_t wire;

static void become_wire(void)
{
    uint8_t bytes[64];
    ssize_t count;

    prctl(PR_SET_PDEATHSIG, SIGKILL);
    while ((count = read(line.theirs, bytes, sizeof bytes)) > 0)
        for (ssize_t sent = 0; sent < count;) {
            ssize_t more = write(line.theirs, bytes + sent, (size_t)(count - sent));

            if (more < 0)
                _exit(1);
            sent += more;
        }
    _exit(0);
}

static int start(void **state)
{
    pty_open(&line);
    wire = fork();
    if (wire == 0)
        become_wire();
    return wire < 0;
}

static int stop(void **state)
{
    kill(wire, SIGKILL);
    waitpid(wire, NULL, 0);
    pty_close(&line);
    return 0;
}

static void the_port_passes(void **state)
{
    running r = machine_start(board, "porttest", line.ours);
    run done = machine_finish(&r, 1);

    /* print_message cuts a text of more than 1024 characters, and its last line with it. */
    printf("%s:\n%s\n", board->name, done.console);
    assert_true(done.ended);
    assert_int_equal(done.code, 0);
    assert_non_null(strstr(done.console, "the port passes"));
}

static int test_machine(const machine *m)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_port_passes)};

    board = m;
    alarm(300);
    return cmocka_run_group_tests_name(m->name, tests, start, stop);
}

int main(int argc, char **argv)
{
    return machine_each(argc, argv, test_machine);
}
