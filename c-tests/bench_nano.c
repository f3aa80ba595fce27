/* The client of nanoMODBUS. Its example for Linux reads single bytes, each with a select; the
 * functions here wait with poll and read as many bytes as nanoMODBUS asks for. */
#include "bench_client.h"
#include "nanomodbus.h"

#include <poll.h>
#include <stddef.h>
#include <unistd.h>

static nmbs_t nano;
static int line;

static int32_t nano_read(uint8_t *bytes, uint16_t count, int32_t timeout_ms, void *context)
{
    struct pollfd ready = {line, POLLIN, 0};
    int32_t have = 0;

    while (have < count && poll(&ready, 1, timeout_ms) == 1) {
        ssize_t got = read(line, bytes + have, (size_t)(count - have));

        if (got <= 0)
            return -1;
        have += (int32_t)got;
    }
    return have;
}

static int32_t nano_write(const uint8_t *bytes, uint16_t count, int32_t timeout_ms, void *context)
{
    return (int32_t)write(line, bytes, count);
}

static void begin(nmbs_transport transport)
{
    nmbs_platform_conf platform;

    nmbs_platform_conf_create(&platform);
    platform.transport = transport;
    platform.read = nano_read;
    platform.write = nano_write;
    if (nmbs_client_create(&nano, &platform) != NMBS_ERROR_NONE)
        fail("nanoMODBUS");
    nmbs_set_read_timeout(&nano, TIMEOUT_MS);
    nmbs_set_byte_timeout(&nano, TIMEOUT_MS);
    nmbs_set_destination_rtu_address(&nano, UNIT);
}

void nano_begin_tcp(int fd)
{
    line = fd;
    begin(NMBS_TRANSPORT_TCP);
}

void nano_begin_rtu(int fd)
{
    line = fd;
    begin(NMBS_TRANSPORT_RTU);
}

const uint16_t *nano_read_registers(void)
{
    static uint16_t words[QUANTITY];

    return nmbs_read_holding_registers(&nano, ADDRESS, QUANTITY, words) == NMBS_ERROR_NONE ? words
                                                                                           : NULL;
}
