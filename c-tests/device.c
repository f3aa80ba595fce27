/* A program from the header that mbm header writes: a client with a plan, and a server with its
 * tables. tests/tool/test_header.py compiles it for each device of examples/devices and holds it
 * against mbm serve and mbm poll.
 *
 *     device poll HOST PORT     reads every field once, and prints the values of each in a line
 *     device serve PORT         serves the values of the device file; PORT 0 takes a free one
 *
 * HEADER is the header in quotes, UPPER and LOWER are the device's name in C. CONVERSIONS is
 * defined if the header has any, and REACH if the device needs something of a client and a link.
 * MORE is a file in quotes with a function print_more, which takes the plan that has been read.
 *
 * Licence: MIT OR Apache-2.0. */
#define JOIN(one, other) one##_##other
#define NAME(one, other) JOIN(one, other)
#include HEADER
#include "mbm_tcp.h"

#include <stdio.h>
#include <string.h>

enum {
    FIELDS = NAME(UPPER, FIELDS),
    READS = NAME(UPPER, READS),
    WORDS = NAME(UPPER, DATA_WORDS),
    PATIENCE = 20000000
};

/* --- a client --- */

static mbm_tcp tcp = MBM_INIT;
static mbm_client client = MBM_INIT;
static mbm_link kept = MBM_INIT;
static mbm_plan plan = MBM_INIT;
static mbm_planPosition positions[FIELDS];
static mbm_planRead reads[READS];
static uint16_t words[WORDS];
static mbm_clientRequest request = MBM_INIT;
static const mbm_planSetup setup = {.fields = NAME(LOWER, fields),
                                    .positions = positions,
                                    .reads = reads,
                                    .data = words,
                                    .requests = &request,
                                    .fieldCount = FIELDS,
                                    .readCount = READS,
                                    .dataWords = WORDS,
                                    .requestCount = 1};

static int is_every_field_read(void)
{
    uint16_t i;

    for (i = 0; i < FIELDS; i++)
        if (mbm_plan_getStatus(&plan, i, NULL) == MBM_PENDING)
            return 0;
    return 1;
}

/* Returns 0 if the header has no conversion for the field. */
static int get_converted(uint16_t field, uint16_t index, double *number)
{
#ifdef CONVERSIONS
    const mbm_planConversion *with = NAME(LOWER, conversions)[field];

    return with && mbm_plan_getConverted(&plan, field, index, with, number) == MBM_OK;
#else
    (void)field;
    (void)index;
    (void)number;
    return 0;
#endif
}

static void print_field(uint16_t field)
{
    const mbm_planField *of = &NAME(LOWER, fields)[field];
    const int is_number = of->type == MBM_TYPE_BIT && of->table >= MBM_TABLE_HOLDING_REGISTERS;
    const uint8_t status = mbm_plan_getStatus(&plan, field, NULL);
    uint16_t i, count = is_number ? 1 : of->count;
    char text[251] = "";
    int64_t integer;
    double number;

    if (status != MBM_OK) {
        printf("%s\n", mbm_status_text(status));
        return;
    }
    if (of->type == MBM_TYPE_TEXT) {
        (void)mbm_plan_getText(&plan, field, text, sizeof text);
        printf("%s\n", text);
        return;
    }
    for (i = 0; i < count; i++) {
        if (get_converted(field, i, &number))
            printf("%.17g", number);
        else if (of->divisor == 0 && mbm_plan_getInteger(&plan, field, i, &integer) == MBM_OK)
            printf("%lld", (long long)integer);
        else if (mbm_plan_getNumber(&plan, field, i, &number) == MBM_OK)
            printf("%.17g", number);
        printf("%s", i + 1 < count ? " " : "\n");
    }
}

#ifdef MORE
#include MORE
#endif

/* Whether a plan with one read or one word of data less is refused, as it must be. */
static int is_storage_exact(void)
{
    mbm_planSetup less = setup;
    mbm_plan other = MBM_INIT;

    less.readCount--;
    if (mbm_plan_beginGrouped(&other, &client, &less, NAME(LOWER, counts), NULL) == MBM_OK)
        return 0;
    less = setup;
    less.dataWords--;
    return mbm_plan_beginGrouped(&other, &client, &less, NAME(LOWER, counts), NULL) != MBM_OK;
}

/* Sets client and link as the device needs them. Returns a status. */
static uint8_t configure(void)
{
#ifdef REACH
    const uint8_t status = NAME(LOWER, configure_client)(&client);

    return status == MBM_OK ? NAME(LOWER, configure_link)(&kept) : status;
#else
    return MBM_OK;
#endif
}

static int poll_device(const char *host, const char *service)
{
    const mbm_port port = mbm_tcp_port(&tcp);
    const uint32_t begin = port.micros(port.context);
    const mbm_linkHooks hooks = mbm_tcp_link(&tcp);
    static mbm_tcp_addresses addresses;
    static uint8_t incoming[1024], outgoing[1024];
    uint16_t i, wrong = 0;

    if (mbm_tcp_openLater(&tcp, &addresses, host, service) != 0) {
        perror(host);
        return 1;
    }
    if (mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing) !=
            MBM_OK ||
        mbm_link_begin(&kept, &client, &hooks) != MBM_OK || configure() != MBM_OK ||
        !is_storage_exact() ||
        mbm_plan_beginGrouped(&plan, &client, &setup, NAME(LOWER, counts), &wrong) != MBM_OK) {
        fprintf(stderr, "field %u is refused\n", wrong);
        return 1;
    }
    while (!is_every_field_read() && port.micros(port.context) - begin < PATIENCE) {
        (void)mbm_plan_poll(&plan);
        (void)mbm_client_poll(&client);
        mbm_tcp_wait(&tcp, 1, NULL, -1, 1000);
    }
    for (i = 0; i < FIELDS; i++)
        print_field(i);
#ifdef MORE
    print_more(&plan);
#endif
    mbm_tcp_close(&tcp);
    return 0;
}

/* --- a server --- */

enum { PLACES = 4 };

static mbm_tcp_listener listener = MBM_INIT;
static mbm_tcp places[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static mbm_unit unit = {.id = NAME(UPPER, UNIT)};
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

static int serve_device(const char *service)
{
    int i;

    NAME(LOWER, initialise)();
    if (NAME(LOWER, serve)(&unit) != MBM_OK || mbm_tcp_listen(&listener, NULL, service) != 0) {
        perror(service);
        return 1;
    }
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    printf("ready %u\n", listener.port);
    for (;;) {
        mbm_tcp_wait(places, PLACES, &listener, -1, MBM_TCP_FOREVER);
        while ((i = mbm_tcp_accept(&listener, places, PLACES)) >= 0) {
            const mbm_port port = mbm_tcp_port(&places[i]);

            (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME);
        }
        for (i = 0; i < PLACES; i++)
            if (mbm_tcp_isInUse(&places[i]) && mbm_server_poll(&servers[i]) != MBM_OK)
                mbm_tcp_close(&places[i]);
    }
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "poll") == 0)
        return poll_device(argv[2], argv[3]);
    if (argc == 3 && strcmp(argv[1], "serve") == 0)
        return serve_device(argv[2]);
    fprintf(stderr, "usage: device poll HOST PORT, or device serve PORT\n");
    return 2;
}
