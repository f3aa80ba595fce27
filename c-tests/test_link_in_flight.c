/* A link that begins, or is closed, while requests of its client are in flight: they end, and
 * nothing of them is sent or received over the link that is opened then. */
#include "linked.h"

enum { NOTHING = 0, ALL = 0xFFFF };

/* How many bytes the port accepts at a time, and whether the driver is on. */
static uint16_t accepts;
static int driver;

static int16_t accept_some(void *context, const uint8_t *bytes, uint16_t length)
{
    const mbm_port port = memory_port_of(&m);

    return port.write(context, bytes, length < accepts ? length : accepts);
}

static void driver_on(void *context)
{
    (void)context;
    driver++;
}

static void driver_off(void *context)
{
    (void)context;
    driver--;
}

/* A client without a link. Then `request` is queued and polled until it is in flight, or, if the
 * port accepts nothing, until it waits for the port. */
static void begin_in_flight(int framing, uint16_t accepted)
{
    mbm_port port = memory_port_of(&m);

    begin(framing);
    OK(mbm_link_end(&kept));
    port.write = accept_some;
    port.preTransmission = driver_on;
    port.postTransmission = driver_off;
    memset(&client, 0, sizeof client);
    driver = 0;
    switch (framing) {
    case MBM_FRAMING_RTU: OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_ASCII: OK(mbm_client_beginAscii(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_RTU_OVER_TCP:
        OK(mbm_client_beginRtuOverTcp(&client, &port, frame, sizeof frame));
        break;
    default:
        OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
        OK(mbm_client_setInFlight(&client, 1));
        break;
    }
    OK(mbm_client_setResponseTimeout(&client, 300));
    OK(mbm_client_setQuietTime(&client, 0));
    accepts = accepted;
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 7, 0xBEEF));
    for (m.now += 10 * MS; m.sent_count == 0; m.now += MS) {
        IS(MBM_PENDING, mbm_client_poll(&client));
        if (accepted == NOTHING && m.now > 15 * MS)
            break;
    }
}

static void begin_link(void)
{
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 100, 100));
    OK(mbm_link_setConnectTimeout(&kept, 100));
    OK(mbm_link_setCallback(&kept, changed, &kept));
}

/* The link is open: a request is sent, is the first that is sent, and is answered. */
static void works_over_the_new_link(int framing)
{
    static const uint8_t read_rtu[] = {UNIT, 3}, read_ascii[] = ":0703", read_tcp[] = {UNIT, 3};

    accepts = ALL;
    m.is_lost = 0;
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    assert_int_equal(m.sent_count, 0);
    queue_read(&other);
    memory_port_send(&m, &client);
    switch (framing) {
    case MBM_FRAMING_ASCII: assert_memory_equal(m.sent, read_ascii, 5); break;
    case MBM_FRAMING_TCP: assert_memory_equal(m.sent + 6, read_tcp, 2); break;
    default: assert_memory_equal(m.sent, read_rtu, 2); break;
    }
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
    assert_int_equal(words[0], 0x1234);
    assert_int_equal(mbm_client_pending(&client), 0);
    assert_int_equal(driver, 0);
}

/* What `status` and `connect` return in the first polls. */
static const struct {
    uint8_t status_is, connects_with;
} courses[] = {
    {MBM_LINK_LOST, MBM_OK},
    {MBM_LINK_LOST, MBM_PENDING},
    {MBM_LINK_LOST, MBM_LINK_LOST},
    {MBM_PENDING, MBM_OK}, /* status fails later, and connect succeeds */
};

static void requests_in_flight_end_when_the_link_was_closed(uint16_t accepted)
{
    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned j = 0; j < COUNT(courses); j++)
            for (unsigned waits = 0; waits < 2; waits++) {
                begin_in_flight(framings[i], accepted);
                m.is_lost = 1;
                status_is = courses[j].status_is;
                connects_with = courses[j].connects_with;
                begin_link();
                OK(mbm_link_setRequestsWait(&kept, (uint8_t)waits));
                m.sent_count = 0;
                (void)mbm_client_poll(&client);
                status_is = MBM_LINK_LOST;
                run(50);
                IS(MBM_LINK_LOST, request.status);
                assert_int_equal(driver, 0);
                connects_with = MBM_OK;
                run(2000);
                works_over_the_new_link(framings[i]);
            }
}

TEST(requests_that_were_sent_end_when_a_link_begins_that_is_closed)
{
    requests_in_flight_end_when_the_link_was_closed(ALL);
}

TEST(a_request_that_the_port_took_in_part_is_not_sent_on_over_the_new_link)
{
    requests_in_flight_end_when_the_link_was_closed(5);
}

TEST(a_request_that_ended_with_the_old_link_is_never_sent)
{
    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned j = 0; j < COUNT(courses); j++) {
            begin_in_flight(framings[i], NOTHING);
            assert_int_equal(m.sent_count, 0);
            status_is = courses[j].status_is;
            connects_with = courses[j].connects_with;
            begin_link();
            (void)mbm_client_poll(&client);
            status_is = MBM_LINK_LOST;
            run(50);
            IS(MBM_LINK_LOST, request.status);
            connects_with = MBM_OK;
            run(2000);
            works_over_the_new_link(framings[i]);
        }
}

