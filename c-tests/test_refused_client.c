/* A call of a client that is refused changes nothing, and pending requests go on. Buffers
 * have exactly the size that begin is given. */
#include "refused.h"
#include "refused_wire.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

fixture each_test = {reset, NULL};

static mbm_client client;
static mbm_line line;
static mbm_node node;
static uint16_t node_words[2];
static uint8_t line_frame[16];
static uint8_t *incoming, *outgoing;

/* Begins in framing 0 to 3, with buffers of exactly this size. */
static uint8_t begin_client(int framing, uint16_t in, uint16_t out)
{
    free(incoming);
    free(outgoing);
    incoming = (uint8_t *)malloc(in);
    outgoing = (uint8_t *)malloc(out);
    switch (framing) {
    case 0: return mbm_client_beginRtu(&client, &port, incoming, in);
    case 1: return mbm_client_beginAscii(&client, &port, incoming, in);
    case 2: return mbm_client_beginTcp(&client, &port, incoming, in, outgoing, out);
    default: return mbm_client_beginRtuOverTcp(&client, &port, incoming, in);
    }
}

static void all_client_begins_are(uint8_t status, const mbm_port *p, uint8_t *frame, uint16_t bytes)
{
    REFUSED(status, client, mbm_client_beginRtu(&client, p, frame, bytes));
    REFUSED(status, client, mbm_client_beginAscii(&client, p, frame, bytes));
    REFUSED(status, client, mbm_client_beginRtuOverTcp(&client, p, frame, bytes));
    REFUSED(status, client, mbm_client_beginTcp(&client, p, frame, bytes, frame, 12));
}

TEST(a_zeroed_client_stays_zero_when_a_begin_is_refused)
{
    static uint8_t small[16];
    mbm_port mute = port;

    memset(&client, 0, sizeof client);
    mute.micros = NULL;
    all_client_begins_are(MBM_INVALID_ARGUMENT, &mute, small, 16);
    all_client_begins_are(MBM_INVALID_ARGUMENT, NULL, small, 16);
    all_client_begins_are(MBM_INVALID_ARGUMENT, &port, NULL, 16);
    all_client_begins_are(MBM_INVALID_ARGUMENT, &port, small, 7);
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_beginTcp(&client, &port, small, 8, small, 12));
    REFUSED(MBM_INVALID_ARGUMENT, client,
            mbm_client_beginTcp(&client, &port, small, 16, small, 11));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_beginTcp(&client, &port, small, 16, NULL, 12));
    assert_int_equal(mbm_client_pending(&client), 0);
    REFUSED(MBM_NOT_INITIALISED, client, mbm_client_setRetries(&client, 1));
}

static void all_settings_out_of_range_are_refused(int framing)
{
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setBackoff(&client, 4, 1, 1));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setJitter(&client, 101, NULL, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setJitter(&client, 1, NULL, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setInFlight(&client, 0));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setInFlight(&client, 17));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setDelimiter(&client, ':'));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setDelimiter(&client, 0));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_resume(&client, NULL));
    if (framing != 1)
        REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_setDelimiter(&client, '!'));
}

TEST(a_client_goes_on_after_refused_calls)
{
    static uint8_t small[20];
    static const mbm_line zero;
    static uint16_t reply[125];
    mbm_clientRequest request, other;

    for (int framing = 0; framing < 4; framing++) {
        memset(&client, 0, sizeof client);
        memset(&request, 0, sizeof request);
        memset(&other, 0, sizeof other);
        memset(&line, 0, sizeof line);
        memset(&node, 0, sizeof node);
        OK(begin_client(framing, 600, 600));
        all_settings_out_of_range_are_refused(framing);
        request.unit = 17;
        request.reply = reply;
        request.replyBytes = sizeof reply;
        request.transaction = 7;
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 125));
        wire.length = 0;
        for (uint32_t delay = 0; delay < 1000 && wire.length == 0; delay++)
            IS(MBM_PENDING, mbm_client_poll(&client));
        assert_true(wire.length > 0);

        all_client_begins_are(MBM_INVALID_ARGUMENT, &port, small, 7);
        all_client_begins_are(MBM_INVALID_ARGUMENT, NULL, small, sizeof small);
        all_settings_out_of_range_are_refused(framing);
        if (framing == 1)
            REFUSED(MBM_BUSY, client, mbm_client_setDelimiter(&client, '!'));
        REFUSED(MBM_NOT_PENDING, client, mbm_client_cancel(&client, &other));
        REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_cancel(&client, NULL));
        REFUSED(MBM_BUSY, client, mbm_client_readCoils(&client, &request, 0, 1));
        REFUSED(MBM_BUSY, request, mbm_client_readCoils(&client, &request, 0, 1));
        REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_readCoils(&client, NULL, 0, 1));
        REFUSED(MBM_BUSY, client, mbm_client_suspend(&client, NULL));
        REFUSED(framing == 0 || framing == 3 ? MBM_BUSY : MBM_INVALID_ARGUMENT, client,
                mbm_client_suspend(&client, &line));
        assert_memory_equal(&line, &zero, sizeof line);
        /* A refused request has the status of the refusal and is not queued. */
        other.unit = 17;
        other.transaction = 7;
        other.reply = reply;
        other.replyBytes = 1;
        REFUSED(MBM_ILLEGAL_DATA_VALUE, client, mbm_client_readCoils(&client, &other, 0, 0));
        REFUSED(MBM_BUFFER_TOO_SMALL, client, mbm_client_readCoils(&client, &other, 0, 9));
        REFUSED(MBM_INVALID_ARGUMENT, client,
                mbm_client_writeMultipleRegisters(&client, &other, 0, 1));
        IS(MBM_INVALID_ARGUMENT, other.status);
        if (framing == 2)
            REFUSED(MBM_DUPLICATE_TRANSACTION, client, mbm_client_readCoils(&client, &other, 0, 1));
        other.unit = 0;
        /* In TCP frames unit 0 is a unit. */
        if (framing != 2) {
            REFUSED(MBM_BROADCAST_NOT_ALLOWED, client, mbm_client_readCoils(&client, &other, 0, 1));
            IS(MBM_BROADCAST_NOT_ALLOWED, other.status);
        }
        assert_int_equal(mbm_client_pending(&client), 1);

        if (framing == 0 || framing == 3) {
            uint8_t answer[252] = {3, 250};

            hooked_port_arrive_rtu(&wire, 17, answer, sizeof answer);
            for (uint32_t delay = 0; delay < 1000 && mbm_client_poll(&client) == MBM_PENDING;
                 delay++) {
            }
            OK(request.status);
        } else {
            OK(mbm_client_cancel(&client, &request));
        }
    }
    free(incoming);
    free(outgoing);
    incoming = outgoing = NULL;
}

