/* A gateway from Modbus TCP to the devices of serial lines and of TCP: a program over mbm_gateway.
 *
 *     gateway [-c CONNECTIONS] [-f MOST] [-i SECONDS] [-n MOST] [-q QUIET] [-w WAIT]
 *             PORT MILLISECONDS LINE,FIRST-LAST[=UNIT]...
 *     gateway 502 500 rtu:/dev/ttyUSB0,19200,E1,1-31 tcp:192.168.0.7,101-131=1
 *
 * gateway_line.h says how a LINE is written. The unit id of a request selects the line. =UNIT
 * rewrites the ids: here the unit 101 for the gateway's clients is unit 1 of the device on TCP.
 * A line may have several ranges. 0-0 sends requests for unit 0 as broadcasts; 255-255=5 leads
 * clients that address the gateway itself to unit 5. MILLISECONDS is the response timeout of a
 * device, and the time to connect. The gateway never blocks, except to look up a host by name:
 * while one line waits for a device, the others and all connections go on. Prints `ready PORT`
 * once it listens.
 *
 * A connection may have MOST (8) requests under way. Its next requests wait in its socket.
 * When a line is free, the connections take turns. With WAIT, a request that has waited for
 * its line for this number of milliseconds is answered with 0A and not sent.
 *
 * The gateway has CONNECTIONS (16) places for connections, or fewer if the system gives it fewer
 * descriptors. When a new client finds no place, the gateway closes the connection that has
 * been idle for longest, if that is at least SECONDS (60). A connection whose device has
 * not answered yet is not idle. If none is idle, the new connection is closed at once.
 *
 * Without a response to pass on, the gateway answers itself (V1.1b3, 7): 0A if the unit has
 * no line, or if its line cannot be opened or is lost; 0B if the device does not respond, or
 * if its reply is damaged or does not answer the request; 01, 02 and 03 for a request that
 * the standard does not allow. It passes on unknown functions unchanged.
 *
 * A device may reply after its timeout. QUIET (100) is the quiet time in milliseconds, which
 * keeps such a reply from being taken for the answer to the next request. Make it longer
 * than a device takes to answer.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "gateway_line.h"
#include "trace.h"

#include <errno.h>
#include <netdb.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    CONNECTIONS = 16,
    MOST_CONNECTIONS = UINT8_MAX,
    SHARED_REQUESTS = 128, /* the places for requests beside one for each connection */
    IN_FLIGHT = 8,
    LINES = 32,
    NAP_MICROS = 10000, /* the sleep if the system refuses to poll */
    IDLE_SECONDS = 60
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
    .connectionCount = CONNECTIONS,
};
static mbm_tcp tcps[MOST_CONNECTIONS] = MBM_INIT;
static mbm_tcp_listener listener = MBM_INIT;
static volatile sig_atomic_t is_over;
static sigset_t awake; /* the signal mask during a sleep, which SIGINT and SIGTERM may end */

static void finish(int number)
{
    (void)number;
    is_over = 1;
}

/* --- lines --- */

/* FIRST-LAST[=UNIT]. No unit may have two routes. */
static int add_route(const char *text, uint8_t to)
{
    mbm_gatewayRoute *route = &routes[config.routeCount];
    unsigned first, last, unit = 0, i;
    char extra;
    int fields = sscanf(text, "%3u-%3u%c%3u%c", &first, &last, &extra, &unit, &extra);

    if ((fields != 2 && (fields != 4 || !strchr(text, '='))) || first > last || last > 255 ||
        unit > 255 || config.routeCount == UINT8_MAX)
        return -1;
    for (i = 0; i < config.routeCount; i++)
        if (first <= routes[i].last && last >= routes[i].first)
            return -1;
    *route = (mbm_gatewayRoute){(uint16_t)first, (uint16_t)last, to, (uint16_t)unit};
    config.routeCount++;
    return 0;
}

