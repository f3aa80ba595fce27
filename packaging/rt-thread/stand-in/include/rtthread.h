/* Plays the parts of RT-Thread that mbm's port and example use, with the signatures of RT-Thread
 * 5. Licence: MIT OR Apache-2.0. */
#pragma once

#include "rtconfig.h"
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef long rt_base_t;
typedef unsigned long rt_size_t, rt_ubase_t;
typedef long rt_ssize_t, rt_off_t;
typedef int32_t rt_int32_t;
typedef uint8_t rt_uint8_t;
typedef uint16_t rt_uint16_t;
typedef uint32_t rt_uint32_t, rt_tick_t;
typedef rt_base_t rt_err_t;
typedef int rt_bool_t;
typedef struct rt_device *rt_device_t;

struct rt_device {
    rt_uint8_t ref_count;
};

#define RT_NULL NULL
#define RT_TRUE 1
#define RT_FALSE 0
#define RT_EOK 0
#define RT_ERROR 1
#define RT_ENOSYS 6
#define RT_EBUSY 7
#define RT_EINVAL 10
#define RT_ENOENT 11

#define RT_DEVICE_FLAG_INT_RX 0x100
#define RT_DEVICE_OFLAG_RDWR 0x003
#define RT_DEVICE_FLAG_RX_NON_BLOCKING 0x2000
#define RT_DEVICE_FLAG_TX_BLOCKING 0x4000
#define RT_DEVICE_CTRL_CONFIG 0x03

#define RT_WAITING_FOREVER (-1)

rt_device_t rt_device_find(const char *name);
rt_err_t rt_device_open(rt_device_t device, rt_uint16_t flags);
rt_err_t rt_device_close(rt_device_t device);
rt_err_t rt_device_control(rt_device_t device, int command, void *argument);
rt_ssize_t rt_device_read(rt_device_t device, rt_off_t position, void *bytes, rt_size_t size);
rt_ssize_t rt_device_write(rt_device_t device, rt_off_t position, const void *bytes,
                           rt_size_t size);

rt_err_t rt_device_set_rx_indicate(rt_device_t device,
                                   rt_err_t (*indicate)(rt_device_t device, rt_size_t size));

rt_tick_t rt_tick_get(void);
rt_err_t rt_thread_delay(rt_tick_t ticks);
rt_err_t rt_thread_mdelay(rt_int32_t milliseconds);

#define rt_kprintf printf

#define MSH_CMD_EXPORT(name, text) int (*const stand_in_command)(int, char **) = name
