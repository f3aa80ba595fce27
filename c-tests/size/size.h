/* What the measured programs share: buffers of 64 words and a port that does next to
 * nothing. With WITHOUT_MBM the same program is built without any call of mbm, but with its
 * buffers and hooks. The difference is the size of the library, with the instructions that
 * call it. */
#ifndef SIZE_H
#define SIZE_H

#include "mbm.h"

#define WORDS 64

/* Makes the compiler believe that the program uses the value. */
#define USED(value) __asm__ volatile("" : : "r"(value) : "memory")

static uint16_t response[WORDS];
static uint16_t transmit[WORDS];
static uint8_t frame[MBM_FRAME_BYTES(WORDS)];

static volatile uint8_t uart;
static volatile uint32_t ticks;

static int16_t port_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    (void)capacity;
    bytes[0] = uart;
    return 1;
}

static int16_t port_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)length;
    uart = bytes[0];
    return 1;
}

static uint32_t port_micros(void *context)
{
    (void)context;
    return ticks;
}

#ifdef WITHOUT_MBM
#define CALL(call) 0
#else
#define CALL(call) (call)
#endif

#ifndef SIZE_CLIENT_H
#ifndef WITHOUT_MBM
static mbm_line line;
static mbm_node node;
#endif

static inline void begin(void)
{
    static const mbm_port port = {.read = port_read, .write = port_write, .micros = port_micros};

    USED(&port);
    USED(response);
    USED(transmit);
    USED(frame);
    (void)CALL(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    (void)CALL(mbm_node_begin(&node, &line, 1, response, WORDS, transmit, WORDS));
}

#endif

/* Reads holding registers, and writes them from the transmit words. */
#define CALL_FC03_AND_FC16()                                                                       \
    do {                                                                                           \
        if (CALL(mbm_node_readHoldingRegisters(&node, 2, 10)) == MBM_OK)                           \
            transmit[0] = response[0];                                                             \
        uart = CALL(mbm_node_writeMultipleRegisters(&node, 2, 10));                                \
    } while (0)

/* Calls the ten functions of the master, and reaches its words. */
#define CALL_TEN_FUNCTIONS()                                                                       \
    do {                                                                                           \
        uart = CALL(mbm_node_readCoils(&node, 2, 10));                                             \
        uart = CALL(mbm_node_readDiscreteInputs(&node, 2, 10));                                    \
        uart = CALL(mbm_node_readHoldingRegisters(&node, 2, 10));                                  \
        uart = CALL(mbm_node_readInputRegisters(&node, 2, 10));                                    \
        uart = CALL(mbm_node_writeSingleCoil(&node, 2, 1));                                        \
        uart = CALL(mbm_node_writeSingleRegister(&node, 2, 10));                                   \
        uart = CALL(mbm_node_writeMultipleCoils(&node, 2, 10));                                    \
        uart = CALL(mbm_node_writeMultipleRegisters(&node, 2, 10));                                \
        uart = CALL(mbm_node_maskWriteRegister(&node, 2, 0xFF00, 0x0012));                         \
        uart = CALL(mbm_node_readWriteMultipleRegisters(&node, 2, 10, 20, 10));                    \
        transmit[0] = 1;                                                                           \
        uart = (uint8_t)response[0];                                                               \
    } while (0)

#endif
