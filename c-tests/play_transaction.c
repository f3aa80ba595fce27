/* Plays one transaction of the master on a line with a clock of its own, and prints what happens
 * and when, in microseconds. scripts/check/pictures compares that with the pictures.
 *
 *     play_transaction BAUD HOLD DELAY BYTES
 *
 * reads three holding registers of unit 17. The driver is held for HOLD characters. The device
 * waits for DELAY microseconds after the request, and sends BYTES, in hexadecimal.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm.h"

#include <stdio.h>
#include <stdlib.h>

enum { UNIT = 17, WORDS = 3, STEP = 10, LONGEST = 1000000 };

typedef struct line {
    uint32_t now, sent, character, delay;
    uint8_t reply[64];
    uint16_t length, taken;
    uint8_t driver;
} line;

/* The reply's bytes that have arrived by now, one at a time. */
static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    line *l = context;
    uint32_t arrives = l->sent + l->delay + (l->taken + 1u) * l->character;

    if (l->sent == 0 || l->taken == l->length || capacity == 0 || l->now < arrives)
        return 0;
    bytes[0] = l->reply[l->taken++];
    return 1;
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    line *l = context;

    (void)bytes;
    printf("%lu request\n", (unsigned long)l->now);
    l->sent = l->now + length * l->character;
    return (int16_t)length;
}

static uint8_t line_flush(void *context)
{
    const line *l = context;

    return l->now >= l->sent;
}

static uint32_t line_micros(void *context)
{
    const line *l = context;

    return l->now;
}

static void line_driver(void *context, uint8_t on)
{
    line *l = context;

    if (l->driver != on)
        printf("%lu driver %s\n", (unsigned long)l->now, on ? "on" : "off");
    l->driver = on;
}

static void line_on(void *context)
{
    line_driver(context, 1);
}

static void line_off(void *context)
{
    line_driver(context, 0);
}

int main(int argc, char **argv)
{
    static line l;
    static mbm_line bus;
    static mbm_node node;
    static uint16_t words[WORDS];
    static uint8_t frame[MBM_FRAME_BYTES(WORDS)];
    const mbm_port port = {.context = &l,
                           .read = line_read,
                           .write = line_write,
                           .micros = line_micros,
                           .flush = line_flush,
                           .preTransmission = line_on,
                           .postTransmission = line_off};
    unsigned byte;
    int read;
    const char *bytes;
    uint8_t status;

    if (argc != 5)
        return 2;
    l.character = (uint32_t)(11000000ul / strtoul(argv[1], NULL, 10));
    l.delay = (uint32_t)strtoul(argv[3], NULL, 10);
    for (bytes = argv[4]; l.length < sizeof l.reply && sscanf(bytes, "%2x%n", &byte, &read) == 1;
         bytes += read)
        l.reply[l.length++] = (uint8_t)byte;
    mbm_line_beginRtu(&bus, &port, frame, sizeof frame);
    mbm_node_begin(&node, &bus, UNIT, words, WORDS, NULL, 0);
    mbm_line_setBaudRate(&bus, (uint32_t)strtoul(argv[1], NULL, 10));
    mbm_line_setPostFlushHold(&bus, (uint8_t)strtoul(argv[2], NULL, 10));
    mbm_node_setResponseTimeout(&node, 100);
    mbm_node_setBlocking(&node, 0);
    mbm_line_used(&bus);
    status = mbm_node_readHoldingRegisters(&node, 107, WORDS);
    while (status == MBM_PENDING && l.now < LONGEST) {
        l.now += STEP;
        status = mbm_node_poll(&node);
    }
    printf("%lu status %02X: %u, %u, %u\n", (unsigned long)l.now, status, words[0], words[1],
           words[2]);
    return 0;
}
