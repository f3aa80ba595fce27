/* A program with the calls of ModbusMaster's example "Basic". */
#include "size.h"

int main(void)
{
    uint32_t i = 0;

    begin();
    for (;;) {
        i++;
        transmit[0] = (uint16_t)i;
        transmit[1] = (uint16_t)(i >> 16);
        uart = CALL(mbm_node_writeMultipleRegisters(&node, 0, 2));
        if (CALL(mbm_node_readHoldingRegisters(&node, 2, 6)) == MBM_OK) {
            for (uint8_t j = 0; j < 6; j++)
                uart = (uint8_t)response[j];
        }
        USED(i);
    }
}
