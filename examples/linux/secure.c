/* Modbus/TCP Security in one program: a server whose clients may do what their role allows,
 * and a client. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tls_linux.h"

#include <errno.h>
#include <netdb.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PLACES = 8, FIRST = 100, WORDS = 10, IDLE_MS = 60000 };

/* All storage is the program's own, but for what Mbed TLS allocates. */
static mbm_tls_identity identity = MBM_INIT;
static mbm_tls_files files;
static mbm_tcp_listener listener = {.idleTimeMs = IDLE_MS};
static mbm_tcp tcps[PLACES] = MBM_INIT;
static mbm_tls tlss[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static uint16_t words[WORDS];
static volatile sig_atomic_t is_over;

static void finish(int number)
{
    (void)number;
    is_over = 1;
}

static int begin_identity(char **paths, int is_server)
{
    mbm_tls_options options = {.isServer = (uint8_t)is_server};
    uint8_t reason;

    if (mbm_tls_load(&files, &options, paths[0], paths[1], paths[2]) != 0) {
        fprintf(stderr, "%s, %s, %s: %s\n", paths[0], paths[1], paths[2], strerror(errno));
        return -1;
    }
    reason = mbm_tls_begin(&identity, &options);
    mbm_tls_forgetKey(&files);
    if (reason != 0) {
        fprintf(stderr, "%s (Mbed TLS: -0x%x)\n", mbm_tls_text(reason), (unsigned)-identity.error);
        return -1;
    }
    return 0;
}

/* --- the server --- */

/* What each role may do. A client without a role may do nothing. */
static int is_allowed(const char *role, uint8_t function)
{
    if (role && strcmp(role, "Operator") == 0)
        return 1;
    return role && strcmp(role, "Viewer") == 0 && function >= MBM_FC_READ_COILS &&
           function <= MBM_FC_READ_INPUT_REGISTERS;
}

/* Sees every request before the registers do. The connection is the context of the port that
 * the request came from. Exception 01 is what the specification asks for. */
static uint16_t authorise(void *context, const mbm_request *request, uint8_t *response,
                          uint16_t capacity)
{
    (void)context;
    (void)response;
    (void)capacity;
    if (is_allowed(mbm_tls_role((const mbm_tls *)request->connection), request->function))
        return MBM_REPLY_DECLINED;
    return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_FUNCTION;
}

static mbm_custom every_function = {.serve = authorise};
static mbm_registerTable holding = {.words = words, .base = FIRST, .size = WORDS};
static mbm_unit unit = {.id = 17};

/* One in each round, so that the others are served between two. */
static void take_connection(void)
{
    const int i = mbm_tls_accept(&listener, &identity, tlss, tcps, PLACES);
    mbm_port port;

    if (i < 0)
        return;
    port = mbm_tls_port(&tlss[i]);
    (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME);
}

static void drop_connection(int i)
{
    printf("%d: %s\n", i, mbm_tls_text(tlss[i].status));
    mbm_tls_close(&tlss[i]);
    mbm_tcp_close(&tcps[i]);
}

static void poll_connection(int i)
{
    const uint8_t before = tlss[i].status, status = mbm_server_poll(&servers[i]);

    if (before == MBM_TLS_HANDSHAKE && tlss[i].status == MBM_TLS_OPEN) {
        const char *role = mbm_tls_role(&tlss[i]);

        printf("%d: open, role %s\n", i, role ? role : "(none)");
    }
    if (status != MBM_OK)
        drop_connection(i);
}

/* A step of a handshake may take milliseconds. After each, those whose handshake is over are
 * served, so that they wait for one step and no more. */
static void poll_all(void)
{
    int i, j;

    for (i = 0; i < PLACES; i++) {
        const uint8_t before = tlss[i].status;

        if (!mbm_tcp_isInUse(&tcps[i]))
            continue;
        poll_connection(i);
        for (j = 0; before == MBM_TLS_HANDSHAKE && j < PLACES; j++)
            if (mbm_tcp_isInUse(&tcps[j]) && tlss[j].status != MBM_TLS_HANDSHAKE)
                poll_connection(j);
    }
}

static int serve(const char *service, char **paths)
{
    int i;

    /* The order matters: the unit asks its records in the order of these calls. */
    if (mbm_unit_serveCustom(&unit, &every_function) != MBM_OK ||
        mbm_unit_serveHoldingRegisters(&unit, &holding) != MBM_OK || begin_identity(paths, 1) != 0)
        return 1;
    for (i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(1000 + i);
    if (mbm_tls_listen(&listener, NULL, service) != 0) {
        fprintf(stderr, "%s: %s\n", service,
                listener.lookupError ? gai_strerror(listener.lookupError) : strerror(errno));
        return 1;
    }
    printf("ready %u\n", listener.port);
    while (!is_over) {
        fflush(stdout);
        (void)mbm_tls_wait(tlss, tcps, PLACES, &listener, -1, MBM_TCP_FOREVER);
        take_connection();
        poll_all();
    }
    for (i = 0; i < PLACES; i++)
        if (mbm_tcp_isInUse(&tcps[i]))
            drop_connection(i);
    mbm_tcp_closeListener(&listener);
    return 0;
}

/* --- the client --- */

static mbm_client client = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static mbm_clientRequest request = {.unit = 17};

/* Polls until the request has ended, and prints its result. */
static int see_through(const char *what)
{
    while (mbm_client_poll(&client) == MBM_PENDING && !is_over)
        (void)mbm_tls_wait(tlss, tcps, 1, NULL, -1, mbm_client_pollDelay(&client));
    printf("%s: %s", what, mbm_status_text(request.status));
    if (tlss->status != MBM_TLS_OPEN)
        printf(": %s", mbm_tls_text(tlss->status));
    if (tlss->status == MBM_TLS_REFUSED_BY_PEER)
        printf(": %s", mbm_tls_alertText(tlss->alert));
    printf("\n");
    return request.status;
}

static int ask(const char *host, const char *service, const char *name, char **paths)
{
    static mbm_tcp_addresses addresses;
    static uint16_t value = 2000;
    const mbm_linkHooks link = mbm_tcp_link(tcps);
    const mbm_port socket = mbm_tcp_port(tcps), port = mbm_tls_port(tlss);
    int status, i;

    if (begin_identity(paths, 0) != 0)
        return 1;
    if (mbm_tcp_open(tcps, &addresses, host, service) != 0) {
        fprintf(stderr, "%s: %s\n", host, mbm_tcp_text(tcps));
        return 1;
    }
    (void)mbm_tls_open(tlss, &identity, &socket, *name ? name : NULL, &link);
    (void)mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    (void)mbm_client_setResponseTimeout(&client, 15000); /* with the handshake */
    request.reply = words;
    request.replyBytes = sizeof words;
    (void)mbm_client_readHoldingRegisters(&client, &request, FIRST, WORDS);
    status = see_through("read");
    for (i = 0; i < WORDS && status == MBM_OK; i++)
        printf("%s%u", i ? " " : "", words[i]);
    if (tlss->status == MBM_TLS_OPEN) {
        printf("%s", status == MBM_OK ? "\n" : "");
        request.data = &value;
        (void)mbm_client_writeMultipleRegisters(&client, &request, FIRST, 1);
        status |= see_through("write");
    }
    mbm_tls_close(tlss);
    mbm_tcp_close(tcps);
    return status != MBM_OK;
}

int main(int argc, char **argv)
{
    struct sigaction action = {0};
    int code = 2;

    action.sa_handler = finish;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    if (argc == 6 && strcmp(argv[1], "serve") == 0)
        code = serve(argv[2], argv + 3);
    else if (argc == 8 && strcmp(argv[1], "ask") == 0)
        code = ask(argv[2], argv[3], argv[4], argv + 5);
    else
        fprintf(stderr, "usage: secure serve PORT CERTIFICATE KEY AUTHORITIES\n"
                        "       secure ask HOST PORT NAME CERTIFICATE KEY AUTHORITIES\n"
                        "  serve  serves registers 100 to 109 of unit 17: role Viewer may read,\n"
                        "         role Operator may write too\n"
                        "  ask    reads them, and writes register 100\n"
                        "  NAME   that the server's certificate must have; \"\" for any\n"
                        "The files are PEM or DER. `make secure` shows both.\n");
    mbm_tls_end(&identity);
    return code;
}
