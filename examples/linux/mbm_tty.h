/**
 * @file mbm_tty.h
 * @brief An mbm_port over a POSIX terminal: a serial line, a USB adapter, a pty.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TTY_H
#define MBM_TTY_H

#include "mbm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A terminal in use as a port. */
typedef struct mbm_tty {
    int fd;                   /**< the terminal */
    const mbm_master *master; /**< who uses it; says how long to sleep */
    uint8_t has_uart;         /**< whether there is a transmitter to wait for */
} mbm_tty;

/**
 * Opens a terminal, raw and non-blocking.
 *
 * @param tty     receives the descriptor
 * @param path    for example "/dev/ttyUSB0"
 * @param baud    1200 to 115200, one of the usual rates
 * @param parity  'N', 'E' or 'O'
 * @param stop    stop bits, 1 or 2
 * @return 0, or -1 with errno set (EINVAL for a rate or parity unknown)
 */
int mbm_tty_open(mbm_tty *tty, const char *path, uint32_t baud, char parity, int stop);

/** Uses a descriptor that is open already; makes it raw and non-blocking. */
int mbm_tty_attach(mbm_tty *tty, int fd);

/** Closes the terminal. */
void mbm_tty_close(mbm_tty *tty);

/**
 * The port to give to mbm_master_begin. While a call waits, it sleeps until
 * bytes arrive or `master` has something else to do.
 *
 * @param tty     must outlive the port
 * @param master  the object that the port is for
 */
mbm_port mbm_tty_port(mbm_tty *tty, const mbm_master *master);

#ifdef __cplusplus
}
#endif

#endif
