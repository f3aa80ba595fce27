/* A gateway from Modbus TCP to the devices of serial lines and of TCP: `mbm gateway`, a program
 * over mbm_gateway.
 *
 * The gateway never blocks, except to look up a host by name: while one line waits for a device,
 * the others and all connections go on. docs/gateway.md says what a client gets.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "commands.h"
#include "gateway_line.h"
#include "options.h"
#include "report.h"
#include "trace.h"

#include <errno.h>
#include <netdb.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum {
    CONNECTIONS = 16,
    MOST_CONNECTIONS = UINT8_MAX,
    SHARED_REQUESTS = 128, /* the places for requests beside one for each connection */
    LINES = 32,
    NAP_MICROS = 10000 /* the sleep if the system refuses to poll */
};

/* All storage is the program's own; mbm allocates nothing. */
static gateway_line lines[LINES];
static mbm_gateway gateway = MBM_INIT;
static mbm_gatewayLine gateway_lines[LINES] = MBM_INIT;
static mbm_gatewayRoute routes[256];
static mbm_gatewayConnection connections[MOST_CONNECTIONS] = MBM_INIT;
static mbm_gatewayRequest requests[MOST_CONNECTIONS + SHARED_REQUESTS] = MBM_INIT;
static mbm_gatewayConfig config = {
    .routes = routes,
    .lines = gateway_lines,
    .connections = connections,
    .requests = requests,
};
static mbm_tcp tcps[MOST_CONNECTIONS] = MBM_INIT;
static mbm_tcp_listener listener = MBM_INIT;
static unsigned long connected;
static sigset_t awake; /* the signal mask during a sleep, which SIGINT and SIGTERM may end */

/* What the command line says. */
static struct {
    place listen;
    uint32_t idleMs;
    uint16_t timeoutMs, quietMs, queueMs;
    uint8_t connections, requests, in_flight, is_quiet;
} settings = {.idleMs = 60000,
              .timeoutMs = 1000,
              .quietMs = 100,
              .connections = CONNECTIONS,
              .requests = 8,
              .in_flight = 1};

/* --- the map of units --- */

/* Reads a number from 0 to 255. Returns what follows it, or NULL. */
static const char *read_unit(const char *text, unsigned *unit)
{
    const size_t digits = strspn(text, "0123456789");

    *unit = digits > 0 && digits <= 3 ? (unsigned)strtoul(text, NULL, 10) : 256;
    return *unit <= 255 ? text + digits : NULL;
}

/* Adds FIRST[-LAST][=UNIT]. Returns NULL, or what is wrong with it. */
static const char *add_route(const char *text, uint8_t to)
{
    unsigned first, last, unit, i;

    if (config.routeCount == UINT8_MAX)
        return "a gateway has at most 255 ranges";
    text = read_unit(text, &first);
    last = first;
    if (text && *text == '-')
        text = read_unit(text + 1, &last);
    unit = first;
    if (text && *text == '=')
        text = read_unit(text + 1, &unit);
    if (!text || *text)
        return "units are FIRST-LAST or FIRST-LAST=UNIT, from 0 to 255, such as 1-31 or 101-131=1";
    if (first > last)
        return "the first unit of a range is above its last one";
    if (unit + last - first > 255)
        return "the last unit of the range would be above 255 on the line";
    for (i = 0; i < config.routeCount; i++)
        if (first <= routes[i].last && last >= routes[i].first)
            return "a range before has one of these units";
    routes[config.routeCount++] =
        (mbm_gatewayRoute){(uint16_t)first, (uint16_t)last, to, (uint16_t)unit};
    return NULL;
}

/* Reads UNITS, ranges with commas between them, of the last line. */
static void read_units(const struct argp_state *state, const char *text)
{
    char copy[1024], *rest = NULL, *range;
    const char *wrong = NULL;

    if (strlen(text) >= sizeof copy || !*text || text[strlen(text) - 1] == ',')
        wrong = "units are ranges with commas between them, such as 1-31,101-131=1";
    snprintf(copy, sizeof copy, "%s", text);
    for (range = strtok_r(copy, ",", &rest); range && !wrong; range = strtok_r(NULL, ",", &rest))
        wrong = add_route(range, (uint8_t)(config.lineCount - 1));
    if (wrong)
        options_wrong(state, "UNITS \"%s\": %s", text, wrong);
}

static void add_line(const struct argp_state *state, const char *text)
{
    const char *wrong;

    if (config.lineCount == LINES)
        options_wrong(state, "\"%s\" is one line too many: %d are allowed", text, LINES);
    wrong = gateway_line_read(&lines[config.lineCount], text);
    if (wrong)
        options_wrong(state, "%s", wrong);
    config.lineCount++;
}

