/* examples/stm32/read_registers.c over nanoMODBUS, for scripts/bench/kits, with the HAL's calls
 * that wait, as its own example for STM32 has them. With WITHOUT it is the same program without
 * Modbus. Licence: MIT OR Apache-2.0. */
#include "app.h"
#include "main.h"

#include <stdio.h>

enum { UNIT = 17, FIRST = 100, COUNT = 2 };

static uint16_t registers[COUNT];

#ifndef WITHOUT
#include "nanomodbus.h"

static nmbs_t nmbs;

static int32_t receive(uint8_t *bytes, uint16_t count, int32_t timeout, void *context)
{
    (void)context;
    if (HAL_UART_Receive(&huart1, bytes, count, (uint32_t)timeout) == HAL_OK)
        return count;
    return count - huart1.RxXferCount - 1;
}

static int32_t transmit(const uint8_t *bytes, uint16_t count, int32_t timeout, void *context)
{
    (void)context;
    return HAL_UART_Transmit(&huart1, bytes, count, (uint32_t)timeout) == HAL_OK ? count : 0;
}

void app_setup(void)
{
    nmbs_platform_conf platform;

    nmbs_platform_conf_create(&platform);
    platform.transport = NMBS_TRANSPORT_RTU;
    platform.read = receive;
    platform.write = transmit;
    (void)nmbs_client_create(&nmbs, &platform);
    nmbs_set_read_timeout(&nmbs, 1000);
    nmbs_set_byte_timeout(&nmbs, 100);
    nmbs_set_destination_rtu_address(&nmbs, UNIT);
}

static int ask(void)
{
    return nmbs_read_holding_registers(&nmbs, FIRST, COUNT, registers) == NMBS_ERROR_NONE;
}
#else
void app_setup(void) {}

static int ask(void)
{
    return 1;
}
#endif

void app_loop(void)
{
    if (ask())
        printf("registers 100 and 101: %u %u\n", registers[0], registers[1]);
    else
        printf("no registers\n");
    HAL_Delay(1000);
}
