/* The port over a terminal. A pty shows the settings that the system makes. A pty has no
 * RS-485 driver: the test's own ioctl plays one. */
#define _GNU_SOURCE
#include "await.h"
#include "clock.h"
#include "skip.h"
#include "mbm_tty.h"
#include "pty.h"
#include "test.h"

#include <fcntl.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <pthread.h>
#include <signal.h>

static pty line;
static const mbm_tty_options PLAIN = {.baud = 19200, .parity = 'E', .stop = 1};

/* The driver that the test plays: whether it exists, and its longest delay. */
static struct {
    int there;
    uint32_t longest;
    struct serial_rs485 state;
    uint32_t nearest; /* the rate that it sets instead of any rate without a constant; 0: the rate
                         itself */
    int has_latency;  /* a latency timer: 1; 2: only root may set it */
    struct serial_struct serial;
} driver;

/* TCGETS2, which <termios.h> does not define. */
#define GET_WITH_RATE _IOR('T', 0x2A, uint32_t[11])

/* This function replaces that of libc. */
int ioctl(int fd, unsigned long request, ...)
{
    va_list arguments;

    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    if (driver.there && request == TIOCGRS485) {
        memcpy(argument, &driver.state, sizeof driver.state);
        return 0;
    }
    if (driver.there && request == TIOCSRS485) {
        memcpy(&driver.state, argument, sizeof driver.state);
        if (driver.state.delay_rts_before_send > driver.longest)
            driver.state.delay_rts_before_send = driver.longest;
        return 0;
    }
    if (driver.has_latency && request == TIOCGSERIAL) {
        memcpy(argument, &driver.serial, sizeof driver.serial);
        return 0;
    }
    if (driver.has_latency && request == TIOCSSERIAL) {
        if (driver.has_latency == 2) {
            errno = EPERM;
            return -1;
        }
        memcpy(&driver.serial, argument, sizeof driver.serial);
        return 0;
    }
    if (driver.nearest && request == GET_WITH_RATE) {
        if (syscall(SYS_ioctl, fd, request, argument) < 0)
            return -1;
        ((uint32_t *)argument)[10] = driver.nearest;
        return 0;
    }
    return (int)syscall(SYS_ioctl, fd, request, argument);
}

static void begin(void)
{
    memset(&driver, 0, sizeof driver);
    pty_open(&line);
}

static void end(void)
{
    pty_close(&line);
}

fixture each_test = {begin, end};

static struct termios settings_of(int fd)
{
    struct termios settings;

    assert_int_equal(tcgetattr(fd, &settings), 0);
    return settings;
}

static void assert_same(const struct termios *a, const struct termios *b)
{
    assert_int_equal(a->c_iflag, b->c_iflag);
    assert_int_equal(a->c_oflag, b->c_oflag);
    assert_int_equal(a->c_cflag, b->c_cflag);
    assert_int_equal(a->c_lflag, b->c_lflag);
    assert_memory_equal(a->c_cc, b->c_cc, sizeof a->c_cc);
}

TEST(every_rate_of_termios_can_be_set)
{
    static const struct {
        uint32_t baud;
        speed_t speed;
    } rows[] = {{50, B50},           {134, B134},        {1200, B1200},       {38400, B38400},
                {57600, B57600},     {115200, B115200},  {230400, B230400},   {460800, B460800},
                {500000, B500000},   {921600, B921600},  {1000000, B1000000}, {1500000, B1500000},
                {3000000, B3000000}, {4000000, B4000000}};

    SKIP_IF_EMULATED();
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct termios settings;
        mbm_tty tty;

        assert_int_equal(mbm_tty_open(&tty, line.path, rows[i].baud, 'N', 2), 0);
        settings = settings_of(tty.fd);
        assert_int_equal(cfgetospeed(&settings), rows[i].speed);
        assert_int_equal(settings.c_cflag & CSTOPB, CSTOPB);
        mbm_tty_close(&tty);
    }
}

static uint32_t rate_of(int fd)
{
    uint32_t settings[11]; /* the kernel's termios2: the last two words are the rates */

    assert_int_equal(ioctl(fd, GET_WITH_RATE, settings), 0);
    return settings[10];
}