/* Begins the gateway and its lines, with all settings. */
static void begin(void)
{
    unsigned i;

    for (i = 0; i < config.lineCount; i++) {
        gateway_line *line = &lines[i];

        gateway_line_begin(line, settings.timeoutMs, settings.quietMs);
        gateway_lines[i] = (mbm_gatewayLine){
            .client = &line->client,
            .context = line,
            .isReady = gateway_line_isReady,
            .inFlight = line->place.framing == MBM_FRAMING_TCP ? settings.in_flight : 1};
    }
    config.connectionCount = settings.connections;
    config.requestCount = (uint16_t)(settings.connections + SHARED_REQUESTS);
    (void)mbm_gateway_begin(&gateway, &config);
    (void)mbm_gateway_setInFlight(&gateway, settings.requests);
    (void)mbm_gateway_setQueueTime(&gateway, settings.queueMs);
    listener.idleTimeMs = settings.idleMs;
}

/* --- connections --- */

static void take_connections(void)
{
    int slot;

    while ((slot = mbm_tcp_accept(&listener, tcps, config.connectionCount)) >= 0) {
        char name[24];
        mbm_port port;

        connected++;
        snprintf(name, sizeof name, "client %d", slot);
        port = trace_server(mbm_tcp_port(&tcps[slot]), MBM_FRAMING_TCP, name);
        if (mbm_gateway_open(&gateway, (uint8_t)slot, &port) != MBM_OK)
            mbm_tcp_close(&tcps[slot]);
    }
}

/* Gives the requests of a connection up, and closes it. */
static void drop_connection(unsigned slot)
{
    mbm_gateway_close(&gateway, (uint8_t)slot);
    mbm_tcp_close(&tcps[slot]);
}

/* The events to poll a connection for. */
static short events_of(unsigned slot)
{
    const int reads = mbm_gateway_isReading(&gateway, (uint8_t)slot);

    return (short)((reads ? POLLIN : 0) | (tcps[slot].events & POLLOUT));
}

/* --- all of it --- */

/* The descriptors of one sleep. A descriptor that is not open is left out, since the system
 * refuses a list that is longer than the limit of descriptors. */
static struct {
    struct pollfd polls[1 + LINES + MOST_CONNECTIONS];
    uint8_t slots[1 + LINES + MOST_CONNECTIONS]; /* of the connections */
    nfds_t count;
} waits;

static int sleep_for(uint32_t micros)
{
    const struct timespec time = {(time_t)(micros / 1000000u), (long)(micros % 1000000u) * 1000};

    return ppoll(waits.polls, waits.count, micros == UINT32_MAX ? NULL : &time, &awake);
}

/* Sleeps until there is something to do. */
static void wait_for_work(void)
{
    uint32_t delay = mbm_gateway_pollDelay(&gateway);
    nfds_t clients, n;
    unsigned i;

    waits.count = 0;
    for (i = 0; i < config.connectionCount; i++)
        if (mbm_tcp_isInUse(&tcps[i])) {
            waits.slots[waits.count] = (uint8_t)i;
            waits.polls[waits.count++] = (struct pollfd){tcps[i].fd, events_of(i), 0};
        }
    clients = waits.count;
    for (i = 0; i < config.lineCount; i++)
        waits.count += (nfds_t)gateway_line_wait(&lines[i], &waits.polls[waits.count]);
    if (listener.events)
        waits.polls[waits.count++] = (struct pollfd){listener.fd, POLLIN, 0};
    else if (delay > MBM_TCP_RETRY)
        delay = MBM_TCP_RETRY;
    if (sleep_for(delay) < 0 && errno != EINTR) {
        /* The system refuses to poll: it has no memory, or the limit of descriptors was
         * lowered. */
        waits.count = 0;
        (void)sleep_for(NAP_MICROS);
        return;
    }
    for (n = 0; n < clients; n++) {
        const struct pollfd *one = &waits.polls[n];

        if (!(one->events & POLLIN) && (one->revents & (POLLERR | POLLHUP | POLLNVAL)))
            drop_connection(waits.slots[n]);
    }
}

/* One round of the loop. */
static void work(void)
{
    unsigned slot;

    take_connections();
    mbm_gateway_poll(&gateway);
    for (slot = 0; slot < config.connectionCount; slot++) {
        if (!mbm_tcp_isInUse(&tcps[slot]))
            continue;
        /* A connection is not idle while its device has not answered. */
        tcps[slot].isBusy = mbm_gateway_pending(&gateway, (uint8_t)slot) != 0;
        if (mbm_gateway_status(&gateway, (uint8_t)slot) != MBM_OK)
            drop_connection(slot);
    }
    wait_for_work();
}

static void print_summary(void)
{
    unsigned i;

    fprintf(stderr, "%s: connections: %lu, refused: %u, closed as idle: %u.\n", report_name,
            connected, listener.refused, listener.idle);
    for (i = 0; i < config.lineCount; i++) {
        const mbm_counters *counts = &lines[i].counters;

        fprintf(stderr,
                "%s: %s: requests: %u, replies: %u, exceptions: %u, timeouts: %u, bad CRCs: %u.\n",
                report_name, lines[i].place.text, counts->requests, counts->replies,
                counts->exceptions, counts->timeouts, counts->badCrc);
    }
}

/* --- the command line --- */

