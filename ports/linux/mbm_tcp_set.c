/* The set of mbm_tcp.h: one wait for any number of sockets, by Linux's epoll. Licence: MIT
 * OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <errno.h>
#include <poll.h>
#include <sys/epoll.h>
#include <unistd.h>

_Static_assert(EPOLLIN == POLLIN && EPOLLOUT == POLLOUT,
               "the events of poll and epoll have the same values");

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* Sets what epoll waits for on a descriptor from now on. If that is nothing, the descriptor
 * is removed, since a hang-up would end each wait. */
static int watch(mbm_tcp_set *set, int fd, void *owner, uint8_t before, uint8_t events)
{
    struct epoll_event event = {.events = events, .data = {.ptr = owner}};

    if (before == 0)
        return epoll_ctl(set->fd, EPOLL_CTL_ADD, fd, &event);
    if (events != 0)
        return epoll_ctl(set->fd, EPOLL_CTL_MOD, fd, &event);
    (void)epoll_ctl(set->fd, EPOLL_CTL_DEL, fd, &event);
    return 0;
}

int mbm_tcp_add(mbm_tcp_set *set, mbm_tcp *tcp)
{
    if (!set->isOpen || !mbm_tcp_isInUse(tcp))
        return refuse(EBADF);
    if (tcp->set)
        return refuse(EBUSY);
    if (tcp->events != 0 && set->watch(set, tcp->fd, tcp, 0, tcp->events) < 0)
        return -1;
    tcp->set = set;
    return 0;
}

int mbm_tcp_openSet(mbm_tcp_set *set)
{
    if (set->isOpen)
        return refuse(EBUSY);
    set->fd = epoll_create1(EPOLL_CLOEXEC);
    if (set->fd < 0)
        return -1;
    set->isOpen = 1;
    set->nowMs = mbm_tcp_milliseconds();
    set->first = NULL;
    set->end = &set->first;
    set->listener = NULL;
    set->watch = watch;
    set->add = mbm_tcp_add;
    return 0;
}

void mbm_tcp_closeSet(mbm_tcp_set *set)
{
    if (set->isOpen)
        close(set->fd);
    set->fd = -1;
    set->isOpen = 0;
}

int mbm_tcp_addListener(mbm_tcp_set *set, mbm_tcp_listener *listener)
{
    if (!set->isOpen || listener->port == 0)
        return refuse(EBADF);
    if (listener->set || set->listener)
        return refuse(EBUSY);
    if (listener->events != 0 && set->watch(set, listener->fd, listener, 0, listener->events) < 0)
        return -1;
    listener->set = set;
    set->listener = listener;
    return 0;
}

/* Notes what epoll has found for a socket. The simple case, new bytes, is in wait_once. */
__attribute__((cold, noinline)) void mbm_tcp_noteEvents(mbm_tcp *tcp, uint32_t events)
{
    if (events & ~(uint32_t)EPOLLOUT) {
        if ((tcp->readiness & MBM_TCP_REPORTED) && !(tcp->readiness & MBM_TCP_LISTED)) {
            /* The program has not used the port: epoll does not wait for bytes until it does. */
            mbm_tcp_setEvents(tcp, tcp->events & POLLOUT);
            if (!(events & EPOLLOUT))
                return;
        }
        tcp->readiness |= MBM_TCP_REPORTED;
    }
    if (tcp->events == POLLOUT)
        /* If the socket is connecting, this finds out whether it is connected. */
        (void)mbm_tcp_isConnected(tcp);
    mbm_tcp_markReady(tcp);
}

/* Returns for how many milliseconds connections must still wait, or -1 if they need not.
 * When the time is over, mbm_tcp_accept looks again. */
static int64_t until_retry(mbm_tcp_set *set)
{
    mbm_tcp_listener *listener = set->listener;
    int64_t left;

    if (!listener || listener->events != 0)
        return -1;
    left = listener->retryAtMs - set->nowMs;
    if (left > 0)
        return left;
    listener->nothingToAccept = 0;
    return 0;
}

/* Waits once, for `time` milliseconds or without a limit if negative, and notes what it
 * finds. Returns the number of descriptors. */
static int wait_once(mbm_tcp_set *set, int64_t time)
{
    const int64_t retry = until_retry(set);
    struct epoll_event events[MBM_TCP_READY];
    int count, i;

    if (set->first)
        time = 0;
    else if (retry >= 0 && (time < 0 || time > retry))
        time = retry;
    count = epoll_wait(set->fd, events, MBM_TCP_READY, (int)time);
    set->nowMs = mbm_tcp_milliseconds();
    for (i = 0; i < count; i++) {
        mbm_tcp *tcp = (mbm_tcp *)events[i].data.ptr;

        if (events[i].data.ptr == set->listener) {
            set->listener->nothingToAccept = 0;
        } else if (events[i].events == EPOLLIN && tcp->readiness == 0) {
            tcp->readiness = MBM_TCP_REPORTED | MBM_TCP_LISTED;
            tcp->next = NULL;
            *set->end = tcp;
            set->end = &tcp->next;
        } else {
            mbm_tcp_noteEvents(tcp, events[i].events);
        }
    }
    (void)until_retry(set);
    return count;
}

int mbm_tcp_waitSet(mbm_tcp_set *set, uint32_t timeoutUs)
{
    const int64_t time = timeoutUs == MBM_TCP_FOREVER ? -1 : ((int64_t)timeoutUs + 999) / 1000;
    int count;

    if (!set->isOpen)
        return refuse(EBADF);
    do {
        count = wait_once(set, time);
        if (set->first)
            return 1;
        if (count < 0)
            return errno == EINTR ? 0 : -1;
        if (count == 0)
            return 0;
        /* A socket that the program does not use ended the wait. It will not do so again. */
    } while (!set->listener || set->listener->nothingToAccept);
    return 1;
}

mbm_tcp *mbm_tcp_nextReady(mbm_tcp_set *set)
{
    mbm_tcp *tcp = set->first;

    if (tcp) {
        set->first = tcp->next;
        if (!set->first)
            set->end = &set->first;
        tcp->readiness &= (uint8_t)~MBM_TCP_LISTED;
    }
    return tcp;
}
