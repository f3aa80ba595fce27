/* A client on an RTU line, with every function. */
#include "client.h"

int main(void)
{
    begin_port();
    (void)CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    for (;;)
        every_function();
}
