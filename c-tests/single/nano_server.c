#include "nano_server.h"

uint8_t run(void)
{
    return run_server();
}
