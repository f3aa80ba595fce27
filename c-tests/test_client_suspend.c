/* A client that gives its line away takes it back from the one to whom it was given, and from no
 * other. After that the master has no line: nothing of the client is used any more. */
#include "refused.h"
#include "memory_port.h"
#include "test.h"

static memory_port m, other_m;
static mbm_client *client; /* on the heap, so that the sanitizer finds each use after its end */
static mbm_line line, other_line;
static mbm_node node, other;
static mbm_link *kept;
static uint8_t frame[256], line_frame[256], other_frame[256];
static uint16_t words[4], other_words[4];

static uint8_t opened(void *context)
{
    return MBM_OK;
}

static const mbm_linkHooks hooks = {.connect = opened, .status = opened};

static void begin(int framing, int has_link)
{
    const mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&other_m, 0, sizeof other_m);
    memset(&line, 0, sizeof line);
    memset(&other_line, 0, sizeof other_line);
    memset(&node, 0, sizeof node);
    memset(&other, 0, sizeof other);
    client = (mbm_client *)calloc(1, sizeof *client);
    kept = (mbm_link *)calloc(1, sizeof *kept);
    if (framing == MBM_FRAMING_RTU)
        OK(mbm_client_beginRtu(client, &port, frame, sizeof frame));
    else
        OK(mbm_client_beginRtuOverTcp(client, &port, frame, sizeof frame));
    if (has_link) {
        OK(mbm_link_begin(kept, client, &hooks));
        OK(mbm_client_poll(client));
    }
    OK(mbm_line_setFrame(&line, line_frame, sizeof line_frame));
    OK(mbm_node_begin(&node, &line, 17, words, 4, words, 4));
    OK(mbm_line_setFrame(&other_line, other_frame, sizeof other_frame));
    OK(mbm_node_begin(&other, &other_line, 1, other_words, 4, NULL, 0));
    OK(mbm_node_setBlocking(&node, 0));
    OK(mbm_node_setBlocking(&other, 0));
}

static void end(void)
{
    free(client);
    free(kept);
}

static void each_variant(void (*test)(void))
{
    static const int framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_RTU_OVER_TCP};

    for (unsigned i = 0; i < 4; i++) {
        begin(framings[i / 2], i % 2);
        test();
        end();
    }
}

