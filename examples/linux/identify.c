/* Shows what a device says about itself: all objects of function 2B/0E, the server id of
 * function 11 and the counters of 0B.
 *
 *     identify rtu:/dev/ttyUSB0,19200 -u 17
 *     identify tcp:192.168.0.7 -u 17 -c basic
 *
 * -c is the category of objects: basic, regular or extended (all). What the device does not
 * have is left out, with the reason on stderr.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "line.h"
#include "mbm_call.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static line at;
static uint8_t reply[250], pdu[MBM_MAX_PDU];
static mbm_identification identification = {
    .request = {.unit = 1, .reply = reply, .replyBytes = sizeof reply}};
static mbm_clientRequest request = {.unit = 1, .reply = reply, .replyBytes = sizeof reply};

static const char USAGE[] = "identify PLACE [options]\n"
                            "  -u UNIT      1 if left out\n"
                            "  -c CATEGORY  basic, regular or extended, extended if left out";

/* Prints bytes as text, and those that are none as \x and two digits. */
static void print_text(const uint8_t *bytes, uint16_t length)
{
    uint16_t i;

    for (i = 0; i < length; i++)
        if (isprint(bytes[i]) && bytes[i] != '\\')
            putchar(bytes[i]);
        else
            printf("\\x%02X", bytes[i]);
    putchar('\n');
}

static void print_object(void *context, const mbm_object *object)
{
    static const char *const names[] = {"vendor name",  "product code", "revision",   "vendor URL",
                                        "product name", "model name",   "application"};

    (void)context;
    if (object->id < sizeof names / sizeof names[0])
        printf("%s: ", names[object->id]);
    else
        printf("object %02X: ", object->id);
    print_text(object->data, object->length);
}

static mbm_caller caller_of(mbm_clientRequest *r)
{
    mbm_caller caller = at.is_tcp ? mbm_call_overTcp(&at.tcp, &at.client, r)
                                  : mbm_call_overTty(&at.tty, &at.client, r);

    caller.stop = &line_ended;
    return caller;
}

/* Waits for a request, and prints why it failed. */
static int succeeds(const char *what, mbm_clientRequest *r, uint8_t queued)
{
    const mbm_caller caller = caller_of(r);
    const uint8_t status = mbm_call(&caller, queued);

    if (status != MBM_OK)
        fprintf(stderr, "%s: %s\n", what, mbm_status_text(status));
    return status == MBM_OK;
}

static int identify(uint8_t category)
{
    mbm_packet packet;
    int found = 0;

    identification.object = print_object;
    if (succeeds("identification", &identification.request,
                 mbm_identification_read(&identification, &at.client, category, 0)))
        found++;
    if (succeeds("server id", &request, mbm_client_reportServerId(&at.client, &request)) &&
        mbm_client_reply(&request, pdu, sizeof pdu, &packet) == MBM_OK) {
        printf("server id: ");
        print_text(packet.data, packet.dataLength);
        found++;
    }
    if (succeeds("event counter", &request, mbm_client_getCommEventCounter(&at.client, &request)) &&
        mbm_client_reply(&request, pdu, sizeof pdu, &packet) == MBM_OK) {
        printf("events: %u%s\n", packet.eventCount, packet.commStatus ? ", busy" : "");
        found++;
    }
    return found;
}

int main(int argc, char **argv)
{
    static const char *const categories[] = {"", "basic", "regular", "extended"};
    uint8_t category = MBM_DEVICE_ID_EXTENDED;
    int option, found;

    if (line_wants_help(argc, argv))
        return line_usage(0, USAGE);
    while ((option = getopt(argc, argv, "u:c:")) != -1) {
        if (option == 'u')
            request.unit = (uint8_t)line_number(optarg, 1, 255);
        else if (option == 'c')
            for (category = MBM_DEVICE_ID_EXTENDED;
                 category > 0 && strcmp(optarg, categories[category]) != 0; category--) {
            }
        if (option == '?' || category == 0)
            return line_usage(1, USAGE);
    }
    if (argc != optind + 1)
        return line_usage(1, USAGE);
    if (line_open(&at, argv[optind]) != 0 || line_connect(&at) != 0)
        return 1;
    identification.request.unit = request.unit;
    found = identify(category);
    line_close(&at);
    return found ? 0 : 1;
}
