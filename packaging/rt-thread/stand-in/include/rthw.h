/* See rtthread.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include <rtthread.h>

void rt_hw_us_delay(rt_uint32_t micros);
