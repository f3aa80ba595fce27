/* A session over TCP whose request had no reply: the request is given up with the connection, and
 * so is the alert that ends the session. The test has a network of its own. */
#define _GNU_SOURCE
#include "await.h"
#include "own_network.h"
#include "test.h"
#include "tls_pair.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

enum { TIMEOUT_MS = 100 };

static mbm_tls_identity server_identity, client_identity;
static mbm_tcp_listener listener;
static mbm_tcp place, tcp;
static mbm_tcp_addresses addresses;
static mbm_tls served, tls;
static mbm_server server;
static mbm_client client;
static mbm_clientRequest request;
static uint8_t frame[MBM_MAX_TCP_FRAME], incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[1];
static mbm_registerTable holding;
static mbm_unit unit;

/* One round of the program of each side. */
static void go_both(void)
{
    if (mbm_tls_accept(&listener, &server_identity, &served, &place, 1) == 0) {
        const mbm_port port = mbm_tls_port(&served);

        OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    }
    if (mbm_tcp_isInUse(&place))
        (void)mbm_server_poll(&server);
    (void)mbm_client_poll(&client);
}

static void begin(void)
{
    mbm_port below = mbm_tcp_port(&tcp), port = mbm_tls_port(&tls);
    char service[8];

    own_network();
    tls_identify(&server_identity, "server", "authority", 1);
    tls_identify(&client_identity, "operator", "authority", 0);
    holding = (mbm_registerTable){.words = words, .size = 1};
    unit = (mbm_unit){.id = 1};
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    snprintf(service, sizeof service, "%u", listener.port);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(mbm_tls_open(&tls, &client_identity, &below, "localhost", NULL),
                     MBM_TLS_HANDSHAKE);
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    request.unit = 1;
}

static void end(void)
{
    mbm_tls_close(&tls);
    mbm_tcp_close(&tcp);
    mbm_tls_close(&served);
    mbm_tcp_close(&place);
    mbm_tcp_closeListener(&listener);
    mbm_tls_end(&client_identity);
    mbm_tls_end(&server_identity);
}

fixture each_test = {begin, end};

TEST(a_write_that_timed_out_does_not_follow_the_end_of_its_session)
{
    struct sockaddr_in at;
    socklen_t size = sizeof at;

    /* A handshake takes seconds in valgrind. */
    OK(mbm_client_setResponseTimeout(&client, UINT16_MAX));
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 0, 7));
    AWAIT((go_both(), request.status != MBM_PENDING));
    IS(MBM_OK, request.status);
    assert_int_equal(getsockname(tcp.fd, (struct sockaddr *)&at, &size), 0);

    own_network_set(0);
    OK(mbm_client_setResponseTimeout(&client, TIMEOUT_MS));
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 0, 8));
    AWAIT((go_both(), request.status != MBM_PENDING));
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    mbm_tls_close(&tls);
    mbm_tcp_close(&tcp);
    assert_int_equal(own_network_sockets(ntohs(at.sin_port)), 0);
    own_network_set(1);
    go_both();
    assert_int_equal(words[0], 7);
}
