/* Runs what services share: signals, systemd, statistics, and the wait for descriptors.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "service.h"

#include "clock.h"
#include "options.h"
#include "report.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

static const char *stats_path, *metrics_place;
static uint32_t every; /* milliseconds; 0: only at the end and when SIGUSR1 comes */
static int64_t next_time;
static void (*fill_numbers)(void *context, stats *numbers);
static void *fill_context;
static sigset_t awake; /* the signal mask during a sleep */
static int had_terminal, stats_failed;
static volatile sig_atomic_t reload_wanted, stats_wanted;

/* --- signals --- */

static void on_reload(int number)
{
    (void)number;
    reload_wanted = 1;
}

static void on_stats(int number)
{
    (void)number;
    stats_wanted = 1;
}

static void catch_signals(void)
{
    struct sigaction action = {0};
    sigset_t all;

    action.sa_handler = on_reload;
    sigaction(SIGHUP, &action, NULL);
    action.sa_handler = on_stats;
    sigaction(SIGUSR1, &action, NULL);
    sigemptyset(&all);
    sigaddset(&all, SIGINT);
    sigaddset(&all, SIGTERM);
    sigaddset(&all, SIGHUP);
    sigaddset(&all, SIGUSR1);
    /* pthread_sigmask, because the thread of libmosquitto must not take them either. */
    pthread_sigmask(SIG_BLOCK, &all, &awake);
    had_terminal = isatty(0);
}

int service_reload_is_wanted(void)
{
    const int is_wanted = reload_wanted;

    reload_wanted = 0;
    if (is_wanted && had_terminal && !isatty(0)) {
        report_stopped = 1;
        return 0;
    }
    return is_wanted;
}

/* --- systemd --- */

static void notify(const char *text)
{
    const char *path = getenv("NOTIFY_SOCKET");
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    size_t length;
    int fd;

    if (!path || (path[0] != '/' && path[0] != '@') || strlen(path) >= sizeof to.sun_path)
        return;
    length = strlen(path);
    memcpy(to.sun_path, path, length);
    /* A name in the abstract namespace begins with a zero byte. */
    if (path[0] == '@')
        to.sun_path[0] = '\0';
    fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return;
    (void)sendto(fd, text, strlen(text), MSG_NOSIGNAL | MSG_DONTWAIT, (const struct sockaddr *)&to,
                 (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length));
    close(fd);
}

void service_is_ready(void)
{
    notify("READY=1");
}

void service_is_reloading(void)
{
    char text[64];

    snprintf(text, sizeof text, "RELOADING=1\nMONOTONIC_USEC=%" PRIu64,
             clock_micros(CLOCK_MONOTONIC));
    notify(text);
}

/* --- statistics --- */

static char *take(char *(*as_text)(const stats *from))
{
    static stats numbers;

    memset(&numbers, 0, sizeof numbers);
    fill_numbers(fill_context, &numbers);
    return as_text(&numbers);
}

static char *render(void)
{
    return take(stats_prometheus);
}

/* Writes a line to a file. Returns 0, or -1 with errno set. */
static int write_line(const char *path, const char *text)
{
    FILE *file = fopen(path, "we");
    int result;

    if (!file)
        return -1;
    result = fprintf(file, "%s\n", text) < 0;
    if (fclose(file) != 0 || result)
        return -1;
    return 0;
}

/* Replaces a regular file as a whole, so that a reader never sees half of it, and a full disk
 * leaves the one before. */
static int replace_file(const char *path, const char *text)
{
    struct stat known;
    char next[4096];
    int error;

    if (stat(path, &known) == 0 && !S_ISREG(known.st_mode))
        return write_line(path, text);
    if ((size_t)snprintf(next, sizeof next, "%s.new", path) >= sizeof next) {
        errno = ENAMETOOLONG;
        return -1;
    }
    if (write_line(next, text) == 0 && rename(next, path) == 0)
        return 0;
    error = errno;
    (void)unlink(next);
    errno = error;
    return -1;
}

