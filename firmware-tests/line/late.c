/* See late.h. Licence: MIT OR Apache-2.0. */
#include "late.h"
#include "line.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SLOW = 0x41, MS = 1000 };

/* What the client does, in this order. */
enum { ASKS, GIVES_UP, GETS_LATE_REPLY, GETS_REPLY, ASKS_AGAIN, GETS_LAST_REPLY };

static mbm_server server;
static uint16_t words[] = {LINE_FIRST};
static mbm_registerTable table = {.words = words, .base = LINE_ADDRESS, .size = 1};
static mbm_unit unit = {.id = LINE_UNIT};
static uint8_t frame[MBM_MAX_FRAME];
static uint32_t now, since;
static int stage;
static uint8_t received[16];
static uint16_t count;

static void end(int code, const char *what)
{
    printf("late: %s\n", what);
    exit(code);
}

static uint16_t sealed(uint8_t *bytes, uint16_t length)
{
    uint16_t crc = mbm_frame_crc16(bytes, length);

    bytes[length] = (uint8_t)crc;
    bytes[length + 1] = (uint8_t)(crc >> 8);
    return (uint16_t)(length + 2);
}

/* --- the client */

static void send_read(void)
{
    uint8_t bytes[8] = {LINE_UNIT, 3, 0, LINE_ADDRESS, 0, 1};

    line_write_as_device(bytes, sealed(bytes, 6));
}

/* Returns whether all of these bytes have arrived. */
static int got(uint8_t *bytes, uint16_t length)
{
    length = sealed(bytes, length);
    count = (uint16_t)(count + line_read_as_device(received + count, (uint16_t)(length - count)));
    if (count < length)
        return 0;
    if (memcmp(received, bytes, length) != 0)
        end(1, "the server sends something else");
    count = 0;
    return 1;
}

static int got_read(void)
{
    uint8_t bytes[7] = {LINE_UNIT, 3, 2, LINE_FIRST >> 8, LINE_FIRST & 0xFF};

    return got(bytes, 5);
}

static void next_stage(void)
{
    stage++;
    since = now;
}

static void client(uint32_t time)
{
    uint8_t slow[4] = {LINE_UNIT, SLOW};
    uint32_t passed;

    now = time;
    passed = now - since;
    if (passed > 1000 * MS)
        end(1, "the server does not answer");
    switch (stage) {
    case ASKS:
        if (passed < 10 * MS)
            return;
        line_write_as_device(slow, sealed(slow, 2));
        break;
    case GIVES_UP:
        if (passed < 100 * MS)
            return;
        send_read();
        break;
    case GETS_LATE_REPLY:
        if (!got(slow, 2))
            return;
        break;
    case GETS_REPLY:
        if (passed > 100 * MS)
            end(1, "the server does not go on after the late reply");
        if (!got_read())
            return;
        break;
    case ASKS_AGAIN:
        if (passed < 100 * MS)
            return;
        send_read();
        break;
    default:
        if (got_read())
            end(0, "the server goes on after the late reply");
        return;
    }
    next_stage();
}

void late_begin(void)
{
    line_replace_device(client);
}

/* --- the server */

static uint16_t answer_late(void *context, const mbm_request *request, uint8_t *response,
                            uint16_t capacity)
{
    (void)context;
    (void)request;
    (void)response;
    (void)capacity;
    return stage == GETS_LATE_REPLY && now - since >= 200 * MS ? 0 : MBM_REPLY_PENDING;
}

void late_serve(const mbm_port *port, uint32_t baud)
{
    static mbm_custom slow = {.serve = answer_late, .code = SLOW};

    if (mbm_unit_serveHoldingRegisters(&unit, &table) != MBM_OK ||
        mbm_unit_serveCustom(&unit, &slow) != MBM_OK ||
        mbm_server_beginRtu(&server, port, &unit, 1, frame, sizeof frame) != MBM_OK ||
        mbm_server_setBaudRate(&server, baud) != MBM_OK)
        end(1, "the server does not begin");
}

uint32_t late_poll(void)
{
    mbm_server_poll(&server);
    return mbm_server_pollDelay(&server);
}
