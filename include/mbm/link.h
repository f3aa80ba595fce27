/**
 * @file mbm/link.h
 * @brief A link: keeps the connection of a client open.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_LINK_H
#define MBM_LINK_H

#include "client.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Link: keeps a client's link open ============================================== */

/** mbm_link_state: there is no link. The client opens it when the wait is over. */
#define MBM_LINK_IS_DOWN 1u
/** mbm_link_state: the connection is being made. */
#define MBM_LINK_IS_CONNECTING 2u
/** mbm_link_state: the link is open. */
#define MBM_LINK_IS_UP 3u
/** An event of a link: it is open now. The status is MBM_OK. */
#define MBM_LINK_EVENT_CONNECTED 0u
/** An event of a link: it was open and is lost. The status is MBM_LINK_LOST, or
 *  MBM_RESPONSE_TIMED_OUT if the link has closed it since the device had fallen silent: see
 *  mbm_link_setReplaceAfter. */
#define MBM_LINK_EVENT_LOST 1u
/** An event of a link: an attempt to open it failed. The status is the result of `connect` or
 *  `status` of mbm_linkHooks; MBM_CONNECT_TIMED_OUT if the connection took too long. */
#define MBM_LINK_EVENT_FAILED 2u
/** mbm_link_setClose: the link stays open. */
#define MBM_LINK_CLOSE_NEVER 0u
/** mbm_link_setClose: the link is closed when mbm_client_poll finds no request. */
#define MBM_LINK_CLOSE_WHEN_IDLE 1u
/** mbm_link_setClose: the link is closed after a request without a right response. */
#define MBM_LINK_CLOSE_AFTER_FAILURE 2u

/**
 * A link that opens itself again when it was lost. It belongs to one client:
 * mbm_client_poll polls both.
 *
 * You own the storage. Initialise it with MBM_INIT. It must stay where it is until
 * mbm_link_end or until the client was begun again.
 */
typedef struct mbm_link {
    void *pointers[34]; /**< Private. */
    uint32_t words[24]; /**< Private. */
} mbm_link;

/**
 * Counters of a link. You may read and zero them at any time, but not from
 * an interrupt; each wraps at 2^32.
 */
typedef struct mbm_linkCounters {
    /** Calls of `connect` of mbm_linkHooks. */
    uint32_t attempts;
    /** Attempts that failed. */
    uint32_t failed;
    /** How often the link was opened, or found open by mbm_link_begin. */
    uint32_t connected;
    /** How often an open link was lost. */
    uint32_t lost;
} mbm_linkCounters;

/**
 * Gives a client a link, which mbm_client_poll keeps open from then on:
 * - It notices the loss of the link also while the client has no request. For that, an idle
 *   client reads the port in each poll and drops what it reads: late replies, noise, frames
 *   of others. If something else reads the line, call mbm_client_suspend first.
 * - It opens the link again: for a request at once, if the link was good until it was lost; else
 *   after a wait that grows with each attempt that fails. A link that was opened for a request,
 *   and is lost before anything was sent over it, has failed too.
 * - A link that the peer closes twice in a row while no request is there stays closed until the
 *   next request.
 * - It looks whether the link is still open before it sends a request. So a peer that closes idle
 *   connections costs no request.
 * - It replaces a connection on which the device answers no more: see mbm_link_setReplaceAfter.
 * - When the link is lost, requests in flight end with MBM_LINK_LOST, because the device may
 *   have carried them out. The others end too, or wait: see mbm_link_setRequestsWait.
 * - Requests that are in flight when the link begins go on if `status` finds the link open, and
 *   end with MBM_LINK_LOST if not. No byte of an ended request is sent over a new link.
 *
 * mbm_client_pollDelay returns when the next poll is due, for an idle client at most one
 * second. A wait for bytes that also ends when the link is lost, as mbm_tcp_wait and
 * mbm_tty_wait, finds the loss at once.
 *
 * In the first poll the link calls `status` to find out whether the link is open already, and
 * `connect` if not. After a loss or a failed attempt it calls `disconnect`, once.
 *
 * Client and link must stay where they are, and must not be copied. A program does not also
 * call mbm_client_reconnect.
 *
 * All settings of the link return to their defaults. The call may be repeated at any time,
 * also with another client. A begin function of the client ends the link.
 *
 * @param client  the client, begun; it must not have another link
 * @param hooks   how the link is opened and closed; copied. `connect` must not be NULL. The hooks
 *                must not use the client or the link: each function returns MBM_BUSY
 * @return a status; MBM_NOT_INITIALISED if the client was not begun; MBM_BUSY also while the
 *         client is suspended, and if it has another link
 */
uint8_t mbm_link_begin(mbm_link *link, mbm_client *client, const mbm_linkHooks *hooks);

/**
 * Ends a link. The client and its requests stay; the link itself stays open or closed as it
 * is. If its callback has just reported a loss, open it anew before the client sends again: half
 * a frame may have been sent. The storage is free, and begins anew with mbm_link_begin.
 *
 * @param link  the object; the client's storage must still be valid
 * @return a status; MBM_BUSY also while the client is suspended
 */
uint8_t mbm_link_end(mbm_link *link);

/**
 * Closes the link and opens it again, at the next poll of the client and without a wait. Call
 * it when you know better than the link: the network is back, the address has changed.
 * Requests in flight end with MBM_LINK_LOST; queued ones wait for this attempt.
 */
uint8_t mbm_link_reconnect(mbm_link *link);

