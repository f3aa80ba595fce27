#include "lwip_relay.h"

#include "lwip/ip.h"
#include "lwip/netif.h"
#include "lwip/tcp.h"
#include "lwip/tcpip.h"
#include "tcp_server.h"
#include "test.h"

#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <unistd.h>

ip_addr_t relay_loop;

/* A connection in lwIP and one of the machine. `pcb` is read and written with the lock of the core.
 */
typedef struct relay {
    struct tcp_pcb *pcb;
    int fd;
    sem_t connected;
} relay;

static atomic_uint open_relays;
static relay *newest;
static uint16_t machine_port_of_all;

/* --- from lwIP to the machine, in lwIP's thread */

static void reset_machine(relay *one)
{
    (void)tcp_resetAtClose(one->fd);
    /* Wakes the other thread, which closes it. */
    (void)shutdown(one->fd, SHUT_RD);
}

static err_t received(void *context, struct tcp_pcb *pcb, struct pbuf *p, err_t error)
{
    relay *one = context;
    const struct pbuf *part;

    if (p == NULL) {
        (void)shutdown(one->fd, SHUT_WR);
        return ERR_OK;
    }
    for (part = p; part; part = part->next)
        (void)!send(one->fd, part->payload, part->len, MSG_NOSIGNAL);
    tcp_recved(pcb, p->tot_len);
    pbuf_free(p);
    return ERR_OK;
}

static void failed(void *context, err_t error)
{
    relay *one = context;

    one->pcb = NULL;
    reset_machine(one);
    sem_post(&one->connected);
}

static err_t connected(void *context, struct tcp_pcb *pcb, err_t error)
{
    sem_post(&((relay *)context)->connected);
    return ERR_OK;
}

/* --- from the machine to lwIP */

static void send_all(relay *one, const uint8_t *bytes, uint16_t length)
{
    err_t error = ERR_MEM;

    while (error == ERR_MEM) {
        LOCK_TCPIP_CORE();
        error = one->pcb ? tcp_write(one->pcb, bytes, length, TCP_WRITE_FLAG_COPY) : ERR_CONN;
        if (one->pcb)
            tcp_output(one->pcb);
        UNLOCK_TCPIP_CORE();
        if (error == ERR_MEM)
            poll(NULL, 0, 1);
    }
}

static void *pump(void *context)
{
    relay *one = context;
    uint8_t bytes[1024];
    ssize_t count;

    sem_wait(&one->connected);
    while ((count = recv(one->fd, bytes, sizeof bytes, 0)) > 0)
        send_all(one, bytes, (uint16_t)count);
    LOCK_TCPIP_CORE();
    if (newest == one)
        newest = NULL;
    if (one->pcb) {
        tcp_arg(one->pcb, NULL);
        tcp_recv(one->pcb, NULL);
        tcp_err(one->pcb, NULL);
        if (count < 0 || tcp_close(one->pcb) != ERR_OK)
            tcp_abort(one->pcb);
    }
    UNLOCK_TCPIP_CORE();
    close(one->fd);
    sem_destroy(&one->connected);
    free(one);
    open_relays--;
    return NULL;
}

/* With the lock of the core. */
static relay *begin(int fd, struct tcp_pcb *pcb)
{
    relay *one = calloc(1, sizeof *one);
    pthread_t thread;

    assert_non_null(one);
    one->fd = fd;
    one->pcb = pcb;
    sem_init(&one->connected, 0, 0);
    tcp_arg(pcb, one);
    tcp_recv(pcb, received);
    tcp_err(pcb, failed);
    tcp_nagle_disable(pcb);
    newest = one;
    open_relays++;
    assert_int_equal(pthread_create(&thread, NULL, pump, one), 0);
    pthread_detach(thread);
    return one;
}

/* --- who begins */

typedef struct way {
    int listener;
    uint16_t lwip_port;
} way;

static void *accept_all(void *context)
{
    const way *from = context;
    int fd;

    while ((fd = accept(from->listener, NULL, NULL)) >= 0) {
        struct tcp_pcb *pcb;

        LOCK_TCPIP_CORE();
        pcb = tcp_new();
        assert_non_null(pcb);
        (void)begin(fd, pcb);
        assert_int_equal(tcp_connect(pcb, &relay_loop, from->lwip_port, connected), ERR_OK);
        UNLOCK_TCPIP_CORE();
    }
    return NULL;
}

uint16_t relay_toLwip(uint16_t lwip_port)
{
    static way ways[8];
    static int count;
    way *one = &ways[count++];
    pthread_t thread;
    uint16_t port;

    one->listener = tcp_listenOnFree(&port);
    one->lwip_port = lwip_port;
    assert_int_equal(pthread_create(&thread, NULL, accept_all, one), 0);
    pthread_detach(thread);
    return port;
}

static err_t accepted(void *context, struct tcp_pcb *pcb, err_t error)
{
    relay *one;

    if (pcb == NULL)
        return ERR_MEM;
    one = begin(tcp_connectTo(machine_port_of_all), pcb);
    sem_post(&one->connected);
    return ERR_OK;
}

void relay_toMachine(uint16_t lwip_port, uint16_t machine_port)
{
    struct tcp_pcb *pcb;

    machine_port_of_all = machine_port;
    LOCK_TCPIP_CORE();
    pcb = tcp_new();
    assert_non_null(pcb);
    assert_int_equal(tcp_bind(pcb, IP_ADDR_ANY, lwip_port), ERR_OK);
    pcb = tcp_listen_with_backlog(pcb, 8);
    assert_non_null(pcb);
    tcp_accept(pcb, accepted);
    UNLOCK_TCPIP_CORE();
}

void relay_reset(void)
{
    LOCK_TCPIP_CORE();
    if (newest && newest->pcb) {
        struct tcp_pcb *pcb = newest->pcb;

        /* Calls `failed`. */
        tcp_abort(pcb);
    }
    UNLOCK_TCPIP_CORE();
}

unsigned relay_count(void)
{
    return open_relays;
}

/* --- lwIP */

static err_t loop_back(struct netif *netif, struct pbuf *p, const ip4_addr_t *target)
{
    return netif_loop_output(netif, p);
}

static err_t begin_interface(struct netif *netif)
{
    netif->name[0] = 'l';
    netif->name[1] = 'o';
    netif->mtu = 1500;
    netif->output = loop_back;
    return ERR_OK;
}

static void has_begun(void *context)
{
    sem_post(context);
}

void relay_setNetwork(int is_up)
{
    struct netif *netif;

    LOCK_TCPIP_CORE();
    NETIF_FOREACH(netif)
    (is_up ? netif_set_up : netif_set_down)(netif);
    UNLOCK_TCPIP_CORE();
}

void relay_begin(void)
{
    static struct netif netif;
    static int has;
    ip4_addr_t address, mask, gateway;
    sem_t begun;

    if (has)
        return;
    has = 1;
    sem_init(&begun, 0, 0);
    tcpip_init(has_begun, &begun);
    sem_wait(&begun);
    IP_ADDR4(&relay_loop, 127, 0, 0, 1);
    IP4_ADDR(&address, 127, 0, 0, 1);
    IP4_ADDR(&mask, 255, 0, 0, 0);
    IP4_ADDR(&gateway, 0, 0, 0, 0);
    LOCK_TCPIP_CORE();
    assert_non_null(
        netif_add(&netif, &address, &mask, &gateway, NULL, begin_interface, tcpip_input));
    netif_set_link_up(&netif);
    netif_set_up(&netif);
    UNLOCK_TCPIP_CORE();
}
