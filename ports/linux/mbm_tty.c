/* An mbm_port over a POSIX terminal. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tty.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stddef.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#ifdef __linux__
#include <linux/serial.h>
#endif

/* POSIX has the rates up to 38400. The others depend on the system. */
static const struct {
    uint32_t baud;
    speed_t speed;
} RATES[] = {
    {50, B50},           {75, B75},     {110, B110},   {134, B134},     {150, B150},
    {200, B200},         {300, B300},   {600, B600},   {1200, B1200},   {1800, B1800},
    {2400, B2400},       {4800, B4800}, {9600, B9600}, {19200, B19200}, {38400, B38400},
#ifdef B57600
    {57600, B57600},
#endif
#ifdef B76800
    {76800, B76800},
#endif
#ifdef B115200
    {115200, B115200},
#endif
#ifdef B153600
    {153600, B153600},
#endif
#ifdef B230400
    {230400, B230400},
#endif
#ifdef B307200
    {307200, B307200},
#endif
#ifdef B460800
    {460800, B460800},
#endif
#ifdef B500000
    {500000, B500000},
#endif
#ifdef B576000
    {576000, B576000},
#endif
#ifdef B614400
    {614400, B614400},
#endif
#ifdef B921600
    {921600, B921600},
#endif
#ifdef B1000000
    {1000000, B1000000},
#endif
#ifdef B1152000
    {1152000, B1152000},
#endif
#ifdef B1500000
    {1500000, B1500000},
#endif
#ifdef B2000000
    {2000000, B2000000},
#endif
#ifdef B2500000
    {2500000, B2500000},
#endif
#ifdef B3000000
    {3000000, B3000000},
#endif
#ifdef B3500000
    {3500000, B3500000},
#endif
#ifdef B4000000
    {4000000, B4000000},
#endif
};

static speed_t speed_of(uint32_t baud)
{
    size_t i;

    for (i = 0; i < sizeof RATES / sizeof RATES[0]; i++)
        if (RATES[i].baud == baud)
            return RATES[i].speed;
    return B0;
}

/* The rate that termios gets while a rate without a constant is not set yet. */
static speed_t stand_in(const mbm_tty_options *options)
{
    return options->anyRate && options->baud > 0 ? B38400 : B0;
}

static int refuse(int error)
{
    errno = error;
    return -1;
}

int mbm_tty_settings(struct termios *settings, const mbm_tty_options *options)
{
    speed_t speed = speed_of(options->baud) == B0 ? stand_in(options) : speed_of(options->baud);
    uint8_t data = options->data == 0 ? 8 : options->data;
    tcflag_t flags = CLOCAL | CREAD;

    if (speed == B0 || (data != 7 && data != 8) || options->stop < 1 || options->stop > 2)
        return refuse(EINVAL);
    switch (options->parity) {
    case 'N': break;
    case 'E': flags |= PARENB; break;
    case 'O': flags |= PARENB | PARODD; break;
    default: return refuse(EINVAL);
    }
    flags |= data == 7 ? CS7 : CS8;
    flags |= options->stop == 2 ? CSTOPB : 0;

    cfmakeraw(settings);
    /* Bytes with a wrong parity bit are received too: the CRC finds the error. */
    settings->c_iflag &= ~(tcflag_t)(INPCK | IXOFF | IXANY);
    settings->c_cflag &= ~(tcflag_t)(CSIZE | PARENB | PARODD | CSTOPB | HUPCL);
#ifdef CRTSCTS
    settings->c_cflag &= ~(tcflag_t)CRTSCTS;
#endif
    settings->c_cflag |= flags;
    if (cfsetispeed(settings, speed) < 0 || cfsetospeed(settings, speed) < 0)
        return -1;
    return 0;
}

#ifdef TIOCSRS485
static int begin_rs485(mbm_tty *tty, const mbm_tty_options *options)
{
    struct serial_rs485 now;

    if (ioctl(tty->fd, TIOCGRS485, &now) < 0)
        return -1;
    memcpy(tty->rs485_before, &now, sizeof tty->rs485_before);
    now.flags = SER_RS485_ENABLED;
    now.flags |= options->rtsLow ? SER_RS485_RTS_AFTER_SEND : SER_RS485_RTS_ON_SEND;
    if (options->hearSelf)
        now.flags |= SER_RS485_RX_DURING_TX;
    now.delay_rts_before_send = options->rtsDelayBeforeMs;
    now.delay_rts_after_send = options->rtsDelayAfterMs;
    if (ioctl(tty->fd, TIOCSRS485, &now) < 0)
        return -1;
    tty->is_rs485 = 1;
    /* The driver drops settings that it cannot do, and only this shows it. */
    if (ioctl(tty->fd, TIOCGRS485, &now) < 0)
        return -1;
    if (!(now.flags & SER_RS485_ENABLED) ||
        now.delay_rts_before_send != options->rtsDelayBeforeMs ||
        now.delay_rts_after_send != options->rtsDelayAfterMs)
        return refuse(EINVAL);
    return 0;
}