TEST(any_rate_is_set_if_the_options_allow_it)
{
    static const uint32_t rates[] = {76800, 100000, 250000, 19201, 3250000, 9600};
    struct termios before = settings_of(line.theirs), after;
    mbm_tty_options options = PLAIN;
    mbm_tty tty;

    SKIP_IF_EMULATED();
    uint32_t rate = rate_of(line.theirs);
    options.anyRate = 1;
    for (size_t i = 0; i < COUNT(rates); i++) {
        options.baud = rates[i];
        assert_int_equal(mbm_tty_openWith(&tty, line.path, &options), 0);
        assert_int_equal(rate_of(tty.fd), rates[i]);
        mbm_tty_close(&tty);
        after = settings_of(line.theirs);
        assert_same(&before, &after);
        assert_int_equal(rate_of(line.theirs), rate);
    }
    options.baud = 0;
    FAILS(EINVAL, mbm_tty_openWith(&tty, line.path, &options));
    /* A driver that sets the nearest rate that it has. */
    options.baud = 250000;
    driver.nearest = 245200;
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &options), 0);
    mbm_tty_close(&tty);
    driver.nearest = 230400;
    FAILS(EINVAL, mbm_tty_openWith(&tty, line.path, &options));
    after = settings_of(line.theirs);
    assert_same(&before, &after);
}

/* The C library fails if the terminal takes none of the changes. */
TEST(a_pty_that_lacks_only_the_parity_is_opened)
{
    const mbm_tty_options frames[] = {PLAIN,
                                      {.baud = 19200, .parity = 'O', .stop = 1},
                                      {.baud = 19200, .parity = 'E', .stop = 1, .data = 7}};
    mbm_tty left_open, tty;

    assert_int_equal(mbm_tty_open(&left_open, line.path, 19200, 'N', 1), 0);
    for (size_t i = 0; i < COUNT(frames); i++) {
        assert_int_equal(mbm_tty_openWith(&tty, line.path, &frames[i]), 0);
        mbm_tty_close(&tty);
    }
    mbm_tty_close(&left_open);
}

TEST(options_that_no_terminal_has_are_refused_with_einval)
{
    static const mbm_tty_options bad[] = {
        {.baud = 0, .parity = 'N', .stop = 1},
        {.baud = 19201, .parity = 'N', .stop = 1},
        {.baud = 9600, .parity = 0, .stop = 1},
        {.baud = 9600, .parity = 'n', .stop = 1},
        {.baud = 9600, .parity = 'M', .stop = 1},
        {.baud = 9600, .parity = 'N', .stop = 0},
        {.baud = 9600, .parity = 'N', .stop = 3},
        {.baud = 9600, .parity = 'N', .stop = 1, .data = 6},
        {.baud = 9600, .parity = 'N', .stop = 1, .data = 9},
    };
    struct termios settings = settings_of(line.theirs);
    mbm_tty tty;

    for (size_t i = 0; i < COUNT(bad); i++) {
        FAILS(EINVAL, mbm_tty_openWith(&tty, line.path, &bad[i]));
        assert_int_equal(tty.fd, -1);
        FAILS(EINVAL, mbm_tty_settings(&settings, &bad[i]));
    }
    FAILS(EINVAL, mbm_tty_open(&tty, line.path, 9600, 'N', 257));
    FAILS(EINVAL, mbm_tty_open(&tty, line.path, 9600, 'N', -255));
}

TEST(a_failed_open_sets_errno)
{
    mbm_tty tty;

    FAILS(ENOENT, mbm_tty_openWith(&tty, "/dev/no-such-terminal", &PLAIN));
    FAILS(ENOTTY, mbm_tty_openWith(&tty, "/dev/null", &PLAIN));
    assert_int_equal(tty.fd, -1);
    FAILS(EBADF, mbm_tty_attach(&tty, -1));
    FAILS(EBADF, mbm_tty_wait(&tty, 0));
    mbm_tty_close(&tty);
}

TEST(close_leaves_the_terminal_as_it_was_found)
{
    struct termios found = settings_of(line.theirs), now;
    mbm_tty tty;

    found.c_lflag |= ECHO | ICANON;
    found.c_cc[VMIN] = 7;
    cfsetispeed(&found, B1200);
    cfsetospeed(&found, B1200);
    assert_int_equal(tcsetattr(line.theirs, TCSANOW, &found), 0);
    found = settings_of(line.theirs);

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    now = settings_of(line.theirs);
    assert_int_equal(now.c_lflag & (ECHO | ICANON), 0);
    assert_int_equal(cfgetospeed(&now), B19200);
    mbm_tty_close(&tty);
    assert_int_equal(tty.fd, -1);
    now = settings_of(line.theirs);
    assert_same(&now, &found);
    mbm_tty_close(&tty);
}

