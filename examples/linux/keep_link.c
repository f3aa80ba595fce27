/* Shows a client whose link opens itself again. It needs no device: the server is in this
 * program too, with Modbus TCP on the loopback between them.
 *
 *     keep_link
 *
 * The client reads a register every 300 ms, for four seconds. After one second the server
 * closes the connection, while the client is idle. After two seconds it goes away for one
 * second. The program prints what it reads and what happens to the link, and ends once
 * the client got over both.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

/* In milliseconds. */
enum { INTERVAL = 300, SOON = 10 };
static const uint32_t times[] = {1000, 2000, 3000, 4000};

enum { UNIT = 1 };

/* Both ends of the connection, in one array for mbm_tcp_wait. */
static mbm_tcp ends[2] = MBM_INIT;
static mbm_tcp *const client_end = &ends[0], *const server_end = &ends[1];

static uint32_t milliseconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000u + (uint32_t)now.tv_nsec / 1000000u;
}

static uint32_t began;

static uint32_t time_now(void)
{
    return milliseconds() - began;
}

static void print(const char *what, const char *detail)
{
    const uint32_t now = time_now();

    printf("%u.%u s  %s%s\n", (unsigned)(now / 1000), (unsigned)(now / 100 % 10), what, detail);
}

/* --- the server --- */

static mbm_tcp_listener listener = MBM_INIT;
static mbm_server server = MBM_INIT;
static mbm_unit unit = MBM_INIT;
static mbm_registerTable table = MBM_INIT;
static uint16_t registers[1];
static uint8_t frame[MBM_MAX_TCP_FRAME];
static char service[8] = "0";

/* Returns 0 if the server listens, at the same port each time. */
static int come(void)
{
    if (mbm_tcp_listen(&listener, "127.0.0.1", service) != 0)
        return -1;
    snprintf(service, sizeof service, "%u", listener.port);
    return 0;
}

static void hang_up(void)
{
    if (mbm_tcp_isInUse(server_end))
        mbm_tcp_close(server_end);
}

static void serve(void)
{
    mbm_port port;

    if (listener.port != 0 && mbm_tcp_accept(&listener, server_end, 1) == 0) {
        port = mbm_tcp_port(server_end);
        (void)mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame);
    }
    registers[0] = (uint16_t)time_now();
    if (mbm_tcp_isInUse(server_end) && mbm_server_poll(&server) == MBM_LINK_LOST)
        mbm_tcp_close(server_end);
}

/* --- the client --- */

static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static mbm_linkCounters counters = MBM_INIT;
static mbm_clientRequest request = MBM_INIT;
static mbm_tcp_addresses addresses;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t word;
static unsigned answered;

static void changed(void *context, uint8_t event, uint8_t status)
{
    (void)context;
    (void)status;
    switch (event) {
    case MBM_LINK_EVENT_CONNECTED: print("link: connected", ""); break;
    case MBM_LINK_EVENT_LOST: print("link: lost: ", mbm_tcp_text(client_end)); break;
    default: print("link: not connected: ", mbm_tcp_text(client_end)); break;
    }
}

static void is_read(void *context, mbm_clientRequest *ended)
{
    char text[16];

    (void)context;
    answered += ended->status == MBM_OK;
    snprintf(text, sizeof text, "%u", word);
    print("register 0: ", ended->status == MBM_OK ? text : mbm_status_text(ended->status));
}

static int begin(void)
{
    mbm_linkHooks hooks;
    mbm_port port;

    unit.id = UNIT;
    table.words = registers;
    table.size = 1;
    if (mbm_unit_serveHoldingRegisters(&unit, &table) != MBM_OK || come() != 0 ||
        mbm_tcp_openLater(client_end, &addresses, "127.0.0.1", service) != 0)
        return -1;
    port = mbm_tcp_port(client_end);
    hooks = mbm_tcp_link(client_end);
    mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    mbm_link_begin(&kept, &client, &hooks);
    mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 100, 1000);
    mbm_link_setRequestsWait(&kept, 1);
    mbm_link_setCallback(&kept, changed, NULL);
    mbm_link_setCounters(&kept, &counters);
    request.unit = UNIT;
    request.reply = &word;
    request.replyBytes = sizeof word;
    request.done = is_read;
    return 0;
}

/* --- what happens --- */

/* What happens to the server, at its time, but not before the client got over what was before. */
static int act(unsigned *next)
{
    switch (time_now() >= times[*next] ? *next : 3) {
    case 0:
        print("server: closes the connection", "");
        hang_up();
        break;
    case 1:
        if (counters.connected < 2)
            return 0;
        print("server: goes away", "");
        mbm_tcp_closeListener(&listener);
        hang_up();
        break;
    case 2:
        if (counters.failed < 1)
            return 0;
        print("server: is back", "");
        if (come() != 0)
            return -1;
        break;
    default: return 0;
    }
    (*next)++;
    return 0;
}

int main(void)
{
    uint32_t due = 0, delay;
    unsigned next = 0;

    began = milliseconds();
    if (begin() != 0) {
        perror("keep_link");
        return 1;
    }
    while (next < 3 || counters.connected < 3 || time_now() < times[3]) {
        if (act(&next) != 0) {
            perror("keep_link");
            return 1;
        }
        if (time_now() >= due && request.status != MBM_PENDING) {
            (void)mbm_client_readHoldingRegisters(&client, &request, 0, 1);
            due = time_now() + INTERVAL;
        }
        serve();
        (void)mbm_client_poll(&client);
        /* Not for long, so that the server acts at its times. */
        delay = mbm_client_pollDelay(&client);
        mbm_tcp_wait(ends, 2, &listener, -1, delay < SOON * 1000 ? delay : SOON * 1000);
    }
    printf("%u replies; connected %u times, lost %u times, %u attempts failed\n", answered,
           (unsigned)counters.connected, (unsigned)counters.lost, (unsigned)counters.failed);
    mbm_tcp_close(client_end);
    hang_up();
    return answered > 0 ? 0 : 1;
}
