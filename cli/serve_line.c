#define _GNU_SOURCE
#include "serve_line.h"

#include "fault_port.h"
#include "line.h"
#include "mbm_tls_linux.h"
#include "mbm_udp.h"
#include "report.h"
#include "terminal.h"
#include "trace.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

/* REST: the longest sleep in microseconds, since a signal just before it does not end it. */
enum { PLACES = 32, REST = 500000, LINK_BYTES = 256 };

/* Where Linux names pseudo terminals. */
#define PSEUDO_TERMINALS "/dev/pts/"

static place at;
static mbm_tty tty;
static int far_end = -1;   /* of a pseudo terminal, kept open so that the line does not hang up */
static char linked_to[64]; /* the pseudo terminal to which this program has made a link */
static mbm_udp udp;
static mbm_tcp_listener listener;
static mbm_tcp_set set; /* of the listener and its connections; TLS does without */
static mbm_tls_identity identity;
static mbm_tls_files files;

/* The connections; a line or a socket has the first one. */
static mbm_tcp tcps[PLACES];
static mbm_tls tlss[PLACES];
static fault_port ports[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_ASCII_FRAME];
static int count;

/* --- opening --- */

/* Says why, which is an error of getaddrinfo or one of the system. */
static int cannot_open(int lookupError)
{
    const int error = errno;
    const char *advice = lookupError ? "Check the name of the host" : place_advice(&at, error);

    return report(CODE_LINE, "%s: %s%s%s", at.text,
                  lookupError ? gai_strerror(lookupError) : terminal_error_text(&at, error),
                  *advice ? ". " : "", advice);
}

static int open_tty(char *name)
{
    snprintf(name, SERVE_LINE_NAME_BYTES, "%s", at.path);
    return terminal_open(&tty, &at) == 0 ? CODE_DONE : cannot_open(0);
}

/* Whether a link leads to what a pseudo terminal was: a name of one that is gone, or that the
 * system has given to this program again. */
static int is_left_over(const char *leads_to, const char *target)
{
    const size_t folder = sizeof PSEUDO_TERMINALS - 1;

    return strcmp(leads_to, target) == 0 ||
           (strncmp(leads_to, PSEUDO_TERMINALS, folder) == 0 && leads_to[folder] != '\0' &&
            strspn(leads_to + folder, "0123456789") == strlen(leads_to + folder) &&
            access(leads_to, F_OK) != 0 && errno == ENOENT);
}

/* Reads where the link of the place leads. Returns 0 if there is none. */
static int read_link(char leads_to[LINK_BYTES])
{
    const ssize_t length = readlink(at.path, leads_to, LINK_BYTES - 1);

    leads_to[length > 0 ? length : 0] = '\0';
    return length > 0;
}

/* Links a name to the far end. Replaces only a link that an ended program has left. */
static int link_name(const char *target)
{
    char leads_to[LINK_BYTES];
    struct stat old;

    if (lstat(at.path, &old) == 0) {
        if (!read_link(leads_to))
            return report(CODE_LINE, "%s: %s is there already and is no link", at.text, at.path);
        if (!is_left_over(leads_to, target))
            return report(CODE_LINE,
                          strncmp(leads_to, PSEUDO_TERMINALS, sizeof PSEUDO_TERMINALS - 1) == 0
                              ? "%s: %s leads to %s, which a program has open, such as another mbm "
                                "serve. Take another name, or end that program"
                              : "%s: %s leads to %s, and only a link that mbm serve has left is "
                                "replaced. Take another name, or remove the link",
                          at.text, at.path, leads_to);
        (void)unlink(at.path);
    }
    if (symlink(target, at.path) != 0)
        return cannot_open(0);
    snprintf(linked_to, sizeof linked_to, "%s", target);
    return CODE_DONE;
}

/* Removes the link of this program. Another one may stand there by now. */
static void unlink_name(void)
{
    char leads_to[LINK_BYTES];

    if (*linked_to && read_link(leads_to) && strcmp(leads_to, linked_to) == 0)
        (void)unlink(at.path);
    linked_to[0] = '\0';
}

