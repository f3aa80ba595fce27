#define _GNU_SOURCE
#include "line.h"

#include "trace.h"

#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

volatile sig_atomic_t line_ended;

static void end(int number)
{
    (void)number;
    line_ended = 1;
}

uint32_t line_milliseconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000u + (uint32_t)now.tv_nsec / 1000000u;
}

static int open_tty(line *l, char *path, int ascii)
{
    mbm_tty_options options = {
        .baud = 19200, .anyRate = 1, .parity = 'N', .stop = 1, .data = ascii ? 7 : 8};
    char *baud = strchr(path, ','), *parity = baud ? strchr(baud + 1, ',') : NULL;
    mbm_port port;

    if (parity) {
        *parity = '\0';
        options.parity = parity[1] && !parity[2] ? parity[1] : '?';
    }
    if (baud) {
        *baud = '\0';
        options.baud = (uint32_t)line_number(baud + 1, 50, 4000000);
    }
    if (mbm_tty_openWith(&l->tty, path, &options) != 0)
        return -1;
    port = trace_client(mbm_tty_port(&l->tty), ascii ? MBM_FRAMING_ASCII : MBM_FRAMING_RTU, path);
    if (ascii)
        return mbm_client_beginAscii(&l->client, &port, l->incoming, sizeof l->incoming);
    mbm_client_beginRtu(&l->client, &port, l->incoming, sizeof l->incoming);
    return mbm_client_setBaudRate(&l->client, options.baud);
}

static int open_tcp(line *l, char *host, int rtu)
{
    char *service = strchr(host, ',');
    mbm_port port;

    if (service)
        *service++ = '\0';
    if (mbm_tcp_openLater(&l->tcp, &l->addresses, host, service ? service : MBM_TCP_SERVICE) != 0)
        return -1;
    /* A name that does not exist is a mistake of the user. A network that is not there yet is not:
     * the link waits for it. */
    if (mbm_tcp_connect(&l->tcp) == MBM_LINK_LOST && l->tcp.error == ENXIO) {
        mbm_tcp_close(&l->tcp);
        errno = ENXIO;
        return -1;
    }
    l->is_tcp = 1;
    port =
        trace_client(mbm_tcp_port(&l->tcp), rtu ? MBM_FRAMING_RTU_OVER_TCP : MBM_FRAMING_TCP, host);
    if (rtu)
        return mbm_client_beginRtuOverTcp(&l->client, &port, l->incoming, sizeof l->incoming);
    return mbm_client_beginTcp(&l->client, &port, l->incoming, sizeof l->incoming, l->outgoing,
                               sizeof l->outgoing);
}

/* Keeps the reason why the link was lost or not opened, since the next attempt clears it. */
static void keep_reason(void *context, uint8_t event, uint8_t status)
{
    line *l = (line *)context;
    const int error = l->is_tcp ? l->tcp.error : l->tty.error;

    (void)status;
    if (event != MBM_LINK_EVENT_CONNECTED && error != 0)
        l->lost_by = error;
}

static void keep_open(line *l)
{
    const mbm_linkHooks hooks = l->is_tcp ? mbm_tcp_link(&l->tcp) : mbm_tty_link(&l->tty);

    (void)mbm_link_begin(&l->kept, &l->client, &hooks);
    (void)mbm_link_setBackoff(&l->kept, MBM_BACKOFF_FIXED, 1000, 1000);
    (void)mbm_link_setCallback(&l->kept, keep_reason, l);
}

int line_open(line *l, const char *place)
{
    struct sigaction action = {0};
    char copy[512], *rest;
    int failed = -1;

    memset(l, 0, sizeof *l);
    snprintf(copy, sizeof copy, "%s", place);
    rest = strchr(copy, ':');
    errno = EINVAL;
    if (rest) {
        *rest++ = '\0';
        if (strcmp(copy, "rtu") == 0 || strcmp(copy, "ascii") == 0)
            failed = open_tty(l, rest, copy[0] == 'a');
        else if (strcmp(copy, "tcp") == 0 || strcmp(copy, "rtuovertcp") == 0)
            failed = open_tcp(l, rest, copy[0] == 'r');
    }
    if (failed) {
        const int error = errno;

        fprintf(stderr, "%s: %s\n%s", place,
                l->tcp.lookupError ? gai_strerror(l->tcp.lookupError) : strerror(error),
                error == EINVAL ? LINE_HELP : "");
        return -1;
    }
    mbm_client_setCounters(&l->client, &l->counters);
    keep_open(l);
    action.sa_handler = end;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    return 0;
}

