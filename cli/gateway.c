/* A gateway from Modbus TCP to the devices of serial lines and of TCP: `mbm gateway`, a program
 * over mbm_gateway.
 *
 * The gateway never blocks, except to look up a host by name: while one line waits for a device,
 * the others and all connections go on. docs/gateway.md says what a client gets. */
#include "port_over.h"
#include "advice.h"
#include "clock.h"
#include "gateway_file.h"
#include "line.h"
#include "options.h"
#include "report.h"
#include "service.h"
#include "trace.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    CONNECTIONS = 16,
    SPARE_LINES = 4,    /* places for lines that a reload may add */
    NAP_MICROS = 10000, /* the sleep if the system refuses to poll */
    ROUTES = UINT8_MAX
};

/* The descriptors of one sleep. A descriptor that is not open is left out, since the system
 * refuses a list that is longer than the limit of descriptors. */
typedef struct sleep_waits {
    struct pollfd polls[1 + GATEWAY_LINES + GATEWAY_CONNECTIONS + SERVICE_WAITS];
    uint8_t slots[GATEWAY_LINES + GATEWAY_CONNECTIONS]; /* of clients, and then of lines */
    nfds_t clients, count;
} sleep_waits;

/* A line of the gateway: a place for a serial line, or for a device or gateway on TCP. It need not
 * be there when the gateway begins. */
typedef struct gateway_line {
    line at;
    char *text;
    mbm_counters known; /* the counters at the last good reply */
    uint32_t in_flight;
    uint8_t is_used;   /* 0: a place for a line, which refuses every request */
    uint8_t is_silent; /* and that was reported */
} gateway_line;

/* All storage is the program's own; mbm allocates nothing. */
typedef struct gateway {
    gateway_line lines[GATEWAY_LINES];
    mbm_gateway gateway;
    mbm_gatewayLine gateway_lines[GATEWAY_LINES];
    mbm_gatewayRoute routes[ROUTES];
    mbm_gatewayConnection connections[GATEWAY_CONNECTIONS];
    mbm_gatewayRequest requests[GATEWAY_CONNECTIONS + GATEWAY_REQUESTS];
    mbm_gatewayConfig config;
    mbm_tcp tcps[GATEWAY_CONNECTIONS];
    ahead_port aheads[GATEWAY_CONNECTIONS];
    mbm_tcp_listener listener;
    int is_client_waiting; /* at the listener, as far as is known */
    service service;
    sleep_waits waits;
    found_round round;
    unsigned long connected, reloads, refused_reloads;

    /* What the command line says, and what is in force: the same, or with what the file says. */
    gateway_setup given, setup;
    const char *path;                /* of the file; NULL: the command line has the lines */
    uint8_t place_of[GATEWAY_LINES]; /* the index in `lines` of each line of the setup */
    int is_quiet, is_check;
} gateway;

/* --- a line --- */

/* The gateway reports a line after SILENT_AFTER requests in a row without a right reply. */
enum { SILENT_AFTER = 5 };

/* Sets what a reload may change of a line. */
static void gateway_line_set(gateway_line *l, const gateway_pace *pace, const reach *what)
{
    line_set(&l->at, (uint8_t)pace->in_flight, (uint8_t)pace->replace_after);
    l->in_flight = l->at.place.framing == MBM_FRAMING_TCP ? pace->in_flight : 1;
    (void)mbm_client_setQuietTime(&l->at.client, pace->quietMs);
    line_reach(&l->at, what);
    (void)mbm_link_setConnectTimeout(&l->at.kept, reach_timeout(&l->at.place.reach));
}

/* Begins the client and the link, which opens the line in the first poll of the client. The text of
 * the place is copied. Returns 0 without memory. */
static int gateway_line_begin(gateway_line *l, const place *where, const gateway_pace *pace)
{
    char *text = strdup(where->text);
    place copy = *where;

    if (!text)
        return 0;
    copy.text = text;
    memset(l, 0, sizeof *l);
    if (line_begin(&l->at, &copy) != CODE_DONE) {
        free(text);
        return 0;
    }
    l->text = text;
    l->at.is_logged = l->is_used = 1;
    gateway_line_set(l, pace, &where->reach);
    return 1;
}

