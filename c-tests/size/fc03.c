/* A program that reads holding registers and does nothing else. */
#include "size.h"

int main(void)
{
    begin();
    for (;;) {
        if (CALL(mbm_node_readHoldingRegisters(&node, 2, 10)) == MBM_OK)
            uart = (uint8_t)response[0];
    }
}
