/* Reads a register every 300 ms over Modbus TCP, and opens the connection again when it is lost.
 *
 *     keep_link HOST PORT
 *
 * Prints what it reads and what happens to the connection. The server need not be there at first.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tcp.h"

#include <stdio.h>

enum { UNIT = 1, INTERVAL_US = 300000 };

static mbm_tcp tcp = MBM_INIT;
static mbm_tcp_addresses addresses;
static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t word;
static mbm_clientRequest request = {.unit = UNIT, .reply = &word, .replyBytes = sizeof word};

static void changed(void *context, uint8_t event, uint8_t status)
{
    (void)context;
    (void)status;
    switch (event) {
    case MBM_LINK_EVENT_CONNECTED: printf("link: connected\n"); break;
    case MBM_LINK_EVENT_LOST: printf("link: lost: %s\n", mbm_tcp_text(&tcp)); break;
    default: printf("link: not connected: %s\n", mbm_tcp_text(&tcp)); break;
    }
}

static void is_read(void *context, mbm_clientRequest *ended)
{
    (void)context;
    if (ended->status == MBM_OK)
        printf("register 0: %u\n", word);
    else
        printf("register 0: %s\n", mbm_status_textOf(ended->status, ended->exception));
}

int main(int argc, char **argv)
{
    const mbm_port port = mbm_tcp_port(&tcp);
    const mbm_linkHooks hooks = mbm_tcp_link(&tcp);
    uint32_t due = port.micros(port.context), left;

    if (argc != 3 || mbm_tcp_openLater(&tcp, &addresses, argv[1], argv[2]) != 0) {
        fprintf(stderr, "usage: keep_link HOST PORT\n");
        return 2;
    }
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    mbm_link_begin(&kept, &client, &hooks);
    mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 100, 1000); /* milliseconds */
    mbm_link_setRequestsWait(&kept, 1);
    mbm_link_setCallback(&kept, changed, NULL);
    request.done = is_read;
    for (;;) {
        left = due - port.micros(port.context);
        if (left > INTERVAL_US) { /* the time is over */
            if (request.status != MBM_PENDING)
                (void)mbm_client_readHoldingRegisters(&client, &request, 0, 1);
            due += INTERVAL_US;
            left = INTERVAL_US;
        }
        (void)mbm_client_poll(&client);
        if (mbm_client_pollDelay(&client) < left)
            left = mbm_client_pollDelay(&client);
        mbm_tcp_wait(&tcp, 1, NULL, -1, left);
    }
}
