/* A board for the README's program. Unit 17 is a part of the board's memory and has two registers
 * from 107 on. The board checks what the program sends, byte by byte. */
#include "crc.h"
#include "mbm.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

uint8_t read_meter(void);

static uint8_t asked[8], reply[9];
static size_t asked_length, sent;

static int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    uint16_t taken = 0;

    (void)context;
    while (taken < length && asked_length < sizeof asked)
        asked[asked_length++] = bytes[taken++];
    return (int16_t)taken;
}

static int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    static const uint8_t expected[6] = {17, 3, 0, 107, 0, 2};

    (void)context;
    if (asked_length < sizeof asked || memcmp(asked, expected, sizeof expected) != 0 ||
        crc16(asked, sizeof asked) != 0 || sent == sizeof reply || capacity == 0)
        return 0;
    if (sent == 0) {
        static const uint8_t head[5] = {17, 3, 4, 0x12, 0x34};

        memcpy(reply, head, sizeof head);
        seal(reply, sizeof reply - 2);
    }
    *bytes = reply[sent++];
    return 1;
}

static uint32_t clock_micros(void *context)
{
    struct timespec now;

    (void)context;
    timespec_get(&now, TIME_UTC);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

const mbm_port uart = {.read = uart_read, .write = uart_write, .micros = clock_micros};

int main(void)
{
    const uint8_t status = read_meter();

    printf("%u bytes asked, %u answered: %s\n", (unsigned)asked_length, (unsigned)sent,
           mbm_status_text(status));
    return status == MBM_OK ? 0 : 1;
}
