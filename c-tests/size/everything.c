/* A master with its ten functions, and a server with every function, on a serial line in
 * RTU and ASCII and over TCP. */
#include "everything.h"

int main(void)
{
    serve_everything();
    begin();
    for (;;) {
        uart = CALL(mbm_server_poll(&server));
        uart = CALL(mbm_master_readCoils(&node, 2, 10));
        uart = CALL(mbm_master_readDiscreteInputs(&node, 2, 10));
        uart = CALL(mbm_master_readHoldingRegisters(&node, 2, 10));
        uart = CALL(mbm_master_readInputRegisters(&node, 2, 10));
        uart = CALL(mbm_master_writeSingleCoil(&node, 2, 1));
        uart = CALL(mbm_master_writeSingleRegister(&node, 2, 10));
        uart = CALL(mbm_master_writeMultipleCoils(&node, 2, 10));
        uart = CALL(mbm_master_writeMultipleRegisters(&node, 2, 10));
        uart = CALL(mbm_master_maskWriteRegister(&node, 2, 0xFF00, 0x0012));
        uart = CALL(mbm_master_readWriteMultipleRegisters(&node, 2, 10, 20, 10));
        (void)CALL(mbm_master_setTransmitBuffer(&node, 0, 1));
        uart = (uint8_t)CALL(mbm_master_getResponseBuffer(&node, 0));
    }
}