static int open_pty(char *name)
{
    const int near_end = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    struct termios raw;
    char path[64];

    if (near_end < 0)
        return cannot_open(0);
    if (grantpt(near_end) != 0 || unlockpt(near_end) != 0 ||
        ptsname_r(near_end, path, sizeof path) != 0 ||
        (far_end = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC)) < 0 ||
        tcgetattr(far_end, &raw) != 0 || mbm_tty_attach(&tty, near_end) != 0) {
        const int error = errno;

        (void)close(near_end);
        errno = error;
        return cannot_open(0);
    }
    cfmakeraw(&raw);
    (void)tcsetattr(far_end, TCSANOW, &raw);
    snprintf(name, SERVE_LINE_NAME_BYTES, "%s", *at.path ? at.path : path);
    return *at.path ? link_name(path) : CODE_DONE;
}

static int open_udp(void)
{
    if (mbm_udp_listen(&udp, place_host(&at), at.service) == 0)
        return CODE_DONE;
    return cannot_open(udp.lookupError);
}

static int open_tls(void)
{
    mbm_tls_options options = {.isServer = 1};
    const char *unreadable;
    uint8_t status;

    unreadable = line_load_tls(&at, &files, &options);
    if (unreadable)
        return report(CODE_WRONG, "%s: %s", unreadable, strerror(errno));
    status = mbm_tls_begin(&identity, &options);
    mbm_tls_forgetKey(&files);
    return status == 0 ? CODE_DONE : report(CODE_WRONG, "%s: %s", at.text, mbm_tls_text(status));
}

static int open_listener(void)
{
    const int result = at.kind == PLACE_TLS
                           ? mbm_tls_listen(&listener, place_host(&at), at.service)
                           : mbm_tcp_listen(&listener, place_host(&at), at.service);

    if (result == 0 && (at.kind == PLACE_TLS ||
                        (mbm_tcp_openSet(&set) == 0 && mbm_tcp_addListener(&set, &listener) == 0)))
        return CODE_DONE;
    return cannot_open(listener.lookupError);
}

/* Writes the name of a listening place with its port. */
static void name_network(uint16_t port, char *name)
{
    const char *bracket = strchr(at.host, ':') ? "[" : "", *end = *bracket ? "]" : "";

    snprintf(name, SERVE_LINE_NAME_BYTES, "%.*s//%s%s%s:%u", (int)strcspn(at.text, "/"), at.text,
             bracket, at.host, end, port);
}

int serve_line_open(const place *where, char name[SERVE_LINE_NAME_BYTES])
{
    int code;

    at = *where;
    switch (at.kind) {
    case PLACE_RTU:
    case PLACE_ASCII: return open_tty(name);
    case PLACE_PTY: return open_pty(name);
    case PLACE_UDP:
        code = open_udp();
        name_network(udp.port, name);
        return code;
    default:
        code = at.kind == PLACE_TLS ? open_tls() : CODE_DONE;
        if (code == CODE_DONE)
            code = open_listener();
        name_network(listener.port, name);
        return code;
    }
}

void serve_line_close(void)
{
    int i;

    for (i = 0; i < PLACES; i++) {
        mbm_tls_close(&tlss[i]);
        mbm_tcp_close(&tcps[i]);
    }
    mbm_tls_end(&identity);
    mbm_tcp_closeListener(&listener);
    mbm_tcp_closeSet(&set);
    mbm_udp_close(&udp);
    if (at.kind == PLACE_PTY && tty.isOpen) {
        const int near_end = tty.fd;

        /* The other end may never read the last answers, so they are discarded. */
        (void)tcflush(near_end, TCIOFLUSH);
        mbm_tty_detach(&tty);
        (void)close(near_end);
        unlink_name();
    }
    if (far_end >= 0)
        (void)close(far_end);
    mbm_tty_close(&tty);
}

/* --- serving --- */

uint8_t serve_line_before(void *context, const mbm_request *request)
{
    fault_port *port = (fault_port *)request->connection;

    memset(&port->chosen, 0, sizeof port->chosen);
    /* Nobody answers a broadcast. */
    if (request->unit == 0 && place_is_serial(&at))
        return 0;
    fault_choose((fault_list *)context, &port->chosen);
    return (uint8_t)port->chosen.value[FAULT_EXCEPTION];
}

