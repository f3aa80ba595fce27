/* mbm_call: a blocking call on a client over a serial line and over TCP, against libmodbus's
 * servers and against links that fail. */
#define _GNU_SOURCE
#include "mbm_call.h"
#include "pty.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <pthread.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

enum { UNIT = 17, FIRST = 100 };

static mbm_client client;
static mbm_clientRequest request;
static mbm_caller caller;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[125];
static mbm_tty tty;
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;
static server rtu_server;
static tcp_server server_of_tcp;
static int ends[2]; /* a connection whose peer is the test */
static pthread_t main_thread;
static volatile sig_atomic_t signals, stop;

static void prepare(void)
{
    request = (mbm_clientRequest){.unit = UNIT, .reply = words, .replyBytes = sizeof words};
    stop = signals = 0;
    main_thread = pthread_self();
}

static void begin_on_tty(int fd)
{
    mbm_port port = mbm_tty_port(&tty);

    prepare();
    memset(&tty, 0, sizeof tty);
    assert_int_equal(mbm_tty_attach(&tty, fd), 0);
    OK(mbm_client_beginRtu(&client, &port, incoming, sizeof incoming));
    OK(mbm_client_setBaudRate(&client, 115200));
    OK(mbm_client_setResponseTimeout(&client, 20000));
    caller = mbm_call_overTty(&tty, &client, &request);
}

static void begin_on_tcp(void)
{
    mbm_port port = mbm_tcp_port(&tcp);

    prepare();
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&client, 20000));
    caller = mbm_call_overTcp(&tcp, &client, &request);
}

/* Begins on one end of a connection; the test is the device, at ends[1]. */
static void begin_on_pair(void)
{
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
    memset(&tcp, 0, sizeof tcp);
    assert_int_equal(mbm_tcp_attach(&tcp, ends[0]), 0);
    begin_on_tcp();
}

static void end_pair(void)
{
    mbm_tcp_close(&tcp);
    close(ends[1]);
}

static uint8_t read_words(uint16_t count)
{
    return mbm_client_readHoldingRegisters(&client, &request, FIRST, count);
}

/* A program with libmodbus does each of these in one line. */
static void asks_everything(mbm_caller *with)
{
    static const uint16_t written[] = {0x1234, 0xFEDC};
    static const uint8_t bits[] = {0x05};

    OK(mbm_call(with, read_words(125)));
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(words[i], server_pattern(FIRST + i));
    OK(mbm_call(with, mbm_client_writeSingleRegister(&client, &request, 7, 0xABCD)));
    request.data = written;
    OK(mbm_call(with, mbm_client_writeMultipleRegisters(&client, &request, 8, 2)));
    OK(mbm_call(with, mbm_client_readHoldingRegisters(&client, &request, 7, 3)));
    assert_int_equal(words[0], 0xABCD);
    assert_int_equal(words[1], 0x1234);
    assert_int_equal(words[2], 0xFEDC);
    request.data = bits;
    OK(mbm_call(with, mbm_client_writeMultipleCoils(&client, &request, 3, 3)));
    OK(mbm_call(with, mbm_client_readCoils(&client, &request, 3, 3)));
    assert_int_equal(*(const uint8_t *)words, 0x05);
    OK(mbm_call(with, mbm_client_reportServerId(&client, &request)));
    assert_true(request.length > 2);
    IS(MBM_ILLEGAL_DATA_ADDRESS,
       mbm_call(with, mbm_client_readHoldingRegisters(&client, &request, 60000, 1)));
    /* A refused request is not waited for. */
    IS(MBM_ILLEGAL_DATA_VALUE,
       mbm_call(with, mbm_client_readHoldingRegisters(&client, &request, 0, 126)));
}

TEST(calls_over_a_serial_line_are_answered_by_libmodbus)
{
    server_start(&rtu_server, UNIT);
    begin_on_tty(rtu_server.line.ours);
    asks_everything(&caller);
    mbm_tty_detach(&tty);
    server_stop(&rtu_server);
}

TEST(calls_over_tcp_are_answered_by_libmodbus)
{
    char service[8];

    tcp_server_start(&server_of_tcp);
    snprintf(service, sizeof service, "%u", server_of_tcp.port);
    memset(&tcp, 0, sizeof tcp);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    begin_on_tcp();
    asks_everything(&caller);
    mbm_tcp_close(&tcp);
    tcp_server_stop(&server_of_tcp);
}

TEST(a_device_that_does_not_answer_is_a_timeout)
{
    begin_on_pair();
    OK(mbm_client_setResponseTimeout(&client, 30));
    OK(mbm_client_setRetries(&client, 1));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_call(&caller, read_words(1)));
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    end_pair();
}

static void *hang_up(void *unused)
{
    char byte;

    /* Only when the request is in flight. */
    assert_int_equal(read(ends[1], &byte, 1), 1);
    shutdown(ends[1], SHUT_RDWR);
    return NULL;
}

