/* Opens the lines of clients, keeps them open, and says why a request got no reply. */
#include "line.h"

#include "advice.h"
#include "clock.h"
#include "numbers.h"
#include "options.h"
#include "report.h"
#include "terminal.h"
#include "trace.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* A lookup of a host may block the program, so there is a longer pause between two of them. */
enum { REOPEN_MS = 1000, LOOKUP_MS = 10000 };

static uint32_t micros(void)
{
    return (uint32_t)clock_micros(CLOCK_MONOTONIC);
}

uint32_t line_milliseconds(void)
{
    return (uint32_t)clock_milliseconds();
}

/* --- the hooks of the link: a terminal, which is opened for this program alone, or a socket --- */

/* Keeps a descriptor for a line that is not open. Without it, a new connection could take the
 * line's descriptor, and the line could not be opened again. */
static void keep_reserve(line *l)
{
    const int fd = l->reserve ? 0 : open("/dev/null", O_RDONLY | O_CLOEXEC);

    if (fd > 0)
        l->reserve = fd;
}

static void free_reserve(line *l)
{
    if (l->reserve)
        close(l->reserve);
    l->reserve = 0;
}

static void close_device(void *context)
{
    line *l = (line *)context;

    if (place_is_tcp(&l->place))
        mbm_tcp_disconnect(&l->tcp);
    else
        mbm_tty_disconnect(&l->tty);
    keep_reserve(l);
}

static uint8_t open_device(void *context)
{
    line *l = (line *)context;
    uint8_t status;

    l->tried = micros();
    free_reserve(l);
    if (!place_is_tcp(&l->place))
        return terminal_connect(&l->tty, &l->place);
    if (l->tcp.lookupError && micros() - l->looked_up < LOOKUP_MS * 1000u)
        return MBM_LINK_LOST;
    status = mbm_tcp_connect(&l->tcp);
    if (l->tcp.lookupError)
        l->looked_up = micros();
    return status;
}

static uint8_t device_status(void *context)
{
    line *l = (line *)context;

    return place_is_tcp(&l->place) ? mbm_tcp_status(&l->tcp) : mbm_tty_status(&l->tty);
}

/* --- opening --- */

static int cannot_open(const place *where, const char *reason, const char *advice)
{
    return report(CODE_LINE, "%s: %s%s%s", where->text, reason, *advice ? ". " : "", advice);
}

int line_cannot_open(const place *where, int lookup_error)
{
    const int error = errno;

    if (lookup_error)
        return cannot_open(where, gai_strerror(lookup_error), "Check the name of the host");
    return cannot_open(where, terminal_error_text(where, error), place_advice(where, error));
}

static int open_tty(line *l)
{
    return terminal_open(&l->tty, &l->place) == 0 ? CODE_DONE : line_cannot_open(&l->place, 0);
}

static int open_tcp_later(line *l)
{
    return mbm_tcp_openLater(&l->tcp, &l->addresses, l->place.host, l->place.service) == 0
               ? CODE_DONE
               : line_cannot_open(&l->place, 0);
}

static int open_tcp(line *l)
{
    const int code = open_tcp_later(l);

    if (code != CODE_DONE)
        return code;
    /* A name that does not exist is a mistake of the user. A network that is not there yet is not:
     * the link waits for it. */
    if (mbm_tcp_connect(&l->tcp) == MBM_LINK_LOST && l->tcp.error == ENXIO)
        return cannot_open(&l->place, mbm_tcp_text(&l->tcp), "Check the name of the host");
    return CODE_DONE;
}

static int open_udp(line *l)
{
    return mbm_udp_open(&l->udp, l->place.host, l->place.service) == 0
               ? CODE_DONE
               : line_cannot_open(&l->place, l->udp.lookupError);
}

const char *line_load_tls(const place *p, mbm_tls_files *files, mbm_tls_options *into)
{
    const char *const paths[] = {p->cert, p->key, p->ca};
    int i = 0;

    if (mbm_tls_load(files, into, p->cert, p->key, p->ca) == 0)
        return NULL;
    while (mbm_tls_load(files, into, paths[i], paths[i], paths[i]) == 0 && i < 2)
        i++;
    return paths[i];
}

