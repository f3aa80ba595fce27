/* mbm_tcp_wait sleeps where the program would not react to what it could report. */
#define _GNU_SOURCE
#include "port_of_peer.h"
#include "test.h"

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

fixture each_test = {begin, end};

enum { SECOND = 1000000 };

TEST(a_completed_connection_ends_the_wait_once)
{
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 5 * SECOND), 1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
}

/* The peer sends, and does not read. The program cannot answer, so it sleeps. */
TEST(unread_bytes_do_not_end_the_wait_again)
{
    static uint8_t much[60000];
    uint8_t bytes[4];
    int pair[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(mbm_tcp_attach(&tcp, pair[0]), 0);
    assert_int_equal(write(pair[1], "abcd", 4), 4);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    /* They end it again once the program has read, or has written everything that it had to
     * write. */
    assert_int_equal(port.read(port.context, bytes, 2), 2);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    while (port.write(port.context, much, sizeof much) > 0)
        ;
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    assert_int_equal(fcntl(pair[1], F_SETFL, O_NONBLOCK), 0);
    while (read(pair[1], much, sizeof much) > 0)
        ;
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(port.write(port.context, much, 10), 10);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(port.read(port.context, bytes, 4), 2);
    /* Nor does the end of the stream, once it was reported. */
    assert_int_equal(read(pair[1], much, sizeof much), 10);
    close(pair[1]);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    assert_int_equal(mbm_tcp_isConnected(&tcp), -1);
    assert_int_equal(tcp.error, EPIPE);
}
