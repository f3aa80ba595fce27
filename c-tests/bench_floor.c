/* Straight C: what one transaction costs at least, in a program that can do nothing else. It sends
 * the request, waits with poll, and compares the reply with the one that it expects: header or CRC,
 * unit, function, byte count. Anything else on the line ends the program: it skips nothing, repeats
 * nothing and knows no exception. */
#include "bench_client.h"

#include <poll.h>
#include <stddef.h>
#include <unistd.h>

enum { TCP_REPLY = 9 + 2 * QUANTITY, RTU_REPLY = 5 + 2 * QUANTITY };

static int line;
static uint16_t table[256], words[QUANTITY];

void floor_begin(int fd)
{
    unsigned byte, bit;

    line = fd;
    for (byte = 0; byte < 256; byte++)
        for (table[byte] = (uint16_t)byte, bit = 0; bit < 8; bit++)
            table[byte] =
                (uint16_t)(table[byte] & 1 ? table[byte] >> 1 ^ 0xA001 : table[byte] >> 1);
}

static uint16_t crc(const uint8_t *bytes, unsigned length)
{
    uint16_t sum = 0xFFFF;

    for (; length > 0; length--)
        sum = (uint16_t)(sum >> 8 ^ table[(sum ^ *bytes++) & 0xFF]);
    return sum;
}

/* Sends a request and receives `length` bytes. Returns 0 if they do not come in time. */
static int exchange(const uint8_t *request, unsigned size, uint8_t *reply, unsigned length)
{
    struct pollfd ready = {line, POLLIN, 0};
    unsigned have = 0;

    if (write(line, request, size) != (ssize_t)size)
        return 0;
    while (have < length) {
        ssize_t got;

        if (poll(&ready, 1, TIMEOUT_MS) != 1)
            return 0;
        got = read(line, reply + have, length - have);
        if (got <= 0)
            return 0;
        have += (unsigned)got;
    }
    return 1;
}

static const uint16_t *registers(const uint8_t *data)
{
    unsigned i;

    for (i = 0; i < QUANTITY; i++)
        words[i] = (uint16_t)(data[2 * i] << 8 | data[2 * i + 1]);
    return words;
}

const uint16_t *floor_read_tcp(void)
{
    uint8_t request[12] = {0, 0, 0, 0, 0, 6, UNIT, 3, 0, ADDRESS, 0, QUANTITY}, reply[TCP_REPLY];
    static uint16_t transaction;

    request[0] = (uint8_t)(++transaction >> 8);
    request[1] = (uint8_t)transaction;
    if (!exchange(request, sizeof request, reply, sizeof reply) || reply[0] != request[0] ||
        reply[1] != request[1] || reply[2] || reply[3] || reply[4] || reply[5] != TCP_REPLY - 6 ||
        reply[6] != UNIT || reply[7] != 3 || reply[8] != 2 * QUANTITY)
        return NULL;
    return registers(reply + 9);
}

const uint16_t *floor_read_rtu(void)
{
    uint8_t request[8] = {UNIT, 3, 0, ADDRESS, 0, QUANTITY}, reply[RTU_REPLY];
    uint16_t sum = crc(request, 6);

    request[6] = (uint8_t)sum;
    request[7] = (uint8_t)(sum >> 8);
    if (!exchange(request, sizeof request, reply, sizeof reply) || crc(reply, RTU_REPLY) != 0 ||
        reply[0] != UNIT || reply[1] != 3 || reply[2] != 2 * QUANTITY)
        return NULL;
    return registers(reply + 3);
}
