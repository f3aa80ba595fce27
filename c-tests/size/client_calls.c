/* A client that reads holding registers, and makes one call that most programs do without. A macro
 * on the compiler's command line chooses the call; without one there is none. The client has the
 * frames of an RTU line, with TCP those of Modbus TCP; with LINK it has a link, with PLAN a plan.
 */
#include "client.h"

#ifdef LINK
static mbm_link kept;

static mbm_linkHooks hooks;

static uint8_t connect_line(void *context)
{
    (void)context;
    return uart;
}
#endif

#ifdef PLAN
enum { FIELDS = 2 };

static const mbm_planField fields[FIELDS] = {
    {.unit = 1, .table = MBM_TABLE_HOLDING_REGISTERS, .type = MBM_TYPE_INT16, .intervalMs = 1000},
    {.unit = 1,
     .table = MBM_TABLE_HOLDING_REGISTERS,
     .type = MBM_TYPE_INT16,
     .address = 1,
     .intervalMs = 1000}};
static const uint16_t counts[1] = {FIELDS};
static mbm_planPosition positions[FIELDS];
static mbm_planRead reads[FIELDS];
static uint16_t data[WORDS];
static const mbm_planSetup setup = PLAN_SETUP(fields, .readCount = 1);
static const mbm_planConversion conversion = {
    .offset = -40, .powerField = 1, .flags = MBM_CONVERSION_POWER | MBM_CONVERSION_STANDARD};
static mbm_plan plan;
static int32_t whole;
static double number;
#endif

#ifdef SPLITTING
static uint16_t blocks[FIELDS];
static mbm_planSplitting splitting = {.blocks = blocks, .readCount = FIELDS};
#define POLL mbm_plan_pollSplitting(&plan, &splitting)
#else
#define POLL mbm_plan_poll(&plan)
#endif

#if defined(CONVERTED)
#define ONE_MORE mbm_plan_getConverted(&plan, 0, 0, &conversion, &number)
#elif defined(DECIMAL)
#define ONE_MORE mbm_plan_getDecimal(&plan, 0, 0, &conversion, 1, &whole)
#elif defined(AVAILABLE)
#define ONE_MORE mbm_plan_checkAvailable(&plan, 0, 0, &conversion)
#elif defined(CLIENT_LENIENT)
#define ONE_MORE mbm_client_setLenient(&client, 1)
#elif defined(ACCEPT)
#define ONE_MORE mbm_client_setAccept(&client, MBM_ACCEPT_UNIT | MBM_ACCEPT_TRANSACTION)
#elif defined(MESSAGE_WAIT)
#define ONE_MORE mbm_client_setMessageWait(&client, 50)
#elif defined(BUSY_RETRIES)
#define ONE_MORE mbm_client_setBusyRetries(&client, 3, 100)
#elif defined(CLOSE)
#define ONE_MORE mbm_link_setClose(&kept, MBM_LINK_CLOSE_WHEN_IDLE)
#elif defined(DELAY)
#define ONE_MORE mbm_link_setDelayAfterConnect(&kept, 2000)
#else
#define ONE_MORE 0
#endif

int main(void)
{
    begin_port();
#ifdef TCP
    static uint8_t outgoing[MBM_FRAME_BYTES(WORDS)];

    uart = mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing);
#else
    uart = mbm_client_beginRtu(&client, &port, frame, sizeof frame);
#endif
#ifdef LINK
    hooks.connect = connect_line;
    uart = mbm_link_begin(&kept, &client, &hooks);
#endif
#ifdef PLAN
    USED(&setup);
    USED(&conversion);
    USED(&whole);
    USED(&number);
    uart = mbm_plan_beginGrouped(&plan, &client, &setup, counts, NULL);
#endif
    uart = ONE_MORE;
    request.unit = 1;
    request.reply = response;
    request.replyBytes = sizeof response;
    for (;;) {
#ifdef PLAN
        uart = POLL;
#else
        uart = mbm_client_readHoldingRegisters(&client, &request, 2, 10);
#endif
        uart = mbm_client_poll(&client);
    }
}
