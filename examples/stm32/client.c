/* Reads the holding registers 100 and 101 of unit 17 with a client, which never waits: the main
 * loop does its other work in between. CubeMX as for read_registers.c.
 * Licence: MIT OR Apache-2.0. */
#include "app.h"
#include "mbm_stm32.h"

#include <stdio.h>

extern UART_HandleTypeDef huart1;

enum { UNIT = 17, FIRST = 100, COUNT = 2, INTERVAL = 1000 /* ms */ };

static mbm_stm32Line uart;
static mbm_client client = MBM_INIT;
static mbm_clientRequest request = MBM_INIT;
static uint16_t registers[COUNT];
static uint8_t frame[MBM_MAX_FRAME];
static uint32_t asked;

static void done(void *context, mbm_clientRequest *ended)
{
    (void)context;
    if (ended->status == MBM_OK)
        printf("registers 100 and 101: %u %u\n", registers[0], registers[1]);
    else
        printf("no registers: %s\n", mbm_status_text(ended->status));
}

void app_setup(void)
{
    mbm_port port;
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
    mbm_client_beginRtu(&client, &port, frame, sizeof frame);
    mbm_client_setBaudRate(&client, huart1.Init.BaudRate);
    request.unit = UNIT;
    request.reply = registers;
    request.replyBytes = sizeof registers;
    request.done = done;
}

void app_loop(void)
{
    if (request.status != MBM_PENDING && HAL_GetTick() - asked >= INTERVAL) {
        asked = HAL_GetTick();
        mbm_client_readHoldingRegisters(&client, &request, FIRST, COUNT);
    }
    mbm_client_poll(&client);
    /* Your other work. Or sleep until the next interrupt, which is SysTick's at the latest: __WFI
     */
}