/* LINE,FIRST-LAST[=UNIT]... */
static int add_line(char *text, uint8_t in_flight)
{
    const uint8_t index = config.lineCount;
    gateway_line *line = &lines[index];
    char *ranges, *rest = NULL, *range;

    ranges = index < LINES ? gateway_line_read(line, text) : NULL;
    range = ranges ? strtok_r(ranges, ",", &rest) : NULL;
    if (!range)
        return -1;
    for (; range; range = strtok_r(NULL, ",", &rest))
        if (add_route(range, index) != 0)
            return -1;
    gateway_lines[index] =
        (mbm_gatewayLine){.client = &line->client,
                          .context = line,
                          .isReady = gateway_line_isReady,
                          .inFlight = line->framing == MBM_FRAMING_TCP ? in_flight : 1};
    config.lineCount++;
    return 0;
}

/* --- connections --- */

static void take_connections(void)
{
    int place;

    while ((place = mbm_tcp_accept(&listener, tcps, config.connectionCount)) >= 0) {
        char name[24];
        mbm_port port;

        snprintf(name, sizeof name, "client %d", place);
        port = trace_server(mbm_tcp_port(&tcps[place]), MBM_FRAMING_TCP, name);
        if (mbm_gateway_open(&gateway, (uint8_t)place, &port) != MBM_OK)
            mbm_tcp_close(&tcps[place]);
    }
}

/* Gives the requests of a connection up, and closes it. */
static void drop_connection(unsigned place)
{
    mbm_gateway_close(&gateway, (uint8_t)place);
    mbm_tcp_close(&tcps[place]);
}

/* The events to poll a connection for. */
static short events_of(unsigned place)
{
    const int reads = mbm_gateway_isReading(&gateway, (uint8_t)place);

    return (short)((reads ? POLLIN : 0) | (tcps[place].events & POLLOUT));
}

/* --- all of it --- */

/* The descriptors of one sleep. A descriptor that is not open is left out, since the system
 * refuses a list that is longer than the limit of descriptors. */
static struct {
    struct pollfd polls[1 + LINES + MOST_CONNECTIONS];
    uint8_t places[1 + LINES + MOST_CONNECTIONS]; /* of the connections */
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
    nfds_t connected, n;
    unsigned i;

    waits.count = 0;
    for (i = 0; i < config.connectionCount; i++)
        if (mbm_tcp_isInUse(&tcps[i])) {
            waits.places[waits.count] = (uint8_t)i;
            waits.polls[waits.count++] = (struct pollfd){tcps[i].fd, events_of(i), 0};
        }
    connected = waits.count;
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
    for (n = 0; n < connected; n++) {
        const struct pollfd *one = &waits.polls[n];

        if (!(one->events & POLLIN) && (one->revents & (POLLERR | POLLHUP | POLLNVAL)))
            drop_connection(waits.places[n]);
    }
}

static int usage(int wrong)
{
    fprintf(
        wrong ? stderr : stdout,
        "usage: gateway [-c CONNECTIONS] [-f MOST] [-i SECONDS] [-n MOST] [-q QUIET] [-w WAIT]\n"
        "               PORT MILLISECONDS LINE,FIRST-LAST[=UNIT]...\n"
        "  -c CONNECTIONS       places for clients, 1 to 255, 16 if left out; a client that finds\n"
        "                       no place is disconnected at once\n"
        "  -f MOST              requests of one connection that are under way at once, 8 if left\n"
        "                       out\n"
        "  -i SECONDS           that a connection is idle before it may be closed for a new\n"
        "                       client, 60 if left out, 0 for never\n"
        "  -n MOST              requests that are under way at once on a line tcp:, 1 to 16, 1 if\n"
        "                       left out\n"
        "  -q QUIET             milliseconds that a line is left alone after a request without\n"
        "                       a right reply, 0 to 65535, 100 if left out\n"
        "  -w WAIT              milliseconds that a request may wait for its line, then it is\n"
        "                       answered with exception 0A; 0 for any time, if left out\n"
        "  PORT                 where it listens, 0 for one that is free\n"
        "  MILLISECONDS         that a device has to respond, up to 65535\n"
        "  FIRST-LAST[=UNIT]    the units of the line, 0 to 255, each on one line; =UNIT: the id\n"
        "                       on the line of the unit FIRST. Several ranges may follow\n"
        "lines, up to 32:\n"
        "  [rtu:]PATH,BAUD,PARITY+STOP   a serial line, the parity N, E or O, 1 or 2 stop bits\n"
        "  ascii:PATH,BAUD,PARITY+STOP   the same in ASCII frames\n"
        "  tcp:HOST[,PORT]               Modbus TCP, port 502 if left out\n"
        "  rtuovertcp:HOST[,PORT]        RTU frames in a TCP stream, port 502 if left out\n"
        "for example: gateway 502 500 rtu:/dev/ttyUSB0,19200,E1,1-31 tcp:192.168.0.7,101-131=1\n" TRACE_HELP);
    return wrong ? 2 : 0;
}

