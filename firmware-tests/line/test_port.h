/* The test kit for ports over the line in memory: the device's end is the second port. Include
 * line.h before. Licence: MIT OR Apache-2.0. */
#ifndef TEST_PORT_H
#define TEST_PORT_H

#include "mbm_porttest.h"

#include <stdio.h>
#include <stdlib.h>

static void no_device(uint32_t now)
{
    (void)now;
}

/* Call it before the port is opened. */
static inline void test_port_begin(void)
{
    line_replace_device(no_device);
}

static int16_t far_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    return (int16_t)line_read_as_device(bytes, capacity);
}

static int16_t far_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    return (int16_t)line_write_as_device(bytes, length);
}

static uint32_t far_micros(void *context)
{
    (void)context;
    return line_micros();
}

static uint8_t driver(void *context)
{
    (void)context;
    return line_is_driving();
}

static void say(void *context, mbm_portFinding kind, const char *sentence)
{
    (void)context;
    printf("%s: %s\n", mbm_portFinding_name(kind), sentence);
}

/* Tests an open port, and ends the program. `begin` closes the port and opens it again. */
static inline void test_port(const mbm_port *port, uint32_t baud, uint8_t mayWait,
                             uint8_t (*begin)(void *context))
{
    static const mbm_port far_port = {.read = far_read, .write = far_write, .micros = far_micros};
    static mbm_portTest test = MBM_INIT;

    test.port = port;
    test.other = &far_port;
    test.bits = 11;
    test.baud = baud;
    test.holds = 256;
    test.mayWait = mayWait;
    test.reference = far_micros;
    test.driver = driver;
    test.begin = begin;
    test.say = say;
    if (mbm_portTest_run(&test) != 0)
        exit(1);
    printf("the port passes\n");
    exit(0);
}

#endif