TEST(detach_gives_the_descriptor_back_as_it_was)
{
    struct termios found, now;
    int flags = fcntl(line.ours, F_GETFL);
    mbm_tty tty;

    found = settings_of(line.ours);
    found.c_lflag |= ECHO;
    assert_int_equal(tcsetattr(line.ours, TCSANOW, &found), 0);
    found = settings_of(line.ours);
    assert_int_equal(mbm_tty_attach(&tty, line.ours), 0);
    assert_true(fcntl(line.ours, F_GETFL) & O_NONBLOCK);
    mbm_tty_detach(&tty);
    assert_int_equal(tty.fd, -1);
    assert_int_equal(fcntl(line.ours, F_GETFL), flags);
    now = settings_of(line.ours);
    assert_same(&now, &found);
}

TEST(an_exclusive_terminal_is_busy_for_a_second_one)
{
    mbm_tty_options options = PLAIN;
    struct termios before, after;
    mbm_tty first, second;
    int exclusive = 0;

    SKIP_IF_EMULATED();
    options.exclusive = 1;
    assert_int_equal(mbm_tty_openWith(&first, line.path, &options), 0);
    assert_int_equal(ioctl(line.theirs, TIOCGEXCL, &exclusive), 0);
    assert_int_equal(exclusive, 1);
    before = settings_of(line.theirs);
    options.baud = 1200;
    FAILS(EBUSY, mbm_tty_openWith(&second, line.path, &options));
    after = settings_of(line.theirs);
    assert_same(&before, &after);

    mbm_tty_close(&first);
    assert_int_equal(ioctl(line.theirs, TIOCGEXCL, &exclusive), 0);
    assert_int_equal(exclusive, 0);
    assert_int_equal(mbm_tty_openWith(&second, line.path, &options), 0);
    mbm_tty_close(&second);
}

TEST(a_shared_terminal_is_open_to_others_that_share_it)
{
    mbm_tty_options shared = PLAIN, exclusive = PLAIN;
    mbm_tty first, second;
    int is_exclusive = 1;

    SKIP_IF_EMULATED();
    shared.shared = 1;
    exclusive.exclusive = 1;
    assert_int_equal(mbm_tty_openWith(&first, line.path, &shared), 0);
    assert_int_equal(ioctl(line.theirs, TIOCGEXCL, &is_exclusive), 0);
    assert_int_equal(is_exclusive, 0);
    assert_int_equal(mbm_tty_openWith(&second, line.path, &shared), 0);
    mbm_tty_close(&second);
    FAILS(EBUSY, mbm_tty_openWith(&second, line.path, &exclusive));
    mbm_tty_close(&first);

    assert_int_equal(mbm_tty_openWith(&first, line.path, &exclusive), 0);
    FAILS(EBUSY, mbm_tty_openWith(&second, line.path, &shared));
    assert_int_equal(ioctl(line.theirs, TIOCGEXCL, &is_exclusive), 0);
    assert_int_equal(is_exclusive, 1);
    mbm_tty_close(&first);
}

TEST(without_a_driver_for_it_rs485_is_refused_and_nothing_is_changed)
{
    struct termios before = settings_of(line.theirs), after;
    mbm_tty_options options = PLAIN;
    mbm_tty tty;

    SKIP_IF_EMULATED();
    options.rs485 = 1;
    FAILS(ENOTTY, mbm_tty_openWith(&tty, line.path, &options));
    assert_int_equal(tty.fd, -1);
    after = settings_of(line.theirs);
    assert_same(&before, &after);
}

TEST(rs485_sets_up_the_driver_and_close_restores_it)
{
    mbm_tty_options options = PLAIN;
    mbm_tty tty;

    driver.there = 1;
    driver.longest = 100;
    driver.state.delay_rts_after_send = 42;
    options.rs485 = 1;
    options.rtsDelayBeforeMs = 3;
    options.rtsDelayAfterMs = 5;
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &options), 0);
    assert_int_equal(driver.state.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
    assert_int_equal(driver.state.delay_rts_before_send, 3);
    assert_int_equal(driver.state.delay_rts_after_send, 5);
    mbm_tty_close(&tty);
    assert_int_equal(driver.state.flags, 0);
    assert_int_equal(driver.state.delay_rts_after_send, 42);

    options.rtsLow = 1;
    options.hearSelf = 1;
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &options), 0);
    assert_int_equal(driver.state.flags,
                     SER_RS485_ENABLED | SER_RS485_RTS_AFTER_SEND | SER_RS485_RX_DURING_TX);
    mbm_tty_close(&tty);
}

