/* A server on a serial line with four arrays: functions 01 to 06, 0F and 10. */
#include "server.h"

int main(void)
{
    serve();
    for (;;)
        uart = CALL(mbm_server_poll(&server));
}