TEST(a_link_that_is_lost_ends_the_call)
{
    pthread_t thread;
    pty line;

    begin_on_pair();
    pthread_create(&thread, NULL, hang_up, NULL);
    IS(MBM_LINK_LOST, mbm_call(&caller, read_words(1)));
    pthread_join(thread, NULL);
    assert_int_not_equal(tcp.error, 0);
    /* Again, on the lost link. */
    IS(MBM_LINK_LOST, mbm_call(&caller, read_words(1)));
    end_pair();

    pty_open(&line);
    begin_on_tty(line.ours);
    mbm_tty_detach(&tty);
    IS(MBM_LINK_LOST, mbm_call(&caller, read_words(1)));
    assert_int_equal(tty.error, EBADF);
    pty_close(&line);
}

/* Sends signals to the program until the request has arrived and been answered. */
static void *interrupt_and_answer(void *unused)
{
    uint8_t frame[12];

    assert_int_equal(read(ends[1], frame, sizeof frame), sizeof frame);
    for (int i = 0; i < 20; i++) {
        pthread_kill(main_thread, SIGUSR1);
        usleep(1000);
    }
    frame[5] = 5;
    frame[8] = 2;
    frame[9] = 0x12;
    frame[10] = 0x34;
    assert_int_equal(write(ends[1], frame, 11), 11);
    return NULL;
}

static void count_signal(int number)
{
    signals++;
}

static void stop_it(int number)
{
    stop = 1;
}

static void handle(void (*handler)(int))
{
    struct sigaction action = {0};

    action.sa_handler = handler; /* without SA_RESTART */
    sigaction(SIGUSR1, &action, NULL);
}

TEST(signals_do_not_end_the_call)
{
    pthread_t thread;

    handle(count_signal);
    begin_on_pair();
    pthread_create(&thread, NULL, interrupt_and_answer, NULL);
    OK(mbm_call(&caller, read_words(1)));
    pthread_join(thread, NULL);
    assert_int_equal(words[0], 0x1234);
    assert_true(signals > 0);
    end_pair();
}

static void *signal_when_asked(void *unused)
{
    char byte;

    assert_int_equal(read(ends[1], &byte, 1), 1);
    pthread_kill(main_thread, SIGUSR1);
    return NULL;
}

TEST(a_signal_that_sets_stop_cancels_the_request)
{
    pthread_t thread;

    handle(stop_it);
    begin_on_pair();
    caller.stop = &stop;
    pthread_create(&thread, NULL, signal_when_asked, NULL);
    IS(MBM_CANCELLED, mbm_call(&caller, read_words(1)));
    pthread_join(thread, NULL);
    IS(MBM_CANCELLED, request.status);
    assert_int_equal(mbm_client_pending(&client), 0);
    end_pair();
}

static mbm_clientRequest other;
static unsigned others_ended;
static uint8_t called_in_done;

static void call_again(void *context, mbm_clientRequest *ended)
{
    others_ended++;
    called_in_done = mbm_call(&caller, read_words(1));
    IS(MBM_CANCELLED, request.status);
}

static void note_end(void *context, mbm_clientRequest *ended)
{
    others_ended++;
}

TEST(requests_of_others_go_on)
{
    uint16_t word;

    server_start(&rtu_server, UNIT);
    begin_on_tty(rtu_server.line.ours);
    others_ended = 0;
    other = (mbm_clientRequest){
        .unit = UNIT, .reply = &word, .replyBytes = sizeof word, .done = note_end};
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &other, 5, 1));
    request.done = note_end;
    OK(mbm_call(&caller, read_words(1)));
    assert_int_equal(others_ended, 2);
    assert_int_equal(word, server_pattern(5));

    /* All requests of the client. */
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &other, 5, 1));
    IS(MBM_PENDING, read_words(1));
    caller.request = NULL;
    OK(mbm_call(&caller, MBM_PENDING));
    assert_int_equal(others_ended, 4);
    assert_int_equal(mbm_client_pending(&client), 0);
    OK(mbm_call(&caller, MBM_PENDING));
    mbm_tty_detach(&tty);
    server_stop(&rtu_server);
}

TEST(a_call_from_within_done_is_busy_and_leaves_nothing_pending)
{
    uint16_t word;

    server_start(&rtu_server, UNIT);
    begin_on_tty(rtu_server.line.ours);
    others_ended = 0;
    called_in_done = MBM_OK;
    other = (mbm_clientRequest){
        .unit = UNIT, .reply = &word, .replyBytes = sizeof word, .done = call_again};
    {
        mbm_caller of_other = mbm_call_overTty(&tty, &client, &other);

        OK(mbm_call(&of_other, mbm_client_readHoldingRegisters(&client, &other, 5, 1)));
    }
    assert_int_equal(others_ended, 1);
    IS(MBM_BUSY, called_in_done);
    assert_int_equal(mbm_client_pending(&client), 0);
    OK(mbm_call(&caller, read_words(1)));
    mbm_tty_detach(&tty);
    server_stop(&rtu_server);
}

