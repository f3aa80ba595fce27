/* One wait for any number of clients, links, plans and servers. Licence: MIT OR Apache-2.0.
 *
 * The times of the entries are in a binary heap, `places`. The time of a place may be earlier than
 * that of its entry, but never later: an entry whose time moves on, as with each request of a busy
 * client, leaves its place as it is, and is put right only when that place comes up. */
#define _GNU_SOURCE
#include "mbm_loop.h"

#include <errno.h>
#include <poll.h>
#include <stddef.h>
#include <sys/epoll.h>
#include <time.h>

/* Kinds of entries, by what they wait for. */
enum { OF_FD, OF_TCP, OF_TTY, OF_UDP, OF_LISTENER };

/* The shortest wait that is rounded up to milliseconds, in microseconds. */
enum { LONG_WAIT = 100000 };

/* The time of an entry that has nothing to do. */
static const int64_t NEVER = INT64_MAX;

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* Microseconds. */
static int64_t clock_now(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/* --- lists --- */

static void begin_list(mbm_loop_link *list)
{
    list->next = list->before = list;
}

static int is_empty(const mbm_loop_link *list)
{
    return list->next == list;
}

static void append(mbm_loop_link *list, mbm_loop_link *one)
{
    one->next = list;
    one->before = list->before;
    list->before->next = one;
    list->before = one;
}

static void unlink_one(mbm_loop_link *one)
{
    one->next->before = one->before;
    one->before->next = one->next;
    one->next = NULL;
}

/* Moves all of a list to another one, which is empty. */
static void move_all(mbm_loop_link *to, mbm_loop_link *from)
{
    begin_list(to);
    if (is_empty(from))
        return;
    *to = *from;
    to->next->before = to->before->next = to;
    begin_list(from);
}

static mbm_loop_entry *entry_of(mbm_loop_link *awake)
{
    return (mbm_loop_entry *)(void *)((char *)awake - offsetof(mbm_loop_entry, awake));
}

/* --- the heap. The places of an entry are counted from 1 on; 0: it is in none. --- */

static inline void put(mbm_loop *loop, uint32_t at, mbm_loop_place place)
{
    loop->places[at - 1] = place;
    place.entry->place = at;
}

/* Puts a place into the free one at `at`, or higher up. */
static void rise(mbm_loop *loop, uint32_t at, mbm_loop_place place)
{
    while (at > 1 && loop->places[at / 2 - 1].timeUs > place.timeUs) {
        put(loop, at, loop->places[at / 2 - 1]);
        at /= 2;
    }
    put(loop, at, place);
}

/* Returns the place below `at` whose time comes first; 0 if there is none. */
static inline uint32_t first_below(const mbm_loop *loop, uint32_t at)
{
    const uint32_t one = 2 * at;

    if (one >= loop->timed)
        return one == loop->timed ? one : 0;
    return loop->places[one].timeUs < loop->places[one - 1].timeUs ? one + 1 : one;
}

/* Puts a place into the free one at `at`, or further down. */
static void sink(mbm_loop *loop, uint32_t at, mbm_loop_place place)
{
    uint32_t next = first_below(loop, at);

    while (next != 0 && loop->places[next - 1].timeUs < place.timeUs) {
        put(loop, at, loop->places[next - 1]);
        at = next;
        next = first_below(loop, at);
    }
    put(loop, at, place);
}

static void leave_heap(mbm_loop_entry *entry)
{
    mbm_loop *loop = entry->loop;
    const uint32_t at = entry->place;
    mbm_loop_place last;

    if (at == 0)
        return;
    entry->place = 0;
    last = loop->places[--loop->timed];
    if (at > loop->timed)
        return;
    if (at > 1 && loop->places[at / 2 - 1].timeUs > last.timeUs)
        rise(loop, at, last);
    else
        sink(loop, at, last);
}

/* Sets the time of an entry. */
static void set_due(mbm_loop_entry *entry, int64_t due)
{
    mbm_loop *loop = entry->loop;

    entry->dueUs = due;
    if (entry->place != 0) {
        if (due < loop->places[entry->place - 1].timeUs)
            rise(loop, entry->place, (mbm_loop_place){due, entry});
    } else if (due != NEVER) {
        rise(loop, ++loop->timed, (mbm_loop_place){due, entry});
    }
}

/* Returns the entry whose time is over at `now`, or NULL; puts places right that come up before
 * their entry's time. */
static mbm_loop_entry *find_due(mbm_loop *loop, int64_t now)
{
    while (loop->timed > 0 && loop->places[0].timeUs <= now) {
        mbm_loop_entry *entry = loop->places[0].entry;

        if (entry->dueUs <= now)
            return entry;
        if (entry->dueUs == NEVER)
            leave_heap(entry);
        else
            sink(loop, 1, (mbm_loop_place){entry->dueUs, entry});
    }
    return NULL;
}

/* --- descriptors --- */

/* Sets what epoll waits for on a descriptor of an entry. If that is nothing, the descriptor is
 * removed, since a hang-up would end each wait. */
static int change(const mbm_loop *loop, int fd, mbm_loop_entry *entry, uint8_t before,
                  uint8_t events)
{
    struct epoll_event event = {.events = events, .data = {.ptr = entry}};

    if (events == 0) {
        (void)epoll_ctl(loop->set.fd, EPOLL_CTL_DEL, fd, &event);
        return 0;
    }
    return epoll_ctl(loop->set.fd, before ? EPOLL_CTL_MOD : EPOLL_CTL_ADD, fd, &event);
}

/* For the sockets and the listener of the set: `owner` is one of them. */
static int watch_socket(mbm_tcp_set *set, int fd, void *owner, uint8_t before, uint8_t events)
{
    mbm_loop *loop = (mbm_loop *)(void *)set;
    mbm_loop_entry *entry = loop->accepting;

    if (!entry || owner != entry->port)
        entry = (mbm_loop_entry *)((mbm_tcp *)owner)->owner;
    return change(loop, fd, entry, before, events);
}

/* mbm_tcp_accept calls it. The program adds the connection, with an entry. */
static int add_later(mbm_tcp_set *set, mbm_tcp *tcp)
{
    (void)set;
    (void)tcp;
    return 0;
}

/* Sets what epoll waits for on the entry's own descriptor. */
static int set_events(mbm_loop_entry *entry, uint8_t events)
{
    if (entry->events != events && change(entry->loop, entry->fd, entry, entry->events, events) < 0)
        return -1;
    entry->events = events;
    return 0;
}

/* For terminals and UDP: their descriptor was opened, or will be closed. */
static int watch_port(void *owner, int fd, uint8_t isOpen)
{
    mbm_loop_entry *entry = (mbm_loop_entry *)owner;

    if (!isOpen)
        return set_events(entry, 0);
    entry->fd = fd;
    return set_events(entry, POLLIN);
}

/* What to wait for on a terminal or by UDP: bytes, once the program has used the port since the
 * last ones were reported; space too, if the port is full. */
static uint8_t wanted_of(const mbm_loop_entry *entry)
{
    const mbm_udp *udp;

    if (entry->kind == OF_TTY) {
        const mbm_tty *tty = (const mbm_tty *)entry->port;

        return tty->isOpen && tty->events != 0 ? POLLIN : 0;
    }
    udp = (const mbm_udp *)entry->port;
    if (udp->port == 0 || udp->isLost)
        return 0;
    return (uint8_t)((udp->isUsed ? POLLIN : 0) | (udp->isFull ? POLLOUT : 0));
}

/* --- polling --- */

/* Waits for what a port other than TCP wants. Without it the entry would sleep for ever, so if the
 * system refuses it, the entry is polled again soon. Returns the delay. */
__attribute__((noinline)) static uint32_t follow_port(mbm_loop_entry *entry, uint32_t delay)
{
    enum { SOON = 100000 };

    if (entry->kind == OF_LISTENER) {
        const mbm_tcp_listener *listener = (const mbm_tcp_listener *)entry->port;

        /* While connections must wait, the loop polls it again after MBM_TCP_RETRY. */
        return listener->events == 0 && delay > MBM_TCP_RETRY ? MBM_TCP_RETRY : delay;
    }
    if (entry->kind != OF_FD && set_events(entry, wanted_of(entry)) < 0 && delay > SOON)
        return SOON;
    return delay;
}

static void poll_entry(mbm_loop *loop, mbm_loop_entry *entry)
{
    int64_t now = loop->nowUs;
    uint32_t delay;

    if (entry->awake.next)
        unlink_one(&entry->awake);
    loop->current = entry;
    loop->polled++;
    delay = entry->poll(entry);
    if (loop->current != entry)
        return; /* it was removed */
    loop->current = NULL;
    if (entry->kind == OF_TCP) {
        /* The delay counts from when the entry has looked at the clock. */
        const mbm_tcp *tcp = (const mbm_tcp *)entry->port;

        if (tcp->clockUs > now)
            now = tcp->clockUs;
    } else {
        delay = follow_port(entry, delay);
    }
    if (delay == 0) {
        set_due(entry, NEVER);
        mbm_loop_wake(entry);
    } else {
        set_due(entry, delay == MBM_LOOP_FOREVER ? NEVER : now + delay);
    }
}

/* Notes that the descriptor of an entry is ready. Returns whether to poll the entry. */
static int note_ready(mbm_loop_entry *entry, uint32_t events)
{
    switch (entry->kind) {
    case OF_TCP: {
        mbm_tcp *tcp = (mbm_tcp *)entry->port;

        if (events == EPOLLIN && tcp->readiness == 0) {
            tcp->readiness = MBM_TCP_REPORTED;
            return 1;
        }
        mbm_tcp_noteEvents(tcp, events);
        return 0; /* poll_listed polls it, if it is to be polled */
    }
    /* Bytes are reported again once the port is used: follow_port sees to that. */
    case OF_TTY: ((mbm_tty *)entry->port)->events = 0; return 1;
    case OF_UDP: ((mbm_udp *)entry->port)->isUsed = 0; return 1;
    case OF_LISTENER: ((mbm_tcp_listener *)entry->port)->nothingToAccept = 0; return 1;
    default: return 1;
    }
}

/* Polls the entries that were woken before this round. */
static void poll_awake(mbm_loop *loop)
{
    mbm_loop_link round;

    move_all(&round, &loop->awake);
    while (!is_empty(&round))
        poll_entry(loop, entry_of(round.next));
}

static void poll_due(mbm_loop *loop)
{
    mbm_loop_entry *entry;

    while ((entry = find_due(loop, loop->nowUs))) {
        if (entry->kind == OF_LISTENER)
            ((mbm_tcp_listener *)entry->port)->nothingToAccept = 0;
        entry->dueUs = NEVER;
        poll_entry(loop, entry);
    }
}

static void poll_ready(mbm_loop *loop)
{
    int i;

    for (i = 0; i < loop->readyCount; i++) {
        mbm_loop_entry *entry = (mbm_loop_entry *)loop->ready[i].data.ptr;

        /* mbm_loop_remove sets the entries that it removes to NULL. */
        if (entry && note_ready(entry, loop->ready[i].events))
            poll_entry(loop, entry);
    }
}

/* Polls the sockets for which the system reported more than new bytes. */
static void poll_listed(mbm_loop *loop)
{
    mbm_tcp *tcp;

    while ((tcp = mbm_tcp_nextReady(&loop->set)))
        if (tcp->owner)
            poll_entry(loop, (mbm_loop_entry *)tcp->owner);
}

/* Waits until a descriptor is ready, at most until `until`. Returns the number of descriptors. */
static int wait_until(const mbm_loop *loop, int64_t until, struct epoll_event *events)
{
    const int64_t left = until == NEVER ? NEVER : until - loop->nowUs;
    struct pollfd wait = {loop->set.fd, POLLIN, 0};
    struct timespec time;
    int count;

    if (left >= LONG_WAIT) {
        const int64_t ms = left / 1000 + 1;

        return epoll_wait(loop->set.fd, events, MBM_LOOP_READY,
                          left == NEVER ? -1 : (int)(ms < INT32_MAX ? ms : INT32_MAX));
    }
    count = epoll_wait(loop->set.fd, events, MBM_LOOP_READY, 0);
    if (count != 0 || left <= 0)
        return count;
    /* epoll_wait counts in milliseconds, which are too long for a serial line. */
    time = (struct timespec){0, (long)left * 1000};
    count = ppoll(&wait, 1, &time, NULL);
    return count > 0 ? epoll_wait(loop->set.fd, events, MBM_LOOP_READY, 0) : count;
}

int mbm_loop_wait(mbm_loop *loop, uint32_t timeoutUs)
{
    struct epoll_event events[MBM_LOOP_READY];
    int64_t end, until;
    int count;

    if (!loop->set.isOpen)
        return refuse(EBADF);
    if (loop->isPolling)
        return refuse(EBUSY);
    loop->polled = 0;
    loop->nowUs = clock_now();
    end = timeoutUs == MBM_LOOP_FOREVER ? NEVER : loop->nowUs + timeoutUs;
    do {
        until = end;
        if (!is_empty(&loop->awake) || loop->set.first || find_due(loop, loop->nowUs))
            until = loop->nowUs;
        else if (loop->timed > 0 && loop->places[0].timeUs < until)
            until = loop->places[0].timeUs;
        count = wait_until(loop, until, events);
        if (count < 0 && errno != EINTR)
            return -1;
        loop->nowUs = clock_now();
        loop->set.nowMs = loop->nowUs / 1000;
        loop->ready = events;
        loop->readyCount = count;
        loop->isPolling = 1;
        poll_awake(loop);
        poll_due(loop);
        poll_ready(loop);
        poll_listed(loop);
        loop->isPolling = 0;
        loop->readyCount = 0;
    } while (loop->polled == 0 && count >= 0 && loop->nowUs < end);
    return (int)(loop->polled < INT32_MAX ? loop->polled : INT32_MAX);
}

uint32_t mbm_loop_pollDelay(const mbm_loop *loop)
{
    int64_t left;

    if (!loop->set.isOpen || (is_empty(&loop->awake) && !loop->set.first && loop->timed == 0))
        return MBM_LOOP_FOREVER;
    if (!is_empty(&loop->awake) || loop->set.first)
        return 0;
    left = loop->places[0].timeUs - clock_now();
    if (left <= 0)
        return 0;
    return left < MBM_LOOP_FOREVER ? (uint32_t)left : MBM_LOOP_FOREVER - 1;
}

/* --- adding and removing --- */

int mbm_loop_open(mbm_loop *loop, mbm_loop_place *places, uint32_t count)
{
    if (loop->set.isOpen)
        return refuse(EBUSY);
    if (!places || count == 0 || count > INT32_MAX)
        return refuse(EINVAL);
    if (mbm_tcp_openSet(&loop->set) < 0)
        return -1;
    loop->set.watch = watch_socket;
    loop->set.add = add_later;
    loop->places = places;
    loop->capacity = count;
    loop->count = loop->timed = 0;
    loop->current = loop->accepting = NULL;
    loop->readyCount = 0;
    loop->isPolling = 0;
    begin_list(&loop->awake);
    return 0;
}

void mbm_loop_close(mbm_loop *loop)
{
    if (!loop->isPolling)
        mbm_tcp_closeSet(&loop->set);
}

/* Checks what all entries need. */
static int may_add(const mbm_loop *loop, const mbm_loop_entry *entry)
{
    if (!loop->set.isOpen)
        return refuse(EBADF);
    if (!entry->poll)
        return refuse(EINVAL);
    if (entry->loop)
        return refuse(EBUSY);
    return loop->count == loop->capacity ? refuse(ENOSPC) : 0;
}

static void begin_entry(mbm_loop *loop, mbm_loop_entry *entry, uint8_t kind, void *port)
{
    entry->loop = loop;
    entry->kind = kind;
    entry->port = port;
    entry->dueUs = NEVER;
    entry->place = 0;
    entry->fd = -1;
    entry->events = 0;
    entry->awake.next = NULL;
}

/* The entry is in the loop, and is polled by the next wait. */
static int finish_adding(mbm_loop_entry *entry)
{
    entry->loop->count++;
    mbm_loop_wake(entry);
    return 0;
}

static int give_up(mbm_loop_entry *entry)
{
    entry->loop = NULL;
    return -1;
}

int mbm_loop_addTcp(mbm_loop *loop, mbm_loop_entry *entry, mbm_tcp *tcp)
{
    if (may_add(loop, entry) < 0)
        return -1;
    if (tcp->set)
        return refuse(EBUSY);
    begin_entry(loop, entry, OF_TCP, tcp);
    tcp->owner = entry;
    if (mbm_tcp_add(&loop->set, tcp) < 0) {
        tcp->owner = NULL;
        return give_up(entry);
    }
    return finish_adding(entry);
}

int mbm_loop_addTty(mbm_loop *loop, mbm_loop_entry *entry, mbm_tty *tty)
{
    if (may_add(loop, entry) < 0)
        return -1;
    if (tty->watch)
        return refuse(EBUSY);
    if (!tty->isOpen && tty->path[0] == '\0')
        return refuse(EBADF);
    begin_entry(loop, entry, OF_TTY, tty);
    if (tty->isOpen && watch_port(entry, tty->fd, 1) < 0)
        return give_up(entry);
    tty->owner = entry;
    tty->watch = watch_port;
    return finish_adding(entry);
}

int mbm_loop_addUdp(mbm_loop *loop, mbm_loop_entry *entry, mbm_udp *udp)
{
    if (may_add(loop, entry) < 0)
        return -1;
    if (udp->port == 0)
        return refuse(EBADF);
    if (udp->watch)
        return refuse(EBUSY);
    begin_entry(loop, entry, OF_UDP, udp);
    if (watch_port(entry, udp->fd, 1) < 0)
        return give_up(entry);
    udp->isUsed = 1;
    udp->owner = entry;
    udp->watch = watch_port;
    return finish_adding(entry);
}

int mbm_loop_addListener(mbm_loop *loop, mbm_loop_entry *entry, mbm_tcp_listener *listener)
{
    if (may_add(loop, entry) < 0)
        return -1;
    if (loop->accepting)
        return refuse(EBUSY);
    begin_entry(loop, entry, OF_LISTENER, listener);
    loop->accepting = entry;
    if (mbm_tcp_addListener(&loop->set, listener) < 0) {
        loop->accepting = NULL;
        return give_up(entry);
    }
    return finish_adding(entry);
}

int mbm_loop_addFd(mbm_loop *loop, mbm_loop_entry *entry, int fd)
{
    if (may_add(loop, entry) < 0)
        return -1;
    begin_entry(loop, entry, OF_FD, NULL);
    entry->fd = fd;
    if (fd >= 0 && set_events(entry, POLLIN) < 0)
        return give_up(entry);
    return finish_adding(entry);
}

/* Takes the entry's port out of the loop, and leaves it open. */
static void leave_port(mbm_loop_entry *entry)
{
    mbm_loop *loop = entry->loop;

    switch (entry->kind) {
    case OF_TCP: {
        mbm_tcp *tcp = (mbm_tcp *)entry->port;

        if (tcp->owner == entry && tcp->set == &loop->set)
            mbm_tcp_remove(tcp);
        tcp->owner = NULL;
        break;
    }
    case OF_LISTENER: {
        mbm_tcp_listener *listener = (mbm_tcp_listener *)entry->port;

        if (listener->set && listener->events != 0)
            (void)change(loop, listener->fd, entry, listener->events, 0);
        listener->set = NULL;
        listener->nothingToAccept = 0;
        loop->set.listener = NULL;
        loop->accepting = NULL;
        break;
    }
    case OF_TTY:
        (void)set_events(entry, 0);
        ((mbm_tty *)entry->port)->watch = NULL;
        break;
    case OF_UDP:
        (void)set_events(entry, 0);
        ((mbm_udp *)entry->port)->watch = NULL;
        break;
    default: (void)set_events(entry, 0); break;
    }
}

void mbm_loop_remove(mbm_loop_entry *entry)
{
    mbm_loop *loop = entry->loop;
    int i;

    if (!loop)
        return;
    leave_port(entry);
    leave_heap(entry);
    if (entry->awake.next)
        unlink_one(&entry->awake);
    for (i = 0; i < loop->readyCount; i++)
        if (loop->ready[i].data.ptr == entry)
            loop->ready[i].data.ptr = NULL;
    if (loop->current == entry)
        loop->current = NULL;
    loop->count--;
    entry->loop = NULL;
}

void mbm_loop_wake(mbm_loop_entry *entry)
{
    if (entry->loop && !entry->awake.next)
        append(&entry->loop->awake, &entry->awake);
}

/* --- ready-made --- */

uint32_t mbm_loop_pollClient(mbm_loop_entry *entry)
{
    mbm_client *client = (mbm_client *)entry->context;

    (void)mbm_client_poll(client);
    return mbm_client_pollDelay(client);
}

uint32_t mbm_loop_pollPlan(mbm_loop_entry *entry)
{
    mbm_loop_planned *own = (mbm_loop_planned *)entry->context;
    const int isIdle = mbm_client_pending(own->client) == 0;
    uint32_t delay, next;
    uint8_t pending;

    /* Replies come before the plan, and what the plan has queued is sent at once. */
    if (!isIdle)
        (void)mbm_client_poll(own->client);
    pending = mbm_client_pending(own->client);
    (void)mbm_plan_poll(own->plan);
    if (isIdle || mbm_client_pending(own->client) > pending)
        (void)mbm_client_poll(own->client);
    delay = mbm_client_pollDelay(own->client);
    next = mbm_plan_pollDelay(own->plan);
    return next < delay ? next : delay;
}

uint32_t mbm_loop_pollServer(mbm_loop_entry *entry)
{
    mbm_server *server = (mbm_server *)entry->context;
    const uint8_t status = mbm_server_poll(server);

    if (status != MBM_LINK_LOST && status != MBM_MALFORMED_FRAME)
        return mbm_server_pollDelay(server);
    if (entry->kind == OF_TCP) {
        mbm_tcp *tcp = (mbm_tcp *)entry->port;

        mbm_loop_remove(entry);
        mbm_tcp_close(tcp);
    }
    return MBM_LOOP_FOREVER;
}
