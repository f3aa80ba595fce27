/* Reads the holding registers 100 and 101 of unit 17 over RS-485, once a second. The master waits
 * for each reply. Call app_setup and app_loop in CubeMX's main.c: see docs/guide-stm32.md.
 *
 * In CubeMX: USART1, asynchronous, with its global interrupt; DMA for USART1_RX, circular, and
 * for USART1_TX, normal; a GPIO output with the label DRIVER at DE and /RE of the transceiver.
 * Licence: MIT OR Apache-2.0. */
#include "app.h"
#include "mbm_stm32.h"

#include <stdio.h>

extern UART_HandleTypeDef huart1; /* in CubeMX's main.c, or usart.c */

enum { UNIT = 17, FIRST = 100, COUNT = 2 };

static mbm_stm32Line uart;
static mbm_port port;
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t registers[COUNT];
static uint8_t frame[MBM_MAX_FRAME];

void app_setup(void)
{
    uint8_t fault;

#ifdef DRIVER_GPIO_Port
    uart.driverPort = DRIVER_GPIO_Port;
    uart.driverPin = DRIVER_Pin;
#endif
    fault = mbm_stm32_open(&uart, &huart1, &port);
    if (fault != MBM_STM32_OK) {
        printf("%s\n", mbm_stm32_text(fault));
        return;
    }
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, huart1.Init.BaudRate);
    mbm_node_begin(&meter, &line, UNIT, registers, COUNT, NULL, 0);
}

void app_loop(void)
{
    uint8_t status = mbm_node_readHoldingRegisters(&meter, FIRST, COUNT);

    if (status == MBM_OK)
        printf("registers 100 and 101: %u %u\n", registers[0], registers[1]);
    else
        printf("no registers: %s\n", mbm_status_text(status));
    if (mbm_stm32_lost(&uart) != 0u || uart.overruns != 0u)
        printf("lost %u bytes, %u overruns\n", mbm_stm32_lost(&uart), uart.overruns);
    HAL_Delay(1000);
}
