/* The port for STM32 in the test kit for ports, on a chip that is played. TX is wired to RX. */
#include "machine.h"
#include "porttest.h"
#include "test.h"
#include "uart.h"

static mbm_portTest test;
static mbm_port watched;

/* The clock goes on while the program looks at it. */
static uint32_t micros(void *context)
{
    machine_run(2);
    return port.micros(context);
}

static void yield(void *context)
{
    machine_run(20);
}

static uint32_t reference(void *context)
{
    return (uint32_t)(m.now / 1000u);
}

static uint32_t lost(void *context)
{
    return mbm_stm32_lost(&uart) + uart.overruns;
}

static uint8_t driver(void *context)
{
    return chip_is_driving() != 0;
}

static void disturb(void *context)
{
    machine_receive_faulty(0, FRAMING);
    machine_run(200);
}

static uint8_t begin_again(void *context)
{
    mbm_stm32_close(&uart);
    return mbm_stm32_open(&uart, &huart1, &port) != MBM_STM32_OK;
}

static void passes(uint8_t byDma)
{
    uart_start(byDma);
    memset(&test, 0, sizeof test);
    m.isLooped = 1;
    uart_open();
    watched = port;
    watched.micros = micros;
    test.port = &watched;
    test.isLooped = 1;
    test.bits = 11;
    test.baud = 115200;
    test.holds = MBM_STM32_RECEIVE_BYTES - 1;
    test.say = porttest_say;
    test.lost = lost;
    test.driver = driver;
    test.begin = begin_again;
    test.disturb = disturb;
    test.reference = reference;
    test.yield = yield;
    assert_int_equal(mbm_portTest_run(&test), 0);
    assert_int_equal(test.advice, 0);
    mbm_stm32_close(&uart);
}

TEST(the_port_for_stm32_by_dma)
{
    passes(1);
}

TEST(the_port_for_stm32_by_interrupt)
{
    passes(0);
}
