/* Reads a holding register of each of many devices every second, in one process.
 *
 *     many_devices COUNT HOST PORT...
 *
 * Device 0 is at the first port, device 1 at the second, after the last at the first again.
 * Register N of device N is read. Prints values that have changed, and devices lost and back.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_loop.h"

#include <stdio.h>
#include <stdlib.h>

enum { UNIT = 17, MOST = 10000 };

typedef struct device {
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    mbm_client client;
    mbm_link link;
    mbm_plan plan;
    mbm_planField field;
    mbm_planPosition position;
    mbm_planRead read;
    mbm_planSetup setup;
    mbm_clientRequest request;
    mbm_loop_planned planned;
    mbm_loop_entry entry;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    uint16_t data, shown; /* 0 at first */
    uint8_t status;       /* of the last read */
} device;

static device devices[MOST];
static mbm_loop loop = MBM_INIT;
static mbm_loop_place places[MOST];

static void updated(void *context, mbm_plan *plan, uint16_t field)
{
    device *d = (device *)context;
    const uint8_t status = mbm_plan_getStatus(plan, field, NULL);
    const int number = (int)(d - devices);

    if (status != MBM_OK && status != d->status)
        printf("device %d: lost: %s\n", number,
               d->tcp.error ? mbm_tcp_text(&d->tcp) : mbm_status_text(status));
    if (status == MBM_OK && d->status != MBM_OK)
        printf("device %d: back\n", number);
    if (status == MBM_OK && d->data != d->shown)
        printf("device %d: %u\n", number, d->data);
    d->shown = d->data;
    d->status = status;
}

static int begin_device(device *d, const char *host, const char *service)
{
    const mbm_port port = mbm_tcp_port(&d->tcp);
    const mbm_linkHooks hooks = mbm_tcp_link(&d->tcp);

    d->field = (mbm_planField){.unit = UNIT,
                               .table = MBM_TABLE_HOLDING_REGISTERS,
                               .type = MBM_TYPE_UINT16,
                               .address = (uint16_t)(d - devices),
                               .intervalMs = 1000};
    d->setup = (mbm_planSetup){.fields = &d->field,
                               .positions = &d->position,
                               .reads = &d->read,
                               .data = &d->data,
                               .requests = &d->request,
                               .update = updated,
                               .context = d};
    d->setup.fieldCount = d->setup.readCount = d->setup.dataWords = d->setup.requestCount = 1;
    d->planned = (mbm_loop_planned){&d->client, &d->plan};
    d->entry.poll = mbm_loop_pollPlan;
    d->entry.context = &d->planned;
    return mbm_tcp_openLater(&d->tcp, &d->addresses, host, service) == 0 &&
           mbm_client_beginTcp(&d->client, &port, d->incoming, sizeof d->incoming, d->outgoing,
                               sizeof d->outgoing) == MBM_OK &&
           mbm_link_begin(&d->link, &d->client, &hooks) == MBM_OK &&
           mbm_plan_begin(&d->plan, &d->client, &d->setup, NULL) == MBM_OK &&
           mbm_loop_addTcp(&loop, &d->entry, &d->tcp) == 0;
}

int main(int argc, char **argv)
{
    int count = argc > 3 ? atoi(argv[1]) : 0, i;

    if (count < 1 || count > MOST || mbm_loop_open(&loop, places, MOST) != 0) {
        fprintf(stderr, "usage: many_devices COUNT HOST PORT...\n");
        return 2;
    }
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    for (i = 0; i < count; i++)
        if (!begin_device(&devices[i], argv[2], argv[3 + i % (argc - 3)]))
            return 1;
    while (mbm_loop_wait(&loop, MBM_LOOP_FOREVER) >= 0)
        ;
    return 1;
}