/* Begins the server of a connection. */
static void begin(served_units *units, int i, const mbm_port *below)
{
    char name[64];
    mbm_port traced, port;

    if (at.kind == PLACE_UDP || place_is_serial(&at))
        snprintf(name, sizeof name, "%.60s", at.text);
    else
        snprintf(name, sizeof name, "client %d", i + 1);
    traced = trace_server(*below, at.framing, name);
    port = fault_port_begin(&ports[i], &traced, at.framing, at.kind == PLACE_UDP);
    switch (at.framing) {
    case MBM_FRAMING_RTU:
        (void)mbm_server_beginRtu(&servers[i], &port, units->units, units->count, frames[i],
                                  MBM_MAX_FRAME);
        break;
    case MBM_FRAMING_ASCII:
        (void)mbm_server_beginAscii(&servers[i], &port, units->units, units->count, frames[i],
                                    MBM_MAX_ASCII_FRAME);
        break;
    case MBM_FRAMING_RTU_OVER_TCP:
        (void)mbm_server_beginRtuOverTcp(&servers[i], &port, units->units, units->count, frames[i],
                                         MBM_MAX_FRAME);
        break;
    default:
        (void)mbm_server_beginTcp(&servers[i], &port, units->units, units->count, frames[i],
                                  MBM_MAX_TCP_FRAME);
    }
    if (at.kind == PLACE_RTU) {
        (void)mbm_server_setBaudRate(&servers[i], at.tty.baud);
        if (at.has_echo)
            (void)mbm_server_setEchoDiscard(&servers[i], at.discards_echo);
        if (at.has_latency)
            (void)mbm_server_setReceiveLatency(&servers[i], (uint16_t)at.latencyMs);
        if (at.has_gap)
            (void)mbm_server_setSilence(&servers[i], at.gapMs * 1000);
    }
}

/* How long the server of a connection has nothing to do. */
static uint32_t delay_of(int i)
{
    const uint32_t due = fault_port_delay(&ports[i]);

    return due != UINT32_MAX ? due : mbm_server_pollDelay(&servers[i]);
}

static int is_used(int i)
{
    return count == 1 || mbm_tcp_isInUse(&tcps[i]);
}

static void rest(void)
{
    uint32_t delay = REST;
    int i;

    for (i = 0; i < count; i++)
        if (is_used(i) && delay_of(i) < delay)
            delay = delay_of(i);
    if (at.kind == PLACE_UDP)
        (void)mbm_udp_wait(&udp, 1, -1, delay);
    else if (at.kind == PLACE_TLS)
        (void)mbm_tls_wait(tlss, tcps, PLACES, &listener, -1, delay);
    else if (place_is_tcp(&at))
        (void)mbm_tcp_waitSet(&set, delay);
    else
        (void)mbm_tty_wait(&tty, delay);
    if (far_end >= 0)
        terminal_free(far_end);
}

/* Accepts the connections that wait; of TLS one in each round. */
static void accept_all(served_units *units)
{
    mbm_port port;
    int i;

    if (at.kind == PLACE_TLS) {
        i = mbm_tls_accept(&listener, &identity, tlss, tcps, PLACES);
        if (i >= 0) {
            port = mbm_tls_port(&tlss[i]);
            begin(units, i, &port);
        }
        return;
    }
    while ((i = mbm_tcp_accept(&listener, tcps, PLACES)) >= 0) {
        port = mbm_tcp_port(&tcps[i]);
        begin(units, i, &port);
    }
}

/* Finds the servers to poll: of a set those whose connection is ready, or that have something due
 * without it. */
static void find_due(uint8_t is_due[PLACES])
{
    const mbm_tcp *tcp;
    int i;

    for (i = 0; i < count; i++)
        is_due[i] = is_used(i) && (!set.isOpen || fault_port_delay(&ports[i]) != UINT32_MAX ||
                                   mbm_server_pollDelay(&servers[i]) == 0);
    while (set.isOpen && (tcp = mbm_tcp_nextReady(&set)))
        is_due[tcp - tcps] = 1;
}

int serve_line_run(served_units *units)
{
    const int is_listening = place_is_tcp(&at);
    uint8_t is_due[PLACES] = {0};
    mbm_port port;
    int i;

    count = is_listening ? PLACES : 1;
    if (!is_listening) {
        port = at.kind == PLACE_UDP ? mbm_udp_port(&udp) : mbm_tty_port(&tty);
        begin(units, 0, &port);
    }
    while (!report_stopped) {
        if (is_listening)
            accept_all(units);
        find_due(is_due);
        for (i = 0; i < count; i++) {
            if (!is_due[i] || mbm_server_poll(&servers[i]) == MBM_OK)
                continue;
            if (!is_listening)
                return report(CODE_LINE, "%s: the line was lost: %s", at.text,
                              report_error_text(at.kind == PLACE_UDP ? udp.error : tty.error));
            mbm_tls_close(&tlss[i]);
            mbm_tcp_close(&tcps[i]);
        }
        rest();
    }
    return CODE_DONE;
}