TEST(received_bytes_are_handed_over_at_once_if_the_driver_can)
{
    const int other = (int)ASYNC_SKIP_TEST, at_once = (int)ASYNC_LOW_LATENCY;
    mbm_tty tty;

    driver.serial.closing_wait = 77;
    for (int i = 0; i < 4; i++) {
        const int before = i & 1 ? other | at_once : other;

        driver.has_latency = i < 2 ? 1 : 2;
        driver.serial.flags = before;
        assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
        assert_int_equal(driver.serial.flags, i < 2 ? other | at_once : before);
        mbm_tty_close(&tty);
        assert_int_equal(driver.serial.flags, before);
        assert_int_equal(driver.serial.closing_wait, 77);
    }
    driver.has_latency = 0;
}

TEST(an_rs485_delay_that_the_driver_shortens_is_refused)
{
    mbm_tty_options options = PLAIN;
    mbm_tty tty;

    driver.there = 1;
    driver.longest = 100;
    options.rs485 = 1;
    options.rtsDelayBeforeMs = 101;
    FAILS(EINVAL, mbm_tty_openWith(&tty, line.path, &options));
    assert_int_equal(driver.state.flags, 0);
}

TEST(a_lost_line_is_reported_with_its_errno)
{
    uint8_t byte;
    mbm_tty tty;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    mbm_port port = mbm_tty_port(&tty);
    assert_int_equal(port.read(port.context, &byte, 1), 0);
    assert_int_equal(port.write(port.context, (const uint8_t *)"ab", 2), 2);
    assert_int_equal(read(line.ours, &byte, 1), 1);
    assert_int_equal(tty.error, 0);
    close(line.ours);
    line.ours = -1;
    assert_true(port.read(port.context, &byte, 1) < 0);
    assert_true(tty.error == EIO || tty.error == EPIPE);
    tty.error = 0;
    assert_true(port.write(port.context, &byte, 1) < 0);
    assert_int_equal(tty.error, EIO);
    mbm_tty_close(&tty);
}

TEST(a_full_line_accepts_no_bytes_and_is_not_lost)
{
    static uint8_t much[40000];
    int16_t taken;
    mbm_tty tty;
    unsigned rounds = 0;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    mbm_port port = mbm_tty_port(&tty);
    while ((taken = port.write(port.context, much, sizeof much)) > 0)
        assert_true(++rounds < 1000);
    assert_int_equal(taken, 0);
    assert_int_equal(tcflush(tty.fd, TCIOFLUSH), 0);
    mbm_tty_close(&tty);
}

TEST(a_socket_can_be_attached)
{
    int pair[2];
    mbm_tty tty;
    uint8_t byte;

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(mbm_tty_attach(&tty, pair[0]), 0);
    mbm_port port = mbm_tty_port(&tty);
    /* A socket has no transmitter to wait for. */
    assert_int_equal(port.flush(port.context), 1);
    assert_int_equal(port.read(port.context, &byte, 1), 0);
    close(pair[1]);
    assert_int_equal(port.read(port.context, &byte, 1), -1);
    assert_int_equal(tty.error, EPIPE);
    mbm_tty_close(&tty);
}

/* --- How the options of a terminal become settings, without opening a terminal --- */

TEST_WITH(parity_stop_and_data_bits_become_settings, NULL, NULL)
{
    static const struct {
        char parity;
        uint8_t stop, data;
        tcflag_t flags;
    } rows[] = {
        {'N', 1, 8, CS8},          {'N', 2, 8, CS8 | CSTOPB},
        {'E', 1, 0, CS8 | PARENB}, {'O', 1, 8, CS8 | PARENB | PARODD},
        {'E', 1, 7, CS7 | PARENB}, {'O', 2, 7, CS7 | PARENB | PARODD | CSTOPB},
    };
    const tcflag_t all = CSIZE | PARENB | PARODD | CSTOPB | CRTSCTS | HUPCL | CLOCAL | CREAD;

    for (size_t i = 0; i < COUNT(rows); i++) {
        mbm_tty_options options = {.baud = 9600};
        struct termios settings;

        memset(&settings, 0xFF, sizeof settings);
        options.parity = rows[i].parity;
        options.stop = rows[i].stop;
        options.data = rows[i].data;
        assert_int_equal(mbm_tty_settings(&settings, &options), 0);
        assert_int_equal(settings.c_cflag & all, rows[i].flags | CLOCAL | CREAD);
        assert_int_equal(settings.c_iflag & (INPCK | IXON | IXOFF | ISTRIP | ICRNL), 0);
        assert_int_equal(settings.c_lflag & (ICANON | ECHO | ISIG), 0);
        assert_int_equal(settings.c_cc[VMIN], 1);
        assert_int_equal(cfgetospeed(&settings), B9600);
        assert_int_equal(cfgetispeed(&settings), B9600);
    }
}

