/* A server of the device of device.yaml on a serial line: with the tables and functions that mbm
 * header writes, or with BY_HAND as one writes them. */
#define DEVICE_SERVER
#ifdef BY_HAND
#include "mbm.h"

#include <string.h>

enum { FIRST = 100, READ_ONLY = 102, DEVICE_MODE_AUTOMATIC = 1 };

static uint16_t inputs[8], holding[3];
static uint8_t coils[1], discrete[1];
static mbm_registerTable input_table = {.words = inputs, .size = 8};
static mbm_registerTable holding_table = {.words = holding, .base = FIRST, .size = 3};
static mbm_bitTable coil_table = {.bits = coils, .size = 1};
static mbm_bitTable discrete_table = {.bits = discrete, .size = 1};

/* The last register is read-only. */
static uint8_t before_write(void *context, const mbm_access *access)
{
    (void)context;
    return access->address + access->quantity > READ_ONLY ? MBM_ILLEGAL_DATA_ADDRESS : MBM_OK;
}

static const mbm_accessHooks hooks = {.beforeWrite = before_write};

static void device_serve(mbm_unit *of)
{
    (void)mbm_unit_serveCoils(of, &coil_table);
    (void)mbm_unit_serveDiscreteInputs(of, &discrete_table);
    (void)mbm_unit_serveHoldingRegisters(of, &holding_table);
    (void)mbm_registerTable_setHooks(&holding_table, &hooks);
    (void)mbm_unit_serveInputRegisters(of, &input_table);
}

static void device_set_voltage_1(uint16_t value)
{
    inputs[0] = value;
}

static void device_set_voltage_2(uint16_t value)
{
    inputs[1] = value;
}

static void device_set_power(int32_t value)
{
    inputs[2] = (uint16_t)((uint32_t)value >> 16);
    inputs[3] = (uint16_t)value;
}

static void device_set_energy(uint32_t value)
{
    inputs[4] = (uint16_t)value;
    inputs[5] = (uint16_t)(value >> 16);
}

static void device_set_frequency(float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    inputs[6] = (uint16_t)(bits >> 16);
    inputs[7] = (uint16_t)bits;
}

static int16_t device_get_setpoint(void)
{
    return (int16_t)holding[0];
}

static uint16_t device_get_mode(void)
{
    return holding[1];
}

static void device_set_version(uint16_t value)
{
    holding[2] = value;
}

static uint8_t device_get_relay(void)
{
    return coils[0] & 1;
}

static void device_set_alarm(uint8_t on)
{
    if (on)
        discrete[0] |= 1;
    else
        discrete[0] &= (uint8_t)~1;
}
#else
#include "device.h"
#endif

#include "size.h"

static mbm_server server;
static mbm_unit unit = {.id = 17};

int main(void)
{
    static const mbm_port port = {.read = port_read, .write = port_write, .micros = port_micros};

    USED(&port);
    (void)device_serve(&unit);
    (void)mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame);
    device_set_version(7);
    for (;;) {
        const uint32_t sample = ticks;
        float hertz;

        memcpy(&hertz, &sample, sizeof hertz);
        uart = mbm_server_poll(&server);
        device_set_voltage_1((uint16_t)sample);
        device_set_voltage_2((uint16_t)(sample + 1));
        device_set_power((int32_t)(sample - 2));
        device_set_energy(sample);
        device_set_frequency(hertz);
        device_set_alarm(device_get_setpoint() < 0);
        if (device_get_mode() == DEVICE_MODE_AUTOMATIC && device_get_relay())
            ticks = 0;
    }
}
