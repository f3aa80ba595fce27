#define _GNU_SOURCE
#include "mbm_call.h"

#include <time.h>
#include <unistd.h>

/* The sleep if the link cannot be waited for, in microseconds. */
enum { BLIND_SLEEP = 10000 };

static int64_t microseconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/* The time at which the call ends. */
static int64_t end_of(const mbm_caller *caller)
{
    const uint32_t longest = caller->timeoutMs ? caller->timeoutMs : MBM_CALL_TIMEOUT_MS;

    return longest == MBM_CALL_FOREVER ? INT64_MAX : microseconds() + (int64_t)longest * 1000;
}

/* Cancels the request, so that no pending request points to memory of a caller that has
 * returned. */
static uint8_t give_up(const mbm_caller *caller, uint8_t status)
{
    if (caller->request)
        (void)mbm_client_cancel(caller->client, caller->request);
    return status;
}

/* Ends the request with the reason of the link. */
static uint8_t time_out(const mbm_caller *caller)
{
    const uint8_t link = caller->status ? caller->status(caller->port) : MBM_OK;
    const uint8_t status = link == MBM_OK        ? MBM_RESPONSE_TIMED_OUT
                           : link == MBM_PENDING ? MBM_CONNECT_TIMED_OUT
                                                 : link;

    if (caller->request && mbm_client_cancel(caller->client, caller->request) == MBM_OK)
        caller->request->status = status;
    return status;
}

/* The status of a request that has ended. A client knows that the port took no bytes; the link
 * knows why. */
static uint8_t ended(const mbm_caller *caller)
{
    if (caller->request->status == MBM_LINE_BUSY && caller->status &&
        caller->status(caller->port) == MBM_PENDING)
        caller->request->status = MBM_CONNECT_TIMED_OUT;
    return caller->request->status;
}

/* Sleeps until the client has something to do, for at most `longest` microseconds. */
static void rest(const mbm_caller *caller, int64_t longest)
{
    uint32_t delay = mbm_client_pollDelay(caller->client);

    if (caller->stop && delay > MBM_CALL_SLEEP)
        delay = MBM_CALL_SLEEP;
    if (delay > longest)
        delay = (uint32_t)longest;
    /* A lost terminal cannot be waited for. The next poll that uses it ends the request. */
    if (delay > 0 && caller->wait(caller->port, delay) < 0)
        usleep(delay < BLIND_SLEEP ? delay : BLIND_SLEEP);
}

static uint8_t call(const mbm_caller *caller)
{
    const int64_t end = end_of(caller);

    for (;;) {
        const uint8_t polled = mbm_client_poll(caller->client);
        int64_t left;

        if (polled != MBM_OK && polled != MBM_PENDING)
            return give_up(caller, polled);
        if (caller->request && caller->request->status != MBM_PENDING)
            return ended(caller);
        if (polled == MBM_OK)
            return caller->request ? MBM_INVALID_ARGUMENT : MBM_OK;
        if (caller->stop && *caller->stop)
            return give_up(caller, MBM_CANCELLED);
        left = end - microseconds();
        if (left <= 0)
            return time_out(caller);
        rest(caller, left);
    }
}

/* Makes the limit of the call the response timeout of its request, if that is longer. So a request
 * that the call gives up delays the next one by that time, and not by the client's timeout. */
static void shorten_timeout(const mbm_caller *caller)
{
    mbm_clientRequest *request = caller->request;
    const uint32_t limit = caller->timeoutMs;
    uint32_t timeout = request->timeoutMs;

    if (timeout == 0)
        timeout = mbm_client_getResponseTimeout(caller->client, (uint8_t)request->unit);
    if (limit > 0 && limit < timeout)
        request->timeoutMs = limit;
}

uint8_t mbm_call(const mbm_caller *caller, uint8_t queued)
{
    uint32_t timeout;
    uint8_t status;

    if (queued != MBM_PENDING)
        return queued;
    if (!caller || !caller->client || !caller->wait)
        return MBM_INVALID_ARGUMENT;
    if (!caller->request)
        return call(caller);
    timeout = caller->request->timeoutMs;
    shorten_timeout(caller);
    status = call(caller);
    caller->request->timeoutMs = timeout;
    return status;
}