/* --- a place without a line --- */

static int16_t no_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    (void)bytes;
    (void)capacity;
    return -1;
}

static int16_t no_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    (void)length;
    return -1;
}

static uint32_t no_micros(void *context)
{
    (void)context;
    return (uint32_t)clock_micros(CLOCK_MONOTONIC);
}

/* Makes a zeroed or closed line a place that refuses every request: requests that it had end. */
static void gateway_line_leave(gateway_line *l)
{
    const mbm_port nowhere = {.read = no_read, .write = no_write, .micros = no_micros};

    (void)mbm_client_beginRtuOverTcp(&l->at.client, &nowhere, l->at.incoming,
                                     sizeof l->at.incoming);
}

/* Reports devices that have become silent or damaged, and that answer again. */
static void gateway_line_watch(gateway_line *l)
{
    const char *why;
    const mbm_counters *now = &l->at.counters;
    const uint32_t damaged = now->badCrc - l->known.badCrc,
                   failed = damaged + now->timeouts - l->known.timeouts;

    if (now->replies != l->known.replies) {
        if (l->is_silent)
            report_log(REPORT_INFO, "%s: a device answers again", l->at.place.text);
        l->is_silent = 0;
        l->known = *now;
    } else if (!l->is_silent && failed >= SILENT_AFTER) {
        l->is_silent = 1;
        why = received_text(&l->at.received);
        report_set_in_flight(l->in_flight);
        if (damaged > 0)
            report_log(REPORT_WARNING,
                       "%s: the last %u requests got no right reply, %u of them damaged ones. %s",
                       l->at.place.text, failed, damaged, advice_damaged(&l->at.place));
        else
            report_log(REPORT_WARNING, "%s: the last %u requests got no reply%s%s. %s%s",
                       l->at.place.text, failed, why ? ": " : "", why ? why : "",
                       advice_silent(&l->at.place), report_in_flight());
    }
}

/* `isReady` of mbm_gatewayLine. */
static uint8_t gateway_line_isReady(void *context)
{
    gateway_line *l = (gateway_line *)context;

    return (uint8_t)(l->is_used && line_prepare(&l->at));
}

/* Closes the line, which may be begun again. */
static void gateway_line_close(gateway_line *l)
{
    l->is_used = 0;
    line_close(&l->at);
    free(l->text);
    l->text = NULL;
    gateway_line_leave(l);
}

/* --- lines and routes --- */

/* Fills the map of units with the routes of lines that are there. */
static void map_units(gateway *g)
{
    unsigned i, count = 0;

    for (i = 0; i < g->setup.route_count; i++) {
        mbm_gatewayRoute route = g->setup.routes[i];

        route.line = g->place_of[route.line];
        if (g->lines[route.line].is_used)
            g->routes[count++] = route;
    }
    /* No unit is in a range whose last unit is below its first. */
    while (count < ROUTES)
        g->routes[count++] = (mbm_gatewayRoute){1, 0, 0, 0};
}

static void set_line(gateway *g, unsigned index)
{
    const unsigned slot = g->place_of[index];
    const int is_tcp = g->lines[slot].at.place.framing == MBM_FRAMING_TCP;

    gateway_line_set(&g->lines[slot], &g->setup.lines[index].pace,
                     &g->setup.lines[index].place.reach);
    g->gateway_lines[slot].inFlight = (uint8_t)(is_tcp ? g->setup.lines[index].pace.in_flight : 1);
}

static int begin_line(gateway *g, unsigned index)
{
    const unsigned slot = g->place_of[index];

    if (!gateway_line_begin(&g->lines[slot], &g->setup.lines[index].place,
                            &g->setup.lines[index].pace))
        return report(CODE_SYSTEM, REPORT_NO_MEMORY);
    set_line(g, index);
    return CODE_DONE;
}

/* Sets what a reload may change of the whole gateway. */
static void set_gateway(gateway *g)
{
    (void)mbm_gateway_setMaxPending(&g->gateway, (uint16_t)g->setup.requests);
    (void)mbm_gateway_setQueueTime(&g->gateway, g->setup.queueMs);
    g->listener.idleTimeMs = g->setup.idleMs;
}

