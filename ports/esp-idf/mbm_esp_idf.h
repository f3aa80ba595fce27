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

/** A serial line. Set the first fields, zero the others, and keep it valid while it is used. The
 *  driver of its UART is this port's alone: do not delete it or install it again. */
typedef struct mbm_espIdfLine {
    uart_port_t uart;        /**< for example UART_NUM_1 */
    int txPin;               /**< GPIO of the transmitter */
    int rxPin;               /**< GPIO of the receiver */
    int driverPin;           /**< GPIO at DE and /RE; not used with MBM_ESP_IDF_NO_DRIVER */
    mbm_espIdfDriver driver; /**< how that pin is switched */
    int baud;                /**< bits per second */
    uart_parity_t parity;    /**< Modbus's default is UART_PARITY_EVEN */
    int stopBits;            /**< 0: two without parity, else one, as the standard has it; or
                                  UART_STOP_BITS_1, as in 8N1 */

    uint16_t overruns; /**< how often characters were lost: the FIFO was full, because the buffer
                            was or because the UART's interrupt was late. It counts too when the
                            driver had made 256 events, one for each character, since the last
                            read: it may have dropped one that says so */
    uint16_t faulty;   /**< characters with a wrong stop bit or parity. A receiver's output that
                            floats while the transceiver sends makes some too */
    uint16_t stalled;  /**< frames that did not leave, and were given up */

    QueueHandle_t events; /**< private */
    uint8_t isOpen;       /**< private */
    int64_t sentAtUs;     /**< private */
} mbm_espIdfLine;

/**
 * Installs the UART driver, with 8 data bits. It takes some 6 kB of the heap.
 *
 * The counters begin at 0 and wrap at 65536; each hook of the port may change them.
 *
 * A frame that does not leave, because of CTS or a clock that stands still, is given up and never
 * leaves later: when the request ends, with MBM_LINE_BUSY, or, of a server's response, three
 * seconds after its time. For that the port installs the driver again; make settings of your own,
 * such as flow control, again when `stalled` has grown. While that fails for lack of memory, the
 * link is lost (MBM_LINK_LOST), and each request and poll tries again.
 *
 * @param line  the settings
 * @param port  receives the port for the begin functions
 * @return ESP_OK; ESP_ERR_INVALID_ARG for NULL, a rate of 0 or less, or a driver's pin that is
 *         not there; ESP_ERR_INVALID_STATE if the line is open; or the error of the function of
 *         ESP-IDF that failed. Then nothing is left installed, and nothing has changed.
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
