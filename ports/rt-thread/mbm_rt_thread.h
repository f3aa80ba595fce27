/**
 * @file mbm_rt_thread.h
 * @brief An mbm_port over RT-Thread's serial and pin devices, for RS-232, TTL levels and RS-485.
 *
 * For RT-Thread 4.1 and later, with the serial framework of version 1 or 2. A line is used in one
 * thread. Any number of lines may be used side by side.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_RT_THREAD_H
#define MBM_RT_THREAD_H

#include "mbm.h"

#include <rtdevice.h>
#include <rtthread.h>

#ifdef __cplusplus
extern "C" {
#endif

/** For driverPin: there is no pin to switch. */
#define MBM_RT_THREAD_NO_PIN (-1)

/** A serial line. Set the public fields, zero the others, and keep it valid while it is used. */
typedef struct mbm_rtThreadLine {
    const char *uart;    /**< the device's name, for example "uart2" */
    rt_base_t driverPin; /**< the pin at DE and /RE of an RS-485 transceiver, as GET_PIN returns
                              it, or MBM_RT_THREAD_NO_PIN */
    rt_uint32_t baud;    /**< bits per second */
    rt_uint32_t parity;  /**< PARITY_EVEN, Modbus's default, PARITY_ODD or PARITY_NONE */
    rt_uint8_t tail;     /**< how many characters the UART may still hold when rt_device_write
                              returns: 0 if its driver waits for the last bit, as that of the
                              STM32 does, 2 without a FIFO, else the bytes of the FIFO and 1. Above
                              0 the BSP needs rt_hw_us_delay */
    rt_uint16_t stalled; /**< frames that did not leave, or not as a whole, and were given up */

    rt_uint8_t held;                        /**< private */
    rt_device_t device;                     /**< private; NULL while the line is not open */
    struct mbm_rtThreadLine *next;          /**< private */
    mbm_ring ring;                          /**< private */
    rt_uint8_t received[MBM_MAX_FRAME + 1]; /**< private */
} mbm_rtThreadLine;

/**
 * Opens the device: 8 data bits, two stop bits without parity, else one. It takes the device's
 * rx_indicate.
 *
 * If the device sends less than a whole frame, the port counts it in `stalled`, opens the device
 * again, so that the rest never leaves, and the link is lost (MBM_LINK_LOST) for the request under
 * way. The next one works once the device does. The same holds if another part of the program has
 * closed the device.
 *
 * @param line  the settings
 * @param port  receives the port for the begin functions. Its write waits while the bytes leave,
 *              as rt_device_write does: with version 2 of the serial framework for twice the time
 *              of the longest frame at the most; with version 1 for as long as the driver waits
 *              for each character
 * @return RT_EOK; -RT_EINVAL for NULL, a rate of 0, a line that is open, or a pin that is not
 *         there, if the BSP's driver of pins says so; -RT_ENOENT if there is
 *         no device of that name, in RT-Thread 4 -RT_ERROR; or the error of the function of
 *         RT-Thread that failed. Then the device is not left open
 */
rt_err_t mbm_rtThread_open(mbm_rtThreadLine *line, mbm_port *port);

/** Closes the device. Objects that use the port then report a lost link. Does nothing if the
 *  line is not open. */
void mbm_rtThread_close(mbm_rtThreadLine *line);

/**
 * Returns how many received bytes the thread was too late for: the port holds 256. What the UART
 * loses by itself, because its interrupt comes too late, only its driver knows.
 *
 * @return bytes since mbm_rtThread_open; it wraps at 65536. 0 for NULL
 */
rt_uint16_t mbm_rtThread_lost(const mbm_rtThreadLine *line);

/**
 * Lets other threads run, for at most a tick. For a program that polls a client or a server: pass
 * the value that its pollDelay function returned. Does not sleep for less than a tick, so that the
 * driver of the transceiver goes off in time.
 *
 * @param timeoutUs  the longest time to sleep, in microseconds
 */
void mbm_rtThread_wait(uint32_t timeoutUs);

#ifdef __cplusplus
}
#endif

#endif
