/* A gateway from Modbus TCP to the devices of serial lines: a program over mbm_gateway.
 *
 *     gateway [-f MOST] [-i SECONDS] [-q QUIET] [-w WAIT] PORT MILLISECONDS
 *             PATH,BAUD,PARITY+STOP[,ascii],FIRST-LAST[=UNIT]...
 *     gateway 502 500 /dev/ttyUSB0,19200,E1,1-31 /dev/ttyUSB1,9600,N2,101-131=1
 *
 * The unit id of a request selects the line. =UNIT rewrites the ids: here the unit 101 on TCP
 * is unit 1 on the second line. A line may have several ranges. 0-0 sends requests for unit 0
 * as broadcasts; 255-255=5 leads clients that address the gateway itself to unit 5.
 * MILLISECONDS is the response timeout of a device. The gateway never blocks: while one line
 * waits for a device, the others and all connections go on. Prints `ready PORT` once it
 * listens.
 *
 * A connection may have MOST (8) requests under way. Its next requests wait in its socket.
 * When a line is free, the connections take turns. With WAIT, a request that has waited for
 * its line for this number of milliseconds is answered with 0A and not sent.
 *
 * The gateway has 16 places for connections, or fewer if the system gives it fewer
 * descriptors. When a new client finds no place, the gateway closes the connection that has
 * been idle for longest, if that is at least SECONDS (60). A connection whose device has
 * not answered yet is not idle.
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
#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "trace_options.h"

#include <errno.h>
#include <fcntl.h>
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
    REQUESTS = 128,
    IN_FLIGHT = 8,
    LINES = 4,
    REOPEN_MICROS = 1000000,
    NAP_MICROS = 10000, /* the sleep if the system refuses to poll */
    IDLE_SECONDS = 60
};

/* A serial line and the client for its devices. */
typedef struct line {
    mbm_tty tty;
    int failure; /* errno of the last attempt to open it */
    int reserve; /* a descriptor that is kept for the line while it is not open; 0: none */
    mbm_tty_options options;
    mbm_client client;
    const char *path;
    uint32_t tried; /* when it was last tried to open the line, while it is not open */
    uint8_t is_open;
    uint8_t frame[MBM_MAX_ASCII_FRAME];
} line;

/* All storage is the program's own; mbm allocates nothing. */
static line lines[LINES];
static mbm_gateway gateway = MBM_INIT;
static mbm_gatewayLine gateway_lines[LINES] = MBM_INIT;
static mbm_gatewayRoute routes[256];
static mbm_gatewayConnection connections[CONNECTIONS] = MBM_INIT;
static mbm_gatewayRequest requests[REQUESTS] = MBM_INIT;
static mbm_gatewayConfig config = {
    .routes = routes,
    .lines = gateway_lines,
    .connections = connections,
    .requests = requests,
    .requestCount = REQUESTS,
    .connectionCount = CONNECTIONS,
};
static mbm_tcp tcps[CONNECTIONS] = MBM_INIT;
static mbm_tcp_listener listener = MBM_INIT;
static long quiet = 100; /* milliseconds; the client's default */
static volatile sig_atomic_t is_over;
static sigset_t awake; /* the signal mask during a sleep, which SIGINT and SIGTERM may end */

static void finish(int number)
{
    (void)number;
    is_over = 1;
}

static uint32_t micros(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

/* --- lines --- */

/* Keeps a descriptor for a lost line. Without it, a waiting connection could take the
 * line's descriptor, and the line could not be opened again. */
static void keep_reserve(line *l)
{
    int fd = open("/dev/null", O_RDONLY | O_CLOEXEC);

    l->reserve = fd > 0 ? fd : 0;
}

static void free_reserve(line *l)
{
    if (l->reserve)
        close(l->reserve);
    l->reserve = 0;
}

static void close_line(void *context)
{
    line *l = (line *)context;

    if (l->is_open) {
        mbm_tty_close(&l->tty);
        keep_reserve(l);
    }
    l->is_open = 0;
}

static uint8_t open_line(void *context)
{
    line *l = (line *)context;

    l->tried = micros();
    free_reserve(l);
    l->is_open = mbm_tty_openWith(&l->tty, l->path, &l->options) == 0;
    l->failure = errno;
    if (!l->is_open)
        keep_reserve(l);
    return l->is_open ? MBM_OK : MBM_LINK_LOST;
}

/* A line that hung up between requests is opened again for the next request. */
static void hang_up(line *l)
{
    close_line(l);
    l->tried = micros() - REOPEN_MICROS;
}

/* Returns whether a line is open. If not, tries to open it, at most once a second. */
static uint8_t is_ready(void *context)
{
    line *l = (line *)context;
    const mbm_linkHooks link = {.context = l, .disconnect = close_line, .connect = open_line};
    struct pollfd idle = {l->tty.fd, 0, 0};

    /* It may have hung up since the last wait. */
    if (l->is_open && mbm_client_pending(&l->client) == 0 && poll(&idle, 1, 0) > 0)
        hang_up(l);
    if (!l->is_open && micros() - l->tried >= REOPEN_MICROS)
        mbm_client_reconnect(&l->client, &link);
    return l->is_open;
}

/* Closes a line that is lost. All its requests have ended then. */
static void close_if_lost(line *l)
{
    if (l->is_open && l->tty.error != 0 && mbm_client_pending(&l->client) == 0) {
        fprintf(stderr, "%s: %s\n", l->path, strerror(l->tty.error));
        close_line(l);
        l->tried = micros();
    }
}

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
    *route = (mbm_gatewayRoute){(uint8_t)first, (uint8_t)last, to, (uint8_t)unit};
    config.routeCount++;
    return 0;
}

