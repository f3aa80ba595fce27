/* The connection of mbm_lwip.h: lwIP's callbacks, and the hooks of the port. Licence: MIT OR
 * Apache-2.0. */
#include "mbm_lwip.h"

#include "lwip/ip.h"
#include "lwip/pbuf.h"
#include "lwip/sys.h"
#include "lwip/tcp.h"

#include <string.h>

/* A silent peer is asked after this time, and again, before it counts as gone. */
enum { IDLE_MS = 15000, PROBE_INTERVAL_MS = 5000, PROBE_COUNT = 3 };

/* The most bytes that one read or write moves, since its result is an int16_t. */
enum { MOST = 0x7FFF };

/* The most received bytes that are copied to lwIP's heap: several requests. */
enum { MOST_JOINED = 1024 };

/* --- the end of a connection */

static void free_received(mbm_lwip *link)
{
    if (link->received != NULL)
        (void)pbuf_free(link->received);
    link->received = NULL;
    link->taken = 0;
}

/* Gives a control block back to lwIP. `isHard`: what was not acknowledged is given up. */
static void give_back(mbm_lwip *link, struct tcp_pcb *pcb, uint8_t isHard)
{
    tcp_arg(pcb, NULL);
    tcp_recv(pcb, NULL);
    tcp_sent(pcb, NULL);
    tcp_err(pcb, NULL);
    tcp_poll(pcb, NULL, 0);
    /* lwIP may have to send the rest to a peer that is gone. A new connection that finds no memory
     * then takes that of this one. */
    tcp_setprio(pcb, TCP_PRIO_MIN);
    if (!(isHard && tcp_sndqueuelen(pcb) != 0) && tcp_close(pcb) == ERR_OK)
        return;
    tcp_abort(pcb);
    /* The callback that runs for it must say so to lwIP. */
    if (link->calling == pcb)
        link->calling = NULL;
}

void mbm_lwip_leave(mbm_lwip *link, uint8_t state, err_t error, uint8_t isHard)
{
    struct tcp_pcb *pcb = link->pcb;

    link->pcb = NULL;
    link->state = state;
    link->error = error;
    link->flags &= MBM_LWIP_HAS_SERVER;
    free_received(link);
    if (pcb != NULL)
        give_back(link, pcb, isHard);
}

/* Ends a connection that was not handed over. The program does not know of it, but perhaps of the
 * one before it. */
void mbm_lwip_reset(mbm_lwip *link, err_t error)
{
    if (link->flags & MBM_LWIP_IS_SUCCESSOR)
        mbm_lwip_leave(link, MBM_LWIP_LOST, link->error, 1);
    else
        mbm_lwip_leave(link, MBM_LWIP_FREE, error, 1);
}

/* --- lwIP's callbacks */

/* Tells the program. Returns what the callback returns to lwIP. */
static err_t report(mbm_lwip *link, struct tcp_pcb *pcb)
{
    err_t result = ERR_OK;

    if (link->ready != NULL) {
        link->calling = pcb;
        link->ready(link->context);
        if (link->calling == NULL)
            result = ERR_ABRT;
        link->calling = NULL;
    }
    return result;
}

/* Returns whether there is place for more bytes. Joins many small segments, so that their pbufs are
 * free. */
static uint8_t make_place_for(mbm_lwip *link, const struct pbuf *more)
{
    const struct pbuf *held = link->received;

    if ((u32_t)held->tot_len + more->tot_len > 0xFFFF)
        return 0;
    if (pbuf_clen(held) + pbuf_clen(more) > MBM_LWIP_PBUFS && held->tot_len <= MOST_JOINED)
        held = link->received = pbuf_coalesce(link->received, PBUF_RAW);
    return pbuf_clen(held) + pbuf_clen(more) <= MBM_LWIP_PBUFS;
}

static err_t on_received(void *context, struct tcp_pcb *pcb, struct pbuf *p, err_t error)
{
    mbm_lwip *link = context;

    (void)error;
    if (p == NULL)
        link->flags |= MBM_LWIP_IS_ENDED;
    else if (link->received == NULL)
        link->received = p;
    else if (make_place_for(link, p))
        pbuf_cat(link->received, p);
    else
        return ERR_MEM; /* lwIP keeps it, tries again, and drops what comes after it */
    return report(link, pcb);
}

