/* Many requests over TCP to a device that splits, joins, reorders, repeats, drops and
 * delays its responses, answers with other ids, sends garbage and resets the connection.
 * Every request ends once, with its own data. */
#define _GNU_SOURCE
#include "tcp_peer.h"
#include "client.h"
#include "tcp_server.h"
#include "test.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

enum { FRAME = 12, HELD = 64, QUANTITY = 5, TIMEOUT = 30 };

/* --- the device */

typedef struct device {
    int listener, peer;
    volatile int stop;
    unsigned random;
    held_clock clock;
    struct {
        uint8_t bytes[64];
        size_t length;
        int64_t at;
    } held[HELD];
    unsigned count;
    pthread_t thread;
} device;

static unsigned chance(unsigned *state, unsigned limit)
{
    *state = *state * 1103515245u + 12345u;
    return (*state >> 16) % limit;
}

static uint16_t value_at(unsigned address)
{
    return (uint16_t)(address * 40503u + 7u);
}

static size_t respond(uint8_t *frame, const uint8_t *request)
{
    unsigned address = (unsigned)request[8] << 8 | request[9], i;

    memcpy(frame, request, 8);
    frame[5] = 3 + 2 * QUANTITY;
    frame[8] = 2 * QUANTITY;
    for (i = 0; i < QUANTITY; i++) {
        frame[9 + 2 * i] = (uint8_t)(value_at(address + i) >> 8);
        frame[10 + 2 * i] = (uint8_t)value_at(address + i);
    }
    return 9 + 2 * QUANTITY;
}

static void hold(device *d, const uint8_t *bytes, size_t length, unsigned delay)
{
    if (d->count == HELD)
        return;
    memcpy(d->held[d->count].bytes, bytes, length);
    d->held[d->count].length = length;
    d->held[d->count++].at = held_clock_now(&d->clock) + 1000 * (int64_t)delay;
}

/* Decides what happens to the response to a request. Returns 0 if the connection must be
 * closed. */
static int choose_fault(device *d, const uint8_t *request)
{
    uint8_t frame[64];
    size_t length = respond(frame, request);

    switch (chance(&d->random, 2000)) {
    case 0: /* no response */
    case 1: return 1;
    case 2: /* a response after the timeout */ hold(d, frame, length, 2 * TIMEOUT); return 1;
    case 3: /* the response twice */
    case 4: hold(d, frame, length, 0); break;
    case 5: /* a response with another id, too */
    case 6:
        frame[0] ^= 0x80;
        hold(d, frame, length, 0);
        frame[0] ^= 0x80;
        break;
    case 7: { /* garbage before the response */
        uint8_t garbage[9] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};

        hold(d, garbage, sizeof garbage, 0);
        break;
    }
    case 8: /* an exception instead */
        frame[5] = 3;
        frame[7] |= 0x80;
        frame[8] = 6;
        length = 9;
        break;
    case 9: return chance(&d->random, 4) != 0;
    default: break;
    }
    hold(d, frame, length, chance(&d->random, 500) == 0 ? 3 : 0);
    return 1;
}

/* Sends the responses that are due. Now and then the last one goes first, and now and then
 * they are sent in pieces. */
static void send_due(device *d)
{
    uint8_t all[HELD * 64];
    size_t length = 0, sent = 0;
    int64_t now = held_clock_now(&d->clock);

    for (unsigned i = 0; i < d->count;) {
        unsigned at = i;

        if (chance(&d->random, 3) == 0)
            at = d->count - 1;
        if (d->held[at].at > now) {
            i++;
            continue;
        }
        memcpy(all + length, d->held[at].bytes, d->held[at].length);
        length += d->held[at].length;
        d->held[at] = d->held[--d->count];
    }
    while (sent < length) {
        size_t piece = chance(&d->random, 8) == 0 ? 1 + chance(&d->random, 20) : length - sent;
        ssize_t done;

        if (piece > length - sent)
            piece = length - sent;
        done = send(d->peer, all + sent, piece, MSG_NOSIGNAL);
        if (done < 0)
            return;
        sent += (size_t)done;
    }
}

