/* Runs what services share: signals, systemd, statistics, and the wait for descriptors. */
#include "service.h"

#include "clock.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
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

/* Set by signals. */
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

static void catch_signals(service *s)
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
    pthread_sigmask(SIG_BLOCK, &all, &s->awake);
    s->had_terminal = isatty(0);
}

int service_reload_is_wanted(const service *s)
{
    const int is_wanted = reload_wanted;

    reload_wanted = 0;
    if (is_wanted && s->had_terminal && !isatty(0)) {
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

/* --- the statistics as JSON --- */

/* The numbers of a line, in the order of line_values. */
static const stats_kind OF_LINE[STATS_OF_LINE] = {
    {"requests", "Requests sent, repetitions too.", 1},
    {"replies", "Replies to these requests, exceptions too.", 1},
    {"exceptions", "Replies that were exceptions.", 1},
    {"timeouts", "Requests without a reply in time.", 1},
    {"bad_crcs", "Requests whose reply was damaged.", 1},
    {"foreign_frames", "Frames of other units and late replies.", 1},
    {"bytes_sent", "Bytes sent.", 1},
    {"bytes_received", "Bytes received.", 1},
    {"reconnects", "How often the line was opened again.", 1},
    {"line_up", "1 while the line is open.", 0},
};

static void line_values(const stats_line *line, uint64_t values[STATS_OF_LINE])
{
    const mbm_counters *counters = line->counters;

    values[0] = counters->requests;
    values[1] = counters->replies;
    values[2] = counters->exceptions;
    values[3] = counters->timeouts;
    values[4] = counters->badCrc;
    values[5] = counters->foreignFrames;
    values[6] = counters->bytesSent;
    values[7] = counters->bytesReceived;
    values[8] = line->link && line->link->connected > 0 ? line->link->connected - 1 : 0;
    values[9] = line->is_up;
}

/* Both return a text that the caller frees, or NULL without memory. */
static char *stats_json(const stats *from)
{
    cJSON *root = cJSON_CreateObject(), *list;
    char when[CLOCK_TEXT_BYTES];
    size_t at, line;
    char *text;

    cJSON_AddStringToObject(root, "time", clock_now_text(when));
    cJSON_AddStringToObject(root, "command", from->command);
    for (at = 0; at < from->count; at++)
        cJSON_AddNumberToObject(root, from->kinds[at].name, (double)from->values[at]);
    list = cJSON_AddArrayToObject(root, "lines");
    for (line = 0; line < from->line_count; line++) {
        cJSON *one = cJSON_CreateObject();
        uint64_t values[STATS_OF_LINE];

        line_values(&from->lines[line], values);
        cJSON_AddStringToObject(one, "line", from->lines[line].name);
        for (at = 0; at < STATS_OF_LINE; at++)
            cJSON_AddNumberToObject(one, OF_LINE[at].name, (double)values[at]);
        cJSON_AddItemToArray(list, one);
    }
    text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}

/* --- the statistics in Prometheus' text format 0.0.4 --- */

static void print_head(FILE *to, const stats *from, const stats_kind *kind)
{
    const char *end = kind->is_counter ? "_total" : "";

    fprintf(to, "# HELP mbm_%s_%s%s %s\n# TYPE mbm_%s_%s%s %s\n", from->command, kind->name, end,
            kind->help, from->command, kind->name, end, kind->is_counter ? "counter" : "gauge");
}

/* Backslash, quote and line feed are escaped in the value of a label. */
static void print_label(FILE *to, const char *text)
{
    for (; *text; text++) {
        if (*text == '\\' || *text == '"')
            fputc('\\', to);
        if (*text == '\n')
            fputs("\\n", to);
        else
            fputc(*text, to);
    }
}

static char *stats_prometheus(const stats *from)
{
    uint64_t values[STATS_OF_LINE];
    char *text = NULL;
    size_t length, at, line;
    FILE *to = open_memstream(&text, &length);

    if (!to)
        return NULL;
    for (at = 0; at < from->count; at++) {
        print_head(to, from, &from->kinds[at]);
        fprintf(to, "mbm_%s_%s%s %" PRIu64 "\n", from->command, from->kinds[at].name,
                from->kinds[at].is_counter ? "_total" : "", from->values[at]);
    }
    for (at = 0; at < STATS_OF_LINE; at++) {
        print_head(to, from, &OF_LINE[at]);
        for (line = 0; line < from->line_count; line++) {
            line_values(&from->lines[line], values);
            fprintf(to, "mbm_%s_%s%s{line=\"", from->command, OF_LINE[at].name,
                    OF_LINE[at].is_counter ? "_total" : "");
            print_label(to, from->lines[line].name);
            fprintf(to, "\"} %" PRIu64 "\n", values[at]);
        }
    }
    if (fclose(to) != 0) {
        free(text);
        return NULL;
    }
    return text;
}

/* --- writing them --- */

static char *take(service *s, char *(*as_text)(const stats *from))
{
    static stats numbers;

    memset(&numbers, 0, sizeof numbers);
    s->fill_numbers(s->fill_context, &numbers);
    return as_text(&numbers);
}

static char *render(void *context)
{
    return take((service *)context, stats_prometheus);
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
static void write_stats(service *s)
{
    char *text = s->stats_path ? take(s, stats_json) : NULL;

    if (!s->stats_path)
        return;
    if (text && strcmp(s->stats_path, "-") == 0) {
        puts(text);
        report_flush();
    } else if (!text || replace_file(s->stats_path, text) != 0) {
        if (!s->stats_failed)
            report_log(REPORT_ERROR, "%s: %s. The statistics are not written", s->stats_path,
                       text ? strerror(errno) : "not enough memory");
        s->stats_failed = 1;
    } else {
        if (s->stats_failed)
            report_log(REPORT_INFO, "%s: the statistics are written again", s->stats_path);
        s->stats_failed = 0;
    }
    free(text);
}

/* --- the life of a service --- */

int service_begin(service *s, void (*fill)(void *context, stats *numbers), void *context)
{
    s->fill_numbers = fill;
    s->fill_context = context;
    catch_signals(s);
    if (s->metrics_place) {
        static const http_page pages[] = {{.path = "/metrics",
                                           .type = "text/plain; version=0.0.4; charset=utf-8",
                                           .render = render},
                                          {0}};
        int port;

        s->metrics.pages = pages;
        s->metrics.context = s;
        port = http_listen(&s->metrics, s->metrics_place);
        if (port < 0)
            return report(CODE_LINE, "--metrics %s: %s", s->metrics_place, strerror(errno));
        report_log(REPORT_INFO, "metrics are at port %d, /metrics", port);
    }
    s->next_time = clock_milliseconds() + s->every;
    return CODE_DONE;
}

int service_wait(service *s, struct pollfd *polls, nfds_t count, uint32_t micros)
{
    const uint32_t delay = http_delay(&s->metrics);
    struct timespec time;
    nfds_t added;
    int found;

    if (report_stopped)
        return 0;
    if (delay < micros)
        micros = delay;
    if (s->every > 0) {
        const int64_t left = s->next_time - clock_milliseconds();

        if (left <= 0)
            micros = 0;
        else if (left * 1000 < micros)
            micros = (uint32_t)(left * 1000);
    }
    added = http_wait(&s->metrics, polls + count);
    time = clock_timespec(micros);
    found = ppoll(polls, count + added, micros == UINT32_MAX ? NULL : &time, &s->awake);
    if (found > 0)
        http_polled(&s->metrics, polls + count, added);
    return found;
}

void service_work(service *s)
{
    http_work(&s->metrics);
    if (s->every > 0 && clock_milliseconds() >= s->next_time) {
        s->next_time = clock_milliseconds() + s->every;
        stats_wanted = 1;
    }
    if (!stats_wanted)
        return;
    stats_wanted = 0;
    write_stats(s);
}

void service_end(service *s)
{
    notify("STOPPING=1");
    write_stats(s);
    http_close(&s->metrics);
}

/* --- the command line --- */

enum { STATS = 0x3000, STATS_EVERY, METRICS, LOG_LEVEL };

static error_t parse(int key, char *text, struct argp_state *state)
{
    service *s = (service *)state->input;
    const char *wrong;

    switch (key) {
    case STATS: s->stats_path = text; return 0;
    case STATS_EVERY:
        s->every = options_time(state, "--stats-every", text, 100, 86400000);
        return 0;
    case METRICS:
        s->metrics_place = text;
        wrong = http_check(text, 0);
        if (wrong)
            options_wrong(state, "--metrics \"%s\" %s", text, wrong);
        return 0;
    case LOG_LEVEL:
        report_level =
            report_level_numbers[options_word(state, "--log-level", text, report_level_names)];
        return 0;
    case ARGP_KEY_END:
        if (s->every > 0 && !s->stats_path)
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
