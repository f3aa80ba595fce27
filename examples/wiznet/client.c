/* Reads two holding registers of unit 1 at 192.168.0.7 once a second, through socket 7 of a W5500
 * with WIZnet's ioLibrary. Connects again by itself. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm_wiznet.h"

enum { UNIT = 1, FIRST = 100, COUNT = 2, INTERVAL_US = 1000000 };

static mbm_wiznet device = {.number = 7, .address = {192, 168, 0, 7}, .micros = board_micros};
static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[COUNT];
static mbm_clientRequest request = MBM_INIT;

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
    const mbm_port port = mbm_wiznet_port(&device);
    const mbm_linkHooks hooks = mbm_wiznet_link(&device);
    uint32_t last;

    board_begin();
    (void)mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    (void)mbm_link_begin(&kept, &client, &hooks);
    request.unit = UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
    request.done = has_read;
    last = board_micros(0) - INTERVAL_US;
    for (;;) {
        if (board_micros(0) - last >= INTERVAL_US && request.status != MBM_PENDING) {
            last = board_micros(0);
            (void)mbm_client_readHoldingRegisters(&client, &request, FIRST, COUNT);
        }
        (void)mbm_client_poll(&client);
    }
}
