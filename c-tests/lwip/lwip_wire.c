#include "lwip_wire.h"

#include "lwip/init.h"
#include "lwip/ip.h"
#include "lwip/netif.h"
#include "lwip/priv/tcp_priv.h"
#include "lwip/sys.h"
#include "lwip/timeouts.h"
#include "test.h"

wire the_wire;

/* The packets that are under way, of at most 1500 bytes each. */
enum { PACKETS = 1024, BYTES = 1500, FLAGS = 13, RST = 4 };
static struct {
    uint16_t length;
    uint8_t bytes[BYTES];
} packets[PACKETS];
static uint32_t sent, delivered;

static struct netif netif;

/* Takes the place of that of the library. */
u32_t sys_now(void)
{
    return the_wire.ms;
}

static uint16_t length_of_ip(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] >> 4 == 6 ? 40 : 4 * (bytes[0] & 0xF));
}

/* `source` and `size`: where the first address is, and how long. */
static err_t send_swapped(struct pbuf *p, size_t source, size_t size)
{
    uint8_t *bytes = packets[sent % PACKETS].bytes, swapped[16];

    if (the_wire.isCut)
        return ERR_OK;
    assert_true(sent - delivered < PACKETS);
    packets[sent % PACKETS].length = pbuf_copy_partial(p, bytes, BYTES, 0);
    /* Of IPv6 lwIP sends other packets too. */
    if (bytes[size == 4 ? 9 : 6] != IP_PROTO_TCP)
        return ERR_OK;
    /* The checksums of IP and TCP stay right, since they are sums. */
    memcpy(swapped, bytes + source, size);
    memcpy(bytes + source, bytes + source + size, size);
    memcpy(bytes + source + size, swapped, size);
    sent++;
    return ERR_OK;
}

static err_t send_packet(struct netif *from, struct pbuf *p, const ip4_addr_t *target)
{
    return send_swapped(p, 12, 4);
}

#if LWIP_IPV6
static err_t send_packet6(struct netif *from, struct pbuf *p, const ip6_addr_t *target)
{
    return send_swapped(p, 8, 16);
}
#endif

static err_t begin_interface(struct netif *interface)
{
    interface->name[0] = 'w';
    interface->name[1] = 'i';
    interface->mtu = BYTES;
    interface->output = send_packet;
#if LWIP_IPV6
    interface->output_ip6 = send_packet6;
#endif
    return ERR_OK;
}

/* Returns a packet as a chain of pbufs, or NULL for lack of memory. The headers are in the first
 * one. */
static struct pbuf *chain_of(const uint8_t *bytes, uint16_t length)
{
    const uint16_t ip = length_of_ip(bytes);
    const uint16_t headers = (uint16_t)(ip + 4 * (bytes[ip + 12] >> 4));
    const uint16_t data = (uint16_t)(length - headers);
    uint16_t at = 0, part = length;
    struct pbuf *chain = NULL, *next;

    if (the_wire.first != 0 && the_wire.first < data)
        part = (uint16_t)(headers + the_wire.first);
    while (at < length) {
        /* Not of the pool: in Debian's 2.1.3 its pbufs have 592 bytes, and lwIP takes them for
         * 1536. */
        next = pbuf_alloc(PBUF_RAW, part, PBUF_RAM);
        if (next == NULL) {
            if (chain)
                pbuf_free(chain);
            return NULL;
        }
        assert_int_equal(pbuf_take(next, bytes + at, part), ERR_OK);
        if (chain)
            pbuf_cat(chain, next);
        else
            chain = next;
        at = (uint16_t)(at + part);
        part = (uint16_t)(length - at);
        if (the_wire.others != 0 && the_wire.others < part)
            part = the_wire.others;
    }
    return chain;
}

uint32_t wire_underWay(void)
{
    return sent - delivered;
}

void wire_deliver(void)
{
    while (delivered != sent) {
        const uint8_t *bytes = packets[delivered % PACKETS].bytes;
        const uint16_t length = packets[delivered % PACKETS].length;

        struct pbuf *p = chain_of(bytes, length);

        delivered++;
        /* As a driver does, it drops a packet for which there is no memory. */
        if (p == NULL)
            continue;
        the_wire.packets++;
        the_wire.resets += (bytes[length_of_ip(bytes) + FLAGS] & RST) != 0;
        assert_int_equal(netif.input(p, &netif), ERR_OK);
    }
}

void wire_pass(uint32_t ms, void (*each)(void))
{
    const uint32_t end = the_wire.ms + ms;

    do {
        the_wire.ms += end - the_wire.ms < 50 ? end - the_wire.ms : 50;
        sys_check_timeouts();
        wire_deliver();
        if (each)
            each();
        wire_deliver();
    } while (the_wire.ms != end);
}

void wire_begin(void)
{
    const uint32_t ms = the_wire.ms;
    static int has_begun;
    ip4_addr_t address, mask, gateway;
#if LWIP_IPV6
    ip_addr_t address6;
#endif

    memset(&the_wire, 0, sizeof the_wire);
    the_wire.ms = ms;
    sent = delivered = 0;
    IP_ADDR4(&the_wire.far, 10, 0, 0, 2);
#if LWIP_IPV6
    IP_ADDR6(&the_wire.far6, PP_HTONL(0xFD000000), 0, 0, PP_HTONL(2));
#endif
    if (has_begun)
        return;
    has_begun = 1;
    /* So that sums of times wrap within the test. */
    the_wire.ms = UINT32_MAX - 100000;
    lwip_init();
    IP4_ADDR(&address, 10, 0, 0, 1);
    IP4_ADDR(&mask, 255, 255, 255, 0);
    IP4_ADDR(&gateway, 0, 0, 0, 0);
    assert_non_null(netif_add(&netif, &address, &mask, &gateway, NULL, begin_interface, ip_input));
    netif_set_default(&netif);
    netif_set_up(&netif);
#if LWIP_IPV6
    IP_ADDR6(&address6, PP_HTONL(0xFD000000), 0, 0, PP_HTONL(1));
    netif_ip6_addr_set(&netif, 0, ip_2_ip6(&address6));
    netif_ip6_addr_set_state(&netif, 0, IP6_ADDR_PREFERRED);
#endif
    wire_plug();
}

void wire_end(void)
{
    the_wire.isCut = 0;
    wire_plug();
    wire_pass(1000, NULL);
    assert_null(tcp_listen_pcbs.listen_pcbs);
    while (tcp_active_pcbs)
        tcp_abort(tcp_active_pcbs);
    while (tcp_tw_pcbs)
        tcp_abort(tcp_tw_pcbs);
    wire_pass(1000, NULL);
}

void wire_unplug(void)
{
    netif_set_link_down(&netif);
}

void wire_plug(void)
{
    netif_set_link_up(&netif);
}

void wire_readdress(uint8_t last)
{
    ip4_addr_t address;

    IP4_ADDR(&address, 10, 0, 0, last);
    netif_set_ipaddr(&netif, &address);
}
