#include "uart.h"

#include "machine.h"
#include "test.h"

mbm_stm32Line uart;
mbm_port port;

void uart_start(uint8_t byDma)
{
    machine_start(byDma, byDma);
    mbm_stm32_close(&uart);
    memset(&uart, 0, sizeof uart);
    uart.driverPort = GPIOA;
    uart.driverPin = GPIO_PIN_8;
}

void uart_open(void)
{
    assert_int_equal(mbm_stm32_open(&uart, &huart1, &port), MBM_STM32_OK);
}

void uart_is_quiet(void)
{
    assert_int_equal(m.collisions, 0);
    assert_int_equal(m.undriven, 0);
    assert_int_equal(m.isDriving, 0);
}
