/* Every function of a client, called from within each of its hooks. Where no call is
 * allowed, it returns MBM_BUSY and changes nothing. Calls from `done` work. */
#include "unchanged.h"
#include "hooked_port.h"
#include "test.h"

#include <string.h>

static hooked_port wire;
static mbm_port port;
static uint8_t small_frame[MBM_MAX_TCP_FRAME], other_frame[MBM_MAX_TCP_FRAME];
static uint16_t words[8];

static mbm_client client;
static mbm_clientRequest request, another;
static mbm_identification identification;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(&another, 0, sizeof another);
    memset(&identification, 0, sizeof identification);
    memset(words, 0, sizeof words);
    wire.step = 500;
    port = hooked_port_of(&wire);
    entered = 0;
}

fixture each_test = {reset, NULL};

static uint32_t random_number(void *context)
{
    (void)context;
    return 7;
}

static void every_setting_of_the_client_answers(uint8_t status)
{
    static mbm_clientUnit units[1];

    IS(status, mbm_client_setResponseTimeout(&client, 5));
    IS(status, mbm_client_setBaudRate(&client, 19200));
    IS(status, mbm_client_setGap(&client, 1));
    IS(status, mbm_client_setTurnaroundDelay(&client, 1));
    IS(status, mbm_client_setQuietTime(&client, 1));
    IS(status, mbm_client_setEchoDiscard(&client, 0));
    IS(status, mbm_client_setPostFlushHold(&client, 0));
    IS(status, mbm_client_setRetries(&client, 0));
    IS(status, mbm_client_setBusyRetries(&client, 0, 1));
    IS(status, mbm_client_setBackoff(&client, 0, 1, 1));
    IS(status, mbm_client_setJitter(&client, 1, random_number, NULL));
    IS(status, mbm_client_setCounters(&client, NULL));
    IS(status, mbm_client_setUnits(&client, units, 0));
    IS(status, mbm_client_setInFlight(&client, 1));
}

static void every_request_of_the_client_answers(uint8_t status, mbm_clientRequest *r)
{
    const mbm_rule rule = {.kind = MBM_RULE_SILENCE};

#define ASKED(call)                                                                                \
    do {                                                                                           \
        IS(status, call);                                                                          \
        if (status == MBM_PENDING)                                                                 \
            OK(mbm_client_cancel(&client, r));                                                     \
    } while (0)
    ASKED(mbm_client_readCoils(&client, r, 0, 1));
    ASKED(mbm_client_readCoils(&client, r, 0, 1));
    ASKED(mbm_client_readDiscreteInputs(&client, r, 0, 1));
    ASKED(mbm_client_readDiscreteInputs(&client, r, 0, 1));
    ASKED(mbm_client_readHoldingRegisters(&client, r, 0, 1));
    ASKED(mbm_client_readHoldingRegisters(&client, r, 0, 1));
    ASKED(mbm_client_readInputRegisters(&client, r, 0, 1));
    ASKED(mbm_client_readInputRegisters(&client, r, 0, 1));
    ASKED(mbm_client_writeSingleCoil(&client, r, 0, 1));
    ASKED(mbm_client_writeSingleRegister(&client, r, 0, 1));
    ASKED(mbm_client_writeMultipleCoils(&client, r, 0, 1));
    ASKED(mbm_client_writeMultipleRegisters(&client, r, 0, 1));
    ASKED(mbm_client_maskWriteRegister(&client, r, 0, 1, 1));
    ASKED(mbm_client_readWriteMultipleRegisters(&client, r, 0, 1, 0, 1));
    ASKED(mbm_client_readExceptionStatus(&client, r));
    ASKED(mbm_client_diagnostics(&client, r, 0, 1));
    ASKED(mbm_client_getCommEventCounter(&client, r));
    ASKED(mbm_client_getCommEventLog(&client, r));
    ASKED(mbm_client_reportServerId(&client, r));
    ASKED(mbm_client_readFileRecord(&client, r, 1, 0, 1));
    ASKED(mbm_client_writeFileRecord(&client, r, 1, 0, 1));
    ASKED(mbm_client_readFifoQueue(&client, r, 0));
    ASKED(mbm_client_readDeviceIdentification(&client, r, 1, 0));
    ASKED(mbm_client_custom(&client, r, 65, 1, &rule));
}

