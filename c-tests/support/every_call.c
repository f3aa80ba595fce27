#include "every_call.h"
#include "test.h"

void every_node_request_returns(uint8_t status, mbm_node *n)
{
    IS(status, mbm_node_readCoils(n, 0, 1));
    IS(status, mbm_node_readDiscreteInputs(n, 0, 1));
    IS(status, mbm_node_readHoldingRegisters(n, 0, 1));
    IS(status, mbm_node_readInputRegisters(n, 0, 1));
    IS(status, mbm_node_writeSingleCoil(n, 3, 1));
    IS(status, mbm_node_writeSingleRegister(n, 3, 0x9999));
    IS(status, mbm_node_writeMultipleCoils(n, 3, 1));
    IS(status, mbm_node_writeQueuedCoils(n));
    IS(status, mbm_node_writeMultipleRegisters(n, 3, 1));
    IS(status, mbm_node_writeQueuedRegisters(n));
    IS(status, mbm_node_maskWriteRegister(n, 3, 1, 2));
    IS(status, mbm_node_readWriteMultipleRegisters(n, 0, 1, 3, 1));
    IS(status, mbm_node_readWriteQueuedRegisters(n, 0, 1));
}

void every_line_call_returns(uint8_t status, mbm_line *l)
{
    mbm_counters counters;

    IS(status, mbm_line_cancel(l));
    IS(status, mbm_line_setBaudRate(l, 9600));
    IS(status, mbm_line_setGap(l, 1));
    IS(status, mbm_line_setTurnaroundDelay(l, 1));
    IS(status, mbm_line_setQuietTime(l, 1));
    IS(status, mbm_line_setRetries(l, 1));
    IS(status, mbm_line_setEchoDiscard(l, 1));
    IS(status, mbm_line_setPostFlushHold(l, 1));
    IS(status, mbm_line_setCounters(l, &counters));
    IS(status, mbm_line_setCounters(l, NULL));
    IS(status, mbm_line_used(l));
    IS(status, mbm_line_usedAt(l, 0));
}

static uint32_t random_number(void *context)
{
    return 7;
}

void every_client_setting_returns(uint8_t status, mbm_client *c)
{
    IS(status, mbm_client_setResponseTimeout(c, 5));
    IS(status, mbm_client_setBaudRate(c, 19200));
    IS(status, mbm_client_setGap(c, 1));
    IS(status, mbm_client_setTurnaroundDelay(c, 1));
    IS(status, mbm_client_setQuietTime(c, 1));
    IS(status, mbm_client_setEchoDiscard(c, 0));
    IS(status, mbm_client_setPostFlushHold(c, 0));
    IS(status, mbm_client_setRetries(c, 0));
    IS(status, mbm_client_setBusyRetries(c, 0, 1));
    IS(status, mbm_client_setBackoff(c, 0, 1, 1));
    IS(status, mbm_client_setJitter(c, 1, random_number, NULL));
    IS(status, mbm_client_setCounters(c, NULL));
    IS(status, mbm_client_setUnits(c, NULL, 0));
    IS(status, mbm_client_setInFlight(c, 1));
}

#define RETURNS(call)                                                                              \
    do {                                                                                           \
        IS(status, call);                                                                          \
        if (status == MBM_PENDING)                                                                 \
            OK(mbm_client_cancel(c, r));                                                           \
    } while (0)

void every_client_request_returns(uint8_t status, mbm_client *c, mbm_clientRequest *r)
{
    static const mbm_rule silence = {.kind = MBM_RULE_SILENCE};
    static const uint8_t byte;

    RETURNS(mbm_client_readCoils(c, r, 0, 1));
    RETURNS(mbm_client_readDiscreteInputs(c, r, 0, 1));
    RETURNS(mbm_client_readHoldingRegisters(c, r, 0, 1));
    RETURNS(mbm_client_readInputRegisters(c, r, 0, 1));
    RETURNS(mbm_client_writeSingleCoil(c, r, 0, 1));
    RETURNS(mbm_client_writeSingleRegister(c, r, 0, 1));
    RETURNS(mbm_client_writeMultipleCoils(c, r, 0, 1));
    RETURNS(mbm_client_writeMultipleRegisters(c, r, 0, 1));
    RETURNS(mbm_client_maskWriteRegister(c, r, 0, 1, 1));
    RETURNS(mbm_client_readWriteMultipleRegisters(c, r, 0, 1, 0, 1));
    RETURNS(mbm_client_readExceptionStatus(c, r));
    RETURNS(mbm_client_diagnostics(c, r, 0, 1));
    RETURNS(mbm_client_getCommEventCounter(c, r));
    RETURNS(mbm_client_getCommEventLog(c, r));
    RETURNS(mbm_client_reportServerId(c, r));
    RETURNS(mbm_client_readFileRecord(c, r, 1, 0, 1));
    RETURNS(mbm_client_writeFileRecord(c, r, 1, 0, 1));
    RETURNS(mbm_client_readFileRecords(c, r, 7));
    RETURNS(mbm_client_writeFileRecords(c, r, 9));
    RETURNS(mbm_client_readFifoQueue(c, r, 0));
    RETURNS(mbm_client_readDeviceIdentification(c, r, 1, 0));
    RETURNS(mbm_client_encapsulatedInterfaceTransport(c, r, MBM_MEI_CANOPEN, 1));
    RETURNS(mbm_client_custom(c, r, 65, 1, &silence));
    RETURNS(mbm_client_forward(c, r, 65, &byte, 1));
}

uint8_t client_begin(mbm_client *c, unsigned framing, const mbm_port *port, uint8_t *incoming,
                     uint16_t in, uint8_t *outgoing, uint16_t out)
{
    switch (framing) {
    case MBM_FRAMING_RTU: return mbm_client_beginRtu(c, port, incoming, in);
    case MBM_FRAMING_ASCII: return mbm_client_beginAscii(c, port, incoming, in);
    case MBM_FRAMING_TCP: return mbm_client_beginTcp(c, port, incoming, in, outgoing, out);
    default: return mbm_client_beginRtuOverTcp(c, port, incoming, in);
    }
}

uint8_t server_begin(mbm_server *s, unsigned framing, const mbm_port *port, mbm_unit *units,
                     uint8_t count, uint8_t *frame, uint16_t bytes)
{
    switch (framing) {
    case MBM_FRAMING_RTU: return mbm_server_beginRtu(s, port, units, count, frame, bytes);
    case MBM_FRAMING_ASCII: return mbm_server_beginAscii(s, port, units, count, frame, bytes);
    case MBM_FRAMING_TCP: return mbm_server_beginTcp(s, port, units, count, frame, bytes);
    default: return mbm_server_beginRtuOverTcp(s, port, units, count, frame, bytes);
    }
}
