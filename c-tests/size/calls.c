/* The program fc03_fc16, which also makes one call that most programs do without. A macro on the
 * compiler's command line chooses the call; without one there is none. */
#include "size.h"

#ifdef COUNTERS
static mbm_counters counters;
#define ONE_MORE mbm_master_setCounters(&node, &counters)
#elif defined(LENIENT)
#define ONE_MORE mbm_master_setLenient(&node, 1)
#elif defined(TURN)
static mbm_turn turn;
#define ONE_MORE (mbm_master_takeTurn(&node, &turn) | mbm_master_endTurn(&node, &turn))
#elif defined(POLL)
#define ONE_MORE (mbm_master_setBlocking(&node, 0) | mbm_master_poll(&node))
#elif defined(BAUD)
#define ONE_MORE mbm_master_setBaudRate(&node, 19200)
#elif defined(TIMEOUT)
#define ONE_MORE mbm_master_setResponseTimeout(&node, 500)
#elif defined(RETRIES)
#define ONE_MORE mbm_master_setRetries(&node, 2)
#elif defined(ECHO)
#define ONE_MORE mbm_master_setEchoDiscard(&node, 1)
#else
#define ONE_MORE 0
#endif

int main(void)
{
    begin();
    uart = CALL(ONE_MORE);
    for (;;)
        CALL_FC03_AND_FC16();
}