/* No read begins an identification, or it is cancelled again. */
static void an_identification_answers(uint8_t status)
{
    const mbm_identification before = identification;

    identification.request.unit = 17;
    identification.request.reply = words;
    IS(status, mbm_identification_read(&identification, &client, MBM_DEVICE_ID_BASIC, 0));
    if (status == MBM_PENDING)
        OK(mbm_client_cancel(&client, &identification.request));
    identification = before;
}

static void every_function_of_the_client_is_busy(void)
{
    static mbm_line borrower;
    static const mbm_node zero;
    static const mbm_linkHooks link = {.context = NULL};
    static uint8_t asked[sizeof another];

    IS(MBM_BUSY, mbm_client_beginRtu(&client, &port, other_frame, 260));
    IS(MBM_BUSY, mbm_client_beginAscii(&client, &port, other_frame, 260));
    IS(MBM_BUSY, mbm_client_beginRtuOverTcp(&client, &port, other_frame, 260));
    IS(MBM_BUSY, mbm_client_beginTcp(&client, &port, other_frame, 260, other_frame, 260));
    every_setting_of_the_client_answers(MBM_BUSY);
    another.data = words;
    memcpy(asked, &another, sizeof another);
    every_request_of_the_client_answers(MBM_BUSY, &another);
    assert_memory_equal(asked, &another, sizeof another);
    an_identification_answers(MBM_BUSY);
    memcpy(asked, &request, sizeof request);
    every_request_of_the_client_answers(MBM_BUSY, &request);
    IS(MBM_BUSY, mbm_client_cancel(&client, &request));
    assert_memory_equal(asked, &request, sizeof request);
    IS(MBM_BUSY, mbm_client_setDelimiter(&client, '!'));
    IS(MBM_BUSY, mbm_client_reconnect(&client, &link));
    IS(MBM_BUSY, mbm_client_suspend(&client, NULL));
    IS(MBM_BUSY, mbm_client_suspend(&client, &borrower));
    IS(MBM_BUSY, mbm_client_resume(&client, &borrower));
    assert_memory_equal(&borrower, &zero, sizeof zero);
    IS(MBM_BUSY, mbm_client_poll(&client));
    assert_int_equal(mbm_client_pollDelay(&client), 0);
    assert_int_equal(mbm_client_pending(&client), 0);
    assert_int_equal(mbm_client_isConnected(&client), 0);
}

static void within_client(int hook)
{
    (void)hook;
    UNCHANGED_BY(client, every_function_of_the_client_is_busy());
}

static unsigned drawn;

static uint32_t reentrant_random(void *context)
{
    (void)context;
    drawn++;
    UNCHANGED_BY(client, every_function_of_the_client_is_busy());
    return 7;
}

/* Begins the client in framing 0 to 3. */
static void begin_client(int framing)
{
    memset(&client, 0, sizeof client);
    switch (framing) {
    case 0: OK(mbm_client_beginRtu(&client, &port, small_frame, 256)); break;
    case 1: OK(mbm_client_beginAscii(&client, &port, small_frame, 256)); break;
    case 2: OK(mbm_client_beginTcp(&client, &port, small_frame, 260, other_frame, 260)); break;
    default: OK(mbm_client_beginRtuOverTcp(&client, &port, small_frame, 256));
    }
    OK(mbm_client_setResponseTimeout(&client, 20));
    OK(mbm_client_setQuietTime(&client, 1));
}

static void poll_until_all_have_ended(void)
{
    for (unsigned i = 0; i < 3000 && mbm_client_poll(&client) == MBM_PENDING; i++) {
    }
    assert_int_equal(mbm_client_pending(&client), 0);
}

