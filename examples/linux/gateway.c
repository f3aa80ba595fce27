/* A gateway from Modbus TCP to the devices of RTU serial lines.
 *
 *     gateway [-i SECONDS] [-q QUIET] PORT MILLISECONDS PATH,BAUD,PARITY+STOP,FIRST-LAST...
 *     gateway 502 500 /dev/ttyUSB0,19200,E1,1-31 /dev/ttyUSB1,9600,N2,32-40
 *
 * The unit id of a request selects the line. MILLISECONDS is the response timeout of a
 * device. The gateway never blocks: while one line waits for a device, the others and all
 * connections go on. A connection has one request under way. Its next requests wait in its
 * socket. Prints `ready PORT` once it listens.
 *
 * The gateway has 16 places for connections, or fewer if the system gives it fewer
 * descriptors. When a new client finds no place, the gateway closes the connection that has
 * been idle for longest, if that is at least SECONDS (60). A connection whose device has
 * not answered yet is not idle.
 *
 * Without a response to pass on, the gateway answers itself (V1.1b3, 7): 0A if the unit has
 * no line, or if its line cannot be opened, is lost, or has a full queue; 0B if the device
 * does not respond, or if its reply is damaged or does not answer the request; 02 and 03
 * for a request that the standard does not allow. It passes on unknown functions unchanged.
 *
 * A device may reply after its timeout. QUIET (100) is the quiet time in milliseconds, which
 * keeps such a reply from being taken for the answer to the next request. Make it longer
 * than a device takes to answer.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"
#include "mbm_tty.h"

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
    CONNECTIONS = 16, /* as many as a client's queue has requests */
    LINES = 4,
    DATA = 252,
    REOPEN_MICROS = 1000000,
    NAP_MICROS = 10000, /* the sleep if the system refuses to poll */
    IDLE_SECONDS = 60,
    PATH_UNAVAILABLE = MBM_REPLY_EXCEPTION | 0x0A,
    NO_RESPONSE = MBM_REPLY_EXCEPTION | 0x0B
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
    uint8_t frame[MBM_MAX_FRAME];
} line;

/* A connection. Its server has one unit, which answers for every unit id. */
typedef struct connection {
    mbm_server server;
    mbm_unit unit;
    mbm_custom every;
    mbm_clientRequest request;
    line *asked; /* the line whose device has the request, or NULL */
    uint8_t reply[DATA];
    uint8_t frame[2 * MBM_MAX_TCP_FRAME]; /* a request and, after it, its response */
} connection;

/* All storage is the program's own; mbm allocates nothing. */
static line lines[LINES];
static unsigned line_count;
static line *route[256];
static connection connections[CONNECTIONS];
static mbm_tcp tcps[CONNECTIONS];
static mbm_tcp_listener listener;
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

/* Opens a line that is not open, at most once a second. Returns whether it is open. */
static int open_if_due(line *l)
{
    const mbm_linkHooks link = {.context = l, .disconnect = close_line, .connect = open_line};
    struct pollfd idle = {l->tty.fd, 0, 0};

    /* It may have hung up since the last wait. */
    if (l->is_open && mbm_client_pending(&l->client) == 0 && poll(&idle, 1, 0) > 0)
        hang_up(l);
    if (!l->is_open && micros() - l->tried >= REOPEN_MICROS)
        mbm_client_reconnect(&l->client, &link);
    return l->is_open;
}

/* Moves the requests of a line on. When the line is lost, all its requests have ended. */
static void poll_line(line *l)
{
    mbm_client_poll(&l->client);
    if (l->is_open && l->tty.error != 0 && mbm_client_pending(&l->client) == 0) {
        fprintf(stderr, "%s: %s\n", l->path, strerror(l->tty.error));
        close_line(l);
        l->tried = micros();
    }
}

