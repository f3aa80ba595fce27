/* mbm serve: a device from a file, one whose values vary, or one that holds what is written; on a
 * terminal, a pseudo terminal, a socket or a listener with connections. */
#include "device.h"
#include "device_plan.h"
#include "fault_port.h"
#include "line.h"
#include "numbers.h"
#include "options.h"
#include "report.h"
#include "served.h"
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
enum { PLACES = 32, REST = 500000, LINK_BYTES = 256, NAME_BYTES = 600 };

/* Where Linux names pseudo terminals. */
#define PSEUDO_TERMINALS "/dev/pts/"

/* The connections of a listener; a terminal or a socket has the first one. */
typedef struct serve_connection {
    mbm_server server;
    fault_port port;
    uint8_t frame[MBM_MAX_ASCII_FRAME];
} serve_connection;

typedef struct serve_line {
    place at;
    fault_device faults;
    mbm_tty tty;
    int far_end; /* of a pseudo terminal, kept open so that the line does not hang up; or -1 */
    char linked_to[64]; /* the pseudo terminal to which this program has made a link */
    mbm_udp udp;
    mbm_tcp_listener listener;
    mbm_tcp_set set; /* of the listener and its connections; TLS does without */
    mbm_tls_identity identity;
    mbm_tls_files files;
    mbm_tcp tcps[PLACES];
    mbm_tls tlss[PLACES];
    serve_connection connections[PLACES];
    int count;
} serve_line;

typedef struct serving {
    /* What the command line says. */
    const char *place_text, *file, *unit_text;
    const char *fault_texts[FAULT_MOST];
    uint32_t fault_count;
    int is_random, is_echo, is_quiet;
    place where;
    uint8_t ids[OPTIONS_UNITS], id_count;

    serve_line line;
    served_units units;
} serving;

/* --- opening the line --- */

static int open_tty(serve_line *l, char *name)
{
    snprintf(name, NAME_BYTES, "%s", l->at.path);
    return terminal_open(&l->tty, &l->at) == 0 ? CODE_DONE : line_cannot_open(&l->at, 0);
}

/* Whether a link is left over: it leads to a pseudo terminal that is gone, or that the system has
 * given to this program again. */
static int is_left_over(const char *leads_to, const char *target)
{
    const size_t folder = sizeof PSEUDO_TERMINALS - 1;

    return strcmp(leads_to, target) == 0 ||
           (strncmp(leads_to, PSEUDO_TERMINALS, folder) == 0 && leads_to[folder] != '\0' &&
            strspn(leads_to + folder, "0123456789") == strlen(leads_to + folder) &&
            access(leads_to, F_OK) != 0 && errno == ENOENT);
}

/* Reads where the link of the place leads. Returns 0 if there is none. */
static int read_link(serve_line *l, char leads_to[LINK_BYTES])
{
    const ssize_t length = readlink(l->at.path, leads_to, LINK_BYTES - 1);

    leads_to[length > 0 ? length : 0] = '\0';
    return length > 0;
}

/* Links a name to the far end. Replaces only a link that an ended program has left. */
static int link_name(serve_line *l, const char *target)
{
    char leads_to[LINK_BYTES];
    struct stat old;

    if (lstat(l->at.path, &old) == 0) {
        if (!read_link(l, leads_to))
            return report(CODE_LINE, "%s: %s is there already and is no link", l->at.text,
                          l->at.path);
        if (!is_left_over(leads_to, target))
            return report(CODE_LINE,
                          strncmp(leads_to, PSEUDO_TERMINALS, sizeof PSEUDO_TERMINALS - 1) == 0
                              ? "%s: %s leads to %s, which a program has open, such as another mbm "
                                "serve. Take another name, or end that program"
                              : "%s: %s leads to %s, and only a link that mbm serve has left is "
                                "replaced. Take another name, or remove the link",
                          l->at.text, l->at.path, leads_to);
        (void)unlink(l->at.path);
    }
    if (symlink(target, l->at.path) != 0)
        return line_cannot_open(&l->at, 0);
    snprintf(l->linked_to, sizeof l->linked_to, "%s", target);
    return CODE_DONE;
}

/* Removes the link of this program. Another one may stand there by now. */
static void unlink_name(serve_line *l)
{
    char leads_to[LINK_BYTES];

    if (*l->linked_to && read_link(l, leads_to) && strcmp(leads_to, l->linked_to) == 0)
        (void)unlink(l->at.path);
    l->linked_to[0] = '\0';
}

