/* The server of server.h with nanoMODBUS. */
#ifndef NANO_SERVER_H
#define NANO_SERVER_H

#include "nano_hooks.h"

static uint16_t served[128];

static nmbs_error serve_read(uint16_t address, uint16_t quantity, uint16_t *registers, uint8_t unit,
                             void *context)
{
    uint16_t i;

    (void)unit;
    (void)context;
    if ((uint32_t)address + quantity > 128)
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    for (i = 0; i < quantity; i++)
        registers[i] = served[address + i];
    return NMBS_ERROR_NONE;
}

static nmbs_error serve_write(uint16_t address, uint16_t quantity, const uint16_t *registers,
                              uint8_t unit, void *context)
{
    uint16_t i;

    (void)unit;
    (void)context;
    if ((uint32_t)address + quantity > 128)
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    for (i = 0; i < quantity; i++)
        served[address + i] = registers[i];
    return NMBS_ERROR_NONE;
}

static nmbs_error serve_write_one(uint16_t address, uint16_t value, uint8_t unit, void *context)
{
    return serve_write(address, 1, &value, unit, context);
}

static uint8_t run_server(void)
{
    static nmbs_t server;
    nmbs_platform_conf conf;
    nmbs_callbacks callbacks;

    served[FIRST] = 0x1234;
    served[FIRST + 1] = 0x5678;
    begin_nano(&conf);
    nmbs_callbacks_create(&callbacks);
    callbacks.read_holding_registers = serve_read;
    callbacks.write_single_register = serve_write_one;
    callbacks.write_multiple_registers = serve_write;
    if (nmbs_server_create(&server, UNIT, &conf, &callbacks) != NMBS_ERROR_NONE)
        return 6;
    nmbs_set_read_timeout(&server, 1000);
    nmbs_set_byte_timeout(&server, 100);
    wire_expect(&READ_REPLY, NULL);
    wire_say(&READ);
    if (nmbs_server_poll(&server) != NMBS_ERROR_NONE || !wire_is_done())
        return 7;
    wire_expect(&WRITE_REPLY, NULL);
    wire_say(&WRITE);
    if (nmbs_server_poll(&server) != NMBS_ERROR_NONE || !wire_is_done())
        return 8;
    return served[FIRST] == 0x9ABC && served[FIRST + 1] == 0xDEF0 ? 0 : 9;
}

#endif
