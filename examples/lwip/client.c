/* Reads two holding registers of unit 1 at 192.168.0.7 once a second, over lwIP's raw API in a main
 * loop (NO_SYS). Connects again by itself. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm_lwip.h"

#include "lwip/sys.h"

enum { UNIT = 1, FIRST = 100, COUNT = 2, INTERVAL_MS = 1000 };

static mbm_lwip device = MBM_INIT;
static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[COUNT];
static mbm_clientRequest request = MBM_INIT;

static void changed(void *context, uint8_t event, uint8_t status)
{
    (void)context;
    (void)status;
    board_print(event == MBM_LINK_EVENT_CONNECTED ? "connected" : mbm_lwip_text(device.error));
    board_print("\n");
}

static void has_read(void *context, mbm_clientRequest *ended)
{
    int i;

    (void)context;
    if (ended->status != MBM_OK)
        board_print(mbm_status_textOf(ended->status, ended->exception));
    for (i = 0; i < COUNT && ended->status == MBM_OK; i++) {
        board_printNumber(words[i]);
        board_print(" ");
    }
    board_print("\n");
}

int main(void)
{
    const mbm_port port = mbm_lwip_port(&device);
    const mbm_linkHooks hooks = mbm_lwip_link(&device);
    ip_addr_t address;
    u32_t last;

    board_begin();
    IP_ADDR4(&address, 192, 168, 0, 7);
    /* The link connects later if the network is not there yet. */
    (void)mbm_lwip_open(&device, &address, MBM_LWIP_PORT);
    (void)mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    (void)mbm_link_begin(&kept, &client, &hooks);
    (void)mbm_link_setRequestsWait(&kept, 1);
    (void)mbm_link_setCallback(&kept, changed, 0);
    request.unit = UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
    request.done = has_read;
    last = sys_now() - INTERVAL_MS;
    for (;;) {
        board_poll();
        if (sys_now() - last >= INTERVAL_MS && request.status != MBM_PENDING) {
            last = sys_now();
            (void)mbm_client_readHoldingRegisters(&client, &request, FIRST, COUNT);
        }
        (void)mbm_client_poll(&client);
    }
}