static int open_tls(line *l)
{
    const mbm_linkHooks hooks = {l, close_device, open_device, device_status};
    const mbm_port below = mbm_tcp_port(&l->tcp);
    mbm_tls_options tls = {0};
    const char *unreadable;
    int code;
    uint8_t status;

    unreadable = line_load_tls(&l->place, &l->files, &tls);
    if (unreadable)
        return report(CODE_WRONG, "%s: %s", unreadable, strerror(errno));
    status = mbm_tls_begin(&l->identity, &tls);
    mbm_tls_forgetKey(&l->files);
    if (status != 0)
        return report(CODE_WRONG, "%s: %s (Mbed TLS: -0x%x)", l->place.text, mbm_tls_text(status),
                      (unsigned)-l->identity.error);
    code = open_tcp(l);
    if (code == CODE_DONE)
        (void)mbm_tls_open(&l->tls, &l->identity, &below, *l->place.name ? l->place.name : NULL,
                           &hooks);
    return code;
}

/* Whether a loss is harmless, unless the line cannot be opened again: a device has closed a
 * connection that was idle, or over which it has answered. */
static int is_harmless(const line *l, uint8_t event)
{
    const mbm_counters *opened = &l->opened, *now = &l->counters;

    return event == MBM_LINK_EVENT_LOST && place_is_tcp(&l->place) &&
           (l->place.kind != PLACE_TLS || l->tls.status < MBM_TLS_TIMED_OUT) &&
           (now->replies != opened->replies || now->requests == opened->requests);
}

/* The connection to a device is made anew, since no byte came. This is reported if the device has
 * answered over this connection; the program reports a device that never answered. */
static void take_silence(line *l)
{
    if (l->counters.replies == l->opened.replies)
        return;
    if (l->is_logged && !l->is_replaced)
        report_log(REPORT_WARNING,
                   "%s: no byte came after %u requests in a row. The connection is made anew, now "
                   "and each time that this happens",
                   l->place.text, l->replace_after);
    l->is_replaced = 1;
}

/* Keeps the reason why the link was lost or not opened, since the next attempt clears it. A loss is
 * logged once, with its first reason and with each other one. */
static void take_link(void *context, uint8_t event, uint8_t status)
{
    line *l = (line *)context;
    const int is_quiet = is_harmless(l, event);
    char before[sizeof l->reason];

    /* The next request may open a line that was open until now. */
    if (event == MBM_LINK_EVENT_LOST)
        l->tried = micros() - REOPEN_MS * 1000u;
    if (event == MBM_LINK_EVENT_LOST && status == MBM_RESPONSE_TIMED_OUT) {
        take_silence(l);
        return;
    }
    if (event == MBM_LINK_EVENT_CONNECTED) {
        l->opened = l->counters;
        if (l->is_told)
            report_log(REPORT_INFO, "%s: the line is open again", l->place.text);
        l->is_told = 0;
        return;
    }
    l->failed++;
    snprintf(before, sizeof before, "%s", l->reason);
    if (l->place.kind == PLACE_TLS && l->tls.status == MBM_TLS_REFUSED_BY_PEER)
        snprintf(l->reason, sizeof l->reason, "%s: %s", mbm_tls_text(l->tls.status),
                 mbm_tls_alertText(l->tls.alert));
    else if (l->place.kind == PLACE_TLS && l->tls.status >= MBM_TLS_TIMED_OUT)
        snprintf(l->reason, sizeof l->reason, "%s", mbm_tls_text(l->tls.status));
    else if (place_is_tcp(&l->place) && l->tcp.error != 0)
        snprintf(l->reason, sizeof l->reason, "%s",
                 l->tcp.lookupError ? mbm_tcp_text(&l->tcp) : report_error_text(l->tcp.error));
    else if (place_is_serial(&l->place) && l->tty.error != 0)
        snprintf(l->reason, sizeof l->reason, "%s", terminal_error_text(&l->place, l->tty.error));
    else if (!*l->reason || status == MBM_CONNECT_TIMED_OUT)
        snprintf(l->reason, sizeof l->reason, "%s", mbm_status_text(status));
    if (is_quiet)
        return;
    if (l->is_logged && (!l->is_told || strcmp(before, l->reason) != 0))
        report_log(REPORT_WARNING, "%s: %s. The line is opened again each second", l->place.text,
                   l->reason);
    l->is_told = l->is_logged;
}