/* Tells the client's clock when the next response is due, so that the clock waits for it. */
static void set_clock_due(device *d)
{
    int64_t due = HELD_CLOCK_NEVER;

    for (unsigned i = 0; i < d->count; i++)
        if (d->held[i].at < due)
            due = d->held[i].at;
    held_clock_due(&d->clock, due);
}

static void *run_device(void *argument)
{
    device *d = (device *)argument;
    uint8_t bytes[4096];
    size_t have = 0;
    unsigned link = 0;
    int on = 1;

    while (!d->stop) {
        struct pollfd wait = {d->peer < 0 ? d->listener : d->peer, POLLIN, 0};
        size_t used = 0;
        ssize_t count;

        if (poll(&wait, 1, d->count > 0 ? 1 : 10) > 0) {
            if (d->peer < 0) {
                d->peer = accept(d->listener, NULL, NULL);
                link = held_clock_link(&d->clock);
                /* Without this, one piece would wait for the next, for longer than the
                 * timeout. */
                setsockopt(d->peer, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
                have = 0;
                continue;
            }
            count = recv(d->peer, bytes + have, sizeof bytes - have, 0);
            have += count > 0 ? (size_t)count : 0;
            while (count > 0 && have - used >= FRAME) {
                if (!choose_fault(d, bytes + used))
                    count = 0;
                used += FRAME;
                set_clock_due(d);
                held_clock_done(&d->clock, link, FRAME);
            }
            memmove(bytes, bytes + used, have - used);
            have -= used;
            if (count <= 0) {
                close(d->peer);
                d->peer = -1;
                d->count = 0;
                set_clock_due(d);
                continue;
            }
        }
        if (d->peer >= 0)
            send_due(d);
        set_clock_due(d);
    }
    if (d->peer >= 0)
        close(d->peer);
    return NULL;
}

/* --- the client */

typedef struct job {
    mbm_clientRequest request;
    uint16_t words[QUANTITY];
    unsigned pending;
} job;

static asker a;
static job jobs[MBM_CLIENT_DEPTH];
static unsigned long queued, ended, right, exceptions, failed, crossed, doubled, total;
static unsigned seed = 4711;

static void queue_job(job *j);

static void done(void *context, mbm_clientRequest *request)
{
    job *j = (job *)context;
    unsigned i, wrong = 0;

    doubled += j->pending != 1;
    j->pending = 0;
    ended++;
    if (request->status == MBM_OK) {
        for (i = 0; i < QUANTITY; i++)
            wrong |= j->words[i] != value_at(request->transaction + i);
        right += !wrong;
        crossed += wrong;
    } else if (request->status < 0x80) {
        exceptions++;
    } else {
        failed++;
    }
    if (queued < total)
        queue_job(j);
}

static void queue_job(job *j)
{
    memset(j->words, 0xEE, sizeof j->words);
    memset(&j->request, 0, sizeof j->request);
    j->request.unit = (uint8_t)(1 + chance(&seed, 3));
    j->request.done = done;
    j->request.context = j;
    j->request.reply = j->words;
    j->request.replyBytes = sizeof j->words;
    j->request.transaction = (uint16_t)(1 + queued % 60000);
    j->pending = 1;
    queued++;
    IS(MBM_PENDING,
       mbm_client_readHoldingRegisters(&a.client, &j->request, j->request.transaction, QUANTITY));
}

TEST(every_request_ends_once_and_with_its_own_data)
{
    const char *fewer = getenv("MBM_TRANSACTIONS");
    static device d;
    unsigned long reconnected = 0;
    uint16_t port;

    total = fewer ? strtoul(fewer, NULL, 10) : 200000;
    d.listener = tcp_listenOnFree(&port);
    d.peer = -1;
    d.random = 1;
    held_clock_start(&d.clock);
    assert_int_equal(pthread_create(&d.thread, NULL, run_device, &d), 0);
    asker_begin_tcp_by(&a, port, &d.clock);
    OK(mbm_client_setInFlight(&a.client, MBM_CLIENT_DEPTH));
    OK(mbm_client_setResponseTimeout(&a.client, TIMEOUT));
    OK(mbm_client_setRetries(&a.client, 1));
    for (unsigned i = 0; i < MBM_CLIENT_DEPTH && queued < total; i++)
        queue_job(&jobs[i]);
    while (mbm_client_poll(&a.client) == MBM_PENDING) {
        if (!mbm_client_isConnected(&a.client) && mbm_tcp_isConnected(&a.tcp) < 0) {
            reconnected++;
            IS(MBM_PENDING, mbm_client_reconnect(&a.client, &a.link));
        } else {
            asker_rest(&a);
        }
    }
    printf("%lu right, %lu exceptions, %lu failed, %lu reconnected, %u foreign, %u timeouts, "
           "%u resynchronised\n",
           right, exceptions, failed, reconnected, a.counters.foreignFrames, a.counters.timeouts,
           a.counters.resynchronisations);
    assert_int_equal(queued, total);
    assert_int_equal(ended, total);
    assert_int_equal(right + exceptions + failed, total);
    assert_int_equal(crossed, 0);
    assert_int_equal(doubled, 0);
    /* A request fails only if the connection is lost or the retry gets no answer either. */
    assert_true(right > total - total / 50 - 50);
    assert_true(fewer || (reconnected > 0 && exceptions > 0 && a.counters.foreignFrames > 0 &&
                          a.counters.timeouts > 0 && a.counters.resynchronisations > 0));
    d.stop = 1;
    pthread_join(d.thread, NULL);
    mbm_tcp_close(&a.tcp);
    close(d.listener);
}

/* The client against a TCP peer that plays one fault in each test: how the request that
 * meets the fault ends, without a retry and with one, and that the next requests succeed. */

enum { FAULT_TIMEOUT = 150, WORDS = 5, MET = 3, ASKED = 8 };

static held_clock by_clock;
static tcp_peer *peer;
static mbm_clientRequest requests[ASKED];
static uint16_t words[ASKED][WORDS];

static void begin(void)
{
    peer = tcp_peer_new();
    held_clock_start(&by_clock);
    tcp_peer_clock(peer, &by_clock);
    asker_begin_tcp_by(&a, tcp_peer_start(peer, 0), &by_clock);
    OK(mbm_client_setInFlight(&a.client, ASKED));
    OK(mbm_client_setResponseTimeout(&a.client, FAULT_TIMEOUT));
}

static void end(void)
{
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(peer);
}

static void queue_read(unsigned i)
{
    memset(&requests[i], 0, sizeof requests[i]);
    memset(words[i], 0, sizeof words[i]);
    requests[i].unit = 7;
    requests[i].reply = words[i];
    requests[i].replyBytes = sizeof words[i];
    requests[i].transaction = (uint16_t)(i + 1);
    IS(MBM_PENDING,
       mbm_client_readHoldingRegisters(&a.client, &requests[i], (uint16_t)(20 * i), WORDS));
}

static void is_right(unsigned i)
{
    OK(requests[i].status);
    for (unsigned word = 0; word < WORDS; word++)
        assert_int_equal(words[i][word], tcp_peer_word(20 * i + word));
}

/* Polls until all requests have ended. Connects anew if the connection was lost. */
static void finish(void)
{
    while (mbm_client_poll(&a.client) == MBM_PENDING)
        asker_rest(&a);
    if (!mbm_client_isConnected(&a.client) && mbm_tcp_isConnected(&a.tcp) < 0)
        IS(MBM_PENDING, mbm_client_reconnect(&a.client, &a.link));
}

/* Makes eight requests, one after the other. The third meets the fault. */
static void assert_ends_with(tcp_fault fault, unsigned argument, uint8_t status)
{
    tcp_peer_fault(peer, MET, fault, argument);
    for (unsigned i = 1; i <= ASKED; i++) {
        queue_read(i - 1);
        finish();
        if (i == MET && status != MBM_OK)
            assert_int_equal(requests[i - 1].status, status);
        else
            is_right(i - 1);
    }
    assert_int_equal(tcp_peer_count(peer).faults[fault], 1);
    assert_int_equal(tcp_peer_count(peer).requests, ASKED);
}

/* The same with one retry. A lost link and an exception are not retried. */
static void meets_and_retries(tcp_fault fault, unsigned argument)
{
    OK(mbm_client_setRetries(&a.client, 1));
    tcp_peer_fault(peer, MET, fault, argument);
    for (unsigned i = 0; i < ASKED; i++) {
        queue_read(i);
        finish();
        is_right(i);
    }
    assert_int_equal(tcp_peer_count(peer).requests, ASKED + 1);
}

#define MEETS(name, fault, argument, status)                                                       \
    TEST_WITH(name, begin, end)                                                                    \
    {                                                                                              \
        assert_ends_with(fault, argument, status);                                                 \
    }

#define MEETS_AND_RETRIES(name, fault, argument, status)                                           \
    MEETS(name, fault, argument, status)                                                           \
    TEST_WITH(name##_and_a_retry_helps, begin, end)                                                \
    {                                                                                              \
        meets_and_retries(fault, argument);                                                        \
    }

MEETS(a_response_in_time_is_waited_for, FAULT_DELAY, FAULT_TIMEOUT / 3, MBM_OK)
MEETS(a_response_in_single_bytes_is_put_together, FAULT_SPLIT, 1, MBM_OK)
MEETS(the_second_of_two_responses_is_dropped, FAULT_TWICE, 0, MBM_OK)
MEETS(a_response_of_another_id_before_the_right_one_is_dropped, FAULT_ALSO_OTHER_ID, 9, MBM_OK)
MEETS(garbage_before_the_response_is_skipped, FAULT_GARBAGE, 9, MBM_OK)
MEETS(an_exception_is_reported, FAULT_EXCEPTION, 6, MBM_SERVER_DEVICE_BUSY)
MEETS(half_a_response_and_the_end_is_a_lost_link, FAULT_HALF, 6, MBM_LINK_LOST)
MEETS(the_end_of_the_stream_is_a_lost_link, FAULT_CLOSE, 0, MBM_LINK_LOST)
MEETS(a_reset_is_a_lost_link, FAULT_RESET, 0, MBM_LINK_LOST)
MEETS_AND_RETRIES(a_response_that_never_comes_times_out, FAULT_DROP, 0, MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_late_response_answers_nothing_else, FAULT_DELAY, 2 * FAULT_TIMEOUT,
                  MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_response_of_another_id_only_times_out, FAULT_OTHER_ID, 9,
                  MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_response_of_another_protocol_times_out, FAULT_WRONG_PROTOCOL, 1,
                  MBM_RESPONSE_TIMED_OUT)
MEETS_AND_RETRIES(a_response_of_another_unit_is_reported, FAULT_WRONG_UNIT, 1, MBM_INVALID_SLAVE_ID)
MEETS_AND_RETRIES(a_response_of_another_function_is_reported, FAULT_WRONG_FUNCTION, 4,
                  MBM_INVALID_FUNCTION)
MEETS_AND_RETRIES(a_length_that_is_too_small_is_malformed, FAULT_SHORT_LENGTH, 2,
                  MBM_MALFORMED_REPLY)

TEST_WITH(responses_in_another_order_are_matched, begin, end)
{
    tcp_peer_fault(peer, 1, FAULT_HOLD, 5);
    tcp_peer_fault(peer, 2, FAULT_HOLD, 2);
    tcp_peer_fault(peer, 5, FAULT_DELAY, 20);
    for (unsigned i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (unsigned i = 0; i < ASKED; i++)
        is_right(i);
    assert_int_equal(a.counters.foreignFrames, 0);
}

TEST_WITH(responses_in_one_segment_are_separated, begin, end)
{
    tcp_peer_fault(peer, 1, FAULT_JOIN, ASKED - 1);
    for (unsigned i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (unsigned i = 0; i < ASKED; i++)
        is_right(i);
}

TEST_WITH(a_reset_ends_all_requests_in_flight, begin, end)
{
    unsigned i, lost = 0;

    tcp_peer_fault(peer, MET, FAULT_RESET, 0);
    for (i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (i = 0; i < ASKED; i++) {
        assert_true(requests[i].status == MBM_OK || requests[i].status == MBM_LINK_LOST);
        lost += requests[i].status == MBM_LINK_LOST;
    }
    assert_true(lost >= ASKED - MET + 1);
    for (i = 0; i < ASKED; i++)
        queue_read(i);
    finish();
    for (i = 0; i < ASKED; i++)
        is_right(i);
}