enum { IDLE = 0x100, IN_FLIGHT, QUEUE_TIME, QUIET_TIME, REQUESTS, TIMEOUT };

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 'c':
        settings.connections =
            (uint8_t)options_number(state, "--connections", text, 1, MOST_CONNECTIONS);
        return 0;
    case 'q': settings.is_quiet = 1; return 0;
    case REQUESTS:
        settings.requests = (uint8_t)options_number(state, "--requests", text, 1, SHARED_REQUESTS);
        return 0;
    case IN_FLIGHT:
        settings.in_flight =
            (uint8_t)options_number(state, "--in-flight", text, 1, MBM_CLIENT_DEPTH);
        return 0;
    case IDLE: settings.idleMs = options_time(state, "--idle", text, 0, 1000000000); return 0;
    case TIMEOUT:
        settings.timeoutMs = (uint16_t)options_time(state, "--timeout", text, 1, UINT16_MAX);
        return 0;
    case QUIET_TIME:
        settings.quietMs = (uint16_t)options_time(state, "--quiet-time", text, 0, UINT16_MAX);
        return 0;
    case QUEUE_TIME:
        settings.queueMs = (uint16_t)options_time(state, "--queue-time", text, 0, UINT16_MAX);
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num % 2 == 1)
            add_line(state, text);
        else if (state->arg_num > 0)
            read_units(state, text);
        else
            options_place(state, &settings.listen, text, 1);
        return 0;
    case ARGP_KEY_END:
        if (state->arg_num < 3)
            options_wrong(state, "a gateway needs LISTEN, and for each LINE its UNITS");
        if (state->arg_num % 2 == 0)
            options_wrong(state, "UNITS of the last line are missing, such as 1-31");
        if (settings.listen.kind != PLACE_TCP)
            options_wrong(state, "LISTEN \"%s\": a gateway listens at tcp://, such as tcp://:502",
                          settings.listen.text);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"connections", 'c', "N", 0,
     "Places for clients, 1 to 255 (16). A client that finds no place is disconnected at once", 1},
    {"requests", REQUESTS, "N", 0,
     "Requests of one connection that are under way at once, 1 to 128 (8)", 1},
    {"idle", IDLE, "TIME", 0,
     "How long a connection is idle before it may be closed for a new client (1m); 0s for never",
     1},
    {"in-flight", IN_FLIGHT, "N", 0,
     "Requests that are under way at once on a line tcp://, 1 to 16 (1)", 2},
    {"timeout", TIMEOUT, "TIME", 0,
     "How long a device may take to reply, and a connection to it to be made, up to 65s (1s)", 2},
    {"quiet-time", QUIET_TIME, "TIME", 0,
     "How long a line is left alone after a request without a right reply (100ms)", 2},
    {"queue-time", QUEUE_TIME, "TIME", 0,
     "How long a request may wait for its line; then it gets exception 0A (0s, for any time)", 2},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 3},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {{&options_trace, 0, NULL, 0}, {NULL, 0, NULL, 0}};
static const struct argp parser = {
    texts,
    parse,
    "LISTEN LINE UNITS [LINE UNITS]...",
    "Passes requests from Modbus TCP to the devices of serial lines and of TCP.\v"
    "LISTEN is where clients connect: tcp://:502, or tcp://ADDRESS:PORT for one address of this "
    "machine; with port 0 it is a free one. mbm prints \"ready PORT\" once it listens.\n\n"
    "UNITS are the unit ids of the LINE before: FIRST-LAST, or FIRST-LAST=UNIT if the unit FIRST of "
    "clients is UNIT on the line. Several ranges have commas between them. 0=0 passes broadcasts.\n\n"
    "Example:\n\n"
    "  mbm gateway tcp://:502 rtu:/dev/ttyUSB0 1-31 tcp://192.168.0.7 101-131=1\n\n"
    "The lines of a gateway are rtu:, ascii:, tcp:// and rtu+tcp://.\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

int gateway_command(int argc, char **argv)
{
    sigset_t ends;
    unsigned i;

    argp_parse(&parser, argc, argv, 0, NULL, NULL);
    begin();
    if (mbm_tcp_listen(&listener, place_host(&settings.listen), settings.listen.service) != 0)
        return report(CODE_LINE, "%s: %s%s", settings.listen.text,
                      listener.lookupError ? gai_strerror(listener.lookupError) : strerror(errno),
                      errno == EACCES       ? ". Ports below 1024 need the right to them"
                      : errno == EADDRINUSE ? ". Another program listens there"
                                            : "");
    sigemptyset(&ends);
    sigaddset(&ends, SIGINT);
    sigaddset(&ends, SIGTERM);
    sigprocmask(SIG_BLOCK, &ends, &awake);
    printf("ready %u\n", listener.port);
    fflush(stdout);
    while (!report_stopped)
        work();
    for (i = 0; i < config.connectionCount; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            drop_connection(i);
    for (i = 0; i < config.lineCount; i++)
        gateway_line_close(&lines[i]);
    if (!settings.is_quiet)
        print_summary();
    mbm_tcp_closeListener(&listener);
    return CODE_DONE;
}