static void end_rs485(mbm_tty *tty)
{
    struct serial_rs485 before;

    memcpy(&before, tty->rs485_before, sizeof before);
    ioctl(tty->fd, TIOCSRS485, &before);
}

_Static_assert(sizeof(struct serial_rs485) == sizeof(((mbm_tty *)0)->rs485_before),
               "space for the driver's previous settings");
#else
static int begin_rs485(mbm_tty *tty, const mbm_tty_options *options)
{
    (void)tty;
    (void)options;
    return refuse(ENOTTY);
}

static void end_rs485(mbm_tty *tty)
{
    (void)tty;
}
#endif

#if defined(__linux__) && (defined(__x86_64__) || defined(__i386__) || defined(__arm__) ||         \
                           defined(__aarch64__) || defined(__riscv))
/* struct termios2 with its requests and flags: <asm/termbits.h> defines them, but cannot be
 * included together with <termios.h>. */
typedef struct rated {
    uint32_t iflag, oflag, cflag, lflag;
    uint8_t line, cc[19];
    uint32_t in, out;
} rated;

/* The second parameter of ioctl: unsigned long in glibc, int in musl, as in POSIX. */
#ifdef __GLIBC__
typedef unsigned long ioctl_request;
#else
typedef int ioctl_request;
#endif

#define GET_RATED ((ioctl_request)_IOR('T', 0x2A, rated))
#define SET_RATED ((ioctl_request)_IOW('T', 0x2B, rated))
enum { RATE = 0x100F, RATE_IN = 0x100F << 16, OTHER_RATE = 0x1000 };

static int set_rate(const mbm_tty *tty, uint32_t baud)
{
    rated settings;

    if (ioctl(tty->fd, GET_RATED, &settings) < 0)
        return -1;
    settings.cflag &= ~(uint32_t)(RATE | RATE_IN);
    settings.cflag |= OTHER_RATE;
    settings.in = settings.out = baud;
    if (ioctl(tty->fd, SET_RATED, &settings) < 0 || ioctl(tty->fd, GET_RATED, &settings) < 0)
        return -1;
    /* The driver sets the nearest rate that it has. */
    if (settings.out < baud - baud / 50 || settings.out > baud + baud / 50)
        return refuse(EINVAL);
    return 0;
}
#else
static int set_rate(const mbm_tty *tty, uint32_t baud)
{
    (void)tty;
    (void)baud;
    return refuse(EINVAL);
}
#endif

/* Asks the driver to hand over received bytes at once, and not when a timer ends: 16 ms in an
 * adapter of FTDI. Many drivers cannot, and some leave it to root. */
#if defined TIOCGSERIAL && defined ASYNC_LOW_LATENCY
static int set_low_latency(int fd, int on)
{
    struct serial_struct serial;
    int flags;

    if (ioctl(fd, TIOCGSERIAL, &serial) < 0)
        return 0;
    flags = serial.flags & ~(int)ASYNC_LOW_LATENCY;
    flags |= on ? (int)ASYNC_LOW_LATENCY : 0;
    if (flags == serial.flags)
        return 0;
    serial.flags = flags;
    return ioctl(fd, TIOCSSERIAL, &serial) == 0;
}
#else
static int set_low_latency(int fd, int on)
{
    (void)fd;
    (void)on;
    return 0;
}
#endif

/* Saves the settings of the terminal, then makes it raw and non-blocking. */
static int take_over(mbm_tty *tty)
{
    struct termios settings;
    int lines;

    tty->flags_before = fcntl(tty->fd, F_GETFL);
    if (tty->flags_before < 0 || fcntl(tty->fd, F_SETFL, tty->flags_before | O_NONBLOCK) < 0)
        return -1;
    if (tcgetattr(tty->fd, &tty->before) == 0) {
        settings = tty->before;
        cfmakeraw(&settings);
        if (tcsetattr(tty->fd, TCSANOW, &settings) < 0) {
            fcntl(tty->fd, F_SETFL, tty->flags_before);
            return -1;
        }
        tty->has_before = 1;
    }
    tty->has_uart = ioctl(tty->fd, TIOCMGET, &lines) == 0;
    tty->isOpen = 1;
    tty->events = POLLIN;
    return 0;
}