/* PATH,BAUD,PARITY+STOP,FIRST-LAST */
static int add_line(char *text, uint16_t timeout)
{
    line *l = &lines[line_count];
    struct termios unused = {0};
    unsigned baud, stop, first, last, unit;
    char parity, extra;
    mbm_port port;
    char *rest = strchr(text, ',');

    if (!rest || line_count == LINES)
        return -1;
    *rest++ = 0;
    if (sscanf(rest, "%u,%c%u,%u-%u%c", &baud, &parity, &stop, &first, &last, &extra) != 5 ||
        first < 1 || first > last || last > 247 || stop > 2 || baud < 50)
        return -1;
    l->path = text;
    l->options.baud = baud;
    l->options.anyRate = 1;
    l->options.parity = parity;
    l->options.stop = (uint8_t)stop;
    if (mbm_tty_settings(&unused, &l->options) != 0)
        return -1;
    for (unit = first; unit <= last; unit++)
        if (route[unit])
            return -1;
    line_count++;
    port = mbm_tty_port(&l->tty);
    if (open_line(l) != MBM_OK)
        fprintf(stderr, "%s: %s\n", text, strerror(l->failure));
    if (mbm_client_beginRtu(&l->client, &port, l->frame, sizeof l->frame) != MBM_OK ||
        mbm_client_setBaudRate(&l->client, baud) != MBM_OK ||
        mbm_client_setResponseTimeout(&l->client, timeout) != MBM_OK ||
        mbm_client_setQuietTime(&l->client, (uint16_t)quiet) != MBM_OK)
        return -1;
    for (unit = first; unit <= last; unit++)
        route[unit] = l;
    return 0;
}

/* --- requests --- */

/* True for 08 with sub-function 04, Force Listen Only Mode: no device responds to it. */
static int is_unanswered(const mbm_request *request)
{
    return request->function == MBM_FC_DIAGNOSTICS && request->length >= 2 &&
           request->data[0] == 0 && request->data[1] == MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY;
}

/* The response to a request that has ended at its device. */
static uint16_t outcome(const connection *c, uint8_t *response, uint16_t capacity)
{
    if (c->request.status == MBM_OK) {
        if (c->request.length > capacity)
            return MBM_REPLY_EXCEPTION | MBM_SLAVE_DEVICE_FAILURE;
        memcpy(response, c->reply, c->request.length);
        return c->request.length;
    }
    if (c->request.exception != 0)
        return (uint16_t)(MBM_REPLY_EXCEPTION | c->request.exception);
    if (c->request.status == MBM_LINK_LOST || c->request.status == MBM_LINE_BUSY)
        return PATH_UNAVAILABLE;
    return NO_RESPONSE;
}

/* Notes the line that has the connection's request, NULL when the request has ended. Until
 * then the connection is not idle, however long its device takes. */
static void become_busy(connection *c, line *l)
{
    c->asked = l;
    tcps[c - connections].isBusy = l != NULL;
}

/* Serves every function of every unit: passes the request to the line's client, and is
 * called again until the request has ended. */
static uint16_t forward(void *context, const mbm_request *request, uint8_t *response,
                        uint16_t capacity)
{
    connection *c = (connection *)context;
    line *l = route[request->unit];
    uint8_t status;

    if (c->asked) {
        if (c->request.status == MBM_PENDING)
            return MBM_REPLY_PENDING;
        become_busy(c, NULL);
        if (c->request.status == MBM_OK && is_unanswered(request))
            return MBM_REPLY_NONE;
        return outcome(c, response, capacity);
    }
    if (!l || !open_if_due(l))
        return PATH_UNAVAILABLE;
    memset(&c->request, 0, sizeof c->request);
    c->request.unit = request->unit;
    c->request.reply = c->reply;
    c->request.replyBytes = sizeof c->reply;
    /* The request's data stay where they are until the response is sent. The client does
     * not accept a reply that does not answer this request, for example a late one to
     * another client. */
    status = mbm_client_forward(&l->client, &c->request, request->function, request->data,
                                request->length);
    switch (status) {
    case MBM_PENDING: become_busy(c, l); return MBM_REPLY_PENDING;
    case MBM_QUEUE_FULL: return PATH_UNAVAILABLE;
    case MBM_ILLEGAL_FUNCTION:
    case MBM_ILLEGAL_DATA_ADDRESS:
    case MBM_ILLEGAL_DATA_VALUE: return (uint16_t)(MBM_REPLY_EXCEPTION | status);
    default: return MBM_REPLY_EXCEPTION | MBM_SLAVE_DEVICE_FAILURE;
    }
}

/* --- connections --- */

static void take_connections(void)
{
    int place;

    while ((place = mbm_tcp_accept(&listener, tcps, CONNECTIONS)) >= 0) {
        connection *c = &connections[place];
        mbm_port port = mbm_tcp_port(&tcps[place]);

        memset(c, 0, sizeof *c);
        c->every.serve = forward;
        c->every.context = c;
        if (mbm_unit_serveCustom(&c->unit, &c->every) != MBM_OK ||
            mbm_server_beginTcp(&c->server, &port, &c->unit, 1, c->frame, sizeof c->frame) !=
                MBM_OK)
            mbm_tcp_close(&tcps[place]);
    }
}

