/**
 * @file mbm_zephyr.h
 * @brief An mbm_port over Zephyr's interrupt-driven UART API, for RS-232, TTL levels and RS-485.
 *
 * For Zephyr 3.4 and later, with CONFIG_MBM and CONFIG_MBM_UART. A line is used in one thread.
 * Any number of lines may be used side by side.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_ZEPHYR_H
#define MBM_ZEPHYR_H

#include "mbm.h"

#include <stdbool.h>
#include <zephyr/drivers/gpio.h>
#include <zephyr/drivers/uart.h>
#include <zephyr/kernel.h>

#ifdef __cplusplus
extern "C" {
#endif

/**
 * The first fields of a line from the devicetree's node of its UART, for example
 * MBM_ZEPHYR_UART(DT_ALIAS(modbus_line)).
 */
#define MBM_ZEPHYR_UART(node)                                                                      \
    .uart = DEVICE_DT_GET(node), .currentSpeed = DT_PROP_OR(node, current_speed, 0)

/** A serial line. Set the public fields, zero the others, and keep it valid while it is used. */
typedef struct mbm_zephyrLine {
    const struct device *uart;  /**< MBM_ZEPHYR_UART sets it */
    struct gpio_dt_spec driver; /**< the pin at DE and /RE of an RS-485 transceiver; zero if none */
    uint32_t currentSpeed;      /**< the rate that the devicetree gives the UART; 0 if unknown.
                                     MBM_ZEPHYR_UART sets it. It counts only for a UART that
                                     cannot be configured at run time */
    uint32_t baud;              /**< bits per second; see mbm_zephyr_open */
    uint8_t parity;             /**< UART_CFG_PARITY_EVEN, Modbus's default, _ODD or _NONE */

    volatile uint16_t faulty;   /**< framing, parity and noise errors, at most one for each look at
                                     the UART. Only of a driver that has uart_err_check */
    volatile uint16_t overruns; /**< overruns: characters were lost in the UART. As `faulty` */
    volatile uint16_t stalled;  /**< frames that did not leave, and were given up */

    mbm_ring ring;                        /**< private: received bytes */
    uint8_t ringBytes[MBM_MAX_FRAME + 1]; /**< private */
    uint8_t toSend[MBM_MAX_FRAME];        /**< private */
    volatile uint16_t next;               /**< private: the first byte that is not in the FIFO */
    volatile uint16_t end;                /**< private: the end of the bytes to send */
    volatile bool isSending;              /**< private */
    volatile bool hasFailed;              /**< private: the next hook says so */
    bool isUnsure;                        /**< private: the FIFO may have bytes of a frame that was
                                               given up */
    bool isStuck;                         /**< private: the pin did not go off */
    int errors;                           /**< private: those of the last look */
    uint32_t beganAtCycles;               /**< private */
    uint32_t lastsCycles;                 /**< private */
    uint32_t beganAtMs;                   /**< private */
    uint32_t longestMs;                   /**< private */
    struct k_spinlock lock;               /**< private: of the interrupt and the thread */
    struct k_sem received;                /**< private */
} mbm_zephyrLine;

/**
 * Prepares UART and pin, and begins all counters at 0: 8 data bits, two stop bits without parity,
 * else one.
 *
 * A UART without runtime configuration keeps the rate and the format of the devicetree: one whose
 * driver lacks uart_configure, as that of qemu_cortex_m3 does, and every UART without
 * CONFIG_UART_USE_RUNTIME_CONFIGURE. If they are known to differ from those of the line, printk
 * says so, and `baud` becomes the devicetree's rate. So give the object `baud`, not a number.
 *
 * A frame that takes more than twice its time and 50 ms is given up: requests and polls return
 * MBM_LINK_LOST once. So they do while the pin cannot be set.
 *
 * @param line  the settings
 * @param port  receives the port for the begin functions
 * @return 0; -EINVAL for NULL, a rate of 0 or a frame that is being sent; -ENODEV if a device is
 *         not ready; or the error of the function of Zephyr that failed
 */
int mbm_zephyr_open(mbm_zephyrLine *line, mbm_port *port);

/**
 * Sleeps until bytes arrive or a time is over. For a program that polls a client or a server: pass
 * the value that its pollDelay function returned. Does not sleep for a last tick or two, so that
 * the driver goes off in time.
 *
 * @param line       the line, open
 * @param timeoutUs  the longest time to sleep, in microseconds; the sleep may be shorter
 */
void mbm_zephyr_wait(mbm_zephyrLine *line, uint32_t timeoutUs);

/**
 * Returns how many received bytes found no place because the thread read too late. What the UART
 * loses by itself is in `overruns`.
 *
 * @return bytes since mbm_zephyr_open
 */
uint16_t mbm_zephyr_lost(const mbm_zephyrLine *line);

#ifdef __cplusplus
}
#endif

#endif
