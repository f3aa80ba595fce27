/* A program that reads holding registers and writes them from the transmit words. */
#include "size.h"

int main(void)
{
    begin();
    for (;;) {
        if (CALL(mbm_master_readHoldingRegisters(&node, 2, 10)) == MBM_OK)
            transmit[0] = response[0];
        uart = CALL(mbm_master_writeMultipleRegisters(&node, 2, 10));
    }
}
