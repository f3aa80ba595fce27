#define _GNU_SOURCE
#include "line.h"

#include <errno.h>
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
    mbm_tty_options options = {.baud = 19200, .parity = 'N', .stop = 1, .data = ascii ? 7 : 8};
    char *baud = strchr(path, ','), *parity = baud ? strchr(baud + 1, ',') : NULL;
    mbm_port port;

    if (parity) {
        *parity = '\0';
        options.parity = parity[1];
    }
    if (baud) {
        *baud = '\0';
        options.baud = (uint32_t)line_number(baud + 1, 50, 4000000);
    }
    if (mbm_tty_openWith(&l->tty, path, &options) != 0)
        return -1;
    port = mbm_tty_port(&l->tty, NULL);
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
    if (mbm_tcp_open(&l->tcp, host, service ? service : MBM_TCP_SERVICE) != 0)
        return -1;
    l->is_tcp = 1;
    l->connected = line_milliseconds();
    port = mbm_tcp_port(&l->tcp, NULL);
    if (rtu)
        return mbm_client_beginRtuOverTcp(&l->client, &port, l->incoming, sizeof l->incoming);
    return mbm_client_beginTcp(&l->client, &port, l->incoming, sizeof l->incoming, l->outgoing,
                               sizeof l->outgoing);
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
        fprintf(stderr, "%s: %s\nplaces: %s\n", place, strerror(errno), LINE_PLACES);
        return -1;
    }
    mbm_client_setCounters(&l->client, &l->counters);
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
    const mbm_link anew = {&l->tcp, mbm_tcp_disconnect, mbm_tcp_connect};

    (void)mbm_client_poll(&l->client);
    if (l->is_tcp && !mbm_client_isConnected(&l->client) &&
        line_milliseconds() - l->connected >= 1000) {
        l->connected = line_milliseconds();
        (void)mbm_client_reconnect(&l->client, &anew);
    }
}

void line_rest(line *l, uint32_t milliseconds)
{
    uint32_t micros = mbm_client_pollDelay(&l->client);

    if (micros / 1000 >= milliseconds)
        micros = milliseconds * 1000;
    if (l->is_tcp)
        (void)mbm_tcp_wait(&l->tcp, 1, NULL, -1, micros);
    else
        (void)mbm_tty_wait(&l->tty, micros);
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
    case 1:
        return mbm_client_readCoils(&l->client, request, address, quantity);
    case 2:
        return mbm_client_readDiscreteInputs(&l->client, request, address, quantity);
    case 3:
        return mbm_client_readHoldingRegisters(&l->client, request, address, quantity);
    default:
        return mbm_client_readInputRegisters(&l->client, request, address, quantity);
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
    long number = strtol(text, &rest, 0);

    if (rest == text || *rest || number < least || number > most) {
        fprintf(stderr, "%s: not a number from %ld to %ld\n", text, least, most);
        exit(2);
    }
    return number;
}