static err_t on_sent(void *context, struct tcp_pcb *pcb, u16_t length)
{
    mbm_lwip *link = context;

    (void)length;
    link->progressMs = sys_now();
    return link->flags & MBM_LWIP_WAITS ? report(link, pcb) : ERR_OK;
}

static err_t on_connected(void *context, struct tcp_pcb *pcb, err_t error)
{
    mbm_lwip *link = context;

    (void)error;
    link->state = MBM_LWIP_CONNECTED;
    link->error = ERR_OK;
    return report(link, pcb);
}

/* lwIP has freed the control block. What was received before can still be read. */
static void on_error(void *context, err_t error)
{
    mbm_lwip *link = context;
    const uint8_t isNew = link->flags & MBM_LWIP_IS_NEW;

    link->pcb = NULL;
    if (isNew) {
        mbm_lwip_reset(link, error);
    } else {
        if (link->state == MBM_LWIP_CONNECTING && error == ERR_ABRT)
            error = ERR_TIMEOUT;
        link->state = MBM_LWIP_LOST;
        link->error = error;
    }
    (void)report(link, NULL);
}

static uint8_t has_route(const struct tcp_pcb *pcb)
{
    return ip_route(&pcb->local_ip, &pcb->remote_ip) != NULL;
}

/* Called twice a second. lwIP itself tries to send again after that. */
static err_t on_poll(void *context, struct tcp_pcb *pcb)
{
    mbm_lwip *link = context;
    err_t lost = ERR_OK;

    if (link->state == MBM_LWIP_CONNECTED && tcp_sndqueuelen(pcb) != 0) {
        if (link->flags & MBM_LWIP_HAS_SERVER && !has_route(pcb))
            lost = ERR_RTE;
        else if (sys_now() - link->progressMs > MBM_LWIP_UNACKNOWLEDGED_MS)
            lost = ERR_ABRT;
    }
    if (lost != ERR_OK) {
        tcp_err(pcb, NULL);
        tcp_abort(pcb);
        on_error(link, lost);
        return ERR_ABRT;
    }
    return link->flags & MBM_LWIP_WAITS ? report(link, pcb) : ERR_OK;
}

/* --- the beginning of a connection */

void mbm_lwip_adopt(mbm_lwip *link, struct tcp_pcb *pcb, uint8_t state)
{
    link->pcb = pcb;
    link->state = state;
    link->error = state == MBM_LWIP_CONNECTED ? ERR_OK : ERR_INPROGRESS;
    link->activeMs = link->progressMs = sys_now();
    tcp_arg(pcb, link);
    tcp_recv(pcb, on_received);
    tcp_sent(pcb, on_sent);
    tcp_err(pcb, on_error);
    tcp_poll(pcb, on_poll, 1);
    tcp_nagle_disable(pcb);
    ip_set_option(pcb, SOF_KEEPALIVE);
    pcb->keep_idle = IDLE_MS;
#if LWIP_TCP_KEEPALIVE
    pcb->keep_intvl = PROBE_INTERVAL_MS;
    pcb->keep_cnt = PROBE_COUNT;
#endif
}

static uint8_t begin_to_connect(mbm_lwip *link)
{
    struct tcp_pcb *pcb;
    err_t error;

    if (!(link->flags & MBM_LWIP_HAS_SERVER))
        return MBM_LINK_LOST;
    mbm_lwip_leave(link, MBM_LWIP_LOST, ERR_MEM, 1);
    pcb = tcp_new_ip_type(IP_GET_TYPE(&link->address));
    if (pcb == NULL)
        return MBM_LINK_LOST;
    mbm_lwip_adopt(link, pcb, MBM_LWIP_CONNECTING);
    error = tcp_connect(pcb, &link->address, link->port, on_connected);
    if (error == ERR_OK)
        return MBM_PENDING;
    mbm_lwip_leave(link, MBM_LWIP_LOST, error, 0);
    return MBM_LINK_LOST;
}

uint8_t mbm_lwip_connect(void *context)
{
    mbm_lwip *link = context;
    uint8_t status;

    if (link == NULL)
        return MBM_INVALID_ARGUMENT;
    MBM_LWIP_TAKE(link);
    status = begin_to_connect(link);
    MBM_LWIP_GIVE(link);
    return status;
}

