/* What mbm gateway and mbm bridge have as services: statistics in a file and for Prometheus, the
 * level of log lines, SIGHUP and SIGUSR1, and reports to systemd.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef SERVICE_H
#define SERVICE_H

#include "metrics.h"
#include "stats.h"

#include <argp.h>

/* WAITS: the descriptors that service_wait adds to those of the program. POLLS: how often an object
 * is polled at most in one round while its pollDelay is 0, so that the other descriptors are not
 * forgotten. */
enum { SERVICE_WAITS = METRICS_WAITS, SERVICE_POLLS = 4 };

/* --stats, --stats-every, --metrics and --log-level. */
extern const struct argp options_service;

#define SERVICE_HELP                                                                                  \
    "SIGUSR1 writes the statistics. systemd learns when the service is ready, and when it reads its " \
    "files again (Type=notify).\n\n"

/* Begins: `fill` is called with `context` for the numbers when they are wanted. The signals that
 * end or wake the program are blocked from now on, except in service_wait. Returns an exit code
 * after reporting the reason.
 */
int service_begin(void (*fill)(void *context, stats *numbers), void *context);

/* Sleeps until a descriptor is ready, at most for a time in microseconds, UINT32_MAX without a
 * limit. `polls` has room for SERVICE_WAITS more than `count`. Returns as ppoll does. */
int service_wait(struct pollfd *polls, nfds_t count, uint32_t micros);

/* Serves what has come meanwhile. Call it in each round. */
void service_work(void);

/* Returns 1 once after each SIGHUP. After the loss of the terminal that began the program, SIGHUP
 * ends it instead. */
int service_reload_is_wanted(void);

/* Reports to systemd, and does nothing without it: the service is ready, reads its files, ends. */
void service_is_ready(void);
void service_is_reloading(void);

/* Writes the statistics, and closes what service_begin has opened. */
void service_end(void);

#endif
