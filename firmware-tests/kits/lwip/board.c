/* The board of examples/lwip for linking alone: an Ethernet interface whose driver is two
 * registers. Licence: MIT OR Apache-2.0. */
#include "board.h"

#include "lwip/etharp.h"
#include "lwip/init.h"
#include "lwip/netif.h"
#include "lwip/sys.h"
#include "lwip/timeouts.h"
#include "netif/ethernet.h"

static volatile uint32_t REGISTERS[4];

static struct netif interface;

u32_t sys_now(void)
{
    return REGISTERS[0];
}

static err_t send_frame(struct netif *netif, struct pbuf *p)
{
    (void)netif;
    for (; p != NULL; p = p->next)
        REGISTERS[1] = p->len;
    return ERR_OK;
}

static err_t begin_interface(struct netif *netif)
{
    netif->mtu = 1500;
    netif->hwaddr_len = ETH_HWADDR_LEN;
    netif->flags = NETIF_FLAG_BROADCAST | NETIF_FLAG_ETHARP | NETIF_FLAG_LINK_UP;
    netif->output = etharp_output;
    netif->linkoutput = send_frame;
    return ERR_OK;
}

void board_begin(void)
{
    ip4_addr_t address, mask, gateway;

    lwip_init();
    IP4_ADDR(&address, 192, 168, 0, 2);
    IP4_ADDR(&mask, 255, 255, 255, 0);
    IP4_ADDR(&gateway, 192, 168, 0, 1);
    (void)netif_add(&interface, &address, &mask, &gateway, NULL, begin_interface, ethernet_input);
    netif_set_default(&interface);
    netif_set_up(&interface);
}

void board_poll(void)
{
    struct pbuf *p = NULL;

    if (REGISTERS[2] != 0)
        p = pbuf_alloc(PBUF_RAW, (u16_t)REGISTERS[2], PBUF_POOL);
    if (p != NULL && interface.input(p, &interface) != ERR_OK)
        (void)pbuf_free(p);
    sys_check_timeouts();
}

void board_print(const char *text)
{
    while (*text)
        REGISTERS[3] = (uint8_t)*text++;
}

void board_printNumber(unsigned long number)
{
    REGISTERS[3] = (uint32_t)number;
}