uint8_t mbm_lwip_open(mbm_lwip *link, const ip_addr_t *address, uint16_t port)
{
    uint8_t status = MBM_BUSY;

    if (link == NULL || address == NULL || ip_addr_isany(address) || port == 0 ||
        (link->isTask && !MBM_LWIP_CAN_LOCK))
        return MBM_INVALID_ARGUMENT;
    MBM_LWIP_TAKE(link);
    if (link->state == MBM_LWIP_FREE) {
        ip_addr_copy(link->address, *address);
        link->port = port;
        link->flags = MBM_LWIP_HAS_SERVER;
        status = begin_to_connect(link);
    }
    MBM_LWIP_GIVE(link);
    return status;
}

/* --- what the program asks for */

int mbm_lwip_isInUse(const mbm_lwip *link)
{
    const uint8_t newAlone = MBM_LWIP_IS_NEW;
    int isInUse = 0;

    if (link != NULL) {
        MBM_LWIP_TAKE(link);
        isInUse = link->state != MBM_LWIP_FREE &&
                  (link->flags & (MBM_LWIP_IS_NEW | MBM_LWIP_IS_SUCCESSOR)) != newAlone;
        MBM_LWIP_GIVE(link);
    }
    return isInUse;
}

void mbm_lwip_close(mbm_lwip *link)
{
    if (link == NULL)
        return;
    MBM_LWIP_TAKE(link);
    if (link->flags & MBM_LWIP_IS_SUCCESSOR) {
        link->flags &= (uint8_t)~MBM_LWIP_IS_SUCCESSOR;
        link->error = ERR_OK;
        link->isBusy = 0;
        /* The task must wake for mbm_lwip_accept. */
        if (link->isTask && link->ready != NULL)
            link->ready(link->context);
    } else if (!(link->flags & MBM_LWIP_IS_NEW) && link->state != MBM_LWIP_FREE) {
        link->flags = 0;
        link->isBusy = 0;
        mbm_lwip_leave(link, MBM_LWIP_FREE, link->error, 0);
    }
    MBM_LWIP_GIVE(link);
}

void mbm_lwip_disconnect(void *context)
{
    mbm_lwip *link = context;

    if (link == NULL)
        return;
    MBM_LWIP_TAKE(link);
    if (!(link->flags & MBM_LWIP_IS_NEW)) {
        if (link->state == MBM_LWIP_CONNECTING)
            mbm_lwip_leave(link, MBM_LWIP_LOST, ERR_TIMEOUT, 0);
        else if (link->state == MBM_LWIP_CONNECTED)
            mbm_lwip_leave(link, MBM_LWIP_LOST, ERR_CONN, 1);
    }
    MBM_LWIP_GIVE(link);
}

/* Returns whether the link is lost, and all that came over it was read. Ends a connection that its
 * peer has closed. */
static uint8_t notice_loss(mbm_lwip *link)
{
    if (link->flags & MBM_LWIP_IS_SUCCESSOR)
        return 1;
    if (link->flags & MBM_LWIP_IS_NEW || link->received != NULL)
        return 0;
    if (link->flags & MBM_LWIP_IS_ENDED && link->pcb != NULL)
        mbm_lwip_leave(link, MBM_LWIP_LOST, ERR_CLSD, 0);
    return link->pcb == NULL;
}

uint8_t mbm_lwip_status(void *context)
{
    mbm_lwip *link = context;
    uint8_t status = MBM_OK;

    if (link == NULL)
        return MBM_INVALID_ARGUMENT;
    MBM_LWIP_TAKE(link);
    if (notice_loss(link))
        status = link->error == ERR_TIMEOUT ? MBM_CONNECT_TIMED_OUT : MBM_LINK_LOST;
    else if (link->state == MBM_LWIP_CONNECTING)
        status = MBM_PENDING;
    MBM_LWIP_GIVE(link);
    return status;
}