/* PATH,BAUD,PARITY+STOP[,ascii],FIRST-LAST[=UNIT]... */
static int add_line(char *text, uint16_t timeout)
{
    const uint8_t index = config.lineCount;
    line *l = &lines[index];
    struct termios unused = {0};
    unsigned baud, stop;
    char parity, extra, *field, *rest = NULL;
    int is_ascii = 0;
    mbm_port port;

    if (index == LINES || !(l->path = strtok_r(text, ",", &rest)) ||
        !(field = strtok_r(NULL, ",", &rest)) || sscanf(field, "%9u%c", &baud, &extra) != 1 ||
        !(field = strtok_r(NULL, ",", &rest)) ||
        sscanf(field, "%c%1u%c", &parity, &stop, &extra) != 2 || stop > 2 || baud < 50)
        return -1;
    l->options.baud = baud;
    l->options.anyRate = 1;
    l->options.parity = parity;
    l->options.stop = (uint8_t)stop;
    field = strtok_r(NULL, ",", &rest);
    if (field && strcmp(field, "ascii") == 0) {
        is_ascii = 1;
        field = strtok_r(NULL, ",", &rest);
    }
    if (!field || mbm_tty_settings(&unused, &l->options) != 0)
        return -1;
    for (; field; field = strtok_r(NULL, ",", &rest))
        if (add_route(field, index) != 0)
            return -1;
    config.lineCount++;
    port = trace_client(mbm_tty_port(&l->tty), is_ascii ? MBM_FRAMING_ASCII : MBM_FRAMING_RTU,
                        l->path);
    if (open_line(l) != MBM_OK)
        fprintf(stderr, "%s: %s\n", text, strerror(l->failure));
    if (is_ascii ? mbm_client_beginAscii(&l->client, &port, l->frame, sizeof l->frame)
                 : mbm_client_beginRtu(&l->client, &port, l->frame, sizeof l->frame) ||
                       mbm_client_setBaudRate(&l->client, baud))
        return -1;
    gateway_lines[index] =
        (mbm_gatewayLine){.client = &l->client, .context = l, .isReady = is_ready};
    return mbm_client_setResponseTimeout(&l->client, timeout) == MBM_OK &&
                   mbm_client_setQuietTime(&l->client, (uint16_t)quiet) == MBM_OK
               ? 0
               : -1;
}

/* --- connections --- */