static int open_pty(serve_line *l, char *name)
{
    const int near_end = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    struct termios raw;
    char path[64];

    if (near_end < 0)
        return line_cannot_open(&l->at, 0);
    if (grantpt(near_end) != 0 || unlockpt(near_end) != 0 ||
        ptsname_r(near_end, path, sizeof path) != 0 ||
        (l->far_end = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC)) < 0 ||
        tcgetattr(l->far_end, &raw) != 0 || mbm_tty_attach(&l->tty, near_end) != 0) {
        const int error = errno;

        (void)close(near_end);
        errno = error;
        return line_cannot_open(&l->at, 0);
    }
    cfmakeraw(&raw);
    (void)tcsetattr(l->far_end, TCSANOW, &raw);
    snprintf(name, NAME_BYTES, "%s", *l->at.path ? l->at.path : path);
    return *l->at.path ? link_name(l, path) : CODE_DONE;
}

static int open_udp(serve_line *l)
{
    if (mbm_udp_listen(&l->udp, place_host(&l->at), l->at.service) == 0)
        return CODE_DONE;
    return line_cannot_open(&l->at, l->udp.lookupError);
}

static int open_tls(serve_line *l)
{
    mbm_tls_options tls = {.isServer = 1};
    const char *unreadable;
    uint8_t status;

    unreadable = line_load_tls(&l->at, &l->files, &tls);
    if (unreadable)
        return report(CODE_WRONG, "%s: %s", unreadable, strerror(errno));
    status = mbm_tls_begin(&l->identity, &tls);
    mbm_tls_forgetKey(&l->files);
    return status == 0 ? CODE_DONE : report(CODE_WRONG, "%s: %s", l->at.text, mbm_tls_text(status));
}

static int open_listener(serve_line *l)
{
    const int result = l->at.kind == PLACE_TLS
                           ? mbm_tls_listen(&l->listener, place_host(&l->at), l->at.service)
                           : mbm_tcp_listen(&l->listener, place_host(&l->at), l->at.service);

    if (result == 0 &&
        (l->at.kind == PLACE_TLS ||
         (mbm_tcp_openSet(&l->set) == 0 && mbm_tcp_addListener(&l->set, &l->listener) == 0)))
        return CODE_DONE;
    return line_cannot_open(&l->at, l->listener.lookupError);
}

/* Writes the name of a listening place with its port. */
static void name_network(serve_line *l, uint16_t port, char *name)
{
    const char *bracket = strchr(l->at.host, ':') ? "[" : "", *end = *bracket ? "]" : "";

    snprintf(name, NAME_BYTES, "%.*s//%s%s%s:%u", (int)strcspn(l->at.text, "/"), l->at.text,
             bracket, l->at.host, end, port);
}

/* Opens the place of a line that is zeroed but for its faults. Returns CODE_DONE, or another exit
 * code after reporting the reason. `name` receives the place as its masters write it, with the port
 * or the terminal that the system has chosen. */
static int open_line(serve_line *l, const place *where, char name[NAME_BYTES])
{
    int code;

    l->at = *where;
    l->far_end = -1;
    switch (l->at.kind) {
    case PLACE_RTU:
    case PLACE_ASCII: return open_tty(l, name);
    case PLACE_PTY: return open_pty(l, name);
    case PLACE_UDP:
        code = open_udp(l);
        name_network(l, l->udp.port, name);
        return code;
    default:
        code = l->at.kind == PLACE_TLS ? open_tls(l) : CODE_DONE;
        if (code == CODE_DONE)
            code = open_listener(l);
        name_network(l, l->listener.port, name);
        return code;
    }
}

static void close_line(serve_line *l)
{
    int i;

    for (i = 0; i < PLACES; i++) {
        mbm_tls_close(&l->tlss[i]);
        mbm_tcp_close(&l->tcps[i]);
    }
    mbm_tls_end(&l->identity);
    mbm_tcp_closeListener(&l->listener);
    mbm_tcp_closeSet(&l->set);
    mbm_udp_close(&l->udp);
    if (l->at.kind == PLACE_PTY && l->tty.isOpen) {
        const int near_end = l->tty.fd;

        /* The other end may never read the last answers, so they are discarded. */
        (void)tcflush(near_end, TCIOFLUSH);
        mbm_tty_detach(&l->tty);
        (void)close(near_end);
        unlink_name(l);
    }
    if (l->far_end >= 0)
        (void)close(l->far_end);
    mbm_tty_close(&l->tty);
}