/* --- What ends mbm_tty_wait, and what does not --- */

static void begin_wait(void)
{
    alarm(2 * PATIENCE_MS / 1000);
    pty_open(&line);
}

static void end_wait(void)
{
    pty_close(&line);
    alarm(0);
}

TEST_WITH(wait_ends_with_a_byte_with_the_time_or_with_the_line, begin_wait, end_wait)
{
    uint8_t byte;
    mbm_tty tty;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    mbm_port port = mbm_tty_port(&tty);
    assert_int_equal(mbm_tty_wait(&tty, 0), 0);
    double start = seconds();
    assert_int_equal(mbm_tty_wait(&tty, 30500), 0);
    assert_true(seconds() - start >= 0.0305);
    assert_int_equal(write(line.ours, "x", 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    assert_int_equal(port.read(port.context, &byte, 1), 1);
    close(line.ours);
    line.ours = -1;
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    mbm_tty_close(&tty);
}

/* A server whose function is pending reads nothing, so its program sleeps. */
TEST_WITH(bytes_that_are_not_read_do_not_end_the_next_wait, begin_wait, end_wait)
{
    uint8_t byte;
    mbm_tty tty;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    mbm_port port = mbm_tty_port(&tty);
    assert_int_equal(write(line.ours, "ab", 2), 2);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    assert_int_equal(mbm_tty_wait(&tty, 1000), 0);
    assert_int_equal(port.write(port.context, &byte, 0), 0);
    assert_int_equal(mbm_tty_wait(&tty, 1000), 0);
    /* After the program has read from the port, bytes end the wait again. */
    assert_int_equal(port.read(port.context, &byte, 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    mbm_tty_close(&tty);
}

/* A program that has sent something waits for what comes back, also if it has not read before. */
TEST_WITH(after_a_write_bytes_end_the_wait_again, begin_wait, end_wait)
{
    mbm_tty tty;

    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    mbm_port port = mbm_tty_port(&tty);
    assert_int_equal(write(line.ours, "a", 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    assert_int_equal(mbm_tty_wait(&tty, 1000), 0);
    assert_int_equal(port.write(port.context, (const uint8_t *)"b", 1), 1);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    mbm_tty_close(&tty);
}

static uint16_t pending(void *context, const mbm_request *request, uint8_t *response,
                        uint16_t capacity)
{
    return MBM_REPLY_PENDING;
}

/* The program's loop of the server while its function is pending: each round sleeps for the
 * time of pollDelay, though the next request has arrived. */
TEST_WITH(a_server_with_a_pending_function_sleeps_between_polls, begin_wait, end_wait)
{
    static const uint8_t request[] = {0x11, 0x41, 0xCD, 0xD0};
    static mbm_server server;
    static mbm_unit unit;
    static mbm_custom custom;
    uint8_t frame[MBM_MAX_FRAME];
    mbm_tty tty;

    unit.id = 0x11;
    custom.code = 0x41;
    custom.serve = pending;
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    mbm_port port = mbm_tty_port(&tty);
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    assert_int_equal(write(line.ours, request, sizeof request), sizeof request);
    AWAIT((OK(mbm_server_poll(&server)), mbm_server_pollDelay(&server) == 1000));
    assert_int_equal(write(line.ours, request, sizeof request), sizeof request);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), 1);
    for (unsigned i = 0; i < 10; i++) {
        OK(mbm_server_poll(&server));
        assert_int_equal(mbm_tty_wait(&tty, mbm_server_pollDelay(&server)), 0);
    }
    mbm_tty_close(&tty);
}

static void ignore_signal(int signal_number) {}

static volatile int waited;

/* A signal before the wait does not end it, so this thread sends one after the other. */
static void *interrupt(void *thread)
{
    while (!waited) {
        usleep(10000);
        pthread_kill(*(pthread_t *)thread, SIGUSR1);
    }
    return NULL;
}

TEST_WITH(a_signal_ends_the_wait, begin_wait, end_wait)
{
    struct sigaction action = {0};
    pthread_t self = pthread_self(), other;
    double start = seconds();
    mbm_tty tty;

    action.sa_handler = ignore_signal;
    sigaction(SIGUSR1, &action, NULL);
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &PLAIN), 0);
    assert_int_equal(pthread_create(&other, NULL, interrupt, &self), 0);
    assert_int_equal(mbm_tty_wait(&tty, 60000000), 0);
    waited = 1;
    pthread_join(other, NULL);
    assert_true(seconds() - start < 50);
    mbm_tty_close(&tty);
}
