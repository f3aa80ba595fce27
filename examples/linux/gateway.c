/* A gateway: Modbus TCP comes in, RTU goes out to the devices of serial lines.
 *
 *     gateway [-q QUIET] PORT MILLISECONDS PATH,BAUD,PARITY+STOP,FIRST-LAST...
 *     gateway 502 500 /dev/ttyUSB0,19200,E1,1-31 /dev/ttyUSB1,9600,N2,32-40
 *
 * The unit id says which line a request is for; a device has so many milliseconds
 * to respond. Nothing waits: while one line waits for a device, the others and all
 * connections go on. A connection has one request under way; what it sends behind
 * that waits in its socket. Prints `ready PORT` once it listens.
 *
 * Where there is no response to hand on, the gateway answers itself (V1.1b3, 7):
 * 0A for a unit of no line, a line that cannot be opened, is lost, or has as many
 * requests as it holds; 0B for a device that does not respond, or whose reply is
 * damaged or does not answer the request; 02 and 03 for a request that the standard
 * does not allow. Functions that it does not know pass through as they are.
 *
 * A device may reply after its time is over. QUIET is how long a line is left alone
 * after a request without a right reply, so that such a reply comes before the next
 * request. Make it longer for devices that are later than that.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"
#include "mbm_tty.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    CONNECTIONS = 16, /* no more than a client holds requests */
    LINES = 4,
    DATA = 252,
    REOPEN_MICROS = 1000000,
    PATH_UNAVAILABLE = MBM_REPLY_EXCEPTION | 0x0A,
    NO_RESPONSE = MBM_REPLY_EXCEPTION | 0x0B
};

/* A serial line and the client that asks its devices. */
typedef struct line {
    mbm_tty tty;
    mbm_tty_options options;
    mbm_client client;
    const char *path;
    uint32_t tried;  /* when it was opened last, if it is not open */
    uint8_t is_open;
    uint8_t frame[MBM_MAX_FRAME];
} line;

/* A connection, whose one unit is every unit. */
typedef struct connection {
    mbm_server server;
    mbm_unit unit;
    mbm_custom every;
    mbm_clientRequest request;
    line *asked; /* whose device has the request; else NULL */
    uint8_t reply[DATA];
    uint8_t frame[2 * MBM_MAX_TCP_FRAME]; /* a request and, behind it, its response */
} connection;

/* All storage is the program's own; mbm allocates nothing. */
static line lines[LINES];
static unsigned line_count;
static line *route[256];
static connection connections[CONNECTIONS];
static mbm_tcp tcps[CONNECTIONS];
static uint8_t is_used[CONNECTIONS];
static mbm_tcp_listener listener;
static uint16_t quiet = 100; /* milliseconds; as the client has it at first */
static volatile sig_atomic_t is_over;
static sigset_t awake; /* the signals that come while it works wait for its sleep */

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

static void close_line(void *context)
{
    line *l = (line *)context;

    if (l->is_open)
        mbm_tty_close(&l->tty);
    l->is_open = 0;
}

static uint8_t open_line(void *context)
{
    line *l = (line *)context;

    l->tried = micros();
    l->is_open = mbm_tty_openWith(&l->tty, l->path, &l->options) == 0;
    return l->is_open ? MBM_OK : MBM_LINK_LOST;
}

/* A line that hung up while nobody asked is opened again by who does. */
static void hang_up(line *l)
{
    close_line(l);
    l->tried = micros() - REOPEN_MICROS;
}

/* Opens a line that is not open, now and then. */
static int is_there(line *l)
{
    const mbm_link link = {l, close_line, open_line};
    struct pollfd idle = {l->tty.fd, 0, 0};

    /* It may have hung up since the last wait. */
    if (l->is_open && mbm_client_pending(&l->client) == 0 && poll(&idle, 1, 0) > 0)
        hang_up(l);
    if (!l->is_open && micros() - l->tried >= REOPEN_MICROS)
        mbm_client_reconnect(&l->client, &link);
    return l->is_open;
}