/* --- serving --- */

/* The hook of the units: counts each request and chooses its faults. */
static uint8_t before_request(void *context, const mbm_request *request)
{
    serve_line *l = (serve_line *)context;
    fault_port *port = (fault_port *)request->connection;

    memset(&port->chosen, 0, sizeof port->chosen);
    /* A broadcast has no answer. */
    if (request->unit == 0 && place_is_serial(&l->at))
        return 0;
    return fault_device_take(&l->faults, request);
}

/* The microseconds of a byte on the line; where there is no rate, at the standard's 19200 baud. */
static uint32_t char_time(const serve_line *l)
{
    return 11 * 1000000u / (l->at.tty.baud ? l->at.tty.baud : 19200);
}

/* How many connections there may be. */
static size_t most_connections(const serve_line *l)
{
    const uint32_t most = fault_value(&l->faults.list, FAULT_CONNECTIONS);

    return most ? most : PLACES;
}

/* Begins the server of a connection. */
static void begin(serve_line *l, served_units *units, int i, const mbm_port *below)
{
    char name[64];
    mbm_port traced, port;

    if (l->at.kind == PLACE_UDP || place_is_serial(&l->at))
        snprintf(name, sizeof name, "%.60s", l->at.text);
    else
        snprintf(name, sizeof name, "client %d", i + 1);
    traced = trace_server(*below, l->at.framing, name);
    port = fault_port_begin(&l->connections[i].port, &l->faults, &traced, l->at.framing,
                            l->at.kind == PLACE_UDP, char_time(l));
    switch (l->at.framing) {
    case MBM_FRAMING_RTU:
        (void)mbm_server_beginRtu(&l->connections[i].server, &port, units->units, units->count,
                                  l->connections[i].frame, MBM_MAX_FRAME);
        break;
    case MBM_FRAMING_ASCII:
        (void)mbm_server_beginAscii(&l->connections[i].server, &port, units->units, units->count,
                                    l->connections[i].frame, MBM_MAX_ASCII_FRAME);
        break;
    case MBM_FRAMING_RTU_OVER_TCP:
        (void)mbm_server_beginRtuOverTcp(&l->connections[i].server, &port, units->units,
                                         units->count, l->connections[i].frame, MBM_MAX_FRAME);
        break;
    default:
        (void)mbm_server_beginTcp(&l->connections[i].server, &port, units->units, units->count,
                                  l->connections[i].frame, MBM_MAX_TCP_FRAME);
    }
    if (l->at.kind == PLACE_RTU) {
        (void)mbm_server_setBaudRate(&l->connections[i].server, l->at.tty.baud);
        if (l->at.has_echo)
            (void)mbm_server_setEchoDiscard(&l->connections[i].server, l->at.discards_echo);
        if (l->at.has_latency)
            (void)mbm_server_setReceiveLatency(&l->connections[i].server,
                                               (uint16_t)l->at.latencyMs);
        if (l->at.has_gap)
            (void)mbm_server_setSilence(&l->connections[i].server, l->at.gapMs * 1000);
    }
}

/* How long the server of a connection has nothing to do. */
static uint32_t delay_of(serve_line *l, int i)
{
    const uint32_t due = fault_port_delay(&l->connections[i].port),
                   server = mbm_server_pollDelay(&l->connections[i].server);

    /* While an answer waits, the server would look every millisecond. */
    return fault_port_is_waiting(&l->connections[i].port) || due < server ? due : server;
}

static int is_used(serve_line *l, int i)
{
    return l->count == 1 || mbm_tcp_isInUse(&l->tcps[i]);
}

static void rest(serve_line *l)
{
    uint32_t delay = REST;
    int i;

    for (i = 0; i < l->count; i++) {
        const uint32_t due = is_used(l, i) ? delay_of(l, i) : REST;

        if (due < delay)
            delay = due;
    }
    if (l->at.kind == PLACE_UDP)
        (void)mbm_udp_wait(&l->udp, 1, -1, delay);
    else if (l->at.kind == PLACE_TLS)
        (void)mbm_tls_wait(l->tlss, l->tcps, PLACES, &l->listener, -1, delay);
    else if (place_is_tcp(&l->at))
        (void)mbm_tcp_waitSet(&l->set, delay);
    else
        (void)mbm_tty_wait(&l->tty, delay);
    if (l->far_end >= 0)
        terminal_free(l->far_end);
}