/* Begins the gateway and its lines, with all settings. Returns an exit code. */
static int begin(gateway *g)
{
    unsigned i, places = g->setup.line_count;

    if (g->path)
        places = places + SPARE_LINES > GATEWAY_LINES ? GATEWAY_LINES : places + SPARE_LINES;
    for (i = 0; i < places; i++) {
        gateway_line_leave(&g->lines[i]);
        g->gateway_lines[i] = (mbm_gatewayLine){.client = &g->lines[i].at.client,
                                                .context = &g->lines[i],
                                                .isReady = gateway_line_isReady};
    }
    for (i = 0; i < g->setup.line_count; i++) {
        g->place_of[i] = (uint8_t)i;
        if (begin_line(g, i) != CODE_DONE)
            return CODE_SYSTEM;
    }
    /* The gateway checks the routes that it begins with: each must be one. */
    for (i = 0; i < ROUTES; i++)
        g->routes[i] = g->setup.routes[i < g->setup.route_count ? i : 0];
    g->config.lineCount = (uint8_t)places;
    g->config.connectionCount = (uint8_t)g->setup.connections;
    g->config.requestCount = (uint16_t)(g->setup.connections + GATEWAY_REQUESTS);
    (void)mbm_gateway_begin(&g->gateway, &g->config);
    map_units(g);
    set_gateway(g);
    return CODE_DONE;
}

/* --- the file again --- */

/* The place of a line that is in force already and is not taken, or -1. */
static int find_place(gateway *g, const char *text, const uint8_t taken[GATEWAY_LINES])
{
    int slot;

    for (slot = 0; slot < g->config.lineCount; slot++)
        if (g->lines[slot].is_used && !taken[slot] && strcmp(g->lines[slot].text, text) == 0)
            return slot;
    return -1;
}

/* Returns NULL, or why the gateway must begin anew for this file. */
static const char *needs_restart(gateway *g, const gateway_setup *next)
{
    if (strcmp(next->listen_text, g->setup.listen_text) != 0)
        return "listen has changed";
    if (next->connections != g->setup.connections)
        return "connections has changed";
    if (next->line_count > g->config.lineCount)
        return "it has more lines than there are places";
    return NULL;
}

/* Replaces the setup by one that is right. Lines that both have go on as they are. */
static void apply(gateway *g, gateway_setup *next)
{
    uint8_t taken[GATEWAY_LINES] = {0}, is_new[GATEWAY_LINES] = {0}, next_places[GATEWAY_LINES];
    unsigned i, slot, kept = 0, removed = 0;

    for (i = 0; i < next->line_count; i++) {
        const int found = find_place(g, next->lines[i].text, taken);

        is_new[i] = found < 0;
        if (found < 0)
            continue;
        next_places[i] = (uint8_t)found;
        taken[found] = 1;
        kept++;
    }
    for (slot = 0; slot < g->config.lineCount; slot++)
        if (g->lines[slot].is_used && !taken[slot]) {
            gateway_line_close(&g->lines[slot]);
            removed++;
        }
    for (i = slot = 0; i < next->line_count; i++) {
        if (!is_new[i])
            continue;
        while (taken[slot])
            slot++;
        next_places[i] = (uint8_t)slot;
        taken[slot] = 1;
    }
    gateway_setup_free(&g->setup);
    g->setup = *next;
    memcpy(g->place_of, next_places, sizeof g->place_of);
    /* The requests of removed lines are answered before their places have other lines. */
    map_units(g);
    (void)mbm_gateway_poll(&g->gateway);
    for (i = 0; i < g->setup.line_count; i++) {
        if (!is_new[i])
            set_line(g, i);
        else
            (void)begin_line(g, i);
    }
    map_units(g);
    set_gateway(g);
    report_log(REPORT_INFO, "%s is in force. Lines kept: %u, removed: %u, added: %u", g->path, kept,
               removed, g->setup.line_count - kept);
}

