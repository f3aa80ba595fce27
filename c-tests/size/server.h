/* What the measured servers share: four arrays of 64 registers or bits. */
#ifndef SIZE_SERVER_H
#define SIZE_SERVER_H

#include "size.h"

static uint16_t holding_words[WORDS];
static uint16_t input_words[WORDS];
static uint8_t coil_bits[WORDS / 8];
static uint8_t input_bits[WORDS / 8];

#ifndef WITHOUT_MBM
static mbm_server server;
static mbm_unit unit;
static mbm_registerTable holding, inputs;
static mbm_bitTable coils, discrete;
#endif

static inline void serve(void)
{
    mbm_port port = {0};

    port.read = port_read;
    port.write = port_write;
    port.micros = port_micros;
    USED(&port);
    USED(holding_words);
    USED(input_words);
    USED(coil_bits);
    USED(input_bits);
    USED(frame);
#ifndef WITHOUT_MBM
    unit.id = 17;
    holding.words = holding_words;
    holding.size = WORDS;
    inputs.words = input_words;
    inputs.size = WORDS;
    coils.bits = coil_bits;
    coils.size = WORDS;
    discrete.bits = input_bits;
    discrete.size = WORDS;
    (void)mbm_unit_serveHoldingRegisters(&unit, &holding);
    (void)mbm_unit_serveInputRegisters(&unit, &inputs);
    (void)mbm_unit_serveCoils(&unit, &coils);
    (void)mbm_unit_serveDiscreteInputs(&unit, &discrete);
    (void)mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame);
#endif
}

#endif