/* Accepts the connections that wait; with TLS one in each round. */
static void accept_all(serve_line *l, served_units *units)
{
    mbm_port port;
    int i;

    if (l->at.kind == PLACE_TLS) {
        i = mbm_tls_accept(&l->listener, &l->identity, l->tlss, l->tcps, most_connections(l));
        if (i >= 0) {
            port = mbm_tls_port(&l->tlss[i]);
            begin(l, units, i, &port);
        }
        return;
    }
    while ((i = mbm_tcp_accept(&l->listener, l->tcps, most_connections(l))) >= 0) {
        port = mbm_tcp_port(&l->tcps[i]);
        begin(l, units, i, &port);
    }
}

/* Finds the servers to poll: with a set those that have something due, or whose connection is
 * ready. */
static void find_due(serve_line *l, uint8_t is_due[PLACES])
{
    const mbm_tcp *tcp;
    int i;

    for (i = 0; i < l->count; i++)
        is_due[i] =
            is_used(l, i) && (!l->set.isOpen || fault_port_is_waiting(&l->connections[i].port) ||
                              fault_port_delay(&l->connections[i].port) == 0 ||
                              mbm_server_pollDelay(&l->connections[i].server) == 0);
    while (l->set.isOpen && (tcp = mbm_tcp_nextReady(&l->set)))
        is_due[tcp - l->tcps] = 1;
}

/* Serves until Ctrl-C, or until the line is lost. Returns an exit code. */
static int run_line(serve_line *l, served_units *units)
{
    const int is_listening = place_is_tcp(&l->at);
    uint8_t is_due[PLACES] = {0};
    mbm_port port;
    int i;

    l->count = is_listening ? PLACES : 1;
    if (!is_listening) {
        port = l->at.kind == PLACE_UDP ? mbm_udp_port(&l->udp) : mbm_tty_port(&l->tty);
        begin(l, units, 0, &port);
    }
    while (!report_stopped) {
        if (is_listening)
            accept_all(l, units);
        find_due(l, is_due);
        for (i = 0; i < l->count; i++) {
            if (!is_due[i] || mbm_server_poll(&l->connections[i].server) == MBM_OK)
                continue;
            if (!is_listening)
                return report(
                    CODE_LINE, "%s: the line was lost: %s", l->at.text,
                    report_error_text(l->at.kind == PLACE_UDP ? l->udp.error : l->tty.error));
            fault_port_end(&l->connections[i].port);
            mbm_tls_close(&l->tlss[i]);
            mbm_tcp_close(&l->tcps[i]);
        }
        rest(l);
    }
    return CODE_DONE;
}

/* --- the command line --- */

enum { RANDOM_KEY = 0x2000, ECHO_KEY, FAULT_KEY };

/* Checks what was given, once all of it is known. */
static void check(serving *s, const struct argp_state *state)
{
    uint32_t i, count;

    if (!s->place_text)
        options_wrong(state, "LINE is missing, such as pty: or tcp://:1502");
    if ((s->file != NULL) + s->is_random + s->is_echo != 1)
        options_wrong(state, "give a device FILE, or --random, or --echo");
    if (s->unit_text && s->file)
        options_wrong(state, "--unit goes with --random and --echo: a device file has its units");
    options_place(state, &s->where, s->place_text, 1);
    for (i = 0; i < s->fault_count; i++) {
        const char *wrong = fault_read(&s->line.faults.list, s->fault_texts[i], s->where.kind);

        if (wrong)
            options_wrong(state, "--fault %s", wrong);
    }
    if (fault_check(&s->line.faults.list))
        options_wrong(state, "--fault %s", fault_check(&s->line.faults.list));
    count = options_units(state, "--unit", s->unit_text ? s->unit_text : "1", s->ids);
    if (count > UINT8_MAX)
        options_wrong(state, "--unit: these are %u units, and up to 255 are served", count);
    options_check_units(state, &s->where, s->ids);
    s->id_count = (uint8_t)count;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    serving *s = (serving *)state->input;

    switch (key) {
    case 'u': s->unit_text = text; return 0;
    case RANDOM_KEY: s->is_random = 1; return 0;
    case ECHO_KEY: s->is_echo = 1; return 0;
    case 'q': s->is_quiet = 1; return 0;
    case FAULT_KEY:
        if (s->fault_count == FAULT_MOST)
            options_wrong(state, "there are more than %d --fault options", FAULT_MOST);
        s->fault_texts[s->fault_count++] = text;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 1)
            options_too_many(state, text);
        *(state->arg_num == 0 ? &s->place_text : &s->file) = text;
        return 0;
    case ARGP_KEY_END: check(s, state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"random", RANDOM_KEY, NULL, 0,
     "Every address can be read and written; values that were not written vary", 1},
    {"echo", ECHO_KEY, NULL, 0, "Every address is 0 at first, and holds what is written", 1},
    {"unit", 'u', "N", 0, "Units of --random and --echo, such as 1, 1,17 or 1-10 (1)", 1},
    {"fault", FAULT_KEY, "FAULT", 0, "Answer wrongly: see below", 2},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 3},
    {0}};

