/* See line.h. Licence: MIT OR Apache-2.0. */
#include "line.h"
#include "mbm.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CAPACITY = 512 };

/* Bytes on their way in one direction. */
struct way {
    uint8_t bytes[CAPACITY];
    uint16_t count;    /* bytes that wait */
    uint16_t arrived;  /* bytes at the end of the way, before those */
    uint32_t first_us; /* when the first waiting byte arrives */
};

static struct way there, back;
static uint32_t now, byte_us;
static bool has_driver, is_driving, is_stopped;
static unsigned answers, ignored, ignore_after, end_after;

static void (*replacement)(uint32_t now);
static mbm_server device = MBM_INIT;
static mbm_unit unit = {.id = LINE_UNIT};
static uint16_t words[] = {LINE_FIRST, LINE_SECOND};
static mbm_registerTable table = {.words = words, .base = LINE_ADDRESS, .size = 2};
static uint8_t frame[MBM_MAX_FRAME];

static void fail(const char *what)
{
    printf("line: %s at %lu us\n", what, (unsigned long)now);
    exit(1);
}

void line_expect(bool fact, const char *what)
{
    if (!fact)
        fail(what);
}

static uint16_t put(struct way *way, const uint8_t *bytes, uint16_t length)
{
    uint16_t space = (uint16_t)(CAPACITY - way->count - way->arrived);

    if (length > space)
        length = space;
    if (length > 0 && way->count == 0)
        way->first_us = now + byte_us;
    memcpy(way->bytes + way->arrived + way->count, bytes, length);
    way->count = (uint16_t)(way->count + length);
    return length;
}

static uint16_t take(struct way *way, uint8_t *bytes, uint16_t capacity)
{
    uint16_t count = way->arrived < capacity ? way->arrived : capacity;

    memcpy(bytes, way->bytes, count);
    memmove(way->bytes, way->bytes + count, sizeof way->bytes - count);
    way->arrived = (uint16_t)(way->arrived - count);
    return count;
}

/* Moves the bytes whose time has come. Returns whether there were any. */
static bool move(struct way *way)
{
    bool moved = false;

    while (way->count > 0 && (int32_t)(now - way->first_us) >= 0) {
        if (has_driver && is_driving != (way == &there))
            fail(is_driving ? "the driver is on while a byte arrives"
                            : "the driver is off while a byte is sent");
        way->count--;
        way->arrived++;
        way->first_us += byte_us;
        moved = true;
    }
    return moved;
}

static void advance(uint32_t micros)
{
    while (micros > 0) {
        uint32_t step = micros < byte_us ? micros : byte_us;

        now += step;
        micros -= step;
        if (replacement != NULL)
            replacement(now);
        else
            mbm_server_poll(&device);
        if (is_stopped)
            there.first_us = now + byte_us;
        if (move(&there) || move(&back))
            line_interrupt();
    }
}

/* --- the device's end */

static int16_t device_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    return (int16_t)take(&there, bytes, capacity);
}

static int16_t device_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    if (ignore_after > 0 && answers + ignored == ignore_after) {
        ignored++;
        return (int16_t)length;
    }
    answers++;
    return (int16_t)put(&back, bytes, length);
}

static uint32_t device_micros(void *context)
{
    (void)context;
    return now;
}

void line_replace_device(void (*step)(uint32_t now))
{
    replacement = step;
}

uint16_t line_read_as_device(uint8_t *bytes, uint16_t capacity)
{
    return take(&there, bytes, capacity);
}

uint16_t line_write_as_device(const uint8_t *bytes, uint16_t length)
{
    return put(&back, bytes, length);
}

/* --- the program's end */

void line_begin(uint32_t baud)
{
    static const mbm_port port = {
        .read = device_read, .write = device_write, .micros = device_micros};

    byte_us = 11000000 / baud;
    if (replacement != NULL)
        return;
    if (mbm_unit_serveHoldingRegisters(&unit, &table) != MBM_OK ||
        mbm_server_beginRtu(&device, &port, &unit, 1, frame, sizeof frame) != MBM_OK ||
        mbm_server_setBaudRate(&device, baud) != MBM_OK)
        fail("the device does not begin");
}

void line_has_driver(void)
{
    has_driver = true;
}

void line_ignore_after(unsigned requests)
{
    ignore_after = requests;
}

uint32_t line_micros(void)
{
    advance(1);
    return now;
}

void line_sleep(uint32_t micros)
{
    advance(micros);
    if (end_after > 0 && answers >= end_after && micros >= 500000) {
        printf("line: %u requests answered, %u ignored\n", answers, ignored);
        exit(0);
    }
    if (end_after > 0 && now > 60000000)
        fail("the device was not asked often enough");
}

uint16_t line_write(const uint8_t *bytes, uint16_t length)
{
    return put(&there, bytes, length);
}

uint16_t line_unsent(void)
{
    return there.count;
}

uint16_t line_read(uint8_t *bytes, uint16_t capacity)
{
    return take(&back, bytes, capacity);
}

uint16_t line_received(void)
{
    return back.arrived;
}

void line_drive(bool on)
{
    if (!on && there.count > 0 && !is_stopped)
        fail("the driver goes off before the last bit has left");
    is_driving = on;
}

bool line_is_driving(void)
{
    return is_driving;
}

void line_end_after(unsigned wanted)
{
    end_after = wanted;
}

void line_stop(bool stops)
{
    is_stopped = stops;
}

void line_drop_unsent(void)
{
    there.count = 0;
}

void line_reset(void)
{
    memset(&there, 0, sizeof there);
    memset(&back, 0, sizeof back);
    has_driver = is_driving = is_stopped = false;
    replacement = NULL;
    words[0] = LINE_FIRST;
    answers = ignored = ignore_after = end_after = 0;
}