static void take_connections(void)
{
    int place;

    while ((place = mbm_tcp_accept(&listener, tcps, CONNECTIONS)) >= 0) {
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
    struct pollfd polls[1 + LINES + CONNECTIONS];
    uint8_t owner[1 + LINES + CONNECTIONS]; /* a line's index; from LINES on, a connection's */
    nfds_t count;
} waits;

static void wait_on(int fd, short events, unsigned owner)
{
    waits.owner[waits.count] = (uint8_t)owner;
    waits.polls[waits.count++] = (struct pollfd){fd, events, 0};
}

static int sleep_for(uint32_t micros)
{
    const struct timespec time = {(time_t)(micros / 1000000u), (long)(micros % 1000000u) * 1000};

    return ppoll(waits.polls, waits.count, micros == UINT32_MAX ? NULL : &time, &awake);
}

/* Sleeps until there is something to do. */
static void wait_for_work(void)
{
    uint32_t delay = mbm_gateway_pollDelay(&gateway);
    unsigned i;
    nfds_t n;

    waits.count = 0;
    for (i = 0; i < config.lineCount; i++) {
        /* An idle client reads no bytes, so only a hang-up of its line ends the sleep. */
        if (lines[i].is_open)
            wait_on(lines[i].tty.fd, mbm_client_pending(&lines[i].client) != 0 ? POLLIN : 0, i);
    }
    for (i = 0; i < CONNECTIONS; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            wait_on(tcps[i].fd, events_of(i), LINES + i);
    if (listener.events)
        wait_on(listener.fd, POLLIN, UINT8_MAX);
    else if (delay > MBM_TCP_RETRY)
        delay = MBM_TCP_RETRY;
    if (sleep_for(delay) < 0 && errno != EINTR) {
        /* The system refuses to poll: it has no memory, or the limit of descriptors was
         * lowered. */
        waits.count = 0;
        (void)sleep_for(NAP_MICROS);
    }
    for (n = 0; n < waits.count; n++) {
        const struct pollfd *one = &waits.polls[n];
        const unsigned owner = waits.owner[n];

        if (owner < LINES && !one->events && one->revents)
            hang_up(&lines[owner]);
        else if (owner >= LINES && owner < LINES + CONNECTIONS && !(one->events & POLLIN) &&
                 (one->revents & (POLLERR | POLLHUP | POLLNVAL)))
            drop_connection(owner - LINES);
    }
}

static int usage(int wrong)
{
    fprintf(
        wrong ? stderr : stdout,
        "usage: gateway [-f MOST] [-i SECONDS] [-q QUIET] [-w WAIT] PORT MILLISECONDS\n"
        "               PATH,BAUD,PARITY+STOP[,ascii],FIRST-LAST[=UNIT]...\n"
        "  -f MOST              requests of one connection that are under way at once, 8 if left\n"
        "                       out\n"
        "  -i SECONDS           that a connection is idle before it may be closed for a new\n"
        "                       client, 60 if left out, 0 for never\n"
        "  -q QUIET             milliseconds that a line is left alone after a request without\n"
        "                       a right reply, 0 to 65535, 100 if left out\n"
        "  -w WAIT              milliseconds that a request may wait for its line, then it is\n"
        "                       answered with exception 0A; 0 for any time, if left out\n"
        "  PORT                 where it listens, 0 for one that is free\n"
        "  MILLISECONDS         that a device has to respond, up to 65535\n"
        "  PATH,BAUD,...        up to 4 serial lines, the parity N, E or O, 1 or 2 stop bits,\n"
        "                       and the units on it, 0 to 255, each on one line; =UNIT: the\n"
        "                       id on the line of the unit FIRST. Several ranges may follow\n"
        "for example: gateway 502 500 /dev/ttyUSB0,19200,E1,1-31 "
        "/dev/ttyUSB1,9600,N2,101-131=1\n" TRACE_HELP);
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
    long idle = IDLE_SECONDS, timeout, most = IN_FLIGHT, wait = 0;
    sigset_t ends;
    int i, option;

    trace_options(&argc, argv);
    if (argc == 2 && strcmp(argv[1], "--help") == 0)
        return usage(0);
    while ((option = getopt(argc, argv, "f:hi:q:w:")) != -1) {
        if (option == 'f')
            most = number(optarg, 1, REQUESTS);
        else if (option == 'w')
            wait = number(optarg, 0, UINT16_MAX);
        else if (option == 'i')
            idle = number(optarg, 0, 1000000);
        else if (option == 'q')
            quiet = number(optarg, 0, UINT16_MAX);
        else
            return usage(option != 'h');
        if (idle < 0 || quiet < 0 || most < 0 || wait < 0)
            return usage(1);
    }
    argc -= optind;
    argv += optind;
    timeout = argc > 2 ? number(argv[1], 1, UINT16_MAX) : -1;
    for (i = 2; timeout > 0 && i < argc; i++)
        if (add_line(argv[i], (uint16_t)timeout) != 0)
            break;
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
        for (place = 0; place < config.lineCount; place++)
            close_if_lost(&lines[place]);
        for (place = 0; place < CONNECTIONS; place++) {
            if (!mbm_tcp_isInUse(&tcps[place]))
                continue;
            /* A connection is not idle while its device has not answered. */
            tcps[place].isBusy = mbm_gateway_pending(&gateway, (uint8_t)place) != 0;
            if (mbm_gateway_status(&gateway, (uint8_t)place) != MBM_OK)
                drop_connection(place);
        }
        wait_for_work();
    }
    for (i = 0; i < CONNECTIONS; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            drop_connection((unsigned)i);
    for (i = 0; i < config.lineCount; i++) {
        close_line(&lines[i]);
        free_reserve(&lines[i]);
    }
    mbm_tcp_closeListener(&listener);
    return 0;
}
