/* Modbus over UDP in one program: a server, and a client with retries. Licence: MIT OR
 * Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_udp.h"

#include <errno.h>
#include <netdb.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

enum { FIRST = 100, WORDS = 10, TIMEOUT_MS = 500, RETRIES = 9 };

static mbm_udp udp = MBM_INIT;
static uint16_t words[WORDS];
static volatile sig_atomic_t is_over;

static void finish(int number)
{
    (void)number;
    is_over = 1;
}

static int complain(const char *what)
{
    fprintf(stderr, "%s: %s\n", what,
            udp.lookupError ? gai_strerror(udp.lookupError) : strerror(errno));
    return 1;
}

static int serve(const char *service)
{
    static mbm_registerTable holding = {.words = words, .base = FIRST, .size = WORDS};
    static mbm_unit unit = {.id = 17};
    static mbm_server server = MBM_INIT;
    static uint8_t frame[MBM_MAX_TCP_FRAME];
    const mbm_port port = mbm_udp_port(&udp);
    int i;

    for (i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(1000 + i);
    if (mbm_udp_listen(&udp, NULL, service) != 0)
        return complain(service);
    if (mbm_unit_serveHoldingRegisters(&unit, &holding) != MBM_OK ||
        mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame) != MBM_OK)
        return 1;
    printf("ready %u\n", udp.port);
    fflush(stdout);
    while (!is_over && mbm_server_poll(&server) == MBM_OK)
        (void)mbm_udp_wait(&udp, 1, -1, mbm_server_pollDelay(&server));
    printf("%u datagrams dropped\n", (unsigned)udp.dropped);
    return !is_over;
}

static int ask(const char *host, const char *service)
{
    static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    static mbm_clientRequest request = {.unit = 17, .reply = words, .replyBytes = sizeof words};
    static mbm_client client = MBM_INIT;
    const mbm_port port = mbm_udp_port(&udp);
    int i;

    if (mbm_udp_open(&udp, host, service) != 0)
        return complain(host);
    (void)mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    (void)mbm_client_setResponseTimeout(&client, TIMEOUT_MS);
    (void)mbm_client_setRetries(&client, RETRIES);
    (void)mbm_client_readHoldingRegisters(&client, &request, FIRST, WORDS);
    while (mbm_client_poll(&client) == MBM_PENDING && !is_over)
        (void)mbm_udp_wait(&udp, 1, -1, mbm_client_pollDelay(&client));
    printf("%s\n", mbm_status_text(request.status));
    for (i = 0; i < WORDS && request.status == MBM_OK; i++)
        printf("register %d: %u\n", FIRST + i, words[i]);
    return request.status != MBM_OK;
}

int main(int argc, char **argv)
{
    struct sigaction action = {0};
    int code = 2;

    action.sa_handler = finish;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    if (argc == 3 && strcmp(argv[1], "serve") == 0)
        code = serve(argv[2]);
    else if (argc == 4 && strcmp(argv[1], "ask") == 0)
        code = ask(argv[2], argv[3]);
    else
        fprintf(stderr, "usage: udp serve PORT\n"
                        "       udp ask HOST PORT\n"
                        "  serve  serves registers 100 to 109 of unit 17; port 0 for a free one\n"
                        "  ask    reads them, and repeats a request up to 9 times\n");
    mbm_udp_close(&udp);
    return code;
}
