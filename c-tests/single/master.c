#include "master.h"

uint8_t run(void)
{
    return run_master();
}
