/**
 * @file mbm_esp_idf.h
 * @brief An mbm_port over ESP-IDF's UART driver, for RS-232, TTL levels and RS-485.
 *
 * For ESP-IDF 5.0 and later. A line is used in one task. Any number of lines may be used side
 * by side.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_ESP_IDF_H
#define MBM_ESP_IDF_H

#include "mbm.h"

#include "driver/uart.h"
#include "esp_err.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How the driver of an RS-485 transceiver (its pins DE and /RE) is switched. */
typedef enum mbm_espIdfDriver {
    MBM_ESP_IDF_NO_DRIVER,      /**< not at all: no RS-485, or the transceiver does it itself */
    MBM_ESP_IDF_DRIVER_BY_UART, /**< by the UART, which uses the pin as its RTS */
    MBM_ESP_IDF_DRIVER_BY_PIN   /**< by this port, which sets the pin as a GPIO */
} mbm_espIdfDriver;

/** A serial line. Set all fields but the private ones, and keep it valid while it is used. */
typedef struct mbm_espIdfLine {
    uart_port_t uart;        /**< for example UART_NUM_1 */
    int txPin;               /**< GPIO of the transmitter */
    int rxPin;               /**< GPIO of the receiver */
    int driverPin;           /**< GPIO at DE and /RE; not used with MBM_ESP_IDF_NO_DRIVER */
    mbm_espIdfDriver driver; /**< how that pin is switched */
    int baud;                /**< bits per second */
    uart_parity_t parity;    /**< Modbus's default is UART_PARITY_EVEN */
    uint8_t isOpen;          /**< private */
    int64_t sentAtUs;        /**< private */
} mbm_espIdfLine;

/**
 * Installs the UART driver: 8 data bits, two stop bits without parity, else one.
 *
 * @param line  the settings
 * @param port  receives the port for the begin functions
 * @return ESP_OK; ESP_ERR_INVALID_ARG for NULL; ESP_ERR_INVALID_STATE if the line is open;
 *         or the error of the function of ESP-IDF that failed. Then nothing is left installed.
 */
esp_err_t mbm_espIdf_open(mbm_espIdfLine *line, mbm_port *port);

/** Removes the UART driver. Objects that use the port then report a lost link. Does nothing if
 *  the line is not open. */
void mbm_espIdf_close(mbm_espIdfLine *line);

/**
 * Lets other tasks run, for at most a tick. For a program that polls a client or a server: pass
 * the value that its pollDelay function returned. Does not sleep for less than a tick, so that the
 * driver of the transceiver goes off in time.
 *
 * @param timeoutUs  the longest time to sleep, in microseconds
 */
void mbm_espIdf_wait(uint32_t timeoutUs);

#ifdef __cplusplus
}
#endif

#endif
