/**
 * @file mbm_tty.h
 * @brief An mbm_port over a POSIX terminal: a serial line, a USB adapter, a pty.
 *
 * Functions that return int return -1 with errno set when they fail; nothing is
 * left open or changed then. None is re-entrant on one mbm_tty; any number may
 * be used side by side.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TTY_H
#define MBM_TTY_H

#include "mbm.h"

#include <termios.h>

#ifdef __cplusplus
extern "C" {
#endif

/** For mbm_tty_wait: as long as it takes. */
#define MBM_TTY_FOREVER UINT32_MAX

/** How a serial line is set; what is 0 is as said. */
typedef struct mbm_tty_options {
    uint32_t baud;           /**< bits per second: any rate of which termios has a constant */
    uint8_t anyRate;         /**< 1: others too, where the system has them, as Linux; to 2 % */
    char parity;             /**< 'N', 'E' or 'O' */
    uint8_t stop;            /**< stop bits, 1 or 2 */
    uint8_t data;            /**< data bits: 8, which 0 means too, or 7 for ASCII */
    uint8_t exclusive;       /**< 1: no other program may open the terminal meanwhile */
    uint8_t rs485;           /**< 1: the driver of the system switches RTS for RS-485 */
    uint8_t rtsLow;          /**< with rs485, 1: RTS is low while sending, else high */
    uint8_t hearSelf;        /**< with rs485, 1: what is sent is received too */
    uint16_t rtsDelayBefore; /**< with rs485: from RTS to the first bit, milliseconds */
    uint16_t rtsDelayAfter;  /**< with rs485: from the last bit to RTS, milliseconds */
} mbm_tty_options;

/** A terminal in use as a port; zeroed, open or closed. */
typedef struct mbm_tty {
    int fd;               /**< the terminal, while isOpen is 1; -1 once closed */
    int error;            /**< errno of what lost the link; 0 while it is there */
    uint8_t isOpen;       /**< 1 from open or attach to close or detach; a zeroed one is closed */
    uint8_t has_uart;     /**< whether there is a transmitter to wait for */
    uint8_t awaits;       /**< what mbm_tty_wait polls it for: POLLIN, or 0; see there */
    uint8_t has_before;   /**< private */
    uint8_t is_exclusive; /**< private */
    uint8_t is_rs485;     /**< private */
    int flags_before;     /**< private */
    uint32_t rs485_before[8]; /**< private */
    struct termios before;    /**< private */
} mbm_tty;

/**
 * Opens a terminal, raw and non-blocking, with eight data bits.
 *
 * @param tty     receives the descriptor
 * @param path    for example "/dev/ttyUSB0"
 * @param baud    bits per second, as in mbm_tty_options
 * @param parity  'N', 'E' or 'O'
 * @param stop    stop bits, 1 or 2
 * @return 0, or -1 with errno as of mbm_tty_openWith
 */
int mbm_tty_open(mbm_tty *tty, const char *path, uint32_t baud, char parity, int stop);

/**
 * Opens a terminal, raw and non-blocking.
 *
 * @param tty      receives the descriptor
 * @param path     for example "/dev/ttyUSB0"
 * @param options  how the line is set
 * @return 0, or -1 with errno set: EINVAL for options that no terminal has or
 *         that this one does not take, EBUSY if it is another's exclusively,
 *         ENOTTY for RS-485 where the driver knows none, or as of open
 */
int mbm_tty_openWith(mbm_tty *tty, const char *path, const mbm_tty_options *options);

/**
 * Uses a descriptor that is open already; makes it raw and non-blocking. What
 * is no terminal, a socket or a pipe, is made non-blocking only.
 *
 * @param tty  receives the descriptor
 * @param fd   open for reading and writing
 * @return 0, or -1 with errno set
 */
int mbm_tty_attach(mbm_tty *tty, int fd);

/**
 * Writes options into the settings of a terminal, raw; sets nothing. For who
 * holds a terminal in another way.
 *
 * @param settings  of tcgetattr, for tcsetattr
 * @param options   how the line is to be; exclusive, RS-485 and a rate without a
 *                  constant are not in it
 * @return 0, or -1 with errno EINVAL
 */
int mbm_tty_settings(struct termios *settings, const mbm_tty_options *options);

/**
 * Closes the terminal and leaves it set as it was found. Waits for bytes that
 * are still to leave. Nothing happens if it is closed already.
 *
 * @param tty  the terminal
 */
void mbm_tty_close(mbm_tty *tty);

/**
 * Leaves the descriptor set as it was found, and open.
 *
 * @param tty  the terminal; the descriptor is yours again
 */
void mbm_tty_detach(mbm_tty *tty);

/**
 * Sleeps until there is something to read or a time is over. Pass the value that a
 * pollDelay function returned.
 *
 * Bytes or a hang-up end one wait. They end the next one only after the port was read:
 * a server whose function is pending reads nothing, and its program sleeps.
 *
 * @param tty     the terminal
 * @param timeoutUs  the longest time to sleep, in microseconds, from 100000 on rounded up to the
 * next millisecond, or MBM_TTY_FOREVER
 * @return 1 if bytes have arrived or the link is lost, which the next read reports;
 *         0 if the time is over or a signal came; -1 with errno set
 */
int mbm_tty_wait(mbm_tty *tty, uint32_t timeoutUs);

/**
 * The port to give to the begin functions. It may be made before the terminal is open,
 * stays valid when it is closed and opened again, and may be given to several objects.
 * While a blocking call of a master waits, the port sleeps until bytes arrive, at most
 * as long as mbm_master_pollDelay of that master says.
 *
 * @param tty  must outlive the port
 * @return the port; its read and write keep errno in `error` when the link is lost,
 *         EBADF while the terminal is not open
 */
mbm_port mbm_tty_port(mbm_tty *tty);

#ifdef __cplusplus
}
#endif

#endif