static void drop_connection(unsigned place)
{
    connection *c = &connections[place];

    /* The connection is gone, so its request is given up. */
    if (c->asked)
        mbm_client_cancel(&c->asked->client, &c->request);
    mbm_tcp_close(&tcps[place]);
}

/* The events to poll a connection for. */
static short events_of(unsigned place)
{
    const connection *c = &connections[place];

    /* The connection has a request under way. Its next request may wait in the socket. */
    if (c->asked)
        return c->request.status == MBM_PENDING ? 0 : POLLOUT;
    /* The socket was full. */
    return tcps[place].awaits & POLLOUT ? POLLOUT : POLLIN;
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
    uint32_t delay = UINT32_MAX;
    unsigned i;
    nfds_t n;

    waits.count = 0;
    for (i = 0; i < line_count; i++) {
        mbm_client *client = &lines[i].client;
        uint32_t own = mbm_client_pollDelay(client);

        /* An idle client reads no bytes, so only a hang-up of its line ends the sleep. */
        if (lines[i].is_open)
            wait_on(lines[i].tty.fd, mbm_client_pending(client) != 0 ? POLLIN : 0, i);
        delay = own < delay ? own : delay;
    }
    for (i = 0; i < CONNECTIONS; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            wait_on(tcps[i].fd, events_of(i), LINES + i);
    if (listener.awaits)
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
        else if (owner >= LINES && owner < LINES + CONNECTIONS &&
                 connections[owner - LINES].asked &&
                 (one->revents & (POLLERR | POLLHUP | POLLNVAL)))
            drop_connection(owner - LINES);
    }
}

static int usage(int wrong)
{
    fprintf(
        wrong ? stderr : stdout,
        "usage: gateway [-i SECONDS] [-q QUIET] PORT MILLISECONDS\n"
        "               PATH,BAUD,PARITY+STOP,FIRST-LAST...\n"
        "  -i SECONDS           that a connection is idle before it may be closed for a new\n"
        "                       client, 60 if left out, 0 for never\n"
        "  -q QUIET             milliseconds that a line is left alone after a request without\n"
        "                       a right reply, 0 to 65535, 100 if left out\n"
        "  PORT                 where it listens, 0 for one that is free\n"
        "  MILLISECONDS         that a device has to respond, up to 65535\n"
        "  PATH,BAUD,...        up to 4 serial lines, the parity N, E or O, 1 or 2 stop bits,\n"
        "                       and the units on it, 1 to 247, each on one line\n"
        "for example: gateway 502 500 /dev/ttyUSB0,19200,E1,1-31 /dev/ttyUSB1,9600,N2,32-40\n");
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
    long idle = IDLE_SECONDS, timeout;
    sigset_t ends;
    int i, option;

    if (argc == 2 && strcmp(argv[1], "--help") == 0)
        return usage(0);
    while ((option = getopt(argc, argv, "hi:q:")) != -1) {
        if (option == 'i')
            idle = number(optarg, 0, 1000000);
        else if (option == 'q')
            quiet = number(optarg, 0, UINT16_MAX);
        else
            return usage(option != 'h');
        if (idle < 0 || quiet < 0)
            return usage(1);
    }
    argc -= optind;
    argv += optind;
    timeout = argc > 2 ? number(argv[1], 1, UINT16_MAX) : -1;
    for (i = 2; timeout > 0 && i < argc; i++)
        if (add_line(argv[i], (uint16_t)timeout) != 0)
            break;
    if (i < 3 || i < argc)
        return usage(1);
    listener.idleTimeMs = (uint32_t)idle * 1000u;
    if (mbm_tcp_listen(&listener, NULL, argv[0]) != 0) {
        fprintf(stderr, "%s: %s\n", argv[0],
                listener.lookup ? gai_strerror(listener.lookup) : strerror(errno));
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
        for (place = 0; place < line_count; place++)
            poll_line(&lines[place]);
        for (place = 0; place < CONNECTIONS; place++)
            if (mbm_tcp_isInUse(&tcps[place]) &&
                mbm_server_poll(&connections[place].server) != MBM_OK)
                drop_connection(place);
        wait_for_work();
    }
    for (i = 0; i < CONNECTIONS; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            drop_connection((unsigned)i);
    for (i = 0; i < (int)line_count; i++) {
        close_line(&lines[i]);
        free_reserve(&lines[i]);
    }
    mbm_tcp_closeListener(&listener);
    return 0;
}
