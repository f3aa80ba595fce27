/* A client of an RTU line, with every function. */
#include "client.h"

int main(void)
{
    mbm_port port = client_port();

    USED(&port);
    USED(response);
    USED(transmit);
    USED(frame);
    (void)CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    for (;;)
        every_function();
}
