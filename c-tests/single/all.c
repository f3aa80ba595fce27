/* A master, and then a server, in one program. */
#include "master.h"
#include "server.h"

uint8_t run(void)
{
    const uint8_t wrong = run_master();

    return wrong ? wrong : run_server();
}
