/* A board for the README's program. Unit 17 is a part of the board's memory and has 0x1234
 * in register 2. The board checks what the program sends, byte by byte. */
#include "crc.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity);
int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length);
uint32_t clock_micros(void *context);
void show(uint16_t value);
void setup(void);
void loop(void);

static uint8_t asked[8], reply[17];
static size_t asked_length, sent;
static int shown;

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    uint16_t taken = 0;

    (void)context;
    while (taken < length && asked_length < sizeof asked)
        asked[asked_length++] = bytes[taken++];
    return (int16_t)taken;
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    static const uint8_t expected[6] = {17, 3, 0, 2, 0, 6};

    (void)context;
    if (asked_length < sizeof asked || memcmp(asked, expected, sizeof expected) != 0 ||
        crc16(asked, sizeof asked) != 0 || sent == sizeof reply || capacity == 0)
        return 0;
    if (sent == 0) {
        static const uint8_t head[5] = {17, 3, 12, 0x12, 0x34};

        memcpy(reply, head, sizeof head);
        seal(reply, sizeof reply - 2);
    }
    *bytes = reply[sent++];
    return 1;
}

uint32_t clock_micros(void *context)
{
    struct timespec now;

    (void)context;
    timespec_get(&now, TIME_UTC);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

void show(uint16_t value)
{
    shown = value == 0x1234;
    printf("register 2: 0x%04X\n", value);
}

int main(void)
{
    setup();
    loop();
    return shown ? 0 : 1;
}
