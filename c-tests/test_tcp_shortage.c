/* Connections without enough places or descriptors: those that are served stay served, the
 * program sleeps, and waiting connections are accepted when there is a free place again. */
#define _GNU_SOURCE
#include "await.h"
#include "skip.h"
#include "mbm_tcp.h"
#include "tcp_server.h"
#include "tcp_waiting.h"
#include "test.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { PLACES = 3, MINUTE_MS = 60000, FLOOD = 70, TURNED_AWAY = 64 };

static mbm_tcp_listener listener;
static mbm_tcp places[PLACES];
static int clients[FLOOD + PLACES];
static unsigned client_count;
static struct rlimit found;
static time_t ahead; /* seconds by which the clock of the port is fast */

/* This function replaces that of libc. */
int clock_gettime(clockid_t id, struct timespec *time)
{
    const int result = (int)syscall(SYS_clock_gettime, id, time);

    if (result == 0)
        time->tv_sec += ahead;
    return result;
}

static void limit_descriptors(rlim_t most)
{
    const struct rlimit limit = {most, found.rlim_max};

    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
}

/* Lowers the limit so that the next descriptor would exceed it. */
static void leave_no_descriptor(void)
{
    const int next = dup(0);

    assert_true(next >= 0);
    close(next);
    limit_descriptors((rlim_t)next);
}

static void begin(void)
{
    alarm(2 * PATIENCE_MS / 1000);
    ahead = 0;
    client_count = 0;
    memset(&listener, 0, sizeof listener);
    memset(places, 0, sizeof places);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &found), 0);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
}

static void end(void)
{
    limit_descriptors(found.rlim_cur);
    for (unsigned i = 0; i < client_count; i++)
        close(clients[i]);
    for (unsigned i = 0; i < PLACES; i++)
        mbm_tcp_close(&places[i]);
    mbm_tcp_closeListener(&listener);
    alarm(0);
}

fixture each_test = {begin, end};

static void connect_some(unsigned count)
{
    tcp_connect_some(clients + client_count, count, listener.fd, listener.port);
    client_count += count;
}

static int accept_one(void)
{
    return mbm_tcp_accept(&listener, places, PLACES);
}

static void expect_none(int error)
{
    assert_int_equal(accept_one(), -1);
    assert_int_equal(errno, error);
}

static void fill(void)
{
    connect_some(PLACES);
    for (int i = 0; i < PLACES; i++)
        assert_int_equal(accept_one(), i);
}

/* The peer of a place sends a byte, and the program reads it. */
static void exchange_byte(unsigned place)
{
    const mbm_port port = mbm_tcp_port(&places[place]);
    uint8_t byte;

    assert_int_equal(write(clients[place], "x", 1), 1);
    AWAIT(port.read(port.context, &byte, 1) == 1);
}

static int is_lost(unsigned place)
{
    const mbm_port port = mbm_tcp_port(&places[place]);
    uint8_t byte;

    return port.read(port.context, &byte, 1) < 0;
}

static int wait_for(uint32_t micros)
{
    return mbm_tcp_wait(places, PLACES, &listener, -1, micros);
}

TEST(a_place_is_in_use_until_it_is_closed)
{
    mbm_tcp_addresses addresses;
    mbm_tcp place;

    memset(&place, 0, sizeof place);
    assert_int_equal(mbm_tcp_isInUse(&place), 0);
    assert_int_equal(mbm_tcp_idleFor(&place), -1);
    mbm_tcp_disconnect(&place);
    assert_int_equal(mbm_tcp_isInUse(&place), 0);
    connect_some(1);
    assert_int_equal(mbm_tcp_accept(&listener, &place, 1), 0);
    assert_int_equal(mbm_tcp_isInUse(&place), 1);
    assert_true(mbm_tcp_idleFor(&place) >= 0);
    mbm_tcp_disconnect(&place);
    assert_int_equal(mbm_tcp_isConnected(&place), -1);
    assert_int_equal(mbm_tcp_isInUse(&place), 1);
    assert_int_equal(mbm_tcp_idleFor(&place), -1);
    mbm_tcp_close(&place);
    assert_int_equal(mbm_tcp_isInUse(&place), 0);
    assert_int_equal(mbm_tcp_open(&place, &addresses, "127.0.0.1", "no-such-service"), -1);
    assert_int_equal(mbm_tcp_isInUse(&place), 0);
}

