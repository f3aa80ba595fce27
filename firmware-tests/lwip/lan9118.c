#include "lan9118.h"

#include "lwip/etharp.h"
#include "lwip/pbuf.h"

#include <string.h>

#define REGISTER(offset) (*(volatile uint32_t *)(uintptr_t)(0x40200000u + (offset)))
#define RX_DATA REGISTER(0x00)
#define TX_DATA REGISTER(0x20)
#define RX_STATUS REGISTER(0x40)
#define TX_STATUS REGISTER(0x48)
#define IRQ_CFG REGISTER(0x54)
#define INT_STS REGISTER(0x58)
#define INT_EN REGISTER(0x5C)
#define FIFO_INT REGISTER(0x68)
#define TX_CFG REGISTER(0x70)
#define HW_CFG REGISTER(0x74)
#define RX_FIFO_INF REGISTER(0x7C)
#define TX_FIFO_INF REGISTER(0x80)
#define MAC_COMMAND REGISTER(0xA4)
#define MAC_DATA REGISTER(0xA8)

enum { IRQ_PUSH_PULL_HIGH = 0x111, RX_WAITS = 8, TX_ON = 2, TX_DROPS_STATUS = 4 };
enum { MAC_CR = 1, MAC_ADDRESS_HIGH = 2, MAC_ADDRESS_LOW = 3, MII_ACCESS = 6, MII_DATA = 7 };
enum { MAC_TX_RX = 0xC, PHY_STATUS = 1, PHY_LINK = 4, PHY_ADDRESS = 1, CRC_BYTES = 4 };
enum { FIRST_AND_LAST = 0x3000, RX_ERROR = 0x8000, LONGEST = 1536 };
#define MAC_BUSY 0x80000000u
#define MAC_READ 0x40000000u

volatile unsigned lan9118_lost;

static void mac_write(uint32_t number, uint32_t value)
{
    MAC_DATA = value;
    MAC_COMMAND = MAC_BUSY | number;
    while (MAC_COMMAND & MAC_BUSY) {
    }
}

static uint32_t mac_read(uint32_t number)
{
    MAC_COMMAND = MAC_BUSY | MAC_READ | number;
    while (MAC_COMMAND & MAC_BUSY) {
    }
    return MAC_DATA;
}

int lan9118_hasLink(void)
{
    /* The first read shows what was since the last one. */
    mac_write(MII_ACCESS, PHY_ADDRESS << 11 | PHY_STATUS << 6 | 1u);
    (void)mac_read(MII_DATA);
    mac_write(MII_ACCESS, PHY_ADDRESS << 11 | PHY_STATUS << 6 | 1u);
    return (mac_read(MII_DATA) & PHY_LINK) != 0;
}

void lan9118_interrupt(int on)
{
    INT_EN = on ? RX_WAITS : 0;
}

/* Called where lwIP runs, by one task at a time. */
static err_t send(struct netif *netif, struct pbuf *p)
{
    static uint32_t words[LONGEST / 4];
    uint32_t i;

    (void)netif;
    if (p->tot_len > sizeof words || (TX_FIFO_INF & 0xFFFFu) < p->tot_len + 8u)
        return ERR_MEM;
    (void)pbuf_copy_partial(p, words, p->tot_len, 0);
    TX_DATA = FIRST_AND_LAST | p->tot_len;
    TX_DATA = p->tot_len;
    for (i = 0; i < (p->tot_len + 3u) / 4u; i++)
        TX_DATA = words[i];
    while (TX_FIFO_INF & 0xFF0000u)
        (void)TX_STATUS;
    return ERR_OK;
}

int lan9118_receive(struct netif *netif)
{
    static uint32_t words[LONGEST / 4 + 1];
    uint32_t status, length, i;
    struct pbuf *p;

    INT_STS = RX_WAITS;
    if ((RX_FIFO_INF & 0xFF0000u) == 0)
        return 0;
    status = RX_STATUS;
    length = status >> 16 & 0x3FFFu;
    for (i = 0; i < (length + 3u) / 4u; i++) {
        const uint32_t word = RX_DATA;

        if (i < sizeof words / 4)
            words[i] = word;
    }
    p = status & RX_ERROR || length <= CRC_BYTES || length > sizeof words
            ? NULL
            : pbuf_alloc(PBUF_RAW, (u16_t)(length - CRC_BYTES), PBUF_POOL);
    if (p == NULL) {
        lan9118_lost++;
        return 1;
    }
    (void)pbuf_take(p, words, p->tot_len);
    if (netif->input(p, netif) != ERR_OK) {
        lan9118_lost++;
        (void)pbuf_free(p);
    }
    return 1;
}

err_t lan9118_init(struct netif *netif)
{
    static const uint8_t address[6] = {0x02, 0x6D, 0x62, 0x6D, 0x00, 0x01};

    memcpy(netif->hwaddr, address, sizeof address);
    netif->hwaddr_len = sizeof address;
    netif->mtu = 1500;
    netif->name[0] = 'e';
    netif->name[1] = 'n';
    netif->flags = NETIF_FLAG_BROADCAST | NETIF_FLAG_ETHARP | NETIF_FLAG_ETHERNET;
    netif->output = etharp_output;
    netif->linkoutput = send;
    mac_write(MAC_ADDRESS_LOW, 0x6D626D02u);
    mac_write(MAC_ADDRESS_HIGH, 0x0100u);
    mac_write(MAC_CR, MAC_TX_RX);
    HW_CFG = 0x00050000u; /* 5 kB of the FIFO for sending */
    TX_CFG = TX_ON | TX_DROPS_STATUS;
    FIFO_INT = 0x48000000u; /* an interrupt for each received frame */
    IRQ_CFG = IRQ_PUSH_PULL_HIGH;
    INT_STS = 0xFFFFFFFFu;
    return ERR_OK;
}