/* Writes the statistics. A failure is reported once, until it is over. */
static void write_stats(void)
{
    char *text = stats_path ? take(stats_json) : NULL;

    if (!stats_path)
        return;
    if (text && strcmp(stats_path, "-") == 0) {
        puts(text);
        report_flush();
    } else if (!text || replace_file(stats_path, text) != 0) {
        if (!stats_failed)
            report_log(REPORT_ERROR, "%s: %s. The statistics are not written", stats_path,
                       text ? strerror(errno) : "not enough memory");
        stats_failed = 1;
    } else {
        if (stats_failed)
            report_log(REPORT_INFO, "%s: the statistics are written again", stats_path);
        stats_failed = 0;
    }
    free(text);
}

/* --- the life of a service --- */

int service_begin(void (*fill)(void *context, stats *numbers), void *context)
{
    fill_numbers = fill;
    fill_context = context;
    catch_signals();
    if (metrics_place) {
        const int port = metrics_listen(metrics_place);

        if (port < 0)
            return report(CODE_LINE, "--metrics %s: %s", metrics_place, strerror(errno));
        report_log(REPORT_INFO, "metrics are at port %d, /metrics", port);
    }
    next_time = clock_milliseconds() + every;
    return CODE_DONE;
}

int service_wait(struct pollfd *polls, nfds_t count, uint32_t micros)
{
    const uint32_t delay = metrics_delay();
    struct timespec time;
    nfds_t added;
    int found;

    if (report_stopped)
        return 0;
    if (delay < micros)
        micros = delay;
    if (every > 0) {
        const int64_t left = next_time - clock_milliseconds();

        if (left <= 0)
            micros = 0;
        else if (left * 1000 < micros)
            micros = (uint32_t)(left * 1000);
    }
    added = metrics_wait(polls + count);
    time = (struct timespec){(time_t)(micros / 1000000u), (long)(micros % 1000000u) * 1000};
    found = ppoll(polls, count + added, micros == UINT32_MAX ? NULL : &time, &awake);
    if (found > 0)
        metrics_polled(polls + count, added);
    return found;
}

void service_work(void)
{
    metrics_work(render);
    if (every > 0 && clock_milliseconds() >= next_time) {
        next_time = clock_milliseconds() + every;
        stats_wanted = 1;
    }
    if (!stats_wanted)
        return;
    stats_wanted = 0;
    write_stats();
}

void service_end(void)
{
    notify("STOPPING=1");
    write_stats();
    metrics_close();
}

/* --- the command line --- */

enum { STATS = 0x3000, STATS_EVERY, METRICS, LOG_LEVEL };

static error_t parse(int key, char *text, struct argp_state *state)
{
    const char *wrong;

    switch (key) {
    case STATS: stats_path = text; return 0;
    case STATS_EVERY: every = options_time(state, "--stats-every", text, 100, 86400000); return 0;
    case METRICS:
        metrics_place = text;
        wrong = metrics_check(text);
        if (wrong)
            options_wrong(state, "--metrics \"%s\" %s", text, wrong);
        return 0;
    case LOG_LEVEL:
        report_level =
            report_level_numbers[options_word(state, "--log-level", text, report_level_names)];
        return 0;
    case ARGP_KEY_END:
        if (every > 0 && !stats_path)
            options_wrong(state, "--stats-every needs --stats");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"stats", STATS, "FILE", 0,
     "Write statistics as JSON at the end and after SIGUSR1; - is standard output", 7},
    {"stats-every", STATS_EVERY, "TIME", 0, "How often to write them too, such as 10s", 7},
    {"metrics", METRICS, "ADDRESS:PORT", 0,
     "Serve the statistics to Prometheus at an address of this machine, such as 127.0.0.1:9100", 7},
    {"log-level", LOG_LEVEL, "LEVEL", 0,
     "Print log lines up to this level: error, warning, info or debug (info)", 7},
    {0}};

const struct argp options_service = {.options = texts, .parser = parse};
