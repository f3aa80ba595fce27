/* An mbm_port over a POSIX terminal. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tty.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static speed_t speed_of(uint32_t baud)
{
    switch (baud) {
    case 1200: return B1200;
    case 2400: return B2400;
    case 4800: return B4800;
    case 9600: return B9600;
    case 19200: return B19200;
    case 38400: return B38400;
    case 57600: return B57600;
    case 115200: return B115200;
    default: return B0;
    }
}

int mbm_tty_attach(mbm_tty *tty, int fd)
{
    struct termios settings;
    int flags = fcntl(fd, F_GETFL);
    int lines;

    if (flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0)
        return -1;
    if (tcgetattr(fd, &settings) == 0) {
        cfmakeraw(&settings);
        if (tcsetattr(fd, TCSANOW, &settings) < 0)
            return -1;
    }
    tty->fd = fd;
    tty->master = NULL;
    tty->has_uart = ioctl(fd, TIOCMGET, &lines) == 0;
    return 0;
}

int mbm_tty_open(mbm_tty *tty, const char *path, uint32_t baud, char parity, int stop)
{
    struct termios settings;
    speed_t speed = speed_of(baud);
    int fd;

    if (speed == B0 || (parity != 'N' && parity != 'E' && parity != 'O') || stop < 1 || stop > 2) {
        errno = EINVAL;
        return -1;
    }
    fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (fd < 0)
        return -1;
    if (mbm_tty_attach(tty, fd) < 0 || tcgetattr(fd, &settings) < 0)
        goto failed;
    cfsetispeed(&settings, speed);
    cfsetospeed(&settings, speed);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cflag &= ~(tcflag_t)(PARENB | PARODD | CSTOPB);
    if (parity != 'N')
        settings.c_cflag |= PARENB;
    if (parity == 'O')
        settings.c_cflag |= PARODD;
    if (stop == 2)
        settings.c_cflag |= CSTOPB;
    if (tcsetattr(fd, TCSANOW, &settings) < 0)
        goto failed;
    return 0;

failed:
    close(fd);
    return -1;
}

void mbm_tty_close(mbm_tty *tty)
{
    close(tty->fd);
    tty->fd = -1;
}

/* A signal and "try again" mean that nothing was moved; all else that the
 * link is gone. */
static int16_t outcome(ssize_t count)
{
    if (count > 0)
        return (int16_t)count;
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR))
        return 0;
    return -1;
}

static int16_t tty_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    const mbm_tty *tty = (const mbm_tty *)context;

    return capacity == 0 ? 0 : outcome(read(tty->fd, bytes, capacity));
}

static int16_t tty_write(void *context, const uint8_t *bytes, uint16_t length)
{
    const mbm_tty *tty = (const mbm_tty *)context;

    return length == 0 ? 0 : outcome(write(tty->fd, bytes, length));
}

static uint32_t tty_micros(void *context)
{
    struct timespec now;

    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

static uint8_t tty_flush(void *context)
{
    const mbm_tty *tty = (const mbm_tty *)context;
    int left = 0;

    return ioctl(tty->fd, TIOCOUTQ, &left) < 0 || left == 0;
}

/* Sleeps until bytes arrive or the master has something else to do. */
static void tty_idle(void *context)
{
    const mbm_tty *tty = (const mbm_tty *)context;
    uint32_t delay = mbm_master_pollDelay(tty->master);
    struct timespec time = {(time_t)(delay / 1000000u), (long)(delay % 1000000u) * 1000};
    struct pollfd line = {tty->fd, POLLIN, 0};

    ppoll(&line, 1, &time, NULL);
}

mbm_port mbm_tty_port(mbm_tty *tty, const mbm_master *master)
{
    mbm_port port = {0};

    tty->master = master;
    port.context = tty;
    port.read = tty_read;
    port.write = tty_write;
    port.micros = tty_micros;
    /* A pty has no transmitter that could drain. */
    port.flush = tty->has_uart ? tty_flush : NULL;
    port.idle = tty_idle;
    return port;
}
