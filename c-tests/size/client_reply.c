/* A client on an RTU line, with every function, that reads the replies as packets. */
#include "client.h"

static mbm_packet packet;
static uint8_t pdu[MBM_MAX_PDU];

int main(void)
{
    begin_port();
    USED(&packet);
    USED(pdu);
    (void)CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    for (;;) {
        every_function();
        uart = CALL(mbm_client_reply(&request, pdu, sizeof pdu, &packet));
    }
}