const char *mbm_lwip_text(err_t error)
{
    switch (error) {
    case ERR_OK: return "there is a connection";
    case ERR_INPROGRESS: return "the connection is being made";
    case ERR_MEM: return "lwIP has no memory: raise MEMP_NUM_TCP_PCB or MEM_SIZE";
    case ERR_RTE: return "no interface that is up leads to the peer";
    case ERR_TIMEOUT: return "nothing has answered, or the connection was idle for too long";
    case ERR_ABRT: return "lwIP gave up: the peer acknowledges nothing, or the address has changed";
    case ERR_RST: return "the peer refused or reset the connection";
    case ERR_CLSD: return "the peer closed the connection";
    case ERR_CONN: return "not connected";
    case ERR_USE: return "the TCP port is taken";
    default: return "lwIP refused it";
    }
}

/* --- the hooks of the port */

/* Copies bytes out, and frees the pbufs that are empty then. */
static u16_t take_bytes(mbm_lwip *link, uint8_t *bytes, u16_t capacity)
{
    u16_t count = 0;

    while (count < capacity && link->received != NULL) {
        struct pbuf *first = link->received;
        u16_t part = (u16_t)(first->len - link->taken);

        if (part > capacity - count)
            part = (u16_t)(capacity - count);
        memcpy(bytes + count, (const uint8_t *)first->payload + link->taken, part);
        count = (u16_t)(count + part);
        link->taken = (u16_t)(link->taken + part);
        if (link->taken == first->len) {
            link->received = first->next;
            link->taken = 0;
            if (first->next != NULL)
                pbuf_ref(first->next);
            (void)pbuf_free(first);
        }
    }
    return count;
}

static int16_t lwip_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_lwip *link = context;
    int16_t count = 0;

    MBM_LWIP_TAKE(link);
    if (notice_loss(link)) {
        count = -1;
    } else if (link->received != NULL && !(link->flags & MBM_LWIP_IS_NEW)) {
        count = (int16_t)take_bytes(link, bytes, capacity < MOST ? capacity : MOST);
        if (count > 0)
            link->activeMs = sys_now();
        /* Now the peer may send as many more. */
        if (count > 0 && link->pcb != NULL)
            tcp_recved(link->pcb, (u16_t)count);
    }
    MBM_LWIP_GIVE(link);
    return count;
}

/* Gives bytes to lwIP. Returns how many it took. */
static int16_t hand_bytes(mbm_lwip *link, const uint8_t *bytes, uint16_t length)
{
    struct tcp_pcb *pcb = link->pcb;
    tcpwnd_size_t count = tcp_sndbuf(pcb);
    err_t error = ERR_MEM;

    if (count > length)
        count = length;
    if (count > MOST)
        count = MOST;
    if (tcp_sndqueuelen(pcb) == 0)
        link->progressMs = sys_now();
    if (count > 0)
        error = tcp_write(pcb, bytes, (u16_t)count, TCP_WRITE_FLAG_COPY);
    if (error != ERR_OK && error != ERR_MEM) {
        mbm_lwip_leave(link, MBM_LWIP_LOST, error, 1);
        return -1;
    }
    if (error == ERR_MEM)
        count = 0;
    else
        link->activeMs = sys_now();
    link->flags &= (uint8_t)~MBM_LWIP_WAITS;
    if (count < length)
        link->flags |= MBM_LWIP_WAITS;
    /* If it fails, lwIP tries again. */
    (void)tcp_output(pcb);
    return (int16_t)count;
}

static int16_t lwip_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_lwip *link = context;
    int16_t count = 0;

    MBM_LWIP_TAKE(link);
    if (link->flags & MBM_LWIP_IS_SUCCESSOR || link->pcb == NULL) {
        count = -1;
    } else if (link->state == MBM_LWIP_CONNECTED && !(link->flags & MBM_LWIP_IS_NEW) &&
               length > 0) {
        if (link->flags & MBM_LWIP_HAS_SERVER && !has_route(link->pcb)) {
            mbm_lwip_leave(link, MBM_LWIP_LOST, ERR_RTE, 1);
            count = -1;
        } else {
            count = hand_bytes(link, bytes, length);
        }
    }
    MBM_LWIP_GIVE(link);
    return count;
}

static uint32_t lwip_micros(void *context)
{
    (void)context;
    return (uint32_t)sys_now() * 1000u;
}

mbm_port mbm_lwip_port(mbm_lwip *link)
{
    mbm_port port = MBM_INIT;

    if (link != NULL) {
        port.context = link;
        port.read = lwip_read;
        port.write = lwip_write;
        port.micros = lwip_micros;
    }
    return port;
}
