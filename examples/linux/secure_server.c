/* A server of Modbus/TCP Security whose clients may do what the role in their certificate allows.
 *
 *     secure_server PORT CERTIFICATE KEY AUTHORITIES     PORT 0 takes a free one; the files are PEM
 * or DER
 *
 * Unit 17 has holding registers 100 to 109. The role Viewer may read, Operator may write too.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tls_linux.h"

#include <stdio.h>
#include <string.h>

enum { PLACES = 8, WORDS = 10 };

static uint16_t words[WORDS] = {1000, 1001, 1002, 1003, 1004, 1005, 1006, 1007, 1008, 1009};
static mbm_tls_identity identity = MBM_INIT;
static mbm_tls_files files;
static mbm_tcp_listener listener = {.idleTimeMs = 60000};
static mbm_tcp tcps[PLACES] = MBM_INIT;
static mbm_tls tlss[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

/* Sees every request before the registers do. The connection is the context of its port.
 * Exception 01 is what the specification asks for. */
static uint16_t authorise(void *context, const mbm_request *request, uint8_t *response,
                          uint16_t capacity)
{
    const char *role = mbm_tls_role((const mbm_tls *)request->connection);
    const int is_read = request->function <= MBM_FC_READ_INPUT_REGISTERS;

    (void)context, (void)response, (void)capacity;
    if (role && (strcmp(role, "Operator") == 0 || (is_read && strcmp(role, "Viewer") == 0)))
        return MBM_REPLY_DECLINED;
    return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_FUNCTION;
}

static mbm_custom every_function = {.serve = authorise};
static mbm_registerTable holding = {.words = words, .base = 100, .size = WORDS};
static mbm_unit unit = {.id = 17};

/* Returns 0, or -1 after printing the reason. */
static int begin(char **argv)
{
    mbm_tls_options options = {.isServer = 1};
    uint8_t reason;

    if (mbm_tls_load(&files, &options, argv[2], argv[3], argv[4]) != 0)
        return perror(argv[2]), -1;
    reason = mbm_tls_begin(&identity, &options);
    mbm_tls_forgetKey(&files);
    if (reason != 0)
        return fprintf(stderr, "%s\n", mbm_tls_text(reason)), -1;
    /* The unit asks its records in the order of these calls. */
    mbm_unit_serveCustom(&unit, &every_function);
    mbm_unit_serveHoldingRegisters(&unit, &holding);
    return mbm_tls_listen(&listener, NULL, argv[1]) == 0 ? 0 : (perror(argv[1]), -1);
}

/* Serves a connection. Returns whether it takes part in a handshake. */
static int serve(int i)
{
    if (!mbm_tcp_isInUse(&tcps[i]))
        return 0;
    if (mbm_server_poll(&servers[i]) == MBM_OK)
        return tlss[i].status == MBM_TLS_HANDSHAKE;
    printf("connection %d: %s\n", i, mbm_tls_text(tlss[i].status));
    mbm_tls_close(&tlss[i]);
    mbm_tcp_close(&tcps[i]);
    return 0;
}

int main(int argc, char **argv)
{
    int i, j;

    if (argc != 5)
        return fprintf(stderr, "usage: secure_server PORT CERTIFICATE KEY AUTHORITIES\n"), 2;
    if (begin(argv) != 0)
        return 1;
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    printf("ready %u\n", listener.port);
    for (;;) {
        (void)mbm_tls_wait(tlss, tcps, PLACES, &listener, -1, MBM_TCP_FOREVER);
        i = mbm_tls_accept(&listener, &identity, tlss, tcps, PLACES); /* one in each round */
        if (i >= 0) {
            const mbm_port port = mbm_tls_port(&tlss[i]);

            (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME);
        }
        /* The open connections are served after each step of a handshake, which may take ms. */
        for (i = 0; i < PLACES; i++)
            for (j = serve(i) ? 0 : PLACES; j < PLACES; j++)
                if (tlss[j].status == MBM_TLS_OPEN)
                    (void)serve(j);
    }
}