static unsigned rounds;

static void once_more(void *context, mbm_clientRequest *ended)
{
    if (++rounds < 3)
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, ended, FIRST, 1));
}

TEST(a_request_that_done_queues_again_is_waited_for)
{
    server_start(&rtu_server, UNIT);
    begin_on_tty(rtu_server.line.ours);
    rounds = 0;
    request.done = once_more;
    OK(mbm_call(&caller, read_words(1)));
    assert_int_equal(rounds, 3);
    mbm_tty_detach(&tty);
    server_stop(&rtu_server);
}

TEST(a_call_that_cannot_go_on_is_refused)
{
    static mbm_client idle;

    begin_on_pair();
    IS(MBM_INVALID_ARGUMENT, mbm_call(NULL, MBM_PENDING));
    mbm_caller wrong = caller;
    wrong.client = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_call(&wrong, MBM_PENDING));
    wrong = caller;
    wrong.wait = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_call(&wrong, MBM_PENDING));
    wrong = caller;
    wrong.client = &idle;
    IS(MBM_NOT_INITIALISED, mbm_call(&wrong, MBM_PENDING));

    OK(mbm_client_suspend(&client, NULL));
    IS(MBM_BUSY, mbm_call(&caller, read_words(1)));
    IS(MBM_CANCELLED, request.status);
    OK(mbm_client_resume(&client, NULL));

    /* A request that is pending on another client. */
    {
        mbm_port port = mbm_tcp_port(&tcp);

        OK(mbm_client_beginTcp(&idle, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
        IS(MBM_PENDING, read_words(1));
        wrong = caller;
        wrong.client = &idle;
        IS(MBM_INVALID_ARGUMENT, mbm_call(&wrong, MBM_PENDING));
        IS(MBM_PENDING, request.status);
    }
    end_pair();
}

static int cannot_wait(void *port, uint32_t timeoutUs)
{
    return -1;
}

TEST(a_link_that_cannot_be_waited_for_ends_by_the_timeout)
{
    begin_on_pair();
    OK(mbm_client_setResponseTimeout(&client, 30));
    caller.wait = cannot_wait;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_call(&caller, read_words(1)));
    end_pair();
}

static uint32_t longest;

/* Notes the time, and lets the reply arrive instead of sleeping it. */
static int wait_for_long(void *port, uint32_t timeoutUs)
{
    static const uint8_t rest[] = {0, 0, 0, 5, UNIT, 3, 2, 0x56, 0x78};
    uint8_t frame[12];

    if (timeoutUs > longest)
        longest = timeoutUs;
    if (recv(ends[1], frame, sizeof frame, MSG_DONTWAIT) == (ssize_t)sizeof frame) {
        assert_int_equal(write(ends[1], frame, 2), 2);
        assert_int_equal(write(ends[1], rest, sizeof rest), sizeof rest);
    }
    return 1;
}

TEST(the_longest_response_timeout_is_passed_on_whole)
{
    begin_on_pair();
    OK(mbm_client_setResponseTimeout(&client, 65535));
    caller.timeoutMs = MBM_CALL_FOREVER;
    longest = 0;
    caller.wait = wait_for_long;
    OK(mbm_call(&caller, read_words(1)));
    assert_int_equal(words[0], 0x5678);
    assert_in_range(longest, 60000000u, 65535000u);
    /* With `stop` the sleeps are short. */
    longest = 0;
    caller.stop = &stop;
    OK(mbm_call(&caller, read_words(1)));
    assert_int_equal(longest, MBM_CALL_SLEEP);
    end_pair();
}

TEST(a_call_ends_at_its_own_limit_before_the_device_answers)
{
    begin_on_pair();
    caller.timeoutMs = 30;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_call(&caller, read_words(1)));
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    end_pair();
}

/* --- mbm_call while there is no link: hosts that refuse and hosts that never answer --- */

enum { PEER_UNIT = 17, FIRST_WORD = 100, SOON_MS = 30 };

static mbm_link kept;

static uint16_t peer_words[1];

static void begin_with_a_link(void)
{
    mbm_port port = mbm_tcp_port(&tcp);

    memset(&request, 0, sizeof request);
    request.unit = PEER_UNIT;
    request.reply = peer_words;
    request.replyBytes = sizeof peer_words;
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&client, 20000));
    caller = mbm_call_overTcp(&tcp, &client, &request);
}

static int error_in_callback;
static uint8_t status_in_callback;

static void note_failure(void *context, uint8_t event, uint8_t status)
{
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

    *listener = tcp_listenOnFree(&port);
    assert_int_equal(listen(*listener, 0), 0);
    *filler = tcp_connectTo(port);
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
    begin_with_a_link();
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
    begin_with_a_link();
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

    begin_with_a_link();
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
