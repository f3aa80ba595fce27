/* See kernel.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include "devicetree.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct device {
    const char *name;
};

extern const struct device stand_in_uart, stand_in_gpio;

/* The only alias and node whose devices the sample uses. */
#define DT_ALIAS(name) stand_in_alias_##name
#define DT_PATH(name) stand_in_path_##name
#define DEVICE_DT_GET(node) DEVICE_OF(node)
#define DEVICE_OF(node) (&node##_device)
#define stand_in_alias_modbus_line_device stand_in_uart

/* The only property that a line reads. */
#define DT_PROP_OR(node, property, otherwise) PROPERTY_OF(node, property)
#define PROPERTY_OF(node, property) node##_##property
#define stand_in_alias_modbus_line_current_speed STAND_IN_CURRENT_SPEED

bool device_is_ready(const struct device *device);
