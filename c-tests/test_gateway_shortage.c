/* The gateway without enough descriptors or places: it serves the connections that
 * it has, sleeps, accepts waiting connections when there is a free place again, and ends on
 * SIGTERM. */
#define _GNU_SOURCE
#include "asked.h"
#include "await.h"
#include "skip.h"
#include "program.h"
#include "pty.h"
#include "tcp_server.h"
#include "test.h"

#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

/* The gateway needs 6 descriptors itself: 3 for the terminal, 2 to listen and 1 for the line. */
enum { OWN = 6, NO_LINE = 200, ABSENT = 6, PLACES = 16, MANY = 40, TIMEOUT_MS = 3000 };

static program gateway;
static uint16_t port;
static pty line;
static char name[64];
static int fds[MANY];

static void begin(void)
{
    for (unsigned i = 0; i < MANY; i++)
        fds[i] = -1;
    alarm(6 * PATIENCE_MS / 1000);
    pty_open(&line);
    snprintf(name, sizeof name, "/tmp/mbm-shortage-%d", (int)getpid());
    unlink(name);
    assert_int_equal(symlink(line.path, name), 0);
}

static void end(void)
{
    for (unsigned i = 0; i < MANY; i++)
        if (fds[i] >= 0)
            close(fds[i]);
    unlink(name);
    pty_close(&line);
    alarm(0);
}

fixture each_test = {begin, end};

static void start(unsigned descriptors, const char *idle)
{
    char text[64], path[128];
    const char *arguments[] = {"gateway",  "--idle", idle,   "--timeout", "3s",
                               "tcp://:0", path,     "1-10", NULL};
    int number;

    snprintf(path, sizeof path, "rtu:%s?baud=115200&parity=none", name);
    program_start_limited(&gateway, "mbm", arguments, descriptors);
    program_line(&gateway, text, sizeof text);
    assert_int_equal(sscanf(text, "ready %d", &number), 1);
    port = (uint16_t)number;
}

static void stop(void)
{
    kill(gateway.pid, SIGTERM);
    assert_int_equal(program_end(&gateway), 0);
}

static void connect_to(unsigned first, unsigned last)
{
    for (; first < last; first++)
        fds[first] = tcp_connectTo(port);
}

static int is_served(int fd)
{
    return asked_is_served(fd, NO_LINE, 0x0A);
}

static void close_from_to(unsigned first, unsigned last)
{
    for (; first < last; first++) {
        close(fds[first]);
        fds[first] = -1;
    }
}

TEST(with_few_descriptors_the_gateway_serves_sleeps_and_ends)
{
    static const unsigned limits[] = {OWN + 1, OWN + 3, OWN + 15, OWN + 16, OWN + 17};

    SKIP_WITHOUT_LIMITS();
    for (unsigned i = 0; i < COUNT(limits); i++) {
        const unsigned most = limits[i] - OWN < PLACES ? limits[i] - OWN : PLACES;

        start(limits[i], "60s");
        connect_to(0, most);
        for (unsigned k = 0; k < most; k++)
            assert_int_equal(is_served(fds[k]), 1);
        AWAIT(program_sleeps(&gateway));
        stop();
        close_from_to(0, most);
    }
}

TEST(connections_beyond_the_descriptors_are_closed_at_once)
{
    enum { SERVED = 4, ALL = MANY };
    unsigned i;

    SKIP_WITHOUT_LIMITS();
    start(OWN + SERVED, "60s");
    connect_to(0, ALL);
    for (i = 0; i < SERVED; i++)
        assert_int_equal(is_served(fds[i]), 1);
    AWAIT(program_sleeps(&gateway));
    for (i = 0; i < SERVED; i++)
        assert_int_equal(is_served(fds[i]), 1);
    for (; i < ALL; i++)
        assert_int_equal(is_served(fds[i]), 0);
    close_from_to(0, ALL);
    AWAIT((fds[0] = tcp_connectTo(port), is_served(fds[0])) || (close(fds[0]), 0));
    stop();
}

TEST(a_new_client_gets_the_place_of_an_idle_one)
{
    char byte;

    start(0, "1s");
    connect_to(0, PLACES);
    /* The connections are silent for at least a second. */
    AWAIT((fds[PLACES] = tcp_connectTo(port), is_served(fds[PLACES])) || (close(fds[PLACES]), 0));
    /* The first connection has been idle for longest. */
    assert_int_equal(recv(fds[0], &byte, 1, 0), 0);
    assert_int_equal(is_served(fds[PLACES]), 1);
    stop();
}

TEST(a_new_client_gets_the_descriptor_of_an_idle_one)
{
    enum { SERVED = 4 };

    SKIP_WITHOUT_LIMITS();
    start(OWN + SERVED, "1s");
    connect_to(0, SERVED);
    for (unsigned i = SERVED; i < SERVED + 2; i++)
        AWAIT((fds[i] = tcp_connectTo(port), is_served(fds[i])) || (close(fds[i]), 0));
    stop();
}

TEST(an_idle_time_of_0_closes_none)
{
    start(0, "0s");
    connect_to(0, PLACES + 1);
    assert_int_equal(is_served(fds[PLACES]), 0);
    for (unsigned i = 0; i < PLACES; i++)
        assert_int_equal(is_served(fds[i]), 1);
    stop();
}

TEST(a_connection_that_waits_for_its_device_is_not_idle)
{
    static const uint8_t request[] = {0, 1, 0, 0, 0, 6, ABSENT, 3, 0, 0, 0, 1};
    uint8_t answer[9];

    start(0, "1s");
    connect_to(0, 1);
    assert_int_equal(write(fds[0], request, sizeof request), sizeof request);
    /* The request is on the line before the other clients connect. */
    assert_int_equal(read(line.ours, answer, 1), 1);
    connect_to(1, PLACES);
    AWAIT((fds[PLACES] = tcp_connectTo(port), is_served(fds[PLACES])) || (close(fds[PLACES]), 0));
    assert_int_equal(recv(fds[0], answer, sizeof answer, MSG_WAITALL), sizeof answer);
    assert_int_equal(answer[8], 0x0B);
    stop();
}

TEST(a_lost_line_keeps_its_descriptor)
{
    enum { SERVED = 4 };
    static const uint8_t request[] = {0, 1, 0, 0, 0, 6, ABSENT, 3, 0, 0, 0, 1};
    struct pollfd input;

    SKIP_WITHOUT_LIMITS();
    start(OWN + SERVED, "60s");
    connect_to(0, SERVED + 2);
    for (unsigned i = 0; i < SERVED; i++)
        assert_int_equal(is_served(fds[i]), 1);
    /* Another program may get a terminal of the same name. */
    assert_int_equal(unlink(name), 0);
    pty_close(&line);
    assert_int_equal(asked_is_served(fds[0], ABSENT, 0x0A), 1);
    AWAIT(program_sleeps(&gateway));
    pty_open(&line);
    assert_int_equal(symlink(line.path, name), 0);
    /* The gateway opens the line again when a request needs it, at most once a second. */
    input = (struct pollfd){line.ours, POLLIN, 0};
    AWAIT((send(fds[0], request, sizeof request, MSG_NOSIGNAL), poll(&input, 1, 100) == 1));
    stop();
}
