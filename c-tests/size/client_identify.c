/* A client on an RTU line, with every function, that reads the identification of devices. */
#include "client.h"

static void show(void *context, const mbm_object *object)
{
    (void)context;
    uart = object->id;
}

int main(void)
{
#ifndef WITHOUT_MBM
    static mbm_identification identification;

    identification.request.unit = 1;
    identification.request.reply = response;
    identification.request.replyBytes = sizeof response;
    identification.object = show;
    USED(&identification);
#else
    USED(show);
#endif
    begin_port();
    (void)CALL(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    for (;;) {
        every_function();
        uart = CALL(mbm_identification_read(&identification, &client, MBM_DEVICE_ID_EXTENDED, 0));
    }
}