static void reload(gateway *g)
{
    static gateway_setup next;
    const char *why;

    if (!g->path) {
        report_log(REPORT_WARNING,
                   "SIGHUP reads the file of the gateway, and this one was begun without a file");
        return;
    }
    service_is_reloading();
    next = g->given;
    if (gateway_file_read(&next, g->path) != CODE_DONE) {
        report_log(REPORT_ERROR, "%s. The file before stays in force", next.wrong);
    } else if ((why = needs_restart(g, &next)) != NULL) {
        report_log(REPORT_ERROR, "%s: %s, which needs a restart. The file before stays in force",
                   g->path, why);
    } else {
        apply(g, &next);
        g->reloads++;
        service_is_ready();
        return;
    }
    g->refused_reloads++;
    gateway_setup_free(&next);
    service_is_ready();
}

/* --- connections --- */

static void take_connections(gateway *g)
{
    int slot;

    while ((slot = mbm_tcp_accept(&g->listener, g->tcps, g->config.connectionCount)) >= 0) {
        const mbm_port own = mbm_tcp_port(&g->tcps[slot]);
        char name[24];
        mbm_port port;

        g->connected++;
        snprintf(name, sizeof name, "client %d", slot);
        report_log(REPORT_DEBUG, "%s is connected", name);
        port = trace_server(ahead_port_begin(&g->aheads[slot], &own), MBM_FRAMING_TCP, name);
        if (mbm_gateway_open(&g->gateway, (uint8_t)slot, &port) != MBM_OK)
            mbm_tcp_close(&g->tcps[slot]);
    }
    /* An idle connection may have been closed for them. No wait shows that. */
    for (slot = 0; slot < g->config.connectionCount; slot++)
        g->aheads[slot].is_ready |= mbm_tcp_isInUse(&g->tcps[slot]) && g->tcps[slot].fd < 0;
}

/* Gives the requests of a connection up, and closes it. */
static void drop_connection(gateway *g, unsigned slot)
{
    report_log(REPORT_DEBUG, "client %u is disconnected", slot);
    mbm_gateway_close(&g->gateway, (uint8_t)slot);
    mbm_tcp_close(&g->tcps[slot]);
}

/* The events to poll a connection for. */
static short events_of(gateway *g, unsigned slot)
{
    const int reads = mbm_gateway_isReading(&g->gateway, (uint8_t)slot);

    return (short)((reads ? POLLIN : 0) | (g->tcps[slot].events & POLLOUT));
}

/* --- all of it --- */

/* Lists the descriptors. Returns for how long to sleep at most. */
static uint32_t list_waits(gateway *g)
{
    uint32_t delay = mbm_gateway_pollDelay(&g->gateway);
    unsigned i;

    g->waits.count = 0;
    for (i = 0; i < g->config.connectionCount; i++) {
        struct pollfd *one = &g->waits.polls[g->waits.count];

        if (!mbm_tcp_isInUse(&g->tcps[i]))
            continue;
        *one = (struct pollfd){g->tcps[i].fd, events_of(g, i), 0};
        g->waits.slots[g->waits.count++] = (uint8_t)i;
        if ((one->events & POLLIN) && ahead_port_has_bytes(&g->aheads[i]))
            delay = 0;
    }
    g->waits.clients = g->waits.count;
    for (i = 0; i < g->config.lineCount; i++) {
        const line *at = &g->lines[i].at;
        struct pollfd *one = &g->waits.polls[g->waits.count];

        if (!g->lines[i].is_used || !line_polls(at, one))
            continue;
        /* The sleep waits for noise of an idle line too. Otherwise each poll of its client would
         * read the line. */
        if (place_is_serial(&at->place))
            one->events = POLLIN;
        g->waits.slots[g->waits.count++] = (uint8_t)i;
    }
    if (g->listener.events)
        g->waits.polls[g->waits.count] = (struct pollfd){g->listener.fd, POLLIN, 0};
    else if (delay > MBM_TCP_RETRY)
        delay = MBM_TCP_RETRY;
    return delay;
}