static void keep_open(line *l)
{
    const mbm_linkHooks device = {l, close_device, open_device, device_status};
    const mbm_linkHooks hooks = l->place.kind == PLACE_TLS ? mbm_tls_link(&l->tls) : device;

    if (l->place.kind == PLACE_UDP)
        return;
    l->tried = micros() - REOPEN_MS * 1000u;
    (void)mbm_link_begin(&l->kept, &l->client, &hooks);
    (void)mbm_link_setBackoff(&l->kept, MBM_BACKOFF_FIXED, REOPEN_MS, REOPEN_MS);
    (void)mbm_link_setCallback(&l->kept, take_link, l);
    (void)mbm_link_setCounters(&l->kept, &l->losses);
}

static mbm_port port_of(line *l)
{
    switch (l->place.kind) {
    case PLACE_UDP: return mbm_udp_port(&l->udp);
    case PLACE_TLS: return mbm_tls_port(&l->tls);
    case PLACE_TCP:
    case PLACE_RTU_OVER_TCP: return mbm_tcp_port(&l->tcp);
    default: return mbm_tty_port(&l->tty);
    }
}

static void begin_client(line *l)
{
    const mbm_port own = port_of(l);
    const mbm_port below = found_port_begin(&l->found, &own);
    const mbm_port port = trace_client(received_begin(&l->received, &below, l->place.framing),
                                       l->place.framing, l->place.text);

    switch (l->place.framing) {
    case MBM_FRAMING_RTU:
        (void)mbm_client_beginRtu(&l->client, &port, l->incoming, sizeof l->incoming);
        break;
    case MBM_FRAMING_ASCII:
        (void)mbm_client_beginAscii(&l->client, &port, l->incoming, sizeof l->incoming);
        break;
    case MBM_FRAMING_RTU_OVER_TCP:
        (void)mbm_client_beginRtuOverTcp(&l->client, &port, l->incoming, sizeof l->incoming);
        break;
    default:
        (void)mbm_client_beginTcp(&l->client, &port, l->incoming, sizeof l->incoming, l->outgoing,
                                  sizeof l->outgoing);
    }
    if (place_is_serial(&l->place)) {
        (void)mbm_client_setBaudRate(&l->client, l->place.tty.baud);
        (void)mbm_client_setEchoDiscard(&l->client, l->place.discards_echo);
    }
    (void)mbm_client_setCounters(&l->client, &l->counters);
}

void line_set(line *l, uint8_t in_flight, uint8_t replace_after)
{
    if (l->place.framing == MBM_FRAMING_TCP)
        (void)mbm_client_setInFlight(&l->client, in_flight);
    l->replace_after = replace_after;
    if (place_is_tcp(&l->place))
        (void)mbm_link_setReplaceAfter(&l->kept, replace_after);
}

void line_reach(line *l, const reach *what)
{
    const reach_line has = place_reach(&l->place, 1);

    l->place.reach = *what;
    (void)reach_fit(&l->place.reach, &has);
    l->received.accept = l->place.reach.accept;
    reach_set(&l->place.reach, &l->client, has.has_link ? &l->kept : NULL, &has,
              l->place.has_gap ? l->place.gapMs * 1000 : 0);
}

const char *line_add_reach(place *where, const reach *of_device, uint32_t in_flight,
                           const char **lost)
{
    const reach_line has = place_reach(where, in_flight);
    reach own = *of_device;

    *lost = reach_fit(&own, &has);
    reach_fill(&where->reach, &options.reach);
    reach_fill(&where->reach, &own);
    return reach_check(&where->reach, &has, "");
}

/* Checks what the name of the line and the options say together. Returns an exit code. */
static int check_reach(line *l)
{
    const reach_line has = place_reach(&l->place, options.in_flight);
    const char *wrong;

    reach_fill(&l->place.reach, &options.reach);
    wrong = reach_check(&l->place.reach, &has, "--");
    return wrong ? report(CODE_WRONG, "%s: %s", l->place.text, wrong) : CODE_DONE;
}

static int open_place(line *l, const place *where, int (*open_serial)(line *l),
                      int (*open_stream)(line *l))
{
    int code;

    memset(l, 0, sizeof *l);
    l->place = *where;
    code = check_reach(l);
    if (code != CODE_DONE)
        return code;
    code = place_is_serial(where)     ? open_serial(l)
           : where->kind == PLACE_UDP ? open_udp(l)
           : where->kind == PLACE_TLS ? open_tls(l)
                                      : open_stream(l);
    if (code != CODE_DONE) {
        line_close(l);
        return code;
    }
    begin_client(l);
    keep_open(l);
    line_set(l, options.in_flight, options.replace_after);
    line_reach(l, &l->place.reach);
    if (where->framing == MBM_FRAMING_TCP)
        report_set_in_flight(options.in_flight);
    return CODE_DONE;
}

