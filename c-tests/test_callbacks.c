/* ModbusMaster's callbacks in C: mbm_node_idle, mbm_node_preTransmission and
 * mbm_node_postTransmission, on a simulated wire. Unit 17 is 11 on the wire. */
#include "sim.h"
#include "test.h"

static sim *wire;
static mbm_nodeCallbacks callbacks;
static char called[32];
static uint16_t during;

static void note(char what)
{
    const size_t count = strlen(called);

    if ((count == 0 || called[count - 1] != what) && count + 1 < sizeof called)
        called[count] = what;
}

static void before(void)
{
    note('b');
    /* The driver of the port is on, and nothing was sent yet. */
    assert_int_equal(wire->driver_on, 1);
}

static void after(void)
{
    note('a');
    assert_int_not_equal(wire->driver_on, 0);
}

static void waiting(void)
{
    note('i');
    wire->now += wire->idle_step;
}

/* Begins callbacks on a port, and the line of the test on the callbacks. */
static void begin_line(sim *s, const mbm_port *port)
{
    OK(mbm_nodeCallbacks_begin(&callbacks, port));
    OK(mbm_line_beginRtu(&s->line, mbm_nodeCallbacks_port(&callbacks), s->buffer,
                         sizeof s->buffer));
}

static void begin(sim *s)
{
    wire = s;
    memset(called, 0, sizeof called);
    memset(&callbacks, 0, sizeof callbacks);
    begin_line(s, &s->port);
}

static void use_all(mbm_node *n)
{
    OK(mbm_node_idle(n, waiting));
    OK(mbm_node_preTransmission(n, before));
    OK(mbm_node_postTransmission(n, after));
}

SIM_TEST(callbacks_come_in_the_order_of_modbusmaster)
{
    begin(s);
    use_all(n);
    sim_reads(s, 5000);
    assert_string_equal(called, "bai");
    /* The port's own hooks are called around the callbacks: the driver is on all the time. */
    sim_assert_order(s, "PWO", "PWO");
    assert_int_equal(s->driver_on, 0);
    assert_int_equal(s->idle_while_driving, 0);
}

SIM_TEST(idle_is_called_only_while_a_reply_is_awaited)
{
    begin(s);
    OK(mbm_node_idle(n, waiting));
    OK(mbm_line_setGap(&s->line, 50000));
    sim_reads(s, 5000);
    memset(called, 0, sizeof called);
    const unsigned idles = s->idles;
    OK(mbm_node_preTransmission(n, before));
    sim_reads(s, 5000);
    /* The port's own hook has waited in the gap, and the callback for the reply. */
    assert_string_equal(called, "bi");
    assert_true(s->idles > idles);
}

SIM_TEST(a_broadcast_is_idle_in_its_turnaround_delay)
{
    begin(s);
    OK(mbm_node_idle(n, waiting));
    OK(mbm_node_setSlaveID(n, 0));
    OK(mbm_node_writeSingleRegister(n, 1, 2));
    assert_string_equal(called, "i");
}

SIM_TEST(callbacks_survive_a_begin_of_the_node_the_line_and_themselves)
{
    begin(s);
    use_all(n);
    sim_answer(s, 1, 5000, "12 03 02 00 07 +");
    begin_line(s, &s->port);
    OK(mbm_node_begin(n, &s->line, 18, s->response, 125, s->transmit, 123));
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_string_equal(called, "bai");
}

SIM_TEST(null_takes_a_callback_away)
{
    begin(s);
    use_all(n);
    OK(mbm_node_idle(n, NULL));
    OK(mbm_node_preTransmission(n, NULL));
    OK(mbm_node_postTransmission(n, NULL));
    sim_reads(s, 5000);
    assert_string_equal(called, "");
    assert_true(s->idles > 0);
    assert_int_equal(s->driver_on, 0);
}

SIM_TEST(all_nodes_of_a_line_share_its_callbacks)
{
    mbm_node other = MBM_INIT;

    begin(s);
    OK(mbm_node_begin(&other, &s->line, 18, s->response, 125, s->transmit, 123));
    use_all(n);
    sim_answer(s, 1, 5000, "12 03 02 00 07 +");
    OK(mbm_node_readHoldingRegisters(&other, 0, 1));
    assert_string_equal(called, "bai");
}

/* A port with nothing but what it must have. */
SIM_TEST(a_port_without_hooks_has_callbacks_too)
{
    s->port.flush = NULL;
    s->port.preTransmission = NULL;
    s->port.postTransmission = NULL;
    s->port.idle = NULL;
    begin(s);
    assert_null(mbm_nodeCallbacks_port(&callbacks)->flush);
    OK(mbm_node_idle(n, waiting));
    sim_reads(s, 5000);
    assert_string_equal(called, "i");
}

/* In an idle callback. */
static void makes_calls(void)
{
    mbm_node *n = &wire->node;

    IS(MBM_BUSY, mbm_node_readHoldingRegisters(n, 0, 1));
    IS(MBM_PENDING, mbm_node_status(n));
    during = mbm_node_getResponseBuffer(n, 0);
    OK(mbm_node_idle(n, waiting));
}

/* In a callback around the frame. */
static void is_busy(void)
{
    mbm_node *n = &wire->node;

    note('b');
    IS(MBM_BUSY, mbm_node_idle(n, NULL));
    IS(MBM_BUSY, mbm_node_poll(n));
    assert_int_equal(mbm_node_requestFrom(n, 0, 1), 0);
    OK(mbm_node_setTransmitBuffer(n, 0, 0x1234));
}

SIM_TEST(callbacks_may_use_words_and_idle_every_function)
{
    begin(s);
    s->response[0] = 0x4321;
    OK(mbm_node_idle(n, makes_calls));
    OK(mbm_node_preTransmission(n, is_busy));
    sim_reads(s, 5000);
    assert_string_equal(called, "bi");
    assert_int_equal(during, 0x4321);
    assert_int_equal(s->transmit[0], 0x1234);
}

static void heard(void *context, const mbm_traceRecord *record)
{
    (void)context;
    (void)record;
}

/* Begins a trace of a port, and the line of the test on the trace. */
static void begin_trace(sim *s, mbm_trace *trace, const mbm_port *port)
{
    static const mbm_framing rtu;
    static uint8_t space[2 * MBM_MAX_FRAME];

    OK(mbm_trace_begin(trace, MBM_PACKET_REQUEST, port, &rtu, space, sizeof space, heard, NULL));
    OK(mbm_line_beginRtu(&s->line, mbm_trace_port(trace), s->buffer, sizeof s->buffer));
}

/* The line must use the port of the callbacks. The trace may be below them, not above them. */
SIM_TEST(callbacks_are_found_before_a_trace_and_not_behind_it)
{
    mbm_trace trace = MBM_INIT;

    begin(s);
    begin_trace(s, &trace, &s->port);
    IS(MBM_NOT_INITIALISED, mbm_node_idle(n, waiting));
    begin_line(s, mbm_trace_port(&trace));
    use_all(n);
    sim_reads(s, 5000);
    assert_string_equal(called, "bai");
    OK(mbm_nodeCallbacks_begin(&callbacks, &s->port));
    begin_trace(s, &trace, mbm_nodeCallbacks_port(&callbacks));
    IS(MBM_NOT_INITIALISED, mbm_node_idle(n, waiting));
}
