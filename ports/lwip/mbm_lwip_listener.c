/* The listener of mbm_lwip.h. Licence: MIT OR Apache-2.0. */
#include "mbm_lwip.h"

#include "lwip/sys.h"
#include "lwip/tcp.h"

/* --- places */

static uint8_t is_new(const mbm_lwip *place)
{
    return place->flags & MBM_LWIP_IS_NEW;
}

/* Returns the place whose connection has been idle for longest, and for long enough. */
static mbm_lwip *oldest_idle(const mbm_lwip_listener *listener)
{
    const u32_t now = sys_now();
    mbm_lwip *oldest = NULL, *place;
    uint16_t i;

    for (i = 0; listener->idleTimeMs != 0 && i < listener->count; i++) {
        place = &listener->places[i];
        if (place->state == MBM_LWIP_CONNECTED && !is_new(place) && !place->isBusy &&
            now - place->activeMs >= listener->idleTimeMs &&
            (oldest == NULL || now - place->activeMs > now - oldest->activeMs))
            oldest = place;
    }
    return oldest;
}

static mbm_lwip *close_oldest_idle(mbm_lwip_listener *listener)
{
    mbm_lwip *oldest = oldest_idle(listener);

    if (oldest != NULL) {
        mbm_lwip_leave(oldest, MBM_LWIP_LOST, ERR_TIMEOUT, 1);
        listener->idle++;
    }
    return oldest;
}

/* Returns a place whose connection was lost, or ends one that its peer has closed. What the peer
 * has sent was read. */
static mbm_lwip *find_ended(const mbm_lwip_listener *listener)
{
    uint16_t i;

    for (i = 0; i < listener->count; i++) {
        mbm_lwip *place = &listener->places[i];

        if (place->state == MBM_LWIP_CONNECTED && place->flags & MBM_LWIP_IS_ENDED &&
            place->received == NULL) {
            if (is_new(place))
                mbm_lwip_reset(place, ERR_CLSD);
            else
                mbm_lwip_leave(place, MBM_LWIP_LOST, ERR_CLSD, 0);
        }
        if (place->state != MBM_LWIP_CONNECTED)
            return place;
    }
    return NULL;
}

static mbm_lwip *find_place(mbm_lwip_listener *listener)
{
    mbm_lwip *place;
    uint16_t i;

    for (i = 0; i < listener->count; i++) {
        if (listener->places[i].state == MBM_LWIP_FREE)
            return &listener->places[i];
    }
    place = find_ended(listener);
    return place != NULL ? place : close_oldest_idle(listener);
}

/* --- lwIP's callback */

/* Puts a connection into a place. The program does not know of it yet. */
static void hand_to(mbm_lwip *place, struct tcp_pcb *pcb)
{
    const uint8_t isFree = place->state == MBM_LWIP_FREE;
    const err_t error = place->error;

    mbm_lwip_leave(place, MBM_LWIP_LOST, error, 1);
    mbm_lwip_adopt(place, pcb, MBM_LWIP_CONNECTED);
    place->flags = MBM_LWIP_IS_NEW;
    if (!isFree) {
        /* Until the program has closed the old connection, it sees the end of that one. */
        place->flags |= MBM_LWIP_IS_SUCCESSOR;
        place->error = error;
    }
}

static err_t on_accepted(void *context, struct tcp_pcb *pcb, err_t error)
{
    mbm_lwip_listener *listener = context;
    err_t result = ERR_OK;
    mbm_lwip *place;

    (void)error;
    if (pcb == NULL) {
        /* lwIP has dropped it, and its client tries again. */
        listener->shortages++;
        place = close_oldest_idle(listener);
        if (place != NULL && place->ready != NULL)
            place->ready(place->context);
        return ERR_MEM;
    }
    place = find_place(listener);
    if (place == NULL) {
        listener->refused++;
        tcp_abort(pcb);
        return ERR_ABRT;
    }
    hand_to(place, pcb);
    place->calling = pcb;
    if (listener->ready != NULL)
        listener->ready(listener->context);
    if (place->calling == pcb && place->ready != NULL)
        place->ready(place->context);
    /* The program may have closed it with a reset by now. */
    if (place->calling == NULL)
        result = ERR_ABRT;
    place->calling = NULL;
    return result;
}