/* Returns a number from `least` to `most`, or -1. */
static long number(const char *text, long least, long most)
{
    char *extra;
    long value = strtol(text, &extra, 10);

    return extra != text && !*extra && value >= least && value <= most ? value : -1;
}

int main(int argc, char **argv)
{
    struct sigaction action = {0};
    long idle = IDLE_SECONDS, timeout, most = IN_FLIGHT, wait = 0, quiet = 100, in_flight = 1,
         places = CONNECTIONS;
    sigset_t ends;
    int i, option;

    trace_options(&argc, argv);
    if (argc == 2 && strcmp(argv[1], "--help") == 0)
        return usage(0);
    while ((option = getopt(argc, argv, "c:f:hi:n:q:w:")) != -1) {
        if (option == 'c')
            places = number(optarg, 1, MOST_CONNECTIONS);
        else if (option == 'f')
            most = number(optarg, 1, SHARED_REQUESTS);
        else if (option == 'n')
            in_flight = number(optarg, 1, 16);
        else if (option == 'w')
            wait = number(optarg, 0, UINT16_MAX);
        else if (option == 'i')
            idle = number(optarg, 0, 1000000);
        else if (option == 'q')
            quiet = number(optarg, 0, UINT16_MAX);
        else
            return usage(option != 'h');
        if (idle < 0 || quiet < 0 || most < 0 || wait < 0 || in_flight < 0 || places < 0)
            return usage(1);
    }
    argc -= optind;
    argv += optind;
    timeout = argc > 2 ? number(argv[1], 1, UINT16_MAX) : -1;
    for (i = 2; timeout > 0 && i < argc; i++)
        if (add_line(argv[i], (uint8_t)in_flight) != 0 ||
            gateway_line_begin(&lines[i - 2], (uint16_t)timeout, (uint16_t)quiet) != 0)
            break;
    config.connectionCount = (uint8_t)places;
    config.requestCount = (uint16_t)(places + SHARED_REQUESTS);
    if (i < 3 || i < argc || mbm_gateway_begin(&gateway, &config) != MBM_OK ||
        mbm_gateway_setInFlight(&gateway, (uint16_t)most) != MBM_OK ||
        mbm_gateway_setQueueTime(&gateway, (uint16_t)wait) != MBM_OK)
        return usage(1);
    listener.idleTimeMs = (uint32_t)idle * 1000u;
    if (mbm_tcp_listen(&listener, NULL, argv[0]) != 0) {
        fprintf(stderr, "%s: %s\n", argv[0],
                listener.lookupError ? gai_strerror(listener.lookupError) : strerror(errno));
        return 1;
    }
    sigemptyset(&ends);
    sigaddset(&ends, SIGINT);
    sigaddset(&ends, SIGTERM);
    sigprocmask(SIG_BLOCK, &ends, &awake);
    action.sa_handler = finish;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    printf("ready %u\n", listener.port);
    fflush(stdout);
    while (!is_over) {
        unsigned place;

        take_connections();
        mbm_gateway_poll(&gateway);
        for (place = 0; place < config.connectionCount; place++) {
            if (!mbm_tcp_isInUse(&tcps[place]))
                continue;
            /* A connection is not idle while its device has not answered. */
            tcps[place].isBusy = mbm_gateway_pending(&gateway, (uint8_t)place) != 0;
            if (mbm_gateway_status(&gateway, (uint8_t)place) != MBM_OK)
                drop_connection(place);
        }
        wait_for_work();
    }
    for (i = 0; i < config.connectionCount; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            drop_connection((unsigned)i);
    for (i = 0; i < config.lineCount; i++)
        gateway_line_close(&lines[i]);
    mbm_tcp_closeListener(&listener);
    return 0;
}