/* Accepts one connection. Two more wait, for which there is no descriptor, not even in place of
 * the listener's spare one. */
static void accept_one_and_let_two_wait(void)
{
    connect_some(1);
    assert_int_equal(accept_one(), 0);
    connect_some(2);
    limit_descriptors((rlim_t)listener.spare);
    expect_none(EMFILE);
}

TEST(a_connection_without_a_descriptor_is_closed_at_once)
{
    char byte;

    SKIP_WITHOUT_LIMITS();
    connect_some(1);
    assert_int_equal(accept_one(), 0);
    connect_some(2);
    leave_no_descriptor();
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, 2);
    for (unsigned i = 1; i < 3; i++)
        assert_int_equal(read(clients[i], &byte, 1), 0);
    assert_int_equal(wait_for(1000), 0);
    exchange_byte(0);
    /* The spare descriptor is there for the next one, which gets the first free descriptor. */
    limit_descriptors(found.rlim_cur);
    connect_some(1);
    assert_int_equal(accept_one(), 1);
    connect_some(1);
    leave_no_descriptor();
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, 3);
    assert_int_equal(read(clients[client_count - 1], &byte, 1), 0);
}

TEST(a_flood_without_descriptors_is_closed_in_parts)
{
    SKIP_WITHOUT_LIMITS();
    connect_some(FLOOD);
    leave_no_descriptor();
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, TURNED_AWAY);
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 1);
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, FLOOD);
    assert_int_equal(wait_for(1000), 0);
}

TEST(a_listener_without_a_descriptor_lets_the_program_sleep)
{
    SKIP_WITHOUT_LIMITS();
    accept_one_and_let_two_wait();
    assert_int_equal(wait_for(1000), 0);
    /* The listener tries again by itself. The program still serves the connections that it
     * has. */
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 0);
    expect_none(EMFILE);
    assert_int_equal(write(clients[0], "x", 1), 1);
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 1);
    assert_int_equal(listener.refused, 0);
}

TEST(a_waiting_connection_is_accepted_once_a_descriptor_is_free)
{
    SKIP_WITHOUT_LIMITS();
    accept_one_and_let_two_wait();
    limit_descriptors(found.rlim_cur);
    assert_int_equal(accept_one(), 1);
    assert_int_equal(accept_one(), 2);
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, 0);
    /* The listener ends the wait as before, and has its spare descriptor. */
    mbm_tcp_close(&places[0]);
    connect_some(1);
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 1);
    leave_no_descriptor();
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, 1);
}

TEST(an_idle_connection_gives_its_descriptor_to_a_new_one)
{
    SKIP_WITHOUT_LIMITS();
    listener.idleTimeMs = MINUTE_MS;
    connect_some(2);
    assert_int_equal(accept_one(), 0);
    assert_int_equal(accept_one(), 1);
    connect_some(1);
    leave_no_descriptor();
    ahead = 61;
    exchange_byte(0);
    assert_int_equal(accept_one(), 2);
    assert_int_equal(is_lost(1), 1);
    assert_int_equal(is_lost(0), 0);
    assert_int_equal(listener.idle, 1);
}

TEST(without_a_descriptor_nothing_is_closed_while_no_connection_waits)
{
    SKIP_WITHOUT_LIMITS();
    listener.idleTimeMs = MINUTE_MS;
    connect_some(1);
    assert_int_equal(accept_one(), 0);
    leave_no_descriptor();
    ahead = 3600;
    expect_none(EAGAIN);
    assert_int_equal(is_lost(0), 0);
    assert_int_equal(listener.idle, 0);
}