int line_open(line *l, const place *where)
{
    return open_place(l, where, open_tty, open_tcp);
}

static int open_tty_later(line *l)
{
    return mbm_tty_openLater(&l->tty, l->place.path, &l->place.tty) == 0
               ? CODE_DONE
               : line_cannot_open(&l->place, 0);
}

int line_open_later(line *l, const place *where)
{
    return open_place(l, where, open_tty_later, open_tcp);
}

int line_begin(line *l, const place *where)
{
    const int code = open_place(l, where, open_tty_later, open_tcp_later);

    keep_reserve(l);
    return code;
}

int line_prepare(line *l)
{
    const uint8_t state = mbm_link_state(&l->kept);

    if (state != MBM_LINK_IS_DOWN)
        return 1;
    if (micros() - l->tried < REOPEN_MS * 1000u)
        return 0;
    /* The request waits for this attempt, and ends if it fails. */
    (void)mbm_link_reconnect(&l->kept);
    return 1;
}

void line_close(line *l)
{
    free_reserve(l);
    mbm_tls_close(&l->tls);
    mbm_tls_end(&l->identity);
    mbm_tcp_close(&l->tcp);
    mbm_udp_close(&l->udp);
    mbm_tty_close(&l->tty);
}

int line_connect(line *l)
{
    const char *advice = "";

    while (l->place.kind != PLACE_UDP && !report_stopped) {
        line_poll(l);
        if (mbm_link_state(&l->kept) == MBM_LINK_IS_UP)
            break;
        if (l->failed > 0) {
            if (l->place.kind == PLACE_TLS && l->tls.status >= MBM_TLS_TIMED_OUT)
                advice = "docs/security.md says what to look at";
            else if (l->place.kind == PLACE_TLS && l->tcp.error != ECONNREFUSED &&
                     l->tcp.error != ETIMEDOUT)
                advice = "The server may refuse the certificate: see docs/security.md";
            else if (place_is_tcp(&l->place))
                advice = "Check host and port, and that the device is on";
            return cannot_open(&l->place, line_reason(l), advice);
        }
        line_rest(l, 1000);
    }
    return CODE_DONE;
}

/* --- at work --- */

void line_poll(line *l)
{
    (void)mbm_client_poll(&l->client);
}

/* Sleeps until the terminal or the other descriptor has bytes. An idle line's bytes are noise, and
 * must not end each sleep. */
static void wait_tty(line *l, int fd, uint32_t micros)
{
    const int is_waiting = l->tty.isOpen && mbm_client_pending(&l->client) > 0;
    struct pollfd waits[2] = {{fd, POLLIN, 0}, {is_waiting ? l->tty.fd : -1, POLLIN, 0}};
    const struct timespec time = clock_timespec(micros);

    if (fd < 0)
        (void)mbm_tty_wait(&l->tty, micros);
    else
        (void)ppoll(waits, 2, &time, NULL);
}

void line_wait(line *l, int fd, uint32_t micros)
{
    /* At most a second, since a signal just before the sleep does not end it. */
    if (micros > 1000000)
        micros = 1000000;
    switch (l->place.kind) {
    case PLACE_UDP: (void)mbm_udp_wait(&l->udp, 1, fd, micros); break;
    case PLACE_TLS: (void)mbm_tls_wait(&l->tls, &l->tcp, 1, NULL, fd, micros); break;
    case PLACE_TCP:
    case PLACE_RTU_OVER_TCP: (void)mbm_tcp_wait(&l->tcp, 1, NULL, fd, micros); break;
    default: wait_tty(l, fd, micros);
    }
}

uint32_t line_delay(line *l)
{
    const uint32_t delay = mbm_client_pollDelay(&l->client);

    if (l->place.kind == PLACE_TLS && mbm_tls_pollDelay(&l->tls) < delay)
        return mbm_tls_pollDelay(&l->tls);
    return delay;
}