#define VARIANTS_TEST(name)                                                                        \
    static void each_##name(void);                                                                 \
    TEST(name)                                                                                     \
    {                                                                                              \
        each_variant(each_##name);                                                                 \
    }                                                                                              \
    static void each_##name(void)

VARIANTS_TEST(a_client_resumes_only_from_the_one_who_has_its_line)
{
    static mbm_line fresh;

    OK(mbm_client_suspend(client, &line));
    INVALID(*client, mbm_client_resume(client, NULL));
    INVALID(*client, mbm_client_resume(client, &other_line));
    INVALID(other_line, mbm_client_resume(client, &other_line));
    INVALID(*client, mbm_client_resume(client, &fresh));
    /* The master still has the line. */
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    INVALID(*client, mbm_client_resume(client, NULL));
    REFUSED(MBM_BUSY, *client, mbm_client_resume(client, &line));
    OK(mbm_node_cancel(&node));
    IS(MBM_BUSY, mbm_client_poll(client));
    OK(mbm_client_resume(client, &line));
    OK(mbm_client_poll(client));
    INVALID(*client, mbm_client_resume(client, &line));

    OK(mbm_client_suspend(client, NULL));
    INVALID(*client, mbm_client_resume(client, &line));
    OK(mbm_client_resume(client, NULL));
    /* The next one to whom the line is given counts, not the one before. */
    OK(mbm_client_suspend(client, &other_line));
    INVALID(*client, mbm_client_resume(client, &line));
    OK(mbm_client_resume(client, &other_line));
}

VARIANTS_TEST(a_master_uses_nothing_of_a_client_that_has_resumed)
{
    OK(mbm_client_suspend(client, &line));
    (void)mbm_client_resume(client, NULL);
    OK(mbm_client_resume(client, &line));
    end();
    client = NULL;
    kept = NULL;
    IS(MBM_NOT_INITIALISED, mbm_node_readCoils(&node, 0, 1));
    assert_int_equal(mbm_node_pollDelay(&node), UINT32_MAX);
    OK(mbm_line_used(&line));
    OK(mbm_node_cancel(&node));
}

/* After the end of the client whose line the master had. */
static void the_master_keeps_the_other_port(void)
{
    end();
    client = NULL;
    kept = NULL;
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    while (other_m.sent_count == 0 && mbm_node_poll(&node) == MBM_PENDING)
        other_m.now += 100;
    assert_int_equal(other_m.sent_count, 8);
}

VARIANTS_TEST(a_master_that_began_on_a_port_of_its_own_keeps_that_port)
{
    const mbm_port port = memory_port_of(&other_m);

    OK(mbm_client_suspend(client, &line));
    OK(mbm_line_beginRtu(&line, &port, line_frame, sizeof line_frame));
    OK(mbm_client_resume(client, &line));
    the_master_keeps_the_other_port();
}

VARIANTS_TEST(a_master_with_the_lines_of_two_clients_keeps_the_second)
{
    const mbm_port port = memory_port_of(&other_m);
    static mbm_client second;
    static uint8_t second_frame[256];

    memset(&second, 0, sizeof second);
    OK(mbm_client_beginRtu(&second, &port, second_frame, sizeof second_frame));
    OK(mbm_client_suspend(client, &line));
    OK(mbm_client_suspend(&second, &line));
    OK(mbm_client_resume(client, &line));
    the_master_keeps_the_other_port();
    OK(mbm_node_cancel(&node));
    OK(mbm_client_resume(&second, &line));
    IS(MBM_NOT_INITIALISED, mbm_node_readCoils(&node, 0, 1));
}

VARIANTS_TEST(a_client_resumes_from_a_master_that_was_zeroed)
{
    OK(mbm_client_suspend(client, &line));
    memset(&line, 0, sizeof line);
    IS(MBM_INVALID_ARGUMENT, mbm_client_resume(client, NULL));
    OK(mbm_client_resume(client, &line));
    OK(mbm_client_poll(client));
    IS(MBM_NOT_INITIALISED, mbm_line_cancel(&line));
}

/* --- from within `done` --- */

static mbm_clientRequest requests[2];
static unsigned ended;

static void lend(void *context, mbm_clientRequest *request)
{
    ended++;
    OK(mbm_client_suspend(client, &line));
}

VARIANTS_TEST(a_client_that_is_suspended_when_a_request_is_done_sends_nothing)
{
    static const uint8_t reply[] = {17, 6, 0, 1, 0, 2};

    memset(requests, 0, sizeof requests);
    ended = 0;
    requests[0].done = lend;
    for (unsigned i = 0; i < 2; i++) {
        requests[i].unit = 17;
        IS(MBM_PENDING, mbm_client_writeSingleRegister(client, &requests[i], 1, 2));
    }
    memory_port_send(&m, client);
    assert_int_equal(m.sent_count, 8);
    memory_port_rtu(&m, reply, sizeof reply);
    for (unsigned i = 0; i < 100 && ended == 0; i++, m.now += 10000)
        IS(MBM_PENDING, mbm_client_poll(client));
    assert_int_equal(ended, 1);
    /* The line is the master's: the next request waits. */
    assert_int_equal(m.sent_count, 8);
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    OK(mbm_node_cancel(&node));
    OK(mbm_client_resume(client, &line));
    IS(MBM_PENDING, requests[1].status);
    for (unsigned i = 0; i < 100 && m.sent_count == 8; i++, m.now += 10000)
        IS(MBM_PENDING, mbm_client_poll(client));
    assert_int_equal(m.sent_count, 16);
}