TEST(if_the_system_refuses_to_poll_the_wait_sleeps_and_reports)
{
    SKIP_WITHOUT_LIMITS();
    fill();
    assert_int_equal(write(clients[0], "x", 1), 1);
    limit_descriptors(1);
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 1);
    exchange_byte(1);
    assert_int_equal(wait_for(0), 1);
    exchange_byte(0);
}

TEST(the_oldest_idle_connection_gives_its_place_to_a_new_one)
{
    listener.idleTimeMs = MINUTE_MS;
    fill();
    ahead = 30;
    exchange_byte(1);
    ahead = 59;
    exchange_byte(0);
    ahead = 91;
    connect_some(2);
    /* Places 1 and 2 are idle, place 2 for longer. */
    expect_none(EAGAIN);
    assert_int_equal(is_lost(0), 0);
    assert_int_equal(is_lost(1), 0);
    assert_int_equal(is_lost(2), 1);
    assert_int_equal(places[2].error, ETIMEDOUT);
    mbm_tcp_close(&places[2]);
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 1);
    assert_int_equal(accept_one(), 2);
    expect_none(EAGAIN);
    assert_int_equal(is_lost(1), 1);
    mbm_tcp_close(&places[1]);
    assert_int_equal(accept_one(), 1);
    expect_none(EAGAIN);
    assert_int_equal(listener.idle, 2);
    assert_int_equal(listener.refused, 0);
}

TEST(an_idle_connection_stays_while_no_other_needs_its_place)
{
    listener.idleTimeMs = MINUTE_MS;
    fill();
    ahead = 3600;
    expect_none(EAGAIN);
    for (unsigned i = 0; i < PLACES; i++)
        assert_int_equal(is_lost(i), 0);
}

/* Expects that a new connection gets no place and is closed at once. */
static void expect_turned_away(uint32_t refused)
{
    char byte;

    connect_some(1);
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, refused);
    assert_int_equal(listener.idle, 0);
    assert_int_equal(read(clients[client_count - 1], &byte, 1), 0);
    for (unsigned i = 0; i < PLACES; i++)
        assert_int_equal(is_lost(i), 0);
}

TEST(connections_that_are_not_idle_keep_their_places)
{
    fill();
    ahead = 3600;
    /* No idle time is set. */
    expect_turned_away(1);
    listener.idleTimeMs = MINUTE_MS;
    for (unsigned i = 0; i < PLACES; i++) {
        places[i].isBusy = i != 0;
        if (i == 0)
            exchange_byte(i);
    }
    expect_turned_away(2);
    /* A new connection in a place is not busy. */
    mbm_tcp_close(&places[2]);
    connect_some(1);
    assert_int_equal(accept_one(), 2);
    assert_int_equal(places[2].isBusy, 0);
}

TEST(a_flood_of_connections_is_turned_away_in_parts)
{
    fill();
    connect_some(FLOOD);
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, TURNED_AWAY);
    assert_int_equal(wait_for(MBM_TCP_FOREVER), 1);
    expect_none(EAGAIN);
    assert_int_equal(listener.refused, FLOOD);
    assert_int_equal(wait_for(1000), 0);
}

TEST(a_failed_lookup_keeps_its_reason)
{
    mbm_tcp_listener other = {0};
    mbm_tcp_addresses addresses;
    mbm_tcp place;

    memset(&place, 0, sizeof place);
    assert_int_equal(mbm_tcp_open(&place, &addresses, "no such host", "502"), -1);
    assert_int_not_equal(place.lookupError, 0);
    assert_int_equal(mbm_tcp_listen(&other, NULL, "no-such-service"), -1);
    assert_int_equal(other.lookupError, EAI_SERVICE);
    assert_int_equal(mbm_tcp_listen(&other, "127.0.0.1", "0"), 0);
    assert_int_equal(other.lookupError, 0);
    mbm_tcp_closeListener(&other);
}