/* Sleeps until there is something to do, and notes what it is. */
static void wait_for_work(gateway *g)
{
    const uint32_t delay = list_waits(g);
    const int is_listening = g->listener.events != 0;
    const int found =
        service_wait(&g->service, g->waits.polls, g->waits.count + (nfds_t)is_listening, delay);
    const struct pollfd *one = g->waits.polls;
    nfds_t n;

    if (found < 0 && errno != EINTR)
        /* The system refuses to poll: it has no memory, or the limit of descriptors was
         * lowered. */
        (void)poll(NULL, 0, NAP_MICROS / 1000);
    /* If the wait failed, it is unknown what has come, so all are tried. */
    for (n = 0; n < g->waits.clients && found < 0; n++)
        g->aheads[g->waits.slots[n]].is_ready = 1;
    g->is_client_waiting = 1;
    if (found < 0)
        return;
    for (n = 0; n < g->waits.clients; n++, one++) {
        if (one->revents & ~POLLOUT)
            g->aheads[g->waits.slots[n]].is_ready = 1;
        if (!(one->events & POLLIN) && (one->revents & (POLLERR | POLLHUP | POLLNVAL)))
            drop_connection(g, g->waits.slots[n]);
    }
    found_port_begin_round(&g->round);
    for (; n < g->waits.count; n++, one++)
        line_polled(&g->lines[g->waits.slots[n]].at, &g->round, one);
    g->is_client_waiting = !is_listening || one->revents != 0;
}

/* One round of the loop. */
static void work(gateway *g)
{
    unsigned slot, polls = 0;

    if (service_reload_is_wanted(&g->service))
        reload(g);
    service_work(&g->service);
    if (g->is_client_waiting)
        take_connections(g);
    /* A poll may leave work that waits for nothing: a line has got a request. */
    do
        mbm_gateway_poll(&g->gateway);
    while (++polls < SERVICE_POLLS && mbm_gateway_pollDelay(&g->gateway) == 0);
    for (slot = 0; slot < g->config.lineCount; slot++)
        if (g->lines[slot].is_used)
            gateway_line_watch(&g->lines[slot]);
    for (slot = 0; slot < g->config.connectionCount; slot++) {
        if (!mbm_tcp_isInUse(&g->tcps[slot]))
            continue;
        /* A connection is not idle while its device has not answered. */
        g->tcps[slot].isBusy = mbm_gateway_pending(&g->gateway, (uint8_t)slot) != 0;
        if (mbm_gateway_status(&g->gateway, (uint8_t)slot) != MBM_OK)
            drop_connection(g, slot);
    }
    found_port_end_round(&g->round);
    wait_for_work(g);
}

static const stats_kind KINDS[] = {
    {"clients", "Clients that are connected.", 0},
    {"connections", "Connections that were accepted.", 1},
    {"refused_connections", "Connections that found no place.", 1},
    {"idle_connections_closed", "Connections that were closed as idle.", 1},
    {"reloads", "How often a file came in force.", 1},
    {"reload_failures", "How often a file was refused.", 1},
};

static void fill_stats(void *context, stats *numbers)
{
    gateway *g = (gateway *)context;
    unsigned i;

    numbers->command = "gateway";
    numbers->kinds = KINDS;
    numbers->count = sizeof KINDS / sizeof KINDS[0];
    for (i = 0; i < g->config.connectionCount; i++)
        numbers->values[0] += (uint64_t)mbm_tcp_isInUse(&g->tcps[i]);
    numbers->values[1] = g->connected;
    numbers->values[2] = g->listener.refused;
    numbers->values[3] = g->listener.idle;
    numbers->values[4] = g->reloads;
    numbers->values[5] = g->refused_reloads;
    for (i = 0; i < g->setup.line_count; i++) {
        const gateway_line *of = &g->lines[g->place_of[i]];

        numbers->lines[numbers->line_count++] =
            (stats_line){.name = of->text,
                         .counters = &of->at.counters,
                         .link = &of->at.losses,
                         .is_up = mbm_link_state(&of->at.kept) == MBM_LINK_IS_UP};
    }
}

static void print_summary(gateway *g)
{
    unsigned i;

    fprintf(stderr, "%s: connections: %lu, refused: %u, closed as idle: %u.\n", report_name,
            g->connected, g->listener.refused, g->listener.idle);
    for (i = 0; i < g->setup.line_count; i++) {
        const gateway_line *of = &g->lines[g->place_of[i]];
        const mbm_counters *counts = &of->at.counters;

        fprintf(stderr,
                "%s: %s: requests: %u, replies: %u, exceptions: %u, timeouts: %u, bad CRCs: %u.\n",
                report_name, of->text, counts->requests, counts->replies, counts->exceptions,
                counts->timeouts, counts->badCrc);
    }
}

