#include "wire.h"

#include <stddef.h>

static const uint8_t read_bytes[] = {0x11, 0x03, 0x00, 0x6B, 0x00, 0x02, 0xB7, 0x47};
static const uint8_t read_reply[] = {0x11, 0x03, 0x04, 0x12, 0x34, 0x56, 0x78, 0x90, 0xC6};
static const uint8_t write_bytes[] = {0x11, 0x10, 0x00, 0x6B, 0x00, 0x02, 0x04,
                                      0x9A, 0xBC, 0xDE, 0xF0, 0x56, 0x2C};
static const uint8_t write_reply[] = {0x11, 0x10, 0x00, 0x6B, 0x00, 0x02, 0x32, 0x84};

const wire_frame READ = {read_bytes, sizeof read_bytes};
const wire_frame READ_REPLY = {read_reply, sizeof read_reply};
const wire_frame WRITE = {write_bytes, sizeof write_bytes};
const wire_frame WRITE_REPLY = {write_reply, sizeof write_reply};

static wire_frame said, expected;
static const wire_frame *after;
static uint8_t is_wrong;
static uint32_t now;

void wire_say(const wire_frame *frame)
{
    said = *frame;
}

void wire_expect(const wire_frame *frame, const wire_frame *reply)
{
    expected = *frame;
    after = reply;
}

uint8_t wire_is_done(void)
{
    return !is_wrong && said.length == 0 && expected.length == 0;
}

int16_t wire_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    int16_t count = 0;

    (void)context;
    while (said.length > 0 && (uint16_t)count < capacity) {
        bytes[count++] = *said.bytes++;
        said.length--;
    }
    return count;
}

int16_t wire_write(void *context, const uint8_t *bytes, uint16_t length)
{
    uint16_t i;

    (void)context;
    for (i = 0; i < length; i++) {
        if (expected.length == 0 || *expected.bytes++ != bytes[i]) {
            is_wrong = 1;
            return (int16_t)length;
        }
        expected.length--;
    }
    if (expected.length == 0 && after != NULL) {
        wire_say(after);
        after = NULL;
    }
    return (int16_t)length;
}

uint32_t wire_micros(void *context)
{
    (void)context;
    return now += 100;
}
