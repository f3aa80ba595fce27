/* Reads two holding registers of unit 1 once a second, over lwIP's sockets in a task of its own.
 * Connects again by itself. Licence: MIT OR Apache-2.0. */
#include "sockets.h"

#include "mbm_tcp.h"

#include "lwip/sys.h"

enum { UNIT = 1, FIRST = 0, COUNT = 2, INTERVAL_MS = 1000 };

static mbm_tcp tcp = MBM_INIT;
static mbm_tcp_addresses addresses;
static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static mbm_clientRequest request = MBM_INIT;
static uint16_t words[COUNT];

/* Called by mbm_client_poll when a read has ended. */
static void has_read(void *context, mbm_clientRequest *ended)
{
    device *of = context;

    if (ended->status == MBM_OK) {
        of->words[0] = words[0];
        of->words[1] = words[1];
    }
    of->status = ended->status;
    of->reads++;
}

static int begin(device *of)
{
    const mbm_port port = mbm_tcp_port(&tcp);
    const mbm_linkHooks hooks = mbm_tcp_link(&tcp);

    if (mbm_tcp_openLater(&tcp, &addresses, of->host, of->service) != 0)
        return -1; /* too long a name */
    (void)mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    (void)mbm_link_begin(&kept, &client, &hooks);
    (void)mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 500, 5000); /* milliseconds */
    request.unit = UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
    request.done = has_read;
    request.context = of;
    return 0;
}

void read_sockets(void *of_device)
{
    uint32_t last = sys_now() - INTERVAL_MS, sleep, left;

    if (begin(of_device) != 0)
        sys_msleep(UINT32_MAX);
    for (;;) {
        left = sys_now() - last;
        left = left < INTERVAL_MS ? INTERVAL_MS - left : 0;
        if (left == 0 && request.status != MBM_PENDING) {
            last = sys_now();
            (void)mbm_client_readHoldingRegisters(&client, &request, FIRST, COUNT);
            left = INTERVAL_MS;
        }
        (void)mbm_client_poll(&client);
        sleep = mbm_client_pollDelay(&client);
        if (request.status != MBM_PENDING && left * 1000u < sleep)
            sleep = left * 1000u;
        (void)mbm_tcp_wait(&tcp, 1, NULL, -1, sleep);
    }
}
