/**
 * @file mbm_stm32.h
 * @brief An mbm_port over a UART of ST's HAL for STM32, for RS-232, TTL levels, RS-485 and a single
 * wire.
 *
 * CubeMX configures the UART. The line takes what is linked to its handle: reception by a circular
 * DMA, or else by interrupt; transmission by a DMA, or else by interrupt. In each case the UART's
 * global interrupt is needed.
 *
 * The port lives beside your own callbacks. With USE_HAL_UART_REGISTER_CALLBACKS at 1 it registers
 * its own for this UART. Else add mbm_stm32_callbacks.c to your project, or, if your program has
 * some of these callbacks already, call from them:
 *
 * in HAL's callback           | call
 * ----------------------------|-----
 * HAL_UART_TxCpltCallback     | mbm_stm32_noteTransmitted(huart)
 * HAL_UART_RxCpltCallback     | mbm_stm32_noteReceived(huart)
 * HAL_UARTEx_RxEventCallback  | mbm_stm32_noteReceived(huart)
 * HAL_UART_ErrorCallback      | mbm_stm32_noteError(huart)
 *
 * These do nothing for a UART without a line. A line is used in one thread. Any number of lines
 * may be used side by side.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_STM32_H
#define MBM_STM32_H

#include "mbm.h"

/* CubeMX's main.h includes the HAL of the chip's family. MBM_STM32_HAL may name another header,
 * for example "stm32f4xx_hal.h". */
#ifdef MBM_STM32_HAL
#include MBM_STM32_HAL
#else
#include "main.h"
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** Bytes of the receive buffer: how much may arrive while the main loop is away. */
#ifndef MBM_STM32_RECEIVE_BYTES
#define MBM_STM32_RECEIVE_BYTES 512
#endif
/** Bytes of the send buffer. Less than MBM_MAX_FRAME may tear a frame apart. */
#ifndef MBM_STM32_SEND_BYTES
#define MBM_STM32_SEND_BYTES MBM_MAX_FRAME
#endif

/** 0 leaves out the code for DMAs: some 2 kB, with that of the HAL. */
#ifndef MBM_STM32_BY_DMA
#define MBM_STM32_BY_DMA 1
#endif

/* A cache line of a Cortex-M7 must have no other variable beside a buffer of the DMA. */
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
#define MBM_STM32_ALIGNED __attribute__((aligned(32)))
#else
#define MBM_STM32_ALIGNED
#endif

/** What mbm_stm32_open returns; mbm_stm32_text has a sentence for each. */
enum {
    MBM_STM32_OK,
    MBM_STM32_NULL,         /**< a pointer is NULL */
    MBM_STM32_OPEN,         /**< the line is open, or another line has this UART */
    MBM_STM32_NOT_STARTED,  /**< the UART is not initialised */
    MBM_STM32_BUSY,         /**< another part of the program sends or receives */
    MBM_STM32_FORMAT,       /**< not 8 data bits, or not both directions */
    MBM_STM32_RECEIVE_DMA,  /**< the DMA of reception is not circular, or not of bytes */
    MBM_STM32_TRANSMIT_DMA, /**< the DMA of transmission is not normal, or not of bytes */
    MBM_STM32_MEMORY,       /**< the DMA does not reach the memory of the line */
    MBM_STM32_PIN,          /**< the driver's pin has no number */
    MBM_STM32_RECEPTION     /**< the HAL does not start reception */
};

/** A serial line. Set the public fields, zero the others, and keep it valid while it is used; make
 *  it static. */
typedef struct mbm_stm32Line {
    uint8_t received[MBM_STM32_RECEIVE_BYTES] MBM_STM32_ALIGNED; /**< private */
    uint8_t toSend[MBM_STM32_SEND_BYTES] MBM_STM32_ALIGNED;      /**< private */

    GPIO_TypeDef *driverPort MBM_STM32_ALIGNED; /**< port of the pin at DE and /RE of an RS-485
                                                     transceiver, an output in CubeMX; NULL if
                                                     there is none, or if the UART has its DE */
    uint16_t driverPin;          /**< that pin, for example GPIO_PIN_8; high while it sends */
    void (*wake)(void *context); /**< NULL, or called in the interrupt when bytes have arrived, when
                                      the last bit has left, and after an error: for a task that
                                      sleeps. It must not use mbm */
    void *context;               /**< passed to wake */

    volatile uint16_t faulty;   /**< characters with a framing, noise or parity error. By DMA it
                                     counts at most one of those that arrive between two reads */
    volatile uint16_t overruns; /**< overruns: characters were lost in the UART */
    volatile uint16_t restarts; /**< how often reception had stopped, and was started again */
    volatile uint16_t stalled;  /**< transmissions that did not end, and were aborted */

    UART_HandleTypeDef *uart;   /**< private; NULL while the line is not open */
    struct mbm_stm32Line *next; /**< private */
    union {
        mbm_ring ofInterrupt;
        mbm_dmaRing ofDma;
    } ring;                       /**< private */
    uint32_t sentAt, sendingTime; /**< private */
    uint32_t latestMicros;        /**< private */
    uint16_t lost, flags;         /**< private */
    volatile uint8_t isSending;   /**< private */
    volatile uint8_t hasFailed;   /**< private */
    volatile uint8_t isDeaf;      /**< private */
    uint8_t hasMore, byte;        /**< private */
} mbm_stm32Line;

/**
 * Begins reception, and fills in a port.
 *
 * @param line  the line
 * @param uart  the handle that CubeMX's MX_USARTx_UART_Init has initialised
 * @param port  receives the port for the begin functions
 * @return MBM_STM32_OK, or what is wrong. Then nothing is changed but the port
 */
uint8_t mbm_stm32_open(mbm_stm32Line *line, UART_HandleTypeDef *uart, mbm_port *port);

/** Ends reception and transmission. Objects that use the port then report a lost link. Does
 *  nothing if the line is not open. */
void mbm_stm32_close(mbm_stm32Line *line);

/**
 * Returns how many received bytes the main loop was too late for.
 *
 * @return the number of bytes since mbm_stm32_open; it wraps at 65536
 */
uint16_t mbm_stm32_lost(const mbm_stm32Line *line);

/** A sentence for what mbm_stm32_open returned. */
const char *mbm_stm32_text(uint8_t fault);

/** The last bit has left. Call it in HAL_UART_TxCpltCallback: switches the driver off. */
void mbm_stm32_noteTransmitted(UART_HandleTypeDef *uart);

/** Bytes have arrived. Call it in HAL_UART_RxCpltCallback and HAL_UARTEx_RxEventCallback. */
void mbm_stm32_noteReceived(UART_HandleTypeDef *uart);

/** The UART or its DMA has failed. Call it in HAL_UART_ErrorCallback. */
void mbm_stm32_noteError(UART_HandleTypeDef *uart);

#ifdef __cplusplus
}
#endif

#endif
