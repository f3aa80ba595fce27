/**
 * @file mbm_tty.h
 * @brief An mbm_port over a POSIX terminal: a serial line, a USB adapter, a pty.
 *
 * Functions that return int return -1 with errno set when they fail. Then nothing is left
 * open or changed. No function is re-entrant on one mbm_tty. Any number of mbm_tty may be
 * used side by side.
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

/** For mbm_tty_wait: no time limit. */
#define MBM_TTY_FOREVER UINT32_MAX

/** The longest path of a terminal, with the terminating zero. */
#define MBM_TTY_PATH_BYTES 256

/** The settings of a serial line. */
typedef struct mbm_tty_options {
    uint32_t baud;     /**< bits per second: any rate for which termios has a constant */
    uint8_t anyRate;   /**< 1: other rates too, to within 2 %, if the system can, as Linux */
    char parity;       /**< 'N', 'E' or 'O' */
    uint8_t stop;      /**< stop bits, 1 or 2 */
    uint8_t data;      /**< data bits: 8 (or 0, which means 8), or 7 for ASCII */
    uint8_t exclusive; /**< 1: no other program may open the terminal meanwhile */
    uint8_t rs485;     /**< 1: the driver of the system switches RTS for RS-485 */
    uint8_t rtsLow;    /**< with rs485, 1: RTS is low while sending, else high */
    uint8_t hearSelf;  /**< with rs485, 1: the receiver also receives what is sent */
    uint16_t rtsDelayBeforeMs; /**< with rs485: from RTS to the first bit, milliseconds */
    uint16_t rtsDelayAfterMs;  /**< with rs485: from the last bit to RTS, milliseconds */
    uint8_t shared;            /**< 1: others may open it too, but none has it exclusively */
} mbm_tty_options;

/** A terminal in use as a port. Initialise it with MBM_INIT. */
typedef struct mbm_tty {
    int fd;             /**< the terminal, while isOpen is 1; -1 once closed */
    int error;          /**< why the link was lost, an errno; 0 while there is a link */
    uint8_t isOpen;     /**< 1 from open or attach to close or detach; a zeroed one is closed */
    uint8_t has_uart;   /**< whether there is a transmitter to wait for */
    uint8_t events;     /**< what mbm_tty_wait polls it for: POLLIN or 0 */
    uint8_t has_before; /**< private */
    uint8_t is_locked;  /**< private */
    uint8_t is_rs485;   /**< private */
    uint8_t is_hurried; /**< private */
    int flags_before;   /**< private */
    uint32_t rs485_before[8];      /**< private */
    struct termios before;         /**< private */
    mbm_tty_options options;       /**< private */
    char path[MBM_TTY_PATH_BYTES]; /**< private */
    /** Private: called with 1 when the terminal was opened, with 0 before it is closed. */
    int (*watch)(void *owner, int fd, uint8_t isOpen);
    void *owner; /**< private */
} mbm_tty;

/**
 * Opens a terminal, raw and non-blocking, with eight data bits.
 *
 * @param tty     receives the descriptor
 * @param path    for example "/dev/ttyUSB0"
 * @param baud    bits per second, as in mbm_tty_options
 * @param parity  'N', 'E' or 'O'
 * @param stop    stop bits, 1 or 2
 * @return 0, or -1 with errno set, as of mbm_tty_openWith
 */
int mbm_tty_open(mbm_tty *tty, const char *path, uint32_t baud, char parity, int stop);

/**
 * Opens a terminal, raw and non-blocking.
 *
 * @param tty      receives the descriptor
 * @param path     for example "/dev/ttyUSB0"
 * @param options  the settings of the line
 * @return 0, or -1 with errno set: EINVAL for options that no terminal has or that this
 *         one does not accept, EBUSY if another program has it exclusively, or with exclusive
 *         if one shares it, ENOTTY for
 *         RS-485 if the driver does not support it, or an error of open
 */
int mbm_tty_openWith(mbm_tty *tty, const char *path, const mbm_tty_options *options);

/**
 * Notes a terminal, and leaves the opening to mbm_tty_connect, which a link calls
 * (mbm_tty_link). So a program can begin before the adapter is plugged in.
 *
 * @param tty      closed; it stays so
 * @param path     as for mbm_tty_openWith; copied
 * @param options  as for mbm_tty_openWith; copied
 * @return 0, or -1 with errno set: EINVAL for options that no terminal has, ENAMETOOLONG
 */
