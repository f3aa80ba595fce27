/* See kernel.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include <zephyr/device.h>

enum uart_config_parity { UART_CFG_PARITY_NONE, UART_CFG_PARITY_ODD, UART_CFG_PARITY_EVEN };
enum uart_config_stop_bits { UART_CFG_STOP_BITS_1 = 1, UART_CFG_STOP_BITS_2 = 3 };
enum uart_config_data_bits { UART_CFG_DATA_BITS_8 = 3 };
enum uart_config_flow_control { UART_CFG_FLOW_CTRL_NONE };

enum uart_rx_stop_reason {
    UART_ERROR_OVERRUN = 1,
    UART_ERROR_PARITY = 2,
    UART_ERROR_FRAMING = 4,
    UART_ERROR_NOISE = 32
};

struct uart_config {
    uint32_t baudrate;
    uint8_t parity;
    uint8_t stop_bits;
    uint8_t data_bits;
    uint8_t flow_ctrl;
};

typedef void (*uart_irq_callback_user_data_t)(const struct device *dev, void *user_data);

int uart_configure(const struct device *dev, const struct uart_config *config);
int uart_config_get(const struct device *dev, struct uart_config *config);
int uart_err_check(const struct device *dev);
#ifdef CONFIG_UART_INTERRUPT_DRIVEN
int uart_irq_callback_user_data_set(const struct device *dev, uart_irq_callback_user_data_t wanted,
                                    void *user_data);
int uart_irq_update(const struct device *dev);
int uart_irq_is_pending(const struct device *dev);
int uart_irq_rx_ready(const struct device *dev);
int uart_irq_tx_ready(const struct device *dev);
int uart_irq_tx_complete(const struct device *dev);
void uart_irq_rx_enable(const struct device *dev);
void uart_irq_tx_enable(const struct device *dev);
void uart_irq_tx_disable(const struct device *dev);
int uart_fifo_read(const struct device *dev, uint8_t *bytes, const int size);
int uart_fifo_fill(const struct device *dev, const uint8_t *bytes, int size);
#endif