/* --- the command line --- */

enum { CHECK = 0x100, IDLE, IN_FLIGHT, QUEUE_TIME, QUIET_TIME, REPLACE_AFTER, REQUESTS };

/* Reads a word that is no option: FILE, or LISTEN and then LINE and UNITS by turns. */
static void read_word(gateway *g, const struct argp_state *state, char *text)
{
    const unsigned number = state->arg_num;
    const size_t length = strlen(text);
    const char *wrong = NULL;

    if (number == 0 && length > 5 && strcmp(text + length - 5, ".yaml") == 0)
        g->path = text;
    else if (g->path)
        options_wrong(state, "\"%s\" is one word too many: the lines are in the file", text);
    else if (number == 0)
        wrong = gateway_setup_listen(&g->given, text);
    else if (number % 2 == 1)
        wrong = gateway_setup_line(&g->given, text);
    else
        wrong = gateway_setup_units(&g->given, text);
    if (wrong)
        options_wrong(state, number > 0 && number % 2 == 0 ? "UNITS %s" : "%s", wrong);
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    gateway *g = (gateway *)state->input;

    switch (key) {
    case 'c':
        g->given.connections =
            (uint32_t)options_number(state, "--connections", text, 1, GATEWAY_CONNECTIONS);
        return 0;
    case 'q': g->is_quiet = 1; return 0;
    case CHECK: g->is_check = 1; return 0;
    case REQUESTS:
        g->given.requests =
            (uint32_t)options_number(state, "--requests", text, 1, GATEWAY_REQUESTS);
        return 0;
    case IN_FLIGHT:
        g->given.pace.in_flight =
            (uint32_t)options_number(state, "--in-flight", text, 1, MBM_CLIENT_DEPTH);
        return 0;
    case REPLACE_AFTER:
        g->given.pace.replace_after =
            (uint32_t)options_number(state, "--replace-after", text, 0, 100);
        return 0;
    case IDLE: g->given.idleMs = options_time(state, "--idle", text, 0, 1000000000); return 0;
    case QUIET_TIME:
        g->given.pace.quietMs = options_time(state, "--quiet-time", text, 0, UINT16_MAX);
        return 0;
    case QUEUE_TIME:
        g->given.queueMs = options_time(state, "--queue-time", text, 0, UINT16_MAX);
        return 0;
    case ARGP_KEY_INIT: state->child_inputs[0] = &g->service; return 0;
    case ARGP_KEY_ARG: read_word(g, state, text); return 0;
    case ARGP_KEY_END:
        if (state->arg_num == 0)
            options_wrong(state, "a gateway needs FILE, or LISTEN, and for each LINE its UNITS");
        if (state->arg_num == 1 && g->path)
            return 0;
        if (state->arg_num < 3)
            options_wrong(state, "a gateway needs LISTEN, and for each LINE its UNITS");
        if (state->arg_num % 2 == 0)
            options_wrong(state, "UNITS of the last line are missing, such as 1-31");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"connections", 'c', "N", 0,
     "Places for clients, 1 to 255 (16). A client that finds no place is disconnected at once", 1},
    {"requests", REQUESTS, "N", 0, "Pending requests of one connection at once, 1 to 128 (8)", 1},
    {"idle", IDLE, "TIME", 0,
     "How long a connection is idle before it may be closed for a new client (1m); 0s for never",
     1},
    {"in-flight", IN_FLIGHT, "N", 0, "Requests in flight at once on a line tcp://, 1 to 16 (1)", 2},
    {"replace-after", REPLACE_AFTER, "N", 0,
     "Requests in a row without any byte after which the connection to a device is made anew, 0 to 100 "
     "(2); 0 for never",
     2},
    {"quiet-time", QUIET_TIME, "TIME", 0,
     "How long a line is left alone after a request without a right reply (100ms)", 2},
    {"queue-time", QUEUE_TIME, "TIME", 0,
     "How long a request may wait for its line; then it gets exception 0A (0s, for any time)", 2},
    {"check", CHECK, NULL, 0, "Only check the command line and the file", 3},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 3},
    {0}};