TEST(half_a_reply_of_the_old_peer_is_dropped)
{
    static const uint8_t half_rtu[] = {UNIT, 3, 2}, half_tcp[] = {0, 0, 0, 0, 0, 5, UNIT, 6};

    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_in_flight(framings[i], ALL);
        if (framings[i] == MBM_FRAMING_TCP)
            memory_port_bytes(&m, half_tcp, sizeof half_tcp);
        else if (framings[i] == MBM_FRAMING_ASCII)
            memory_port_bytes(&m, (const uint8_t *)":0703", 5);
        else
            memory_port_bytes(&m, half_rtu, sizeof half_rtu);
        m.now += MS;
        IS(MBM_PENDING, mbm_client_poll(&client));
        begin_link();
        m.sent_count = 0;
        run(20);
        IS(MBM_LINK_LOST, request.status);
        works_over_the_new_link(framings[i]);
    }
}

TEST(a_request_in_flight_goes_on_if_the_link_is_found_open)
{
    static const uint8_t reply[] = {UNIT, 6, 0, 7, 0xBE, 0xEF};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 6, UNIT, 6, 0, 7, 0xBE, 0xEF};

    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned waits = 0; waits < 2; waits++) {
            begin_in_flight(framings[i], ALL);
            status_is = waits ? MBM_PENDING : MBM_OK;
            begin_link();
            IS(MBM_PENDING, mbm_client_poll(&client));
            status_is = MBM_OK;
            IS(MBM_PENDING, mbm_client_poll(&client));
            assert_int_equal(connects + disconnects, 0);
            assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
            if (framings[i] == MBM_FRAMING_TCP)
                memory_port_bytes(&m, tcp, sizeof tcp);
            else if (framings[i] == MBM_FRAMING_ASCII)
                memory_port_bytes(&m, (const uint8_t *)":07060007BEEF3F\r\n", 17);
            else
                memory_port_rtu(&m, reply, sizeof reply);
            IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
            m.sent_count = 0;
            works_over_the_new_link(framings[i]);
        }
}

TEST(a_link_that_the_program_closes_while_it_is_being_made_sends_nothing_old)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        mbm_clientRequest second = {.unit = UNIT};

        begin_in_flight(framings[i], NOTHING);
        status_is = MBM_PENDING;
        begin_link();
        IS(MBM_PENDING, mbm_client_poll(&client));
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
        /* A queued request that the reconnection must leave as it is. */
        IS(MBM_PENDING, mbm_client_readCoils(&client, &second, 0, 1));
        OK(mbm_link_reconnect(&kept));
        connects_with = MBM_PENDING;
        IS(MBM_PENDING, mbm_client_poll(&client));
        IS(MBM_LINK_LOST, request.status);
        IS(MBM_PENDING, second.status);
        assert_int_equal(disconnects, 1);
        OK(mbm_client_cancel(&client, &second));
        status_is = MBM_OK;
        IS(MBM_OK, mbm_client_poll(&client));
        works_over_the_new_link(framings[i]);
    }
}

/* The link is lost, and what its callback does next. */
static void end_it(void *context, uint8_t event, uint8_t status)
{
    (void)context;
    (void)status;
    if (event != MBM_LINK_EVENT_CONNECTED)
        OK(mbm_link_end(&kept));
}

TEST(a_client_whose_link_ends_in_its_callback_sends_nothing_old)
{
    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned j = 1; j < COUNT(courses); j++) {
            begin_in_flight(framings[i], NOTHING);
            status_is = courses[j].status_is;
            connects_with = courses[j].connects_with;
            begin_link();
            OK(mbm_link_setCallback(&kept, end_it, NULL));
            (void)mbm_client_poll(&client);
            status_is = MBM_LINK_LOST;
            run(100);
            assert_int_equal(mbm_link_state(&kept), 0);
            accepts = ALL;
            m.is_lost = 0;
            run(100);
            IS(MBM_LINK_LOST, request.status);
            assert_int_equal(m.sent_count, 0);
            queue_read(&other);
            memory_port_send(&m, &client);
            answer(framings[i]);
            IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
        }
}

/* A reply that guesses the transaction identifier ends a request before it was sent. */
TEST(a_request_that_was_answered_before_it_was_sent_is_not_sent)
{
    static const uint8_t reply[] = {0, 0, 0, 0, 0, 6, UNIT, 6, 0, 7, 0xBE, 0xEF};

    begin_in_flight(MBM_FRAMING_TCP, NOTHING);
    memory_port_bytes(&m, reply, sizeof reply);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    status_is = MBM_OK;
    begin_link();
    run(10);
    works_over_the_new_link(MBM_FRAMING_TCP);
}
