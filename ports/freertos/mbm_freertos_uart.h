/**
 * @file mbm_freertos_uart.h
 * @brief An mbm_port over a UART with interrupts in FreeRTOS, for RS-232, TTL levels and RS-485.
 *
 * Your code has the registers of the UART, in one function and one interrupt; this file has the
 * rest: a ring for received bytes, a buffer for the frame that leaves, the sleep and the driver
 * pin.
 *
 *     static uint8_t received[MBM_MAX_FRAME + 1], toSend[MBM_MAX_FRAME];
 *     static mbm_freertosUart uart = {.baud = 19200, .startSending = enable_transmit_interrupt,
 *                                     .received = received, .receivedBytes = sizeof received,
 *                                     .toSend = toSend, .toSendBytes = sizeof toSend};
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_FREERTOS_UART_H
#define MBM_FREERTOS_UART_H

#include "mbm_freertos.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A serial line. Set the public fields, zero the others, and keep it valid while it is used. */
typedef struct mbm_freertosUart {
    mbm_freertosLine line; /**< for mbm_freertos_take, mbm_freertos_give and mbm_freertos_wait */
    void *context;         /**< your pointer, passed to the two functions; may be NULL */
    /** Begins to send: lets the UART's interrupt call mbm_freertos_nextFromISR for the first byte.
     *  Called in the task. */
    void (*startSending)(void *context);
    /** NULL, or switches the driver of an RS-485 transceiver: `on` 1 before the first byte, in the
     *  task; 0 after the last bit, in the interrupt that calls mbm_freertos_sentFromISR. Returns 1;
     *  0 if the pin did not change. Then requests end with MBM_LINK_LOST, and a pin that did not go
     *  off is switched off again in the task, until it is. */
    uint8_t (*setDriver)(void *context, uint8_t on);
    uint32_t baud;          /**< bits per second */
    uint8_t *received;      /**< storage of the ring: for a server and a client MBM_MAX_FRAME + 1 */
    uint16_t receivedBytes; /**< bytes of it, 2 or more. The ring holds one byte less */
    uint8_t *toSend;        /**< storage of the frame that leaves */
    uint16_t toSendBytes;   /**< bytes of it: the longest frame that is sent. A longer one leaves
                                 with gaps */
    uint8_t hasNoSentInterrupt; /**< 1 if no interrupt says that the last bit has left, so that
                                     mbm_freertos_sentFromISR comes while the last byte leaves. Then
                                     the driver goes off in the task: give its line a post-flush
                                   hold (mbm_line_setPostFlushHold) */
    volatile uint8_t isOpen;    /**< private */
    volatile uint8_t isSending; /**< private */
    volatile uint8_t isStuck;   /**< private: the pin did not go off */
    uint8_t hasFailed;          /**< private: the next hook says so */
    volatile uint16_t next;     /**< private */
    volatile uint16_t end;      /**< private */
    volatile uint16_t overruns; /**< private */
    TickType_t beganAt;         /**< private */
    uint16_t stalled;           /**< private */
    mbm_ring ring;              /**< private */
} mbm_freertosUart;

/**
 * Opens the line. May be called before the scheduler starts; requests may not. Enable the UART's
 * interrupt afterwards, with a priority at which FreeRTOS's functions may be called
 * (configMAX_SYSCALL_INTERRUPT_PRIORITY or less urgent).
 *
 * The clock of the port is FreeRTOS's tick. A finer one of yours may take its place:
 * `port.micros = your_clock`.
 *
 * @param uart  the settings
 * @param port  receives the port for the begin functions. It uses `uart`
 * @return MBM_OK; MBM_INVALID_ARGUMENT for NULL, a rate of 0, no `startSending`, or storage that is
 * too small; MBM_BUSY if the line is open; MBM_LINK_LOST if `setDriver` cannot switch the pin off
 */
uint8_t mbm_freertos_open(mbm_freertosUart *uart, mbm_port *port);

/** Closes the line, in any task, and wakes the task that waits for it. Objects that use the port
 * then report a lost link (MBM_LINK_LOST), until it is opened again. Does nothing if the line is
 * not open. */
void mbm_freertos_close(mbm_freertosUart *uart);

/**
 * Takes received bytes from the interrupt of the UART or of its DMA.
 *
 * @param bytes   the bytes; NULL only if `length` is 0
 * @param length  the number of bytes
 * @param woken   see mbm_freertos_wakeFromISR
 */
void mbm_freertos_receivedFromISR(mbm_freertosUart *uart, const uint8_t *bytes, uint16_t length,
                                  BaseType_t *woken);

/**
 * Returns the next byte to send, for the interrupt that says that the UART accepts one.
 *
 * @param byte  receives the byte
 * @return 1; 0 if no byte is left: disable this interrupt, and enable that of the last bit
 */
uint8_t mbm_freertos_nextFromISR(mbm_freertosUart *uart, uint8_t *byte);

/** Switches the driver off and wakes the task: the last bit has left, in the interrupt that says
 * so. Does nothing while bytes are left. */
void mbm_freertos_sentFromISR(mbm_freertosUart *uart, BaseType_t *woken);

/** Counts a byte that the UART has lost: its overrun interrupt or flag. */
void mbm_freertos_overrunFromISR(mbm_freertosUart *uart);

/**
 * Returns how many received bytes were lost, because the ring was full or by overruns of the UART.
 *
 * @return bytes since mbm_freertos_open; it wraps at 65536. 0 for NULL
 */
uint16_t mbm_freertos_lost(const mbm_freertosUart *uart);

/**
 * Returns how many frames did not leave: the UART is not started, or its interrupt is not enabled.
 * What is left of such a frame is given up: when the request ends (MBM_LINE_BUSY), or, of a
 * server's response, three seconds after its time. It never leaves later.
 *
 * @return frames since mbm_freertos_open; it wraps at 65536. 0 for NULL
 */
uint16_t mbm_freertos_stalled(const mbm_freertosUart *uart);

/** A `flush` of the port that does not sleep, for a task that polls several lines:
 *  `port.flush = mbm_freertos_isSent`. Returns 1 once the last bit has left. */
uint8_t mbm_freertos_isSent(void *context);

#ifdef __cplusplus
}
#endif

#endif
