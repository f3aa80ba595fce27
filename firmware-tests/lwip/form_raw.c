#include "form.h"
#include "mps2.h"
#include "network.h"

#include "mbm_lwip.h"

enum { PLACES = 4, REGISTERS = 10, IDLE_TIME_MS = 60000 };

const char form_name[] = "raw";
static uint16_t words[REGISTERS];
static mbm_registerTable holding = {.words = words, .size = REGISTERS};
static mbm_unit unit = {.id = 1};
static mbm_lwip_listener listener = {.idleTimeMs = IDLE_TIME_MS, .isTask = 1};
static mbm_lwip places[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static mbm_lwip host = MBM_INIT;

/* Called by lwIP: wakes the task of a connection. */
static void wake(void *task)
{
    xTaskNotifyGive((TaskHandle_t)task);
}

static void sleep_for(uint32_t timeoutUs)
{
    (void)ulTaskNotifyTake(pdTRUE,
                           timeoutUs == UINT32_MAX
                               ? portMAX_DELAY
                               : (TickType_t)(timeoutUs / 1000u + (timeoutUs % 1000u != 0)));
}

void form_serve(void *none)
{
    uint32_t sleep, delay;
    int i;

    (void)none;
    (void)mbm_unit_serveHoldingRegisters(&unit, &holding);
    listener.ready = wake;
    listener.context = xTaskGetCurrentTaskHandle();
    for (i = 0; i < PLACES; i++) {
        places[i].ready = wake;
        places[i].context = listener.context;
    }
    while (mbm_lwip_listen(&listener, NULL, MBM_LWIP_PORT, places, PLACES) != MBM_OK)
        vTaskDelay(1000);
    for (;;) {
        while ((i = mbm_lwip_accept(&listener)) >= 0) {
            const mbm_port port = mbm_lwip_port(&places[i]);

            (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]);
        }
        sleep = UINT32_MAX;
        for (i = 0; i < PLACES; i++) {
            if (!mbm_lwip_isInUse(&places[i]))
                continue;
            if (mbm_server_poll(&servers[i]) != MBM_OK) {
                mbm_lwip_close(&places[i]);
                sleep = 0;
                continue;
            }
            delay = mbm_server_pollDelay(&servers[i]);
            sleep = delay < sleep ? delay : sleep;
        }
        sleep_for(sleep);
    }
}

void form_open(uint16_t port, mbm_port *to, mbm_linkHooks *hooks)
{
    ip_addr_t address;

    IP_ADDR4(&address, 10, 0, 2, 2);
    host.ready = wake;
    host.context = xTaskGetCurrentTaskHandle();
    host.isTask = 1;
    (void)mbm_lwip_open(&host, &address, port);
    *to = mbm_lwip_port(&host);
    *hooks = mbm_lwip_link(&host);
}

void form_wait(uint32_t timeoutUs)
{
    sleep_for(timeoutUs);
}

void form_beginExample(uint16_t port)
{
    (void)port;
}

uint32_t form_exampleReads(void)
{
    return 0;
}
