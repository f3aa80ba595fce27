#define _GNU_SOURCE
#include "gateway_line.h"

#include "trace.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* A lookup of a host may block the gateway, so there is a longer pause between two of them. */
enum { REOPEN_MS = 1000, LOOKUP_MS = 10000 };

static uint32_t micros(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

/* --- the place --- */

/* BAUD,PARITY+STOP. Returns what follows, or NULL. */
static char *read_serial(gateway_line *line, char *text)
{
    struct termios unused = {0};
    char *baud, *rest = NULL, *format;
    unsigned rate, stop;
    char parity, extra;

    baud = strtok_r(text, ",", &rest);
    format = baud ? strtok_r(NULL, ",", &rest) : NULL;
    if (!format || sscanf(baud, "%9u%c", &rate, &extra) != 1 || rate < 50 ||
        sscanf(format, "%c%1u%c", &parity, &stop, &extra) != 2 || stop > 2)
        return NULL;
    line->options.baud = rate;
    line->options.anyRate = 1;
    line->options.parity = parity;
    line->options.stop = (uint8_t)stop;
    return mbm_tty_settings(&unused, &line->options) == 0 ? rest : NULL;
}

/* [PORT,]. Returns what follows. A range of units has a minus, a port has none. */
static char *read_service(gateway_line *line, char *text)
{
    const size_t length = strcspn(text, ",");

    line->service = MBM_TCP_SERVICE;
    if (memchr(text, '-', length))
        return text;
    if (length == 0 || strspn(text, "0123456789") != length)
        return NULL;
    line->service = text;
    text += length;
    if (*text)
        *text++ = '\0';
    return text;
}

char *gateway_line_read(gateway_line *line, char *text)
{
    static const struct {
        const char *name;
        uint8_t framing, is_tcp;
    } KINDS[] = {{"rtu:", MBM_FRAMING_RTU, 0},
                 {"ascii:", MBM_FRAMING_ASCII, 0},
                 {"tcp:", MBM_FRAMING_TCP, 1},
                 {"rtuovertcp:", MBM_FRAMING_RTU_OVER_TCP, 1}};
    unsigned kind;
    char *rest;

    line->framing = MBM_FRAMING_RTU;
    for (kind = 0; kind < sizeof KINDS / sizeof *KINDS; kind++)
        if (strncmp(text, KINDS[kind].name, strlen(KINDS[kind].name)) == 0) {
            line->framing = KINDS[kind].framing;
            line->is_tcp = KINDS[kind].is_tcp;
            text += strlen(KINDS[kind].name);
            break;
        }
    line->place = text;
    rest = strchr(text, ',');
    if (!rest || rest == text)
        return NULL;
    *rest++ = '\0';
    return line->is_tcp ? read_service(line, rest) : read_serial(line, rest);
}

/* --- the link --- */

/* Keeps a descriptor for a line that is not open. Without it, a new connection could take the
 * line's descriptor, and the line could not be opened again. */
static void keep_reserve(gateway_line *line)
{
    int fd = line->reserve ? 0 : open("/dev/null", O_RDONLY | O_CLOEXEC);

    if (fd > 0)
        line->reserve = fd;
}

static void free_reserve(gateway_line *line)
{
    if (line->reserve)
        close(line->reserve);
    line->reserve = 0;
}

static void close_line(void *context)
{
    gateway_line *line = (gateway_line *)context;

    if (line->is_tcp)
        mbm_tcp_disconnect(&line->tcp);
    else
        mbm_tty_close(&line->tty);
    keep_reserve(line);
}

static uint8_t link_status(void *context)
{
    gateway_line *line = (gateway_line *)context;

    if (line->is_tcp)
        return mbm_tcp_status(&line->tcp);
    return line->tty.isOpen ? MBM_OK : MBM_LINK_LOST;
}

/* Looks a host up, and begins to connect. */
static uint8_t open_tcp(gateway_line *line)
{
    mbm_tcp *tcp = &line->tcp;

    if (mbm_tcp_isInUse(tcp))
        return mbm_tcp_connect(tcp);
    if (tcp->lookupError && micros() - line->looked_up < LOOKUP_MS * 1000u)
        return MBM_LINK_LOST;
    if (mbm_tcp_open(tcp, &line->addresses, line->place, line->service) == 0)
        return mbm_tcp_status(tcp);
    tcp->error = errno;
    line->looked_up = micros();
    return MBM_LINK_LOST;
}

static uint8_t open_line(void *context)
{
    gateway_line *line = (gateway_line *)context;

    line->tried = micros();
    free_reserve(line);
    if (line->is_tcp)
        return open_tcp(line);
    if (mbm_tty_openWith(&line->tty, line->place, &line->options) == 0)
        return MBM_OK;
    line->tty.error = errno;
    return MBM_LINK_LOST;
}

/* Prints why a line was lost or not opened, once for each reason. */
static void report(void *context, uint8_t event, uint8_t status)
{
    gateway_line *line = (gateway_line *)context;
    const int error = line->is_tcp ? line->tcp.error : line->tty.error;
    const char *reason = line->tcp.lookupError ? gai_strerror(line->tcp.lookupError)
                         : status == MBM_RESPONSE_TIMED_OUT || error == 0 ? mbm_status_text(status)
                                                                          : strerror(error);

    if (event == MBM_LINK_EVENT_CONNECTED) {
        line->reason[0] = '\0';
        return;
    }
    if (strncmp(reason, line->reason, sizeof line->reason - 1) != 0)
        fprintf(stderr, "%s: %s\n", line->place, reason);
    snprintf(line->reason, sizeof line->reason, "%s", reason);
    /* The next request may open a line that was open until now. */
    if (event == MBM_LINK_EVENT_LOST)
        line->tried = micros() - REOPEN_MS * 1000u;
}

static uint8_t begin_client(gateway_line *line)
{
    const mbm_port port =
        trace_client(line->is_tcp ? mbm_tcp_port(&line->tcp) : mbm_tty_port(&line->tty),
                     line->framing, line->place);
    mbm_client *client = &line->client;
    uint8_t status;

    switch (line->framing) {
    case MBM_FRAMING_TCP:
        return mbm_client_beginTcp(client, &port, line->frame, MBM_MAX_TCP_FRAME, line->outgoing,
                                   sizeof line->outgoing);
    case MBM_FRAMING_RTU_OVER_TCP:
        return mbm_client_beginRtuOverTcp(client, &port, line->frame, sizeof line->frame);
    case MBM_FRAMING_ASCII:
        return mbm_client_beginAscii(client, &port, line->frame, sizeof line->frame);
    default:
        status = mbm_client_beginRtu(client, &port, line->frame, sizeof line->frame);
        return status ? status : mbm_client_setBaudRate(client, line->options.baud);
    }
}

int gateway_line_begin(gateway_line *line, uint16_t timeoutMs, uint16_t quietMs)
{
    const mbm_linkHooks hooks = {line, close_line, open_line, link_status};

    keep_reserve(line);
    return begin_client(line) == MBM_OK &&
                   mbm_client_setResponseTimeout(&line->client, timeoutMs) == MBM_OK &&
                   mbm_client_setQuietTime(&line->client, quietMs) == MBM_OK &&
                   mbm_link_begin(&line->link, &line->client, &hooks) == MBM_OK &&
                   mbm_link_setBackoff(&line->link, MBM_BACKOFF_FIXED, REOPEN_MS, REOPEN_MS) ==
                       MBM_OK &&
                   mbm_link_setConnectTimeout(&line->link, timeoutMs) == MBM_OK &&
                   mbm_link_setCallback(&line->link, report, line) == MBM_OK
               ? 0
               : -1;
}

/* Whether a line that was open has hung up since the last wait. */
static int has_hung_up(gateway_line *line)
{
    struct pollfd idle = {line->tty.fd, 0, 0};

    return line->is_tcp ? mbm_tcp_isConnected(&line->tcp) < 0 : poll(&idle, 1, 0) > 0;
}

uint8_t gateway_line_isReady(void *context)
{
    gateway_line *line = (gateway_line *)context;
    const uint8_t state = mbm_link_state(&line->link);

    if ((state == MBM_LINK_IS_UP && mbm_client_pending(&line->client) == 0 && has_hung_up(line)) ||
        (state == MBM_LINK_IS_DOWN && micros() - line->tried >= REOPEN_MS * 1000u)) {
        /* The request waits for this attempt, and ends if it fails. */
        (void)mbm_link_reconnect(&line->link);
        return 1;
    }
    return state != MBM_LINK_IS_DOWN;
}

int gateway_line_wait(const gateway_line *line, struct pollfd *wait)
{
    const int is_open = line->is_tcp ? line->tcp.events != 0 : line->tty.isOpen;

    *wait = (struct pollfd){line->is_tcp ? line->tcp.fd : line->tty.fd,
                            line->is_tcp ? line->tcp.events : POLLIN, 0};
    return is_open;
}

void gateway_line_close(gateway_line *line)
{
    if (line->is_tcp)
        mbm_tcp_close(&line->tcp);
    else
        mbm_tty_close(&line->tty);
    free_reserve(line);
}
