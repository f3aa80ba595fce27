/* A server on USART 0 and a master on USART 1 of an ATmega1284P, without interrupts and
 * without Arduino's core. The test runs the code for avrxmega3 with it. On this chip that
 * code differs from the chip's own only if an interrupt comes between the two writes to the
 * stack pointer.
 * Licence: MIT OR Apache-2.0. */
#include "mbm.h"

#include <avr/io.h>

enum { DIVISOR = 103 /* 9600 baud at 16 MHz */, CELLS = 8, FIRST = 40, COUNT = 3 };

typedef struct usart {
    volatile uint8_t *status, *data;
    uint8_t is_sending;
} usart;

static int16_t take(void *context, uint8_t *bytes, uint16_t capacity)
{
    const usart *u = context;
    int16_t count = 0;

    while ((uint16_t)count < capacity && (*u->status & _BV(RXC0)))
        bytes[count++] = *u->data;
    return count;
}

static int16_t put(void *context, const uint8_t *bytes, uint16_t length)
{
    usart *u = context;
    int16_t count = 0;

    while ((uint16_t)count < length && (*u->status & _BV(UDRE0))) {
        *u->status |= _BV(TXC0);
        *u->data = bytes[count++];
        u->is_sending = 1;
    }
    return count;
}

static uint8_t sent(void *context)
{
    usart *u = context;

    if (*u->status & _BV(TXC0))
        u->is_sending = 0;
    return !u->is_sending;
}

/* Timer 1 counts half microseconds. The clock must be read at least every 32 ms. */
static uint32_t micros(void *context)
{
    static uint32_t total;
    static uint16_t before;
    uint16_t now = TCNT1;

    (void)context;
    total += (uint16_t)(now - before);
    before = now;
    return total / 2;
}

static usart served = {&UCSR0A, &UDR0, 0}, asked = {&UCSR1A, &UDR1, 0};
static mbm_server server = MBM_INIT;
static mbm_unit unit = MBM_INIT;
static mbm_line line = MBM_INIT;
static mbm_node device = MBM_INIT;
static uint8_t frame[MBM_MAX_FRAME], request[MBM_FRAME_BYTES(CELLS)];
static uint16_t words[CELLS], replies[CELLS];
static mbm_registerTable table = MBM_INIT;
static uint8_t is_wanted;

static void written(void *context, const mbm_access *access)
{
    (void)context;
    if (access->address == 0)
        is_wanted = 1;
}

static void port_of(mbm_port *port, usart *u)
{
    port->context = u;
    port->read = take;
    port->write = put;
    port->micros = micros;
    port->flush = sent;
}

int main(void)
{
    static mbm_port serving, asking;
    static mbm_accessHooks hooks;

    UBRR0 = UBRR1 = DIVISOR;
    UCSR0B = UCSR1B = _BV(RXEN0) | _BV(TXEN0);
    TCCR1B = _BV(CS11);
    port_of(&serving, &served);
    port_of(&asking, &asked);

    hooks.afterWrite = written;
    table.words = words;
    table.size = CELLS;
    mbm_registerTable_setHooks(&table, &hooks);
    unit.id = 17;
    mbm_unit_serveHoldingRegisters(&unit, &table);
    mbm_server_beginRtu(&server, &serving, &unit, 1, frame, sizeof frame);
    mbm_server_setBaudRate(&server, 9600);
    mbm_line_beginRtu(&line, &asking, request, sizeof request);
    mbm_node_begin(&device, &line, 1, replies, CELLS, 0, 0);
    for (;;) {
        uint8_t i;

        mbm_server_poll(&server);
        if (!is_wanted || mbm_server_pollDelay(&server) != UINT32_MAX)
            continue;
        /* The response has been sent: reads three registers as the master, and serves the
         * status and values. */
        is_wanted = 0;
        words[1] = mbm_node_readHoldingRegisters(&device, FIRST, COUNT);
        for (i = 0; i < COUNT; i++)
            words[2 + i] = replies[i];
    }
}
