/* See kernel.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include <zephyr/device.h>

typedef uint8_t gpio_pin_t;
typedef uint16_t gpio_dt_flags_t;
typedef uint32_t gpio_flags_t;

struct gpio_dt_spec {
    const struct device *port;
    gpio_pin_t pin;
    gpio_dt_flags_t dt_flags;
};

#define GPIO_OUTPUT_INACTIVE (1u << 17 | 1u << 18)

#define GPIO_DT_SPEC_GET_OR(node, property, otherwise) GPIO_SPEC_OF(node, property)
#define GPIO_SPEC_OF(node, property) node##_##property
#define stand_in_path_zephyr_user_modbus_driver_gpios                                              \
    {                                                                                              \
        .port = &stand_in_gpio, .pin = STAND_IN_PIN, .dt_flags = STAND_IN_FLAGS                    \
    }

int gpio_pin_configure_dt(const struct gpio_dt_spec *pin, gpio_flags_t flags);
int gpio_pin_set_dt(const struct gpio_dt_spec *pin, int value);
