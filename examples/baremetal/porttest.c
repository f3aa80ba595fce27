/* Tests the port of a board without an operating system, whose TX is wired to its RX, and
 * prints what the test finds.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm_porttest.h"

static void say(void *context, mbm_portFinding kind, const char *sentence)
{
    (void)context;
    console_print(mbm_portFinding_name(kind));
    console_print(": ");
    console_print(sentence);
    console_print("\n");
}

static uint8_t begin(void *context)
{
    (void)context;
    uart_start();
    return 0;
}

#ifdef SLEEPS
/* The UART fills a ring, and the core sleeps while a call waits. */
static void idle(void *context, mbm_node *node)
{
    (void)context;
    sleep_at_most(mbm_node_pollDelay(node));
}

static uint32_t lost(void *context)
{
    (void)context;
    return uart_lost();
}
#endif

int main(void)
{
    static mbm_port port = {
        .read = uart_read, .write = uart_write, .micros = clock_micros, .flush = uart_flush};
    static mbm_portTest test = MBM_INIT;

    clock_start();
    uart_start();
    test.port = &port;
    test.isLooped = 1;
    /* QEMU's UARTs have no rate; with a UART that has one, this is BAUD. */
    test.baud = 0;
    test.begin = begin;
    test.say = say;
#ifdef SLEEPS
    sleep_start();
    port.idle = idle;
    test.lost = lost;
    test.holds = MBM_MAX_FRAME;
#endif
    if (mbm_portTest_run(&test) > 0u) {
        console_exit(1);
    }
    console_print("the port passes\n");
    console_exit(0);
}
