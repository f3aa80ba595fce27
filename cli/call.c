/* mbm call: sends any request. */
#include "advice.h"
#include "line.h"
#include "numbers.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

enum { MBAP = 7 };

typedef struct call {
    line at;
    place where;
    /* Frames of Modbus TCP: the PDUs after a header, for mbm_frame_text. */
    uint8_t asked[MBAP + MBM_MAX_PDU], answered[MBAP + MBM_MAX_PDU];
    size_t length;
} call;

static error_t parse(int key, char *text, struct argp_state *state)
{
    call *c = (call *)state->input;
    const char *wrong;

    switch (key) {
    case ARGP_KEY_ARG:
        if (state->arg_num == 0) {
            options_place(state, &c->where, text, 0);
            return 0;
        }
        wrong = number_hex(text, c->asked + MBAP, MBM_MAX_PDU, &c->length);
        if (wrong)
            options_wrong(state, "HEX %s", wrong);
        return 0;
    case ARGP_KEY_SUCCESS:
        if (c->length == 0)
            options_wrong(state, "%s is missing", c->where.text ? "HEX" : "LINE");
        options_check_unit(state, &c->where, 1);
        if (c->asked[MBAP] == 0 || c->asked[MBAP] > 127)
            options_wrong(state, "HEX begins with %02X: a function code is 01 to 7F",
                          c->asked[MBAP]);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {
    {.argp = &options_unit}, {.argp = &options_client}, {0}};

static const struct argp arguments = {
    .parser = parse,
    .args_doc = "LINE HEX...",
    .doc =
        "Sends a request that is given as a PDU in hexadecimal bytes, function code first, without unit "
        "and checksum. Prints the PDU of the response in hexadecimal, and in words.\v"
        "Example: read two holding registers from address 100 (hexadecimal 64) on\n\n"
        "  mbm call tcp://192.168.0.7 --unit 17 03 00 64 00 02\n\n" PLACE_HELP,
    .children = children};

/* Sends a request that mbm understands, or, if it breaks a rule of its function, as it is. */
static uint8_t queue(call *c, mbm_clientRequest *request)
{
    static const mbm_rule any_length = {.kind = MBM_RULE_SILENCE};
    const uint16_t bytes = (uint16_t)(c->length - 1);
    const uint8_t *const pdu = c->asked + MBAP;
    /* A count of 6 is too small for records: mbm_client_forward would add one. */
    const int lacks_count =
        bytes > 0 && pdu[1] == 6 &&
        (pdu[0] == MBM_FC_READ_FILE_RECORD || pdu[0] == MBM_FC_WRITE_FILE_RECORD);

    if (!lacks_count &&
        mbm_client_forward(&c->at.client, request, pdu[0], pdu + 1, bytes) == MBM_PENDING)
        return MBM_PENDING;
    request->data = c->asked + MBAP + 1;
    return mbm_client_custom(&c->at.client, request, c->asked[MBAP], bytes, &any_length);
}

/* The PDU in hexadecimal and in words. */
static void describe(uint8_t *frame, uint16_t bytes, uint8_t kind, char *hex, char *words)
{
    const mbm_framing framing = {.kind = MBM_FRAMING_TCP};
    uint16_t i;

    *hex = '\0';
    for (i = 0; i < bytes; i++)
        sprintf(hex + 3 * i, i + 1 < bytes ? "%02X " : "%02X", frame[MBAP + i]);
    frame[5] = (uint8_t)(bytes + 1);
    frame[4] = (uint8_t)((bytes + 1) >> 8);
    frame[6] = options.unit;
    (void)mbm_frame_text(&framing, kind, frame, (uint16_t)(MBAP + bytes), words, 2400);
}

/* True unless no device answers the request: a broadcast, or Force Listen Only Mode. */
static int has_reply(call *c)
{
    static const uint8_t listen_only[] = {8, 0, MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY};

    return !(options.unit == 0 && place_is_serial(&c->where)) &&
           !(c->length > sizeof listen_only &&
             !memcmp(c->asked + MBAP, listen_only, sizeof listen_only));
}

static void show(call *c, const mbm_clientRequest *request)
{
    char hex[3 * MBM_MAX_PDU + 1], words[2400], status[256];
    uint16_t bytes = 0;
    cJSON *all;

    if (request->exception != 0) {
        c->answered[MBAP] = c->asked[MBAP] | 0x80;
        c->answered[MBAP + 1] = request->exception;
        bytes = 2;
    } else if (request->status == MBM_OK && has_reply(c)) {
        c->answered[MBAP] = c->asked[MBAP];
        bytes = (uint16_t)(1 + request->length);
    }
    if (!options.is_json) {
        describe(c->answered, bytes, MBM_PACKET_RESPONSE, hex, words);
        if (bytes > 0)
            printf("%s\n%s\n", hex, words);
        else if (request->status == MBM_OK && !options.is_quiet)
            printf("sent; no device answers this request\n");
        return;
    }
    all = cJSON_CreateObject();
    cJSON_AddNumberToObject(all, "unit", options.unit);
    describe(c->asked, (uint16_t)c->length, MBM_PACKET_REQUEST, hex, words);
    cJSON_AddStringToObject(all, "request", hex);
    describe(c->answered, bytes, MBM_PACKET_RESPONSE, hex, words);
    if (bytes > 0) {
        cJSON_AddStringToObject(all, "response", hex);
        cJSON_AddStringToObject(all, "words", words);
    }
    report_json(all, request->status, request->exception, line_status(&c->at, request, status));
}

int call_command(int argc, char **argv)
{
    static call data;
    call *c = &data;
    mbm_clientRequest request = {.reply = c->answered + MBAP + 1, .replyBytes = MBM_MAX_PDU - 1};

    argp_parse(&arguments, argc, argv, 0, NULL, c);
    request.unit = options.unit;
    if (line_open(&c->at, &c->where) == CODE_DONE && line_connect(&c->at) == CODE_DONE) {
        request.status = line_call(&c->at, &request, queue(c, &request));
        if (request.status != MBM_OK)
            (void)line_failure(&c->at, &request, ADVICE_CALL);
        show(c, &request);
    }
    line_close(&c->at);
    return report_code;
}
