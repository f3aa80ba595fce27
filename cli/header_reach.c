/* The part of a device's header on what the device needs to be reached: constants, and functions
 * that set a client and a link so. */
#include "header.h"

#include <inttypes.h>

/* The constants, without the device's name. */
static const char *const NAMES[REACH_KEYS] = {[REACH_ACCEPT] = "ACCEPT",
                                              [REACH_LENIENT] = "LENIENT",
                                              [REACH_DELAY] = "DELAY_MS",
                                              [REACH_MESSAGE_WAIT] = "MESSAGE_WAIT_MS",
                                              [REACH_CLOSE] = "CLOSE",
                                              [REACH_RETRIES] = "RETRIES",
                                              [REACH_BUSY_RETRIES] = "BUSY_RETRIES",
                                              [REACH_BUSY_WAIT] = "BUSY_WAIT_MS",
                                              [REACH_TIMEOUT] = "TIMEOUT_MS"};

/* What the functions call, in this order: last what the frames of a client may not have. */
typedef struct setting {
    uint8_t key;
    uint8_t of_link;
    const char *function;
} setting;

static const setting SETTINGS[] = {{REACH_TIMEOUT, 0, "mbm_client_setResponseTimeout"},
                                   {REACH_RETRIES, 0, "mbm_client_setRetries"},
                                   {REACH_BUSY_RETRIES, 0, "mbm_client_setBusyRetries"},
                                   {REACH_MESSAGE_WAIT, 0, "mbm_client_setMessageWait"},
                                   {REACH_LENIENT, 0, "mbm_client_setLenient"},
                                   {REACH_ACCEPT, 0, "mbm_client_setAccept"},
                                   {REACH_DELAY, 1, "mbm_link_setDelayAfterConnect"},
                                   {REACH_CLOSE, 1, "mbm_link_setClose"}};
enum { SETTING_COUNT = sizeof SETTINGS / sizeof SETTINGS[0] };

/* What a key says; 0 is the default of client and link. */
static uint32_t value_of(const reach *of, int key)
{
    switch (key) {
    case REACH_ACCEPT: return of->accept;
    case REACH_LENIENT: return of->is_lenient;
    case REACH_DELAY: return of->delayMs;
    case REACH_MESSAGE_WAIT: return of->message_waitMs;
    case REACH_CLOSE: return reach_closes(of);
    case REACH_RETRIES: return of->retries;
    case REACH_BUSY_RETRIES: return of->busy_retries;
    case REACH_TIMEOUT: return of->timeoutMs;
    default: return reach_busy_wait(of);
    }
}

const char *header_reach_name(const header *h, int key)
{
    const reach *of = &h->of->reach;
    /* A wait of 0 is not the default, but counts only with repetitions. */
    const int is_there = value_of(of, key == REACH_BUSY_WAIT ? REACH_BUSY_RETRIES : key) != 0;

    return is_there ? NAMES[key] : NULL;
}

/* Writes the names of two bits, or of one. */
static void write_bits(const header *h, uint32_t bits, const char *one, const char *two)
{
    if (bits == 3)
        fprintf(h->out, "(%s | %s)\n", one, two);
    else
        fprintf(h->out, "%s\n", bits == 1 ? one : two);
}

static void write_constants(const header *h)
{
    int key;

    for (key = 0; key < REACH_KEYS; key++) {
        const char *name = header_reach_name(h, key);
        const uint32_t value = value_of(&h->of->reach, key);

        if (!name)
            continue;
        fprintf(h->out, "#define %s_%s ", h->upper, name);
        if (key == REACH_ACCEPT)
            write_bits(h, value, "MBM_ACCEPT_UNIT", "MBM_ACCEPT_TRANSACTION");
        else if (key == REACH_CLOSE)
            write_bits(h, value, "MBM_LINK_CLOSE_WHEN_IDLE", "MBM_LINK_CLOSE_AFTER_FAILURE");
        else
            fprintf(h->out, "%" PRIu32 "u\n", value);
    }
}

/* Writes one of the functions, if a key needs it. */
static void write_function(const header *h, uint8_t of_link)
{
    const char *object = of_link ? "link" : "client";
    int i, count = 0;

    for (i = 0; i < SETTING_COUNT; i++) {
        const setting *one = &SETTINGS[i];

        if (one->of_link != of_link || !header_reach_name(h, one->key))
            continue;
        if (count++ == 0)
            fprintf(h->out,
                    "\nstatic inline uint8_t %s_configure_%s(mbm_%s *%s)\n{\n"
                    "    uint8_t status, first = MBM_OK;\n\n",
                    h->lower, object, object, object);
        fprintf(h->out, "    status = %s(%s, %s_%s", one->function, object, h->upper,
                NAMES[one->key]);
        if (one->key == REACH_BUSY_RETRIES)
            fprintf(h->out, ", %s_%s", h->upper, NAMES[REACH_BUSY_WAIT]);
        fprintf(h->out, ");\n    first = first == MBM_OK ? status : first;\n");
    }
    if (count > 0)
        fprintf(h->out, "    return first;\n}\n");
}

int header_has_reach(const header *h)
{
    int i;

    for (i = 0; i < SETTING_COUNT; i++)
        if (header_reach_name(h, SETTINGS[i].key))
            return 1;
    return 0;
}

void header_write_reach(const header *h)
{
    if (!header_has_reach(h))
        return;
    fprintf(h->out,
            "\n/* ==== Reach: what the device needs of a client and of its link ==== */\n\n"
            "#ifdef %s_PLAN\n#include \"mbm.h\"\n\n",
            h->upper);
    write_constants(h);
    fprintf(h->out,
            "\n/* Call these after the functions that begin client and link and set the baud rate. "
            "They make all\n * settings, and return the status of the first one that was refused: "
            "MBM_INVALID_ARGUMENT if the\n * frames of the client have no such setting. */\n");
    write_function(h, 0);
    write_function(h, 1);
    fprintf(h->out, "#endif\n");
}
