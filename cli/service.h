/* What mbm gateway and mbm bridge have as services: statistics in a file and for Prometheus, the
 * level of log lines, SIGHUP and SIGUSR1, and reports to systemd. */
#pragma once

#include "mbm.h"
#include "http.h"

#include <argp.h>
#include <signal.h>
#include <stddef.h>
#include <stdint.h>

/* A number: its name in JSON, which Prometheus' name has too, and what it counts. */
typedef struct stats_kind {
    const char *name, *help;
    uint8_t is_counter; /* it only grows: Prometheus' name ends with _total */
} stats_kind;

enum { STATS_LINES = 32, STATS_OF_LINE = 10, STATS_OF_PROGRAM = 12 };

/* What is known of a line. */
typedef struct stats_line {
    const char *name;
    const mbm_counters *counters;
    const mbm_linkCounters *link; /* NULL: the line has no link */
    uint8_t is_up;
} stats_line;

typedef struct stats {
    const char *command;     /* "gateway" */
    const stats_kind *kinds; /* of the program */
    size_t count;
    uint64_t values[STATS_OF_PROGRAM];
    stats_line lines[STATS_LINES];
    size_t line_count;
} stats;

/* A service. It is zeroed at first, and the input of options_service. */
typedef struct service {
    const char *stats_path, *metrics_place;
    uint32_t every; /* milliseconds; 0: only at the end and when SIGUSR1 comes */
    int64_t next_time;
    void (*fill_numbers)(void *context, stats *numbers);
    void *fill_context;
    sigset_t awake; /* the signal mask during a sleep */
    int had_terminal, stats_failed;
    http metrics;
} service;

/* WAITS: the descriptors that service_wait adds to those of the program. POLLS: how often an object
 * is polled at most in one round while its pollDelay is 0, so that the other descriptors are not
 * forgotten. */
enum { SERVICE_WAITS = HTTP_WAITS, SERVICE_POLLS = 4 };

/* --stats, --stats-every, --metrics and --log-level. */
extern const struct argp options_service;

#define SERVICE_HELP                                                                                  \
    "SIGUSR1 writes the statistics. systemd learns when the service is ready, and when it reads its " \
    "files again (Type=notify).\n\n"

/* Begins: `fill` is called with `context` for the numbers when they are wanted. The signals that
 * end or wake the program are blocked from now on, except in service_wait. Returns an exit code
 * after reporting the reason.
 */
int service_begin(service *s, void (*fill)(void *context, stats *numbers), void *context);

/* Sleeps until a descriptor is ready, at most for a time in microseconds, UINT32_MAX without a
 * limit. `polls` has room for SERVICE_WAITS more than `count`. Returns as ppoll does. */
int service_wait(service *s, struct pollfd *polls, nfds_t count, uint32_t micros);

/* Serves what has come meanwhile. Call it in each round. */
void service_work(service *s);

/* Returns 1 once after each SIGHUP. After the loss of the terminal that began the program, SIGHUP
 * ends it instead. */
int service_reload_is_wanted(const service *s);

/* Reports to systemd, and does nothing without it: the service is ready, reads its files, ends. */
void service_is_ready(void);
void service_is_reloading(void);

/* Writes the statistics, and closes what service_begin has opened. */
void service_end(service *s);
