/* An mbm_port over a POSIX terminal. Licence: MIT OR Apache-2.0. */
#define _DEFAULT_SOURCE
#include "mbm_tty.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

/* Where a terminal stands between a request and its reply. */
enum { LISTENING, SENT, AWAITING };

/* How long idle sleeps at most, in milliseconds: short where a silence is to be
 * measured, longer where the next event is a reply. A timer that is nearer than
 * the kernel's own next tick costs more than the rest of a transaction. */
enum { SHORT_SLEEP = 1, LONG_SLEEP = 5 };

/* No slave answers sooner, in microseconds: it has to receive the request first. */
enum { TOO_SOON = 100 };

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
    tty->now = tty->sent_at = 0;
    tty->phase = LISTENING;
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

/* A look right behind a request finds nothing; it is left out, so that idle
 * sleeps at once. */
static int16_t tty_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_tty *tty = (mbm_tty *)context;
    int16_t count;

    if (tty->phase == SENT) {
        tty->phase = AWAITING;
        if (tty->now - tty->sent_at < TOO_SOON)
            return 0;
    }
    count = capacity == 0 ? 0 : outcome(read(tty->fd, bytes, capacity));
    if (count > 0)
        tty->phase = LISTENING;
    return count;
}

static int16_t tty_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_tty *tty = (mbm_tty *)context;

    tty->phase = SENT;
    tty->sent_at = tty->now;
    return length == 0 ? 0 : outcome(write(tty->fd, bytes, length));
}

static uint32_t tty_micros(void *context)
{
    mbm_tty *tty = (mbm_tty *)context;
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    tty->now = (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
    return tty->now;
}

static uint8_t tty_flush(void *context)
{
    const mbm_tty *tty = (const mbm_tty *)context;
    int left = 0;

    return ioctl(tty->fd, TIOCOUTQ, &left) < 0 || left == 0;
}

/* Sleeps until bytes arrive, for a few milliseconds at most. */
static void tty_idle(void *context)
{
    mbm_tty *tty = (mbm_tty *)context;
    struct pollfd line = {tty->fd, POLLIN, 0};

    if (tty->phase == SENT)
        tty->phase = AWAITING;
    poll(&line, 1, tty->phase == LISTENING ? SHORT_SLEEP : LONG_SLEEP);
}

mbm_port mbm_tty_port(mbm_tty *tty)
{
    mbm_port port = {0};

    port.context = tty;
    port.read = tty_read;
    port.write = tty_write;
    port.micros = tty_micros;
    /* A pty has no transmitter that could drain. */
    port.flush = tty->has_uart ? tty_flush : NULL;
    port.idle = tty_idle;
    return port;
}