int mbm_tty_attach(mbm_tty *tty, int fd)
{
    memset(tty, 0, sizeof *tty);
    tty->fd = fd;
    if (take_over(tty) < 0) {
        tty->fd = -1;
        return -1;
    }
    return 0;
}

/* Restores the settings of the descriptor, also if opening failed. */
static void release(mbm_tty *tty)
{
    if (tty->watch)
        (void)tty->watch(tty->owner, tty->fd, 0);
    if (tty->has_before)
        tcsetattr(tty->fd, TCSADRAIN, &tty->before);
    if (tty->is_rs485)
        end_rs485(tty);
    if (tty->is_hurried)
        set_low_latency(tty->fd, 0);
    if (tty->is_locked && tty->options.exclusive)
        ioctl(tty->fd, TIOCNXCL);
    if (tty->is_locked)
        flock(tty->fd, LOCK_UN);
    fcntl(tty->fd, F_SETFL, tty->flags_before);
    tty->fd = -1;
    tty->isOpen = 0;
}

void mbm_tty_detach(mbm_tty *tty)
{
    tty->path[0] = '\0';
    if (tty->isOpen)
        release(tty);
}

void mbm_tty_disconnect(void *context)
{
    mbm_tty *tty = (mbm_tty *)context;
    int fd = tty->fd;

    if (!tty->isOpen)
        return;
    release(tty);
    close(fd);
}

void mbm_tty_close(mbm_tty *tty)
{
    tty->path[0] = '\0';
    mbm_tty_disconnect(tty);
}

/* TIOCEXCL keeps other programs out except those of root. The lock of the file keeps root's
 * out too, and those that would share the terminal. */
static int lock(mbm_tty *tty)
{
    const int is_exclusive = tty->options.exclusive;

    if (flock(tty->fd, (is_exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB) < 0)
        return errno == EWOULDBLOCK ? refuse(EBUSY) : -1;
    tty->is_locked = 1;
    return is_exclusive ? ioctl(tty->fd, TIOCEXCL) : 0;
}

/* tcsetattr succeeds if it could do any part of its task, so the settings are read back. A
 * pty sends no bits over a wire, and its driver has neither parity nor seven bits. */
static int set(const mbm_tty *tty, const mbm_tty_options *options)
{
    const tcflag_t frame = CSIZE | PARENB | PARODD | CSTOPB;
    struct termios wanted, got;

    if (tcgetattr(tty->fd, &wanted) < 0 || mbm_tty_settings(&wanted, options) < 0)
        return -1;
    if (!tty->has_uart)
        wanted.c_cflag = (wanted.c_cflag & ~(tcflag_t)(PARENB | PARODD)) | CS8;
    if (tcsetattr(tty->fd, TCSANOW, &wanted) < 0 || tcgetattr(tty->fd, &got) < 0)
        return -1;
    if (cfgetospeed(&got) != cfgetospeed(&wanted) ||
        (tty->has_uart && ((got.c_cflag ^ wanted.c_cflag) & frame) != 0))
        return refuse(EINVAL);
    if (speed_of(options->baud) == B0 && set_rate(tty, options->baud) < 0)
        return -1;
    /* Bytes that arrived at another rate are useless. */
    return tcflush(tty->fd, TCIOFLUSH);
}

/* Notes how the terminal is opened. A path that is too long cannot be opened again. */
static void note(mbm_tty *tty, const char *path, const mbm_tty_options *options)
{
    memset(tty, 0, sizeof *tty);
    tty->fd = -1;
    tty->options = *options;
    if (strlen(path) < sizeof tty->path)
        strcpy(tty->path, path);
}

static int open_noted(mbm_tty *tty, const char *path)
{
    const mbm_tty_options *options = &tty->options;
    int fd, error;

    fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0)
        return -1;
    tty->fd = fd;
    tty->flags_before = O_RDWR;
    /* Locks first, so that the settings of another program's terminal stay as they are. */
    if (((options->exclusive || options->shared) && lock(tty) < 0) || take_over(tty) < 0 ||
        set(tty, options) < 0 || (options->rs485 && begin_rs485(tty, options) < 0) ||
        (tty->watch && tty->watch(tty->owner, fd, 1) < 0)) {
        error = errno;
        release(tty);
        close(fd);
        return refuse(error);
    }
    tty->is_hurried = (uint8_t)set_low_latency(fd, 1);
    return 0;
}