static const struct argp_child children[] = {{.argp = &options_trace}, {0}};

static const struct argp parser = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE FILE\nLINE --random\nLINE --echo",
    .doc =
        "Serves a device until Ctrl-C: the values of a device file, or every address.\v"
        "LINE is pty: (a pseudo terminal), pty:PATH (one with a link to it), rtu:PATH, ascii:PATH, "
        "tcp://:PORT, rtu+tcp://:PORT, udp://:PORT or tls://:PORT?ca=FILE&cert=FILE&key=FILE. With "
        "port 0 the system chooses one. The first line of the output says where it serves.\n\n" FAULT_HELP
        "\nmbm serve pty:/tmp/meter meter.yaml --fault late=2s@10\n"
        "mbm serve tcp://:1502 --random --unit 1-10 --fault 'exception=6@5/5'",
    .children = children};

/* --- the command --- */

/* Prints the line that scripts wait for: serving unit 1 on /dev/pts/3. */
static void announce(const served_units *units, const char *name)
{
    int i, last;

    printf("serving unit%s ", units->count > 1 ? "s" : "");
    for (i = 0; i < units->count; i = last + 1) {
        for (last = i;
             last + 1 < units->count && units->units[last + 1].id == units->units[last].id + 1;
             last++)
            ;
        printf("%s%u", i ? ", " : "", units->units[i].id);
        if (last > i)
            printf("-%u", units->units[last].id);
    }
    printf(" on %s\n", name);
    report_flush();
}

/* Reads the device file, and its units. Returns CODE_DONE, or another exit code after reporting the
 * reason. */
static int read_device(serving *s, device *from)
{
    char wrong[YAML_FILE_WRONG_BYTES];
    const char *why;
    unsigned count;
    const int code = device_file_read(from, s->file, wrong);

    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    why = device_plan_check(from, s->file, s->where.framing);
    if (why)
        return report(CODE_WRONG, "%s", why);
    count = served_ids(from, s->ids);
    if (count > UINT8_MAX)
        return report(CODE_WRONG, "%s: the fields have %u units, and up to 255 are served", s->file,
                      count);
    s->id_count = (uint8_t)count;
    return CODE_DONE;
}

static int make_units(serving *s, const device *from, served_hook *hook)
{
    const int status =
        s->file ? served_make_device(&s->units, from, s->ids, s->id_count, hook)
                : served_make_units(&s->units, s->is_random ? SERVED_RANDOM : SERVED_ECHO, s->ids,
                                    s->id_count, hook);

    return status == 0 ? CODE_DONE : report(CODE_SYSTEM, REPORT_NO_MEMORY);
}

static int serve(serving *s)
{
    char name[NAME_BYTES];
    int code = open_line(&s->line, &s->where, name);

    if (code == CODE_DONE) {
        announce(&s->units, name);
        code = run_line(&s->line, &s->units);
        if (!s->is_quiet)
            fprintf(stderr, "%s: requests: %u, with a fault: %u.\n", report_name,
                    s->line.faults.list.requests, s->line.faults.list.hit);
    }
    close_line(&s->line);
    return code;
}

int serve_command(int argc, char **argv)
{
    static serving data;
    serving *s = &data;
    served_hook hook = {.before = before_request, .context = &s->line};
    device from = {0};
    int code;

    argp_parse(&parser, argc, argv, 0, NULL, s);
    code = s->file ? read_device(s, &from) : CODE_DONE;
    if (code == CODE_DONE)
        code = make_units(s, &from, &hook);
    if (code == CODE_DONE)
        code = serve(s);
    served_free(&s->units);
    device_free(&from);
    return code;
}
