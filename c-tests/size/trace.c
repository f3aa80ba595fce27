/* A program that calls readHoldingRegisters over a trace. */
#include "size.h"

static volatile uint8_t traced;

static void take(void *context, const mbm_traceRecord *record)
{
    (void)context;
    traced = record->bytes[0];
}

int main(void)
{
    static const mbm_port port = {.read = port_read, .write = port_write, .micros = port_micros};
    static const mbm_framing rtu = {0};
    static uint8_t buffer[2 * MBM_FRAME_BYTES(WORDS)];
#ifndef WITHOUT_MBM
    static mbm_trace trace;
#endif

    USED(&port);
    USED(&rtu);
    USED(&take);
    USED(buffer);
    begin();
    (void)CALL(mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, &rtu, buffer, sizeof buffer, take,
                               NULL));
    (void)CALL(mbm_line_beginRtu(&line, mbm_trace_port(&trace), frame, sizeof frame));
    for (;;) {
        uart = CALL(mbm_node_readHoldingRegisters(&node, 2, 10));
        uart = (uint8_t)response[0];
    }
}
