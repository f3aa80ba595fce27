#include "form.h"
#include "mps2.h"
#include "network.h"
#include "sockets.h"

#include "mbm_tcp.h"

#include <string.h>

const char form_name[] = "sockets";
static mbm_tcp tcp = MBM_INIT;
static mbm_tcp_addresses addresses;
static char service[8];
static device meter = {.host = "10.0.2.2"};

void form_serve(void *none)
{
    serve_sockets(none);
}

static const char *text_of(uint16_t port)
{
    char *first = service + sizeof service - 1;

    for (; port > 0; port = (uint16_t)(port / 10u))
        *--first = (char)('0' + port % 10u);
    return first;
}

void form_open(uint16_t port, mbm_port *to, mbm_linkHooks *hooks)
{
    configASSERT(mbm_tcp_openLater(&tcp, &addresses, "10.0.2.2", text_of(port)) == 0);
    *to = mbm_tcp_port(&tcp);
    *hooks = mbm_tcp_link(&tcp);
}

void form_wait(uint32_t timeoutUs)
{
    (void)mbm_tcp_wait(&tcp, 1, NULL, -1, timeoutUs);
}

void form_beginExample(uint16_t port)
{
    meter.service = text_of(port);
    (void)network_task(read_sockets, "example", &meter, 400);
}

uint32_t form_exampleReads(void)
{
    return meter.status == MBM_OK && meter.words[1] == 50 ? meter.reads : 0;
}
