/* The program fc03_fc16, which also makes one call that most programs do without. A macro on the
 * compiler's command line chooses the call; without one there is none. */
#include "size.h"

#ifdef COUNTERS
static mbm_counters counters;
#define ONE_MORE mbm_line_setCounters(&line, &counters)
#elif defined(LENIENT)
#define ONE_MORE mbm_node_setLenient(&node, 1)
#elif defined(NODE)
static mbm_node other;
static uint16_t more[WORDS];
#define ONE_MORE                                                                                   \
    (mbm_node_begin(&other, &line, 2, more, WORDS, transmit, WORDS) |                              \
     mbm_node_readHoldingRegisters(&other, 2, 10))
#elif defined(POLL)
#define ONE_MORE (mbm_node_setBlocking(&node, 0) | mbm_node_poll(&node))
#elif defined(BAUD)
#define ONE_MORE mbm_line_setBaudRate(&line, 19200)
#elif defined(TIMEOUT)
#define ONE_MORE mbm_node_setResponseTimeout(&node, 500)
#elif defined(EXTRAS)
#define ONE_MORE mbm_line_setRetries(&line, 2)
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
