/* What a device needs that deviates from the standard, or that needs time: in the name of a line,
 * as options, at the head of a device file, and in the file of a bridge or gateway. */
#pragma once

#include "mbm.h"
#include "yaml_file.h"

#include <stdint.h>

enum {
    REACH_ACCEPT,
    REACH_LENIENT,
    REACH_DELAY,
    REACH_MESSAGE_WAIT,
    REACH_CLOSE,
    REACH_RETRIES,
    REACH_BUSY_RETRIES,
    REACH_BUSY_WAIT,
    REACH_TIMEOUT,
    REACH_KEYS,
    /* Of files alone: message_wait as a number. */
    REACH_MILLISECONDS = REACH_KEYS,
    REACH_FILE_KEYS
};

/* Their names in files and in the names of lines; those of the options have - for _. */
#define REACH_NAMES                                                                                \
    "accept", "lenient", "delay", "message_wait", "close", "retries", "busy_retries", "busy_wait", \
        "timeout"
#define REACH_FILE_NAMES REACH_NAMES, "message_wait_milliseconds"
extern const char *const reach_names[];

/* The keys in words, for sentences. */
#define REACH_WORDS                                                                                \
    "accept, lenient, delay, message_wait, close, retries, busy_retries, busy_wait and timeout"

typedef struct reach {
    uint16_t given;     /* 1 << REACH_..., of what was said */
    uint8_t accept;     /* MBM_ACCEPT_ */
    uint8_t is_lenient; /* replies with too many data are accepted */
    uint8_t close;      /* MBM_LINK_CLOSE_ */
    uint8_t retries, busy_retries;
    uint32_t delayMs;        /* after connecting */
    uint32_t message_waitMs; /* between requests */
    uint32_t busy_waitMs;
    uint32_t timeoutMs; /* of a reply */
} reach;

/* The wait before repetitions without busy_wait, and the time for a reply without timeout. */
enum { REACH_BUSY_WAIT_MS = 100, REACH_TIMEOUT_MS = 1000 };

/* Reads the value of a key. Returns NULL, or what is wrong with it, in a buffer that the next call
 * overwrites. */
const char *reach_read(reach *into, int key, const char *text);

/* Reads the keys of a file, which are REACH_FILE_NAMES: accept and close may be lists. Returns 0
 * after a refusal. */
int reach_read_nodes(yaml_file *file, const yaml_node_t *const *values, reach *into);

/* Takes from `from` what `into` does not say. */
void reach_fill(reach *into, const reach *from);

/* When a link closes, MBM_LINK_CLOSE_; how long to wait before a busy device is asked again, and
 * how long a reply may take, in milliseconds. */
uint8_t reach_closes(const reach *of);
uint32_t reach_busy_wait(const reach *of);
uint32_t reach_timeout(const reach *of);

/* Whether a key was said. */
int reach_has(const reach *of, int key);

/* What a line can do with it. */
typedef struct reach_line {
    uint8_t framing;    /* one of MBM_FRAMING_ */
    uint8_t has_link;   /* it is opened and closed: not of UDP */
    uint32_t in_flight; /* requests in flight at once */
} reach_line;

/* Returns NULL, or why a line cannot have what is said, in a buffer that the next call overwrites.
 * `dash` is before the names: "--", or nothing. */
const char *reach_check(const reach *of, const reach_line *line, const char *dash);

/* Leaves out what the line cannot have: a device file may say it, since the same device may be on a
 * line that can. Returns NULL, or a sentence about one of the keys that have no effect then. */
const char *reach_fit(reach *of, const reach_line *line);

/* Sets client and link; NULL for no link. `gapUs` is the gap of a serial line, 0: t3.5. */
void reach_set(const reach *of, mbm_client *client, mbm_link *link, const reach_line *line,
               uint32_t gapUs);