/**
 * Sets the wait before an attempt to open the link. The first attempt after a loss waits for
 * `delayMs`; each attempt that fails lets the wait grow. It starts anew when the link was open
 * for as long as the last wait, or bytes have arrived. A request does not wait for the first
 * attempt after the loss of such a link: it is made at once.
 *
 * @param backoff     MBM_BACKOFF_NONE to MBM_BACKOFF_EXPONENTIAL (the default), as of
 *                    mbm_client_setBackoff
 * @param delayMs     the first wait in milliseconds, 0 to 1000000; the default is 500
 * @param maxDelayMs  the longest wait in milliseconds, 0 to 1000000; the default is 30000
 */
uint8_t mbm_link_setBackoff(mbm_link *link, uint8_t backoff, uint32_t delayMs, uint32_t maxDelayMs);

/**
 * Shortens each wait before an attempt by a random part, so that many clients that lost their
 * server together do not connect at the same time.
 *
 * @param percent  0 (the default) to 100: the largest part of the wait that is taken off
 * @param random   as of mbm_client_setJitter; must not use the client or the link. NULL only if
 *                 `percent` is 0
 * @param context  your pointer, passed to `random`; may be NULL
 */
uint8_t mbm_link_setJitter(mbm_link *link, uint8_t percent, uint32_t (*random)(void *context),
                           void *context);

/**
 * Sets how long a connection may take to be made. Then the attempt has failed, with
 * MBM_CONNECT_TIMED_OUT.
 *
 * @param timeoutMs  milliseconds, 1 to 1000000 (16 minutes); 0: as long as `status` returns
 *                   MBM_PENDING. The default is 10000
 */
uint8_t mbm_link_setConnectTimeout(mbm_link *link, uint32_t timeoutMs);

/**
 * Sets after how many requests in a row without any byte the link is closed and opened anew,
 * because some devices keep a connection open on which they answer no more. Repetitions count. So
 * do requests that you cancel while they are in flight, once nothing was heard for the client's
 * response timeout. While others are in flight, which may still be answered, the link is closed
 * 16 requests later at the most; they end with MBM_LINK_LOST. Requests that wait are sent over
 * the new link.
 *
 * Some devices answer nothing in the first seconds of a connection. So each link over which no byte
 * came has twice as many requests as the one before, up to 16 times as many and at most 100.
 *
 * @param requests  0 to 100; 0 for never. The default is 2 on TCP, and 0 on a serial line
 */
uint8_t mbm_link_setReplaceAfter(mbm_link *link, uint8_t requests);

/**
 * Sets whether requests wait for the link. By default they do not: while the link is down,
 * every request ends at the next poll: with MBM_CONNECT_TIMED_OUT if the last attempt took
 * longer than the connect timeout, else with MBM_LINK_LOST. (A program whose `done` queues the
 * request again at once then polls without a pause: let it wait.) If requests wait, they stay
 * in the queue until the link is open again or until you cancel them; their response timeout
 * begins when they are sent. While a connection is being made, requests always wait; those for
 * which a lost link is opened again end with MBM_CONNECT_TIMED_OUT if that takes as long as
 * their response timeout.
 *
 * @param on  0 (the default) or 1
 */
uint8_t mbm_link_setRequestsWait(mbm_link *link, uint8_t on);

/**
 * Sets the function that mbm_client_poll calls when the link was opened or lost, or when an
 * attempt has failed.
 *
 * @param callback  gets an MBM_LINK_EVENT_ constant and a status. It may do what `done` of a
 *                  request may, and call every function on the link; NULL for none
 * @param context   your pointer, passed to `callback`; may be NULL
 */
uint8_t mbm_link_setCallback(mbm_link *link,
                             void (*callback)(void *context, uint8_t event, uint8_t status),
                             void *context);

/**
 * Sets your storage for counters, in which the link counts from now on.
 *
 * @param counters  your counters, initialised with MBM_INIT; NULL stops counting
 */
uint8_t mbm_link_setCounters(mbm_link *link, mbm_linkCounters *counters);

/**
 * Returns what a link is doing.
 *
 * @return MBM_LINK_IS_DOWN, MBM_LINK_IS_CONNECTING or MBM_LINK_IS_UP; 0 before the first poll, and
 *         for an object that was never begun
 */
uint8_t mbm_link_state(const mbm_link *link);

/**
 * Sets when the link is closed although it is good. A request opens it again, without a wait,
 * and waits for that. Such a close is no loss: the link counts none and reports none.
 *
 * MBM_LINK_CLOSE_WHEN_IDLE is for devices with few places for connections. A program that
 * queues the requests of a round before it polls closes the link after each round. A plan does
 * so in its first round; later it spreads the requests, and the link is closed after each that
 * none follows at once.
 *
 * MBM_LINK_CLOSE_AFTER_FAILURE is for devices that answer no more, or wrongly, until they are
 * connected to anew: after a request, or its repetition, whose response is missing, damaged or
 * malformed. An exception is a right response. Over the new connection no late response comes.
 * Other requests in flight end with MBM_LINK_LOST, those that wait are sent over it.
 *
 * @param when  MBM_LINK_CLOSE_NEVER (the default), MBM_LINK_CLOSE_WHEN_IDLE,
 *              MBM_LINK_CLOSE_AFTER_FAILURE, or the last two added
 */
uint8_t mbm_link_setClose(mbm_link *link, uint8_t when);

/**
 * Sets how long no request is sent after the link was opened, for devices that answer nothing
 * at first. Requests wait meanwhile; their response timeout begins when they are sent.
 *
 * @param delayMs  milliseconds, 0 (the default) to 65535
 */
uint8_t mbm_link_setDelayAfterConnect(mbm_link *link, uint32_t delayMs);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_LINK_H */
