/**
 * @file mbm_call.h
 * @brief Sees one request of a client through: polls, sleeps, returns its status.
 *
 * For programs that do one thing after the other, on any link whose port can wait: a serial
 * line, a TCP connection, or a link of yours.
 *
 *     mbm_caller device = mbm_call_overTcp(&tcp, &client, &request);
 *
 *     status = mbm_call(&device, mbm_client_readHoldingRegisters(&client, &request, 100, 10));
 *
 * Compile mbm_call.c and the port that you use.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_CALL_H
#define MBM_CALL_H

#include "mbm_tcp.h"
#include "mbm_tty.h"

#include <signal.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The longest sleep between two polls if the caller has a `stop`, in microseconds: a signal
 *  just before a sleep does not end that sleep. */
#define MBM_CALL_SLEEP 100000u

/** The longest call in milliseconds, if `timeoutMs` of the caller is 0. */
#define MBM_CALL_TIMEOUT_MS 30000u

/** For `timeoutMs` of a caller: no limit. */
#define MBM_CALL_FOREVER UINT32_MAX

/** A client, its request, and how to sleep on its link. mbm_call_overTty and mbm_call_overTcp
 *  fill it in. It may be copied. */
typedef struct mbm_caller {
    mbm_client *client;         /**< the client; the program begins it */
    mbm_clientRequest *request; /**< the request that mbm_call sees through; NULL: all requests
                                     of the client */
    /** Sleeps until bytes have arrived, the link is lost, a full port accepts bytes again, or
     *  the time is over; it may return earlier. Returns -1 if it cannot sleep. */
    int (*wait)(void *port, uint32_t timeoutUs);
    void *port; /**< passed to `wait`; the port that the client uses */
    /** Returns the state of the link, like the hook of mbm_linkHooks: MBM_OK, MBM_PENDING while the
     * connection is being made, or another status. Then the call can say why the request was not
     * sent. NULL if the link is always there. */
    uint8_t (*status)(void *port);
    uint32_t timeoutMs; /**< the longest that a call takes, in milliseconds; 0:
                             MBM_CALL_TIMEOUT_MS */
    /** NULL, or a variable that ends a call when it becomes other than 0, for example one that
     *  a signal handler sets. */
    const volatile sig_atomic_t *stop;
} mbm_caller;

/**
 * Waits until a request has ended. Meanwhile it polls the client: other requests go on, and
 * `done` of all that end is called. Between two polls it sleeps.
 *
 * The settings of the client say how long that takes: response timeout, retries, backoff, and
 * the requests that were queued before; and of its link, how long a connection takes. However
 * long that is, the call ends after `timeoutMs`. If that is shorter than the response timeout, it
 * is the response timeout of the request, too, so that a request that is given up delays the next
 * one to its unit by no more than twice that time and the quiet time. Only a hook that blocks can
 * make it longer: mbm_tcp_connect while it looks up a name. A signal ends the call only by `stop`.
 * When the call returns, the request is not pending any more, except in a hook of the port.
 *
 * If `done` of the request queues it again, the call goes on until it has ended again. So the
 * `request` of an mbm_identification has ended when all objects are read.
 *
 * @param caller  the client and its request
 * @param queued  the status of the function that queued the request; MBM_PENDING if it was
 *                queued before
 * @return `queued` if it is not MBM_PENDING: the request was refused. Otherwise the status of
 *         the request; if `request` is NULL, MBM_OK when no request is pending. After
 *         `timeoutMs` MBM_RESPONSE_TIMED_OUT, while a connection is being made
 *         MBM_CONNECT_TIMED_OUT, without a link what its `status` says. A request that could not
 *         be sent because the connection is being made is MBM_CONNECT_TIMED_OUT too.
 *         MBM_CANCELLED if `stop` is set. MBM_BUSY from within `done` or a hook of the port, and
 *         while the client is suspended. MBM_INVALID_ARGUMENT for NULL, and for a request of
 *         another client; MBM_NOT_INITIALISED. After `timeoutMs`, for MBM_CANCELLED and for
 *         MBM_BUSY the request is cancelled; if `request` is NULL, no request is cancelled
 */
uint8_t mbm_call(const mbm_caller *caller, uint8_t queued);

/* `wait` of a caller on a serial line, and on a TCP connection. */
static inline int mbm_call_waitTty(void *tty, uint32_t timeoutUs)
{
    return mbm_tty_wait((mbm_tty *)tty, timeoutUs);
}

static inline int mbm_call_waitTcp(void *tcp, uint32_t timeoutUs)
{
    return mbm_tcp_wait((mbm_tcp *)tcp, 1, NULL, -1, timeoutUs);
}

/** A caller for a client on a serial line. */
static inline mbm_caller mbm_call_overTty(mbm_tty *tty, mbm_client *client,
                                          mbm_clientRequest *request)
{
    mbm_caller caller = {client, request, mbm_call_waitTty, tty, mbm_tty_status, 0, NULL};
    return caller;
}

/** A caller for a client on a TCP connection. */
static inline mbm_caller mbm_call_overTcp(mbm_tcp *tcp, mbm_client *client,
                                          mbm_clientRequest *request)
{
    mbm_caller caller = {client, request, mbm_call_waitTcp, tcp, mbm_tcp_status, 0, NULL};
    return caller;
}

#ifdef __cplusplus
}
#endif

#endif
