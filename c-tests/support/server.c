#define _GNU_SOURCE
#include "server.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

uint16_t server_pattern(unsigned address)
{
    return (uint16_t)(address * 40503u + 0x1234u);
}

uint8_t server_bit_pattern(unsigned address)
{
    return (uint8_t)(server_pattern(address) >> 7 & 1u);
}

modbus_mapping_t *server_memory(void)
{
    modbus_mapping_t *memory =
        modbus_mapping_new(SERVER_BITS, SERVER_BITS, SERVER_REGISTERS, SERVER_REGISTERS);

    if (!memory)
        abort();
    for (unsigned i = 0; i < SERVER_REGISTERS; i++) {
        memory->tab_registers[i] = server_pattern(i);
        memory->tab_input_registers[i] = (uint16_t)~server_pattern(i);
    }
    for (unsigned i = 0; i < SERVER_BITS; i++) {
        memory->tab_bits[i] = server_bit_pattern(i);
        memory->tab_input_bits[i] = !server_bit_pattern(i);
    }
    return memory;
}

static void *serve(void *argument)
{
    server *s = (server *)argument;
    uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];

    for (;;) {
        struct pollfd waits[2] = {{modbus_get_socket(s->peer), POLLIN, 0}, {s->stop[0], POLLIN, 0}};
        int length;

        poll(waits, 2, -1);
        if (waits[1].revents)
            return NULL;
        length = modbus_receive(s->peer, request);
        /* After a frame for another unit libmodbus takes the next frame for that unit's
         * reply. That frame must not be a request of the test. */
        if (length == 0)
            modbus_receive(s->peer, request);
        if (length > 0)
            modbus_reply(s->peer, request, length, s->mapping);
    }
}

void server_start(server *s, int unit)
{
    pty_open(&s->line);
    s->peer = modbus_new_rtu(s->line.path, 115200, 'N', 8, 1);
    s->mapping = server_memory();
    if (!s->peer || modbus_set_slave(s->peer, unit) || modbus_connect(s->peer) ||
        modbus_set_response_timeout(s->peer, 0, 20000) || pipe(s->stop)) {
        perror("libmodbus server");
        abort();
    }
    if (pthread_create(&s->thread, NULL, serve, s))
        abort();
}

void server_stop(server *s)
{
    if (write(s->stop[1], "", 1) != 1)
        abort();
    pthread_join(s->thread, NULL);
    modbus_close(s->peer);
    modbus_free(s->peer);
    modbus_mapping_free(s->mapping);
    close(s->stop[0]);
    close(s->stop[1]);
    pty_close(&s->line);
}
