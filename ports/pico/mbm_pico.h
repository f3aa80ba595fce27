/**
 * @file mbm_pico.h
 * @brief An mbm_port over a UART or the USB of a Raspberry Pi Pico, with pico-sdk 2.
 *
 * Each line is used by the core that opened it: its interrupt runs there too. The other core may
 * have lines of its own. The USB belongs to the core that calls tusb_init.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_PICO_H
#define MBM_PICO_H

#include "mbm.h"

#include <stdbool.h>

#include "hardware/uart.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A UART. Set the public fields, zero the others, and keep it valid while it is used. */
typedef struct mbm_picoUart {
    uart_inst_t *uart;    /**< uart0 or uart1 */
    uint32_t baud;        /**< bits per second */
    uart_parity_t parity; /**< UART_PARITY_EVEN, Modbus's default, _ODD or _NONE */
    uint8_t txPin;        /**< the GPIO that sends, for example 4 for uart1 */
    uint8_t rxPin;        /**< the GPIO that receives, for example 5 for uart1 */
    uint8_t driverPin;    /**< the GPIO at DE and /RE of an RS-485 transceiver, if hasDriver */
    bool hasDriver;       /**< switches driverPin */

    volatile uint16_t overruns; /**< how often the FIFO was full and characters were lost */
    volatile uint16_t faulty;   /**< characters with a wrong stop bit or parity, and breaks */
    uint16_t stalled;           /**< frames that did not leave in their time, and were dropped */

    mbm_ring ring;                        /**< private: received bytes */
    uint8_t ringBytes[MBM_MAX_FRAME + 1]; /**< private */
    uint8_t toSend[MBM_MAX_FRAME];        /**< private */
    volatile uint16_t next;               /**< private: the first byte that is not in the FIFO */
    volatile uint16_t end;                /**< private: the end of the bytes to send */
    uint32_t sentAt, sendingTime;         /**< private */
    bool hasFailed;                       /**< private */
} mbm_picoUart;

/**
 * Prepares UART and pins: 8 data bits, two stop bits without parity, else one.
 *
 * @param line  the settings
 * @param port  receives the port for the begin functions
 * @return MBM_OK; MBM_INVALID_ARGUMENT for NULL, a rate of 0 or that the UART cannot have from its
 * clock, 119 to 7 812 500 at 125 MHz, or a GPIO above 29; MBM_BUSY while a frame is being sent
 */
uint8_t mbm_picoUart_open(mbm_picoUart *line, mbm_port *port);

/**
 * Returns how many received bytes found no place in the ring because the program read too late.
 * `overruns` counts what the FIFO lost.
 *
 * @return bytes since mbm_picoUart_open
 */
uint16_t mbm_picoUart_lost(const mbm_picoUart *line);

/** A serial port of the USB, by TinyUSB's class CDC. Zero it, or set the public fields. */
typedef struct mbm_picoUsb {
    uint8_t number;  /**< which serial port, if there are several: 0 is the first */
    bool hasOwnTask; /**< the program calls tud_task itself; otherwise every read does */

    uint16_t stalled; /**< responses and requests that the host did not read, and were dropped */

    bool wasOpen, hasFailed; /**< private */
    uint32_t space, since;   /**< private */
} mbm_picoUsb;

/**
 * Prepares the port. Begin with RTU over TCP on it: silence separates no frames there. The link is
 * lost while the cable is out, and once when a program on the host closes the port. Begin a server
 * again then.
 *
 * @param usb   the settings
 * @param port  receives the port for the begin functions
 * @return MBM_OK; MBM_INVALID_ARGUMENT for NULL or a serial port that TinyUSB does not have
 */
uint8_t mbm_picoUsb_open(mbm_picoUsb *usb, mbm_port *port);

#ifdef __cplusplus
}
#endif

#endif
