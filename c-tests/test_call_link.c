/* mbm_call while there is no link: hosts that refuse and hosts that never answer. */
#define _GNU_SOURCE
#include "mbm_call.h"
#include "tcp_server.h"
#include "test.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { UNIT = 17, FIRST = 100, SOON_MS = 30 };

static mbm_client client;
static mbm_clientRequest request;
static mbm_caller caller;
static mbm_link kept;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[1];
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;

static void begin_on_tcp(void)
{
    mbm_port port = mbm_tcp_port(&tcp);

    memset(&request, 0, sizeof request);
    request.unit = UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&client, 20000));
    caller = mbm_call_overTcp(&tcp, &client, &request);
}

static uint8_t read_words(uint16_t count)
{
    return mbm_client_readHoldingRegisters(&client, &request, FIRST, count);
}

static int error_in_callback;
static uint8_t status_in_callback;

static void note_failure(void *context, uint8_t event, uint8_t status)
{
    (void)context;
    if (event != MBM_LINK_EVENT_FAILED)
        return;
    error_in_callback = tcp.error;
    status_in_callback = status;
}

static void keep_link(void)
{
    const mbm_linkHooks hooks = mbm_tcp_link(&tcp);

    memset(&kept, 0, sizeof kept);
    error_in_callback = 0;
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setCallback(&kept, note_failure, NULL));
}

/* A host that never answers: a listener whose queue is full. Returns its descriptors. */
static void find_silent_host(int *listener, int *filler, char *service)
{
    uint16_t port;

    *listener = tcp_listen(&port);
    assert_int_equal(listen(*listener, 0), 0);
    *filler = tcp_connect(port);
    sprintf(service, "%u", port);
}

TEST(a_call_ends_at_its_own_limit_while_requests_wait_for_a_link)
{
    uint16_t port;
    const int nobody = tcp_reserve(&port);
    char service[8];

    sprintf(service, "%u", port);
    memset(&tcp, 0, sizeof tcp);
    assert_int_equal(mbm_tcp_openLater(&tcp, &addresses, "127.0.0.1", service), 0);
    begin_on_tcp();
    keep_link();
    OK(mbm_link_setRequestsWait(&kept, 1));
    caller.timeoutMs = SOON_MS;
    IS(MBM_LINK_LOST, mbm_call(&caller, read_words(1)));
    IS(MBM_LINK_LOST, request.status);
    assert_int_equal(tcp.error, ECONNREFUSED);
    assert_int_equal(mbm_client_pending(&client), 0);
    /* All requests: they go on waiting. */
    IS(MBM_PENDING, read_words(1));
    caller.request = NULL;
    IS(MBM_LINK_LOST, mbm_call(&caller, MBM_PENDING));
    assert_int_equal(mbm_client_pending(&client), 1);
    mbm_tcp_close(&tcp);
    close(nobody);
}

/* Each limit alone: that of the call, the link's, and without a link the response timeout. */
TEST(a_host_that_never_answers_is_a_timeout_of_the_connection)
{
    int listener, filler;
    char service[8];

    find_silent_host(&listener, &filler, service);
    memset(&tcp, 0, sizeof tcp);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    begin_on_tcp();
    OK(mbm_client_setResponseTimeout(&client, SOON_MS));
    IS(MBM_CONNECT_TIMED_OUT, mbm_call(&caller, read_words(1)));
    IS(MBM_CONNECT_TIMED_OUT, request.status);
    assert_int_equal(tcp.error, ETIMEDOUT);
    assert_string_equal(mbm_tcp_text(&tcp), strerror(ETIMEDOUT));
    assert_string_equal(mbm_status_text(request.status), "the connection was not made in time");

    /* RTU over TCP, whose client cannot tell this from a line that is never silent. */
    {
        mbm_port port = mbm_tcp_port(&tcp);

        OK(mbm_client_beginRtuOverTcp(&client, &port, incoming, sizeof incoming));
        OK(mbm_client_setResponseTimeout(&client, SOON_MS));
        IS(MBM_CONNECT_TIMED_OUT, mbm_call(&caller, read_words(1)));
        IS(MBM_CONNECT_TIMED_OUT, request.status);
    }

    begin_on_tcp();
    keep_link();
    OK(mbm_link_setConnectTimeout(&kept, SOON_MS));
    IS(MBM_CONNECT_TIMED_OUT, mbm_call(&caller, read_words(1)));
    IS(MBM_CONNECT_TIMED_OUT, status_in_callback);
    assert_int_equal(error_in_callback, ETIMEDOUT);
    assert_int_equal(tcp.error, ETIMEDOUT);

    OK(mbm_link_setConnectTimeout(&kept, 0));
    OK(mbm_link_setRequestsWait(&kept, 1));
    caller.timeoutMs = SOON_MS;
    IS(MBM_CONNECT_TIMED_OUT, mbm_call(&caller, read_words(1)));
    IS(MBM_CONNECT_TIMED_OUT, request.status);
    assert_int_equal(tcp.error, ETIMEDOUT);
    mbm_tcp_close(&tcp);
    close(filler);
    close(listener);
}
