/**
 * @file mbm_loop.h
 * @brief One wait for any number of clients, links, plans and servers: over TCP, serial lines
 *        and UDP. It polls only those that have something to do.
 *
 * A program registers each of them as an entry, with a function that polls it and returns for how
 * long it has nothing to do. mbm_loop_wait sleeps until a descriptor of an entry is ready or the
 * time of an entry is over, and polls these entries:
 *
 *     static mbm_loop loop = MBM_INIT;
 *     static mbm_loop_place places[DEVICES];
 *     static mbm_loop_entry entries[DEVICES] = MBM_INIT;
 *
 *     mbm_loop_open(&loop, places, DEVICES);
 *     entries[i].poll = mbm_loop_pollClient;
 *     entries[i].context = &clients[i];
 *     mbm_loop_addTcp(&loop, &entries[i], &tcps[i]);
 *     ...
 *     for (;;)
 *         mbm_loop_wait(&loop, MBM_LOOP_FOREVER);
 *
 * The work of a wait grows with the number of entries that have something to do, and with the
 * logarithm of the number of all. There is no heap: the storage is the program's.
 *
 * What to know:
 *
 * - A request that is queued outside the entry's own `poll` (in the main program, in `done` of
 *   another client) needs mbm_loop_wake. Within its `poll`, and so in `done`, in the callback of
 *   its link and in `update` of its plan, it needs none.
 * - A link that opens its socket or terminal again needs nothing: the loop waits for the new
 *   descriptor.
 * - `poll` may call every function of this file except mbm_loop_wait and mbm_loop_close. It may
 *   add and remove entries, itself too.
 * - All functions are for one thread. They are not for signal handlers.
 *
 * On Linux, by epoll. Compile mbm_loop.c, mbm_tcp.c, mbm_tcp_set.c, mbm_tcp_listener.c, mbm_tty.c
 * and mbm_udp.c.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_LOOP_H
#define MBM_LOOP_H

#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "mbm_udp.h"

#ifdef __cplusplus
extern "C" {
#endif

/** For mbm_loop_wait: no time limit. As the result of `poll`: nothing to do until the descriptor
 *  is ready or mbm_loop_wake is called. It is what the pollDelay functions return for that. */
#define MBM_LOOP_FOREVER UINT32_MAX

/** Most descriptors that one mbm_loop_wait takes from the system. The next one takes the others,
 *  so a descriptor that is always ready keeps none of the others waiting. */
#define MBM_LOOP_READY 64

/** Private: a place in a list. */
typedef struct mbm_loop_link {
    struct mbm_loop_link *next, *before;
} mbm_loop_link;

/** What a loop polls: for example a client with its link and its plan. Initialise it with
 *  MBM_INIT, then set `poll` and `context`. It must stay where it is while it is in a loop. */
typedef struct mbm_loop_entry {
    /** Does what can be done without waiting. Returns for how many microseconds there is nothing to
     *  do then: the least of what the pollDelay functions return, 0 to poll again in the next
     *  wait, or MBM_LOOP_FOREVER. For example mbm_loop_pollClient. */
    uint32_t (*poll)(struct mbm_loop_entry *entry);
    void *context;         /**< yours, for `poll` */
    mbm_loop_link awake;   /**< private */
    struct mbm_loop *loop; /**< private */
    void *port;            /**< private */
    int64_t dueUs;         /**< private */
    uint32_t place;        /**< private */
    int fd;                /**< private */
    uint8_t kind;          /**< private */
    uint8_t events;        /**< private */
} mbm_loop_entry;

/** Storage of a loop, one for each entry. */
typedef struct mbm_loop_place {
    int64_t timeUs;        /**< private */
    mbm_loop_entry *entry; /**< private */
} mbm_loop_place;

struct epoll_event;

/** A loop. Initialise it with MBM_INIT. */
typedef struct mbm_loop {
    mbm_tcp_set set;           /**< private */
    mbm_loop_place *places;    /**< private */
    uint32_t capacity;         /**< private */
    uint32_t count;            /**< private */
    uint32_t timed;            /**< private */
    uint32_t polled;           /**< private */
    int64_t nowUs;             /**< private */
    mbm_loop_link awake;       /**< private */
    mbm_loop_entry *current;   /**< private */
    mbm_loop_entry *accepting; /**< private */
    struct epoll_event *ready; /**< private */
    int readyCount;            /**< private */
    uint8_t isPolling;         /**< private */
} mbm_loop;

/**
 * Begins a loop without entries. It takes one descriptor.
 *
 * @param loop    initialised with MBM_INIT, or closed before
 * @param places  storage, the loop's alone until mbm_loop_close
 * @param count   number of places, 1 to 2^31 - 1: the most entries that the loop can have
 * @return 0, or -1 with errno set: EBUSY if the loop is open, EINVAL for a count out of range, or
 * an error of epoll_create1
 */
int mbm_loop_open(mbm_loop *loop, mbm_loop_place *places, uint32_t count);

/** Ends a loop. Remove its entries before. Does nothing if it is not open, and within `poll`. */
void mbm_loop_close(mbm_loop *loop);

/**
 * Adds an entry over a socket. The next wait polls it, whatever has arrived. If its link connects
 * anew, the loop waits for the new socket.
 *
 * @param loop   an open loop
 * @param entry  with `poll` set, in no loop
 * @param tcp    in use (mbm_tcp_openLater, mbm_tcp_open, mbm_tcp_attach or mbm_tcp_accept), in no
 *               set. Remove the entry before you close it
 * @return 0, or -1 with errno set: EBADF for a loop that is not open or a socket that is not in
 *         use, EBUSY for an entry or a socket that is in a loop or a set, EINVAL without `poll`,
 *         ENOSPC if all places are in use, or an error of epoll_ctl. Then nothing has changed
 */
