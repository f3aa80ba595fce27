/* The master of master.h with nanoMODBUS. */
#ifndef NANO_MASTER_H
#define NANO_MASTER_H

#include "nano_hooks.h"

static uint8_t run_master(void)
{
    static nmbs_t client;
    static uint16_t words[COUNT], transmit[COUNT];
    nmbs_platform_conf conf;

    begin_nano(&conf);
    if (nmbs_client_create(&client, &conf) != NMBS_ERROR_NONE)
        return 1;
    nmbs_set_read_timeout(&client, 1000);
    nmbs_set_byte_timeout(&client, 100);
    nmbs_set_destination_rtu_address(&client, UNIT);
    wire_expect(&READ, &READ_REPLY);
    if (nmbs_read_holding_registers(&client, FIRST, COUNT, words) != NMBS_ERROR_NONE)
        return 1;
    if (words[0] != 0x1234 || words[1] != 0x5678)
        return 2;
    transmit[0] = 0x9ABC;
    transmit[1] = 0xDEF0;
    wire_expect(&WRITE, &WRITE_REPLY);
    if (nmbs_write_multiple_registers(&client, FIRST, COUNT, transmit) != NMBS_ERROR_NONE)
        return 3;
    return wire_is_done() ? 0 : 4;
}

#endif