TEST(a_full_queue_and_a_suspended_client_change_nothing)
{
    static mbm_clientRequest requests[MBM_CLIENT_DEPTH + 1];
    static const mbm_line zero;
    unsigned i;

    memset(&client, 0, sizeof client);
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    memset(requests, 0, sizeof requests);
    OK(begin_client(0, 256, 1));
    for (i = 0; i < MBM_CLIENT_DEPTH; i++) {
        requests[i].unit = 17;
        IS(MBM_PENDING, mbm_client_readCoils(&client, &requests[i], 0, 1));
    }
    requests[i].unit = 17;
    REFUSED(MBM_QUEUE_FULL, client, mbm_client_readCoils(&client, &requests[i], 0, 1));
    OK(mbm_client_suspend(&client, NULL));
    REFUSED(MBM_BUSY, client, mbm_client_suspend(&client, &line));
    assert_memory_equal(&line, &zero, sizeof line);
    REFUSED(MBM_BUSY, client, mbm_client_poll(&client));
    REFUSED(MBM_BUSY, client, mbm_client_reconnect(&client, NULL));
    OK(mbm_client_resume(&client, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, client, mbm_client_resume(&client, NULL));
    /* While a master has a pending request, it can be neither given the line nor lose it. */
    OK(mbm_line_setFrame(&line, line_frame, 16));
    OK(mbm_node_begin(&node, &line, 1, node_words, 2, node_words, 0));
    OK(mbm_client_suspend(&client, &line));
    OK(mbm_node_setBlocking(&node, 0));
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    REFUSED(MBM_BUSY, client, mbm_client_resume(&client, &line));
    REFUSED(MBM_BUSY, line, mbm_client_resume(&client, &line));
    OK(mbm_node_cancel(&node));
    OK(mbm_client_resume(&client, &line));
    free(incoming);
    free(outgoing);
    incoming = outgoing = NULL;
}

/* A request is in the queue only once, even if the program zeroes it while it is pending. */
TEST(a_request_that_is_zeroed_while_it_is_pending_is_not_queued_twice)
{
    mbm_clientRequest *request = (mbm_clientRequest *)malloc(sizeof *request);

    for (int framing = 0; framing < 4; framing++) {
        memset(&client, 0, sizeof client);
        OK(begin_client(framing, 600, 600));
        OK(mbm_client_setResponseTimeout(&client, 10));
        memset(request, 0, sizeof *request);
        request->unit = 17;
        IS(MBM_PENDING, mbm_client_readCoils(&client, request, 0, 1));
        memset(request, 0, sizeof *request);
        request->unit = 17;
        IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1)); /* it waits */
        wire.length = 0;
        for (unsigned i = 0; i < 1000 && mbm_client_pending(&client) > 0; i++) {
            mbm_client_poll(&client);
            if (mbm_client_pending(&client) > 0)
                IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1)); /* in flight */
        }
        assert_int_equal(mbm_client_pending(&client), 0);
        /* The same with a request that has ended before. */
        IS(MBM_PENDING, mbm_client_readCoils(&client, request, 0, 1));
        request->status = MBM_OK;
        IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1));
        memset(request, 0, sizeof *request);
        IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1));
        OK(mbm_client_cancel(&client, request));
    }
    free(request);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_client_poll(&client));
    free(incoming);
    free(outgoing);
    incoming = outgoing = NULL;
}
