#define _GNU_SOURCE
#include "mbm_call.h"

#include <unistd.h>

/* The sleep if the link cannot be waited for, in microseconds. */
enum { BLIND_SLEEP = 10000 };

/* Cancels the request, so that no pending request points to memory of a caller that has
 * returned. */
static uint8_t give_up(const mbm_caller *caller, uint8_t status)
{
    if (caller->request)
        (void)mbm_client_cancel(caller->client, caller->request);
    return status;
}

/* Sleeps until the client has something to do. */
static void rest(const mbm_caller *caller)
{
    uint32_t delay = mbm_client_pollDelay(caller->client);

    if (caller->stop && delay > MBM_CALL_SLEEP)
        delay = MBM_CALL_SLEEP;
    /* A lost terminal cannot be waited for. The next poll that uses it ends the request. */
    if (delay > 0 && caller->wait(caller->port, delay) < 0)
        usleep(delay < BLIND_SLEEP ? delay : BLIND_SLEEP);
}

uint8_t mbm_call(const mbm_caller *caller, uint8_t queued)
{
    if (queued != MBM_PENDING)
        return queued;
    if (!caller || !caller->client || !caller->wait)
        return MBM_INVALID_ARGUMENT;
    for (;;) {
        const uint8_t polled = mbm_client_poll(caller->client);

        if (polled != MBM_OK && polled != MBM_PENDING)
            return give_up(caller, polled);
        if (caller->request && caller->request->status != MBM_PENDING)
            return caller->request->status;
        if (polled == MBM_OK)
            return caller->request ? MBM_INVALID_ARGUMENT : MBM_OK;
        if (caller->stop && *caller->stop)
            return give_up(caller, MBM_CANCELLED);
        rest(caller);
    }
}