/* Moves the requests of a line on. A line that is lost has ended them all. */
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
    char parity, behind;
    mbm_port port;
    char *rest = strchr(text, ',');

    if (!rest || line_count == LINES)
        return -1;
    *rest++ = 0;
    if (sscanf(rest, "%u,%c%u,%u-%u%c", &baud, &parity, &stop, &first, &last, &behind) != 5 ||
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
    port = mbm_tty_port(&l->tty, NULL);
    if (open_line(l) != MBM_OK)
        perror(text);
    if (mbm_client_beginRtu(&l->client, &port, l->frame, sizeof l->frame) != MBM_OK ||
        mbm_client_setBaudRate(&l->client, baud) != MBM_OK ||
        mbm_client_setResponseTimeout(&l->client, timeout) != MBM_OK ||
        mbm_client_setQuietTime(&l->client, quiet) != MBM_OK)
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

/* What became of a request that a device had. */
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

/* Serves every function of every unit: asks the device, and is asked again until
 * that has answered. */
static uint16_t forward(void *context, const mbm_request *request, uint8_t *response,
                        uint16_t capacity)
{
    connection *c = (connection *)context;
    line *l = route[request->unit];
    uint8_t status;

    if (c->asked) {
        if (c->request.status == MBM_PENDING)
            return MBM_REPLY_PENDING;
        c->asked = NULL;
        if (c->request.status == MBM_OK && is_unanswered(request))
            return MBM_REPLY_NONE;
        return outcome(c, response, capacity);
    }
    if (!l || !is_there(l))
        return PATH_UNAVAILABLE;
    memset(&c->request, 0, sizeof c->request);
    c->request.unit = request->unit;
    c->request.reply = c->reply;
    c->request.replyBytes = sizeof c->reply;
    /* The request's data stay where they are until it is answered. A reply that does
     * not answer this request, for example a late one to another client, is not taken. */
    status = mbm_client_forward(&l->client, &c->request, request->function, request->data,
                                request->length);
    switch (status) {
    case MBM_PENDING: c->asked = l; return MBM_REPLY_PENDING;
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
        mbm_port port = mbm_tcp_port(&tcps[place], NULL);

        memset(c, 0, sizeof *c);
        c->every.serve = forward;
        c->every.context = c;
        is_used[place] = mbm_server_serveCustom(&c->unit, &c->every) == MBM_OK &&
                         mbm_server_beginTcp(&c->server, &port, &c->unit, 1, c->frame,
                                             sizeof c->frame) == MBM_OK;
        if (!is_used[place])
            mbm_tcp_close(&tcps[place]);
    }
}

static void drop_connection(unsigned place)
{
    connection *c = &connections[place];

    /* What it asked is nobody's any more. */
    if (c->asked)
        mbm_client_cancel(&c->asked->client, &c->request);
    mbm_tcp_close(&tcps[place]);
    is_used[place] = 0;
}

/* --- all of it --- */

/* Sleeps until there is something to do. */
static void wait_for_work(void)
{
    struct pollfd waits[1 + LINES + CONNECTIONS];
    uint32_t delay = UINT32_MAX;
    struct timespec time;
    unsigned i;

    waits[0] = (struct pollfd){listener.fd, POLLIN, 0};
    for (i = 0; i < LINES; i++) {
        const mbm_client *client = &lines[i].client;
        uint32_t own = i < line_count ? mbm_client_pollDelay(client) : UINT32_MAX;
        int is_busy = i < line_count && lines[i].is_open && mbm_client_pending(client) != 0;

        /* An idle client takes no bytes; that its line hangs up is always told. */
        waits[1 + i] = (struct pollfd){lines[i].is_open ? lines[i].tty.fd : -1,
                                       is_busy ? POLLIN : 0, 0};
        delay = own < delay ? own : delay;
    }
    for (i = 0; i < CONNECTIONS; i++) {
        struct pollfd *one = &waits[1 + LINES + i];

        *one = (struct pollfd){is_used[i] ? tcps[i].fd : -1, POLLIN, 0};
        /* Its next request may wait. */
        if (is_used[i] && connections[i].asked)
            one->events = connections[i].request.status == MBM_PENDING ? 0 : POLLOUT;
        /* The socket was full. */
        else if (is_used[i] && (tcps[i].awaits & POLLOUT))
            one->events = POLLOUT;
    }
    time = (struct timespec){(time_t)(delay / 1000000u), (long)(delay % 1000000u) * 1000};
    if (ppoll(waits, 1 + LINES + CONNECTIONS, delay == UINT32_MAX ? NULL : &time,
              &awake) <= 0)
        return;
    for (i = 0; i < line_count; i++)
        if (!waits[1 + i].events && waits[1 + i].revents)
            hang_up(&lines[i]);
    for (i = 0; i < CONNECTIONS; i++)
        if (is_used[i] && connections[i].asked &&
            (waits[1 + LINES + i].revents & (POLLERR | POLLHUP | POLLNVAL)))
            drop_connection(i);
}

/* Reads a number of milliseconds; 0 if it is none, or too large. */
static int read_milliseconds(const char *text, uint16_t *milliseconds)
{
    char *end;
    unsigned long number = strtoul(text, &end, 10);

    if (*text < '0' || *text > '9' || *end || number > UINT16_MAX)
        return 0;
    *milliseconds = (uint16_t)number;
    return 1;
}

/* Takes the options, which come first; how many arguments they are, or -1. */
static int take_options(int argc, char **argv)
{
    int option;

    while ((option = getopt(argc, argv, "+:q:")) >= 0) {
        switch (option) {
        case 'q':
            if (!read_milliseconds(optarg, &quiet))
                return -1;
            break;
        default: return -1;
        }
    }
    return optind - 1;
}

int main(int argc, char **argv)
{
    struct sigaction action = {0};
    sigset_t ends;
    const int is_asked = argc == 2 && (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0);
    const int options = take_options(argc, argv);
    uint16_t timeout = 0;
    int i = 3;

    if (options > 0) {
        argv += options;
        argc -= options;
    }
    if (options >= 0 && argc > 3 && read_milliseconds(argv[2], &timeout) && timeout > 0)
        while (i < argc && add_line(argv[i], timeout) == 0)
            i++;
    if (i < 4 || i < argc) {
        fprintf(is_asked ? stdout : stderr,
                "usage: gateway [-q QUIET] PORT MILLISECONDS PATH,BAUD,PARITY+STOP,FIRST-LAST...\n"
                "  -q QUIET             milliseconds that a line is left alone after a request\n"
                "                       without a right reply, 0 to 65535; 100 if not given\n"
                "  PORT                 where it listens, 0 for one that is free\n"
                "  MILLISECONDS         that a device has to respond, up to 65535\n"
                "  PATH,BAUD,...        up to 4 serial lines, the parity N, E or O, 1 or 2 stop bits,\n"
                "                       and the units on it, 1 to 247, each on one line\n"
                "for example: gateway 502 500 /dev/ttyUSB0,19200,E1,1-31 /dev/ttyUSB1,9600,N2,32-40\n");
        return is_asked ? 0 : 2;
    }
    if (mbm_tcp_listen(&listener, NULL, argv[1]) != 0) {
        perror(argv[1]);
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
            if (is_used[place] && mbm_server_poll(&connections[place].server) != MBM_OK)
                drop_connection(place);
        wait_for_work();
    }
    for (i = 0; i < CONNECTIONS; i++)
        if (is_used[i])
            drop_connection((unsigned)i);
    for (i = 0; i < (int)line_count; i++)
        close_line(&lines[i]);
    mbm_tcp_closeListener(&listener);
    return 0;
}
