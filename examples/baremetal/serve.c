/* A Modbus server on a board without an operating system: four arrays. A write to the holding
 * registers or coils also changes the input registers or discrete inputs. Licence: MIT OR
 * Apache-2.0. */
#include "serve.h"
#include "board.h"
#include "mbm.h"

static mbm_server server = MBM_INIT;
static mbm_unit unit = MBM_INIT;
static uint8_t frame[MBM_MAX_FRAME];

static uint16_t holding_words[SERVE_CELLS], input_words[SERVE_CELLS];
static uint8_t coil_bits[(SERVE_CELLS + 7) / 8], input_bits[(SERVE_CELLS + 7) / 8];
static mbm_registerTable holding = MBM_INIT, inputs = MBM_INIT;
static mbm_bitTable coils = MBM_INIT, discrete = MBM_INIT;

/* Refuses a write if one of its values is too high. */
static uint8_t registers_before(void *context, const mbm_access *access)
{
    const uint8_t *data = access->data;
    uint16_t left;

    (void)context;
    for (left = access->quantity; left > 0u; left--, data += 2) {
        if ((data[0] << 8 | data[1]) > SERVE_MOST) {
            return MBM_ILLEGAL_DATA_VALUE;
        }
    }
    return 0;
}

static void registers_written(void *context, const mbm_access *access)
{
    uint16_t i, first = access->address - SERVE_BASE;

    (void)context;
    for (i = first; i < first + access->quantity; i++) {
        input_words[i] = (uint16_t)~holding_words[i];
    }
}

static void coils_written(void *context, const mbm_access *access)
{
    uint16_t i;

    (void)context;
    (void)access;
    for (i = 0; i < sizeof coil_bits; i++) {
        input_bits[i] = (uint8_t)~coil_bits[i];
    }
}

static uint8_t is_over(void)
{
    const uint16_t end = SERVE_END - SERVE_BASE;

    /* The response to the write that ends the program must be sent first. */
    return ((coil_bits[end / 8u] >> (end % 8u)) & 1u) != 0u &&
           mbm_server_pollDelay(&server) == UINT32_MAX;
}

static void fill(void)
{
    static const mbm_accessHooks register_hooks = {.beforeWrite = registers_before,
                                                   .afterWrite = registers_written};
    static const mbm_accessHooks coil_hooks = {.afterWrite = coils_written};

    holding.words = holding_words;
    holding.base = SERVE_BASE;
    holding.size = SERVE_CELLS;
    (void)mbm_registerTable_setHooks(&holding, &register_hooks);
    inputs.words = input_words;
    inputs.base = SERVE_BASE;
    inputs.size = SERVE_CELLS;
    coils.bits = coil_bits;
    coils.base = SERVE_BASE;
    coils.size = SERVE_CELLS;
    (void)mbm_bitTable_setHooks(&coils, &coil_hooks);
    discrete.bits = input_bits;
    discrete.base = SERVE_BASE;
    discrete.size = SERVE_CELLS;
}

int main(void)
{
    mbm_port port = {0};
    uint8_t status = MBM_OK;

    uart_start();
    clock_start();

    port.read = uart_read;
    port.write = uart_write;
    port.micros = clock_micros;
    port.flush = uart_flush;

    fill();
    unit.id = SERVE_UNIT;
    (void)mbm_unit_serveHoldingRegisters(&unit, &holding);
    (void)mbm_unit_serveInputRegisters(&unit, &inputs);
    (void)mbm_unit_serveCoils(&unit, &coils);
    (void)mbm_unit_serveDiscreteInputs(&unit, &discrete);
    (void)mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame);
    (void)mbm_server_setSilence(&server, SERVE_SILENCE);
    console_print("serving\n");
    while (status == MBM_OK && !is_over()) {
        status = mbm_server_poll(&server);
    }
    return status;
}