/* --- what the program asks for */

static uint8_t begin_to_listen(mbm_lwip_listener *listener, const ip_addr_t *address, uint16_t port)
{
    struct tcp_pcb *bound, *pcb = NULL;

    listener->error = ERR_MEM;
    bound = tcp_new_ip_type(IP_GET_TYPE(address));
    if (bound == NULL)
        return MBM_LINK_LOST;
#if SO_REUSE
    /* Without this, a server that begins again could not listen, because of its old connections. */
    ip_set_option(bound, SOF_REUSEADDR);
#endif
    listener->error = tcp_bind(bound, address, port);
    if (listener->error == ERR_OK)
        pcb = tcp_listen_with_backlog_and_err(
            bound, (u8_t)(listener->count < 255 ? listener->count : 255), &listener->error);
    if (pcb == NULL) {
        (void)tcp_close(bound);
        return MBM_LINK_LOST;
    }
    listener->pcb = pcb;
    tcp_arg(pcb, listener);
    tcp_accept(pcb, on_accepted);
    return MBM_OK;
}

/* The listener's task makes the calls of its places too. */
static uint8_t prepare_places(const mbm_lwip_listener *listener, mbm_lwip *places, uint16_t count)
{
    uint16_t i;

    for (i = 0; i < count; i++) {
        if (places[i].state != MBM_LWIP_FREE)
            return 0;
    }
    for (i = 0; i < count; i++)
        places[i].isTask = listener->isTask;
    return 1;
}

uint8_t mbm_lwip_listen(mbm_lwip_listener *listener, const ip_addr_t *address, uint16_t port,
                        mbm_lwip *places, uint16_t count)
{
    uint8_t status = MBM_BUSY;

    if (listener == NULL || places == NULL || count == 0 || port == 0 ||
        (listener->isTask && !MBM_LWIP_CAN_LOCK))
        return MBM_INVALID_ARGUMENT;
    MBM_LWIP_TAKE(listener);
    if (listener->pcb == NULL && prepare_places(listener, places, count)) {
        listener->places = places;
        listener->count = count;
        status = begin_to_listen(listener, address != NULL ? address : IP_ANY_TYPE, port);
    }
    MBM_LWIP_GIVE(listener);
    return status;
}

int mbm_lwip_accept(mbm_lwip_listener *listener)
{
    int index = -1;
    uint16_t i;

    if (listener == NULL)
        return -1;
    MBM_LWIP_TAKE(listener);
    for (i = 0; listener->pcb != NULL && i < listener->count && index < 0; i++) {
        mbm_lwip *place = &listener->places[i];

        if (is_new(place) && !(place->flags & MBM_LWIP_IS_SUCCESSOR)) {
            place->flags &= (uint8_t)~MBM_LWIP_IS_NEW;
            place->activeMs = sys_now();
            index = i;
        }
    }
    MBM_LWIP_GIVE(listener);
    return index;
}

void mbm_lwip_closeListener(mbm_lwip_listener *listener)
{
    uint16_t i;

    if (listener == NULL)
        return;
    MBM_LWIP_TAKE(listener);
    if (listener->pcb != NULL)
        (void)tcp_close(listener->pcb);
    for (i = 0; listener->pcb != NULL && i < listener->count; i++) {
        mbm_lwip *place = &listener->places[i];

        if (is_new(place))
            mbm_lwip_reset(place, ERR_ABRT);
    }
    listener->pcb = NULL;
    MBM_LWIP_GIVE(listener);
}