int mbm_tty_openLater(mbm_tty *tty, const char *path, const mbm_tty_options *options)
{
    struct termios unused = {0};

    if (mbm_tty_settings(&unused, options) < 0)
        return -1;
    if (strlen(path) >= sizeof tty->path)
        return refuse(ENAMETOOLONG);
    note(tty, path, options);
    return 0;
}

int mbm_tty_openWith(mbm_tty *tty, const char *path, const mbm_tty_options *options)
{
    struct termios unused = {0};

    note(tty, path, options);
    if (mbm_tty_settings(&unused, options) == 0 && open_noted(tty, path) == 0)
        return 0;
    tty->path[0] = '\0';
    return -1;
}

uint8_t mbm_tty_connect(void *context)
{
    mbm_tty *tty = (mbm_tty *)context;
    const mbm_tty before = *tty;

    if (before.path[0] == '\0') {
        tty->error = EBADF;
        return MBM_LINK_LOST;
    }
    mbm_tty_disconnect(tty);
    note(tty, before.path, &before.options);
    tty->watch = before.watch;
    tty->owner = before.owner;
    if (open_noted(tty, before.path) == 0)
        return MBM_OK;
    tty->error = errno;
    return MBM_LINK_LOST;
}

int mbm_tty_open(mbm_tty *tty, const char *path, uint32_t baud, char parity, int stop)
{
    mbm_tty_options options = {0};

    options.baud = baud;
    options.parity = parity;
    options.stop = (uint8_t)(stop == 1 || stop == 2 ? stop : 0);
    return mbm_tty_openWith(tty, path, &options);
}

/* No bytes were moved. Returns 0 for a signal or if there are none yet, -1 for a lost link. */
static int16_t none_moved(mbm_tty *tty, ssize_t count)
{
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR))
        return 0;
    /* The end of file means that the line has hung up. */
    tty->error = count < 0 ? errno : EPIPE;
    return -1;
}

static int16_t not_open(mbm_tty *tty)
{
    tty->error = EBADF;
    return -1;
}

static size_t at_most(uint16_t length)
{
    return length > INT16_MAX ? INT16_MAX : length;
}

static int16_t tty_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_tty *tty = (mbm_tty *)context;
    ssize_t count;

    if (!tty->isOpen)
        return not_open(tty);
    if (capacity == 0)
        return 0;
    tty->events = POLLIN;
    count = read(tty->fd, bytes, at_most(capacity));
    return count > 0 ? (int16_t)count : none_moved(tty, count);
}

static int16_t tty_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_tty *tty = (mbm_tty *)context;
    ssize_t count;

    if (!tty->isOpen)
        return not_open(tty);
    if (length == 0)
        return 0;
    tty->events = POLLIN;
    count = write(tty->fd, bytes, at_most(length));
    return count > 0 ? (int16_t)count : none_moved(tty, count);
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

    /* A pty has no transmitter, so there is nothing to wait for. */
    return !tty->isOpen || !tty->has_uart || ioctl(tty->fd, TIOCOUTQ, &left) < 0 || left == 0;
}

/* The shortest wait that counts as long, in microseconds. */
enum { LONG_WAIT = 100000 };

/* In a long wait a millisecond does not matter, and poll costs less than ppoll. */
static inline int sleep_on(struct pollfd *line, nfds_t count, uint32_t timeoutUs)
{
    if (timeoutUs >= LONG_WAIT)
        return poll(line, count, timeoutUs == MBM_TTY_FOREVER ? -1 : (int)(timeoutUs / 1000 + 1));
    return ppoll(line, count, &(struct timespec){0, (long)timeoutUs * 1000}, NULL);
}

int mbm_tty_wait(mbm_tty *tty, uint32_t timeoutUs)
{
    struct pollfd line = {tty->fd, POLLIN, 0};
    int ready;

    if (!tty->isOpen && tty->path[0] == '\0')
        return refuse(EBADF);
    /* An awaited event of 0 would still make a hang-up end the wait, so the list is empty
     * then, and while the terminal is closed. */
    ready = sleep_on(&line, tty->isOpen && tty->events != 0, timeoutUs);
    if (ready < 0)
        return errno == EINTR ? 0 : -1;
    if (ready > 0)
        tty->events = 0;
    return ready > 0;
}

/* Sleeps until bytes arrive or the master has something else to do. */
static void tty_idle(void *context, mbm_node *node)
{
    mbm_tty_wait((mbm_tty *)context, mbm_node_pollDelay(node));
}

mbm_port mbm_tty_port(mbm_tty *tty)
{
    mbm_port port = {0};

    port.context = tty;
    port.read = tty_read;
    port.write = tty_write;
    port.micros = tty_micros;
    port.flush = tty_flush;
    port.idle = tty_idle;
    return port;
}
