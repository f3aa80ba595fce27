/* The hooks that nanoMODBUS asks for: they wait until all bytes are there, or the time is over. */
#ifndef NANO_HOOKS_H
#define NANO_HOOKS_H

#include "nanomodbus.h"
#include "wire.h"

#include <stddef.h>

static int32_t hook_read(uint8_t *bytes, uint16_t count, int32_t timeout_ms, void *context)
{
    const uint32_t begun = wire_micros(context);
    uint16_t done = 0;

    while (done < count) {
        done =
            (uint16_t)(done + (uint16_t)wire_read(context, bytes + done, (uint16_t)(count - done)));
        if (timeout_ms >= 0 && wire_micros(context) - begun >= (uint32_t)timeout_ms * 1000u)
            break;
    }
    return done;
}

static int32_t hook_write(const uint8_t *bytes, uint16_t count, int32_t timeout_ms, void *context)
{
    (void)timeout_ms;
    return wire_write(context, bytes, count);
}

static inline void begin_nano(nmbs_platform_conf *conf)
{
    nmbs_platform_conf_create(conf);
    conf->transport = NMBS_TRANSPORT_RTU;
    conf->read = hook_read;
    conf->write = hook_write;
}

#endif