int mbm_tty_openLater(mbm_tty *tty, const char *path, const mbm_tty_options *options);

/**
 * Uses a descriptor that is open already, and makes it raw and non-blocking. A descriptor
 * that is no terminal, for example a socket or a pipe, becomes non-blocking only.
 *
 * @param tty  receives the descriptor
 * @param fd   open for reading and writing
 * @return 0, or -1 with errno set
 */
int mbm_tty_attach(mbm_tty *tty, int fd);

/**
 * Writes options into the settings of a terminal, raw. The terminal itself is not changed.
 * For programs that open a terminal in another way.
 *
 * @param settings  from tcgetattr, for tcsetattr
 * @param options   the settings of the line; exclusive, RS-485 and a rate without a
 *                  constant have no effect here
 * @return 0, or -1 with errno EINVAL
 */
int mbm_tty_settings(struct termios *settings, const mbm_tty_options *options);

/** Closes the terminal and restores its settings. Waits until all bytes are sent. Does nothing
 *  if it is closed already, except that mbm_tty_connect then opens it no more. */
void mbm_tty_close(mbm_tty *tty);

/**
 * Restores the settings of the descriptor and leaves it open.
 *
 * @param tty  the terminal; the descriptor belongs to the program again
 */
void mbm_tty_detach(mbm_tty *tty);

/**
 * Opens the terminal of mbm_tty_open, mbm_tty_openWith or mbm_tty_openLater again, with the same
 * options. If it is open, closes it before. A hook for a function that reconnects.
 *
 * @param context  an mbm_tty
 * @return MBM_OK, or MBM_LINK_LOST with errno in its `error`: EBADF if there is no path, after
 *         mbm_tty_attach or mbm_tty_close
 */
uint8_t mbm_tty_connect(void *context);

/**
 * Closes the terminal until mbm_tty_connect. A hook for a function that reconnects.
 *
 * @param context  an mbm_tty
 */
void mbm_tty_disconnect(void *context);

/**
 * Returns whether the terminal is open, as a hook of mbm_linkHooks.
 *
 * @param tty  an mbm_tty
 * @return MBM_OK or MBM_LINK_LOST
 */
static inline uint8_t mbm_tty_status(void *tty)
{
    return ((const mbm_tty *)tty)->isOpen ? MBM_OK : MBM_LINK_LOST;
}

/**
 * Returns the hooks for mbm_link_begin, for a client on a terminal of mbm_tty_openLater,
 * mbm_tty_openWith or mbm_tty_open. In the callback of the link, `error` of the mbm_tty says
 * why the terminal was lost or not opened.
 *
 * @param tty  must outlive the link
 * @return the hooks
 */
static inline mbm_linkHooks mbm_tty_link(mbm_tty *tty)
{
    mbm_linkHooks hooks;

    hooks.context = tty;
    hooks.disconnect = mbm_tty_disconnect;
    hooks.connect = mbm_tty_connect;
    hooks.status = mbm_tty_status;
    return hooks;
}

/**
 * Sleeps until there is something to read or a time is over. Pass the value that a
 * pollDelay function returned.
 *
 * Bytes or a hang-up end one wait. They end the next one only after the port was read or
 * written: a server whose function is pending reads nothing, and its program sleeps. While a
 * link has closed the terminal, the wait is the time alone.
 *
 * @param tty     the terminal
 * @param timeoutUs  the longest time to sleep, in microseconds, from 100000 on rounded up to the
 * next millisecond, or MBM_TTY_FOREVER
 * @return 1 if bytes have arrived or the link is lost, which the next read reports;
 *         0 if the time is over or a signal came; -1 with errno set: EBADF if the terminal is
 *         closed and no link can open it
 */
int mbm_tty_wait(mbm_tty *tty, uint32_t timeoutUs);

/**
 * Returns the port for the begin functions. It may be made before the terminal is open,
 * stays valid when the terminal is closed and opened again, and may be given to several
 * objects. While a blocking call of a node waits, the port sleeps until bytes arrive, at
 * most for the time of mbm_node_pollDelay.
 *
 * @param tty  must outlive the port
 * @return the port; its read and write set `error` to errno when the link is lost, to
 *         EBADF while the terminal is not open
 */
mbm_port mbm_tty_port(mbm_tty *tty);

#ifdef __cplusplus
}
#endif

#endif