TEST(no_hook_of_a_clients_port_nor_its_random_function_may_call_the_client)
{
    for (int framing = 0; framing < 4; framing++) {
        wire.within = framing == 2 ? NULL : within_client; /* the begin of TCP calls no hook */
        begin_client(framing);
        wire.within = within_client;
        OK(mbm_client_setRetries(&client, 2));
        OK(mbm_client_setBackoff(&client, MBM_BACKOFF_FIXED, 1, 1));
        OK(mbm_client_setJitter(&client, 100, reentrant_random, NULL));
        memset(&request, 0, sizeof request);
        request.unit = 17;
        entered = drawn = 0;
        IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
        assert_true(mbm_client_pollDelay(&client) < 0xFFFFFFFFu);
        poll_until_all_have_ended();
        IS(MBM_RESPONSE_TIMED_OUT, request.status);
        assert_int_equal(drawn, 2);
        assert_true(entered > drawn);
        /* While the driver is on, cancelling and connecting anew call hooks. */
        IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
        IS(MBM_PENDING, mbm_client_poll(&client));
        OK(mbm_client_reconnect(&client, NULL));
        poll_until_all_have_ended();
        IS(MBM_LINK_LOST, request.status);
        IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
        IS(MBM_PENDING, mbm_client_poll(&client));
        OK(mbm_client_cancel(&client, &request));
    }
    for (int framing = 0; framing < HOOK_IDLE; framing++)
        assert_true(wire.called[framing] > 0);
}

static int done_does, framing_of_done;

static void connect_anew(void *context)
{
    (void)context;
    entered++;
    /* Only the poll that called `done` is running. */
    IS(MBM_BUSY, mbm_client_poll(&client));
    assert_int_equal(mbm_client_isConnected(&client), 1);
}

static void done(void *context, mbm_clientRequest *ended)
{
    const mbm_linkHooks link = {.disconnect = connect_anew};
    static mbm_line borrower;

    (void)context;
    entered++;
    IS(MBM_BUSY, mbm_client_poll(&client));
    switch (done_does) {
    case 0:
        every_setting_of_the_client_answers(MBM_OK);
        another.unit = ended->unit = 17;
        another.data = ended->data = words;
        every_request_of_the_client_answers(MBM_PENDING, &another);
        every_request_of_the_client_answers(MBM_PENDING, ended);
        an_identification_answers(MBM_PENDING);
        assert_true(mbm_client_pollDelay(&client) == 0xFFFFFFFFu);
        assert_int_equal(mbm_client_pending(&client), 0);
        IS(framing_of_done == 1 ? MBM_OK : MBM_INVALID_ARGUMENT,
           mbm_client_setDelimiter(&client, '!'));
        break;
    case 1: OK(mbm_client_reconnect(&client, &link)); break;
    case 2:
        OK(mbm_client_suspend(&client, NULL));
        IS(MBM_BUSY, mbm_client_suspend(&client, NULL));
        OK(mbm_client_resume(&client, NULL));
        memset(&borrower, 0, sizeof borrower);
        if (framing_of_done % 3 == 0) {
            OK(mbm_client_suspend(&client, &borrower));
            OK(mbm_client_resume(&client, &borrower));
        }
        break;
    case 3:
        /* The object is zeroed. Its other requests are given up. */
        memset(&client, 0, sizeof client);
        break;
    default:
        /* The object is begun again with another framing. */
        begin_client((framing_of_done + 1) % 4);
        OK(mbm_client_poll(&client));
    }
}

TEST(a_done_function_may_call_its_client)
{
    for (framing_of_done = 0; framing_of_done < 4; framing_of_done++) {
        for (done_does = 0; done_does < 5; done_does++) {
            static mbm_clientRequest waits;

            begin_client(framing_of_done);
            memset(&request, 0, sizeof request);
            memset(&another, 0, sizeof another);
            memset(&waits, 0, sizeof waits);
            request.unit = waits.unit = 17;
            request.done = done;
            entered = 0;
            wire.lost = 1;
            IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
            if (done_does >= 3)
                IS(MBM_PENDING, mbm_client_readCoils(&client, &waits, 0, 1));
            poll_until_all_have_ended();
            assert_true(entered > 0);
            wire.lost = 0;
            if (done_does == 3)
                IS(MBM_NOT_INITIALISED, mbm_client_poll(&client));
            else
                OK(mbm_client_poll(&client));
        }
    }
}

TEST(the_clock_may_not_call_the_client_that_gives_its_port_to_a_line)
{
    static mbm_line line;

    memset(&line, 0, sizeof line);
    begin_client(0);
    request.unit = 17;
    IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
    wire.within = within_client;
    OK(mbm_client_suspend(&client, &line));
    wire.within = NULL;
    assert_int_equal(entered, 1);
    OK(mbm_client_resume(&client, &line));
}
