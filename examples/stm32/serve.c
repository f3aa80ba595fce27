/* Is unit 17 with ten holding registers from address 100, and ten coils from address 0. CubeMX as
 * for read_registers.c. Licence: MIT OR Apache-2.0. */
#include "app.h"
#include "mbm_stm32.h"

#include <stdio.h>

extern UART_HandleTypeDef huart1;

enum { UNIT = 17 };

static mbm_stm32Line uart;
static mbm_server server = MBM_INIT;
static uint16_t words[10] = {2301, 50};
static uint8_t bits[2];
static mbm_registerTable holding = {.words = words, .base = 100, .size = 10};
static mbm_bitTable coils = {.bits = bits, .base = 0, .size = 10};
static mbm_unit unit = {.id = UNIT};
static uint8_t frame[MBM_MAX_FRAME];

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
    mbm_unit_serveHoldingRegisters(&unit, &holding);
    mbm_unit_serveCoils(&unit, &coils);
    mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame);
    mbm_server_setBaudRate(&server, huart1.Init.BaudRate);
    printf("serving unit %u\n", UNIT);
}

void app_loop(void)
{
    mbm_server_poll(&server);
    /* Your other work, for at most some milliseconds: the master waits. */
}
