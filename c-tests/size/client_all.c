/* A client of every framing, with every function. */
#include "client.h"

static uint8_t outgoing[MBM_FRAME_BYTES(WORDS)];

int main(void)
{
    begin_port();
    USED(outgoing);
    for (;;) {
        uart = CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
        uart = CALL(mbm_client_beginAscii(&client, &port, frame, sizeof frame));
        uart = CALL(mbm_client_beginRtuOverTcp(&client, &port, frame, sizeof frame));
        uart = CALL(
            mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
        every_function();
    }
}