int line_polls(const line *l, struct pollfd *wait)
{
    if (l->place.kind == PLACE_UDP) {
        *wait = (struct pollfd){l->udp.fd, POLLIN, 0};
        return l->udp.port != 0 && !l->udp.isLost;
    }
    if (place_is_tcp(&l->place)) {
        *wait = (struct pollfd){l->tcp.fd, l->tcp.events, 0};
        return l->tcp.events != 0;
    }
    /* An idle line's bytes are noise. Without events only its loss ends the sleep. */
    *wait = (struct pollfd){l->tty.fd, mbm_client_pending(&l->client) > 0 ? POLLIN : 0, 0};
    return l->tty.isOpen;
}

void line_polled(line *l, const found_round *round, const struct pollfd *wait)
{
    /* TLS keeps bytes that the descriptor does not show. */
    if (l->place.kind != PLACE_TLS)
        found_port_note(&l->found, round, wait);
}

static int rest(void *context, uint32_t micros)
{
    line_wait((line *)context, -1, micros);
    return 0;
}

void line_rest(line *l, uint32_t milliseconds)
{
    uint32_t micros = mbm_client_pollDelay(&l->client);

    if (milliseconds > 1000)
        milliseconds = 1000;
    if (micros / 1000 >= milliseconds)
        micros = milliseconds * 1000;
    line_wait(l, -1, micros);
}

uint8_t line_call(line *l, mbm_clientRequest *request, uint8_t queued)
{
    const mbm_caller caller = {.client = &l->client,
                               .request = request,
                               .wait = rest,
                               .port = l,
                               .timeoutMs = MBM_CALL_FOREVER,
                               .stop = &report_stopped};

    const uint8_t status = mbm_call(&caller, queued);

    line_note(l, status);
    return status;
}

const char *line_reason(const line *l)
{
    if (l->place.kind == PLACE_UDP && l->udp.error != 0)
        return strerror(l->udp.error);
    return *l->reason ? l->reason : NULL;
}

void line_note(line *l, uint8_t status)
{
    const char *text = NULL;

    if (status == MBM_OK || status == MBM_CANCELLED)
        return;
    if (status == MBM_RESPONSE_TIMED_OUT ||
        (status == MBM_INVALID_SLAVE_ID && l->place.framing == MBM_FRAMING_TCP) ||
        ((status == MBM_MALFORMED_REPLY || status == MBM_INVALID_FUNCTION) &&
         received_is_echo(&l->received)))
        text = received_text(&l->received);
    snprintf(l->came, sizeof l->came, "%s", text ? text : "");
}

/* `done` of a request. */
static void on_end(void *context, mbm_clientRequest *request)
{
    line_note((line *)context, request->status);
}

const char *line_why(const line *l, uint8_t status)
{
    /* A datagram that its receiver refused is no loss of the link. */
    if (status == MBM_LINK_LOST || (l->place.kind == PLACE_UDP && l->udp.error != 0))
        return line_reason(l);
    return status != MBM_OK && status != MBM_CANCELLED && *l->came ? l->came : NULL;
}

const char *line_status(const line *l, const mbm_clientRequest *request, char text[256])
{
    const char *reason = line_why(l, request->status);

    snprintf(text, 256, "%s%s%s", report_words(request->status, request->exception),
             reason ? ": " : "", reason ? reason : "");
    return text;
}

int line_failure_of(line *l, const char *who, const mbm_clientRequest *request, int about)
{
    const uint8_t status = request->status, exception = request->exception;
    const char *why = line_why(l, status);

    return report_failure(who, status, exception, reach_timeout(&l->place.reach), why,
                          advice_on(&l->place, about, status, exception, why));
}

int line_failure(line *l, const mbm_clientRequest *request, int about)
{
    char who[24];

    snprintf(who, sizeof who, "unit %u", request->unit);
    return line_failure_of(l, who, request, about);
}

uint8_t line_read(line *l, mbm_clientRequest *request, uint8_t table, uint16_t address,
                  uint16_t quantity)
{
    request->done = on_end;
    request->context = l;
    switch (table) {
    case MBM_TABLE_COILS: return mbm_client_readCoils(&l->client, request, address, quantity);
    case MBM_TABLE_DISCRETE_INPUTS:
        return mbm_client_readDiscreteInputs(&l->client, request, address, quantity);
    case MBM_TABLE_INPUT_REGISTERS:
        return mbm_client_readInputRegisters(&l->client, request, address, quantity);
    default: return mbm_client_readHoldingRegisters(&l->client, request, address, quantity);
    }
}
