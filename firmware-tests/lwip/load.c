/* A server and a client over lwIP at once. The client writes a number to holding register 5 of the
 * host's unit 1, and reads the registers 0 to 9: register 1 is 50, register 5 the number. Each
 * second the program prints what it has counted. */
#include "form.h"
#include "lan9118.h"
#include "mps2.h"
#include "network.h"

enum { QUANTITY = 10, NUMBER = 5, FIFTY = 50 };

static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static mbm_clientRequest request = MBM_INIT;
static uint16_t words[QUANTITY], number;
static uint8_t is_reading;
static uint32_t right, wrong, failed, last_status;
static TaskHandle_t server_task, client_task;

static void write_next(void)
{
    is_reading = 0;
    (void)mbm_client_writeSingleRegister(&client, &request, NUMBER, ++number);
}

/* Called by mbm_client_poll. */
static void has_ended(void *context, mbm_clientRequest *ended)
{
    (void)context;
    if (ended->status != MBM_OK) {
        failed++;
        last_status = ended->status;
        write_next();
    } else if (is_reading) {
        /* The number of another write is wrong, too. */
        if (words[1] == FIFTY && words[NUMBER] == number)
            right++;
        else
            wrong++;
        write_next();
    } else {
        is_reading = 1;
        (void)mbm_client_readHoldingRegisters(&client, ended, 0, QUANTITY);
    }
}

static void ask(void *none)
{
    mbm_port port;
    mbm_linkHooks hooks;

    (void)none;
    form_open((uint16_t)HOST_PORT, &port, &hooks);
    (void)mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    (void)mbm_client_setResponseTimeout(&client, 1000);
    (void)mbm_link_begin(&kept, &client, &hooks);
    (void)mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 50, 500);
    (void)mbm_link_setConnectTimeout(&kept, 2000);
    (void)mbm_link_setRequestsWait(&kept, 1);
    request.unit = 1;
    request.reply = words;
    request.replyBytes = sizeof words;
    request.done = has_ended;
    write_next();
    for (;;) {
        (void)mbm_client_poll(&client);
        form_wait(mbm_client_pollDelay(&client));
    }
}

static void say(const char *what, uint32_t count)
{
    mps2_print(what);
    mps2_printNumber(count);
}

static void count(void *none)
{
    (void)none;
    for (;;) {
        say("right ", right);
        say(" wrong ", wrong);
        say(" failed ", failed);
        say(" last ", last_status);
        say(" example ", form_exampleReads());
        say(" lost ", lan9118_lost);
        say(" server ", network_stackUsed(server_task));
        say(" client ", network_stackUsed(client_task));
        say(" lwip ", network_stackUsed(network_lwip));
        say(" driver ", network_stackUsed(network_driver));
        say(" heap ", configTOTAL_HEAP_SIZE - (uint32_t)xPortGetMinimumEverFreeHeapSize());
        mps2_print("\n");
        vTaskDelay(pdMS_TO_TICKS(500));
    }
}

static void begin(void *none)
{
    (void)none;
    server_task = network_task(form_serve, "server", NULL, 400);
    if (HOST_PORT != 0) {
        client_task = network_task(ask, "client", NULL, 400);
        form_beginExample((uint16_t)HOST_PORT);
    } else {
        client_task = server_task;
    }
    (void)network_task(count, "count", NULL, 200);
    mps2_print(form_name);
    mps2_print(": ready\n");
}

int main(void)
{
    network_begin(begin);
    vTaskStartScheduler();
    return 1;
}