static const struct argp_child children[] = {
    {.argp = &options_service}, {.argp = &options_reach}, {.argp = &options_trace}, {0}};
static const struct argp parser = {
    .options = texts,
    .parser = parse,
    .args_doc = "FILE.yaml\nLISTEN LINE UNITS [LINE UNITS]...",
    .doc =
        "Passes requests from Modbus TCP to the devices of serial lines and of TCP.\v"
        "FILE has the keys listen and lines, and what the options say; docs/gateway.md describes it. "
        "SIGHUP reads it again: lines that stay the same, and all clients, stay connected.\n\n"
        "LISTEN is where clients connect: tcp://:502, or tcp://ADDRESS:PORT for one address of this "
        "machine; with port 0 it is a free one. mbm prints \"ready PORT\" once it listens.\n\n"
        "UNITS are the unit ids of the LINE before: FIRST-LAST, or FIRST-LAST=UNIT if the unit FIRST of "
        "clients is UNIT on the line. Several ranges have commas between them. 0=0 passes broadcasts. On a "
        "line tcp:// 0 is a unit that answers: 5=0 leads there.\n\n"
        "Examples:\n\n"
        "  mbm gateway tcp://:502 rtu:/dev/ttyUSB0 1-31 tcp://192.168.0.7 101-131=1\n"
        "  mbm gateway gateway.yaml --metrics 127.0.0.1:9100\n\n" SERVICE_HELP
        "The lines of a gateway are rtu:, ascii:, tcp:// and rtu+tcp://.\n\n" PLACE_HELP,
    .children = children};

int gateway_command(int argc, char **argv)
{
    static gateway data;
    gateway *g = &data;
    const char *wrong;
    unsigned i;
    int code = CODE_DONE;

    g->is_client_waiting = 1;
    g->given.idleMs = 60000;
    g->given.connections = CONNECTIONS;
    g->given.requests = 8;
    g->given.pace = (gateway_pace){100, 1, 2};
    g->config = (mbm_gatewayConfig){.routes = g->routes,
                                    .routeCount = ROUTES,
                                    .lines = g->gateway_lines,
                                    .connections = g->connections,
                                    .requests = g->requests};
    argp_parse(&parser, argc, argv, 0, NULL, g);
    for (i = 0; i < g->given.line_count; i++) {
        g->given.lines[i].pace = g->given.pace;
        wrong = gateway_setup_reach(&g->given, i, &options.reach, "--");
        if (wrong)
            return report(CODE_WRONG, "%s: %s", g->given.lines[i].text, wrong);
    }
    /* The file may say something else. */
    g->given.reach = options.reach;
    g->setup = g->given;
    if (g->path)
        code = gateway_file_read(&g->setup, g->path);
    if (code != CODE_DONE)
        return report(code, "%s", g->setup.wrong);
    if (g->is_check)
        return CODE_DONE;
    if (begin(g) != CODE_DONE)
        return CODE_SYSTEM;
    if (mbm_tcp_listen(&g->listener, place_host(&g->setup.listen), g->setup.listen.service) != 0)
        return line_cannot_open(&g->setup.listen, g->listener.lookupError);
    code = service_begin(&g->service, fill_stats, g);
    if (code != CODE_DONE)
        return code;
    printf("ready %u\n", g->listener.port);
    report_flush();
    service_is_ready();
    while (!report_stopped)
        work(g);
    service_end(&g->service);
    for (i = 0; i < g->config.connectionCount; i++)
        if (mbm_tcp_isInUse(&g->tcps[i]))
            drop_connection(g, i);
    if (!g->is_quiet)
        print_summary(g);
    for (i = 0; i < g->config.lineCount; i++)
        if (g->lines[i].is_used)
            gateway_line_close(&g->lines[i]);
    gateway_setup_free(&g->setup);
    mbm_tcp_closeListener(&g->listener);
    return CODE_DONE;
}
