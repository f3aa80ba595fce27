/* A client on an RTU line that opens itself again, with every function. The difference from
 * client_rtu is what the link adds. */
#include "client.h"

#ifndef WITHOUT_MBM
static mbm_link kept;
static mbm_linkHooks hooks;

static uint8_t connect_line(void *context)
{
    (void)context;
    return uart;
}
#endif

int main(void)
{
    begin_port();
    (void)CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
#ifndef WITHOUT_MBM
    hooks.connect = connect_line;
    uart = mbm_link_begin(&kept, &client, &hooks);
#endif
    for (;;)
        every_function();
}