void line_close(line *l)
{
    if (l->is_tcp)
        mbm_tcp_close(&l->tcp);
    else
        mbm_tty_close(&l->tty);
}

void line_poll(line *l)
{
    (void)mbm_client_poll(&l->client);
}

int line_connect(line *l)
{
    int there = 1;

    while (l->is_tcp && !line_ended && (there = mbm_tcp_isConnected(&l->tcp)) == 0)
        (void)mbm_tcp_wait(&l->tcp, 1, NULL, -1, 1000000);
    if (there < 0)
        fprintf(stderr, "%s\n", mbm_tcp_text(&l->tcp));
    return there < 0 ? -1 : 0;
}

const char *line_reason(const line *l)
{
    return l->tcp.lookupError ? mbm_tcp_text(&l->tcp) : strerror(l->lost_by);
}

const char *line_status(line *l, const mbm_clientRequest *request)
{
    const char *text = mbm_status_textOf(request->status, request->exception);

    if (request->status != MBM_LINK_LOST || l->lost_by == 0)
        return text;
    snprintf(l->status, sizeof l->status, "%s: %s", text, line_reason(l));
    return l->status;
}

void line_rest(line *l, uint32_t milliseconds)
{
    uint32_t micros = mbm_client_pollDelay(&l->client);

    /* At most a second, since a signal just before the sleep does not end it. */
    if (milliseconds > 1000)
        milliseconds = 1000;
    if (micros / 1000 >= milliseconds)
        micros = milliseconds * 1000;
    if (l->is_tcp)
        (void)mbm_tcp_wait(&l->tcp, 1, NULL, -1, micros);
    else
        (void)mbm_tty_wait(&l->tty, micros);
}

int line_usage(int wrong, const char *usage)
{
    fprintf(wrong ? stderr : stdout, "usage: %s\n%s%s", usage, LINE_HELP, TRACE_HELP);
    return wrong ? 2 : 0;
}

int line_wants_help(int argc, char **argv)
{
    int i;

    for (i = 1; i < argc; i++)
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)
            return 1;
    return 0;
}

const char *line_tables(long function)
{
    static const char *const names[] = {"coils", "discrete inputs", "holding registers",
                                        "input registers"};

    return function >= 1 && function <= 4 ? names[function - 1] : NULL;
}

uint8_t line_read(line *l, mbm_clientRequest *request, long function, uint16_t address,
                  uint16_t quantity)
{
    switch (function) {
    case 1: return mbm_client_readCoils(&l->client, request, address, quantity);
    case 2: return mbm_client_readDiscreteInputs(&l->client, request, address, quantity);
    case 3: return mbm_client_readHoldingRegisters(&l->client, request, address, quantity);
    default: return mbm_client_readInputRegisters(&l->client, request, address, quantity);
    }
}

uint16_t line_value(const mbm_clientRequest *request, long function, unsigned index)
{
    if (function > 2)
        return ((const uint16_t *)request->reply)[index];
    return ((const uint8_t *)request->reply)[index / 8] >> index % 8 & 1;
}

long line_number(const char *text, long least, long most)
{
    char *rest;
    long number = strtol(text, &rest, strpbrk(text, "xX") ? 16 : 10);

    if (rest == text || *rest || number < least || number > most) {
        fprintf(stderr, "%s: not a number from %ld to %ld\n", text, least, most);
        exit(2);
    }
    return number;
}

int line_addresses(long address, long quantity)
{
    if (address + quantity <= 65536)
        return 1;
    fprintf(stderr, "%ld from address %ld on: addresses end at 65535\n", quantity, address);
    return 0;
}