int mbm_loop_addTcp(mbm_loop *loop, mbm_loop_entry *entry, mbm_tcp *tcp);

/**
 * Adds an entry over a terminal: a client or a server on a serial line.
 *
 * @param loop   an open loop
 * @param entry  as for mbm_loop_addTcp
 * @param tty    open, or noted by mbm_tty_openLater for a link; in no loop. Remove the entry before
 *               you detach it or open it otherwise than by its link
 * @return as mbm_loop_addTcp
 */
int mbm_loop_addTty(mbm_loop *loop, mbm_loop_entry *entry, mbm_tty *tty);

/**
 * Adds an entry over UDP.
 *
 * @param loop   an open loop
 * @param entry  as for mbm_loop_addTcp
 * @param udp    open, in no loop. Remove the entry before you close it
 * @return as mbm_loop_addTcp
 */
int mbm_loop_addUdp(mbm_loop *loop, mbm_loop_entry *entry, mbm_udp *udp);

/**
 * Adds a listener. Its `poll` calls mbm_tcp_accept until that returns -1, begins a server on each
 * connection, adds an entry for it by mbm_loop_addTcp, and returns MBM_LOOP_FOREVER.
 *
 * @param loop      an open loop without a listener
 * @param entry     as for mbm_loop_addTcp
 * @param listener  in use, in no set. Remove the entry before you close it
 * @return as mbm_loop_addTcp; EBUSY also for a second listener
 */
int mbm_loop_addListener(mbm_loop *loop, mbm_loop_entry *entry, mbm_tcp_listener *listener);

/**
 * Adds an entry over a descriptor of the program: it is polled whenever that can be read, so `poll`
 * has to read it.
 *
 * @param loop   an open loop
 * @param entry  as for mbm_loop_addTcp
 * @param fd     for example a pipe, a timerfd or another library's socket. -1: none. Then only
 *               times and mbm_loop_wake have the entry polled: a client over a port of your own, or
 *               what a program does every second. Remove the entry before you close it
 * @return as mbm_loop_addTcp; EPERM for a file that cannot be waited for
 */
int mbm_loop_addFd(mbm_loop *loop, mbm_loop_entry *entry, int fd);

/**
 * Removes an entry. Its `poll` is called no more. The port stays open. Does nothing if the entry is
 * in no loop.
 *
 * @param entry  the entry; its storage is free
 */
void mbm_loop_remove(mbm_loop_entry *entry);

/** Has the next wait poll an entry, without a sleep before. Call it after you have queued a
 *  request outside the entry's `poll`. Does nothing if the entry is in no loop. */
void mbm_loop_wake(mbm_loop_entry *entry);

/**
 * Sleeps until an entry has something to do, and polls each entry that has: those that were woken
 * or added, those whose time is over, and those whose descriptor is ready, each at most once for
 * each of these reasons. An entry whose time is over is polled before descriptors are looked at.
 *
 * @param loop       an open loop
 * @param timeoutUs  the longest sleep in microseconds, from 100000 on rounded up to the next
 *                   millisecond, or MBM_LOOP_FOREVER; 0: does not sleep. The times of the entries
 *                   are rounded in the same way
 * @return how many times it called `poll`; 0 if the time is over or a signal came; -1 with errno
 *         set: EBADF for a loop that is not open, EBUSY within `poll`, or an error of epoll_wait
 */
int mbm_loop_wait(mbm_loop *loop, uint32_t timeoutUs);

/**
 * Returns for how long mbm_loop_wait would sleep at most, for a program that waits in another way,
 * for example in the loop of another library: it waits for mbm_loop_fd to become readable and for
 * this time, and then calls mbm_loop_wait with 0.
 *
 * @param loop  an open loop
 * @return microseconds, at most 0xFFFFFFFE, or MBM_LOOP_FOREVER
 */
uint32_t mbm_loop_pollDelay(const mbm_loop *loop);

/**
 * Returns the descriptor of the loop, which can be read when an entry's descriptor is ready. Only
 * wait for it.
 *
 * @param loop  an open loop
 * @return a descriptor of epoll
 */
static inline int mbm_loop_fd(const mbm_loop *loop)
{
    return loop->set.fd;
}

/**
 * A `poll` for a client, with its link if it has one.
 *
 * @param entry  its `context` is an mbm_client
 * @return mbm_client_pollDelay
 */
uint32_t mbm_loop_pollClient(mbm_loop_entry *entry);

/** A client with a plan, for mbm_loop_pollPlan. */
typedef struct mbm_loop_planned {
    mbm_client *client; /**< the client, begun */
    mbm_plan *plan;     /**< its plan, begun */
} mbm_loop_planned;

/**
 * A `poll` for a client with a plan. It takes the replies, has the plan queue what is due, and
 * sends that at once.
 *
 * @param entry  its `context` is an mbm_loop_planned
 * @return the lesser of mbm_client_pollDelay and mbm_plan_pollDelay
 */
uint32_t mbm_loop_pollPlan(mbm_loop_entry *entry);

/**
 * A `poll` for a server. If the connection of a server over TCP is lost, or carries what is not
 * Modbus, it removes the entry and closes the socket: then its place is free for mbm_tcp_accept.
 *
 * @param entry  its `context` is an mbm_server
 * @return mbm_server_pollDelay; MBM_LOOP_FOREVER once the link is lost
 */
uint32_t mbm_loop_pollServer(mbm_loop_entry *entry);

#ifdef __cplusplus
}
#endif

#endif
