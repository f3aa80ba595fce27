/* The port for FreeRTOS in the test kit for ports. Tasks are threads: see test_freertos.c. */
#include "porttest.h"
#include "await.h"
#include "mbm_tty.h"
#include "pty.h"
#include "uart.h"

static pty far_end;

static uint32_t lost(void *context)
{
    return mbm_freertos_lost(&uart);
}

static uint8_t driver(void *context)
{
    return (uint8_t)chip.driver;
}

static uint8_t begin(void *context)
{
    mbm_freertos_close(&uart);
    return mbm_freertos_open(&uart, &port);
}

static void yield(void *context)
{
    poll(NULL, 0, 1);
}

static void setup(void)
{
    static uint8_t whole_frame[MBM_MAX_FRAME + 1];

    pty_open(&far_end);
    uart_settings();
    uart.received = whole_frame;
    uart.receivedBytes = sizeof whole_frame;
    OK(mbm_freertos_open(&uart, &port));
    uart_start(far_end.ours);
}

static void teardown(void)
{
    uart_stop();
    pty_close(&far_end);
}

fixture each_test = {setup, teardown};

TEST(the_port_passes_the_test_kit)
{
    static mbm_portTest test;
    static mbm_tty far;
    mbm_port other;

    OK(mbm_tty_attach(&far, far_end.theirs));
    other = mbm_tty_port(&far);
    test = (mbm_portTest){.port = &port,
                          .other = &other,
                          .holds = MBM_MAX_FRAME,
                          .say = porttest_say,
                          .lost = lost,
                          .driver = driver,
                          .begin = begin,
                          .yield = yield};
    assert_int_equal(mbm_portTest_run(&test), 0);
    assert_in_range(test.checks, 10, 100);
}
